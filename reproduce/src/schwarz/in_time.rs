//! Optimal and optimised conditions in time, which the paper leaves to the future.

use super::{NONLINEAR, rate, square, two, until};
use crate::{Rerun, Table};
use driftmesh::equidistribution::{Line, LineDensity, Method, Robin};
use driftmesh::error::Result;

const FRONT: &str = "1 + 50/cosh(30*(x - 0.4))^2";

pub fn in_time() -> Result<Rerun> {
    let mut table = Table::new(
        "Conditions in time: one backward Euler step of MMPDE5 from x = ξ², 100 cells, iterations to 1e-10",
        &["M", "Δt/τ", "subdomains", "method", "iterations", "observed", "linear solves", "verdict"],
    )
    .ruled(
        "optimal: “holds” where it ends after as many iterations as subdomains; optimised: where it needs fewer \
         iterations than classical Schwarz with an overlap of ten cells. The paper has no figures for these",
    );
    let lagged = Method::Optimized { robin: Robin::Lagged };
    let optimal = Method::Optimal { panels: None };
    let peak = Line::new(LineDensity::formula(FRONT)?, 100);
    for (m, line) in [("x² + 1", square(100)?), ("peak", peak)] {
        let old = line.mapped(|xi| xi * xi);
        for step in [1.0, 0.01, 1e-4] {
            let cuts = |count: usize| -> Vec<[usize; 2]> {
                (0..count).map(|s| [s * 100 / count, (s + 1) * 100 / count]).collect()
            };
            let four = vec![[0, 30], [20, 55], [45, 80], [70, 100]];
            for (classical, count) in [(two([45, 55], 100).to_vec(), 2), (four, 4)] {
                let mut before = 0;
                for (name, method) in [("classical", NONLINEAR), ("optimised, lagged", lagged), ("optimal", optimal)] {
                    let ranges = if method == NONLINEAR { classical.clone() } else { cuts(count) };
                    let last = Some((old.as_slice(), 1.0 / step));
                    let history = line.iterate(0.0, &ranges, method, &old, last, until(1e-10))?;
                    let n = history.count();
                    let holds = history.converged && if method == optimal { n <= count } else { n < before };
                    if method == NONLINEAR {
                        before = n;
                    }
                    table.row([
                        m.to_string(),
                        format!("{step}"),
                        count.to_string(),
                        name.into(),
                        n.to_string(),
                        rate(history.observed),
                        history.iterates[n].linear_solves.to_string(),
                        if method == NONLINEAR { String::new() } else { super::verdict(holds) },
                    ]);
                }
            }
        }
    }
    table.note(format!(
        "peak: M = {FRONT}. Optimised: p = M̃ √θ coth(√θ L), θ = τ/(Δt M̃), L the length of the rest, which is M̃/L \
         without time; no number is set. Optimal: the flux that the rest of the line answers with, by a solve of it \
         for each try of the node at the cut, which its linear solves do not count: exact for the discrete problem, \
         and as dear as the whole line"
    ));
    table.note(
        "steps that are short against τ couple neighbours only: then even classical Schwarz takes few iterations",
    );
    Ok(vec![table].into())
}
