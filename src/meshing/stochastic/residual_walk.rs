use super::coarse::SOLVED;
use super::lattice_walk::{Stop, Walks, check_walks, for_each_neighbour, forget_certainty, lowest, mean_jumps};
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
use std::sync::atomic::{AtomicUsize, Ordering};

/// Random walks for what strips leave
///
/// ```text
/// P = a correction of the mesh by every subdomain on itself and a strip of its neighbours,
/// r = xⁿ − M P,   x_i = P_i + E[r where the walk stops]
/// ```
///
/// The walks are those of [`GridWalk`](super::GridWalk). P is a control variate whose target is known exactly: the
/// estimate stays unbiased for any P, and its variance falls with the square of the residual. A walk pays what its own
/// subdomain sees as long as that lies on it or in the nearer half of its strip; a walk that ends further away is
/// handed on to the subdomain there, and pays what that one sees.
///
/// With `sweeps = "auto"` the strips are those of [`Strip`](super::Strip), solved. Where walks would take more than 64
/// jumps, Δt/(τh²) of about 16, they cost more than the strips and are no better, and none is done. With a number, P is
/// so many sweeps of relaxation from xⁿ in strips twice as wide, which see as much as if they had gone over the whole
/// lattice; strips are at most as wide as the narrowest subdomain.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ResidualWalk {
    /// Sweeps of relaxation in place of the solves of strips, or "auto" for the solves.
    pub sweeps: Auto<usize>,
    /// Number N of walks that start at each interface point.
    pub walks: usize,
    /// Weights of the sweeps.
    pub smoother: Smoother,
}

impl Default for ResidualWalk {
    fn default() -> Self {
        Self { sweeps: Auto::Auto, walks: 10, smoother: Smoother::Chebyshev }
    }
}

const MAX_SWEEPS: usize = 1_000_000;
/// Jumps of a walk beyond which strips alone are as good for less.
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

    /// Strips, the correction in them, and how often.
    fn strips(&self, problem: &Problem<'_>, strips: &Strips) -> (Reach, Local, Option<usize>) {
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

impl Estimator for ResidualWalk {
    fn check(&self, _decomposition: &Decomposition) -> Result<()> {
        self.check()
    }

    fn estimate(&self, problem: &Problem<'_>, points: &[usize], strips: &mut Strips) -> Result<Estimates, Failure> {
        let alone = self.sweeps == Auto::Auto && mean_jumps(problem) > WORTH_WALKING;
        // walks that nobody waits for are refused before anything is done
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

/// Adds to estimates what walks from the points are paid.
fn pay_residual(
    problem: &Problem<'_>,
    walks: &Walks<'_>,
    count: usize,
    points: &[usize],
    strips: &Strips,
    found: &Corrected,
    estimates: &mut Estimates,
) {
    let owners: Vec<Option<usize>> = points.iter().map(|&k| strips.owner(k)).collect();
    let handed_on = AtomicUsize::new(0);
    let (mut paid, path_steps) = walks.mean(points, count, |p, Stop { node, .. }| {
        let own = |node: usize| owners[p].and_then(|part| strips.seen(part, node));
        // a side belongs to nobody, and pays nothing
        if own(node).is_none() && strips.owner(node).is_some_and(|owner| owners[p] != Some(owner)) {
            handed_on.fetch_add(1, Ordering::Relaxed);
        }
        left(problem, found, node, |node| own(node).unwrap_or(found.correction[node]))
    });
    forget_certainty(&mut paid);
    for (estimate, paid) in estimates.points.iter_mut().zip(paid) {
        let x = [0, 1].map(|c| estimate.x[c] + paid.x[c]);
        *estimate = Estimate { x, standard_error: paid.standard_error };
    }
    estimates.walks = count;
    estimates.handed_on = handed_on.into_inner();
    estimates.work += Work { path_steps, ..Work::default() };
}

/// What a correction leaves of the residual at a node, r − M c as r_i − c_i + Σ w_e (c_e − c_i); zero on bounded sides.
fn left(problem: &Problem<'_>, found: &Corrected, node: usize, correction: impl Fn(usize) -> [f64; 2]) -> [f64; 2] {
    let c = correction(node);
    let mut left = [0, 1].map(|k| found.residual[node][k] - c[k]);
    for_each_neighbour(problem, node, |neighbour, _, weight| {
        let e = correction(neighbour);
        (0..2).for_each(|k| left[k] += weight * (e[k] - c[k]));
    });
    left
}
