//! Small problems of the plane that people brought up in public; docs/faults.md has the rest of them.

use crate::runs::plane;
use driftmesh::study::MovingRun;

fn l_inf(run: &MovingRun) -> f64 {
    run.record.reports.last().unwrap().error.unwrap().linf
}

/// u_t = −10⁵ (u − x) from u = 0, with steps 10⁴ times as long as the decay takes and with automatic ones, which begin
/// shorter than it: u = x, without ringing.
#[test]
fn a_stiff_decay_is_over_at_once() {
    for step in ["step = 0.1", ""] {
        let run = plane(&format!(
            r#"
            [grid]
            cells = [10, 10]
            [time]
            start = 0.0
            end = 10.0
            report = [0.1, 1.0, 10.0]
            {step}
            [pde]
            kind = "formula"
            unknowns = ["u"]
            source = {{ u = "-1e5*(u - x)" }}
            initial = {{ u = "0" }}
            boundary = {{ u = "no-flux" }}
            exact = {{ u = "x" }}
            "#
        ));
        let errors: Vec<f64> = run.record.reports.iter().map(|report| report.error.unwrap().linf).collect();
        assert!(errors.iter().all(|error| *error < 1e-6), "{step}: {errors:?}");
    }
}

/// A plane front that a reaction drives through a box of 64 × 8, of 64 × .008 and of 64 × 8·10⁻⁴: the cells of a strip
/// are a hundred thousand times as long as they are high, and its error is that in the box within 5 %.
#[test]
fn a_front_passes_a_strip_as_it_passes_a_box() {
    let error = |height: &str| {
        l_inf(&plane(&format!(
            r#"
            [domain]
            lower = [0.0, 0.0]
            upper = [64.0, {height}]
            [grid]
            cells = [64, 8]
            [time]
            start = 0.0
            end = 2.5
            [pde]
            kind = "formula"
            unknowns = ["u"]
            diffusivity = {{ u = "8" }}
            source = {{ u = "(u - u^3)/0.0361 + 10" }}
            initial = {{ u = "0.227759606941801 - 0.918899713971633*tanh(1.20907857101531*(x - 16))" }}
            boundary = {{ u = "no-flux" }}
            exact = {{ u = "0.227759606941801 - 0.918899713971633*tanh(1.20907857101531*(x - 16 - 14.3848172805*t))" }}
            "#
        )))
    };
    let whole = error("8.0");
    assert!(whole < 1.5e-2, "{whole:e}");
    for height in ["0.008", "0.0008"] {
        let strip = error(height);
        assert!((strip / whole - 1.0).abs() < 0.05, "{height}: {strip:e} where the box has {whole:e}");
    }
}

/// An N wave whose data are 10⁻²¹⁷ on the sides, where it is 0: no warning of a difference, nor of anything else.
#[test]
fn rounding_on_the_sides_is_no_reason_to_warn() {
    let run = plane(
        r#"
        [domain]
        lower = [-1.5, 0.0]
        upper = [1.5, 0.25]
        periodic = [false, true]
        [grid]
        cells = [80, 4]
        [time]
        start = 1.0
        end = 4.0
        [pde]
        kind = "formula"
        unknowns = ["u"]
        flux = { u = ["0.5*u^2", "0"] }
        diffusivity = { u = "0.001" }
        initial = { u = "x/(1 + exp((x^2 - 0.25)/(4*0.001)))" }
        boundary = { u = "0" }
        exact = { u = "(x/t)/(1 + sqrt(t)*exp((x^2/t - 0.25)/(4*0.001)))" }
        "#,
    );
    assert!(run.record.warnings.is_empty(), "{:?}", run.record.warnings);
    assert!(l_inf(&run) < 1e-2, "{:e}", l_inf(&run));
}

/// A slotted cylinder, a cone and a hump turn once around the middle of the box: nothing leaves the range of the data,
/// which are the exact solution again, and the mean error is below half of what van Leer's limiter leaves on a uniform
/// 60² (5.0e-2).
#[test]
fn a_slotted_cylinder_turns_once() {
    let run = plane(
        r#"
        [domain]
        lower = [-0.5, -0.5]
        upper = [0.5, 0.5]
        [grid]
        cells = [40, 40]
        [time]
        start = 0.0
        end = 6.283185307179586
        [pde]
        kind = "formula"
        unknowns = ["u"]
        flux = { u = ["-y*u", "x*u"] }
        diffusivity = { u = "0" }
        initial = { u = "HUMP + CONE + CYLINDER" }
        boundary = { u = "0" }
        "#
        .replace("HUMP", "0.25*(1 + cos(pi*min(sqrt((x + 0.25)^2 + y^2)/0.15, 1)))")
        .replace("CONE", "1 - min(sqrt(x^2 + (y + 0.25)^2)/0.15, 1)")
        .replace("CYLINDER", "if(x^2 + (y - 0.25)^2 < 0.0225, if(abs(x) < 0.025, if(y < 0.35, 0, 1), 1), 0)")
        .as_str(),
    );
    let state = run.state.as_ref().unwrap();
    let exact = |[x, y]: [f64; 2]| {
        let [hump, cone] = [(x + 0.25).hypot(y), x.hypot(y + 0.25)].map(|r| (r / 0.15).min(1.0));
        let is_cylinder = x.hypot(y - 0.25) < 0.15 && !(x.abs() < 0.025 && y < 0.35);
        0.25 * (1.0 + (std::f64::consts::PI * hump).cos()) + 1.0 - cone + f64::from(u8::from(is_cylinder))
    };
    let cells = driftmesh::geometry::DualCells::new(&state.mesh);
    let mut mean = 0.0;
    for ((x, u), area) in state.mesh.x().iter().zip(state.u.component(0)).zip(cells.areas()) {
        assert!((-0.01..=1.01).contains(&u), "{u} at {x:?}");
        mean += area * (u - exact(*x)).abs();
    }
    assert!(mean < 3e-2, "{mean:e}");
}
