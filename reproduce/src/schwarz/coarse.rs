//! A coarse correction for any number of subdomains, which the paper leaves to the future.

use super::{NONLINEAR, from_uniform, layer, square, until, valley};
use crate::{Options, Rerun, Table};
use driftmesh::equidistribution::{Coarse, FaceDensity, Line, LineDensity, Method, Sweep};
use driftmesh::error::{Error, Failure, Result};
use driftmesh::output::{Curve, Figure, Picture};

const SPIKE: &str = "1 + 100*exp(-1000*(x - 0.5)^2)";
/// A density by its number of cells.
type Problem = fn(usize) -> Result<Line>;

fn spike(cells: usize) -> Result<Line> {
    Ok(Line::new(LineDensity::formula(SPIKE)?, cells))
}

/// u = tanh(1000(x − .37)): a layer far thinner than any cell of the start.
fn thin(cells: usize) -> Result<Line> {
    Ok(Line::new(LineDensity::arclength("tanh(1000*(x - 0.37))")?, cells))
}

/// The same with exact averages: the discrete problem is then the continuous one, and no cell is too wide for its
/// layer.
fn thin_exact(cells: usize) -> Result<Line> {
    Ok(Line { face: FaceDensity::Exact, ..thin(cells)? })
}

pub fn coarse(options: Options) -> Result<Rerun> {
    let counts: &[usize] = if options.quick { &[2, 4, 8, 16] } else { &[2, 4, 8, 16, 32, 64] };
    let heads = ["M", "correction"].into_iter().map(String::from);
    let mut table = Table {
        title: "Coarse corrections: iterations to 1e-8 from uniform, 8I + 2 cells, subdomains of 10 cells".into(),
        columns: heads.chain(counts.iter().map(|n| format!("I = {n}"))).chain(["verdict".into()]).collect(),
        ..Table::default()
    }
    .ruled(
        "“independent of I” where no count is above 1.5 times that of 2 subdomains; else “grows”, with the \
         largest count",
    );
    let correction = |coarse| Method::Classical { sweep: Sweep::Parallel, linearized: false, coarse };
    let (galerkin, integral) = (correction(Coarse::Galerkin), correction(Coarse::Integral));
    let problems: [(&str, Problem); 6] = [
        ("x² + 1", square),
        ("layer", layer),
        ("C = 300", |cells| valley(300.0, cells)),
        ("spike", spike),
        ("thin layer", thin),
        ("thin layer, exact faces", thin_exact),
    ];
    let mut rows: Vec<(&str, Problem, &str, Method)> = vec![("x² + 1", square, "none", NONLINEAR)];
    for (name, method) in [("galerkin", galerkin), ("integral", integral)] {
        rows.extend(problems.iter().map(|(m, problem)| (*m, *problem, name, method)));
    }
    let mut curves = Vec::new();
    for (m, problem, name, method) in rows {
        let most = if method == NONLINEAR { 16 } else { usize::MAX };
        let mut found = Vec::new();
        for &subdomains in counts.iter().filter(|n| **n <= most) {
            found.push(count(problem, subdomains, method)?);
        }
        let cells = (0..counts.len()).map(|k| match found.get(k) {
            None => "–".into(),
            Some(Ok(n)) => n.to_string(),
            Some(Err(why)) => why.clone(),
        });
        table.row([m.to_string(), name.into()].into_iter().chain(cells).chain([said(&found)]));
        let points = counts.iter().zip(&found).filter_map(|(i, n)| Some([*i as f64, *n.as_ref().ok()? as f64]));
        curves.push(Curve { name: format!("{m}, {name}"), points: points.collect(), ..Curve::default() });
    }
    curves.retain(|curve| curve.name.starts_with("spike") || curve.name.starts_with("x²"));
    table.note(format!(
        "spike: M = {SPIKE}; thin layer: the arc length of tanh(1000(x − .37)); C = 300: M = 300(x − ½)² + 1"
    ));
    table.note(
        "both corrections solve the same two coarse unknowns an interface. “galerkin” moves nodes by the change of \
         ∫M over M, which overshoots where M varies over the way of a node; “integral” moves them to where ∫M has \
         changed by so much",
    );
    if options.quick {
        table.note("quick: up to 16 subdomains, not 64");
    }
    Ok(Rerun { tables: vec![table], pictures: vec![("coarse".into(), drawn(curves))] })
}

fn drawn(curves: Vec<Curve>) -> Picture {
    Figure {
        title: "Iterations to 1e-8 against the number of subdomains".into(),
        labels: ["subdomains".into(), "iterations".into()],
        curves,
        ..Figure::default()
    }
    .draw()
}

/// Iterations to 1e-8, or the name of what ended them.
fn count(problem: Problem, subdomains: usize, method: Method) -> Result<Result<usize, String>> {
    let line = problem(8 * subdomains + 2)?;
    let ranges: Vec<[usize; 2]> = (0..subdomains).map(|s| [8 * s, 8 * s + 10]).collect();
    match from_uniform(&line, &ranges, method, until(1e-8)) {
        Ok(history) if history.converged => Ok(Ok(history.count())),
        Ok(_) => Ok(Err("never".into())),
        Err(Error::Failed { failure: failure @ Failure::LineStalled { .. }, .. }) => Ok(Err(failure.name().into())),
        Err(other) => Err(other),
    }
}

fn said(found: &[Result<usize, String>]) -> String {
    let counts: Vec<usize> = found.iter().filter_map(|n| n.as_ref().ok().copied()).collect();
    match counts.iter().max() {
        Some(most) if counts.len() == found.len() && 2 * most <= 3 * counts[0] => "independent of I".into(),
        Some(most) if counts.len() == found.len() => format!("grows, to {most}"),
        _ => "fails".into(),
    }
}
