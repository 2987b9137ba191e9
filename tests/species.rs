//! Species in the phases of a line, and fronts whose law is a formula, against exact solutions and balances.

use driftmesh::Failure;
use driftmesh::error::Error;
use driftmesh::study::{Begin, Kind, Source, SpeciesReport, SpeciesStudy, Study};
use std::path::Path;

fn study(text: &str, set: &[String]) -> SpeciesStudy {
    let mut source = Source::new("species", text.to_string());
    set.iter().for_each(|assignment| source.set(assignment).unwrap());
    SpeciesStudy::from_source(&source).unwrap()
}

/// The last report of a run on n cells a phase, in steps of a given number.
fn report(text: &str, n: usize, steps: usize, [start, end]: [f64; 2]) -> SpeciesReport {
    let phases = study(text, &[]).domain.phases.len();
    let set = [format!("grid.cells={:?}", vec![n; phases]), format!("time.step={}", (end - start) / steps as f64)];
    let (run, failure) = study(text, &set).compute().unwrap();
    assert!(failure.is_none(), "{failure:?}");
    run.course.reports.last().unwrap().clone()
}

/// Orders of the error of the first front in cells, and of its change in steps.
fn orders(text: &str, exact: f64, range: [f64; 2]) -> [f64; 2] {
    let front = |n: usize, steps: usize| report(text, n, steps, range).front.x[0];
    let space = [10, 20].map(|n| (front(n, 400) - exact).abs());
    let time = [20, 40, 80].map(|steps| front(20, steps));
    println!("{space:?} {time:?}");
    assert!(space[1] < 2e-4, "{space:?}");
    [(space[0] / space[1]).log2(), ((time[0] - time[1]) / (time[1] - time[2])).log2()]
}

/// A core of 4 in a shell whose gas is steady at every moment, from r = .9.
const SHRINKING: &str = r#"
[study]
name = "shrinking"
kind = "stefan"
[domain]
coordinates = "spherical"
phases = ["core", "shell"]
front = [0.9]
[grid]
cells = [10, 10]
[species.solid.core]
diffusivity = 0.0
initial = 4.0
right = "outflow"
[species.gas.shell]
diffusivity = 1.0
storage = 0.0
initial = "10 - 9/x"
left = LEFT
right = 1.0
[front]
law = "LAW"
[time]
end = END
"#;

/// ρ r(1 − r) dr = −D c dt where the shell decides; ρ (1 + K r − K r²) dr = −K c dt where the reaction of rate K at the
/// front has its share: to second order in space and time, and what the gas loses the solid has lost.
#[test]
fn a_core_shrinks_as_the_quasi_steady_solution_does() {
    let diffusion = |r: f64| 4.0 * (r * r / 2.0 - r.powi(3) / 3.0);
    let reaction = |r: f64| 4.0 * (r + 1.5 * r * r - r.powi(3)) / 3.0;
    type Case = (&'static str, &'static str, fn(f64) -> f64);
    let cases: [Case; 2] = [
        ("0.0", "gas_shell_flux/solid_core", diffusion),
        ("{ flux = \"-3*gas\" }", "-3*gas_shell/solid_core", reaction),
    ];
    for (left, law, time) in cases {
        let end = time(0.9) - time(0.5);
        let text = SHRINKING.replace("LEFT", left).replace("LAW", law).replace("END", &format!("{end:?}"));
        let [space, steps] = orders(&text, 0.5, [0.0, end]);
        assert!(space > 1.8 && steps > 1.8, "{law}: orders {space:.2} and {steps:.2}");
        let of = report(&text, 20, 40, [0.0, end]).species;
        let (gas, solid) = (of["gas"], of["solid"]);
        println!("{gas:?} {solid:?}");
        assert!(gas.imbalance < 1e-12 && solid.imbalance < 1e-12, "{of:?}");
        assert!((gas.consumed / solid.consumed - 1.0).abs() < 1e-12 && gas.consumed > 0.5, "{of:?}");
    }
}

/// The study of the directory, by automatic steps: within 2e-4 of t = τ (1 − 3r² + 2r³).
#[test]
fn the_shrinking_core_of_the_studies_is_right_by_default() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("studies").join("shrinking-core.toml");
    let Study::Species(study) = Study::from_source(&Source::read(&file).unwrap()).unwrap() else {
        panic!("of another kind")
    };
    let out = tempfile::tempdir().unwrap();
    let finished = study.run(&out.path().join("run"), Begin::Anew, &mut []).unwrap();
    assert!(finished.failure.is_none(), "{:?}", finished.failure);
    let time = |r: f64| 4.0 / 6.0 * (1.0 - 3.0 * r * r + 2.0 * r.powi(3));
    for report in &finished.summary.figures.reports {
        let (r, off) = (report.front.x[0], time(report.front.x[0]) - time(0.9) - report.t);
        println!("t = {}: r = {r}, {off:e}", report.t);
        assert!(off.abs() < 2e-4, "t = {}: r = {r} belongs to a time that differs by {off:e}", report.t);
    }
    let steps = finished.summary.figures.work.steps;
    assert!(steps < 1000, "{steps} steps");
    for file in ["history.csv", "final.npz", "front.svg", "run.pvd", "report.html"] {
        assert!(out.path().join("run").join(file).exists(), "{file} is missing");
    }
}

/// u = 2 (e^(t−x) − 1) up to the first front x = t, e^(t−x) − 1 up to the second one x = t + 1/2.
const TWO_FRONTS: &str = r#"
[study]
name = "two-fronts"
kind = "stefan"
[domain]
upper = [2.0]
phases = ["lower", "middle", "upper"]
front = [0.2, 0.7]
[grid]
cells = [10, 10, 10]
[species.u.lower]
diffusivity = 1.0
initial = "2*(exp(0.2 - x) - 1)"
left = "2*(exp(t) - 1)"
right = 0.0
[species.u.middle]
diffusivity = 1.0
initial = "exp(0.2 - x) - 1"
left = 0.0
right = "exp(-0.5) - 1"
[front]
law = ["u_lower_flux - u_middle_flux", "u_middle_flux*exp(0.5)"]
[time]
start = 0.2
end = 1.0
"#;

/// Each of two fronts by its own law, the first one by a jump of fluxes; nothing is asked of the third phase.
#[test]
fn several_fronts_are_second_order() {
    let [space, steps] = orders(TWO_FRONTS, 1.0, [0.2, 1.0]);
    assert!(space > 1.8 && steps > 1.8, "orders {space:.2} and {steps:.2}");
    let fronts = report(TWO_FRONTS, 20, 400, [0.2, 1.0]).front;
    assert!((fronts.x[1] - 1.5).abs() < 1e-4 && (fronts.velocity[1] - 1.0).abs() < 1e-3, "{fronts:?}");
}

/// A particle that gives a species off through its surface: two phases in equilibrium at a front that moves by what the
/// fluxes on its sides leave over.
const PARTICLE: &str = r#"
[study]
name = "particle"
kind = "stefan"
[domain]
coordinates = "COORDINATES"
phases = ["core", "shell"]
front = [0.8]
[grid]
cells = [20, 20]
[species.c.core]
diffusivity = 0.5
initial = 0.9
right = 0.8
[species.c.shell]
diffusivity = "1 + c"
storage = "c + c^2/4"
source = "-0.01*c"
initial = 0.3
left = 0.3
right = { flux = "-0.2" }
[front]
law = "(c_core_flux - c_shell_flux)/(c_core - c_shell - c_shell^2/4)"
[time]
end = 0.2
step = 0.005
"#;

/// Nothing is lost at the front nor at the moving cells, and what leaves is what was given, in all coordinates.
#[test]
fn the_total_of_a_species_is_kept_across_a_front() {
    for (coordinates, area) in [("cartesian", 1.0), ("cylindrical", 1.0), ("spherical", 1.0)] {
        let text = PARTICLE.replace("COORDINATES", coordinates);
        let text = if coordinates == "cartesian" {
            text.replace("initial = 0.9", "initial = 0.9\nleft = \"no-flux\"")
        } else {
            text
        };
        let (run, failure) = study(&text, &[]).compute().unwrap();
        assert!(failure.is_none(), "{failure:?}");
        let report = run.course.reports.last().unwrap().clone();
        let total = report.species["c"];
        println!("{coordinates}: {total:?} {:?}", report.front);
        assert!(total.imbalance < 1e-12 && total.consumed.abs() < 1e-12 * total.start, "{total:?}");
        assert!((total.inflow + 0.2 * 0.2 * area).abs() < 1e-12 && (report.front.x[0] - 0.8).abs() > 1e-3, "{total:?}");
    }
}

/// A ball that swells by a given velocity and lets nothing out: its content is that of the start, seen with the moving
/// cells and as the integral over the ball, and is spread evenly in the end.
#[test]
fn a_swelling_sphere_keeps_its_content() {
    let text = r#"
[study]
name = "swelling"
kind = "stefan"
[domain]
coordinates = "spherical"
upper = [2.0]
phases = ["ball", "outside"]
front = [0.8]
[grid]
cells = [30, 3]
[species.c.ball]
diffusivity = 1.0
initial = "1 + cos(3*x)/2"
right = "no-flux"
[front]
law = "exp(-t)/2"
[time]
end = 8.0
step = 0.05
"#;
    let (run, failure) = study(text, &[]).compute().unwrap();
    assert!(failure.is_none(), "{failure:?}");
    let total = run.course.reports[0].species["c"];
    let r = run.course.reports[0].front.x[0];
    assert!(total.imbalance < 1e-12 && (total.content / total.start - 1.0).abs() < 1e-12, "{total:?}");
    assert!((r - (0.8 + 0.5 * (1.0 - (-8.0_f64).exp()))).abs() < 1e-3, "{r}");
    // ∫x² (1 + cos 3x/2) dx over the ball at the start, by parts
    let f = |x: f64| {
        x.powi(3) / 3.0 + 0.5 * ((x * x / 3.0 - 2.0 / 27.0) * (3.0 * x).sin() + 2.0 * x / 9.0 * (3.0 * x).cos())
    };
    assert!((total.start / f(0.8) - 1.0).abs() < 1e-3, "{total:?}");
    let (x, _, values) = run.problem.profile(&run.course.state);
    for (x, c) in x.iter().zip(&values[0]).filter(|([x], _)| *x < r) {
        assert!((c / (3.0 * total.content / r.powi(3)) - 1.0).abs() < 1e-3, "c = {c} at {x:?}");
    }
}

/// A core that is used up ends the run with its name, and with the last good state.
#[test]
fn a_phase_that_vanishes_is_named() {
    let text = SHRINKING.replace("LEFT", "0.0").replace("LAW", "gas_shell_flux/solid_core").replace("END", "1.0");
    let (run, failure) = study(&text, &["grid.cells=[10, 40]".into()]).compute().unwrap();
    let failure = failure.unwrap();
    let Error::Failed { failure: cause, moment } = &failure else { panic!("{failure}") };
    let (t, gone) = (moment.unwrap().t, 4.0 / 6.0 * (1.0 - (1.0 - 3.0 * 0.81 + 2.0 * 0.729)));
    println!("{failure}: t = {t}, {gone}");
    assert!(matches!(cause, Failure::VanishingPhase { phase, .. } if phase == "core"), "{failure}");
    assert!((t - gone).abs() < 5e-3 && run.course.state.t > 0.6, "{t}, not {gone}");
}

/// A run that stops and goes on has the bits of one that does not.
#[test]
fn a_run_goes_on_with_the_same_bits() {
    let text = PARTICLE.replace("COORDINATES", "spherical");
    let out = tempfile::tempdir().unwrap();
    let [whole, parts] = ["whole", "parts"].map(|name| out.path().join(name));
    study(&text, &[]).run(&whole, Begin::Anew, &mut []).unwrap();
    study(&text, &["time.end=0.1".into()]).run(&parts, Begin::Anew, &mut []).unwrap();
    study(&text, &[]).run(&parts, Begin::Resumed, &mut []).unwrap();
    for file in ["final.npz", "front.svg"] {
        assert!(std::fs::read(whole.join(file)).unwrap() == std::fs::read(parts.join(file)).unwrap(), "{file} differs");
    }
}

/// What no run can begin with is named, with the place and what to do.
#[test]
fn bad_input_is_named() {
    let particle = PARTICLE.replace("COORDINATES", "spherical");
    for (set, words) in [
        ("domain.front=[0.8, 0.9]", &["domain.front", "one front between each two of the 2 phases"][..]),
        ("domain.front=[1.8]", &["domain.front", "between the walls"]),
        ("domain.phases=[\"core\", \"the shell\"]", &["domain.phases", "letters, digits and _"]),
        ("domain.phases=[\"core\", \"skin\"]", &["species.c.shell", "domain.phases has core, skin"]),
        ("domain.lower=[-1.0]", &["domain.lower", "distance"]),
        ("grid.cells=[20]", &["grid.cells", "each of the 2 phases"]),
        ("species.c.core.left=0.0", &["species.c.core.left", "centre"]),
        ("species.c.core.diffusivity=\"c - 2\"", &["species.c.core.diffusivity", "not below 0"]),
        ("species.c.shell.right=\"c_core\"", &["species.c.shell.right", "c_core"]),
        ("species.c.shell.source=\"x +\"", &["species.c.shell.source"]),
        ("species.c.core.initial=\"1/(x - x)\"", &["species", "initial"]),
        ("front.law=\"d_core\"", &["front.law", "d_core"]),
        ("front.law=[\"1\", \"2\"]", &["front.law", "1 fronts"]),
        ("species.c.core.porosity=0.5", &["porosity"]),
    ] {
        let mut source = Source::new("species", particle.clone());
        source.set(set).unwrap();
        let error = Study::from_source(&source).unwrap_err();
        let said = format!("{error} {}", error.help().unwrap_or_default());
        assert!(words.iter().all(|word| said.contains(word)), "{set}: {said}");
    }
    let text = particle.replace("right = { flux = \"-0.2\" }", "");
    let error = Study::from_source(&Source::new("species", text)).unwrap_err();
    assert!(error.to_string().contains("species.c.shell.right"), "{error}");
    let text = SHRINKING.replace("LEFT", "0.0").replace("LAW", "-1").replace("END", "1.0");
    let text = text.replace("right = \"outflow\"", "right = \"no-flux\"");
    let error = Study::from_source(&Source::new("species", text)).unwrap_err();
    assert!(error.to_string().contains("nothing flows by itself"), "{error}");
}
