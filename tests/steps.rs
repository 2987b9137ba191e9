//! Steps of any length: what rests is reached, and given steps are no worse than automatic ones.

use crate::runs::{line, plane};

/// The largest difference of two solutions at a node.
fn largest(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).fold(0.0, |m, (a, b)| m.max((a - b).abs()))
}

/// Solutions that rest are reached by steps of any length, though cells are too wide for central fluxes: those of
/// automatic steps and of steps in which the flow crosses twenty cells differ from those of short ones by 1e-6 at most.
#[test]
fn a_steady_solution_is_reached_by_steps_of_any_length() {
    let problems =
        [("u", "1", "x^2", "x"), ("(2 - x)*u", "sin(3*x)", "x", "x"), ("u^2/2", "0.3", "1 - 2*x", "1 - 2*x")];
    for (flux, source, initial, sides) in problems {
        let at_end = |step: &str| {
            let run = line(&format!(
                r#"
                [domain]
                lower = [0.0]
                upper = [1.0]
                [grid]
                cells = [40]
                [time]
                start = 0.0
                end = 10.0
                {step}
                [pde]
                kind = "formula"
                unknowns = ["u"]
                flux = {{ u = ["{flux}"] }}
                diffusivity = {{ u = "1e-3" }}
                source = {{ u = "{source}" }}
                initial = {{ u = "{initial}" }}
                boundary = {{ u = "{sides}" }}
                [mesh]
                generator = {{ kind = "fixed" }}
                "#
            ));
            run.state.unwrap().u.component(0).collect::<Vec<f64>>()
        };
        let rests = at_end("step = 0.025");
        for step in ["", "step = 0.1", "step = 0.5"] {
            let off = largest(&at_end(step), &rests);
            assert!(off < 1e-6, "flux {flux}, {step}: {off:e}");
        }
    }
}

/// The same in the plane, where the flow crosses the mesh at an angle and a layer lies along two sides.
#[test]
fn a_steady_solution_in_the_plane_is_reached_by_steps_of_any_length() {
    let at_end = |step: &str| {
        let run = plane(&format!(
            r#"
            [domain]
            lower = [0.0, 0.0]
            upper = [1.0, 1.0]
            [grid]
            cells = [20, 20]
            [time]
            start = 0.0
            end = 10.0
            {step}
            [pde]
            kind = "formula"
            unknowns = ["u"]
            flux = {{ u = ["u", "u/2"] }}
            diffusivity = {{ u = "1e-3" }}
            source = {{ u = "1" }}
            initial = {{ u = "0" }}
            boundary = {{ u = "0" }}
            [mesh]
            generator = {{ kind = "fixed" }}
            "#
        ));
        run.state.unwrap().u.component(0).collect::<Vec<f64>>()
    };
    let rests = at_end("step = 0.05");
    for step in ["", "step = 0.5"] {
        let off = largest(&at_end(step), &rests);
        assert!(off < 1e-6, "{step}: {off:e}");
    }
}

/// Steps of given length, short or long, lead to no larger error than automatic ones: a mesh that rests at the start,
/// and has yet to learn how a pulse moves, does so in parts of the first steps.
#[test]
fn given_steps_are_no_worse_than_automatic_ones() {
    let error = |step: &str| {
        let run = plane(&format!(
            r#"
            [domain]
            lower = [0.0, 0.0]
            upper = [1.0, 1.0]
            periodic = [true, true]
            [grid]
            cells = [40, 40]
            [time]
            start = 0.0
            end = 0.3
            {step}
            [pde]
            kind = "formula"
            unknowns = ["u"]
            flux = {{ u = ["u", "u"] }}
            diffusivity = {{ u = "1e-5" }}
            initial = {{ u = "exp(-(mod(x + y, 1) - 0.5)^2/0.0016)" }}
            exact = {{ u = "0.04/sqrt(0.0016 + 8e-5*t)*exp(-(mod(x + y - 2*t, 1) - 0.5)^2/(0.0016 + 8e-5*t))" }}
            "#
        ));
        run.record.reports.last().unwrap().error.unwrap().l2
    };
    let automatic = error("");
    for step in [2e-2, 5e-3, 2e-3] {
        let given = error(&format!("step = {step}"));
        assert!(given <= 1.05 * automatic, "{given:e} with steps of {step}, {automatic:e} with automatic ones");
    }
}
