//! One run on several ranks. `make mpi` runs this; `mpirun` finds in the environment what it needs on a small machine.

use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

const PROGRAM: &str = env!("CARGO_BIN_EXE_driftmesh");
/// The longest that anything here takes on a busy machine: what takes longer hangs.
const PATIENCE: Duration = Duration::from_secs(120);

const BURGERS: &str = r#"
[study]
name = "ranks"
kind = "moving-mesh"
[grid]
cells = [16, 14]
[time]
start = 0.25
end = 0.29
step = 1e-2
[pde]
kind = "burgers"
viscosity = 0.02
[output]
report = false
"#;
const WAVES: &str = r#"
[study]
name = "ranks"
kind = "moving-mesh"
[domain]
lower = [0.0, 0.0]
upper = [6.283185307179586, 6.283185307179586]
periodic = [true, true]
[grid]
cells = [16, 14]
[time]
start = 0.0
end = 0.015
step = 5e-3
[pde]
kind = "shallow-water"
form = "flux"
gravity = 1.0
depth = 10.0
pile = 2.5
radius = 1.0
width = 0.6
[mesh]
relaxation = 1.0
[output]
report = false
"#;
const REACTION: &str = r#"
[study]
name = "ranks"
kind = "moving-mesh"
[domain]
periodic = [true, false]
[grid]
cells = [16, 14]
[time]
start = 0.0
end = 0.03
step = 1e-2
[pde]
kind = "formula"
unknowns = ["u", "v"]
diffusivity = { u = "0.02", v = "0.01" }
source = { u = "-u*v^2 + 0.04*(1 - u)", v = "u*v^2 - 0.1*v" }
initial = { u = "1 - v0(x, y)/2", v = "v0(x, y)" }
boundary = { u = "no-flux", v = "no-flux" }
[data]
v0 = { file = "spot.csv", lower = [0.0, 0.0], upper = [1.0, 1.0] }
[output]
report = false
"#;
const LINE: &str = r#"
[study]
name = "ranks"
kind = "moving-mesh"
[domain]
lower = [0.0]
upper = [1.0]
[grid]
cells = [40]
[time]
start = 0.0
end = 0.03
step = 1e-2
[pde]
kind = "burgers"
viscosity = 0.02
initial = "sin(2*pi*x)"
boundary = "0"
[output]
report = false
"#;

struct Sandbox(tempfile::TempDir);

impl Sandbox {
    fn new(study: &str) -> Self {
        let directory = tempfile::tempdir().unwrap();
        std::fs::write(directory.path().join("study.toml"), study).unwrap();
        let spot = |i: i32, j: i32| 0.5 * (-0.2 * f64::from((i - 5).pow(2) + (j - 4).pow(2))).exp();
        let row = |i: i32| (0..9).map(|j| format!("{:.4}", spot(i, j))).collect::<Vec<_>>().join(",");
        let rows: Vec<String> = (0..11).map(|i| row(i % 10)).collect();
        std::fs::write(directory.path().join("spot.csv"), rows.join("\n")).unwrap();
        Self(directory)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn spawn(&self, words: &[&str]) -> Child {
        let mut command = Command::new(words[0]);
        command.args(&words[1..]).current_dir(self.0.path());
        command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
    }

    fn call(&self, words: &[&str]) -> Output {
        waited(self.spawn(words))
    }

    /// Runs the study without `mpirun`.
    fn alone(&self, out: &str, more: &[&str]) -> Output {
        self.call(&[&[PROGRAM, "run", "study.toml", "--out", out, "--threads", "1"], more].concat())
    }

    /// Runs the study on so many ranks.
    fn ranks(&self, ranks: usize, out: &str, more: &[&str]) -> Output {
        self.call(&[&words_for(&ranks.to_string(), out), more].concat())
    }

    fn summary(&self, out: &str) -> Value {
        serde_json::from_str(&std::fs::read_to_string(self.path(out).join("summary.json")).unwrap()).unwrap()
    }

    /// The results of a run to the last bit, and its counters.
    fn left(&self, out: &str) -> (Vec<u8>, String, Value) {
        let text = std::fs::read_to_string(self.path(out).join("history.csv")).unwrap();
        let row = |row: &str| row.rsplit_once(',').unwrap().0.to_string(); // seconds come last
        let history = text.lines().map(row).collect::<Vec<_>>().join("\n");
        let summary = self.summary(out);
        let counted = [&summary["work"], &summary["safety"], &summary["reports"], &summary["status"]];
        let arrays = std::fs::read(self.path(out).join("final.npz")).unwrap();
        (arrays, history, counted.into_iter().cloned().collect())
    }
}

fn words_for<'a>(ranks: &'a str, out: &'a str) -> [&'a str; 8] {
    ["mpirun", "-n", ranks, PROGRAM, "run", "study.toml", "--out", out]
}

/// What a process said, which must end.
fn waited(mut child: Child) -> Output {
    let began = Instant::now();
    while child.try_wait().unwrap().is_none() {
        if began.elapsed() > PATIENCE {
            let _ = child.kill();
            panic!("it hangs");
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    child.wait_with_output().unwrap()
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&[output.stdout.as_slice(), &output.stderr].concat()).into_owned()
}

#[track_caller]
fn assert_done(output: &Output) {
    assert!(output.status.success(), "{}", said(output));
}

/// A failure: its message once, and an exit status.
#[track_caller]
fn assert_failed(output: &Output, message: &str) -> String {
    let text = said(output);
    assert!(!output.status.success(), "{text}");
    assert_eq!(text.matches(message).count(), 1, "{message:?} once in {text}");
    assert!(!text.contains("panicked"), "{text}");
    text
}

/// Every number of ranks and threads has the bits of the program alone, and its counters of work.
#[track_caller]
fn assert_same(study: &str, generator: &str, more: &[&str]) {
    let sandbox = Sandbox::new(study);
    let generator = format!("--set=mesh.generator={generator}");
    let more = [&[generator.as_str()], more].concat();
    assert_done(&sandbox.alone("alone", &more));
    for (ranks, threads) in [(2, "2"), (3, "1"), (4, "1")] {
        let out = ranks.to_string();
        assert_done(&sandbox.ranks(ranks, &out, &[&more[..], &["--threads", threads]].concat()));
        assert!(sandbox.left(&out) == sandbox.left("alone"), "{generator} on {ranks} ranks differs");
        assert_eq!(sandbox.summary(&out)["parallel"]["ranks"], ranks);
    }
}

#[test]
fn bounded_burgers_has_the_same_bits_on_any_number_of_ranks() {
    assert_same(BURGERS, r#"{kind="stochastic",subdomains=[4,1]}"#, &[]);
    assert_same(BURGERS, r#"{kind="schwarz",subdomains=[1,4]}"#, &[]);
    assert_same(
        BURGERS,
        r#"{kind="stochastic",subdomains=[2,2],estimator={kind="strip"}}"#,
        &["--set=time.step=\"auto\""],
    );
    let monte = r#"{kind="stochastic",subdomains=[2,3],estimator={kind="monte-carlo",paths=40,substeps=4,sobol=true}}"#;
    assert_same(BURGERS, monte, &["--set=mesh.relaxation=10.0"]);
}

#[test]
fn periodic_shallow_water_has_the_same_bits_on_any_number_of_ranks() {
    assert_same(WAVES, r#"{kind="stochastic",subdomains=[2,2]}"#, &[]);
    assert_same(WAVES, r#"{kind="schwarz",subdomains=[4,1],method="optimized"}"#, &[]);
    assert_same(WAVES, r#"{kind="stochastic",subdomains=[1,4],estimator={kind="strip"}}"#, &[]);
}

/// Periodic along x, sides along y; with a table that rank 0 reads.
#[test]
fn a_reaction_has_the_same_bits_on_any_number_of_ranks() {
    assert_same(REACTION, r#"{kind="schwarz",subdomains=[2,2],overlap=4}"#, &[]);
    assert_same(
        REACTION,
        r#"{kind="stochastic",subdomains=[5,1],estimator={kind="grid-walk",walks=20,increment=true}}"#,
        &[],
    );
    assert_same(REACTION, r#"{kind="stochastic",subdomains=[1,4],interface={sample=5}}"#, &[]);
}

#[test]
fn a_line_has_the_same_bits_on_any_number_of_ranks() {
    assert_same(LINE, r#"{kind="stochastic",subdomains=[4]}"#, &[]);
    assert_same(LINE, r#"{kind="schwarz",subdomains=[5]}"#, &[]);
}

/// A mesh by the whole domain gains nothing from ranks, has the same bits, and says so once.
#[test]
fn ranks_without_subdomains_are_warned_of() {
    let sandbox = Sandbox::new(BURGERS);
    let set = "--set=mesh.generator={kind=\"whole\"}";
    assert_done(&sandbox.alone("alone", &[set]));
    let output = sandbox.ranks(2, "2", &[set]);
    assert_done(&output);
    assert_eq!(
        said(&output).matches("warning: 2 ranks compute the same, each on its own").count(),
        1,
        "{}",
        said(&output)
    );
    assert!(sandbox.left("2") == sandbox.left("alone"));
}

/// Messages and bytes that rank 0 receives in a step, of a run whose mesh takes one step in each.
fn received(ranks: usize, cells: [usize; 2], generator: &str) -> (f64, f64, u64) {
    let sandbox = Sandbox::new(BURGERS);
    let [generator, cells] = [format!("mesh.generator={generator}"), format!("grid.cells={cells:?}")];
    let plain = "mesh={relaxation=1.0,start=\"uniform\"}";
    let sets: Vec<String> = [plain, &generator, &cells].iter().map(|set| format!("--set={set}")).collect();
    let sets: Vec<&str> = sets.iter().map(String::as_str).collect();
    assert_done(&sandbox.ranks(ranks, "out", &sets));
    let summary = sandbox.summary("out");
    let figure = |name: &str| summary["parallel"][name].as_f64().unwrap();
    (figure("messages"), figure("bytes"), summary["work"]["linear_iterations"].as_u64().unwrap())
}

/// A step by strips takes two exchanges, with walks three, and one question whether to go on: 2 messages from each
/// other rank for an exchange and 1 for the question, however many iterations the solves inside subdomains take. A
/// Schwarz iteration takes an exchange, and so do its prediction and its end.
#[test]
fn messages_of_a_stochastic_step_depend_on_no_iteration() {
    let strip = r#"{kind="stochastic",subdomains=[2,2],estimator={kind="strip",width=3,coarse=1,exchanges=1}}"#;
    let (few, _, quick) = received(4, [16, 14], strip);
    let (many, _, slow) = received(4, [48, 40], strip);
    assert_eq!([few, many], [3.0 * 5.0; 2]);
    assert!(slow as f64 > 1.2 * quick as f64, "{slow} iterations are no more than {quick}");
    let walks = r#"{kind="stochastic",subdomains=[2,2],estimator={kind="residual-walk",sweeps=16,walks=10}}"#;
    assert_eq!(received(3, [16, 14], walks).0, 2.0 * 7.0);
    for iterations in [2, 5] {
        let schwarz = format!("{{kind=\"schwarz\",subdomains=[2,2],iterations={iterations}}}");
        assert_eq!(received(3, [16, 14], &schwarz).0, 2.0 * (2.0 * f64::from(iterations + 2) + 1.0));
    }
}

/// Two subdomains of 16 × 14 cells side by side: rank 1 owns 7 × 13 nodes, which it tells once as corrections of its
/// strip and once, with a ring, as positions; beside them stand lengths, success and counters of work.
#[test]
fn bytes_of_a_step_are_those_of_its_nodes() {
    let strip = r#"{kind="stochastic",subdomains=[2,1],estimator={kind="strip",width=3,coarse=1,exchanges=1}}"#;
    let (strips, positions) = (1 + 7 + 1 + 1 + 2 * 7 * 13, 1 + 1 + 2 * 9 * 15 + 7);
    let (lengths, question) = (2, 1);
    assert_eq!(received(2, [16, 14], strip).1, f64::from(8 * (strips + positions + lengths + question)));
}

/// Some hundred steps, with checkpoints.
const LONG: [&str; 3] = ["--set=time.step=1e-4", "--set=output={checkpoint={steps=20},report=false}", "--quiet"];
const WALKS: &str = "--set=mesh.generator={kind=\"stochastic\",subdomains=[2,2]}";

/// Starts a long run on two ranks, and waits for its first checkpoint.
fn begun(sandbox: &Sandbox, out: &str) -> Child {
    let child = sandbox.spawn(&[&words_for("2", out)[..], &LONG, &[WALKS]].concat());
    let began = Instant::now();
    while !sandbox.path(out).join("checkpoint.0").exists() {
        assert!(began.elapsed() < PATIENCE, "no checkpoint");
        std::thread::sleep(Duration::from_millis(5));
    }
    child
}

/// The processes that another one started.
fn children(of: &Child) -> Vec<String> {
    let listed = Command::new("ps").args(["-o", "pid=", "--ppid", &of.id().to_string()]).output().unwrap();
    String::from_utf8(listed.stdout).unwrap().split_whitespace().map(String::from).collect()
}

fn signal(process: &str, name: &str) {
    assert!(Command::new("kill").args([&format!("-{name}"), process]).status().unwrap().success());
}

/// A rank that is killed ends all, and leaves a checkpoint from which other numbers of ranks go on to the same bits. A
/// rank that is asked to end ends all after the same step.
#[test]
fn a_killed_rank_ends_all_and_any_number_of_ranks_goes_on() {
    let sandbox = Sandbox::new(BURGERS);
    assert_done(&sandbox.alone("alone", &[&LONG[..], &[WALKS]].concat()));
    let child = begun(&sandbox, "killed");
    signal(children(&child).last().unwrap(), "KILL");
    assert!(!waited(child).status.success());
    assert_done(&sandbox.ranks(3, "killed", &[&LONG[..], &[WALKS, "--resume"]].concat()));
    assert!(sandbox.left("killed") == sandbox.left("alone"));

    let child = begun(&sandbox, "asked");
    signal(children(&child).last().unwrap(), "TERM");
    assert_failed(&waited(child), "error: interrupted at t = 0.2");
    assert_eq!(sandbox.summary("asked")["status"], "interrupted");
    assert_done(&sandbox.alone("asked", &[&LONG[..], &[WALKS, "--resume"]].concat()));
    assert!(sandbox.left("asked") == sandbox.left("alone"));
    let again = sandbox.ranks(2, "asked", &[&LONG[1..2], &[LONG[0], WALKS, "--resume"]].concat());
    assert_done(&again);
    assert!(said(&again).contains("complete: asked needs nothing more"), "{}", said(&again));
}

/// A failure that all ranks have is told once, with what a failure leaves.
#[test]
fn a_failure_of_the_mathematics_is_told_once() {
    let sandbox = Sandbox::new(BURGERS);
    let sets = ["--set=mesh.generator={kind=\"schwarz\",subdomains=[2,2],tolerance=1e-10,iterations=2}"];
    let output = sandbox.ranks(2, "out", &sets);
    assert_failed(&output, "the Schwarz iteration stalled");
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(sandbox.summary("out")["status"], "failed");
}

/// 2 × 2 cells of the unit square, in the format of PLOT3D.
const MESH: &str = "3 3 1\n0 .5 1 0 .5 1 0 .5 1\n0 0 0 .5 .5 .5 1 1 1\n0 0 0 0 0 0 0 0 0\n";

/// A failure that one rank has alone is told by it, and ends all: here a mesh that rank 1 does not find.
#[test]
fn a_failure_of_one_rank_ends_all() {
    let sandbox = Sandbox::new(
        &BURGERS.replace("[grid]\ncells = [16, 14]", "[domain]\nmesh = \"mesh.xyz\"\n[grid]\ncells = [2, 2]"),
    );
    std::fs::write(sandbox.path("mesh.xyz"), MESH).unwrap();
    std::fs::create_dir(sandbox.path("elsewhere")).unwrap();
    let one =
        |place: &str| [["-n", "1", "-wdir", place].as_slice(), &[PROGRAM, "run", "study.toml"]].concat().join(" ");
    let words = format!("exec mpirun {} : {}", one(sandbox.0.path().to_str().unwrap()), one("elsewhere"));
    let output = sandbox.call(&["sh", "-c", &words]);
    let text = assert_failed(&output, "rank 1: error: ");
    assert!(text.contains("`domain.mesh` is \"mesh.xyz\", but cannot be read"), "{text}");
}

/// Rank 0 alone writes: where its disk is full, all end with its error, and it can go on.
#[test]
fn a_full_disk_ends_all() {
    let sandbox = Sandbox::new(BURGERS);
    // shared memory of Open MPI is a file, too
    let limited =
        format!("ulimit -f 12; exec {PROGRAM} run study.toml --out out '{WALKS}' {}", "--set=output.frames.every=1");
    let output = sandbox.call(&["mpirun", "--mca", "btl", "self,tcp", "-n", "2", "sh", "-c", &limited]);
    assert_failed(&output, "error: cannot write out/");
    assert_eq!(output.status.code(), Some(1));
}

#[test]
fn bad_input_is_refused_by_one_message() {
    let sandbox = Sandbox::new(BURGERS);
    let halves = "--set=mesh.generator={kind=\"stochastic\",subdomains=[2,1]}";
    let text = assert_failed(&sandbox.ranks(3, "out", &[halves]), "3 ranks need one subdomain each");
    assert!(text.contains("mesh.generator.subdomains") && text.contains("or start 2 of them"), "{text}");
    let output = sandbox.call(&["mpirun", "-n", "2", PROGRAM, "run", "missing.toml"]);
    assert_failed(&output, "error: cannot read missing.toml");
    assert_eq!(output.status.code(), Some(2));
    let one = format!("-n 1 {PROGRAM} run study.toml --out out");
    let output = sandbox.call(&["sh", "-c", &format!("exec mpirun {one} : {one} --set pde.viscosity=0.03")]);
    assert_failed(&output, "error: rank 1 has another study than rank 0");
    std::fs::create_dir(sandbox.path("full")).unwrap();
    std::fs::write(sandbox.path("full/letter"), "mine").unwrap();
    assert_failed(&sandbox.ranks(2, "full", &[]), "error: full is not empty");
    assert!(!Path::new(&sandbox.path("out")).exists());
}
