//! The program as a user meets it: exit status, words on the terminal, and what is on the disk afterwards.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

const STUDY: &str = include_str!("../../studies/burgers-b-stochastic.toml");

struct Sandbox {
    directory: tempfile::TempDir,
}

impl Sandbox {
    /// A directory with `study.toml`, a short run on a coarse grid.
    fn new() -> Self {
        let directory = tempfile::tempdir().unwrap();
        let short = STUDY.replace("[40, 40]", "[12, 10]").replace("[0.75, 1.0, 1.25]", "[0.26, 0.27]");
        let short = short.replace("end = 1.25", "end = 0.27").replace("every = 50", "every = 8");
        std::fs::write(directory.path().join("study.toml"), short).unwrap();
        Self { directory }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.directory.path().join(name)
    }

    fn call(&self, arguments: &[&str]) -> Output {
        Command::new(env!("CARGO_BIN_EXE_driftmesh"))
            .args(arguments)
            .current_dir(self.directory.path())
            .output()
            .unwrap()
    }

    /// Runs the study with settings, into `out`.
    fn run(&self, set: &[&str]) -> Output {
        let mut arguments = vec!["run", "study.toml", "--out", "out"];
        set.iter().for_each(|assignment| arguments.extend(["--set", assignment]));
        self.call(&arguments)
    }
}

fn words(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

#[track_caller]
fn assert_refused(sandbox: &Sandbox, output: &Output, expected: &[&str]) {
    let words = words(output);
    assert_eq!(output.status.code(), Some(2), "{words}");
    assert!(words.starts_with("error: ") && words.matches("error: ").count() == 1, "one error: {words}");
    assert!(!words.contains("panicked"), "{words}");
    for part in expected {
        assert!(words.contains(part), "{part:?} is not in\n{words}");
    }
    assert!(!sandbox.path("out").exists(), "something was written");
}

fn entries(directory: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        std::fs::read_dir(directory).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// A grid that needs more than `ulimit -v` allows is refused before anything is written, and named as such: 1.3 GiB
/// of 1.
#[cfg(target_os = "linux")]
#[test]
fn the_limit_of_the_shell_is_known() {
    let sandbox = Sandbox::new();
    let run = format!(
        "ulimit -v 1048576; exec {} run study.toml --out out --set 'grid.cells=[700, 700]'",
        env!("CARGO_BIN_EXE_driftmesh")
    );
    let output = Command::new("sh").args(["-c", &run]).current_dir(sandbox.directory.path()).output().unwrap();
    assert_refused(&sandbox, &output, &["`grid.cells` is [700, 700]", "`ulimit -v` allows 1; lower it"]);
}

/// A run leaves everything that the contract names, and says where.
#[test]
fn a_run_leaves_its_directory() {
    let sandbox = Sandbox::new();
    let output = sandbox.run(&[]);
    assert!(output.status.success(), "{}", words(&output));
    let said = String::from_utf8(output.stdout).unwrap();
    for part in ["l_inf", "0.2600", "0.2700", "20 steps", "out/mesh.png", "out/report.html", "run      out"] {
        assert!(said.contains(part), "{part:?} is not in\n{said}");
    }
    let expected = [
        "compare",
        "compare.pvd",
        "error.png",
        "error.svg",
        "final.npz",
        "final.state",
        "final.vts",
        "frames",
        "history.csv",
        "mesh.png",
        "mesh.svg",
        "quality.png",
        "quality.svg",
        "report.html",
        "run.pvd",
        "study.toml",
        "summary.json",
    ];
    assert_eq!(entries(&sandbox.path("out")), expected);
    // the first state, steps 8 and 16, and the last
    assert_eq!(entries(&sandbox.path("out/frames")).len(), 4);
    let history = std::fs::read_to_string(sandbox.path("out/history.csv")).unwrap();
    assert_eq!(history.lines().count(), 1 + 21);

    let text = std::fs::read_to_string(sandbox.path("out/summary.json")).unwrap();
    let summary: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(summary["schema"], 1);
    assert_eq!(summary["status"], "completed");
    assert_eq!(summary["work"]["steps"], 20);
    for path in [
        "/seconds/wall",
        "/seconds/cpu",
        "/seconds/monitor",
        "/seconds/interface",
        "/seconds/mesh",
        "/seconds/pde",
        "/seconds/output",
        "/parallel/ranks",
        "/parallel/threads",
        "/work/rejected_steps",
        "/work/linear_solves",
        "/work/newton_iterations",
        "/work/substeps",
        "/work/path_steps",
        "/reports/0/t",
        "/reports/1/error/linf",
        "/reports/1/error/l2",
        "/reports/1/quality/q_max",
        "/reports/1/quality/q_mean",
        "/reports/1/quality/min_scaled_jacobian",
        "/reports/1/quality/equidistribution",
        "/reports/1/conserved/mass",
        "/reports/1/conserved/drift",
    ] {
        assert!(summary.pointer(path).is_some_and(serde_json::Value::is_number), "{path}");
    }
    // the resolved study is itself a study, and gives the same run
    let again = sandbox.call(&["run", "out/study.toml", "--out", "again", "--quiet"]);
    assert!(again.status.success() && again.stdout.is_empty(), "{}", words(&again));
    // on so few cells central differences overshoot, which is said
    assert!(words(&again).lines().all(|line| line.contains("leaves the range of its data")), "{}", words(&again));
    let bytes = |name: &str| std::fs::read(sandbox.path(name)).unwrap();
    assert_eq!(bytes("out/final.npz"), bytes("again/final.npz"));
}

/// Numbers do not depend on the number of threads: a mesh large enough to be shared has the same bits on 1 and 2.
#[test]
fn threads_do_not_change_a_bit() {
    let sandbox = Sandbox::new();
    for threads in ["1", "2"] {
        let set = ["--set", "grid.cells=[150,140]", "--set", "time.end=0.256", "--set", "time.report=[0.256]"];
        let arguments = [&["run", "study.toml", "--quiet", "--threads", threads, "--out", threads], &set[..]].concat();
        assert!(sandbox.call(&arguments).status.success());
    }
    for file in ["final.npz", "frames/step-000006.vtu", "mesh.svg", "mesh.png"] {
        let [one, two] = ["1", "2"].map(|threads| std::fs::read(sandbox.path(threads).join(file)).unwrap());
        assert!(one == two, "{file} differs");
    }
}

/// Settings out of range: the key, the value, the place, exit 2, nothing written.
#[test]
fn bad_settings_are_refused_by_name() {
    let cases: &[(&str, &[&str])] = &[
        ("pde.viscosity=-0.005", &["`pde.viscosity` is -0.005", "above 0", "--set:1:15", "^^^^^^"]),
        ("pde.viscosity=nan", &["`pde.viscosity` is NaN", "finite"]),
        ("grid.cells=[0,40]", &["`grid.cells` is [0, 40]", "at least 2"]),
        ("grid.cells=[1000000000,1000000000]", &["`grid.cells`", "GiB", "lower it"]),
        ("grid.cells=[18446744073709551615,3]", &["--set:1"]),
        ("grid.cells=[9223372036854775807,3]", &["`grid.cells`"]),
        ("time.end=0.1", &["`time.end` is 0.1", "after start = 0.25"]),
        ("time.end=inf", &["`time.end` is inf", "finite"]),
        ("time.step=0", &["`time.step` is 0", "above 0"]),
        ("time.step=nan", &["`time.step` is NaN"]),
        ("time.step=1e-11", &["`time.step`", "steps; raise it"]),
        ("time.report=[3.0]", &["`time.report` is 3", "between"]),
        ("monitor.strength.relative=-1", &["`monitor.strength.relative` is -1"]),
        ("monitor.strength.absolute=nan", &["`monitor.strength.absolute` is NaN"]),
        ("monitor.smoothing=1000000", &["`monitor.smoothing`", "at most"]),
        ("mesh.relaxation=0", &["`mesh.relaxation` is 0"]),
        ("mesh.coupling.iterations=0", &["`mesh.coupling.iterations` is 0"]),
        ("mesh.coupling.mesh_steps=0", &["`mesh.coupling.mesh_steps` is 0"]),
        ("domain.upper=[0.0,1.0]", &["`domain.upper`", "above lower"]),
        ("grid.cells=[40,40,40]", &["an array of length 2, found 3"]),
        ("domain.lower=[0.0,0.0,9.0]", &["an array of length 2, found 3"]),
        ("time=[0.25,0.3,0.001,[]]", &["`time` must be a table, but this is of type array"]),
        ("monitor.strength={relative=1,absolute=2}", &["exactly one of its keys", "--set:1"]),
        ("mesh.generator=whole", &["`mesh.generator` must be a table, but this is of type string"]),
        ("domain.lower=[nan,0.0]", &["`domain.lower`", "finite"]),
        ("domain.upper=[1e-200,1.0]", &["`domain.upper`", "cannot be told apart"]),
        ("domain.upper=[1e300,1.0]", &["`domain.upper` is [1e300, 1.0]", "cannot be told apart"]),
        ("time.step=1e-13", &["`time.step`", "raise it"]),
        ("domain.periodic=[true,false]", &["`domain.periodic`", "bounded"]),
        ("domain.periodic=[true,true]", &["`domain.periodic`", "pde.initial"]),
        ("mesh.generator.subdomains=[13,4]", &["`mesh.generator.subdomains` is [13, 4]", "one a cell", "[12, 10]"]),
        ("mesh.generator.subdomains=[4]", &["an array of length 2, found 1"]),
        ("mesh.generator.subdomains=[0,4]", &["`mesh.generator.subdomains`"]),
        ("mesh.generator.seed=-1", &["expected a whole number from 0 to 2^63 - 1"]),
        ("mesh.generator.seed=9223372036854775808", &["--set:1"]),
        ("mesh.generator.estimator.walks=0", &["`mesh.generator.estimator.walks` is 0", "set it to 1 or more"]),
        (
            "mesh.generator.estimator={kind=\"strip\",width=0}",
            &["`mesh.generator.estimator.width` is 0", "1 node or more", "\"auto\""],
        ),
        (
            "mesh.generator.estimator={kind=\"strip\",width=7}",
            &["`mesh.generator.estimator.width` is 7", "narrowest subdomain", "fewer subdomains"],
        ),
        ("mesh.generator.estimator={kind=\"strip\",widht=2}", &["widht", "did you mean `width`?"]),
        (
            "mesh.generator={kind=\"schwarz\",subdomains=[2,2],robin=1.0}",
            &["`mesh.generator.robin` is 1", "method to \"optimized\""],
        ),
        ("mesh.generator.estimator.sweeps=many", &["a number or \"auto\"", "--set:1"]),
        (
            "mesh.generator.estimator={kind=\"monte-carlo\",paths=0,substeps=1}",
            &["`mesh.generator.estimator.paths` is 0"],
        ),
        ("mesh.generator.estimator.kind=montecarlo", &["did you mean `monte-carlo`?"]),
        ("mesh.generator.interface.sample=0", &["`mesh.generator.interface.sample` is 0"]),
        (
            "mesh.generator={kind=\"schwarz\",subdomains=[2,2],overlap=0}",
            &["`mesh.generator.overlap` is 0", "does not converge"],
        ),
        ("compare.generator.kind=hole", &["did you mean `whole`?"]),
        ("pde.initial=\"sin(x\"", &["`pde.initial`: ", "--set:1:17", "^"]),
        ("pde={kind=\"prescribed\"}", &["`pde.u` is not given", "formula"]),
        ("pde={kind=\"prescribed\",u=\"x+zz\"}", &["`pde.u`: ", "zz"]),
        ("monitor.gradient=save", &["did you mean `safe`?"]),
        ("study.name=\"../x\"", &["`study.name`"]),
        ("output.frames.every=0", &["`output.frames.every` is 0"]),
        ("output.frames.times=[nan]", &["`output.frames.times` is NaN"]),
        ("output.frames.times=[7.0]", &["is 7, but must lie between time.start = 0.25"]),
        ("monitor.strength=30", &["must be a table", "write strength = { relative = 30.0 }"]),
        // wrong types and names
        ("pde.viscosty=1", &["unknown key `viscosty`", "did you mean `viscosity`?"]),
        ("pdes.viscosity=1", &["unknown key `pdes`", "did you mean `pde`?"]),
        ("mesh.generator.kind=hole", &["unknown name `hole`", "did you mean `whole`?"]),
        ("study.kind=statics", &["unknown name `statics`", "moving-mesh"]),
        ("pde.convection=advectiv", &["did you mean `advective`?"]),
        ("time.step=\"fast\"", &["expected a number"]),
        ("grid.cells=40", &["integer `40`, expected an array"]),
        ("grid.cells=[-40,40]", &["expected a whole number"]),
        ("monitor.kind=3", &["`monitor.kind` is not a string"]),
        // not assignments
        ("time.step", &["--set KEY=VALUE"]),
        ("=1", &["--set KEY=VALUE"]),
        ("", &["--set KEY=VALUE"]),
        ("[time]", &["not one assignment"]),
        ("a=1\nb=2", &["not one assignment"]),
    ];
    let sandbox = Sandbox::new();
    for (set, expected) in cases {
        assert_refused(&sandbox, &sandbox.run(&[set]), expected);
    }
}

/// A formula that jumps over the seam of a periodic axis is allowed, with a warning that says by how much; a density
/// that is not positive ends the run with its place.
#[test]
fn formulas_are_warned_of_and_checked() {
    let sandbox = Sandbox::new();
    let periodic = ["domain.periodic=[true,true]", "compare.generator.kind=whole"];
    let with =
        |formula: &str| sandbox.run(&[&periodic[..], &[&format!("pde={{kind=\"prescribed\",{formula}}}")]].concat());
    let output = with("u=\"tanh(5*(x-0.5)) + sin(2*pi*y)\"");
    let said = words(&output);
    assert_eq!(output.status.code(), Some(0), "{said}");
    let expected = "warning: `pde.u` is not periodic along x: from x = 1 to x = 0 it jumps by up to 2.0e0";
    assert!(said.contains(expected) && !said.contains("along y"), "{said}");
    std::fs::remove_dir_all(sandbox.path("out")).unwrap();
    // rounding is no jump, whatever the values on the seam
    let rounding = with("u=\"sin(2*pi*x)*cos(2*pi*y)\"");
    assert!(rounding.status.success() && !words(&rounding).contains("warning"), "{}", words(&rounding));
    let burgers = "pde={kind=\"burgers\",viscosity=0.01,initial=\"0.5 + 0.1*cos(2*pi*x)\",boundary=\"0.6 + 0.1*t*x\"}";
    let said = words(&sandbox.run(&["domain.periodic=[true,false]", "compare.generator.kind=whole", burgers]));
    assert!(said.contains("`pde.boundary` is not periodic along x") && said.contains("by up to 2.7e-2"), "{said}");
    assert!(said.contains("`pde.boundary` is not `pde.initial` at the start"), "{said}");
    std::fs::remove_dir_all(sandbox.path("out")).unwrap();

    // the arc-length table of the study is refused for a prescribed density, not ignored
    let refused = with("rho=\"1.5 + sin(2*pi*x)\"");
    assert_refused(&sandbox, &refused, &["`monitor.kind`", "pde.rho is the density itself"]);
    let given = "monitor={kind=\"given\"}";
    let set = |rho: &str| {
        [&periodic[..], &[&format!("pde={{kind=\"prescribed\",rho=\"{rho}\"}}"), given]].concat().join("\n")
    };
    for (rho, code) in [("1.5 + sin(2*pi*x)", 0), ("0.5 + sin(2*pi*x)", 1)] {
        let assignments = set(rho);
        let output = sandbox.run(&assignments.split('\n').collect::<Vec<_>>());
        assert_eq!(output.status.code(), Some(code), "{}", words(&output));
        assert_eq!(words(&output).contains("the mesh density is -"), code == 1, "{}", words(&output));
    }
}

/// Mistakes in the file itself are shown with their line and a caret.
#[test]
fn bad_files_are_refused_at_their_place() {
    let study = std::fs::read_to_string(Sandbox::new().path("study.toml")).unwrap();
    let without = |table: &str| {
        let start = study.find(&format!("[{table}]")).unwrap();
        let end = study[start + 1..].find("\n[").map_or(study.len(), |n| start + 1 + n);
        format!("{}{}", &study[..start], &study[end..])
    };
    let cases: Vec<(Vec<u8>, &[&str])> = vec![
        (
            study.replace("viscosity", "viscocity").into(),
            &["study.toml:21:1", "viscocity = 0.005", "did you mean `viscosity`?"],
        ),
        (study.replace("smoothing = 2", "smoothing = two").into(), &["study.toml:27:13", "^"]),
        (without("time").into(), &["the study has no [time] table"]),
        (without("pde").into(), &["the study has no [pde] table"]),
        (without("grid").into(), &["the study has no [grid] table"]),
        (without("study").into(), &["the study has no [study] table"]),
        (study.replace("end = 0.27", "").into(), &["the key `end` is missing", "add end = …"]),
        (study.replace("kind = \"burgers\"\n", "").into(), &["`pde` does not say its kind", "driftmesh list"]),
        (study.replace("[time]", "[time").into(), &["study.toml:1"]),
        (
            study.replace("{ relative = 30.0 }", "{ relative = 30.0, absolute = 1.0 }").into(),
            &["exactly one of its keys"],
        ),
        (study.replace("start = 0.25", "start = 0.25\nstart = 0.25").into(), &["duplicate key"]),
        (
            study
                .replace("# Burgers", "# é\tü\n\t\n# Burgers")
                .replace("end = 0.27", "\tend = 0.1  # für später")
                .into(),
            &["`time.end` is 0.1"],
        ),
        (vec![], &["the study has no [study] table"]),
        (b"name = \"\xff\xfe\"".to_vec(), &["not UTF-8", "byte 8, line 1"]),
        (vec![0; 100], &["study.toml:1:1"]),
        (vec![b' '; 2_000_000], &["more than 1048576 bytes"]),
        (b"a=".repeat(10_000), &["study.toml:1"]),
        (b"[".repeat(100_000), &["study.toml:1"]),
    ];
    for (bytes, expected) in cases {
        let sandbox = Sandbox::new();
        std::fs::write(sandbox.path("study.toml"), bytes).unwrap();
        assert_refused(&sandbox, &sandbox.run(&[]), expected);
    }
}

#[test]
fn unreadable_files_are_refused() {
    let sandbox = Sandbox::new();
    assert_refused(&sandbox, &sandbox.call(&["run", "nowhere.toml", "--out", "out"]), &["cannot read nowhere.toml"]);
    assert_refused(&sandbox, &sandbox.call(&["run", ".", "--out", "out"]), &["it is a directory"]);
}

#[test]
fn wrong_command_lines_end_with_2() {
    let sandbox = Sandbox::new();
    for arguments in [
        &["run"][..],
        &["walk"],
        &["run", "study.toml", "--threads", "0"],
        &["run", "study.toml", "--fast"],
        &["list", "cars"],
        &["check"],
        &[],
    ] {
        let output = sandbox.call(arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {}", words(&output));
    }
}

/// A directory that no run of ours wrote is refused and left as it is; one of ours is replaced, other files kept.
#[test]
fn only_our_own_directories_are_replaced() {
    let sandbox = Sandbox::new();
    std::fs::create_dir(sandbox.path("mine")).unwrap();
    std::fs::write(sandbox.path("mine/thesis.tex"), "years of work").unwrap();
    std::fs::write(sandbox.path("mine/summary.json"), "{\"figures\": 3}").unwrap();
    let refused = sandbox.call(&["run", "study.toml", "--out", "mine"]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(words(&refused).contains("mine is not empty and was not written by driftmesh"), "{}", words(&refused));
    assert_eq!(entries(&sandbox.path("mine")), ["summary.json", "thesis.tex"]);
    let refused = sandbox.call(&["run", "study.toml", "--out", "study.toml"]);
    assert_eq!(refused.status.code(), Some(2), "{}", words(&refused));

    assert!(sandbox.run(&[]).status.success());
    std::fs::write(sandbox.path("out/notes.txt"), "kept").unwrap();
    std::fs::write(sandbox.path("out/frames/notes.txt"), "kept too").unwrap();
    assert!(sandbox.run(&["time.end=0.26", "time.report=[0.26]"]).status.success());
    assert_eq!(std::fs::read_to_string(sandbox.path("out/notes.txt")).unwrap(), "kept");
    assert_eq!(std::fs::read_to_string(sandbox.path("out/frames/notes.txt")).unwrap(), "kept too");
    assert_eq!(entries(&sandbox.path("out/frames")).len(), 1 + 3, "old frames are gone");

    // what a run that was killed before its first summary leaves is ours; what another one is writing to is not
    std::fs::create_dir(sandbox.path("killed")).unwrap();
    let lock = std::fs::File::create(sandbox.path("killed/run.lock")).unwrap();
    lock.lock().unwrap();
    let busy = sandbox.call(&["run", "study.toml", "--out", "killed"]);
    assert_eq!(busy.status.code(), Some(2));
    assert!(words(&busy).contains("another run is writing to killed"), "{}", words(&busy));
    drop(lock);
    assert!(sandbox.call(&["run", "study.toml", "--out", "killed"]).status.success());
}

/// A mesh that folds: exit 1, the named error with the present settings, everything so far kept.
#[test]
fn a_folded_mesh_is_named_and_the_frames_are_kept() {
    let sandbox = Sandbox::new();
    let steep =
        ["monitor.strength.relative=3000", "monitor.smoothing=0", "grid.cells=[40,40]", "output.frames.every=1"];
    let first_failure_ends_it = ["safety.substeps=1", "safety.smoothing=0", "safety.halvings=0"];
    let output = sandbox.run(&[&steep[..], &first_failure_ends_it, &["mesh.generator.kind=whole"]].concat());
    assert_eq!(output.status.code(), Some(1));
    let words = words(&output);
    for part in [
        "the mesh folded: cell (",
        "at t = 0.25",
        "(step ",
        "monitor.smoothing (now 0)",
        "time.step (now 0.001)",
        "last good state",
    ] {
        assert!(words.contains(part), "{part:?} is not in\n{words}");
    }
    let text = std::fs::read_to_string(sandbox.path("out/summary.json")).unwrap();
    let summary: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(summary["status"], "failed");
    assert_eq!(summary["error"]["kind"], "mesh-folded");
    // the file and the terminal say the same
    let help = words.lines().find_map(|line| line.trim().strip_prefix("help: ")).unwrap();
    assert_eq!(summary["error"]["help"], help);
    let steps = summary["work"]["steps"].as_u64().unwrap() as usize;
    assert!(steps > 0);
    assert_eq!(entries(&sandbox.path("out/frames")).len(), steps + 1);
    assert!(sandbox.path("out/final.npz").exists());
}

/// A solution that cannot be computed, and one that is not finite from the start.
#[test]
fn a_lost_solution_is_named() {
    let sandbox = Sandbox::new();
    let output = sandbox.run(&[
        "mesh.generator.kind=fixed",
        "pde.viscosity=1e-6",
        "time.step=1.0",
        "time.end=9.0",
        "time.report=[9.0]",
    ]);
    assert_eq!(output.status.code(), Some(1), "{}", words(&output));
    assert!(words(&output).contains("Newton's method stalled"), "{}", words(&output));
    // a failure at the start replaces what an earlier run left, and says so
    assert!(sandbox.run(&[]).status.success());
    let output = sandbox.run(&["monitor.strength.absolute=1e308", "pde.viscosity=1e-6"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(words(&output).contains("(step 0): the mesh density is inf at node"), "{}", words(&output));
    let summary = std::fs::read_to_string(sandbox.path("out/summary.json")).unwrap();
    assert!(summary.contains("\"failed\"") && summary.contains("non-finite"), "{summary}");
}

#[cfg(unix)]
#[test]
fn a_directory_that_cannot_be_written_is_named() {
    let sandbox = Sandbox::new();
    let output = sandbox.call(&["run", "study.toml", "--out", "/proc/driftmesh"]);
    assert_eq!(output.status.code(), Some(1), "{}", words(&output));
    assert!(words(&output).contains("cannot write /proc/driftmesh"), "{}", words(&output));
}

/// What `check` prints is the study with every default, and runs.
#[test]
fn check_prints_a_complete_study() {
    let sandbox = Sandbox::new();
    let output =
        sandbox.call(&["check", "study.toml", "--set", "time.step=5e-4", "--set", "mesh.generator.kind=fixed"]);
    assert!(output.status.success());
    let text = String::from_utf8(output.stdout).unwrap();
    for part in ["step = 0.0005", "gradient = \"central\"", "mesh_steps = 1", "kind = \"fixed\"", "MiB of memory"] {
        assert!(text.contains(part), "{part:?} is not in\n{text}");
    }
    std::fs::write(sandbox.path("checked.toml"), text).unwrap();
    assert!(sandbox.call(&["check", "checked.toml"]).status.success());
    assert_refused(&sandbox, &sandbox.call(&["check", "study.toml", "--set", "time.step=0"]), &["`time.step`"]);
}

/// A choice set on the command line replaces the one in the file; a new kind drops the keys of the old one.
#[test]
fn settings_override_choices() {
    let sandbox = Sandbox::new();
    let output = sandbox.call(&[
        "check",
        "study.toml",
        "--set",
        "monitor.strength.relative=7",
        "--set",
        "monitor.strength.absolute=5",
        "--set",
        "output.frames.times=[0.26]",
    ]);
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(text.contains("absolute = 5.0") && !text.contains("relative"), "{text}");
    assert!(text.contains("times = [0.26]") && !text.contains("every"), "{text}");
}

#[test]
fn list_names_every_kind() {
    let sandbox = Sandbox::new();
    let all = String::from_utf8(sandbox.call(&["list"]).stdout).unwrap();
    for part in ["pdes (pde.kind)", "burgers", "shallow-water", "arclength", "whole", "fixed"] {
        assert!(all.contains(part), "{part:?} is not in\n{all}");
    }
    let generators = String::from_utf8(sandbox.call(&["list", "generators"]).stdout).unwrap();
    assert!(generators.contains("whole") && !generators.contains("burgers"));
}

/// A reader that closes the pipe early is no reason to panic.
#[cfg(unix)]
#[test]
fn a_closed_pipe_is_quiet() {
    let sandbox = Sandbox::new();
    let command = format!("'{}' list | true; '{0}' run study.toml --out out | true", env!("CARGO_BIN_EXE_driftmesh"));
    let output = Command::new("sh").args(["-c", &command]).current_dir(sandbox.directory.path()).output().unwrap();
    assert!(!words(&output).contains("panicked"), "{}", words(&output));
}

/// Every verb's help shows a real example.
#[test]
fn help_shows_an_example() {
    let sandbox = Sandbox::new();
    for verb in ["run", "check", "list"] {
        let help = String::from_utf8(sandbox.call(&[verb, "--help"]).stdout).unwrap();
        assert!(help.contains(&format!("Example:\n  driftmesh {verb} ")), "{help}");
    }
}

/// One item is rerun with its rules and verdicts; everything at once takes no names beside it.
#[test]
fn papers_are_rerun() {
    let sandbox = Sandbox::new();
    let out = sandbox.call(&["reproduce", "errata-sdd", "--out", "papers"]);
    let text = String::from_utf8_lossy(&out.stdout).into_owned();
    assert!(out.status.success() && text.contains("verdict: ") && text.contains("| erratum"), "{text}");
    let written = std::fs::read_to_string(sandbox.path("papers/errata-sdd.md")).unwrap();
    assert_eq!(written.trim_end(), text.trim_end());
    assert!(!sandbox.path("papers/index.html").exists());
    let both = sandbox.call(&["reproduce", "errata-sdd", "--all"]);
    assert_eq!(both.status.code(), Some(2));
}
