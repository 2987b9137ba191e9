//! Runs that are interrupted, or meet a full disk: what they say, what they leave, and how they go on.

#![cfg(unix)]

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

const PROGRAM: &str = env!("CARGO_BIN_EXE_driftmesh");
/// Two seconds or so.
const STUDY: &str = r#"
[study]
name = "short run"
kind = "moving-mesh"
[grid]
cells = [12, 10]
[time]
start = 0.25
end = 0.35
step = 1e-5
report = [0.3, 0.35]
[pde]
kind = "burgers"
viscosity = 0.005
[output]
frames = { every = 1000 }
report = false
"#;

struct Sandbox(tempfile::TempDir);

impl Sandbox {
    fn new(study: &str) -> Self {
        let directory = tempfile::tempdir().unwrap();
        std::fs::write(directory.path().join("a study.toml"), study.replace("short run", "short")).unwrap();
        Self(directory)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn command(&self, program: &str, arguments: &[&str]) -> Command {
        let mut command = Command::new(program);
        command.args(arguments).current_dir(self.0.path()).stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    }

    /// Starts a run and waits until it has written a file.
    fn started(&self, arguments: &[&str], file: &str) -> Child {
        let child = self.command(PROGRAM, &[&["run", "a study.toml"], arguments].concat()).spawn().unwrap();
        let begun = Instant::now();
        while !self.path(file).exists() {
            assert!(begun.elapsed() < Duration::from_secs(60), "{file} was never written");
            std::thread::sleep(Duration::from_millis(5));
        }
        child
    }

    fn status(&self, directory: &str) -> String {
        let text = std::fs::read_to_string(self.path(directory).join("summary.json")).unwrap();
        serde_json::from_str::<serde_json::Value>(&text).unwrap()["status"].as_str().unwrap().into()
    }
}

fn signal(child: &Child, name: &str) {
    assert!(Command::new("kill").args([&format!("-{name}"), &child.id().to_string()]).status().unwrap().success());
}

fn words(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

fn files(directory: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(directory).unwrap().map(|entry| entry.unwrap().path());
    entries.flat_map(|path| if path.is_dir() { files(&path) } else { vec![path] }).collect()
}

fn checkpoints(directory: &Path) -> usize {
    files(directory).iter().filter(|path| path.to_string_lossy().contains("checkpoint")).count()
}

/// Ctrl-C and SIGTERM end a run with its step, status 1 and the command that goes on; that command ends where an
/// undisturbed run does, and then has nothing left to do.
#[test]
fn signals_leave_a_checkpoint_and_the_way_on() {
    let sandbox = Sandbox::new(STUDY);
    assert!(sandbox.command(PROGRAM, &["run", "a study.toml", "--out", "whole"]).status().unwrap().success());
    for name in ["INT", "TERM"] {
        let out = format!("after {name}");
        let frame = format!("{out}/frames/step-001000.vtu");
        let child = sandbox.started(&["--out", &out], &frame);
        signal(&child, name);
        let output = child.wait_with_output().unwrap();
        let said = words(&output);
        assert_eq!(output.status.code(), Some(1), "{said}");
        assert!(said.contains("error: interrupted at t = 0.") && !said.contains("panicked"), "{said}");
        assert_eq!(sandbox.status(&out), "interrupted");
        assert_eq!(checkpoints(&sandbox.path(&out)), 1);

        // the same without --resume says what it would replace
        let anew = sandbox.command(PROGRAM, &["run", "a study.toml", "--out", &out, "--set", "time.step=0"]);
        assert_eq!({ anew }.output().unwrap().status.code(), Some(2));
        let go_on = said.split("go on with: ").nth(1).unwrap().lines().next().unwrap();
        assert!(go_on.ends_with("--resume") && go_on.contains(&format!("'{out}'")), "{go_on}");
        let output = sandbox.command("sh", &["-c", go_on]).output().unwrap();
        assert!(output.status.success(), "{}", words(&output));
        assert_eq!(checkpoints(&sandbox.path(&out)), 0);
        for file in ["final.npz", "run.pvd", "mesh.png"] {
            let [whole, cut] = ["whole", out.as_str()].map(|d| std::fs::read(sandbox.path(d).join(file)).unwrap());
            assert!(whole == cut, "{file} differs after {name}");
        }
        let again = sandbox.command("sh", &["-c", go_on]).output().unwrap();
        assert!(again.status.success() && again.stdout.starts_with(b"complete: "), "{}", words(&again));
    }
}

/// A second Ctrl-C does not wait for the step, nor for the mesh at the start.
#[test]
fn a_second_signal_ends_at_once() {
    let sandbox = Sandbox::new(&STUDY.replace("[12, 10]", "[900, 900]"));
    let mut child = sandbox.started(&["--out", "out"], "out/summary.json");
    signal(&child, "INT");
    std::thread::sleep(Duration::from_millis(100));
    signal(&child, "INT");
    let sent = Instant::now();
    assert_eq!(child.wait().unwrap().code(), Some(1));
    assert!(sent.elapsed() < Duration::from_secs(2), "{:?}", sent.elapsed());
}

/// What the directory holds is said before it is replaced, and where there is nothing to go on from.
#[test]
fn what_is_replaced_is_said() {
    let sandbox = Sandbox::new(&STUDY.replace("end = 0.35", "end = 0.2501").replace("[0.3, 0.35]", "[0.2501]"));
    let run = |more: &[&str]| {
        let output =
            sandbox.command(PROGRAM, &[&["run", "a study.toml", "--out", "out"], more].concat()).output().unwrap();
        assert!(output.status.success(), "{}", words(&output));
        words(&output)
    };
    assert!(run(&["--resume"]).contains("note: nothing to go on from in out: the run begins at its start"));
    std::fs::remove_file(sandbox.path("out/final.state")).unwrap();
    std::fs::write(sandbox.path("out/checkpoint.1"), "of another run").unwrap();
    let refused = sandbox.command(PROGRAM, &["run", "a study.toml", "--out", "out", "--resume"]).output().unwrap();
    assert_eq!(refused.status.code(), Some(2));
    let said = words(&refused);
    assert!(said.contains("checkpoint.1: it is no checkpoint") && said.contains("leave --resume out"), "{said}");
    assert!(run(&[]).contains("warning: out holds an unfinished run, which this one replaces; with --resume it would"));
    assert_eq!(checkpoints(&sandbox.path("out")), 0);
}

/// A disk that fills up: an error that names the file, no panic, and no file that is half written under its name. With
/// space again the run goes on to the same results.
#[test]
fn a_full_disk_is_named_and_the_run_goes_on() {
    let study = STUDY.replace("step = 1e-5", "step = 1e-3").replace("every = 1000", "every = 10");
    let sandbox = Sandbox::new(&study.replace("[12, 10]", "[5, 4]").replace("viscosity = 0.005", "viscosity = 0.05"));
    assert!(sandbox.command(PROGRAM, &["run", "a study.toml", "--out", "whole"]).status().unwrap().success());
    // a limit for each file stands for the full disk: it is met by the first files, a frame or a checkpoint, the
    // history, the picture
    for (blocks, expected) in [(1, "cannot write"), (8, "/"), (24, "history.csv"), (60, "/mesh.")] {
        let out = format!("limited to {blocks}");
        let run = format!(
            "ulimit -f {blocks}; exec '{PROGRAM}' run 'a study.toml' --out '{out}' --set output.checkpoint.steps=7"
        );
        let output = sandbox.command("sh", &["-c", &run]).output().unwrap();
        let said = words(&output);
        assert_eq!(output.status.code(), Some(1), "{blocks}: {said}");
        assert!(said.contains("error: cannot write ") && said.contains("File too large"), "{blocks}: {said}");
        assert!(said.contains(expected) && said.contains("help: free some space"), "{blocks}: {said}");
        assert!(!said.contains("panicked"), "{said}");
        assert!(blocks < 24 || said.contains("; then go on with: ") && said.contains("everything up to"), "{said}");
        for path in files(&sandbox.path(&out)) {
            let bytes = std::fs::read(&path).unwrap();
            match path.extension().and_then(|extension| extension.to_str()) {
                Some("json") => assert!(serde_json::from_slice::<serde_json::Value>(&bytes).is_ok()),
                Some("vtu" | "pvd") => assert!(bytes.ends_with(b"</VTKFile>\n"), "{}", path.display()),
                Some("part") => panic!("{} was left", path.display()),
                _ => {}
            }
        }
        let on = ["run", "a study.toml", "--out", &out, "--resume"];
        let output = sandbox.command(PROGRAM, &on).output().unwrap();
        assert!(output.status.success(), "{blocks}: {}", words(&output));
        for file in ["final.npz", "run.pvd", "mesh.png"] {
            let [whole, cut] = ["whole", out.as_str()].map(|d| std::fs::read(sandbox.path(d).join(file)).unwrap());
            assert!(whole == cut, "{blocks}: {file} differs");
        }
    }
}

/// A disk that is full only once everything is computed: no run of any kind is then called completed, and each is with
/// space again.
#[test]
fn a_picture_that_cannot_be_written_fails_the_run() {
    let sandbox = Sandbox::new(STUDY);
    let studies = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().join("studies");
    // limits of a file in blocks of half a kilobyte, below the size of the one named
    for (study, more, blocks, named) in [
        (
            "burgers-b-conservative",
            "--set time.end=0.26 --set time.report=[0.26] --set grid.cells=[5,4]",
            130,
            "mesh.svg",
        ),
        ("stefan-slides", "--set time.end=0.05 --set time.report=[0.05]", 600, "mesh.png"),
        ("moving-front-1d", "", 700, "report.html"),
        ("annulus-perturbed-published", "", 1000, "mesh.png"),
    ] {
        let run = format!("exec '{PROGRAM}' run '{}/{study}.toml' --out {study} {more}", studies.display());
        let output = sandbox.command("sh", &["-c", &format!("ulimit -f {blocks}; {run}")]).output().unwrap();
        let said = words(&output);
        assert_eq!(output.status.code(), Some(1), "{study}: {said}");
        assert!(said.contains("error: cannot write ") && said.contains(named), "{study}: {said}");
        assert!(!said.contains("picture  ") || sandbox.path(study).join("mesh.png").is_file(), "{study}: {said}");
        assert_eq!(sandbox.status(study), "failed", "{study}");
        let output = sandbox.command("sh", &["-c", &format!("{run} --resume")]).output().unwrap();
        assert!(output.status.success(), "{study}: {}", words(&output));
        assert_eq!(sandbox.status(study), "completed", "{study}");
        for file in ["mesh.png", "report.html"] {
            assert!(sandbox.path(study).join(file).is_file(), "{study}: {file}");
        }
    }
}

/// What is not printed is an error: the study that `check` resolves, cut off, is another study.
#[test]
#[cfg(target_os = "linux")]
fn standard_output_on_a_full_disk_is_an_error() {
    let sandbox = Sandbox::new(STUDY);
    for verb in ["check 'a study.toml'", "list", "schema"] {
        let output = sandbox.command("sh", &["-c", &format!("exec '{PROGRAM}' {verb} >/dev/full")]).output().unwrap();
        assert_eq!(output.status.code(), Some(1), "{verb}");
        assert!(words(&output).contains("error: cannot write standard output: No space left"), "{}", words(&output));
    }
}

/// A directory in the place of the newest checkpoint: the one before it is taken.
#[test]
fn what_is_no_file_is_no_checkpoint() {
    let sandbox = Sandbox::new(&STUDY.replace("step = 1e-5", "step = 1e-3"));
    let run = format!("exec '{PROGRAM}' run 'a study.toml' --out out --set output.checkpoint.steps=7");
    // a full disk leaves both checkpoints
    let output = sandbox.command("sh", &["-c", &format!("ulimit -f 60; {run}")]).output().unwrap();
    assert_eq!((output.status.code(), checkpoints(&sandbox.path("out"))), (Some(1), 2), "{}", words(&output));
    let newest = sandbox.path("out/checkpoint.1");
    std::fs::remove_file(&newest).unwrap();
    std::fs::create_dir(&newest).unwrap();
    let output = sandbox.command("sh", &["-c", &format!("{run} --resume")]).output().unwrap();
    assert!(words(&output).contains("checkpoint.1 was left out"), "{}", words(&output));
}

/// Readers that close the pipe early do not end a run.
#[test]
fn a_closed_pipe_does_not_end_a_run() {
    let sandbox = Sandbox::new(&STUDY.replace("step = 1e-5", "step = 1e-3"));
    let run = format!("'{PROGRAM}' run 'a study.toml' --out out 2>&1 | head -n 1");
    let output = sandbox.command("sh", &["-c", &run]).output().unwrap();
    assert!(output.status.success() && output.stdout.starts_with(b"t = 0."), "{}", words(&output));
    let done = Instant::now();
    while sandbox.status("out") == "running" && done.elapsed() < Duration::from_secs(20) {
        std::thread::sleep(Duration::from_millis(20));
    }
    assert_eq!(sandbox.status("out"), "completed");
}
