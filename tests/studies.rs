//! Every file in `studies/` is rerun against stored norms and work counters.
//!
//! The norms are those on which two other implementations agree, each with the tolerance that comes with it; the
//! counters are this implementation's own and hold exactly.

use driftmesh::geometry::DualCells;
use driftmesh::output::Summary;
use driftmesh::simulation::{Event, Observer, Snapshot};
use driftmesh::study::{Begin, Kind, MovingFigures, MovingMesh, Source};
use std::path::Path;

/// Follows x of node (10, 10).
#[derive(Default)]
struct Node {
    history: Vec<(f64, f64)>,
}

impl Observer for Node {
    fn observe(&mut self, _event: Event, snapshot: &Snapshot<'_>) -> driftmesh::Result<()> {
        let mesh = &snapshot.state::<2>().unwrap().mesh;
        self.history.push((snapshot.t, mesh.x()[mesh.lattice().index([10, 10])][0]));
        Ok(())
    }
}

fn rerun(name: &str) -> (Summary<MovingFigures>, Node) {
    let mut node = Node::default();
    (rerun_with(name, &mut node), node)
}

fn rerun_with(name: &str, observer: &mut dyn Observer) -> Summary<MovingFigures> {
    rerun_set(name, &[], observer)
}

fn rerun_set(name: &str, assignments: &[&str], observer: &mut dyn Observer) -> Summary<MovingFigures> {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("studies").join(format!("{name}.toml"));
    let mut source = Source::read(&file).unwrap();
    assignments.iter().for_each(|assignment| source.set(assignment).unwrap());
    let study = MovingMesh::from_source(&source).unwrap();
    let out = tempfile::tempdir().unwrap();
    let finished = study.run(&out.path().join("run"), Begin::Anew, &mut [observer]).unwrap();
    assert!(finished.failure.is_none(), "{name}: {:?}", finished.failure);
    finished.summary
}

/// Values at the three report times, each within its tolerance, relative.
fn assert_row(name: &str, what: &str, found: [f64; 3], expected: [f64; 3], tolerance: [f64; 3]) {
    for k in 0..3 {
        let off = (found[k] - expected[k]).abs() / expected[k];
        assert!(
            off <= tolerance[k],
            "{name}: {what} is {found:?}, expected {expected:?}, off by {off:.4} at report {k}"
        );
    }
}

fn linf(summary: &Summary<MovingFigures>) -> [f64; 3] {
    std::array::from_fn(|k| summary.figures.reports[k].error.unwrap().linf)
}

fn q_max(summary: &Summary<MovingFigures>) -> [f64; 3] {
    std::array::from_fn(|k| summary.figures.reports[k].quality.q_max)
}

fn q_mean(summary: &Summary<MovingFigures>) -> [f64; 3] {
    std::array::from_fn(|k| summary.figures.reports[k].quality.q_mean)
}

/// Counters: steps, Newton iterations and solves to the one; linear iterations to 1 %, since they turn on the last bit
/// of a residual and `exp` differs in it from system to system.
fn assert_work(summary: &Summary<MovingFigures>, newton: usize, solves: usize, iterations: usize) {
    let work = summary.figures.work.work;
    let name = &summary.study;
    assert_eq!(
        [summary.figures.work.steps, work.newton_iterations, work.linear_solves],
        [1000, newton, solves],
        "{name}"
    );
    assert!(
        work.linear_iterations.abs_diff(iterations) * 100 <= iterations,
        "{name}: {} iterations",
        work.linear_iterations
    );
}

const DIGITS: [f64; 3] = [0.02; 3];
const Q: [f64; 3] = [0.01; 3];

#[test]
fn case_b_conservative() {
    let name = "burgers-b-conservative";
    let (summary, _) = rerun(name);
    assert_row(name, "l_inf", linf(&summary), [0.0103, 0.0107, 0.0138], DIGITS);
    assert_row(name, "Q max", q_max(&summary), [2.148, 2.208, 2.639], Q);
    assert_work(&summary, 2001, 8001, 23465);
}

/// Largest of |R_max − 1|, |R_mean − 1| and the mesh's distance from the reference over the reports.
fn worst(summary: &Summary<MovingFigures>) -> [f64; 3] {
    let all = summary.figures.reports.iter().map(|report| report.comparison.expect("the study compares"));
    all.fold([0.0; 3], |m, c| [m[0].max((c.r_max - 1.0).abs()), m[1].max((c.r_mean - 1.0).abs()), m[2].max(c.mesh_rms)])
}

/// Case B on 4 × 4 subdomains: as good as the single domain, with the default and with the published k = 4, N = 10; a
/// single walk is not enough.
#[test]
fn case_b_by_residual_walks() {
    let name = "burgers-b-stochastic";
    let published = |walks: usize| {
        format!("mesh.generator.estimator={{kind=\"residual-walk\", sweeps=4, smoother=\"jacobi\", walks={walks}}}")
    };
    // the strips of the default are solved, two right-hand sides each but where the first step leaves six of them at
    // rest; those of the published one are swept
    for (settings, rms, solves) in [(vec![], 1e-6, 69_989), (vec![published(10)], 3e-5, 38_001)] {
        let settings: Vec<&str> = settings.iter().map(String::as_str).collect();
        let summary = rerun_set(name, &settings, &mut Node::default());
        assert_row(name, "l_inf", linf(&summary), [0.01032, 0.01066, 0.01375], [0.005; 3]);
        let [r_max, r_mean, mesh_rms] = worst(&summary);
        assert!(r_max <= 0.003 && r_mean <= 0.001 && mesh_rms <= rms, "{settings:?}: {r_max} {r_mean} {mesh_rms:e}");
        let work = summary.figures.work.work;
        assert_eq!([summary.figures.work.steps, work.newton_iterations, work.linear_solves], [1000, 2001, solves]);
        assert!((15_900_000..16_100_000).contains(&work.path_steps), "{} path steps", work.path_steps);
        let interface = summary.figures.reports[2].interface.unwrap();
        assert_eq!((interface.points, interface.walks, interface.exchanges), (225, 10, 1));
        // what the samples say of themselves is what the mesh shows
        assert!((0.3..3.0).contains(&(interface.standard_error.unwrap() / mesh_rms)), "{interface:?} {mesh_rms:e}");
    }
    let one = rerun_set(name, &[&published(1)], &mut Node::default());
    assert!(worst(&one)[2] > 3e-5, "one walk is enough: {:?}", worst(&one));
    assert_eq!(one.figures.reports[2].interface.unwrap().standard_error, None);
}

/// Case B by strips alone: R_max within .003 and the mesh within 3e-5, with what the program chooses and with 8 nodes
/// to each side; no warning, for a deterministic method has no noise to tell of.
#[test]
fn case_b_by_strips() {
    let name = "burgers-b-stochastic";
    for strip in ["{kind=\"strip\"}", "{kind=\"strip\", width=8, coarse=1, exchanges=1}"] {
        let summary = rerun_set(name, &[&format!("mesh.generator.estimator={strip}")], &mut Node::default());
        let [r_max, r_mean, mesh_rms] = worst(&summary);
        println!("{strip}: {r_max:.1e} {r_mean:.1e} {mesh_rms:.1e}");
        assert!(r_max <= 0.003 && r_mean <= 0.001 && mesh_rms <= 3e-5, "{strip}: {r_max} {r_mean} {mesh_rms:e}");
        let interface = summary.figures.reports[2].interface.unwrap();
        assert_eq!((interface.walks, interface.exchanges, interface.standard_error), (0, 1, None));
        assert!(summary.warnings.is_empty() && summary.figures.work.work.path_steps == 0, "{:?}", summary.warnings);
    }
}

/// Three iterations a step are three, no step is rejected for it, and Robin's conditions make a better mesh of as many.
#[test]
fn case_b_by_a_few_schwarz_iterations() {
    let rms = |method: &str| {
        let generator = format!("{{kind=\"schwarz\", subdomains=[4, 4], iterations=3, method=\"{method}\"}}");
        let settings =
            [&format!("mesh.generator={generator}"), "time.end=0.3", "time.report=[0.3]"].map(str::to_string);
        let settings: Vec<&str> = settings.iter().map(String::as_str).collect();
        let summary = rerun_set("burgers-b-schwarz", &settings, &mut Node::default());
        assert_eq!((summary.figures.work.steps, summary.figures.work.rejected_steps), (50, 0));
        let interface = summary.figures.reports[0].interface.unwrap();
        assert_eq!((interface.contraction.unwrap().iterations, interface.exchanges), (3, 3));
        worst(&summary)[2]
    };
    let (classical, optimized) = (rms("classical"), rms("optimized"));
    assert!(classical < 2e-4 && optimized < 0.2 * classical, "{classical:e} {optimized:e}");
}

/// Nothing set by hand: less than the errors of the recipe in two independent implementations (4.90e-3 on as many
/// nodes, 1.205e-2 on 51²), in a ninth of their steps, and the same on 4 × 4 subdomains.
#[test]
fn a_thin_front_without_a_number() {
    let (whole, _) = rerun("burgers");
    assert_row("burgers", "l_inf", linf(&whole), [5.03e-3, 6.79e-3, 9.41e-3], [0.1; 3]);
    assert!((90..148).contains(&whole.figures.work.steps), "{} steps", whole.figures.work.steps);
    assert!(whole.warnings.is_empty(), "{:?}", whole.warnings);
    let (walks, _) = rerun("burgers-stochastic");
    assert_row("burgers-stochastic", "l_inf", linf(&walks), linf(&whole), [0.01; 3]);
    let [r_max, r_mean, mesh_rms] = worst(&walks);
    assert!(r_max <= 0.003 && r_mean <= 0.001 && mesh_rms <= 1e-4, "{r_max} {r_mean} {mesh_rms:e}");
}

/// The second-order mesh that a run says to be as good is as good.
#[test]
fn the_uniform_mesh_of_the_same_error_has_it() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("studies/burgers.toml");
    let study = |set: &[&str]| {
        let mut source = Source::read(&file).unwrap();
        source.set("time.end=0.75").unwrap();
        source.set("time.report=[0.75]").unwrap();
        source.set("grid.cells=[20,20]").unwrap();
        source.set("pde.viscosity=2e-3").unwrap();
        set.iter().for_each(|assignment| source.set(assignment).unwrap());
        MovingMesh::from_source(&source).unwrap()
    };
    let moving = study(&[]).compute().unwrap().0.record.reports[0].clone();
    let found = study(&[]).uniform_equivalent(&moving).unwrap().unwrap();
    assert_eq!((found.thicker, found.t, found.nodes[0]), (2.5, 0.75, found.nodes[1]));
    let cells = format!("grid.cells={:?}", found.nodes.map(|n| n - 1));
    let uniform = ["mesh.generator={kind=\"fixed\"}", "time.stepper=\"rk4\"", "time.step=1.0", &cells];
    let uniform = study(&uniform).compute().unwrap().0.record.reports[0].error.unwrap().linf;
    let moving = moving.error.unwrap().linf;
    assert!((uniform / moving - 1.0).abs() < 0.1, "{uniform:e} on {:?} nodes against {moving:e}", found.nodes);
}

/// The published periodic problems run with nothing set by hand, too.
#[test]
fn periodic_studies_without_a_number() {
    for (name, most, contraction) in
        [("burgers-periodic-auto", 100, 0.7), ("dam-break-auto", 50, 1.0), ("rings-auto", 40, 0.7)]
    {
        let (summary, _) = rerun(name);
        let quality = summary.figures.reports.last().unwrap().quality;
        assert!(summary.figures.work.steps < most && summary.warnings.is_empty(), "{name}: {:?}", summary.figures.work);
        // the mesh has moved, far from folding; waves of water that spread leave equal cells again
        assert!((0.05..contraction).contains(&quality.min_scaled_jacobian), "{name}: {quality:?}");
        let drift = summary.figures.reports.last().unwrap().conserved.drift;
        assert!(name == "rings-auto" || drift.abs() < 1e-13, "{name}: {drift:e}");
    }
}

#[test]
fn case_b_by_schwarz() {
    let name = "burgers-b-schwarz";
    let summary = rerun_set(name, &["time.end=0.35", "time.report=[0.35]"], &mut Node::default());
    let [r_max, r_mean, mesh_rms] = worst(&summary);
    assert!(r_max < 1e-6 && r_mean < 1e-6 && mesh_rms < 1e-9, "{r_max:e} {r_mean:e} {mesh_rms:e}");
    let contraction = summary.figures.reports[0].interface.unwrap().contraction.unwrap();
    let predicted = contraction.predicted.unwrap();
    assert!(contraction.observed > 0.2 && contraction.observed < predicted && predicted < 0.7);
}

/// Rigid figures of two other implementations, and 4 × 4 subdomains as good as one.
#[test]
fn rings() {
    let summary = rerun_with("rings", &mut Node::default());
    let quality = summary.figures.reports[0].quality;
    assert!((quality.q_max / 1.480 - 1.0).abs() < 0.002 && (quality.q_mean / 1.140 - 1.0).abs() < 0.002, "{quality:?}");
    assert!(worst(&summary)[2] < 1e-6);
    // as published, by Monte Carlo with one substep
    let monte = "mesh.generator.estimator={kind=\"monte-carlo\", paths=2000, substeps=1}";
    let [r_max, r_mean, _] = worst(&rerun_set("rings", &[monte], &mut Node::default()));
    assert!(r_max < 0.02 && r_mean < 0.01, "{r_max} {r_mean}");
    // without smoothing the mesh is just not tangled
    let bare = ["monitor.gradient=central", "monitor.smoothing=0", "mesh.generator={kind=\"whole\"}"];
    let quality = rerun_set("rings", &bare, &mut Node::default()).figures.reports[0].quality;
    assert!((2.7..4.1).contains(&quality.q_max) && quality.min_scaled_jacobian > 0.0, "{quality:?}");
}

#[test]
fn periodic_burgers() {
    let summary = rerun_with("burgers-periodic", &mut Node::default());
    let [r_max, r_mean, mesh_rms] = worst(&summary);
    assert!(r_max < 0.001 && r_mean < 0.001 && mesh_rms < 1e-4, "{r_max:e} {r_mean:e} {mesh_rms:e}");
    for (report, q_max) in summary.figures.reports.iter().zip([1.342, 1.246]) {
        assert!((report.quality.q_max / q_max - 1.0).abs() < 0.002, "{:?}", report.quality);
    }
    assert_eq!([summary.figures.work.steps, summary.figures.work.work.newton_iterations], [200, 400]);
}

/// Also node (10, 10) to 2e-5 at all three times, and the smallest corner Jacobian.
#[test]
fn case_b_advective() {
    let name = "burgers-b-advective";
    let (summary, node) = rerun(name);
    assert_row(name, "l_inf", linf(&summary), [0.03076, 0.03413, 0.03307], DIGITS);
    assert_row(name, "Q max", q_max(&summary), [2.126, 2.232, 2.560], Q);
    assert_row(name, "Q mean", q_mean(&summary), [1.1111, 1.1420, 1.1299], Q);
    assert!((summary.figures.reports[0].quality.min_scaled_jacobian - 0.16936).abs() < 1e-5);
    for (t, expected) in [(0.75, 0.256858), (1.0, 0.270088), (1.25, 0.254841)] {
        let x = node.history.iter().find(|(time, _)| *time == t).unwrap().1;
        assert!((x - expected).abs() < 2e-5, "x of node (10, 10) at t = {t} is {x}, expected {expected}");
    }
    assert_work(&summary, 2001, 8001, 23724);
}

/// Chaotic from t = 1 on: round-off moves l_inf and Q by up to 5 %.
#[test]
fn case_a_advective() {
    let name = "burgers-a-advective";
    let (summary, _) = rerun(name);
    let tolerance = [0.01, 0.05, 0.05];
    assert_row(name, "l_inf", linf(&summary), [0.0961, 0.1051, 0.0989], tolerance);
    assert_row(name, "Q max", q_max(&summary), [1.38, 1.26, 1.76], tolerance);
    assert_row(name, "Q mean", q_mean(&summary), [1.02, 1.01, 1.04], tolerance);
    assert_eq!(summary.figures.work.steps, 1000);
}

#[test]
fn case_a_smoothed() {
    let name = "burgers-a-smoothed";
    let (summary, _) = rerun(name);
    assert_row(name, "l_inf", linf(&summary), [0.0298, 0.0315, 0.0286], DIGITS);
    assert_work(&summary, 2000, 8000, 21855);
}

#[test]
fn uniform_meshes() {
    let expected = [
        ("burgers-uniform-conservative", [0.0898, 0.0898, 0.0947]),
        ("burgers-uniform-advective", [0.317, 0.321, 0.328]),
    ];
    for (name, errors) in expected {
        let (summary, _) = rerun(name);
        assert_row(name, "l_inf", linf(&summary), errors, DIGITS);
        assert_row(name, "Q max", q_max(&summary), [1.0; 3], [1e-12; 3]);
        assert_row(name, "Q mean", q_mean(&summary), [1.0; 3], [1e-12; 3]);
        assert_work(&summary, 2000, 2000, 3000);
    }
}

/// A bump carried across the box, against its exact solution: an eighth of what a mesh that stays leaves. As the bump
/// spreads equal cells resolve it, and the mesh lets go of it: a third at the end.
#[test]
fn advected_bump() {
    let [moving, still] = [vec![], vec!["mesh.generator={kind=\"fixed\"}"]]
        .map(|settings| rerun_set("advected-bump", &settings, &mut Node::default()));
    for ((ours, theirs), share) in moving.figures.reports.iter().zip(&still.figures.reports).zip([0.125, 0.35]) {
        let [ours, theirs] = [ours, theirs].map(|report| report.error.unwrap());
        println!("{:.3e} {:.3e}, {:.3e} {:.3e}", ours.linf, theirs.linf, ours.l2, theirs.l2);
        assert!(ours.linf < share * theirs.linf && ours.l2 < share * theirs.l2, "{ours:?} {theirs:?}");
    }
    assert_eq!(moving.figures.work.steps, 100);
}

/// The wave is where the exact one is, and no worse than on a mesh that stays: equal cells resolve it, toe and all.
#[test]
fn fisher() {
    let errors = |settings: &[&str]| {
        let summary = rerun_set("fisher", settings, &mut Node::default());
        summary.figures.reports.iter().map(|report| report.error.unwrap().linf).collect::<Vec<_>>()
    };
    let [ours, still] = [&[][..], &["mesh.generator={kind=\"fixed\"}"]].map(errors);
    assert!(ours[0] < 2.1e-3 && ours[1] < 1.1e-2, "{ours:?}");
    assert!(ours.iter().zip(&still).all(|(ours, still)| ours <= still), "{ours:?} {still:?}");
}

/// Extremes of both substances over all steps.
struct Substances {
    lowest: [f64; 2],
    highest: [f64; 2],
}

impl Observer for Substances {
    fn observe(&mut self, _event: Event, snapshot: &Snapshot<'_>) -> driftmesh::Result<()> {
        for values in snapshot.state::<2>().unwrap().u.values().as_chunks::<2>().0 {
            self.lowest = std::array::from_fn(|c| self.lowest[c].min(values[c]));
            self.highest = std::array::from_fn(|c| self.highest[c].max(values[c]));
        }
        Ok(())
    }
}

/// Substances are never negative and u never exceeds its feed but for the wiggles of a central scheme, a ten-thousandth
/// of the feed, and the spot lives on. Without feed and decay, what u loses v gains to round-off.
#[test]
fn gray_scott() {
    let mut found = Substances { lowest: [f64::INFINITY; 2], highest: [f64::NEG_INFINITY; 2] };
    let summary = rerun_with("gray-scott", &mut found);
    println!("{:?} {:?}", found.lowest, found.highest);
    assert!(found.lowest[0] > 0.1 && found.lowest[1] > -1e-4, "{:?}", found.lowest);
    assert!(found.highest[0] < 1.0 + 2e-4 && (0.25..0.65).contains(&found.highest[1]), "{:?}", found.highest);
    assert_eq!(summary.figures.work.steps, 100);

    let mut totals = Pair::default();
    let closed = ["pde.source.u=\"-u*v^2\"", "pde.source.v=\"u*v^2\"", "time.end=100.0", "time.report=[100.0]"];
    rerun_set("gray-scott", &closed, &mut totals);
    let [first, last] = [totals.history[0], totals.history[totals.history.len() - 1]];
    let drift = (last[0] + last[1]) / (first[0] + first[1]) - 1.0;
    println!("{first:?} {last:?} {drift:.1e}");
    assert!(drift.abs() < 1e-13 && last[1] > 1.05 * first[1], "{first:?} {last:?}");
}

/// Σ A u and Σ A v by dual areas.
#[derive(Default)]
struct Pair {
    history: Vec<[f64; 2]>,
}

impl Observer for Pair {
    fn observe(&mut self, _event: Event, snapshot: &Snapshot<'_>) -> driftmesh::Result<()> {
        let areas = DualCells::new(&snapshot.state::<2>().unwrap().mesh).areas().to_vec();
        let total = |c: usize| {
            areas.iter().zip(snapshot.state::<2>().unwrap().u.component(c)).map(|(area, u)| area * u).sum::<f64>()
        };
        self.history.push([total(0), total(1)]);
        Ok(())
    }
}

/// No study is left out of the tests above.
#[test]
fn every_study_is_tested() {
    let tested = concat!(
        include_str!("studies.rs"),
        include_str!("dam_break.rs"),
        include_str!("laplacian.rs"),
        include_str!("stefan.rs"),
        include_str!("data_sheets.rs"),
        include_str!("curved.rs"),
        include_str!("equidistribution.rs"),
        include_str!("published_lines.rs"),
        include_str!("species.rs")
    );
    for entry in std::fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("studies")).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        let stem = name.strip_suffix(".toml").unwrap_or_else(|| panic!("{name} is not a study"));
        let is_named = [stem, &name].iter().any(|name| tested.contains(&format!("\"{name}\"")));
        assert!(is_named, "{name} has no test");
    }
}
