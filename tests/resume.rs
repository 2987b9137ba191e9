//! A run that ends early and goes on has the bits of one that nothing disturbed, for every kind that steps.

use driftmesh::error::Unfit;
use driftmesh::output::{RunDirectory, Standing};
use driftmesh::simulation::{Event, Observer, Snapshot};
use driftmesh::study::{Begin, Source, Study};
use driftmesh::{Error, Result};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

fn study(name: &str, assignments: &[&str]) -> Study {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("studies").join(format!("{name}.toml"));
    let mut source = Source::read(&file).unwrap();
    let quick = ["output.report=false", "output.frames.every=3", "output.checkpoint.steps=2"];
    assignments.iter().chain(&quick).for_each(|assignment| source.set(assignment).unwrap());
    Study::from_source(&source).unwrap()
}

/// Asks the run to end after a step, counted from where it began.
struct After {
    steps: usize,
    seen: usize,
    begun: Option<Event>,
}

impl After {
    fn steps(steps: usize) -> Self {
        Self { steps, seen: 0, begun: None }
    }
}

impl Observer for After {
    fn observe(&mut self, event: Event, _: &Snapshot<'_>) -> Result<()> {
        self.begun.get_or_insert(event);
        self.seen += usize::from(event == Event::Stepped);
        Ok(())
    }

    fn interrupts(&self) -> bool {
        self.seen >= self.steps
    }
}

/// What a run leaves, but for the time that it took.
fn left(directory: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut files = BTreeMap::new();
    for folder in [directory.to_path_buf(), directory.join("frames"), directory.join("compare")] {
        for path in std::fs::read_dir(folder).into_iter().flatten().map(|entry| entry.unwrap().path()) {
            if path.is_file() {
                let name = path.strip_prefix(directory).unwrap().to_path_buf();
                files.insert(name.clone(), untimed(&name, std::fs::read(&path).unwrap()));
            }
        }
    }
    files
}

fn untimed(name: &Path, bytes: Vec<u8>) -> Vec<u8> {
    match name.to_str() {
        Some("history.csv") => {
            let text = String::from_utf8(bytes).unwrap();
            let at = text.lines().next().unwrap_or_default().split(',').position(|column| column == "seconds");
            let row = |row: &str| {
                let columns = row.split(',').enumerate().filter(|(column, _)| Some(*column) != at);
                columns.map(|(_, entry)| entry).collect::<Vec<_>>().join(",")
            };
            text.lines().map(row).collect::<Vec<_>>().join("\n").into()
        }
        Some("summary.json") => {
            let mut summary: serde_json::Value = serde_json::from_slice(&bytes).unwrap();
            summary.as_object_mut().unwrap().remove("seconds");
            summary.to_string().into()
        }
        // it has the seconds that the run took
        Some("final.state") => Vec::new(),
        _ => bytes,
    }
}

#[track_caller]
fn assert_same(whole: &Path, cut: &Path) {
    let [whole, cut] = [whole, cut].map(left);
    assert_eq!(whole.keys().collect::<Vec<_>>(), cut.keys().collect::<Vec<_>>());
    assert!(whole.contains_key(Path::new("final.npz")) && whole.keys().any(|name| name.starts_with("frames")));
    for (name, bytes) in &whole {
        assert!(*bytes == cut[name], "{} differs", name.display());
    }
}

/// Runs a study whole, and another time in parts of so many steps.
#[track_caller]
fn assert_resumes(study: &Study, parts: &[usize]) {
    let out = tempfile::tempdir().unwrap();
    let [whole, cut] = ["whole", "cut"].map(|name| out.path().join(name));
    assert!(study.run(&whole, Begin::Anew, &mut []).unwrap().is_none());
    for (part, steps) in parts.iter().enumerate() {
        let mut after = After::steps(*steps);
        let ended = study.run(&cut, Begin::Resumed, &mut [&mut after]);
        assert!(matches!(ended, Ok(Some(Error::Interrupted(_)))), "{ended:?}");
        assert_eq!(after.begun, Some(if part == 0 { Event::Started } else { Event::Resumed }));
        assert_eq!(RunDirectory::standing(&cut), Standing::Unfinished);
    }
    assert!(study.run(&cut, Begin::Resumed, &mut []).unwrap().is_none());
    assert_eq!(study.standing(&cut).unwrap(), Standing::Complete);
    assert_same(&whole, &cut);
}

const SHORT: [&str; 3] = ["grid.cells=[16,14]", "time.end=0.264", "time.report=[0.25,0.255,0.264]"];

/// Every generator, both forms of the mesh equation, prescribed and automatic steps; ended at a frame, between frames,
/// at a checkpoint, between checkpoints, at once and before the last step.
#[test]
fn every_generator_goes_on() {
    let walks = "mesh.generator={kind=\"stochastic\",subdomains=[2,3],seed=5,estimator=";
    for generator in [
        "mesh.generator={kind=\"whole\"}".to_string(),
        "mesh.generator={kind=\"schwarz\",subdomains=[2,2]}".into(),
        "mesh.generator={kind=\"fixed\"}".into(),
        format!("{walks}{{kind=\"residual-walk\"}}}}"),
        format!("{walks}{{kind=\"strip\"}}}}"),
        "mesh.generator={kind=\"schwarz\",subdomains=[2,2],method=\"optimized\",iterations=2}".into(),
        format!("{walks}{{kind=\"grid-walk\",walks=200}}}}"),
        format!("{walks}{{kind=\"monte-carlo\",paths=200,substeps=4}}}}"),
        format!("{walks}{{kind=\"monte-carlo\",paths=256,substeps=4,sobol=true}},interface={{sample=3}}}}"),
    ] {
        let sets: Vec<&str> = SHORT.into_iter().chain([generator.as_str()]).collect();
        assert_resumes(&study("burgers-b-stochastic", &sets), &[3, 0, 4, 2]);
    }
    let whole = ["mesh.form=\"conservative\"", "compare.generator.kind=whole"];
    assert_resumes(&study("burgers-b-conservative", &[&SHORT[..], &whole].concat()), &[1, 6, 5]);
}

#[test]
fn automatic_steps_go_on() {
    let short = ["grid.cells=[16,14]", "time.end=0.5", "time.report=[0.3,0.5]"];
    assert_resumes(&study("burgers", &short), &[1, 5, 2]);
    let walks = ["mesh.generator={kind=\"stochastic\",subdomains=[2,2],seed=5}", "pde.viscosity=0.005"];
    assert_resumes(&study("burgers", &[&short[..], &walks].concat()), &[4, 5]);
    assert_resumes(&study("burgers", &[&short[..], &["mesh.coupling.iterations=2"]].concat()), &[3]);
}

/// Equations with a memory of meshes, several unknowns, periodic axes, explicit steps.
#[test]
fn every_equation_goes_on() {
    let start_of = |name: &str, end: f64, more: &[&str]| {
        let (end, report) = (format!("time.end={end}"), format!("time.report=[{end}]"));
        study(name, &[&["grid.cells=[16,14]", end.as_str(), report.as_str()], more].concat())
    };
    assert_resumes(&start_of("burgers-b-advective", 0.26, &[]), &[3, 2]);
    assert_resumes(&start_of("dam-break", 0.04, &["time.step=0.005"]), &[3, 2]);
    assert_resumes(&start_of("gray-scott", 20.0, &["time.step=2"]), &[3, 2]);
    assert_resumes(&start_of("rings", 0.05, &["time.step=0.005"]), &[3, 2]);
    assert_resumes(&start_of("burgers-uniform-conservative", 0.26, &["time.step=0.001"]), &[3, 2]);
    let rk4 = ["time.stepper=\"rk4\"", "time.order=4", "time.step=0.001"];
    assert_resumes(&start_of("burgers-uniform-conservative", 0.26, &rk4), &[3, 2]);
}

#[test]
fn fronts_go_on() {
    let short = ["grid.cells=[12,6,6]", "time.end=0.09", "time.report=[0.05,0.09]"];
    assert_resumes(&study("stefan-slides", &short), &[1, 3, 2]);
    for more in [&["front.stepping=\"implicit\""][..], &["time.step=\"auto\""], &["front.transfer=\"interpolate\""]] {
        assert_resumes(&study("stefan-slides", &[&short[..], more].concat()), &[2, 3]);
    }
}

/// One dimension in time has no watcher of its steps, only one that may end it.
#[test]
fn lines_go_on() {
    struct Ends(std::cell::Cell<usize>);
    impl Observer for Ends {
        fn observe(&mut self, _: Event, _: &Snapshot<'_>) -> Result<()> {
            Ok(())
        }
        fn interrupts(&self) -> bool {
            self.0.set(self.0.get().saturating_sub(1));
            self.0.get() == 0
        }
    }
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("studies/moving-front-1d.toml");
    let divided = std::fs::read_to_string(file).unwrap().replace("end = 0.1", "end = 0.02");
    let whole =
        divided.replace("[schwarz]", "").replace("overlap = ", "# ").replace("[stop]", "").replace("tolerance", "# ");
    for text in [divided, whole] {
        let mut source = Source::new("the study", text);
        for set in ["output.report=false", "output.frames.every=3", "output.checkpoint.steps=2"] {
            source.set(set).unwrap();
        }
        let study = Study::from_source(&source).unwrap();
        let out = tempfile::tempdir().unwrap();
        let [whole, cut] = ["whole", "cut"].map(|name| out.path().join(name));
        assert!(study.run(&whole, Begin::Anew, &mut []).unwrap().is_none());
        for steps in [3, 1, 4] {
            let ended = study.run(&cut, Begin::Resumed, &mut [&mut Ends((steps + 1).into())]);
            assert!(matches!(ended, Ok(Some(Error::Interrupted(_)))), "{ended:?}");
        }
        assert!(study.run(&cut, Begin::Resumed, &mut []).unwrap().is_none());
        let [whole, cut] = [left(&whole), left(&cut)];
        assert!(
            whole.len() > 5 && whole == cut,
            "{:?}",
            whole.iter().find(|(name, bytes)| cut.get(*name) != Some(*bytes)).map(|f| f.0)
        );
    }
}

/// The newest checkpoint that will do is taken; what was refused is told.
#[test]
fn a_damaged_checkpoint_gives_way_to_the_one_before() {
    let out = tempfile::tempdir().unwrap();
    let [whole, cut] = ["whole", "cut"].map(|name| out.path().join(name));
    let study = study("burgers-b-conservative", &SHORT);
    study.run(&whole, Begin::Anew, &mut []).unwrap();
    study.run(&cut, Begin::Anew, &mut [&mut After::steps(7)]).unwrap();
    // steps 2, 4 and 6 are due, and 7 is where it ended: 6 is in .0, and 7 in .1
    let newest = cut.join("checkpoint.1");
    let bytes = std::fs::read(&newest).unwrap();
    for damaged in
        [&bytes[..bytes.len() - 1], &bytes[..40], &[], b"a text", &[&bytes[..5000], b"x", &bytes[5001..]].concat()]
    {
        std::fs::write(&newest, damaged).unwrap();
        let mut after = After::steps(0);
        study.run(&cut, Begin::Resumed, &mut [&mut after]).unwrap();
        assert_eq!(after.begun, Some(Event::Resumed));
        let history = std::fs::read_to_string(cut.join("history.csv")).unwrap();
        assert_eq!(history.lines().count(), 1 + 7, "rows up to step 6");
    }
    assert!(study.run(&cut, Begin::Resumed, &mut []).unwrap().is_none());
    let [mut whole, mut cut] = [left(&whole), left(&cut)];
    let summary = String::from_utf8(cut.remove(Path::new("summary.json")).unwrap()).unwrap();
    assert!(
        summary.contains("checkpoint.1 was left out: ") && summary.contains("went on from checkpoint.0"),
        "{summary}"
    );
    whole.remove(Path::new("summary.json"));
    assert!(whole == cut);
}

/// Checkpoints alone are enough to go on from, as far as they do not need the files beside them.
#[test]
fn a_lost_summary_is_no_lost_run() {
    let out = tempfile::tempdir().unwrap();
    let cut = out.path().join("cut");
    let study = study("burgers-b-conservative", &SHORT);
    study.run(&cut, Begin::Anew, &mut [&mut After::steps(5)]).unwrap();
    for name in ["summary.json", "study.toml"] {
        std::fs::remove_file(cut.join(name)).unwrap();
    }
    let mut after = After::steps(0);
    study.run(&cut, Begin::Resumed, &mut [&mut after]).unwrap();
    assert_eq!(after.begun, Some(Event::Resumed));
    // a file that only bears the name is somebody else's
    let theirs = out.path().join("theirs");
    std::fs::create_dir(&theirs).unwrap();
    std::fs::write(theirs.join("checkpoint.0"), "weights of a network").unwrap();
    let refused = study.run(&theirs, Begin::Resumed, &mut []);
    assert!(matches!(refused, Err(Error::ForeignDirectory { .. })), "{refused:?}");
}

/// What is no checkpoint of this study is refused, each by name, and nothing is touched.
#[test]
fn foreign_checkpoints_are_refused() {
    let out = tempfile::tempdir().unwrap();
    let cut = out.path().join("cut");
    let ours = study("burgers-b-conservative", &SHORT);
    ours.run(&cut, Begin::Anew, &mut [&mut After::steps(5)]).unwrap();
    let before = left(&cut);
    let unfit = |study: &Study| match study.run(&cut, Begin::Resumed, &mut []) {
        Err(error @ Error::Checkpoint { .. }) => {
            assert!(!error.is_failure() && error.help().is_some());
            error.to_string()
        }
        other => panic!("{other:?}"),
    };
    for (set, expected) in [
        ("pde.viscosity=0.006", "`pde.viscosity` is 0.005; here it is 0.006"),
        ("mesh.generator={kind=\"fixed\"}", "`mesh.generator.kind` is \"whole\"; here it is \"fixed\""),
        ("grid.cells=[14,16]", "`grid.cells` is [16, 14]; here it is [14, 16]"),
    ] {
        let said = unfit(&study("burgers-b-conservative", &[&SHORT[..], &[set]].concat()));
        assert!(
            said.contains(expected) && said.contains("checkpoint.0: ") && said.contains("checkpoint.1: "),
            "{said}"
        );
    }
    let said = unfit(&study("stefan-slides", &["time.end=0.1", "time.report=[0.1]"]));
    assert!(said.contains("is \"moving-mesh\"; here it is \"stefan\"") || said.contains("here it is"), "{said}");
    assert!(before == left(&cut));

    // other output is no other study; rows and frames that are gone are missed
    let other = study("burgers-b-conservative", &[&SHORT[..], &["output.checkpoint={ seconds = 5 }"]].concat());
    std::fs::rename(cut.join("frames/step-000003.vtu"), out.path().join("frame")).unwrap();
    assert!(unfit(&other).contains("frames/step-000003.vtu does not go with it"));
    std::fs::rename(out.path().join("frame"), cut.join("frames/step-000003.vtu")).unwrap();
    let history = std::fs::read(cut.join("history.csv")).unwrap();
    std::fs::write(cut.join("history.csv"), &history[..100]).unwrap();
    assert!(unfit(&other).contains("history.csv does not go with it: it has 100 bytes of the"));
    std::fs::write(cut.join("history.csv"), history).unwrap();
    assert!(other.run(&cut, Begin::Resumed, &mut []).unwrap().is_none());
}

/// A complete run of other settings is not taken for one that may go on; without steps there is nothing to go on from.
#[test]
fn what_a_directory_holds_is_told() {
    let out = tempfile::tempdir().unwrap();
    let ours = study("burgers-b-conservative", &SHORT);
    assert_eq!(ours.standing(out.path()).unwrap(), Standing::Nothing);
    ours.run(out.path(), Begin::Resumed, &mut []).unwrap();
    assert_eq!(ours.standing(out.path()).unwrap(), Standing::Complete);
    let finer = study("burgers-b-conservative", &[&SHORT[..], &["time.step=5e-4"]].concat());
    let Err(Error::Checkpoint { refused }) = finer.standing(out.path()) else { panic!() };
    let [was, is] = ["0.001", "0.0005"].map(String::from);
    assert_eq!(refused[0].1, Unfit::Study { key: "time.step".into(), was, is });
    // a failure of the numbers would only come again
    let folding = [
        "monitor.strength.relative=3000",
        "monitor.smoothing=0",
        "grid.cells=[40,40]",
        "safety.substeps=1",
        "safety.smoothing=0",
        "safety.halvings=0",
    ];
    let folding = study("burgers-b-conservative", &[&SHORT[..], &folding].concat());
    assert!(matches!(folding.run(out.path(), Begin::Anew, &mut []), Ok(Some(Error::Failed { .. }))));
    assert_eq!(folding.standing(out.path()).unwrap(), Standing::Nothing);
}

/// A checkpoint of a small study of each kind that has them, behind its checksum.
fn sealed() -> [(Study, Vec<u8>); 2] {
    let moving = ["grid.cells=[6,5]", "time.end=0.26", "time.report=[0.255]", "compare.generator.kind=whole"];
    let front = ["grid.cells=[6,4,4]", "time.end=0.05", "time.report=[0.02]"];
    [study("burgers", &moving), study("stefan-slides", &front)].map(|study| {
        let out = tempfile::tempdir().unwrap();
        study.run(out.path(), Begin::Anew, &mut [&mut After::steps(4)]).unwrap();
        let bytes = std::fs::read(out.path().join("checkpoint.1")).unwrap();
        let behind = bytes.iter().position(|byte| *byte == b'\n').unwrap() + 1 + 32;
        assert_eq!(study.decode(&bytes[behind..]).unwrap(), 4);
        (study, bytes[behind..].to_vec())
    })
}

/// Any bytes behind a right checksum: a checkpoint or a refusal, never a panic; a length that the bytes do not hold is
/// no reason to allocate.
#[test]
fn any_bytes_are_a_checkpoint_or_refused() {
    for (study, bytes) in sealed() {
        let mut refused = 0;
        for k in 0..bytes.len() {
            for value in [0, 0x7f, 0xc0, 0xdd, 0xff, bytes[k] ^ 1] {
                let mut changed = bytes.clone();
                changed[k] = value;
                refused += usize::from(study.decode(&changed).is_err());
            }
            assert!(k % 16 != 0 || study.decode(&bytes[..k]).is_err());
        }
        assert!(refused > bytes.len(), "{refused}");
        // arrays, texts and bytes of four thousand million entries
        for k in (0..bytes.len() - 5).step_by(7) {
            for kind in [0xdd, 0xdf, 0xdb, 0xc6] {
                let mut changed = bytes.clone();
                changed[k..k + 5].copy_from_slice(&[kind, 0xff, 0xff, 0xff, 0xff]);
                let _ = study.decode(&changed);
            }
        }
    }
}

/// Numbers that no state has are refused by what they are of, wherever the bytes come from.
#[test]
fn impossible_states_are_refused_by_name() {
    let [(study, bytes), (front, front_bytes)] = sealed();
    // the first number behind a name: an array of numbers, or of pairs of them
    let with = |bytes: &[u8], name: &str, value: f64| {
        let named = [&[0xa0 | name.len() as u8], name.as_bytes()].concat();
        let at = bytes.windows(named.len()).position(|window| window == named).unwrap() + named.len();
        let number = (at..).find(|k| bytes[*k] == 0xcb).unwrap() + 1;
        let mut changed = bytes.to_vec();
        changed[number..number + 8].copy_from_slice(&value.to_be_bytes());
        changed
    };
    for (name, value, expected) in [
        ("x", f64::NAN, "its mesh is [NaN, "),
        ("x", 0.5, "the mesh folded"),
        ("u", f64::INFINITY, "its solution is [inf] at node 0"),
        ("rho", -1.0, "the mesh density is -1.000e0, not positive, at node (0, 0)"),
        ("velocity", f64::NAN, "its velocity is [NaN, "),
        ("t", 7.0, "at t = 7 is none of the run"),
        ("dt", 0.0, "its time steps are none of the run"),
    ] {
        let said = study.decode(&with(&bytes, name, value)).unwrap_err().to_string();
        assert!(said.contains(expected), "{name}: {said}");
    }
    for (name, value, expected) in [
        ("t", 0.012, "at t = 0.012 is none of the run"),
        ("front", f64::NAN, "its front is [NaN] at node 0"),
        ("front", 9.0, "the front left the box"),
        ("u", f64::NAN, "its temperature is [NaN] at node 0"),
    ] {
        let said = front.decode(&with(&front_bytes, name, value)).unwrap_err().to_string();
        assert!(said.contains(expected), "{name}: {said}");
    }
}

#[test]
fn settings_out_of_range_are_refused() {
    let mut source = Source::new("the study", std::fs::read_to_string("studies/burgers.toml").unwrap());
    for (set, key) in [
        ("output.checkpoint.steps=0", "`output.checkpoint.steps` is 0, but must be 1 or more"),
        ("output.checkpoint.seconds=0", "`output.checkpoint.seconds` is 0, but must be above 0"),
        ("output.checkpoint.seconds=nan", "`output.checkpoint.seconds` is NaN"),
        ("output.checkpoint.seconds=inf", "`output.checkpoint.seconds` is inf"),
        ("output.checkpoint=60", "write checkpoint = { seconds = 60 }"),
        ("output.checkpoint.minutes=1", "minutes"),
    ] {
        let before = source.clone();
        source.set(set).unwrap();
        let error = Study::from_source(&source).unwrap_err();
        let said = format!("{error}\n{}", error.help().unwrap_or_default());
        assert!(said.contains(key), "{said}");
        source = before;
    }
}
