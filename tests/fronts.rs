//! Fronts by default: order in space and time, data sheets, walls with a flux, against exact solutions.

use crate::front_runs::{AS_IT_IS, course, refused};

/// Neumann's solution from a front that starts at a twentieth of the height.
const NEAR_THE_WALL: &str = r#"
[study]
name = "near-the-wall"
kind = "stefan"
[domain]
x = [0.0, 0.1]
bottom = "0"
top = "1"
[grid]
cells = [4, 32, 16]
[exact]
kind = "planar"
wall = 1.0
far = 0.0
start_front = 0.05
[front]
mobility = 0.01
[time]
duration = 4.9
report = [1.0, 3.0, 5.0]
"#;

/// With nothing said of steps the front is right to .2 % and energy to 1e-5 while it moves to six times its distance.
#[test]
fn a_front_that_starts_near_a_wall_is_right_by_default() {
    let reports = course(NEAR_THE_WALL, AS_IT_IS).reports;
    assert_eq!(reports.len(), 3);
    for report in reports {
        let [error, energy] = [report.front.error_linf.unwrap(), report.energy_imbalance.unwrap()];
        println!("t = {}: {:e} {energy:e}", report.t, error / report.front.mean);
        assert!(error <= 2e-3 * report.front.mean && energy <= 1e-5, "t = {}: {error:e} {energy:e}", report.t);
    }
}

/// The explicit front follows the wall by its automatic steps, too.
#[test]
fn explicit_steps_follow_the_distance_from_the_wall() {
    let report = course(NEAR_THE_WALL, &["front.stepping=\"explicit\""]).reports[0];
    let error = report.front.error_linf.unwrap() / report.front.mean;
    println!("{error:e}");
    assert!(error <= 2e-3, "{error:e}");
}

/// Melting with Λ of the order of C ΔT, so that temperatures are far from steady.
const PLANAR: &str = r#"
[study]
name = "planar"
kind = "stefan"
[domain]
x = [-1.0, 1.0]
bottom = "0"
top = "2"
[grid]
cells = [4, 8, 8]
[exact]
kind = "planar"
wall = 1.0
far = -0.5
start_front = 0.7
[time]
duration = 0.4
step = 0.001
"#;

/// Errors of the front with steps that are short for all grids.
#[test]
fn the_front_is_of_second_order_in_space() {
    let errors = [1, 2, 4].map(|n| {
        let cells = format!("grid.cells=[4, {}, {}]", 8 * n, 8 * n);
        course(PLANAR, &[cells]).reports[0].front.error_linf.unwrap()
    });
    println!("{errors:?}");
    for pair in errors.windows(2) {
        let order = (pair[0] / pair[1]).log2();
        assert!(order >= 1.9, "order {order:.2}: {errors:?}");
    }
}

/// The change of the front from a step to half of it, on one grid.
#[test]
fn the_front_is_of_second_order_in_time() {
    let heights = [0.1, 0.05, 0.025, 0.0125].map(|step| course(PLANAR, &[format!("time.step={step}")]).state.front[0]);
    let changes: Vec<f64> = heights.windows(2).map(|h| (h[1] - h[0]).abs()).collect();
    println!("{changes:?}");
    for pair in changes.windows(2) {
        let order = (pair[0] / pair[1]).log2();
        assert!(order >= 1.9, "order {order:.2}: {changes:?}");
    }
}

/// Water of 20 °C melts ice of −5 °C: W, J, m, s and kelvin above that of melting.
const ICE: &str = r#"
[study]
name = "ice"
kind = "stefan"
[domain]
x = [0.0, 0.02]
bottom = "0"
top = "0.5"
[grid]
cells = [4, 20, 40]
[phase.lower]
conductivity = 0.6
capacity = 4.18e6
[phase.upper]
conductivity = 2.2
capacity = 1.92e6
[front]
latent_heat = 3.06e8
[exact]
kind = "planar"
wall = 20.0
far = -5.0
start_front = 0.01
[time]
duration = 36000.0
"#;

/// Ten hours, for two latent heats, with temperatures above melting and above absolute zero.
#[test]
fn ice_melts_in_the_units_of_a_data_sheet() {
    for set in
        [&[][..], &["front.latent_heat=3.34e8"], &["front.melting=273.15", "exact.wall=293.15", "exact.far=268.15"]]
    {
        let report = course(ICE, set).reports[0];
        let [error, energy] = [report.front.error_linf.unwrap(), report.energy_imbalance.unwrap()];
        println!("{set:?}: {} {:e} {energy:e}", report.front.mean, error / report.front.mean);
        assert!(error <= 1e-3 * report.front.mean, "{set:?}: {error:e} of {}", report.front.mean);
    }
}

/// Diffusivities with a mobility, or a data sheet: never some of both, and nothing that is not positive.
#[test]
fn material_is_given_in_one_way() {
    for (set, words) in [
        (
            &["phase.lower.diffusivity=1.0"][..],
            &["phase.lower.diffusivity", "phase.lower.conductivity", "mobility"][..],
        ),
        (&["front.mobility=1.0"], &["front.mobility", "front.latent_heat"]),
        (&["front.latent_heat=0.0"], &["front.latent_heat", "above 0"]),
        (&["phase.upper.capacity=-1.0"], &["phase.upper.capacity", "above 0"]),
        (&["phase.lower.conductivity=0.0"], &["phase.lower.conductivity", "above 0"]),
        (&["front.melting=30.0"], &["exact.wall", "above 30"]),
    ] {
        let error = refused(ICE, set);
        let text = format!("{error}\n{:?}", error.help());
        assert!(words.iter().all(|word| text.contains(word)), "{set:?}: {text}");
    }
    let error = refused(PLANAR, &["front.melting=1.0"]);
    assert!(error.to_string().contains("phase.lower.conductivity"), "{error}");
}

/// u = exp(t − y) − 1 below h = t, and ice at its melting point above.
const EXPONENTIAL: &str = r#"
[study]
name = "exponential"
kind = "stefan"
[domain]
x = [0.0, 0.5]
bottom = "0"
top = "2"
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
end = 1.0
"#;

/// A given temperature, a given flux, and one that depends on the temperature have the same front, to second order.
#[test]
fn a_wall_has_a_temperature_or_a_flux() {
    for wall in ["\"exp(t) - 1\"", "{ flux = \"exp(t)\" }", "{ flux = \"u + 1\" }", "{ flux = \"2*exp(t) - 1 - u\" }"] {
        let error = |n: usize| {
            let set = [
                format!("phase.lower.boundary={wall}"),
                "phase.upper.boundary=\"no-flux\"".into(),
                format!("grid.cells=[4, {}, {}]", 10 * n, 5 * n),
                format!("time.step={}", 0.045 / n as f64),
            ];
            let course = course(EXPONENTIAL, &set);
            (course.state.front[2] - course.state.t).abs()
        };
        let errors = [8, 16].map(error);
        println!("{wall}: {errors:?}");
        for pair in errors.windows(2) {
            let order = (pair[0] / pair[1]).log2();
            assert!(order >= 1.9, "{wall}: order {order:.2}, {errors:?}");
        }
    }
}

/// Both phases at the melting temperature, and a wall that begins to melt one of them: nothing is on the wrong side.
#[test]
fn phases_at_their_melting_temperature_begin_to_melt() {
    let start =
        ["phase.lower.initial=\"0\"", "phase.upper.boundary=\"no-flux\"", "domain.front=\"0.5\"", "time.end=0.4"];
    for (wall, melts) in [("\"1\"", true), ("{ flux = \"1\" }", true), ("\"1 - exp(0.1 - t)\"", true), ("\"0\"", false)]
    {
        let set = start.iter().map(|set| set.to_string()).chain([format!("phase.lower.boundary={wall}")]);
        let course = course(EXPONENTIAL, &set.collect::<Vec<_>>());
        assert_eq!(course.state.front[0] > 0.5 + 1e-3, melts, "{wall}: {}", course.state.front[0]);
    }
    // the same front on twice as many cells
    let set = start.iter().map(|set| set.to_string()).chain(["phase.lower.boundary=\"1\"".to_string()]);
    let [coarse, fine] = [1, 2].map(|n| {
        let set = set.clone().chain([format!("grid.cells=[4, {}, {}]", 20 * n, 10 * n)]);
        course(EXPONENTIAL, &set.collect::<Vec<_>>()).state.front[0]
    });
    assert!((coarse - fine).abs() < 1e-3 * (fine - 0.5), "{coarse} and {fine}");
}
