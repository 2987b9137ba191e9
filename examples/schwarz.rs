//! How fast do two halves of a mesh agree? Change M and see which contractions change with it.
//!
//! ```text
//! cargo run --release -p driftmesh --example schwarz -- "x^2 + 1"
//! cargo run --release -p driftmesh --example schwarz -- "300*(x - 0.5)^2 + 1"
//! ```

use driftmesh::equidistribution::{Coarse, FaceDensity, Line, LineDensity, Measure, Method, Robin, Stop, Sweep};
use std::process::ExitCode;

fn main() -> ExitCode {
    let m = std::env::args().nth(1).unwrap_or_else(|| "x^2 + 1".into());
    match density(&m) {
        Ok(density) => {
            table(&m, density);
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(2)
        }
    }
}

fn density(m: &str) -> driftmesh::Result<LineDensity> {
    let density = LineDensity::formula(m)?;
    density.extremes(0.0, [0.0, 1.0])?;
    Ok(density)
}

fn table(m: &str, density: LineDensity) {
    let line = Line { face: FaceDensity::Exact, ..Line::new(density, 100) };
    let classical = |linearized| Method::Classical { sweep: Sweep::Parallel, linearized, coarse: Coarse::None };
    let optimized = |robin| Method::Optimized { robin };
    let rows: [(&str, Method, [usize; 2]); 7] = [
        ("classical, .48/.52", classical(false), [48, 52]),
        ("classical, .45/.55", classical(false), [45, 55]),
        ("classical, .40/.60", classical(false), [40, 60]),
        ("linearised, .45/.55", classical(true), [45, 55]),
        ("optimised, p = 2", optimized(Robin::Value(2.0)), [50, 50]),
        ("optimised, p lagged", optimized(Robin::Lagged), [50, 50]),
        ("optimal", Method::Optimal { panels: None }, [50, 50]),
    ];
    // symmetric starts can hide the slowest error
    let start = line.mapped(|xi| xi.powf(1.3));
    println!(
        "M = {m}, 100 cells, from ξ^1.3\n{:20} {:>9} {:>9} {:>9}  iterations to 1e-10",
        "contraction in two", "predicted", "at most", "observed"
    );
    for (name, method, [alpha, beta]) in rows {
        let stop = Stop { iterations: 1000, tolerance: Some(1e-10), measure: Measure::Error };
        let rate = |rate: Option<f64>| rate.map_or("-".into(), |rate| format!("{rate:.5}"));
        match line.iterate(0.0, &[[0, beta], [alpha, 100]], method, &start, None, stop) {
            Ok(history) => {
                let [predicted, bound, observed] =
                    [history.prediction.predicted, history.prediction.bound, history.observed].map(rate);
                let count = if history.converged { history.count().to_string() } else { "never".into() };
                println!("{name:20} {predicted:>9} {bound:>9} {observed:>9}  {count}");
            }
            Err(error) => println!("{name:20} {error}"),
        }
    }
}
