//! Phases that vanish and appear, and melts below their melting temperature, against exact solutions.

use crate::front_runs::{AS_IT_IS, course, refused, study};
use driftmesh::stefan::{Change, LOWER, UPPER};
use driftmesh::study::{Begin, Kind};

/// u = exp(t − y) − 1 below h = t, and ice at its melting point above: the ice is gone at t = 1.
const MELT_OUT: &str = r#"
[study]
name = "melt-out"
kind = "stefan"
[domain]
x = [0.0, 0.5]
bottom = "0"
top = "1"
front = "0.1"
[grid]
cells = [4, 20, 10]
[phase.lower]
initial = "exp(0.1 - y) - 1"
boundary = "exp(t) - 1"
[phase.upper]
initial = "0"
boundary = "0"
[time]
start = 0.1
end = 1.5
"#;

/// By automatic and given steps, with either front, and with a flux at the bottom.
#[test]
fn a_phase_vanishes_and_the_run_goes_on() {
    for set in [
        &[][..],
        &["time.step=0.01"],
        &["front.stepping=\"explicit\""],
        &["phase.lower.boundary={ flux = \"exp(t)\" }", "phase.upper.boundary=\"no-flux\""],
    ] {
        let course = course(MELT_OUT, set);
        println!("{set:?}: {:?} {} steps", course.phases, course.work.steps);
        let [event] = &course.phases[..] else { panic!("{set:?}: {:?}", course.phases) };
        assert!((event.t - 1.0).abs() <= 1e-3, "{set:?}: {event:?}");
        assert_eq!((event.event, event.phase.as_str()), (Change::Vanished, "upper"));
        assert_eq!((course.state.t, course.state.alone), (1.5, Some(LOWER)));
        assert!(course.state.front.iter().all(|h| *h == 1.0));
    }
}

/// With no flux through the top, what flows in once the ice is gone heats the water: ∫u grows by ∫exp(t) dt.
#[test]
fn what_is_left_keeps_its_energy() {
    let set = ["phase.lower.boundary={ flux = \"exp(t)\" }", "phase.upper.boundary=\"no-flux\""];
    let course = course(MELT_OUT, &set);
    let energy = course.reports[0].energy_imbalance.unwrap();
    println!("{energy:e}");
    assert!(energy <= 2e-3, "{energy:e}");
}

/// Neumann's problem from t = 0: water at 1 where there was ice of −.5; λ = .469851.
const FROM_NOTHING: &str = r#"
[study]
name = "from-nothing"
kind = "stefan"
[domain]
x = [0.0, 0.5]
bottom = "0"
top = "6"
front = "0"
[grid]
cells = [4, 20, 40]
[phase.lower]
initial = "1"
boundary = "1"
[phase.upper]
initial = "-0.5"
boundary = "-0.5"
[time]
end = 1.0
"#;

#[test]
fn a_phase_appears_at_a_warm_wall() {
    let course = course(FROM_NOTHING, AS_IT_IS);
    let h = course.state.front[0];
    println!("{:?} {h} {:e} {} steps", course.phases, h / (2.0 * 0.469851) - 1.0, course.work.steps);
    let [event] = &course.phases[..] else { panic!("{:?}", course.phases) };
    assert_eq!((event.t, event.event, event.phase.as_str()), (0.0, Change::Appeared, "lower"));
    assert!((h / (2.0 * 0.469851) - 1.0).abs() <= 1e-3, "{h}");
}

/// The same upside down: ice of −1 grows down into water of .5.
#[test]
fn a_phase_appears_at_a_cold_wall() {
    let set = [
        "domain.front=\"6\"",
        "phase.lower.initial=\"0.5\"",
        "phase.lower.boundary=\"0.5\"",
        "phase.upper.initial=\"-1\"",
        "phase.upper.boundary=\"-1\"",
        "grid.cells=[4, 40, 20]",
    ];
    let course = course(FROM_NOTHING, &set);
    let h = 6.0 - course.state.front[0];
    println!("{:?} {h}", course.phases);
    assert_eq!(course.phases[0].phase, "upper");
    assert!((h / (2.0 * 0.469851) - 1.0).abs() <= 1e-3, "{h}");
}

/// Growth into a melt whose undercooling is half of Λ/C: h = 2λ√t with √π λ exp(λ²) erfc(λ) = 1/2, from h = .1.
const UNDERCOOLED: &str = r#"
[study]
name = "undercooled"
kind = "stefan"
[domain]
x = [0.0, 0.2]
bottom = "0"
top = "4"
front = "0.1"
[grid]
cells = [4, 8, 60]
[phase.lower]
initial = "0"
boundary = "0"
[phase.upper]
initial = "-0.5*(1 - (1 - erf(y/(2*sqrt(T0))))/(1 - erf(LAMBDA)))"
boundary = "-0.5"
[front]
undercooled = true
[time]
start = T0
end = 0.4
"#;
const LAMBDA: f64 = 0.4327515993663081;

fn undercooled() -> String {
    UNDERCOOLED.replace("T0", &format!("{:?}", (0.05 / LAMBDA).powi(2))).replace("LAMBDA", &format!("{LAMBDA:?}"))
}

#[test]
fn an_undercooled_melt_freezes() {
    let growth = std::f64::consts::PI.sqrt() * LAMBDA * (LAMBDA * LAMBDA).exp() * libm::erfc(LAMBDA);
    assert!((growth - 0.5).abs() < 1e-9);
    let course = course(&undercooled(), AS_IT_IS);
    let (h, exact) = (course.state.front[0], 2.0 * LAMBDA * course.state.t.sqrt());
    println!("{h} {exact} {:e} {} steps", h / exact - 1.0, course.work.steps);
    assert!((h / exact - 1.0).abs() <= 5e-3, "{h}, not {exact}");
}

/// On rows that are too few the front is in doubt, with a number, and a warning at the end.
#[test]
fn a_front_on_too_few_rows_is_in_doubt() {
    for (rows, doubtful) in [(8, true), (60, false)] {
        let set = format!("grid.cells=[4, 8, {rows}]");
        let study = study(&undercooled(), &[&set]);
        let out = tempfile::tempdir().unwrap();
        let summary = study.run(&out.path().join("run"), Begin::Anew, &mut []).unwrap().summary;
        let doubt = summary.figures.reports[0].front.doubt.unwrap();
        println!("{rows}: {doubt:e} {:?}", summary.warnings);
        let warned = summary.warnings.iter().any(|said| said.contains("raise grid.cells"));
        assert!(warned == doubtful && (doubt > 0.01) == doubtful, "{rows}: {doubt:e}");
    }
}

/// Near Λ/C the speed turns on the last per cent of the heat: the doubt tells the error of the front to a factor of two
/// and warns, also where rows are close at the front and too wide beyond, and a melt beyond Λ/C is refused.
#[test]
fn growth_near_the_largest_undercooling_is_in_doubt() {
    const GROWTH: &str = r#"
[study]
name = "fast"
kind = "stefan"
[domain]
x = [0.0, 0.2]
bottom = "0"
top = "1"
[grid]
cells = [4, 8, 40]
[front]
undercooled = true
[exact]
kind = "planar-growth"
far = -0.9
start_front = 0.1
[time]
duration = 0.01
"#;
    for (set, warns) in [
        (&[][..], true),
        (&["grid.cells=[4, 8, 80]", "grid.grading=3"], true),
        (&["exact.far=-0.98", "time.duration=0.0015", "grid.cells=[4, 8, 120]", "grid.grading=3"], true),
        (&["exact.far=-0.5", "time.duration=0.05"], false),
    ] {
        let study = study(GROWTH, set);
        let start = study.begin().unwrap().course.state.front[0];
        let out = tempfile::tempdir().unwrap();
        let summary = study.run(&out.path().join("run"), Begin::Anew, &mut []).unwrap().summary;
        let front = summary.figures.reports[0].front;
        let off = front.error_linf.unwrap() / (front.mean - start);
        println!("{set:?}: off by {off:e}, doubt {:e}", front.doubt.unwrap());
        assert!((0.5..2.0).contains(&(front.doubt.unwrap() / off)) || !warns, "{set:?}: {off:e}, {front:?}");
        let warned = summary.warnings.iter().any(|said| said.contains("last per cent of the heat"));
        assert!(warned == warns, "{set:?}: {front:?}");
    }
    let error = refused(&undercooled(), &["phase.upper.initial=\"-1.5*(y - 0.1)\""]);
    let said = format!("{error} {}", error.help().unwrap_or_default());
    assert!(
        ["phase.upper.initial", "latent heat over capacity", "raise it"].iter().all(|w| said.contains(w)),
        "{said}"
    );
}

/// Upside down the melt is the lower phase; without the key that is refused with its name, and the key without such a
/// melt, too.
#[test]
fn an_undercooled_melt_is_named() {
    let turned = undercooled().replace("erf(y/", "erf((4 - y)/");
    let turned =
        turned.replace("front = \"0.1\"", "front = \"3.9\"").replace("cells = [4, 8, 60]", "cells = [4, 60, 8]");
    let turned = turned.replace("phase.lower", "phase.other").replace("phase.upper", "phase.lower");
    let turned = turned.replace("phase.other", "phase.upper");
    let course = course(&turned, AS_IT_IS);
    let (h, exact) = (4.0 - course.state.front[0], 2.0 * LAMBDA * course.state.t.sqrt());
    assert!((h / exact - 1.0).abs() <= 5e-3, "{h}, not {exact}");
    let error = refused(&turned, &["front.undercooled=false"]);
    let said = format!("{error} {:?}", error.help());
    assert!(["ill-posed", "front.undercooled"].iter().all(|word| said.contains(word)), "{said}");
    let error = refused(MELT_OUT, &["front.undercooled=true"]);
    assert!(error.to_string().contains("front.undercooled"), "{error}");
    assert_eq!((LOWER, UPPER), (0, 1));
}

/// Frank's disc and a flat front, growing into a melt whose undercooling is half of Λ/C, from the exact solution.
#[test]
fn undercooled_growth_is_exact_in_the_plane() {
    const GROWTH: &str = r#"
[study]
name = "growth"
kind = "stefan"
[domain]
x = [-0.5, 0.5]
bottom = "0"
top = "2"
[grid]
cells = [10, 8, 40]
[front]
undercooled = true
[walls]
sides = "exact"
[exact]
kind = "disc-growth"
far = -0.5
centre = [0.0, -0.5]
start_radius = 1.0
[time]
duration = 0.2
"#;
    let planar = ["exact={ kind = \"planar-growth\", far = -0.5, start_front = 0.5, tilt = 10.0 }"];
    for set in [&[][..], &planar] {
        let course = course(GROWTH, set);
        let start = study(GROWTH, set).begin().unwrap().course.state.front[5];
        let [error, way] = [course.reports[0].front.error_linf.unwrap(), course.state.front[5] - start];
        println!("{set:?}: {error:e} of {way}");
        assert!(way > 0.1 && error <= 5e-3 * way, "{set:?}: {error:e} of {way}");
    }
    let error = refused(GROWTH, &["front.undercooled=false"]);
    assert!(error.to_string().contains("front.undercooled"), "{error}");
    let error = refused(GROWTH, &["exact.far=-1.0"]);
    assert!(error.to_string().contains("latent heat over capacity"), "{error}");
}
