use super::strips::Corrected;
use crate::geometry::{Density, Mesh};
use crate::meshing::{MeshOperator, Mmpde};
use crate::random::Philox;
use crate::work::Work;

/// One step of the mesh equation, as an estimator gets it.
#[derive(Debug)]
pub struct Problem<'a, const D: usize = 2> {
    /// The mesh equation.
    pub equation: &'a Mmpde,
    /// The equation of the step as a linear system.
    pub operator: &'a MeshOperator<D>,
    /// The mesh at the start of the step.
    pub mesh: &'a Mesh<D>,
    /// The density at its nodes.
    pub rho: &'a Density,
    /// Length of the step.
    pub dt: f64,
    /// New positions of nodes on bounded sides, and old ones elsewhere.
    pub new: &'a [[f64; D]],
    /// Seed of all random numbers.
    pub seed: u64,
    /// Number of steps done before. Together with the seed it is the key of this step's random numbers.
    pub step: u32,
    pub(super) random: Philox,
}

impl<'a, const D: usize> Problem<'a, D> {
    /// A step whose random numbers belong to a seed and a step number.
    #[allow(clippy::too_many_arguments)] // what a step is made of
    pub fn new(
        equation: &'a Mmpde,
        operator: &'a MeshOperator<D>,
        mesh: &'a Mesh<D>,
        rho: &'a Density,
        dt: f64,
        new: &'a [[f64; D]],
        seed: u64,
        step: u32,
    ) -> Self {
        Self { equation, operator, mesh, rho, dt, new, seed, step, random: Philox::new(seed) }
    }

    /// Δt/(τh²) along each axis.
    pub fn stiffness(&self) -> [f64; D] {
        self.equation.stiffness(self.mesh.lattice(), self.dt)
    }
}

/// The new position of one node.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate<const D: usize = 2> {
    /// Mean over the samples; for a deterministic estimator its only value.
    pub x: [f64; D],
    /// Standard error of the mean; NaN without samples or with only one.
    pub standard_error: [f64; D],
}

/// The result of an estimator.
#[derive(Debug, Clone)]
pub struct Estimates<const D: usize = 2> {
    /// One estimate for each point asked for.
    pub points: Vec<Estimate<D>>,
    /// Approximate new positions of all nodes, exact on bounded sides, from which solves and interpolations start.
    pub guess: Vec<[f64; D]>,
    /// The work of the estimator.
    pub work: Work,
    /// Relaxation sweeps in the strips.
    pub sweeps: usize,
    /// Samples from each point; 0 for deterministic estimators, and where strips alone are better.
    pub walks: usize,
    /// Exchanges of strips between neighbours.
    pub exchanges: usize,
    /// Walks that ended beyond the nearer half of a strip, so that their value came from another subdomain.
    pub handed_on: usize,
}

impl<const D: usize> Default for Estimates<D> {
    fn default() -> Self {
        Self::sampled(Vec::new(), Vec::new(), 0)
    }
}

impl<const D: usize> Estimates<D> {
    /// Means over `walks` samples, and a guess for all nodes.
    pub(super) fn sampled(points: Vec<Estimate<D>>, guess: Vec<[f64; D]>, walks: usize) -> Self {
        Self { points, guess, work: Work::default(), sweeps: 0, walks, exchanges: 0, handed_on: 0 }
    }

    /// The result of strips without walks.
    pub(super) fn of_strips(found: &Corrected<D>, points: &[usize]) -> Self {
        let moved = |k: usize| std::array::from_fn(|c| found.base[k][c] + found.correction[k][c]);
        let guess: Vec<[f64; D]> = (0..found.base.len()).map(moved).collect();
        let at = |&k: &usize| Estimate { x: guess[k], standard_error: [f64::NAN; D] };
        let points = points.iter().map(at).collect();
        Self { work: found.work, exchanges: found.exchanges, ..Self::sampled(points, guess, 0) }
    }
}
