//! Reports of runs that are finished, interrupted or damaged, as a user meets them.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

struct Run {
    sandbox: tempfile::TempDir,
}

const SHORT: [&str; 4] = ["grid.cells=[12,10]", "time.end=0.27", "time.report=[0.26,0.27]", "output.frames.every=5"];

impl Run {
    /// A short study, run into `out` with settings laid over it.
    fn new(set: &[&str]) -> Self {
        Self::of("burgers-b-stochastic", &[&SHORT, set].concat())
    }

    /// The same, where it fails.
    fn failing(set: &[&str]) -> Self {
        let (run, output) = Self::ended("burgers-b-stochastic", &[&SHORT, set].concat());
        assert_eq!(output.status.code(), Some(1), "{}", words(&output));
        run
    }

    /// A study of ours.
    fn of(name: &str, set: &[&str]) -> Self {
        let (run, output) = Self::ended(name, set);
        assert!(output.status.success(), "{}", words(&output));
        run
    }

    fn ended(name: &str, set: &[&str]) -> (Self, Output) {
        let run = Self { sandbox: tempfile::tempdir().unwrap() };
        let study = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../studies/{name}.toml"));
        let mut arguments = vec!["run", study.to_str().unwrap(), "--quiet", "--out", "out"];
        set.iter().for_each(|assignment| arguments.extend(["--set", assignment]));
        let output = run.call(&arguments);
        (run, output)
    }

    fn call(&self, arguments: &[&str]) -> Output {
        let program = env!("CARGO_BIN_EXE_driftmesh");
        Command::new(program).args(arguments).current_dir(self.sandbox.path()).output().unwrap()
    }

    fn path(&self, name: &str) -> PathBuf {
        self.sandbox.path().join("out").join(name)
    }

    fn text(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).unwrap()
    }

    /// The page, rebuilt, and what was said about it.
    fn rebuilt(&self) -> (String, String) {
        let output = self.call(&["report", "out"]);
        assert!(output.status.success(), "{}", words(&output));
        // slashes stand there by number
        (self.text("report.html").replace("&#x2f;", "/"), words(&output))
    }
}

fn words(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

/// Data of the viewer on a page.
fn viewer(html: &str) -> serde_json::Value {
    let (_, rest) = html.split_once("id=\"viewer-data\">").expect("a viewer");
    serde_json::from_str(rest.split_once("</script>").unwrap().0).unwrap()
}

#[test]
fn a_run_leaves_the_report_that_can_be_rebuilt() {
    let run = Run::new(&[]);
    let first = run.text("report.html");
    // nothing is fetched
    for outside in ["http://", "https://", "src=\"//", "@import", "url("] {
        let found: Vec<&str> = first.match_indices(outside).map(|(at, _)| &first[at..at + 60]).collect();
        assert!(found.iter().all(|text| text.starts_with("http://www.w3.org/2000/svg")), "{found:?}");
    }
    let data = viewer(&first);
    assert_eq!(data["meshes"].as_array().unwrap().len(), 2, "the mesh and the one it is compared with");
    assert_eq!(data["meshes"][0]["times"].as_array().unwrap().len(), 5);
    assert_eq!(data["meshes"][0]["cuts"], serde_json::json!([[3, 6, 9], [3, 5, 8]]));
    for name in ["error.svg", "error.png", "quality.svg", "quality.png", "compare.pvd"] {
        assert!(run.path(name).is_file(), "{name}");
    }
    assert!(run.text("quality.svg").contains("@font-face"), "the font is embedded");
    let (second, said) = run.rebuilt();
    assert_eq!((viewer(&second), said.as_str()), (data, ""));
    // what a run leaves is removed by the next
    std::fs::write(run.path("mine.txt"), "mine").unwrap();
    let study = run.path("study.toml").with_file_name("again.toml");
    std::fs::copy(run.path("study.toml"), &study).unwrap();
    let off = ["--set", "output.report=false", "--set", "compare.generator.kind=fixed"];
    let output = run.call(&[&["run", "out/again.toml", "--quiet", "--out", "out"], &off[..]].concat());
    assert!(output.status.success(), "{}", words(&output));
    for gone in ["report.html", "quality.svg", "error.png"] {
        assert!(!run.path(gone).exists(), "{gone}");
    }
    assert!(run.path("mine.txt").is_file());
}

#[test]
fn an_interrupted_run_has_a_report_of_what_is_there() {
    let run = Run::new(&["output.report=false"]);
    // as a run leaves it that was killed: no end, half a row, half a frame
    let summary = run.text("summary.json").replace("\"completed\"", "\"running\"");
    std::fs::write(run.path("summary.json"), summary).unwrap();
    let history = run.text("history.csv");
    std::fs::write(run.path("history.csv"), &history[..history.len() - 40]).unwrap();
    let frame = run.text("frames/step-000020.vtu");
    std::fs::write(run.path("frames/step-000020.vtu"), &frame[..2000]).unwrap();
    std::fs::remove_file(run.path("frames/step-000005.vtu")).unwrap();
    std::fs::remove_file(run.path("compare.pvd")).unwrap();
    let (html, said) = run.rebuilt();
    assert!(html.contains("before its end. This is what it left."));
    for part in ["frames/step-000020.vtu is left out", "frames/step-000005.vtu is left out", "history.csv: 1 row(s)"] {
        assert!(said.contains(part) && html.contains(part), "{part:?} is not in {said}");
    }
    let data = viewer(&html);
    assert_eq!(data["meshes"].as_array().unwrap().len(), 1);
    assert_eq!(data["meshes"][0]["times"], serde_json::json!([0.25, 0.26, 0.265]));
}

#[test]
fn values_that_are_not_finite_are_not_shown() {
    let run = Run::new(&["output.report=false"]);
    let history = run.text("history.csv");
    let mut lines: Vec<String> = history.lines().map(String::from).collect();
    lines[3] = lines[3].replacen(lines[3].split(',').nth(3).unwrap(), "NaN", 1);
    std::fs::write(run.path("history.csv"), lines.join("\n")).unwrap();
    let (html, _) = run.rebuilt();
    assert!(!html.replace("isNaN", "").contains("NaN"), "NaN on the page");
}

#[test]
fn names_from_outside_stay_text() {
    let run = Run::new(&["output.report=false"]);
    let evil = "</script><script>alert(1)</script><img src=x onerror=alert(2)>";
    let summary = run.text("summary.json").replacen("burgers-b-stochastic", evil, 1);
    std::fs::write(run.path("summary.json"), summary).unwrap();
    let study = run.text("study.toml").replace("name = \"burgers-b-stochastic\"", &format!("name = \"{evil}\""));
    let study = study.replace("kind = \"stochastic\"", &format!("kind = \"{evil}\""));
    std::fs::write(run.path("study.toml"), study).unwrap();
    let (html, _) = run.rebuilt();
    assert!(!html.contains("<script>alert") && !html.contains("<img src=x"), "it is not escaped");
    assert_eq!(html.matches("<script").count(), 2, "the data and the viewer");
    assert!(viewer(&html)["meshes"][0]["name"].as_str().unwrap().starts_with(evil));
}

#[test]
fn a_directory_that_is_no_run_is_refused() {
    let sandbox = tempfile::tempdir().unwrap();
    let call = |name: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_driftmesh"));
        command.args(["report", name]).current_dir(sandbox.path()).output().unwrap()
    };
    std::fs::create_dir(sandbox.path().join("empty")).unwrap();
    std::fs::create_dir(sandbox.path().join("other")).unwrap();
    std::fs::write(sandbox.path().join("other/summary.json"), "[1]").unwrap();
    for (name, reason) in
        [("empty", "it has no summary.json"), ("other", "names no study"), ("nowhere", "No such file")]
    {
        let output = call(name);
        assert_eq!(output.status.code(), Some(2));
        assert!(
            words(&output).contains("is no run directory: ") && words(&output).contains(reason),
            "{}",
            words(&output)
        );
        assert!(!sandbox.path().join(name).join("report.html").exists());
    }
}

/// 201 × 201 nodes in many frames do not fit: some are shown, the first and the last among them, and the page says so.
#[test]
fn large_runs_are_thinned_and_say_so() {
    let run = Run::new(&[
        "grid.cells=[200,200]",
        "pde={kind=\"prescribed\",u=\"tanh(20*(x + y - 2*t))\"}",
        "mesh.generator.kind=whole",
        "compare.generator.kind=fixed",
        "time.end=0.29",
        "time.report=[0.29]",
        "output.frames.every=1",
        "output.report=false",
    ]);
    let (html, said) = run.rebuilt();
    assert!(html.len() < 5_000_000, "{} bytes", html.len());
    assert!(said.contains("of 41 frames") && html.contains("which keeps this page below 5 MB"), "{said}");
    let data = viewer(&html);
    let times = data["meshes"][0]["times"].as_array().unwrap();
    assert!((2..41).contains(&times.len()));
    assert_eq!([times[0].as_f64(), times[times.len() - 1].as_f64()], [Some(0.25), Some(0.29)]);
}

/// A line in time tells where it is, in plain lines where there is no terminal.
#[test]
fn a_line_tells_of_its_progress() {
    let run = Run { sandbox: tempfile::tempdir().unwrap() };
    let study = Path::new(env!("CARGO_MANIFEST_DIR")).join("../studies/moving-front-1d.toml");
    let arguments = ["run", study.to_str().unwrap(), "--out", "out", "--set", "time.end=0.04"];
    let loud = run.call(&arguments);
    let said = words(&loud);
    let lines: Vec<&str> = said.lines().filter(|line| line.starts_with("t = ")).collect();
    assert_eq!(lines.len(), 10, "{said}");
    assert!(
        lines[0].starts_with("t = 4.00e-3  step 4 of 40  min J 0.") && lines[9].contains("step 40 of 40"),
        "{said}"
    );
    assert!(words(&run.call(&[&arguments[..], &["--quiet"]].concat())).is_empty());
}

/// What fails in the run of [compare] is not called a failure of the run itself, which is whole.
#[test]
fn a_failure_of_the_compared_run_is_told_apart() {
    let run = Run::failing(&["compare.generator={kind=\"schwarz\",subdomains=[3,3],iterations=1,tolerance=1e-12}"]);
    let summary: serde_json::Value = serde_json::from_str(&run.text("summary.json")).unwrap();
    let told = |key: &str| summary["error"][key].as_str().unwrap_or_default().to_string();
    assert!(told("message").contains("the run itself is complete; in the one of [compare]: "), "{summary:#}");
    assert!(told("help").contains("compare.generator.iterations") && !told("help").contains("mesh.generator"));
    assert_eq!(summary["reports"].as_array().unwrap().len(), 2);
    assert!(run.text("report.html").contains("in the one of [compare]"));
}

/// A line too, whose iterates are the frames: in colours that are those of the curve.
#[test]
fn an_animation_of_a_line_has_every_iterate() {
    let run = Run::of("table-8-1-nonlinear", &["output.animation=true", "output.report=false"]);
    let file = std::fs::File::open(run.path("animation.gif")).unwrap();
    let mut gif = gif::DecodeOptions::new().read_info(file).unwrap();
    let palette = gif.global_palette().unwrap().to_vec();
    let blue = palette.chunks(3).position(|colour| colour == [0, 114, 178]).unwrap() as u8;
    let mut frames = 0;
    while let Some(frame) = gif.read_next_frame().unwrap() {
        assert!(frame.buffer.contains(&blue));
        frames += 1;
    }
    let files = std::fs::read_dir(run.path("frames")).unwrap().count();
    assert_eq!(frames, files);
    assert!(frames > 5, "{frames}");
}

#[test]
fn an_animation_has_every_frame() {
    let run = Run::new(&["output.animation=true", "output.report=false"]);
    assert!(!run.path("report.html").exists());
    let file = std::fs::File::open(run.path("animation.gif")).unwrap();
    let mut gif = gif::DecodeOptions::new().read_info(file).unwrap();
    let mut frames = Vec::new();
    while let Some(frame) = gif.read_next_frame().unwrap() {
        frames.push(frame.buffer.to_vec());
    }
    assert_eq!(frames.len(), 5);
    assert!(frames.windows(2).all(|pair| pair[0] != pair[1]), "the mesh moves");
}
