//! What is known of a Schwarz iteration on a line once it has ended: its figures, and why it missed its tolerance.

use super::{Coarse, Method, Prediction, Robin, Sweep};
use crate::error::{Act, Failure, Remedy, Setting};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// When an iteration ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stop {
    /// Largest number of iterations.
    pub iterations: usize,
    /// The iteration ends once `measure` is at most this share of the length of the line.
    pub tolerance: Option<f64>,
    /// The quantity that is compared with the tolerance.
    pub measure: Measure,
}

/// The quantity that tells whether an iteration has converged.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Measure {
    /// The largest distance of a node from its place in the discrete mesh of the whole line, which is computed for it.
    #[default]
    Error,
    /// The largest change of a node in an iteration.
    Increment,
}

/// Figures of one iterate; the first one is the start.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Iterate {
    /// The largest distance of a node of any piece from the discrete single-domain mesh.
    pub error: f64,
    /// The largest change of a node since the previous iterate; 0 at the start.
    pub increment: f64,
    /// 2 max |u_i − u_{i−1}| over the pieces, where M is the arc length of u.
    pub largest_jump: Option<f64>,
    /// The largest error of the piecewise linear interpolant of u on the glued mesh.
    pub interpolation_error: Option<f64>,
    /// Linear solves from the start up to this iterate.
    pub linear_solves: usize,
}

/// The figures, meshes and predictions of a Schwarz iteration.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct History {
    /// Figures of the start and of every iterate.
    pub iterates: Vec<Iterate>,
    /// The glued mesh of the last iterate.
    pub mesh: Vec<f64>,
    /// Glued meshes of the start and of iterates, with their numbers. Of long iterations only every second, fourth … is
    /// stored.
    #[serde(skip)]
    pub path: Vec<(usize, Vec<f64>)>,
    /// Errors of the first piece alone, by iterate.
    #[serde(skip)]
    pub first: Vec<f64>,
    /// The discrete mesh of the whole line.
    pub reference: Vec<f64>,
    /// The observed contraction in two iterations: the geometric mean over the last ten iterates above rounding, or
    /// over the last half of fewer.
    pub observed: Option<f64>,
    /// The contraction by theory.
    pub prediction: Prediction,
    /// Whether the tolerance was met; true without one.
    pub converged: bool,
}

/// An error of the mesh below this share of its largest coordinate is rounding: a few units in the last place.
const IS_ROUNDING: f64 = 8.0 * f64::EPSILON;
/// An iteration whose mesh no longer changes counts as converged up to rounding if its error is below this share of the
/// length of the line; farther away it is stuck.
const NEAR: f64 = 1e-6;
/// Largest number of iterations that may be asked for. A message calls an iteration that needs more too slow to wait
/// for.
pub(crate) const MOST_ITERATIONS: usize = 1_000_000;
/// Where rounding stops an iteration, the message recommends this multiple of the error that it reached as tolerance:
/// the error still changes by some last bits from one iteration to the next.
const ABOVE_ROUNDING: f64 = 1.5;
/// After fewer iterations than this no message says that they fail to converge: a contraction in two iterations takes
/// four to be seen.
const FEW: usize = 4;
/// Largest number of quotients of errors over which the observed contraction is averaged.
const LAST: usize = 10;

impl Measure {
    /// The value of the measure for an iterate.
    pub fn of(self, iterate: &Iterate) -> f64 {
        match self {
            Self::Error => iterate.error,
            Self::Increment => iterate.increment,
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Error => "error",
            Self::Increment => "increment",
        }
    }
}

impl History {
    /// Number of iterations done.
    pub fn count(&self) -> usize {
        self.iterates.len() - 1
    }

    /// The failure of an iteration that missed its tolerance, or whose glued mesh has nodes out of order.
    pub fn missed(&self, method: Method, stop: Stop) -> Option<Failure> {
        self.far(method, stop).or_else(|| {
            let disordered = |i: &usize| self.mesh[*i].is_nan() || self.mesh[*i] <= self.mesh[i - 1];
            let node = (1..self.mesh.len()).find(disordered)?;
            let [left, x] = [node - 1, node].map(|i| self.mesh[i]);
            Some(Failure::LineFolded { node, x, left, iterations: self.count() })
        })
    }

    /// The failure of an iteration that missed its tolerance, with what its figures tell.
    fn far(&self, method: Method, stop: Stop) -> Option<Failure> {
        let length = self.mesh[self.mesh.len() - 1] - self.mesh[0];
        let tolerance = stop.tolerance.filter(|_| !self.converged)? * length;
        let measured: Vec<f64> = self.iterates.iter().map(|iterate| stop.measure.of(iterate)).collect();
        let (count, last) = (self.count(), measured[self.count()]);
        let size = self.mesh.iter().fold(0.0, |size: f64, x| size.max(x.abs()));
        let still = count > 0 && self.iterates[count].increment <= f64::EPSILON * size;
        // an iteration whose mesh no longer changes, close to the solution, has reached rounding
        let rounding = if still && last <= NEAR * length { ABOVE_ROUNDING * last } else { IS_ROUNDING * size };
        let rate = contraction(&measured);
        let more = rate.map(|rate| 2.0 * (tolerance.max(rounding) / last).ln() / rate.ln());
        let advice = match (rate, more) {
            _ if last <= rounding => {
                format!("; that is rounding, which no iteration lowers: ask for {:.0e} or more", rounding / length)
            }
            _ if still => {
                "; it no longer changes: with these conditions hardly anything passes from one subdomain to another"
                    .into()
            }
            (Some(rate), Some(more)) if more <= MOST_ITERATIONS as f64 => {
                format!("; it contracts by {rate:.4} in two iterations: about {more:.0} more would do")
            }
            (Some(rate), _) => format!("; it contracts by {rate:.6} in two iterations, which is too slow to wait for"),
            _ if matches!(method, Method::Classical { linearized: true, .. }) => {
                "; the linearised iteration need not converge where M varies much over the overlap".into()
            }
            _ if count < FEW => "; so few iterations do not tell whether it contracts".into(),
            _ => "; it does not contract".into(),
        };
        let converges = !still && (more.is_some_and(|more| more <= MOST_ITERATIONS as f64) || count < FEW);
        let remedies = match last <= rounding {
            true => vec![Remedy::any([Act::Raise(Setting::Tolerance)])],
            false => curing(method, converges),
        };
        let measure = stop.measure.name();
        Some(Failure::NotConverged { measure, last, iterations: count, tolerance, advice, remedies })
    }
}

/// Remedies for an iteration that missed its tolerance: more iterations if it converges, another method if not.
fn curing(method: Method, converges: bool) -> Vec<Remedy> {
    let robin = Act::Set(Setting::Robin, &["\"auto\"", "\"lagged\""]);
    let exact = Act::Set(Setting::FaceDensity, &["\"exact\""]);
    let overlap = Act::Say("give more overlap");
    vec![match method {
        Method::Optimized { robin: Robin::Value(_) } if converges => {
            Remedy::any([Act::Raise(Setting::Iterations), robin])
        }
        _ if converges => Remedy::any([Act::Raise(Setting::Iterations)]),
        Method::Classical { linearized: true, .. } => Remedy::any([Act::Set(Setting::Linearized, &["false"])]),
        Method::Classical { coarse: Coarse::None | Coarse::Galerkin, sweep: Sweep::Parallel, .. } => {
            Remedy::any([overlap, Act::Set(Setting::Coarse, &["\"integral\""])])
        }
        Method::Classical { .. } => Remedy::any([overlap, Act::Refine(Setting::Cells)]),
        Method::Optimized { robin: Robin::Value(_) } => Remedy::any([robin]),
        Method::Optimized { .. } => {
            return vec![
                Remedy::any([Act::Set(Setting::Method, &["\"optimal\""])]),
                Remedy::any([Act::LeaveOut(Setting::Robin)]).when("and"),
                Remedy::any([exact]).when("and"),
            ];
        }
        Method::Optimal { .. } => Remedy::any([exact, Act::Refine(Setting::Cells)]),
    }]
}

/// The contraction in two iterations over the last half of them, if the iteration converges: every value of the last
/// quarter must be below every one of the second quarter, since the values of an oscillation also fall for a while.
fn contraction(measured: &[f64]) -> Option<f64> {
    let count = measured.len() - 1;
    let (first, middle) = (1.max(count / 4), 1.max(count / 2));
    let lowest = measured[first..=middle].iter().copied().fold(f64::INFINITY, f64::min);
    let highest = measured[(count - count / 4).max(middle + 1).min(count)..].iter().copied().fold(0.0, f64::max);
    (count > 1 && highest < lowest).then(|| (measured[count] / measured[middle]).powf(2.0 / (count - middle) as f64))
}

/// The geometric mean of E_{n+2}/E_n over the last iterates with E_{n+2} above rounding.
pub(super) fn observed(iterates: &[Iterate], rounding: f64) -> Option<f64> {
    let above: Vec<f64> = iterates.iter().map(|i| i.error).take_while(|error| *error > rounding).collect();
    // at most the last half: the beginning of a fast iteration is not yet asymptotic
    let pairs = above.len().saturating_sub(2);
    let pairs = LAST.min(pairs.div_ceil(2));
    if pairs == 0 {
        return None;
    }
    let logs = (above.len() - 2 - pairs..above.len() - 2).map(|n| (above[n + 2] / above[n]).ln());
    Some((logs.sum::<f64>() / pairs as f64).exp())
}
