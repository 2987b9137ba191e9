//! Stochastic domain decomposition: the nodes between the subdomains are estimated, then each subdomain is solved
//! alone.

mod coarse;
mod interpolation;
mod lattice_walk;
mod monte_carlo;
mod paths;
mod residual_walk;
mod strip;
mod strips;
mod surface;

pub use interpolation::{Interpolation, Placement};
pub use lattice_walk::GridWalk;
pub use monte_carlo::MonteCarlo;
pub use residual_walk::ResidualWalk;
pub use strip::Strip;
pub use strips::Strips;

use strips::Corrected;

use super::sides::size;
use super::{Decomposition, Interface, MeshGenerator, MeshOperator, Mmpde, Moved, move_sides};
use crate::error::{Error, Failure, Result, Unfit};
use crate::geometry::{Density, Lattice, Mesh, Patch};
use crate::kept::Kept;
use crate::kind::kinds;
use crate::numerics::linear::Robust;
use crate::parallel;
use crate::random::Philox;
use crate::setting::pair;
use crate::work::Work;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::time::Instant;

/// Stochastic domain decomposition
///
/// The new positions of the nodes between the S_ξ × S_η subdomains are estimated one by one, by random walks or by
/// strips around the cuts. With these positions given, each subdomain is an independent solve. Estimators that use
/// strips read them from the neighbours in one exchange in each step, in more exchanges only if the step is long for
/// the mesh; with a coarse lattice they also gather its right-hand sides. [`Interface`] counts what they read and
/// gather.
///
/// The estimator is one of [`EstimatorKind`], as studies name them, or any [`Estimator`] of your own.
///
/// # Source
/// Bihlo, Haynes and Walsh, *Stochastic domain decomposition for time dependent adaptive mesh generation* (2015).
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Stochastic", bound = "E: JsonSchema + Default + Serialize")]
pub struct Stochastic<E = EstimatorKind> {
    /// Number of subdomains along each axis.
    #[serde(deserialize_with = "pair")]
    pub subdomains: [usize; 2],
    /// Seed of all random numbers, 0 … 2⁶³ − 1.
    #[serde(default)]
    pub seed: u64,
    /// How the nodes between subdomains are estimated.
    #[serde(default)]
    pub estimator: E,
    /// Estimates only some nodes of each interface and interpolates the others; by default every node is estimated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub interface: Option<Interpolation>,
    #[serde(skip)]
    line: Robust<1>,
    #[serde(skip)]
    parts: Option<Parts>,
    /// Number of steps done. Together with the seed it is the key of the random numbers.
    #[serde(skip)]
    steps: u32,
}

/// The subdomains of a lattice, with the memory of their solvers.
#[derive(Debug, Clone)]
struct Parts {
    lattice: Lattice<2>,
    decomposition: Decomposition,
    points: Vec<usize>,
    patches: Vec<(Patch<2>, Robust<2>)>,
    strips: Strips,
}

/// One step of the mesh equation, as an estimator gets it.
#[derive(Debug)]
pub struct Problem<'a> {
    /// The mesh equation.
    pub equation: &'a Mmpde,
    /// The same equation as a linear system.
    pub operator: &'a MeshOperator<2>,
    /// The mesh at the start of the step.
    pub mesh: &'a Mesh<2>,
    /// The density at its nodes.
    pub rho: &'a Density,
    /// Length of the step.
    pub dt: f64,
    /// New positions of nodes on bounded sides, and old ones elsewhere.
    pub new: &'a [[f64; 2]],
    /// Seed of all random numbers.
    pub seed: u64,
    /// Number of steps done before. Together with the seed it is the key of this step's random numbers.
    pub step: u32,
    random: Philox,
}

impl<'a> Problem<'a> {
    /// A step whose random numbers belong to a seed and a step number.
    #[allow(clippy::too_many_arguments)] // what a step is made of
    pub fn new(
        equation: &'a Mmpde,
        operator: &'a MeshOperator<2>,
        mesh: &'a Mesh<2>,
        rho: &'a Density,
        dt: f64,
        new: &'a [[f64; 2]],
        seed: u64,
        step: u32,
    ) -> Self {
        Self { equation, operator, mesh, rho, dt, new, seed, step, random: Philox::new(seed) }
    }

    /// Δt/(τh²) along each axis.
    pub fn stiffness(&self) -> [f64; 2] {
        self.equation.stiffness(self.mesh.lattice(), self.dt)
    }
}

/// The new position of one node.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// Mean over the samples; for a deterministic estimator its only value.
    pub x: [f64; 2],
    /// Standard error of the mean; NaN without samples or with only one.
    pub standard_error: [f64; 2],
}

/// The result of an estimator.
#[derive(Debug, Clone, Default)]
pub struct Estimates {
    /// One estimate for each point asked for.
    pub points: Vec<Estimate>,
    /// Approximate new positions of all nodes, exact on bounded sides, from which solves and interpolations start.
    pub guess: Vec<[f64; 2]>,
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

impl Estimates {
    /// Means over `walks` samples, and a guess for all nodes.
    fn sampled(points: Vec<Estimate>, guess: Vec<[f64; 2]>, walks: usize) -> Self {
        Self { points, guess, work: Work::default(), sweeps: 0, walks, exchanges: 0, handed_on: 0 }
    }

    /// The result of strips without walks.
    fn of_strips(found: &Corrected, points: &[usize]) -> Self {
        let moved = |k: usize| [0, 1].map(|c| found.base[k][c] + found.correction[k][c]);
        let guess: Vec<[f64; 2]> = (0..found.base.len()).map(moved).collect();
        let at = |&k: &usize| Estimate { x: guess[k], standard_error: [f64::NAN; 2] };
        let points = points.iter().map(at).collect();
        Self { work: found.work, exchanges: found.exchanges, ..Self::sampled(points, guess, 0) }
    }
}

/// A method to compute the solution of a mesh step at single nodes.
///
/// # Example
/// An estimator that solves the whole domain and returns the points asked for. The subdomains of [`Stochastic`] then
/// make the mesh of [`Whole`](crate::meshing::Whole).
///
/// ```
/// use driftmesh::geometry::{Density, Lattice, Mesh};
/// use driftmesh::meshing::{Estimate, Estimates, Estimator, MeshGenerator, Mmpde, Problem, Stochastic, Strips, Whole};
/// use driftmesh::{Failure, Work};
///
/// struct Oracle;
///
/// impl Estimator for Oracle {
///     fn estimate(&self, problem: &Problem<'_>, points: &[usize], _: &mut Strips) -> Result<Estimates, Failure> {
///         let moved = Whole::to(1e-9).step(problem.equation, problem.mesh, problem.rho, problem.dt)?;
///         let at = |&k: &usize| Estimate { x: moved.mesh.x()[k], standard_error: [f64::NAN; 2] };
///         let guess = moved.mesh.x().to_vec();
///         Ok(Estimates { points: points.iter().map(at).collect(), guess, work: moved.work, ..Estimates::default() })
///     }
/// }
///
/// let mesh = Mesh::uniform(Lattice::bounded([16, 16])?, [0.0; 2], [1.0; 2])?;
/// let rho: Density = mesh.x().iter().map(|[x, y]| 1.0 + (x * y).sin()).collect();
/// let equation = Mmpde::default();
/// let ours = Stochastic::new([2, 2], 1, Oracle).step(&equation, &mesh, &rho, 0.1)?.mesh;
/// let whole = Whole::to(1e-9).step(&equation, &mesh, &rho, 0.1)?.mesh;
/// assert!(ours.farthest(&whole) < 1e-9);
/// # Ok::<(), driftmesh::Error>(())
/// ```
pub trait Estimator: Send + Sync {
    /// Refuses settings out of range for a decomposition.
    ///
    /// # Errors
    /// [`Error::Invalid`].
    fn check(&self, _decomposition: &Decomposition) -> Result<()> {
        Ok(())
    }

    /// The new positions of `points`, each by itself. `strips` are the subdomains extended beyond the cuts on which the
    /// points lie, with memory that lasts from step to step.
    ///
    /// # Errors
    /// [`Failure::SteepDensity`] where the operator's weights are no probabilities.
    fn estimate(&self, problem: &Problem<'_>, points: &[usize], strips: &mut Strips) -> Result<Estimates, Failure>;
}

kinds! {
    /// `mesh.generator.estimator` of a study.
    EstimatorKind {
        "residual-walk" = ResidualWalk: "strips around the interfaces, then random walks on the lattice for what they \
                                         leave",
        "strip" = Strip: "every subdomain solved once with a strip of its neighbours, after a coarse lattice; no walks",
        "grid-walk" = GridWalk: "random walks on the lattice, unbiased for the discrete equation",
        "monte-carlo" = MonteCarlo: "as published: Euler-Maruyama paths with a Brownian-bridge exit test",
    }
}

impl Default for EstimatorKind {
    fn default() -> Self {
        Self::ResidualWalk(ResidualWalk::default())
    }
}

impl Estimator for EstimatorKind {
    fn check(&self, decomposition: &Decomposition) -> Result<()> {
        self.estimator().check(decomposition)
    }

    fn estimate(&self, problem: &Problem<'_>, points: &[usize], strips: &mut Strips) -> Result<Estimates, Failure> {
        self.estimator().estimate(problem, points, strips)
    }
}

impl EstimatorKind {
    /// The estimator as a trait object.
    pub fn estimator(&self) -> &dyn Estimator {
        match self {
            Self::ResidualWalk(walk) => walk,
            Self::Strip(strip) => strip,
            Self::GridWalk(walk) => walk,
            Self::MonteCarlo(paths) => paths,
        }
    }
}

impl<E: Estimator> Stochastic<E> {
    /// Subdomains, with an estimator for the nodes between them.
    pub fn new(subdomains: [usize; 2], seed: u64, estimator: E) -> Self {
        Self { subdomains, seed, estimator, interface: None, line: Robust::default(), parts: None, steps: 0 }
    }

    /// Refuses settings out of range for a lattice.
    ///
    /// # Errors
    /// [`Error::Invalid`].
    pub fn check(&self, lattice: &Lattice<2>) -> Result<()> {
        let decomposition = Decomposition::new(lattice, self.subdomains)?;
        if self.seed > i64::MAX as u64 {
            return Err(Error::invalid("seed", self.seed, "must be a whole number from 0 to 2^63 - 1"));
        }
        self.estimator.check(&decomposition).map_err(|error| error.within("estimator"))?;
        self.interface.as_ref().map_or(Ok(()), |interface| interface.check().map_err(|error| error.within("interface")))
    }
}

impl Parts {
    fn new(lattice: &Lattice<2>, subdomains: [usize; 2]) -> Result<Self, Failure> {
        let decomposition = Decomposition::new(lattice, subdomains)
            .map_err(|_| Failure::Subdomains { subdomains, cells: lattice.cells() })?;
        let patches = decomposition.patches().into_iter().map(|patch| (patch, Robust::default())).collect();
        let (points, strips) = (decomposition.points(), Strips::new(&decomposition));
        Ok(Self { lattice: *lattice, points, decomposition, patches, strips })
    }
}

impl<E: Estimator> MeshGenerator for Stochastic<E> {
    fn solve(&mut self, equation: &Mmpde, mesh: &Mesh<2>, rho: &Density, dt: f64) -> Result<Moved, Failure> {
        let lattice = mesh.lattice();
        let parts = match self.parts.take().filter(|parts| parts.lattice == *lattice) {
            Some(parts) => parts,
            None => Parts::new(lattice, self.subdomains)?,
        };
        self.check(lattice).map_err(Failure::refusing)?;
        let parts = self.parts.insert(parts);
        let operator = equation.operator(lattice, rho, dt)?;
        let mut x = mesh.x().to_vec();
        let mut work = move_sides(equation, mesh, rho, dt, &mut x, &mut self.line)?;

        let started = Instant::now();
        let problem = Problem::new(equation, &operator, mesh, rho, dt, &x, self.seed, self.steps);
        self.steps = self.steps.wrapping_add(1);
        let sample = self.interface.as_ref().map(|i| i.sample(&parts.decomposition, rho.largest()));
        let points = sample.as_ref().unwrap_or(&parts.points);
        let mut interface = None;
        if !points.is_empty() {
            let found = self.estimator.estimate(&problem, points, &mut parts.strips)?;
            work += found.work;
            interface = Some(summary(mesh, parts.points.len(), &found, &parts.strips, problem.stiffness())?);
            x.copy_from_slice(&found.guess);
            points.iter().zip(&found.points).for_each(|(&k, estimate)| x[k] = estimate.x);
            if sample.is_some() {
                interpolation::fill(&parts.decomposition, mesh, points, &found.guess, &mut x);
            }
        }
        let seconds = started.elapsed().as_secs_f64();

        let (jump, size) = (mesh.jump(), size(mesh));
        let solved = parallel::map_mut(&mut parts.patches, |(patch, solver)| {
            operator.solve::<5, 2>(*patch, mesh.x(), &x, jump, solver, size)
        });
        for ((patch, _), solved) in parts.patches.iter().zip(solved) {
            let (inside, cost) = solved?;
            work += cost;
            patch.scatter(lattice, &inside, &mut x, jump);
        }
        let interface = Interface { seconds, ..interface.unwrap_or_default() };
        Ok(Moved { mesh: mesh.moved(x)?, work, interface: Some(interface) })
    }

    fn keep(&self, kept: &mut Kept) {
        kept.put("mesh steps", &self.steps);
    }

    fn resume(&mut self, _mesh: &Mesh<2>, kept: &Kept) -> Result<(), Unfit> {
        self.steps = kept.get("mesh steps")?;
        Ok(())
    }
}

/// Figures of all estimates together; a failure where their noise is as large as an edge of the mesh.
fn summary(
    mesh: &Mesh<2>,
    points: usize,
    found: &Estimates,
    strips: &Strips,
    stiffness: [f64; 2],
) -> Result<Interface, Failure> {
    let squares = found.points.iter().flat_map(|e| e.standard_error).map(|s| s * s);
    let rms = (squares.sum::<f64>() / (2 * found.points.len()).max(1) as f64).sqrt();
    let edge = mesh.shortest_edge();
    if rms > edge {
        return Err(Failure::NoisyInterface { noise: rms, edge, stiffness: stiffness[0].max(stiffness[1]) });
    }
    let known = rms.is_finite();
    let exchanged = found.exchanges > 0;
    Ok(Interface {
        points,
        standard_error: known.then_some(rms),
        noise: known.then_some(rms / edge),
        sweeps: found.sweeps,
        walks: found.walks,
        exchanges: found.exchanges,
        read: if exchanged { strips.read() } else { 0 },
        gathered: if exchanged { strips.gathered() } else { 0 },
        handed_on: found.handed_on,
        ..Interface::default()
    })
}

#[cfg(test)]
mod tests;
