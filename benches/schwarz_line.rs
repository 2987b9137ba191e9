//! Equidistribution on a million cells and 64 subdomains, and of a boundary layer to a given accuracy.
//!
//! With `layer CELLS` as arguments it times that alone and prints seconds and the error against the continuous mesh,
//! for the script that puts SciPy's `solve_bvp` beside it.

use driftmesh::equidistribution::{Coarse, FaceDensity, Line, LineDensity, Measure, Method, Stop, Sweep, pieces};
use std::time::Instant;

const LAYER: &str = "(1 - exp(20*x)) / (1 - exp(20))";

fn main() {
    // cargo adds one of its own
    let arguments: Vec<String> = std::env::args().skip(1).filter(|argument| argument != "--bench").collect();
    if let [layer, cells] = &arguments[..]
        && layer == "layer"
    {
        return boundary_layer(cells.parse().expect("a number of cells"));
    }
    million();
}

fn million() {
    let cells = 64 * 15_626 - 63; // about a million: 64 subdomains that overlap by one cell
    for (name, density) in [("x² + 1", LineDensity::formula("x^2 + 1")), ("layer", LineDensity::arclength(LAYER))] {
        let line = Line::new(density.expect("a formula"), cells);
        let ranges = pieces::equal(cells, 64, 1).expect("they fit");
        let method = Method::Classical { sweep: Sweep::Parallel, linearized: false, coarse: Coarse::Galerkin };
        let stop = Stop { iterations: 100, tolerance: Some(1e-8), measure: Measure::Error };
        let clock = Instant::now();
        let history = line.iterate(0.0, &ranges, method, &line.uniform(), None, stop).expect("solvable");
        let seconds = clock.elapsed().as_secs_f64();
        println!(
            "{name:8} {cells} cells, 64 subdomains: {} iterations, {} linear solves, to {:.1e} in {seconds:.2} s, \
             {} threads",
            history.count(),
            history.iterates[history.count()].linear_solves,
            history.iterates[history.count()].error,
            rayon::current_num_threads()
        );
        assert!(history.converged);
    }
}

fn boundary_layer(cells: usize) {
    let line =
        Line { face: FaceDensity::Trapezoid, ..Line::new(LineDensity::arclength(LAYER).expect("a formula"), cells) };
    let xi: Vec<f64> = (0..=cells).map(|i| i as f64 / cells as f64).collect();
    let exact = line.exact(0.0, &xi).expect("solvable");
    let mut best = f64::INFINITY;
    let mut error = 0.0;
    for _ in 0..20 {
        let clock = Instant::now();
        let mesh = line.solve(0.0, &line.uniform(), None).expect("solvable").0;
        best = best.min(clock.elapsed().as_secs_f64());
        error = mesh.iter().zip(&exact).map(|(x, e)| (x - e).abs()).fold(0.0, f64::max);
    }
    println!("{best:e} {error:e}");
}
