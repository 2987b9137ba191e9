//! The theorems of Gander and Haynes (2012) over random densities, overlaps and grids: what is observed is what is
//! predicted, and at most the bound. Cells have exact mean densities, so that the discrete problem is the continuous
//! one.

use driftmesh::equidistribution::{
    Coarse, FaceDensity, History, Line, LineDensity, Measure, Method, Robin, Stop, Sweep,
};
use proptest::prelude::*;

/// Densities whose largest value is up to 300 times the smallest, of different shapes, with up to so many peaks.
fn density(peaks: f64) -> impl Strategy<Value = String> {
    let ratio = 1.5..300.0_f64;
    prop_oneof![
        (ratio.clone(), 0.0..1.0_f64).prop_map(|(c, b)| format!("1 + {c}*(x - {b})^2")),
        (ratio.clone(), 0.1..0.9_f64, 20.0..200.0_f64).prop_map(|(c, b, w)| format!("1 + {c}*exp(-{w}*(x - {b})^2)")),
        (ratio.clone(), any::<bool>()).prop_map(|(c, up)| format!("exp({}*x)", if up { c.ln() } else { -c.ln() })),
        (ratio, 1.0..peaks).prop_map(|(c, k)| format!("1 + {c}*sin({k}*pi*x)^2")),
    ]
}

fn line(density: &str, cells: usize, face: FaceDensity) -> Line {
    Line { face, ..Line::new(LineDensity::formula(density).unwrap(), cells) }
}

fn run(line: &Line, ranges: &[[usize; 2]], method: Method, stop: Stop) -> History {
    // away from the symmetry that would hide the slowest error
    let start = line.mapped(|xi| xi.powf(1.3));
    line.iterate(0.0, ranges, method, &start, None, stop).unwrap()
}

fn until(tolerance: f64) -> Stop {
    Stop { iterations: 2000, tolerance: Some(tolerance), measure: Measure::Error }
}

const CLASSICAL: Method = Method::Classical { sweep: Sweep::Parallel, linearized: false, coarse: Coarse::None };

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(40) })]

    /// Theorem 3.2: (α/β)(1 − β)/(1 − α) in two iterations, whatever M is; alternating, in each.
    #[test]
    fn classical(m in density(4.0), cells in 10_usize..60, a in 0.15..0.5_f64, width in 0.1..0.5_f64) {
        let alpha = ((a * cells as f64) as usize).max(1);
        let beta = (alpha + ((width * cells as f64) as usize).max(1)).min(cells - 1);
        let line = line(&m, cells, FaceDensity::Exact);
        let ranges = [[0, beta], [alpha, cells]];
        let [x, y] = [alpha, beta].map(|n| n as f64 / cells as f64);
        let rho = x / y * (1.0 - y) / (1.0 - x);
        prop_assume!(rho < 0.95);
        let history = run(&line, &ranges, CLASSICAL, until(1e-11));
        prop_assert!(history.converged);
        prop_assert!((history.prediction.predicted.unwrap() - rho).abs() < 1e-10);
        let observed = history.observed.unwrap();
        prop_assert!((observed - rho).abs() < 2e-3 + 0.02 * rho, "{} {}", observed, rho);
        prop_assert!(observed <= history.prediction.bound.unwrap_or(1.0) + 1e-3);
        let alternating = Method::Classical { sweep: Sweep::Alternating, linearized: false, coarse: Coarse::None };
        let count = run(&line, &ranges, alternating, until(1e-10)).count();
        let parallel = run(&line, &ranges, CLASSICAL, until(1e-10)).count();
        prop_assert!(count as f64 <= 0.55 * parallel as f64 + 2.0, "{} against {}", count, parallel);
    }

    /// Theorem 4.1: two iterations; and as many as subdomains where there are more.
    #[test]
    fn optimal(m in density(4.0), width in 3_usize..12, count in 2_usize..6) {
        let cells = width * count;
        let ranges: Vec<[usize; 2]> = (0..count).map(|s| [s * width, (s + 1) * width]).collect();
        let stop = Stop { iterations: count, tolerance: None, measure: Measure::Error };
        let history = run(&line(&m, cells, FaceDensity::Exact), &ranges, Method::Optimal { panels: None }, stop);
        prop_assert!(history.iterates[count].error < 1e-11, "{:e}", history.iterates[count].error);
    }

    /// Theorem 5.2: at most (5.7), for any p near the densities there are; and the rate between its lines.
    #[test]
    fn optimised(m in density(4.0), cells in 10_usize..60, share in 0.2..0.8_f64, factor in 0.7..1.5_f64) {
        let line = line(&m, cells, FaceDensity::Exact);
        let cut = ((share * cells as f64) as usize).clamp(2, cells - 2);
        let alpha = cut as f64 / cells as f64;
        let mesh = line.solve(0.0, &line.uniform(), None).unwrap().0;
        let p = factor * line.density.at(0.0, mesh[cut]).unwrap()[0] / (alpha * (1.0 - alpha)).sqrt();
        let ranges = [[0, cut], [cut, cells]];
        let history = run(&line, &ranges, Method::Optimized { robin: Robin::Value(p) }, until(1e-12));
        prop_assert!(history.converged);
        let [predicted, bound] = [history.prediction.predicted.unwrap(), history.prediction.bound.unwrap()];
        prop_assert!(predicted <= bound + 1e-12 && bound < 1.0, "{} {}", predicted, bound);
        // fast iterations end before they are asymptotic
        if history.count() >= 16 && predicted > 0.05 {
            prop_assert!((history.observed.unwrap() - predicted).abs() < 0.02 + 0.05 * predicted,
                         "{:?} {}", history.observed, predicted);
        }
        let observed = history.observed;
        prop_assert!(observed.is_none_or(|observed| observed <= bound + 1e-3), "{observed:?} {bound}");
    }

    /// Two-sided lagged p converges without tuning for any number of subdomains. No theorem says so: with many peaks an
    /// iterate may go so far outside the line that it ends by name.
    #[test]
    fn lagged(m in density(2.0), width in 4_usize..12, count in 2_usize..7) {
        let ranges: Vec<[usize; 2]> = (0..count).map(|s| [s * width, (s + 1) * width]).collect();
        let line = line(&m, width * count, FaceDensity::Exact);
        let history = run(&line, &ranges, Method::Optimized { robin: Robin::Lagged }, until(1e-8));
        prop_assert!(history.converged, "{:e}", history.iterates[history.count()].error);
    }

    /// Theorem 6.5: at most 1 − 4r(1 − r) sin²(π/(2(I + 1))); and ρ of the interface matrix.
    #[test]
    fn many(m in density(4.0), width in 4_usize..10, share in 0.25..0.5_f64, count in 2_usize..6) {
        let overlap = ((share * width as f64) as usize).max(1);
        let cells = count * width - (count - 1) * overlap;
        let starts = (0..count).map(|s| s * (width - overlap));
        let ranges: Vec<[usize; 2]> = starts.map(|start| [start, start + width]).collect();
        let history = run(&line(&m, cells, FaceDensity::Exact), &ranges, CLASSICAL, until(1e-11));
        prop_assert!(history.converged);
        let [predicted, bound] = [history.prediction.predicted.unwrap(), history.prediction.bound.unwrap()];
        prop_assert!(predicted <= bound + 1e-12, "{} {}", predicted, bound);
        let observed = history.observed.unwrap();
        prop_assert!((observed - predicted).abs() < 2e-3 + 0.02 * predicted, "{} {}", observed, predicted);
    }

    /// Theorem 7.2: at most the bound, for any step; faster than without time.
    #[test]
    fn in_time(m in density(4.0), cells in 10_usize..60, ratio in 0.1..1000.0_f64) {
        let line = line(&m, cells, FaceDensity::Exact);
        let (alpha, beta) = (2 * cells / 5, cells - 2 * cells / 5);
        prop_assume!(beta > alpha);
        let old = line.mapped(|xi| xi * xi);
        let ranges = [[0, beta], [alpha, cells]];
        let stop = until(1e-11);
        let history = line.iterate(0.0, &ranges, CLASSICAL, &old, Some((&old, ratio)), stop).unwrap();
        prop_assert!(history.converged);
        let bound = history.prediction.bound.unwrap();
        let [x, y] = [alpha, beta].map(|n| n as f64 / cells as f64);
        prop_assert!(bound <= x / y * (1.0 - y) / (1.0 - x) + 1e-12);
        let observed = history.observed;
        prop_assert!(observed.is_none_or(|observed| observed <= bound + 0.02), "{observed:?} {bound}");
    }
}
