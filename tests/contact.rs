//! Phases that begin or end along a part of a wall, and set-ups that no front can have.

use crate::front_runs::{course, study};
use driftmesh::stefan::{Change, Material, Similarity};
use driftmesh::study::Kind;
use driftmesh::{Error, Failure};

/// What a study is refused with, and the remedy.
fn refused(text: &str, set: &[impl AsRef<str>]) -> String {
    let error = crate::front_runs::refused(text, set);
    format!("{error} {}", error.help().unwrap_or_default())
}

/// u = exp(t − y) − 1 below h = t, in a box so wide that columns know nothing of each other. The ice at its melting
/// point is thinnest on the left, where the water reaches the wall at t = .9, and gone on the right at t = 1.1.
const WEDGE: &str = r#"
[study]
name = "wedge"
kind = "stefan"
[domain]
x = [0.0, 40.0]
bottom = "0"
top = "1 - 0.1*cos(pi*x/40)"
front = "0.1"
[grid]
cells = [20, 20, 10]
[phase.lower]
initial = "exp(0.1 - y) - 1"
boundary = "exp(t) - 1"
[phase.upper]
initial = "0"
boundary = "0"
[time]
start = 0.1
end = 1.2
report = [0.85, 1.0, 1.2]
"#;

/// Ice that vanishes at one place first: a wall at its temperature, and one that lets no heat through.
#[test]
fn a_phase_vanishes_column_by_column() {
    for set in [&[][..], &["phase.upper.boundary=\"no-flux\""]] {
        let course = course(WEDGE, set);
        println!("{set:?}: {:?} {} steps", course.phases, course.work.steps);
        let bare: Vec<f64> = course.reports.iter().map(|report| report.front.bare).collect();
        // at t = 1 half of the columns are bare
        assert!(bare[0] == 0.0 && (bare[1] - 0.5).abs() < 0.1 && bare[2] == 0.0, "{bare:?}");
        let [event] = &course.phases[..] else { panic!("{set:?}: {:?}", course.phases) };
        assert!((event.t - 1.1).abs() <= 5e-3, "{set:?}: {event:?}");
        assert_eq!((event.event, event.phase.as_str()), (Change::Vanished, "upper"));
    }
}

/// A floor that is warm on the left only, under ice of −.5.
const SPOT: &str = r#"
[study]
name = "spot"
kind = "stefan"
[domain]
x = [0.0, 40.0]
bottom = "0"
top = "6"
front = "0"
[grid]
cells = [20, 20, 40]
[phase.lower]
initial = "0"
boundary = "cos(pi*x/40)"
[phase.upper]
initial = "-0.5"
boundary = "-0.5"
[time]
end = 1.0
"#;

/// A floor whose mean is at the melting temperature melts the ice where it is warm, as Neumann's solution has it there.
#[test]
fn a_phase_appears_along_a_part_of_a_wall() {
    let course = course(SPOT, &["phase.upper.boundary=\"no-flux\""]);
    let state = &course.state;
    assert_eq!((course.phases.len(), course.phases[0].t), (1, 0.0), "{:?}", course.phases);
    for i in 0..7 {
        let hot = (std::f64::consts::PI * i as f64 / 20.0).cos();
        let solution = Similarity::planar([hot, -0.5], Material::diffusing([1.0; 2], 1.0).unwrap(), 0.0, 0.0).unwrap();
        let (h, exact) = (state.front[i], solution.height(0.0, 1.0));
        println!("{i}: {h} {exact} {:e}", h / exact - 1.0);
        assert!((h / exact - 1.0).abs() <= 1e-2, "column {i}: {h}, not {exact}");
    }
    assert!(state.bare[12..].iter().all(|bare| *bare == Some(0)), "{:?}", state.bare);
}

/// Neumann's solution from a front on the bottom by a flux: u = exp(t − y) − 1 and h = t from t = 0.
#[test]
fn a_phase_appears_at_a_wall_that_heat_flows_through() {
    let set = [
        "domain.front=\"0\"",
        "domain.top=\"2\"",
        "time.start=0.0",
        "time.end=1.0",
        "time.report=[]",
        "phase.lower.initial=\"0\"",
        "phase.lower.boundary={ flux = \"exp(t)\" }",
    ];
    let course = course(WEDGE, &set);
    println!("{:?} {}", course.phases, course.state.front[0]);
    assert_eq!(course.phases[0].event, Change::Appeared);
    assert!((course.state.front[0] - 1.0).abs() <= 2e-3, "{}", course.state.front[0]);
}

/// One phase, whose wall passes the melting temperature: the run ends there, and says why.
#[test]
fn a_wall_that_passes_the_melting_temperature_is_named() {
    for wall in ["\"cos(3*t) - cos(0.3) + exp(0.1) - 1\"", "{ flux = \"cos(8*t)\" }"] {
        let (run, failure) = study(WEDGE, &[format!("phase.lower.boundary={wall}")]).compute().unwrap();
        let course = run.course;
        let failure = failure.unwrap();
        println!("{wall}: {failure}");
        assert!(matches!(&failure, Error::Failed { failure: Failure::WallPassesMelting { .. }, .. }), "{failure}");
        assert!(failure.to_string().contains("the bottom is at -"), "{failure}");
        assert!(failure.help().unwrap().contains("end"), "{failure:?}");
        assert!(course.state.t > 0.15 && course.state.front.iter().all(|h| h.is_finite()));
    }
}

/// Set-ups that would do nothing: refused with what is wrong, or warned of.
#[test]
fn contradictions_are_named() {
    // a cold floor under warm water
    let said = refused(SPOT, &["phase.upper.initial=\"5\"", "phase.lower.boundary=\"-5\""]);
    assert!(["phase.upper.initial", "above the melting", "upside down"].iter().all(|w| said.contains(w)), "{said}");
    // degrees Celsius with a melting temperature in kelvin
    const KELVIN: [&str; 12] = [
        "phase.lower.conductivity=1.0",
        "phase.upper.conductivity=9.0",
        "phase.lower.capacity=1.0",
        "phase.upper.capacity=1.0",
        "front.latent_heat=1.0",
        "front.melting=273.15",
        "phase.lower.initial=\"20\"",
        "phase.upper.initial=\"-5\"",
        "phase.lower.boundary=\"20\"",
        "phase.upper.boundary=\"-5\"",
        "domain.front=\"4\"",
        "domain.x=[0.0, 1.0]",
    ];
    let said = refused(SPOT, &KELVIN);
    assert!(["below the melting", "one scale", "front.melting"].iter().any(|w| said.contains(w)), "{said}");
    let on_wall = [&KELVIN[..], &["domain.front=\"0\""]].concat();
    let study = study(SPOT, &on_wall);
    let said = study.warnings().unwrap().join("\n");
    assert!(said.contains("the lower phase never appears") && said.contains("273.15"), "{said}");
    // a front that begins outside the box is not cured by an earlier end
    let said = refused(SPOT, &["domain.front=\"7\""]);
    assert!(said.contains("begin between the walls") && !said.contains("earlier"), "{said}");
    // a formula that ends
    for wall in ["\"sqrt(0.9 - t)\"", "{ flux = \"log(0.9 - t)\" }"] {
        let said = refused(SPOT, &[&format!("phase.lower.boundary={wall}")]);
        assert!(said.contains("phase.lower.boundary") && said.contains("t = 0.9"), "{said}");
    }
}

/// The same front in other units of length, time and temperature, and in a box of any width.
#[test]
fn results_do_not_depend_on_units() {
    let wide = ["domain.top=\"2\"", "domain.x=[0.0, 0.5]", "time.report=[]", "grid.cells=[4, 20, 10]"];
    let usual = course(WEDGE, &wide).state.front[0];
    for x in ["1e-3", "1e-6", "1e-12"] {
        let x = format!("domain.x=[0.0, {x}]");
        let front = course(WEDGE, &[&wide[..], &[&x]].concat()).state.front[0];
        assert!((front / usual - 1.0).abs() < 1e-6, "{x}: {front}, not {usual}");
    }
    // lengths in a unit of l, times of s, temperatures of k
    for (l, s, k) in [(1e-6, 1e-12, 1.0), (1e-6, 1e3, 1e4), (1e5, 1e9, 1e-6)] {
        let set = [
            format!("domain.x=[0.0, {}]", 0.5 * l),
            format!("domain.top=\"{}\"", 2.0 * l),
            format!("domain.front=\"{}\"", 0.1 * l),
            format!("phase.lower.initial=\"{k}*(exp(0.1 - y/{l}) - 1)\""),
            format!("phase.lower.boundary=\"{k}*(exp(t/{s}) - 1)\""),
            format!("phase.lower.diffusivity={}", l * l / s),
            format!("phase.upper.diffusivity={}", l * l / s),
            format!("front.mobility={}", 1.0 / k),
            format!("time.start={}", 0.1 * s),
            format!("time.end={}", 1.2 * s),
            "time.report=[]".into(),
            "grid.cells=[4, 20, 10]".into(),
        ];
        let front = course(WEDGE, &set).state.front[0];
        assert!((front / (l * usual) - 1.0).abs() < 1e-8, "{l} {s} {k}: {front}, not {}", l * usual);
    }
}

/// u = 2 (exp(t − s) − 1) below a front s = t that is tilted by 15 degrees, exp(t − s) − 1 above, s = cy − bx.
const TILTED: &str = r#"
[study]
name = "tilted"
kind = "stefan"
[domain]
x = [0.0, 1.0]
bottom = "0"
top = "2"
front = "(0.5 + B*x)/C"
[grid]
cells = [10, 10, 10]
[phase.lower]
initial = "2*(exp(0.5 - C*y + B*x) - 1)"
boundary = "2*(exp(t - C*y + B*x) - 1)"
[phase.upper]
initial = "exp(0.5 - C*y + B*x) - 1"
boundary = "exp(t - C*y + B*x) - 1"
[walls.sides]
left = { flux = "-B*(u + if(u > 0, 2, 1))" }
right = { flux = "B*(u + if(u > 0, 2, 1))" }
[time]
start = 0.5
end = 0.8
step = 0.01
"#;

/// Heat through the sides, which depends on the temperature there; temperatures on the sides; one of each.
#[test]
fn sides_have_fluxes_or_temperatures() {
    let (b, c) = (15.0_f64.to_radians().sin(), 15.0_f64.to_radians().cos());
    let text = TILTED.replace('B', &format!("{b:?}")).replace('C', &format!("{c:?}"));
    let value = "\"if(c*y - b*x < t, 2, 1)*(exp(t - c*y + b*x) - 1)\"";
    let value = value.replace("c*", &format!("{c:?}*")).replace("b*", &format!("{b:?}*"));
    let [both, left, right] = ["", ".left", ".right"].map(|side| format!("walls.sides{side}={value}"));
    for set in [&[][..], &[&both[..]], &[&left[..]], &[&right[..]]] {
        let error = |n: usize| {
            let cells = format!("grid.cells=[{}, {}, {}]", 10 * n, 10 * n, 10 * n);
            let step = format!("time.step={}", 0.01 / n as f64);
            let state = course(&text, &[set, &[&cells, &step]].concat()).state;
            let off = |(i, h): (usize, &f64)| (h - (0.8 + b * i as f64 / (10 * n) as f64) / c).abs();
            state.front.iter().enumerate().map(off).fold(0.0, f64::max)
        };
        let errors = [1, 2].map(error);
        println!("{set:?}: {errors:?}");
        assert!(errors[1] < 2e-4 && (errors[0] / errors[1]).log2() > 1.7, "{set:?}: {errors:?}");
    }
    for (set, words) in [
        ("walls.sides.right=\"exact\"", &["walls.sides.right", "[exact]"][..]),
        ("walls.sides={ left = \"1 - y\", right = \"1\" }", &["walls.sides.right", "melting temperature"]),
        ("walls.sides.left={ flux = \"sqrt(0.6 - t)\" }", &["walls.sides.left", "NaN"]),
        ("walls.sides={ bottom = \"no-flux\" }", &["walls.sides.bottom", "boundary"]),
    ] {
        let said = refused(&text, &[set]);
        assert!(words.iter().all(|word| said.contains(word)), "{set}: {said}");
    }
}

/// A front that is symmetric about x = 0, with conditions that change in time.
const SYMMETRIC: &str = r#"
[study]
name = "symmetric"
kind = "stefan"
[domain]
x = [-1.0, 1.0]
bottom = "0"
top = "2"
front = "1 + 0.1*cos(2*x)"
[grid]
cells = [16, 10, 10]
[phase.lower]
initial = "1 + 0.1*cos(2*x) - y"
boundary = "1 + 0.1*cos(2*x) + t"
[phase.upper]
initial = "1 + 0.1*cos(2*x) - y"
boundary = { flux = "u - 0.5" }
[walls]
sides = "1 + 0.1*cos(2*x) - y + t/2"
[time]
end = 0.3
"#;

/// The axis of a symmetric front is an insulated side: half of the box, beside temperatures or a flux on the other
/// side, has the front of the whole box.
#[test]
fn an_insulated_side_is_an_axis_of_symmetry() {
    const VALUE: &str = "\"1 + 0.1*cos(2*x) - y + t/2\"";
    const FLUX: &str = "{ flux = \"0.3 - u/2\" }";
    for condition in [VALUE, FLUX] {
        let whole = course(SYMMETRIC, &[format!("walls.sides={condition}")]).state.front;
        for (x, sides) in [
            ("[-1.0, 0.0]", format!("walls.sides={{ left = {condition}, right = \"no-flux\" }}")),
            ("[0.0, 1.0]", format!("walls.sides={{ left = \"neumann\", right = {condition} }}")),
        ] {
            let half =
                course(SYMMETRIC, &[format!("domain.x={x}"), "grid.cells=[8, 10, 10]".into(), sides]).state.front;
            let there = if x.starts_with("[-") { &whole[..9] } else { &whole[8..] };
            let off = half.iter().zip(there).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            println!("{condition} on {x}: {off:e}, {there:?}");
            assert!(off < 1e-8, "{condition} on {x}: {off:e}");
        }
    }
}

/// Each side of a flat exact front may have it, or let nothing through; nothing else.
#[test]
fn an_exact_side_stands_beside_an_insulated_one() {
    let head = SYMMETRIC[..SYMMETRIC.find("[phase.lower]").unwrap()].replace("front = \"1 + 0.1*cos(2*x)\"\n", "");
    let text = head
        + "[exact]\nkind = \"planar\"\nwall = 1.0\nfar = -0.5\nstart_front = 0.7\n"
        + "[walls.sides]\nleft = \"exact\"\nright = \"neumann\"\n[time]\nduration = 0.2\n";
    let report = course(&text, crate::front_runs::AS_IT_IS).reports[0];
    assert!(report.front.error_linf.unwrap() < 2e-3, "{report:?}");
    let said = refused(&text, &["walls.sides.left=\"1 - y\""]);
    assert!(["walls.sides.left", "\"exact\" or \"neumann\""].iter().all(|word| said.contains(word)), "{said}");
}
