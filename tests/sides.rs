//! Conditions by side for equations given by formulas.

use crate::runs::{HEAD, line, plane};
use driftmesh::error::Error;
use driftmesh::study::{Kind, MovingMesh, Source};

/// A reactor with Danckwerts' inlet and a closed outlet, u_t + 5 u_x = u_xx − 2u with 5u − u_x = 5 at x = 0 and 0 at
/// x = 1: at rest u = A e^{px} + B e^{qx}, p and q = (5 ± √33)/2. The error is of order 2.
#[test]
fn an_inlet_is_second_order() {
    let [p, q] = [1.0, -1.0].map(|sign| 0.5 * (5.0 + sign * 33.0_f64.sqrt()));
    // rows of the two conditions on A and B
    let [[a, b], [c, d]] = [[5.0 - p, 5.0 - q], [(5.0 - p) * p.exp(), (5.0 - q) * q.exp()]];
    let determinant = a * d - b * c;
    let (first, second) = (5.0 * d / determinant, -5.0 * c / determinant);
    let error = |cells: usize| {
        let run = line(&format!(
            r#"
            [grid]
            cells = [{cells}]
            [time]
            start = 0.0
            end = 12.0
            [pde]
            kind = "formula"
            unknowns = ["u"]
            flux = {{ u = ["5*u"] }}
            diffusivity = {{ u = "1" }}
            source = {{ u = "-2*u" }}
            initial = {{ u = "0" }}
            boundary = {{ u = {{ left = {{ flux = "5" }}, right = "no-flux" }} }}
            "#
        ));
        let state = run.state.unwrap();
        let pairs = state.mesh.x().iter().zip(state.u.component(0));
        pairs.map(|([x], u)| (u - first * (p * x).exp() - second * (q * x).exp()).abs()).fold(0.0, f64::max)
    };
    let errors = [80, 160].map(error);
    let order = (errors[0] / errors[1]).log2();
    assert!(errors[0] < 2e-3 && (order - 2.0).abs() < 0.2, "{errors:?}, order {order:.2}");
}

/// u = 2 + sin(x − t) cos πy with values on the left, what flows in on the right, nothing through the bottom and free
/// outflow at the top, on a mesh that is moved about: order 2 in cells and steps.
#[test]
fn every_condition_is_second_order_on_a_moving_mesh() {
    let error = |cells: usize, step: f64| {
        let run = plane(&format!(
            r#"
            [grid]
            cells = [{cells}, {cells}]
            [time]
            start = 0.0
            end = 0.4
            step = {step}
            [pde]
            kind = "formula"
            unknowns = ["u"]
            flux = {{ u = ["u^2/4", "0.3*u*y"] }}
            diffusivity = {{ u = "0.2" }}
            initial = {{ u = "2 + sin(x)*cos(pi*y)" }}
            exact = {{ u = "2 + sin(x - t)*cos(pi*y)" }}
            [pde.source]
            u = """(0.2*(1 + pi^2)*sin(x - t) - cos(x - t))*cos(pi*y)
                + 0.5*(2 + sin(x - t)*cos(pi*y))*cos(x - t)*cos(pi*y)
                + 0.3*(2 + sin(x - t)*cos(pi*y)) - 0.3*y*sin(x - t)*pi*sin(pi*y)"""
            [pde.boundary.u]
            left = "2 + sin(x - t)*cos(pi*y)"
            right = {{ flux = "0.2*cos(x - t)*cos(pi*y) - u^2/4" }}
            bottom = "no-flux"
            top = "outflow"
            [mesh]
            relaxation = 0.05
            [monitor]
            kind = "given"
            of = "1 + 0.3*sin(5*x + 3*y - 6*t)"
            "#
        ));
        assert!(run.record.travelled > 0.01, "{}", run.record.travelled);
        run.record.reports.last().unwrap().error.unwrap().linf
    };
    let errors = [error(12, 0.04), error(24, 0.02)];
    let order = (errors[0] / errors[1]).log2();
    assert!((1.7..2.6).contains(&order), "{errors:?}, order {order:.2}");
}

/// What flows in is what the content grows by, to round-off, with both steppers.
#[test]
fn the_content_grows_by_what_flows_in() {
    for stepper in ["trapezoid", "tr-bdf2"] {
        let run = plane(&format!(
            r#"
            [domain]
            upper = [2.0, 0.5]
            [grid]
            cells = [20, 6]
            [time]
            start = 0.0
            end = 0.5
            stepper = "{stepper}"
            [pde]
            kind = "formula"
            unknowns = ["u"]
            diffusivity = {{ u = "0.02*(1 + u)" }}
            initial = {{ u = "1 + tanh(20*(x - 1))" }}
            [pde.boundary.u]
            left = {{ flux = "0.3" }}
            right = {{ flux = "-0.05" }}
            bottom = "no-flux"
            top = {{ flux = "0" }}
            "#
        ));
        let report = run.record.reports.last().unwrap();
        let start = report.conserved.mass / (1.0 + report.conserved.drift);
        let flown = 0.5 * (0.3 * 0.5 - 0.05 * 0.5);
        assert!((report.conserved.mass - start - flown).abs() < 1e-12, "{stepper}: {:?}, {start}", report.conserved);
    }
}

/// A ball that radiates, −u_r = u⁴ − 1 at its surface, cools to 1, and what it loses has left through its surface.
#[test]
fn a_ball_radiates_until_it_is_as_warm_as_its_surroundings() {
    let run = line(
        r#"
        [domain]
        coordinates = "spherical"
        [grid]
        cells = [30]
        [time]
        start = 0.0
        end = 6.0
        [pde]
        kind = "formula"
        unknowns = ["u"]
        diffusivity = { u = "1" }
        initial = { u = "2" }
        boundary = { u = { left = "no-flux", right = { flux = "1 - u^4" } } }
        "#,
    );
    let state = run.state.unwrap();
    assert!(state.u.component(0).all(|u| (u - 1.0).abs() < 1e-6), "{:?}", state.u);
}

/// Sides that are not there, left out, or misspelt are named with those that there are.
#[test]
fn sides_are_refused_by_name() {
    let refused = |periodic: &str, boundary: &str| -> String {
        let text = format!(
            "{HEAD}[domain]\nperiodic = {periodic}\n[grid]\ncells = [8, 8]\n[time]\nstart = 0.0\nend = 1.0\n[pde]\n\
             kind = \"formula\"\nunknowns = [\"u\"]\ninitial = {{ u = \"0\" }}\nboundary = {{ u = {boundary} }}\n"
        );
        match MovingMesh::from_source(&Source::new("plane.toml", text)) {
            Err(Error::Study(diagnostic)) => format!("{diagnostic}\n{}", diagnostic.help.clone().unwrap_or_default()),
            other => panic!("{boundary}: {other:?}"),
        }
    };
    for (periodic, boundary, said) in [
        ("[false, true]", r#"{ left = "0", right = "1", top = "2" }"#, "the sides here are left, right"),
        ("[false, false]", r#"{ left = "0", right = "1", top = "2" }"#, "add bottom = \"no-flux\""),
        ("[false, false]", r#"{ lefft = "0" }"#, "did you mean `left`?"),
        ("[false, false]", r#"{ flux = "2*w" }"#, "unknown name `w`"),
        ("[false, false]", r#"{ flux = "2", left = "0" }"#, "unknown key `left`"),
        ("[false, false]", r#""Out flow""#, "write \"outflow\""),
        ("[false, false]", "[1, 2]", "\"no-flux\""),
    ] {
        let error = refused(periodic, boundary);
        assert!(error.contains(said), "{boundary}: {error}");
    }
}

/// Water that a clay takes up from a wet side, by Richards' equation in van Genuchten's form, whose conductivity has no
/// value beyond saturation: where Newton's method or a long step would lead there, both go on with less. On any number
/// of cells it completes, between the two contents to a thousandth, and has the front where most cells have it.
#[test]
fn what_a_formula_has_no_value_for_is_not_reached() {
    let sat = "((u - 0.078)/0.352)";
    let dry = format!("(1 - {sat}^2.785714286)");
    let front = |cells: usize, wet: f64| {
        let state = line(&format!(
            r#"
            [grid]
            cells = [{cells}]
            [time]
            start = 0.0
            end = 21600.0
            [pde]
            kind = "formula"
            unknowns = ["u"]
            flux = {{ u = ["2.89e-06*sqrt({sat})*(1 - (1 - {sat}^2.785714286)^0.358974359)^2"] }}
            diffusivity = {{ u = "4.0725334e-6*{sat}^(-2.285714286)*({dry}^(-0.358974359) + {dry}^0.358974359 - 2)" }}
            initial = {{ u = "0.24213178" }}
            boundary = {{ u = "if(x < 0.5, {wet}, 0.24213178)" }}
            "#
        ))
        .state
        .unwrap();
        let u: Vec<f64> = state.u.component(0).collect();
        assert!(u.iter().all(|u| (0.24213178 - 2e-4..wet + 2e-4).contains(u)), "{cells}: {u:?}");
        let k = u.iter().position(|u| *u < 0.3).unwrap();
        let [a, b] = [k - 1, k].map(|k| state.mesh.x()[k][0]);
        a + (b - a) * (u[k - 1] - 0.3) / (u[k - 1] - u[k])
    };
    for wet in [0.40, 0.42648] {
        let fronts = [30, 50, 120, 240].map(|cells| front(cells, wet));
        assert!(fronts.iter().all(|x| (x / fronts[3] - 1.0).abs() < 0.02), "{wet}: {fronts:?}");
    }
}

/// Heat that enters from a side that jumps at the start, against erfc(x/√(4Dt)): within its range, and as accurate
/// where the layer has spread as equal cells are.
#[test]
fn a_side_that_jumps_stays_in_range() {
    let error = |cells: usize, generator: &str| {
        let run = line(&format!(
            "[grid]\ncells = [{cells}]\n[time]\nstart = 0.0\nend = 5.0\n[pde]\nkind = \"formula\"\nunknowns = [\"u\"]\n\
             diffusivity = {{ u = \"0.001\" }}\ninitial = {{ u = \"0\" }}\n\
             boundary = {{ u = {{ left = \"1\", right = \"0\" }} }}\n\
             exact = {{ u = \"if(x > 0, 1 - erf(x/(2*sqrt(0.001*max(t, 1e-30)))), 1)\" }}\n\
             [mesh]\ngenerator = {{ kind = \"{generator}\" }}\n"
        ));
        assert!(run.record.warnings.iter().all(|warning| !warning.contains("leaves the range")), "{:?}", run.record);
        run.record.reports.last().unwrap().error.unwrap().l2
    };
    for cells in [40, 80] {
        let [ours, theirs] = ["whole", "fixed"].map(|generator| error(cells, generator));
        println!("{cells}: {ours:e} {theirs:e}");
        assert!(ours < 2.0 * theirs, "{cells} cells: {ours:e} against {theirs:e}");
    }
}
