//! Figures 8.4 and 8.5: parallel and alternating, nonlinear and linearised.

use super::{
    LINEARISED, NONLINEAR, OVERLAPS, VARIANTS, by_solves, curve, errors, from_uniform, layer, name, square, two, until,
    valley, verdict,
};
use crate::{Rerun, Table};
use driftmesh::equidistribution::Line;
use driftmesh::error::Result;

/// Iterations and linear solves of the four variants, in their order.
type Counts = Vec<(String, [[usize; 2]; 4])>;

pub fn figure_8_4() -> Result<Rerun> {
    let mut table = Table::new(
        "Figure 8.4: four classical variants, 100 cells, to 1e-10",
        &["M", "overlap", "variant", "iterations", "linear solves"],
    );
    let mut cases: Vec<(&str, Line, [usize; 2])> = Vec::new();
    for overlap in OVERLAPS {
        cases.push(("x² + 1", square(100)?, overlap));
    }
    cases.push(("layer", layer(100)?, [45, 55]));
    let [mut left, mut right] = [Vec::new(), Vec::new()];
    let mut counts: Counts = Vec::new();
    for (m, line, overlap) in cases {
        let mut of_case = [[0; 2]; 4];
        for ((variant, method), found) in VARIANTS.into_iter().zip(&mut of_case) {
            let history = from_uniform(&line, &two(overlap, 100), method, until(1e-10))?;
            *found = [history.count(), history.iterates[history.count()].linear_solves];
            let [iterations, solves] = found.map(|n| n.to_string());
            table.row([m.to_string(), name(overlap), variant.into(), iterations, solves]);
            match m {
                "layer" => right.push(by_solves(variant, &history)),
                _ if overlap == [45, 55] => left.push(curve(variant, &history, 1)),
                _ => {}
            }
        }
        counts.push((format!("{m}, {}", name(overlap)), of_case));
    }
    let left = errors("Figure 8.4, left: M = x² + 1, .45/.55", "iterations", left);
    let right = errors("Figure 8.4, right: M of the layer, .45/.55", "linear solves", right);
    Ok(Rerun {
        tables: vec![table, claims(&counts)],
        pictures: vec![("figure-8-4-left".into(), left.draw()), ("figure-8-4-right".into(), right.draw())],
    })
}

/// What the paper says of figure 8.4.
fn claims(counts: &Counts) -> Table {
    let mut table = Table::new("What the text says of figure 8.4", &["claim", "M, overlap", "ours", "verdict"]).ruled(
        "“holds” where the claim is true by more than one iteration, or linear solve, in both sweeps; “no \
         difference” within one",
    );
    let iterations = |c: &[[usize; 2]; 4]| c.map(|n| n[0]);
    let solves = |c: &[[usize; 2]; 4]| c.map(|n| n[1]);
    let mut row = |claim: &str, case: &str, pairs: [[usize; 2]; 2]| {
        let shown = pairs.map(|[fewer, more]| format!("{fewer} against {more}")).join(", ");
        let verdict = match pairs {
            _ if pairs.iter().all(|[fewer, more]| fewer + 1 < *more) => "holds",
            _ if pairs.iter().all(|[fewer, more]| fewer.abs_diff(*more) <= 1) => "no difference",
            _ => "does not hold",
        };
        table.row([claim, case, &shown, verdict]);
    };
    for (case, all) in counts {
        let [parallel, alternating, frozen, alternating_frozen] = iterations(all);
        row(
            "alternating takes fewer iterations than parallel",
            case,
            [[alternating, parallel], [alternating_frozen, frozen]],
        );
    }
    for (case, all) in counts {
        let [parallel, alternating, frozen, alternating_frozen] = iterations(all);
        row(
            "nonlinear takes fewer iterations than linearised",
            case,
            [[parallel, frozen], [alternating, alternating_frozen]],
        );
    }
    for (case, all) in counts.iter().filter(|(case, _)| case.starts_with("layer")) {
        let [parallel, alternating, frozen, alternating_frozen] = solves(all);
        row(
            "linearised takes fewer linear solves than nonlinear",
            case,
            [[frozen, parallel], [alternating_frozen, alternating]],
        );
    }
    table.note(
        "in the left picture the curves of the linearised variants lie on those of the nonlinear ones and hide them",
    );
    table.note(
        "the claims are of the left half, M = x² + 1, and of the right half, the layer; we look at all cases \
         for the first two",
    );
    table
}

pub fn figure_8_5() -> Result<Rerun> {
    const C: [f64; 5] = [1.0, 10.0, 50.0, 100.0, 300.0];
    let mut table = Table::new(
        "Figure 8.5: M = C(x − ½)² + 1, 100 cells, .45/.55, iterations to 1e-8",
        &["from", "method", "C = 1", "10", "50", "100", "300", "verdict"],
    )
    .ruled(
        "the paper: linearised degrades as C grows, holds where its counts never fall and the last is above the \
         first; nonlinear is affected less, holds where its counts grow by a smaller factor than the linearised ones \
         from the same start",
    );
    let [mut left, mut right] = [Vec::new(), Vec::new()];
    for power in [1.0, 1.3] {
        let from = if power == 1.0 { "ξ" } else { "ξ^1.3" };
        let mut growth = f64::NAN;
        for (kind, method) in [("linearised", LINEARISED), ("nonlinear", NONLINEAR)] {
            let mut counts = Vec::new();
            for c in C {
                let line = valley(c, 100)?;
                let start = line.mapped(|xi| xi.powf(power));
                let history = line.iterate(0.0, &two([45, 55], 100), method, &start, None, until(1e-8))?;
                counts.push(history.count());
                if power == 1.3 && method == LINEARISED {
                    left.push(curve(&format!("C = {c}"), &history, 2));
                }
                if power == 1.3 && [1.0, 300.0].contains(&c) {
                    right.push(curve(&format!("{kind}, C = {c}"), &history, 2));
                }
            }
            let grows = counts[4] as f64 / counts[0] as f64;
            let holds = match method {
                LINEARISED => counts.is_sorted() && grows > 1.0,
                _ => grows < growth,
            };
            growth = grows;
            let cells = counts.iter().map(|n| n.to_string());
            table.row([from.to_string(), kind.into()].into_iter().chain(cells).chain([verdict(holds)]));
        }
    }
    table.note("from the uniform mesh a symmetric M hides the slowest error: hence the other start");
    let pictures = vec![
        ("figure-8-5-left".into(), errors("Figure 8.5, left: linearised, from ξ^1.3", "iterations", left).draw()),
        ("figure-8-5-right".into(), errors("Figure 8.5, right: both, from ξ^1.3", "iterations", right).draw()),
    ];
    Ok(Rerun { tables: vec![table], pictures })
}
