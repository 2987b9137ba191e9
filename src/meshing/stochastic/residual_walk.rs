use super::coarse::SOLVED;
use super::lattice_walk::{Means, Stop, Walks, check_walks, for_each_neighbour, forget_certainty, lowest, mean_jumps};
use super::strips::{Corrected, Reach, Strips};
use super::{Estimate, Estimates, Estimator, Problem};
use crate::error::{Error, Failure, Result};
use crate::meshing::Decomposition;
use crate::meshing::overlap::Local;
use crate::numerics::linear::Smoother;
use crate::setting::Auto;
use crate::work::Work;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Random walks that estimate the error which strips leave
///
/// ```text
/// P = a correction of the mesh by every subdomain on itself and a strip of its neighbours,
/// r = xⁿ − M P,   x_i = P_i + E[r where the walk stops]
/// ```
///
/// The walks are those of [`GridWalk`](super::GridWalk). The correction P is a control variate with a known mean: the
/// estimate has no bias for any P, and its variance falls with the square of the residual r. A walk takes the residual
/// as its own subdomain sees it, as long as it stops in that subdomain or in the nearer half of its strip. If it stops
/// farther away, the subdomain there provides the residual: the walk is handed on.
///
/// With `sweeps = "auto"` the strips are those of [`Strip`](super::Strip) and are solved. Where a walk would take more
/// than 64 jumps, which is Δt/(τh²) of about 16, walks cost more than strips and are no better, and none are done. With
/// a number, P is that many sweeps of relaxation from xⁿ in strips of twice as many nodes, which makes them equal to
/// sweeps over the whole lattice; strips are at most as wide as the narrowest subdomain.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ResidualWalk {
    /// Number of relaxation sweeps in the strips; "auto" solves the strips instead.
    pub sweeps: Auto<usize>,
    /// Number N of walks that start at each interface point.
    pub walks: usize,
    /// Relaxation method where `sweeps` is a number.
    pub smoother: Smoother,
}

impl Default for ResidualWalk {
    fn default() -> Self {
        Self { sweeps: Auto::Auto, walks: 10, smoother: Smoother::Chebyshev }
    }
}

/// Largest number of sweeps that may be set.
const MAX_SWEEPS: usize = 1_000_000;
/// Mean number of jumps of a walk above which strips alone are as accurate and cost less.
const WORTH_WALKING: f64 = 64.0;

impl ResidualWalk {
    /// Refuses settings out of range.
    ///
    /// # Errors
    /// [`Error::Invalid`].
    pub fn check(&self) -> Result<()> {
        match self.sweeps {
            Auto::Value(sweeps) if sweeps > MAX_SWEEPS => {
                Err(Error::invalid("sweeps", sweeps, format!("must be at most {MAX_SWEEPS}, or \"auto\"")))
            }
            _ => check_walks(self.walks),
        }
    }

    /// The strips, how they are corrected, and the number of exchanges.
    fn strips<const D: usize, const S: usize>(
        &self,
        problem: &Problem<'_, D>,
        strips: &Strips<D, S>,
    ) -> (Reach, Local, Option<usize>) {
        match self.sweeps {
            Auto::Auto => (Reach::of(problem, strips.decomposition()), Local::Solve { share: SOLVED }, None),
            Auto::Value(sweeps) => {
                let width = sweeps.saturating_mul(2).clamp(1, strips.decomposition().narrowest());
                let local = Local::Sweeps { smoother: self.smoother, sweeps, lowest: lowest(problem) };
                (Reach { width, coarse: 1 }, local, Some(1))
            }
        }
    }
}

impl<const D: usize, const S: usize> Estimator<D, S> for ResidualWalk {
    fn check(&self, _decomposition: &Decomposition<D>) -> Result<()> {
        self.check()
    }

    fn estimate(
        &self,
        problem: &Problem<'_, D>,
        points: &[usize],
        strips: &mut Strips<D, S>,
    ) -> Result<Estimates<D>, Failure> {
        let alone = self.sweeps == Auto::Auto && mean_jumps(problem) > WORTH_WALKING;
        // walks that would take too long are refused before anything is computed
        let walks = (!alone).then(|| Walks::new(problem, self.walks, points.len())).transpose()?;
        let (reach, local, exchanges) = self.strips(problem, strips);
        let found = strips.correct(problem, reach, local, exchanges)?;
        let mut estimates = Estimates::of_strips(&found, points);
        if let Auto::Value(sweeps) = self.sweeps {
            estimates.sweeps = sweeps;
        }
        if let Some(walks) = walks.filter(|_| !strips.rest()) {
            pay_residual(problem, &walks, self.walks, points, strips, &found, &mut estimates);
        }
        Ok(estimates)
    }
}

/// Adds to estimates the mean residual that walks from the points collect.
fn pay_residual<const D: usize, const S: usize>(
    problem: &Problem<'_, D>,
    walks: &Walks<'_, D>,
    count: usize,
    points: &[usize],
    strips: &Strips<D, S>,
    found: &Corrected<D>,
    estimates: &mut Estimates<D>,
) {
    let owners: Vec<Option<usize>> = points.iter().map(|&k| strips.owner(k)).collect();
    // what a subdomain sees of a strip is on its own rank
    let rank = |p: usize| owners[p].map_or(0, |part| strips.rank(part));
    let Means { estimates: mut paid, path_steps, handed_on } =
        walks.mean(points, count, rank, |p, Stop { node, .. }| {
            let own = |node: usize| owners[p].and_then(|part| strips.seen(part, node));
            // a node on a bounded side is owned by no subdomain, and its residual is zero
            let away = own(node).is_none() && strips.owner(node).is_some_and(|owner| owners[p] != Some(owner));
            (left(problem, found, node, |node| own(node).unwrap_or(found.correction[node])), away)
        });
    forget_certainty(&mut paid);
    for (estimate, paid) in estimates.points.iter_mut().zip(paid) {
        let x = std::array::from_fn(|c| estimate.x[c] + paid.x[c]);
        *estimate = Estimate { x, standard_error: paid.standard_error };
    }
    estimates.walks = count;
    estimates.handed_on = handed_on;
    estimates.work += Work { path_steps, ..Work::default() };
}

/// The residual that a correction leaves at a node, r − M c as r_i − c_i + Σ w_e (c_e − c_i); zero on bounded sides.
fn left<const D: usize>(
    problem: &Problem<'_, D>,
    found: &Corrected<D>,
    node: usize,
    correction: impl Fn(usize) -> [f64; D],
) -> [f64; D] {
    let c = correction(node);
    let mut left: [f64; D] = std::array::from_fn(|k| found.residual[node][k] - c[k]);
    for_each_neighbour(problem, node, |neighbour, _, weight| {
        let e = correction(neighbour);
        (0..D).for_each(|k| left[k] += weight * (e[k] - c[k]));
    });
    left
}
