//! Shocks where nothing diffuses: Riemann problems with exact solutions.

use driftmesh::study::{Kind, MovingLine, MovingRun, Source};

/// A run with u_t + f(u)_x = 0 from u = left for x < 0.3, and u = right beyond, over t = 0 … 0.8.
fn run(flux: &str, initial: &str, cells: usize) -> MovingRun<1> {
    let text = format!(
        "[study]\nname = \"shock\"\nkind = \"moving-mesh\"\n[domain]\nlower = [0.0]\nupper = [1.0]\n[grid]\n\
         cells = [{cells}]\n[time]\nstart = 0\nend = 0.8\n[pde]\nkind = \"formula\"\nunknowns = [\"u\"]\n\
         flux = {{ u = [\"{flux}\"] }}\ninitial = {{ u = \"{initial}\" }}\nboundary = {{ u = \"outflow\" }}\n"
    );
    let study = MovingLine::from_source(&Source::new("the study", text)).unwrap();
    let (run, failure) = study.compute().unwrap();
    assert!(failure.is_none(), "{flux} from {initial} on {cells} cells: {failure:?}");
    run
}

/// Where the solution is the share s of the way from its right to its left value, by linear interpolation.
fn level(run: &MovingRun<1>, [left, right]: [f64; 2], s: f64) -> f64 {
    let state = run.state.as_ref().unwrap();
    let (x, u): (Vec<f64>, Vec<f64>) = state.mesh.x().iter().map(|x| x[0]).zip(state.u.component(0)).unzip();
    let share = |u: f64| (u - right) / (left - right);
    let k = (1..x.len()).rev().find(|&k| share(u[k - 1]) >= s && share(u[k]) < s).unwrap();
    x[k] - (x[k] - x[k - 1]) * (s - share(u[k])) / (share(u[k - 1]) - share(u[k]))
}

/// The mesh goes along with a shock: it is at its place, within half an equal cell from end to end, and the number of
/// steps grows no faster than that of cells. From data as thin as no cell as well as from a jump.
#[test]
fn a_shock_takes_as_many_steps_as_its_cells_ask_for() {
    for (flux, initial, ends, place) in [
        ("u^2/2", "if(x < 0.3, 1, 0)", [1.0, 0.0], 0.7),
        ("u^2/2", "0.5 + 0.5*tanh(1000*(0.3 - x))", [1.0, 0.0], 0.7),
        ("100*u^2/2", "if(x < 0.3, 0.01, 0)", [0.01, 0.0], 0.7),
        ("u*(1 - u)", "if(x < 0.3, 0.1, 0.8)", [0.1, 0.8], 0.38),
    ] {
        for cells in [40, 80, 160] {
            let (run, cell) = (run(flux, initial, cells), 1.0 / cells as f64);
            let case = format!("{flux} from {initial} on {cells} cells");
            let steps = run.record.work.steps;
            assert!(steps <= 25 * cells, "{case}: {steps} steps");
            let [head, middle, foot] = [0.95, 0.5, 0.05].map(|s| level(&run, ends, s));
            assert!((middle - place).abs() < 0.2 * cell, "{case}: {} cells off", (middle - place) / cell);
            assert!(foot - head < 0.5 * cell, "{case}: {} cells wide", (foot - head) / cell);
            let [low, high] = [ends[0].min(ends[1]), ends[0].max(ends[1])];
            let beyond = |u: f64| (low - u).max(u - high);
            let worst = run.state.unwrap().u.component(0).map(beyond).fold(0.0, f64::max);
            assert!(worst <= 1e-6 * (high - low), "{case}: {worst:e} out of its range");
        }
    }
}
