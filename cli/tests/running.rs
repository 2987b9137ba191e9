//! What a run is told on the command line beside its study: `--strict`, and studies from standard input.

#![cfg(unix)]

use std::io::Write;
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};

const PROGRAM: &str = env!("CARGO_BIN_EXE_driftmesh");
/// A dozen steps of Burgers' equation.
const STUDY: &str = r#"[study]
name = "piped"
kind = "moving-mesh"
[grid]
cells = [6, 5]
[time]
start = 0.25
end = 0.37
step = 1e-2
[pde]
kind = "burgers"
viscosity = 0.05
"#;
/// The same on a periodic axis, over whose seam the solution that is given jumps: a warning.
const DOUBTFUL: [&str; 2] = ["--set=domain.periodic=[true, false]", "--set=pde={kind=\"prescribed\",u=\"x + t\"}"];

struct Sandbox(tempfile::TempDir);

impl Sandbox {
    fn new() -> Self {
        let directory = tempfile::tempdir().unwrap();
        std::fs::write(directory.path().join("study.toml"), STUDY).unwrap();
        Self(directory)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Calls the program with a text on its standard input.
    fn fed(&self, input: &[u8], arguments: &[&str]) -> Output {
        let mut child = Command::new(PROGRAM)
            .args(arguments)
            .current_dir(self.0.path())
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        // a program that ends before it has read everything is no mistake of this test
        let _ = child.stdin.take().unwrap().write_all(input);
        child.wait_with_output().unwrap()
    }

    fn call(&self, arguments: &[&str]) -> Output {
        self.fed(b"", arguments)
    }

    fn shell(&self, command: &str) -> Output {
        Command::new("sh").args(["-c", command]).current_dir(self.0.path()).output().unwrap()
    }

    fn summary(&self, directory: &str) -> serde_json::Value {
        let text = std::fs::read_to_string(self.path(directory).join("summary.json")).unwrap();
        serde_json::from_str(&text).unwrap()
    }
}

fn words(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

/// Warnings leave the exit status 0; with `--strict` it is 1, one line says so, and the run is as complete as without.
#[test]
fn strict_makes_warnings_a_failure() {
    let sandbox = Sandbox::new();
    let run = |more: &[&str]| sandbox.call(&[&["run", "study.toml", "--out", "out"], more].concat());
    let lenient = run(&DOUBTFUL);
    assert!(lenient.status.success() && words(&lenient).contains("warning: "), "{}", words(&lenient));
    assert!(!words(&lenient).contains("error"), "{}", words(&lenient));
    std::fs::remove_dir_all(sandbox.path("out")).unwrap();
    for more in [&["--strict"][..], &["--strict", "--quiet"], &["--strict", "--resume"]] {
        let strict = run(&[&DOUBTFUL[..], more].concat());
        let said = words(&strict);
        assert_eq!(strict.status.code(), Some(1), "{more:?}: {said}");
        assert!(said.contains("warning: `pde.u` is not periodic along x"), "{more:?}: {said}");
        let count = match sandbox.summary("out")["warnings"].as_array().unwrap().len() {
            1 => "1 warning".to_owned(),
            count => format!("{count} warnings"),
        };
        let last = format!("error: {count}, which --strict makes a failure: the run is complete in out");
        assert_eq!(said.lines().last(), Some(&*last), "{more:?}: {said}");
        assert_eq!(sandbox.summary("out")["status"], "completed");
        assert!(sandbox.path("out/report.html").is_file());
    }
    assert!(run(&[&DOUBTFUL[..], &["--resume"]].concat()).status.success());
    // nothing to warn of
    let sound = sandbox.call(&["run", "study.toml", "--out", "sound", "--strict"]);
    assert!(sound.status.success(), "{}", words(&sound));
    assert_eq!(sandbox.summary("sound")["warnings"], serde_json::json!([]));
}

#[test]
fn check_is_strict_too() {
    let sandbox = Sandbox::new();
    let check = |more: &[&str]| sandbox.call(&[&["check", "study.toml"], more].concat());
    assert!(check(&DOUBTFUL).status.success() && check(&["--strict"]).status.success());
    let strict = check(&[&DOUBTFUL[..], &["--strict"]].concat());
    assert_eq!(strict.status.code(), Some(1), "{}", words(&strict));
    let last = "error: 1 warning, which --strict makes a failure: the study is valid without it";
    assert_eq!(words(&strict).lines().last(), Some(last));
    assert!(String::from_utf8_lossy(&strict.stdout).contains("# valid; needs about"));
}

/// A study from standard input is the study of a file: the same bits, in the directory of its name.
#[test]
fn a_study_comes_from_standard_input() {
    let sandbox = Sandbox::new();
    assert!(sandbox.call(&["run", "study.toml", "--out", "file", "--set", "grid.cells=[7,5]"]).status.success());
    let piped = sandbox.fed(STUDY.as_bytes(), &["run", "-", "--set", "grid.cells=[7,5]"]);
    assert!(piped.status.success(), "{}", words(&piped));
    for name in ["final.npz", "study.toml", "mesh.svg"] {
        let [file, piped] = ["file", "out/piped"].map(|out| std::fs::read(sandbox.path(out).join(name)).unwrap());
        assert!(file == piped, "{name} differs");
    }
    let checked = sandbox.fed(STUDY.as_bytes(), &["check", "-"]);
    assert!(checked.status.success() && checked.stdout.starts_with(b"[study]"), "{}", words(&checked));
}

/// Mistakes in what comes from standard input have their line and column, and nothing is written.
#[test]
fn mistakes_in_standard_input_have_their_place() {
    let sandbox = Sandbox::new();
    let cases: [(String, &[&str], &[&str]); 6] = [
        (
            STUDY.replace("viscosity", "viscocity"),
            &["run", "-"],
            &["standard input:12:1", "viscocity = 0.05", "^", "did you mean `viscosity`?"],
        ),
        (STUDY.replace("1e-2", "-1"), &["check", "-"], &["standard input:9:8", "`time.step` is -1"]),
        (STUDY.replace("[grid]", "[grid"), &["check", "-"], &["standard input:4:"]),
        (String::new(), &["run", "-"], &["cannot read standard input: it is empty"]),
        (" \n\n".into(), &["check", "-"], &["cannot read standard input: it is empty"]),
        (
            STUDY.into(),
            &["run", "-", "--resume"],
            &["`--resume` is given with -", "driftmesh run DIR/study.toml --out DIR --resume"],
        ),
    ];
    for (input, arguments, expected) in cases {
        let output = sandbox.fed(input.as_bytes(), arguments);
        let said = words(&output);
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(said.starts_with("error: ") && said.matches("error: ").count() == 1, "{said}");
        expected.iter().for_each(|part| assert!(said.contains(part), "{part:?} is not in\n{said}"));
        assert!(!sandbox.path("out").exists());
    }
    let output = sandbox.fed(b"name = \"\xff\"", &["check", "-"]);
    assert!(words(&output).contains("cannot read standard input: it is not UTF-8 text (byte 8"), "{}", words(&output));
}

/// A run whose study came from standard input cannot read it again: what goes on is told by the study in its directory.
#[test]
fn a_piped_run_that_ends_early_says_how_it_goes_on() {
    let sandbox = Sandbox::new();
    assert!(sandbox.call(&["run", "study.toml", "--out", "whole", "--set", "time.end=0.77"]).status.success());
    // a limit of the size of files stands for a full disk
    let run = format!(
        "ulimit -f 60; exec '{PROGRAM}' run - --out 'cut off' --set output.checkpoint.steps=7 --set time.end=0.77 \
         < study.toml"
    );
    let output = sandbox.shell(&run);
    let said = words(&output);
    assert_eq!(output.status.code(), Some(1), "{said}");
    let go_on = said.split("go on with: ").nth(1).unwrap().lines().next().unwrap();
    assert!(go_on.ends_with(" run 'cut off/study.toml' --out 'cut off' --resume"), "{go_on}");
    let output = sandbox.shell(go_on);
    assert!(output.status.success(), "{}", words(&output));
    let [whole, cut] = ["whole", "cut off"].map(|out| std::fs::read(sandbox.path(out).join("final.npz")).unwrap());
    assert!(whole == cut);
}

/// Whatever the kind of study, and however the run ended, there is a list of warnings.
#[test]
fn there_is_always_a_list_of_warnings() {
    let sandbox = Sandbox::new();
    let studies = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().join("studies");
    let front = ["time.end=0.02", "time.report=[0.02]", "grid.cells=[8,6,6]"];
    for (study, sets, status) in [
        ("burgers-b-conservative", &["grid.cells=[6,5]", "time.end=0.26", "time.report=[0.26]"][..], "completed"),
        ("burgers-b-conservative", &["monitor.strength.absolute=1e308", "pde.viscosity=1e-6"], "failed"),
        ("laplacian-model-problem", &[], "completed"),
        ("laplacian-model-problem", &["exact.u=\"log(x - 9)\""], "failed"),
        ("stefan-slides", &front, "completed"),
        ("stefan-slides", &[&front[..], &["phase.lower.boundary=\"-1\""]].concat(), "failed"),
        ("moving-front-1d", &["time.end=0.01"], "completed"),
        ("schwarz-not-converged", &[], "not-converged"),
    ] {
        let file = studies.join(format!("{study}.toml"));
        let mut arguments = vec!["run", file.to_str().unwrap(), "--out", "out"];
        sets.iter().for_each(|set| arguments.extend(["--set", set]));
        let output = sandbox.call(&arguments);
        let summary = sandbox.summary("out");
        assert_eq!(summary["status"], status, "{study}: {}", words(&output));
        assert!(summary["warnings"].is_array(), "{study}, {status}: {summary}");
        std::fs::remove_dir_all(sandbox.path("out")).unwrap();
    }
}

/// Several processes of a program without MPI would write over each other: each refuses, and says what to do.
#[cfg(not(feature = "mpi"))]
#[test]
fn a_program_without_mpi_is_not_started_several_times() {
    let sandbox = Sandbox::new();
    for name in ["OMPI_COMM_WORLD_SIZE", "PMI_SIZE"] {
        let call = |count: &str| sandbox.shell(&format!("{name}={count} {PROGRAM} run study.toml --out out"));
        let several = call("4");
        let said = words(&several);
        assert_eq!(several.status.code(), Some(2), "{said}");
        assert!(said.contains("error: 4 processes were started for one run"), "{said}");
        assert!(said.contains("--features mpi") && !sandbox.path("out").exists(), "{said}");
        assert!(call("1").status.success());
        std::fs::remove_dir_all(sandbox.path("out")).unwrap();
    }
}
