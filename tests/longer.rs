//! A complete run goes on to a later end, to the bits of one run to that end where the steps are the same.

use driftmesh::error::Unfit;
use driftmesh::output::{RunDirectory, Standing};
use driftmesh::simulation::{Event, Observer, Snapshot};
use driftmesh::study::{Begin, Source, Study};
use driftmesh::{Error, Result};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Burgers' equation on a line.
const LINE: &str = r#"
[study]
name = "line"
kind = "moving-mesh"
[domain]
lower = [0.0]
upper = [1.0]
[grid]
cells = [20]
[time]
start = 0.0
end = 0.1
step = 0.01
[pde]
kind = "formula"
unknowns = ["u"]
flux = { u = ["0.5*u^2"] }
diffusivity = { u = "0.02" }
initial = { u = "sin(2*pi*x)" }
boundary = { u = "0" }
"#;

fn study(name: &str, sets: &[&str]) -> Study {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("studies").join(format!("{name}.toml"));
    let mut source = if name == "line" { Source::new("a line", LINE) } else { Source::read(&file).unwrap() };
    let quick = ["output.report=false", "output.frames.every=3", "output.checkpoint.steps=2"];
    sets.iter().chain(&quick).for_each(|set| source.set(set).unwrap());
    Study::from_source(&source).unwrap_or_else(|error| panic!("{name}: {error}"))
}

/// What a run leaves, but for the seconds that it took and its last state, which has them too.
fn left(directory: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut files = BTreeMap::new();
    for folder in ["", "frames", "compare"] {
        for path in std::fs::read_dir(directory.join(folder)).into_iter().flatten().map(|entry| entry.unwrap().path()) {
            let name = path.strip_prefix(directory).unwrap().to_path_buf();
            match name.to_str().unwrap() {
                "history.csv" => drop(files.insert(name, rows(directory).concat().into_bytes())),
                "summary.json" => drop(files.insert(name, untimed(directory).to_string().into_bytes())),
                "final.state" => {}
                _ if path.is_file() => drop(files.insert(name, std::fs::read(&path).unwrap())),
                _ => {}
            }
        }
    }
    files
}

fn untimed(directory: &Path) -> Value {
    let mut summary = summary(directory);
    summary.as_object_mut().unwrap().remove("seconds");
    summary
}

fn summary(directory: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(directory.join("summary.json")).unwrap()).unwrap()
}

/// The rows of `history.csv`, without seconds, the last column.
fn rows(directory: &Path) -> Vec<String> {
    let text = std::fs::read_to_string(directory.join("history.csv")).unwrap();
    let timed = text.lines().next().unwrap().ends_with(",seconds");
    text.lines().map(|row| if timed { row.rsplit_once(',').unwrap().0.to_string() } else { row.into() }).collect()
}

/// Counts steps, and ends the run after so many.
struct Steps {
    seen: usize,
    most: usize,
}

impl Observer for Steps {
    fn observe(&mut self, event: Event, _: &Snapshot<'_>) -> Result<()> {
        assert!(event != Event::Started, "the run began anew");
        self.seen += usize::from(event == Event::Stepped);
        Ok(())
    }

    fn interrupts(&self) -> bool {
        self.seen >= self.most
    }
}

fn go_on(study: &Study, directory: &Path) {
    assert_eq!(study.standing(directory).unwrap(), Standing::Shorter);
    let mut steps = Steps { seen: 0, most: usize::MAX };
    assert!(study.run(directory, Begin::Resumed, &mut [&mut steps]).unwrap().is_none());
    assert!(steps.seen > 0 && study.standing(directory).unwrap() == Standing::Complete);
}

/// Runs to the first of several ends and goes on to the others; and runs to the last at once.
#[track_caller]
fn assert_goes_on(name: &str, sets: &[&str], ends: &[&[&str]]) {
    let out = tempfile::tempdir().unwrap();
    let [whole, parts] = ["whole", "parts"].map(|name| out.path().join(name));
    let to = |end: &[&str]| study(name, &[sets, end].concat());
    assert!(to(ends[0]).run(&parts, Begin::Anew, &mut []).unwrap().is_none());
    ends[1..].iter().for_each(|end| go_on(&to(end), &parts));
    assert!(to(ends[ends.len() - 1]).run(&whole, Begin::Anew, &mut []).unwrap().is_none());
    let [whole, parts] = [whole, parts].map(|directory| left(&directory));
    assert_eq!(whole.keys().collect::<Vec<_>>(), parts.keys().collect::<Vec<_>>(), "{name}");
    assert!(whole.contains_key(Path::new("final.npz")) && whole.len() > 6);
    for (file, bytes) in &whole {
        assert!(*bytes == parts[file], "{name}: {} differs", file.display());
    }
}

/// Ends at a frame, between frames and at a checkpoint; meshes by a direct solve, by walks with random numbers of their
/// step, and beside one that they are compared with.
#[test]
fn moving_meshes_go_on_behind_their_end() {
    let ends: [&[&str]; 3] = [
        &["time.end=0.257", "time.report=[0.25,0.257]"],
        &["time.end=0.262", "time.report=[0.25,0.257,0.262]"],
        &["time.end=0.268", "time.report=[0.25,0.257,0.262,0.268]"],
    ];
    let walks = "mesh.generator={kind=\"stochastic\",subdomains=[2,3],seed=5}";
    assert_goes_on("burgers-b-stochastic", &["grid.cells=[16,14]", walks], &ends);
    let compared = ["grid.cells=[16,14]", "mesh.form=\"conservative\"", "compare.generator.kind=whole"];
    assert_goes_on("burgers-b-conservative", &compared, &ends);
}

#[test]
fn equations_go_on_behind_their_end() {
    let to =
        |ends: [&str; 2]| ends.map(|end| [format!("time.end={end}"), format!("time.report={ends:?}").replace('"', "")]);
    for (name, step, ends) in [
        ("dam-break", "time.step=0.005", ["0.03", "0.05"]),
        ("gray-scott", "time.step=2.0", ["10.0", "18.0"]),
        ("fisher", "time.step=0.005", ["0.02", "0.04"]),
        ("burgers-uniform-conservative", "time.step=0.001", ["0.256", "0.26"]),
    ] {
        let [first, then] = to(ends);
        let first = [first[0].as_str(), &format!("time.report=[{}]", ends[0])];
        let then = [then[0].as_str(), &then[1]];
        assert_goes_on(name, &["grid.cells=[12,10]", step], &[&first, &then]);
    }
    let ends: [&[&str]; 2] = [&["time.end=0.1"], &["time.end=0.2", "time.report=[0.1,0.2]"]];
    assert_goes_on("line", &["mesh.relaxation=0.1"], &ends);
}

/// Whose length is given by an end or by a duration; the picture of fronts over time is that of the whole run.
#[test]
fn fronts_go_on_behind_their_end() {
    let cells = ["grid.cells=[12,6,6]"];
    let ends: [&[&str]; 2] =
        [&["time.end=0.25", "time.report=[0.05,0.25]"], &["time.end=0.4", "time.report=[0.05,0.25,0.4]"]];
    assert_goes_on("stefan-slides", &cells, &ends);
    assert_goes_on("stefan-slides", &[cells[0], "front.stepping=\"implicit\""], &ends);
    let durations: [&[&str]; 2] = [&["time.duration=0.125"], &["time.duration=0.25"]];
    let one_report = ["grid.cells=[12,6,6]", "time.step=0.015625"];
    let out = tempfile::tempdir().unwrap();
    let to = |duration: &[&str]| study("stefan-planar", &[&one_report[..], duration].concat());
    to(durations[0]).run(out.path(), Begin::Anew, &mut []).unwrap();
    go_on(&to(durations[1]), out.path());
    assert_eq!(summary(out.path())["work"]["steps"], 16);
}

#[test]
fn lines_go_on_behind_their_end() {
    let ends: [&[&str]; 3] = [&["time.end=0.008"], &["time.end=0.016"], &["time.end=0.032"]];
    assert_goes_on("moving-front-1d", &["time.step=0.002"], &ends);
}

/// Where the later run would have other steps up to the first end, the steps done stay, and the end of the first is
/// met: no gap and no row twice, whatever ends the second on its way.
#[test]
fn steps_done_stay_where_the_later_run_would_have_others() {
    let out = tempfile::tempdir().unwrap();
    let to = |end: &str| study("burgers-b-conservative", &["grid.cells=[8,8]", "time.report=[]", end]);
    to("time.end=0.2567").run(out.path(), Begin::Anew, &mut []).unwrap();
    let first = rows(out.path());
    let longer = to("time.end=0.2711");
    let mut steps = Steps { seen: 0, most: 4 };
    let ended = longer.run(out.path(), Begin::Resumed, &mut [&mut steps]);
    assert!(matches!(ended, Ok(Some(Error::Interrupted(_)))) && steps.seen == 4, "{ended:?}");
    assert!(longer.run(out.path(), Begin::Resumed, &mut []).unwrap().is_none());
    let both = rows(out.path());
    assert_eq!(both[..first.len()], first);
    let times: Vec<f64> = both[1..].iter().map(|row| row.split(',').next().unwrap().parse().unwrap()).collect();
    assert!(times.is_sorted_by(|a, b| a < b) && times.contains(&0.2567) && times.last() == Some(&0.2711), "{times:?}");
    let reports: Vec<f64> =
        summary(out.path())["reports"].as_array().unwrap().iter().map(|report| report["t"].as_f64().unwrap()).collect();
    assert_eq!(reports, [0.2567, 0.2711]);
    assert_eq!(summary(out.path())["work"]["steps"], times.len() - 1);
    let frames = std::fs::read_to_string(out.path().join("run.pvd")).unwrap();
    let frames: Vec<&str> = frames.split("timestep=\"").skip(1).map(|t| t.split('"').next().unwrap()).collect();
    let frames: Vec<f64> = frames.iter().map(|t| t.parse().unwrap()).collect();
    assert!(frames.is_sorted_by(|a, b| a < b) && frames.len() == 1 + (times.len() - 1).div_ceil(3), "{frames:?}");
}

/// A report that is asked for only then at the end of the first run is made from its last state.
#[test]
fn a_report_at_the_first_end_may_be_asked_for_later() {
    let out = tempfile::tempdir().unwrap();
    let [whole, parts] = ["whole", "parts"].map(|name| out.path().join(name));
    let to = |name: &str, sets: &[&str]| study(name, sets);
    for (name, cells, [first, later], reports) in [
        ("burgers-b-conservative", "[8,8]", ["0.256", "0.26"], ["[0.255]", "[0.255,0.256]"]),
        ("stefan-slides", "[8,4,4]", ["0.05", "0.08"], ["[0.02]", "[0.02,0.05]"]),
    ] {
        let of = |end: &str, report: &str| {
            let sets = ["grid.cells=", "time.end=", "time.report="];
            let sets: Vec<String> =
                sets.iter().zip([cells, end, report]).map(|(key, value)| format!("{key}{value}")).collect();
            to(name, &sets.iter().map(String::as_str).collect::<Vec<_>>())
        };
        of(first, reports[0]).run(&parts, Begin::Anew, &mut []).unwrap();
        go_on(&of(later, reports[1]), &parts);
        of(later, reports[1]).run(&whole, Begin::Anew, &mut []).unwrap();
        let [whole, parts] = [&whole, &parts].map(|directory| untimed(directory)["reports"].clone());
        assert_eq!(parts.as_array().unwrap().len(), 2, "{name}: {parts}");
        for key in ["t", "quality", "conserved", "front"] {
            let [whole, parts] = [&whole, &parts].map(|reports| reports[1][key].clone());
            assert_eq!(whole, parts, "{name}: {key}");
        }
    }
}

/// Steps of automatic length go on, too.
#[test]
fn automatic_steps_go_on_behind_their_end() {
    let out = tempfile::tempdir().unwrap();
    let to = |end: &str| study("burgers", &["grid.cells=[16,14]", end, "time.report=[]"]);
    to("time.end=0.4").run(out.path(), Begin::Anew, &mut []).unwrap();
    let first = rows(out.path());
    go_on(&to("time.end=0.6"), out.path());
    let both = rows(out.path());
    assert!(both.len() > first.len() + 3 && both[..first.len()] == first);
}

/// Other settings, an earlier end, other reports on the way, and a last state that is gone or damaged: each is refused
/// by name, and nothing is touched.
#[test]
fn what_is_no_later_end_is_refused() {
    let out = tempfile::tempdir().unwrap();
    let directory = out.path().join("run");
    let of = |sets: &[&str]| {
        let ours = ["grid.cells=[8,8]", "time.end=0.256", "time.report=[0.253,0.256]"];
        study("burgers-b-conservative", &[&ours[..], sets].concat())
    };
    of(&[]).run(&directory, Begin::Anew, &mut []).unwrap();
    let before = left(&directory);
    let refused = |sets: &[&str]| match of(sets).standing(&directory) {
        Err(error @ Error::Checkpoint { .. }) => format!("{error}\n{}", error.help().unwrap()),
        other => panic!("{other:?}"),
    };
    let later = ["time.end=0.26", "time.report=[0.253,0.26]"];
    for (more, expected) in [
        (&["pde.viscosity=0.01"][..], "`pde.viscosity` is 0.005; here it is 0.01"),
        (&["time.step=0.002"], "`time.step` is 0.001; here it is 0.002"),
        (&["time.report=[0.252,0.253,0.26]"], "`time.report` is [0.253] before t = 0.256; here it is [0.252, 0.253]"),
        (&["time.end=0.254", "time.report=[0.253]"], "complete up to t = 0.256, and here it would end at t = 0.254"),
    ] {
        let said = refused(&[&later[..], more].concat());
        assert!(said.contains(expected) && said.contains("leave --resume out"), "{said}");
    }
    let said = refused(&["time.report=[0.256]"]);
    assert!(said.contains("`time.report` is [0.253, 0.256]; here it is [0.256]"), "{said}");
    assert!(left(&directory) == before && of(&[]).standing(&directory).unwrap() == Standing::Complete);

    let last = directory.join("final.state");
    let bytes = std::fs::read(&last).unwrap();
    std::fs::write(&last, &bytes[..bytes.len() / 2]).unwrap();
    assert!(refused(&later).contains("final.state: it is damaged"));
    std::fs::remove_file(&last).unwrap();
    let Err(Error::Checkpoint { refused }) = of(&later).standing(&directory) else { panic!() };
    assert_eq!(refused, [(last.clone(), Unfit::Missing)]);
    std::fs::write(&last, bytes).unwrap();
    go_on(&of(&later), &directory);

    // a run that goes on and is killed before its first checkpoint is still there to go on from
    let longest = of(&["time.end=0.27", "time.report=[0.253]"]);
    let ended = longest.run(&directory, Begin::Resumed, &mut [&mut Steps { seen: 0, most: 1 }]);
    assert!(matches!(ended, Ok(Some(Error::Interrupted(_)))), "{ended:?}");
    for name in ["checkpoint.0", "checkpoint.1"] {
        let _ = std::fs::remove_file(directory.join(name));
    }
    assert_eq!(RunDirectory::standing(&directory), Standing::Unfinished);
    let mut steps = Steps { seen: 0, most: usize::MAX };
    assert!(longest.run(&directory, Begin::Resumed, &mut [&mut steps]).unwrap().is_none());
    assert_eq!((steps.seen, summary(&directory)["work"]["steps"].as_u64()), (10, Some(20)));
}
