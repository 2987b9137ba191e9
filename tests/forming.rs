//! Layers that form or get thinner where they are, out of data that equal cells resolve: the mesh follows them.

use crate::runs::{distance, line};
use driftmesh::study::MovingRun;

fn l_inf(run: &MovingRun<1>) -> f64 {
    run.record.reports.last().unwrap().error.unwrap().linf
}

/// u = tanh(10 eᵗ (x − ½)), which is 55 times as steep at t = 4 as at the start, with steps of any length. Equal
/// cells are off by .6 and more.
#[test]
fn a_layer_that_gets_thinner_is_followed() {
    let layer = "tanh(10*(x - 0.5)*exp(t))";
    let error = |cells: usize, step: &str| {
        l_inf(&line(&format!(
            r#"
            [domain]
            lower = [0.0]
            upper = [1.0]
            [grid]
            cells = [{cells}]
            [time]
            start = 0.0
            end = 4.0
            {step}
            [pde]
            kind = "formula"
            unknowns = ["u"]
            diffusivity = {{ u = "1e-3" }}
            source = {{ u = "(1 - {layer}^2)*10*exp(t)*(x - 0.5 + 0.02*exp(t)*{layer})" }}
            initial = {{ u = "tanh(10*(x - 0.5))" }}
            boundary = {{ u = "{layer}" }}
            exact = {{ u = "{layer}" }}
            "#
        )))
    };
    // on 200 cells equal ones resolve the layer for so long that the mesh is late
    for (cells, allowed) in [(33, 5e-3), (48, 1.5e-3), (80, 1.5e-3), (97, 1.5e-3), (200, 4e-2)] {
        let error = error(cells, "");
        assert!(error < allowed, "{cells} cells: {error:e}");
    }
    for step in [0.1, 0.02, 0.002] {
        let error = error(48, &format!("step = {step}"));
        assert!(error < 1.5e-3, "steps of {step}: {error:e}");
    }
}

/// Small data that a reaction makes grow, u_t = 5(u − u³) + 1e-5 u_xx, become a layer where they change sign: there,
/// since they are odd about that place, and tanh(500(x − x₀)) in the end. The mesh reaches it on any number of cells,
/// though equal cells resolve the data, and most of the growth is over when they do not any more.
#[test]
fn a_layer_that_a_reaction_makes_of_small_data_is_reached() {
    for (place, height) in [(0.37, 0.1), (0.6, 0.01)] {
        for (cells, allowed) in [(40, 5e-4), (60, 3.5e-4), (81, 2e-4), (120, 1e-4), (161, 6e-5), (240, 6e-5)] {
            let run = line(&format!(
                r#"
                [grid]
                cells = [{cells}]
                [time]
                start = 0.0
                end = 3.0
                [pde]
                kind = "formula"
                unknowns = ["u"]
                diffusivity = {{ u = "1e-5" }}
                source = {{ u = "5*(u - u^3)" }}
                initial = {{ u = "{height}*tanh(4*(x - {place}))" }}
                boundary = {{ u = "no-flux" }}
                "#
            ));
            let error = distance(&run, 0, |x| (500.0 * (x - place)).tanh());
            assert!(error < allowed, "at {place} from {height}, {cells} cells: {error:e}");
        }
    }
}
