//! Equidistribution in one dimension, on the whole line and by Schwarz's method.
//!
//! The mesh x(ξ) on \[0, 1\] solves (M(x) x_ξ)_ξ = 0 with its ends fixed, or x_t = (1/τ) (M x_ξ)_ξ in time. In
//! Schwarz's method the line is divided into pieces, which are solved separately and exchange what they have at their
//! ends until they agree.
//!
//! # Source
//! M. J. Gander and R. D. Haynes, *Domain decomposition approaches for mesh generation via the equidistribution
//! principle* (2012). Its theorem 3.4, that the linearised iteration always converges, does not hold: for the density M
//! = 300 (x − ½)² + 1 and two pieces that overlap in (.48, .52) the iteration oscillates for ever.

mod beyond;
mod chain;
mod coarse;
mod counts;
mod cumulative;
mod density;
pub mod pieces;
mod predict;
mod schwarz;

#[cfg(test)]
mod tests;

pub use chain::FaceDensity;
pub use density::{LineDensity, check_ends};
pub use predict::Prediction;
pub use schwarz::{Coarse, Method, Robin, Sweep};

use crate::error::{Act, Error, Failure, Remedy, Result, Setting};
use crate::parallel;
use chain::{Chain, End, Step};
use cumulative::Cumulative;
use schemars::JsonSchema;
use schwarz::{Iteration, Pieces};
use serde::{Deserialize, Serialize};

/// A line with a density, to be divided into cells of equal ∫M.
///
/// # Example
/// ```
/// use driftmesh::equidistribution::{Line, LineDensity};
/// let line = Line::new(LineDensity::formula("x^2 + 1")?, 20);
/// let mesh = line.solve(0.0, &line.uniform(), None)?.0;
/// // the continuous mesh has x(½) = .59607164; the discrete one is of second order
/// assert!((mesh[10] - 0.59607164).abs() < 2e-4);
/// # Ok::<(), driftmesh::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct Line {
    /// The density M.
    pub density: LineDensity,
    /// How M is averaged over a cell.
    pub face: FaceDensity,
    /// Number of cells, of equal width in ξ.
    pub cells: usize,
    /// The ends of the line in x.
    pub ends: [f64; 2],
}

/// The mesh before a time step, and τ/Δt of the step; none without time.
pub type Before<'a> = Option<(&'a [f64], f64)>;

/// The mesh of a whole line without time, and how it was found.
#[derive(Debug, Clone)]
pub struct Settled {
    /// Nodes.
    pub mesh: Vec<f64>,
    /// Linear solves that it took.
    pub linear_solves: usize,
    /// The failure of Newton's method for the average that was asked for, where these nodes are those of
    /// [`FaceDensity::Exact`] instead.
    pub stalled: Option<Failure>,
}

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
        let rounding = if still && last <= NEAR * length { STILL * last } else { IS_ROUNDING * size };
        let rate = contraction(&measured);
        let more = rate.map(|rate| 2.0 * (tolerance.max(rounding) / last).ln() / rate.ln());
        let advice = match (rate, more) {
            _ if last <= rounding => {
                format!("; that is rounding, which no iteration lowers: ask for {:.0e} or more", rounding / length)
            }
            _ if still => {
                "; it stands still: with these conditions subdomains learn next to nothing of each other".into()
            }
            (Some(rate), Some(more)) if more <= MOST_ITERATIONS as f64 => {
                format!("; it contracts by {rate:.4} in two iterations: about {more:.0} more would do")
            }
            (Some(rate), _) => format!("; it contracts by {rate:.6} in two iterations, which is too slow to wait for"),
            _ if matches!(method, Method::Classical { linearized: true, .. }) => {
                "; the linearised iteration need not converge where M varies much over the overlap".into()
            }
            _ if count < FEW => "; so few do not tell whether it contracts".into(),
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

/// Errors below this share of the largest coordinate are rounding.
const IS_ROUNDING: f64 = 8.0 * f64::EPSILON;
/// An iteration whose mesh no longer changes counts as converged up to rounding if its error is below this share of the
/// length of the line; farther away it is stuck.
const NEAR: f64 = 1e-6;
/// Largest number of iterations that may be asked for. A message calls an iteration that needs more too slow to wait
/// for.
pub(crate) const MOST_ITERATIONS: usize = 1_000_000;
/// Where rounding stops an iteration, the message recommends this multiple of the error reached as the tolerance.
const STILL: f64 = 1.5;
/// With fewer iterations than this, a message does not say that an iteration fails to converge: too few to tell.
const FEW: usize = 4;
/// Errors below this share of the length of the line are left out of the observed contraction: rounding falsifies it.
const ROUNDING: f64 = 1e-11;
/// Largest number of iterates over which the observed contraction is averaged.
const LAST: usize = 10;
/// Equal parts into which each cell is divided to estimate its interpolation error.
const FEW_PARTS: usize = 4;
/// Parts of the cells whose estimate is within a tenth of the largest, to find the error itself.
const PARTS: usize = 64;
/// Cells whose places are evaluated in one call.
const CELLS_AT_ONCE: usize = 4096;
/// Largest number of cells that are divided into the finer parts.
const MOST: usize = 1000;
/// Largest number of glued meshes that are stored.
const MOST_MESHES: usize = 100;
/// Largest number of nodes in all glued meshes that are stored: 8 MB.
const MOST_KEPT: usize = 1 << 20;

impl Line {
    /// The density M on \[0, 1\], averaged by trapezoids.
    pub fn new(density: LineDensity, cells: usize) -> Self {
        Self { density, face: FaceDensity::default(), cells, ends: [0.0, 1.0] }
    }

    fn chain<'a>(&'a self, t: f64, cumulative: Option<&'a Cumulative>) -> Chain<'a> {
        Chain { density: &self.density, face: self.face, t, h: 1.0 / self.cells as f64, ends: self.ends, cumulative }
    }

    fn cumulative(&self, t: f64) -> Result<Cumulative, Failure> {
        Cumulative::new(&self.density, t, self.ends)
    }

    /// The nodes of equal cells.
    pub fn uniform(&self) -> Vec<f64> {
        self.mapped(|xi| xi)
    }

    /// The nodes at which a function of ξ, from 0 to 1, divides the line.
    pub fn mapped(&self, f: impl Fn(f64) -> f64) -> Vec<f64> {
        let [a, b] = self.ends;
        let mut x: Vec<f64> = (0..=self.cells).map(|i| a + (b - a) * f(i as f64 / self.cells as f64)).collect();
        (x[0], x[self.cells]) = (a, b);
        x
    }

    /// The mesh on which all cells have the same ∫M. Its nodes are those of the continuous problem, found by inverting
    /// ∫M; it exists for every finite and positive density.
    ///
    /// # Errors
    /// [`Failure::LineDensity`]; [`Failure::LineUnresolved`] where so many cells lie in so thin a layer that
    /// neighbouring nodes are the same floating-point number.
    pub fn equidistributed(&self, t: f64) -> Result<Vec<f64>, Failure> {
        self.in_order(self.cumulative(t)?.divided(self.ends, self.cells))
    }

    fn in_order(&self, mesh: Vec<f64>) -> Result<Vec<f64>, Failure> {
        match (1..mesh.len()).find(|&i| mesh[i] <= mesh[i - 1]) {
            None => Ok(mesh),
            Some(i) => Err(Failure::LineUnresolved { node: i, x: mesh[i], cells: self.cells }),
        }
    }

    /// The discrete mesh of the whole line, and the number of linear solves. For [`FaceDensity::Exact`] without time it
    /// is [`equidistributed`](Self::equidistributed) and takes none. Otherwise Newton's method starts there, or in time
    /// at the guess.
    ///
    /// # Errors
    /// As [`iterate`](Self::iterate), and those of [`equidistributed`](Self::equidistributed).
    pub fn solve(&self, t: f64, guess: &[f64], before: Before<'_>) -> Result<(Vec<f64>, usize)> {
        self.check_mesh("guess", guess)?;
        before.map_or(Ok(()), |(old, _)| self.check_mesh("before", old))?;
        let cumulative = self.cumulative(t)?;
        Ok(self.solved(t, &cumulative, guess, before)?)
    }

    fn solved(
        &self,
        t: f64,
        cumulative: &Cumulative,
        guess: &[f64],
        before: Before<'_>,
    ) -> Result<(Vec<f64>, usize), Failure> {
        let (chain, ends) = (self.chain(t, Some(cumulative)), self.ends.map(End::Value));
        if let Some((old, ratio)) = before {
            return chain.solve(guess, ends, Some(Step { old, ratio }));
        }
        let near = self.in_order(cumulative.divided(self.ends, self.cells))?;
        if self.face == FaceDensity::Exact {
            return Ok((near, 0));
        }
        match chain.newton(&near, ends, None) {
            Err(Failure::LineStalled { .. }) => chain.newton(guess, ends, None),
            other => other,
        }
    }

    /// The discrete mesh of the whole line. Where Newton's method does not converge, it is the one whose cells have the
    /// same ∫M: with trapezoids or midpoints there may be no discrete mesh for an M that jumps or peaks within a cell.
    ///
    /// # Errors
    /// As [`equidistributed`](Self::equidistributed).
    pub fn settled(&self, t: f64) -> Result<Settled, Failure> {
        let cumulative = self.cumulative(t)?;
        match self.solved(t, &cumulative, &self.uniform(), None) {
            Ok((mesh, linear_solves)) => Ok(Settled { mesh, linear_solves, stalled: None }),
            Err(stalled @ Failure::LineStalled { .. }) => {
                let mesh = self.in_order(cumulative.divided(self.ends, self.cells))?;
                Ok(Settled { mesh, linear_solves: 0, stalled: Some(stalled) })
            }
            Err(other) => Err(other),
        }
    }

    /// The continuous mesh at some ξ in ascending order: ∫M up to x(ξ) is ξ times that over the line.
    ///
    /// # Errors
    /// [`Failure::LineDensity`].
    pub fn exact(&self, t: f64, xi: &[f64]) -> Result<Vec<f64>, Failure> {
        let cumulative = self.cumulative(t)?;
        Ok(cumulative.inverted(xi.iter().map(|xi| xi * cumulative.whole())))
    }

    /// ∫M over each cell of a mesh, with M averaged as `face` says.
    ///
    /// # Errors
    /// [`Failure::LineDensity`].
    pub fn shares(&self, t: f64, mesh: &[f64]) -> Result<Vec<f64>, Failure> {
        let chain = self.chain(t, None);
        Ok(chain.fluxes(mesh)?.into_iter().map(|flux| flux * chain.h).collect())
    }

    /// Schwarz's iteration between pieces of the line, from a start, at time t.
    ///
    /// `ranges` holds the first and last node of each piece, from left to right. Neighbours overlap for the classical
    /// method, and share one node for the others. An iteration that does not converge is no error: see
    /// [`History::converged`].
    ///
    /// # Errors
    /// [`Error::Invalid`] for ranges that do not fit the method ([`pieces::check`]) or a start that is no mesh;
    /// [`Error::Failed`] with [`Failure::LineDensity`] or [`Failure::LineStalled`].
    pub fn iterate(
        &self,
        t: f64,
        ranges: &[[usize; 2]],
        method: Method,
        start: &[f64],
        before: Before<'_>,
        stop: Stop,
    ) -> Result<History> {
        pieces::check("ranges", ranges, self.cells, method)?;
        self.check_mesh("start", start)?;
        before.map_or(Ok(()), |(old, _)| self.check_mesh("before", old))?;
        let cumulative = self.cumulative(t)?;
        let reference = self.solved(t, &cumulative, start, before)?.0;
        let chain = self.chain(t, Some(&cumulative));
        let iteration = Iteration { chain, ranges, method, old: before, cells: self.cells };
        let exact = iteration.cut(&reference);
        let mut pieces = iteration.cut(start);
        let (mut path, mut first) = (Path::default(), Vec::new());
        let mut tell = |pieces: &Pieces, increment: f64, solves: usize| {
            let glued = iteration.glue(pieces);
            let iterate = self.measured(t, pieces, &exact, &glued, increment, solves);
            path.take(glued);
            first.push(distance(&pieces[..1], &exact[..1]));
            iterate
        };
        let mut iterates = vec![tell(&pieces, 0.0, 0)];
        let length = self.ends[1] - self.ends[0];
        let met = |iterate: &Iterate, n: usize| {
            let known = n > 0 || stop.measure == Measure::Error;
            known && stop.tolerance.is_some_and(|tolerance| stop.measure.of(iterate) <= tolerance * length)
        };
        let mut converged = met(&iterates[0], 0);
        let mut solves = 0;
        while !converged && iterates.len() <= stop.iterations {
            let (next, cost) = iteration.next(&pieces)?;
            solves += cost;
            let increment = distance(&next, &pieces);
            pieces = next;
            let iterate = tell(&pieces, increment, solves);
            iterates.push(iterate);
            converged = met(&iterate, iterates.len() - 1);
        }
        let observed = observed(&iterates, ROUNDING * length);
        let prediction = Prediction::of(self, t, ranges, method, &reference, before.map(|b| b.1))?;
        let converged = converged || stop.tolerance.is_none();
        let (path, mesh) = (path.meshes, iteration.glue(&pieces));
        Ok(History { iterates, mesh, path, first, reference, observed, prediction, converged })
    }

    /// Refuses nodes that are no mesh of the line: their number, their ends and their order must be right.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the key.
    pub fn check_mesh(&self, key: &str, mesh: &[f64]) -> Result<()> {
        let nodes = self.cells + 1;
        if mesh.len() != nodes {
            let rule = format!("{} cells have {nodes}; give one value a node", self.cells);
            return Err(Error::invalid(key, format!("{} nodes", mesh.len()), rule));
        }
        if let Some(i) = (1..nodes).find(|&i| !(mesh[i] > mesh[i - 1] && mesh[i].is_finite())) {
            let rule = format!("nodes must grow from left to right; node {} is at {}", i - 1, mesh[i - 1]);
            return Err(Error::invalid(key, format!("{} at node {i}", mesh[i]), rule));
        }
        if [mesh[0], mesh[self.cells]] != self.ends {
            let rule = format!("must go from {} to {}", self.ends[0], self.ends[1]);
            return Err(Error::invalid(key, format!("from {} to {}", mesh[0], mesh[self.cells]), rule));
        }
        Ok(())
    }

    fn measured(
        &self,
        t: f64,
        pieces: &Pieces,
        exact: &Pieces,
        glued: &[f64],
        increment: f64,
        linear_solves: usize,
    ) -> Iterate {
        let error = distance(pieces, exact);
        let mut jumps = Vec::with_capacity(pieces.len());
        for piece in pieces {
            let u = self.density.followed(t, piece);
            jumps.extend(u.map(|u| u.windows(2).map(|u| 2.0 * (u[1] - u[0]).abs()).fold(0.0, f64::max)));
        }
        let largest_jump = jumps.into_iter().reduce(f64::max);
        let interpolation_error = self.interpolation_error(t, glued);
        Iterate { error, increment, largest_jump, interpolation_error, linear_solves }
    }

    /// The largest error of the piecewise linear interpolant of u on a mesh, where M is the arc length of u. Every cell
    /// is estimated at a few places, and the worst ones are then searched closely.
    pub fn interpolation_error(&self, t: f64, mesh: &[f64]) -> Option<f64> {
        // largest error in each cell, at the ends of so many equal parts
        let errors = |cells: &[[f64; 2]], parts: usize| -> Option<Vec<f64>> {
            let place = |x: &[f64; 2], k: usize| x[0] + k as f64 / parts as f64 * (x[1] - x[0]);
            let places: Vec<f64> = cells.iter().flat_map(|x| (0..=parts).map(move |k| place(x, k))).collect();
            let u = self.density.followed(t, &places)?;
            let off = |u: &[f64]| {
                let linear = |k: usize| u[0] + k as f64 / parts as f64 * (u[parts] - u[0]);
                (1..parts).map(|k| (u[k] - linear(k)).abs()).fold(0.0, f64::max)
            };
            Some(u.chunks_exact(parts + 1).map(off).collect())
        };
        let cells: Vec<[f64; 2]> = mesh.windows(2).map(|x| [x[0], x[1]]).collect();
        let batches: Vec<&[[f64; 2]]> = cells.chunks(CELLS_AT_ONCE).collect();
        let rough = parallel::map_large(cells.len(), &batches, |cells| errors(cells, FEW_PARTS));
        let rough: Vec<f64> = rough.into_iter().collect::<Option<Vec<_>>>()?.concat();
        let largest = rough.iter().copied().fold(0.0, f64::max);
        // closely in the cells where the largest error may be
        let worst: Vec<[f64; 2]> =
            cells.into_iter().zip(rough).filter(|(_, off)| *off >= 0.9 * largest).map(|(x, _)| x).take(MOST).collect();
        errors(&worst, PARTS)?.into_iter().reduce(f64::max)
    }
}

/// Glued meshes of an iteration, which may be too many to store all.
#[derive(Default)]
struct Path {
    meshes: Vec<(usize, Vec<f64>)>,
    /// Number of meshes seen, and at which multiples one is stored.
    seen: usize,
    every: usize,
}

impl Path {
    /// Stores a mesh if its number is due. Where there is no room, every second stored mesh is dropped first.
    fn take(&mut self, mesh: Vec<f64>) {
        let most = (MOST_KEPT / mesh.len()).min(MOST_MESHES);
        self.every = self.every.max(1);
        if most > 0 && self.seen.is_multiple_of(self.every) {
            if self.meshes.len() == most {
                self.every *= 2;
                self.meshes.retain(|(n, _)| n.is_multiple_of(self.every));
            }
            if self.seen.is_multiple_of(self.every) && self.meshes.len() < most {
                self.meshes.push((self.seen, mesh));
            }
        }
        self.seen += 1;
    }
}

fn distance(a: &[Vec<f64>], b: &[Vec<f64>]) -> f64 {
    let nodes = a.iter().flatten().zip(b.iter().flatten());
    nodes.fold(0.0, |m, (a, b)| if (a - b).is_nan() { f64::INFINITY } else { m.max((a - b).abs()) })
}

/// The geometric mean of E_{n+2}/E_n over the last iterates with E_{n+2} above rounding.
fn observed(iterates: &[Iterate], rounding: f64) -> Option<f64> {
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
