use super::{Coarse, Line, Method, Robin, Sweep};
use crate::error::Failure;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// The contraction of the error in two iterations, by theory
///
/// With α and β the ends of the overlap of two pieces, m = M(x(α)), and numbers of equations and theorems from Gander
/// and Haynes (2012):
///
/// - classical, two pieces: (α/β)(1−β)/(1−α) (theorem 3.2)
/// - classical, any number of pieces: ρ(A)², where A maps the errors of ∫M at the ends of pieces to those of the next
///   iteration (6.4); bound of theorem 6.5 for equal pieces
/// - alternating, two pieces: the square of the classical one, since each iteration contracts by as much as two
/// - optimal, I pieces: 0 after I iterations with exact integrals over cells (theorem 4.1)
/// - optimised, two pieces: |p − m/α| |p − m/(1−α)| / ((p + m/α)(p + m/(1−α))); bound (5.7)
/// - in time, two pieces: bound of theorem 7.2; alternating, its square
///
/// There is none for the linearised method: theorem 3.4 does not hold.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Prediction {
    /// The asymptotic contraction; none where theory gives none for the case.
    pub predicted: Option<f64>,
    /// An upper bound of it; none where theory gives none.
    pub bound: Option<f64>,
}

/// Powers of A² after which its spectral radius is taken as it is.
const MOST_POWERS: usize = 20_000;
/// The spectral radius of A² has settled once another power changes it by no more than this, which is near rounding.
const SETTLED: f64 = 1e-14;

impl Prediction {
    /// The prediction for an iteration that leads to `mesh`; `ratio` is τ/Δt, none without time.
    pub(super) fn of(
        line: &Line,
        t: f64,
        ranges: &[[usize; 2]],
        method: Method,
        mesh: &[f64],
        ratio: Option<f64>,
    ) -> Result<Self, Failure> {
        let count = ranges.len();
        let xi = |node: usize| node as f64 / line.cells as f64;
        let extremes = || line.density.extremes(t, line.ends);
        let Self { predicted, bound } = match (method, ratio) {
            (Method::Classical { linearized: true, .. }, _) => Self::default(),
            (Method::Classical { coarse: Coarse::Galerkin | Coarse::Integral, .. }, _) => Self::default(),
            (Method::Classical { sweep, .. }, Some(ratio)) if count == 2 => {
                let root = (ratio / extremes()?[1]).sqrt();
                Self { predicted: None, bound: Some(bound_in_time(root, xi(ranges[1][0]), xi(ranges[0][1]), sweep)) }
            }
            // this holds for averages that are not exact, too, since the discrete problem beyond a cut is solved
            (Method::Optimal { .. }, Some(_)) => Self { predicted: Some(0.0), bound: None },
            (_, Some(_)) => Self::default(),
            (Method::Classical { sweep, .. }, None) => Self::classical(ranges, sweep, xi),
            (Method::Optimal { .. }, None) => Self { predicted: Some(0.0), bound: (count == 2).then_some(0.0) },
            (Method::Optimized { robin }, None) if count == 2 => {
                let cut = ranges[0][1];
                let m = line.density.at(t, mesh[cut])?[0];
                let extremes = if let Robin::Value(_) = robin { extremes()? } else { [m; 2] };
                Self::optimized(robin, xi(cut), m, extremes)
            }
            (Method::Optimized { .. }, None) => Self::default(),
        };
        // Robin parameters out of all proportion give 0/0
        let [predicted, bound] = [predicted, bound].map(|rate| rate.filter(|rate| rate.is_finite()));
        Ok(Self { predicted, bound })
    }

    /// Of the classical method without time.
    fn classical(ranges: &[[usize; 2]], sweep: Sweep, xi: impl Fn(usize) -> f64) -> Self {
        let count = ranges.len();
        let radius = interface_radius(&ranges.iter().map(|r| r.map(&xi)).collect::<Vec<_>>());
        let predicted = match sweep {
            Sweep::Parallel => Some(radius * radius),
            Sweep::Alternating if count == 2 => Some(radius.powi(4)),
            Sweep::Alternating => None,
        };
        let widths: Vec<usize> = ranges.iter().map(|[first, last]| last - first).collect();
        let overlaps: Vec<usize> = ranges.windows(2).map(|r| r[0][1] - r[1][0]).collect();
        let equal = widths.iter().all(|w| *w == widths[0]) && overlaps.iter().all(|o| *o == overlaps[0]);
        let bound = (equal && sweep == Sweep::Parallel && count > 1).then(|| {
            let r = overlaps[0] as f64 / widths[0] as f64;
            let sine = (PI / (2.0 * (count as f64 + 1.0))).sin();
            1.0 - 4.0 * r * (1.0 - r) * sine * sine
        });
        Self { predicted, bound }
    }

    /// Of Robin conditions between two pieces that meet at ξ = α, where M is `m`; without time. The bound takes the
    /// smallest and the largest M of the line.
    fn optimized(robin: Robin, alpha: f64, m: f64, [low, high]: [f64; 2]) -> Self {
        let rate = |left: f64, right: f64| {
            let factor = |p: f64, m: f64| (p - m).abs() / (p + m);
            Some(factor(left, m / (1.0 - alpha)) * factor(right, m / alpha))
        };
        match robin {
            Robin::Value(p) => {
                // p is optimal for both pieces at once only where M/α = M/(1 − α)
                let predicted =
                    (p - m / alpha).abs() * (p - m / (1.0 - alpha)).abs() / ((p + m / alpha) * (p + m / (1.0 - alpha)));
                let factor = |width: f64| {
                    let (square, product) = (p * p + (high / width).powi(2), 2.0 * p * low / width);
                    ((square - product) / (square + product)).sqrt()
                };
                Self { predicted: Some(predicted), bound: Some(factor(alpha) * factor(1.0 - alpha)) }
            }
            Robin::Auto => Self { predicted: rate(m / alpha, m / alpha), bound: None },
            Robin::Lagged => Self { predicted: rate(m / (1.0 - alpha), m / alpha), bound: None },
        }
    }
}

/// The bound of theorem 7.2 for two pieces that overlap from ξ = α to β, in time; `root` is √(τ/(Δt max M)).
fn bound_in_time(root: f64, alpha: f64, beta: f64, sweep: Sweep) -> f64 {
    // as logarithms: for a small time step the sinh themselves overflow
    let sinh = |s: f64| root * s + (0.5 * -(-2.0 * root * s).exp_m1()).ln();
    let bound = sinh(alpha) + sinh(1.0 - beta) - sinh(beta) - sinh(1.0 - alpha);
    // the theorem is for two parallel sweeps; one alternating sweep contracts as much
    let iterations = if sweep == Sweep::Alternating { 2.0 } else { 1.0 };
    (iterations * bound).exp()
}

/// The spectral radius of A: errors of ∫M are linear in ξ within a piece, so that the error at an inner node is a mean
/// of those at both ends.
fn interface_radius(pieces: &[[f64; 2]]) -> f64 {
    let count = pieces.len();
    if count < 2 {
        return 0.0;
    }
    // the errors at both ends of each piece in the next iteration; at the ends of the line they are 0
    let next = |errors: &[[f64; 2]]| -> Vec<[f64; 2]> {
        let at = |s: usize, xi: f64| {
            let [a, b] = pieces[s];
            let along = (xi - a) / (b - a);
            (1.0 - along) * errors[s][0] + along * errors[s][1]
        };
        (0..count)
            .map(|s| {
                let left = if s == 0 { 0.0 } else { at(s - 1, pieces[s][0]) };
                let right = if s + 1 == count { 0.0 } else { at(s + 1, pieces[s][1]) };
                [left, right]
            })
            .collect()
    };
    let mut errors = vec![[1.0; 2]; count];
    (errors[0][0], errors[count - 1][1]) = (0.0, 0.0);
    let norm = |e: &[[f64; 2]]| e.iter().flatten().map(|e| e * e).sum::<f64>().sqrt();
    let mut rate = 0.0;
    // by powers of A²: A itself exchanges two classes of ends, and its iterates would alternate
    for _ in 0..MOST_POWERS {
        let after = next(&next(&errors));
        let size = norm(&after);
        let new = size / norm(&errors);
        if size == 0.0 {
            return 0.0;
        }
        errors = after.iter().map(|e| e.map(|e| e / size)).collect();
        if (new - rate).abs() <= SETTLED {
            rate = new;
            break;
        }
        rate = new;
    }
    rate.sqrt()
}
