//! M. J. Gander and R. D. Haynes, *Domain decomposition approaches for mesh generation via the equidistribution
//! principle*
//! (2012): section 8, the theorems, and what they left open.
//!
//! Their table and plots give neither the number of cells nor the norm; 100 cells and trapezoidal averages reproduce
//! table 8.1.

mod coarse;
mod coupled;
mod errata;
mod figures;
mod in_time;
mod moving;
mod table_8_1;
mod theorems;
mod variants;

pub use coarse::coarse;
pub use coupled::coupled;
pub use errata::errata;
pub use figures::{figure_8_1, figure_8_2, figure_8_3};
pub use in_time::in_time;
pub use moving::figure_8_6;
pub use table_8_1::table_8_1;
pub use theorems::theorems;
pub use variants::{figure_8_4, figure_8_5};

use driftmesh::equidistribution::{Coarse, History, Line, LineDensity, Measure, Method, Stop, Sweep};
use driftmesh::error::Result;
use driftmesh::output::{Curve, Figure, Scale};

const LAYER: &str = "(1 - exp(20*x)) / (1 - exp(20))";
const NONLINEAR: Method = Method::Classical { sweep: Sweep::Parallel, linearized: false, coarse: Coarse::None };
const LINEARISED: Method = Method::Classical { sweep: Sweep::Parallel, linearized: true, coarse: Coarse::None };
const ALTERNATING: Method = Method::Classical { sweep: Sweep::Alternating, linearized: false, coarse: Coarse::None };
const ALTERNATING_LINEARISED: Method =
    Method::Classical { sweep: Sweep::Alternating, linearized: true, coarse: Coarse::None };
const VARIANTS: [(&str, Method); 4] = [
    ("nonlinear, parallel", NONLINEAR),
    ("nonlinear, alternating", ALTERNATING),
    ("linearised, parallel", LINEARISED),
    ("linearised, alternating", ALTERNATING_LINEARISED),
];
/// Overlaps of two subdomains of 100 cells.
const OVERLAPS: [[usize; 2]; 3] = [[48, 52], [45, 55], [40, 60]];

fn square(cells: usize) -> Result<Line> {
    Ok(Line::new(LineDensity::formula("x^2 + 1")?, cells))
}

fn layer(cells: usize) -> Result<Line> {
    Ok(Line::new(LineDensity::arclength(LAYER)?, cells))
}

/// M = C(x − ½)² + 1.
fn valley(c: f64, cells: usize) -> Result<Line> {
    Ok(Line::new(LineDensity::formula(&format!("{c}*(x - 0.5)^2 + 1"))?, cells))
}

fn two([alpha, beta]: [usize; 2], cells: usize) -> [[usize; 2]; 2] {
    [[0, beta], [alpha, cells]]
}

fn exactly(iterations: usize) -> Stop {
    Stop { iterations, tolerance: None, measure: Measure::Error }
}

fn until(tolerance: f64) -> Stop {
    Stop { iterations: 5000, tolerance: Some(tolerance), measure: Measure::Error }
}

fn from_uniform(line: &Line, ranges: &[[usize; 2]], method: Method, stop: Stop) -> Result<History> {
    line.iterate(0.0, ranges, method, &line.uniform(), None, stop)
}

fn name([alpha, beta]: [usize; 2]) -> String {
    format!(".{alpha}/.{beta}")
}

fn rate(value: Option<f64>) -> String {
    value.map_or("–".into(), |value| format!("{value:.5}"))
}

fn verdict(holds: bool) -> String {
    if holds { "holds" } else { "does not hold" }.into()
}

/// Errors of subdomain one against iterations, every so many of them, as the paper's figures show them.
fn curve(name: &str, history: &History, stride: usize) -> Curve {
    let points = history.first.iter().enumerate().step_by(stride).map(|(n, error)| [n as f64, *error]);
    Curve { name: name.into(), points: points.collect(), ..Curve::default() }
}

fn by_solves(name: &str, history: &History) -> Curve {
    let points = history.iterates.iter().zip(&history.first).map(|(it, error)| [it.linear_solves as f64, *error]);
    Curve { name: name.into(), points: points.collect(), ..Curve::default() }
}

fn errors(title: &str, along: &str, curves: Vec<Curve>) -> Figure {
    Figure {
        title: title.into(),
        labels: [along.into(), "error of subdomain one".into()],
        scales: [Scale::Linear, Scale::Logarithmic],
        curves,
        ..Figure::default()
    }
}
