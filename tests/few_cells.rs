//! Smooth solutions on so few cells that equal ones hardly resolve them: what moving the mesh may make worse.

use crate::runs::line;

/// Sums of two sines that diffuse away, on 16 to 40 cells: the largest error at a node is at most twice that of equal
/// cells, also where the data change by a quarter of their range over a cell, so that a mesh is adapted at first.
#[test]
fn sines_on_few_cells_have_at_most_twice_the_error_at_nodes() {
    let error = |mode: usize, cells: usize, generator: &str| {
        let run = line(&format!(
            r#"
            [grid]
            cells = [{cells}]
            [time]
            start = 0.0
            end = 0.05
            [pde]
            kind = "formula"
            unknowns = ["u"]
            diffusivity = {{ u = "1" }}
            initial = {{ u = "sin(pi*x) + 0.3*sin({mode}*pi*x)" }}
            boundary = {{ u = "0" }}
            exact = {{ u = "exp(-pi^2*t)*sin(pi*x) + 0.3*exp(-{mode}^2*pi^2*t)*sin({mode}*pi*x)" }}
            [mesh]
            generator = {{ kind = "{generator}" }}
            "#
        ));
        run.record.reports.last().unwrap().error.unwrap().linf
    };
    for mode in [2, 3, 4] {
        for cells in [16, 20, 24, 30, 40] {
            let [moving, fixed] = ["whole", "fixed"].map(|generator| error(mode, cells, generator));
            assert!(moving < 2.0 * fixed, "mode {mode}, {cells} cells: {moving:e} where equal ones have {fixed:e}");
        }
    }
}
