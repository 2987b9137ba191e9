//! Stochastic domain decomposition: the nodes between the subdomains are estimated, then each subdomain is solved
//! alone.

mod coarse;
mod estimates;
mod interpolation;
mod lattice_walk;
mod monte_carlo;
mod paths;
mod residual_walk;
mod segment;
mod strip;
mod strips;
mod surface;

pub use estimates::{Estimate, Estimates, Problem};
pub use interpolation::{Interpolation, Placement};
pub use lattice_walk::GridWalk;
pub use monte_carlo::MonteCarlo;
pub use residual_walk::ResidualWalk;
pub use strip::Strip;
pub use strips::Strips;

use super::sides::size;
use super::{Decomposition, Interface, MeshGenerator, Mmpde, Moved, move_sides};
use crate::error::{Error, Failure, Result, Unfit};
use crate::geometry::{Density, Lattice, Mesh, Patch};
use crate::kept::Kept;
use crate::kind::kinds;
use crate::numerics::linear::Robust;
use crate::ranks::Ranks;
use crate::setting::Axes;
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
#[schemars(rename = "Stochastic_{D}", bound = "E: JsonSchema + Default + Serialize")]
pub struct Stochastic<E = EstimatorKind, const D: usize = 2, const S: usize = 5> {
    /// Number of subdomains along each axis.
    pub subdomains: Axes<usize, D>,
    /// Seed of all random numbers, 0 … 2⁶³ − 1.
    #[serde(default)]
    pub seed: u64,
    /// How the nodes between subdomains are estimated.
    #[serde(default)]
    pub estimator: E,
    /// Estimates only some nodes of each interface and interpolates the others; by default every node is estimated. On
    /// a line an interface is a single node.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub interface: Option<Interpolation>,
    #[serde(skip)]
    line: Robust<1>,
    #[serde(skip)]
    parts: Option<Parts<D, S>>,
    /// Number of steps done. Together with the seed it is the key of the random numbers.
    #[serde(skip)]
    steps: u32,
}

/// The subdomains of a lattice, with the memory of their solvers.
#[derive(Debug, Clone)]
struct Parts<const D: usize, const S: usize> {
    lattice: Lattice<D>,
    decomposition: Decomposition<D>,
    points: Vec<usize>,
    patches: Vec<(Patch<D>, Robust<D>)>,
    strips: Strips<D, S>,
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
pub trait Estimator<const D: usize = 2, const S: usize = 5>: Send + Sync {
    /// Refuses settings out of range for a decomposition.
    ///
    /// # Errors
    /// [`Error::Invalid`].
    fn check(&self, _decomposition: &Decomposition<D>) -> Result<()> {
        Ok(())
    }

    /// The new positions of `points`, each by itself. `strips` are the subdomains extended beyond the cuts on which the
    /// points lie, with memory that lasts from step to step.
    ///
    /// # Errors
    /// [`Failure::SteepDensity`] where the operator's weights are no probabilities.
    fn estimate(
        &self,
        problem: &Problem<'_, D>,
        points: &[usize],
        strips: &mut Strips<D, S>,
    ) -> Result<Estimates<D>, Failure>;
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

impl<const D: usize, const S: usize> Estimator<D, S> for EstimatorKind
where
    MonteCarlo: Estimator<D, S>,
{
    fn check(&self, decomposition: &Decomposition<D>) -> Result<()> {
        self.estimator().check(decomposition)
    }

    fn estimate(
        &self,
        problem: &Problem<'_, D>,
        points: &[usize],
        strips: &mut Strips<D, S>,
    ) -> Result<Estimates<D>, Failure> {
        self.estimator().estimate(problem, points, strips)
    }
}

impl EstimatorKind {
    /// The estimator as a trait object.
    pub fn estimator<const D: usize, const S: usize>(&self) -> &dyn Estimator<D, S>
    where
        MonteCarlo: Estimator<D, S>,
    {
        match self {
            Self::ResidualWalk(walk) => walk,
            Self::Strip(strip) => strip,
            Self::GridWalk(walk) => walk,
            Self::MonteCarlo(paths) => paths,
        }
    }
}

impl<E: Estimator<D, S>, const D: usize, const S: usize> Stochastic<E, D, S> {
    /// Subdomains, with an estimator for the nodes between them.
    pub fn new(subdomains: [usize; D], seed: u64, estimator: E) -> Self {
        Self {
            subdomains: subdomains.into(),
            seed,
            estimator,
            interface: None,
            line: Robust::default(),
            parts: None,
            steps: 0,
        }
    }

    /// Refuses settings out of range for a lattice.
    ///
    /// # Errors
    /// [`Error::Invalid`].
    pub fn check(&self, lattice: &Lattice<D>) -> Result<()> {
        let decomposition = Decomposition::new(lattice, *self.subdomains)?;
        Ranks::here().check_subdomains(&*self.subdomains)?;
        if self.seed > i64::MAX as u64 {
            return Err(Error::invalid("seed", self.seed, "must be a whole number from 0 to 2^63 - 1"));
        }
        self.estimator.check(&decomposition).map_err(|error| error.within("estimator"))?;
        if self.interface.is_some() && D == 1 {
            let rule = "an interface of a line is a single node, of which there is no sample; leave it out";
            return Err(Error::invalid("interface", "a sample", rule));
        }
        self.interface.as_ref().map_or(Ok(()), |interface| interface.check().map_err(|error| error.within("interface")))
    }
}

impl<const D: usize, const S: usize> Parts<D, S> {
    fn new(lattice: &Lattice<D>, subdomains: [usize; D]) -> Result<Self, Failure> {
        let decomposition = Decomposition::new(lattice, subdomains)
            .map_err(|_| Failure::Subdomains { subdomains: subdomains.into(), cells: lattice.cells().into() })?;
        let patches = decomposition.patches().into_iter().map(|patch| (patch, Robust::default())).collect();
        let (points, strips) = (decomposition.points(), Strips::new(&decomposition));
        Ok(Self { lattice: *lattice, points, decomposition, patches, strips })
    }
}

impl<E: Estimator<D, S>, const D: usize, const S: usize> Stochastic<E, D, S> {
    /// One step. `sampled` gives the nodes to estimate, where these are not all nodes of the interfaces, and `filled`
    /// interpolates between them.
    fn advance(
        &mut self,
        equation: &Mmpde,
        mesh: &Mesh<D>,
        (rho, dt): (&Density, f64),
        sampled: impl FnOnce(&Interpolation, &Decomposition<D>) -> Vec<usize>,
        filled: impl FnOnce(&Decomposition<D>, &[usize], &[[f64; D]], &mut [[f64; D]]),
    ) -> Result<Moved<D>, Failure> {
        let lattice = mesh.lattice();
        let parts = match self.parts.take().filter(|parts| parts.lattice == *lattice) {
            Some(parts) => parts,
            None => Parts::new(lattice, *self.subdomains)?,
        };
        self.check(lattice).map_err(Failure::refusing)?;
        let parts = self.parts.insert(parts);
        let operator = equation.operator(lattice, rho, dt)?;
        let mut x = mesh.x().to_vec();
        let mut work = move_sides(equation, mesh, rho, dt, &mut x, &mut self.line)?;

        let started = Instant::now();
        let problem = Problem::new(equation, &operator, mesh, rho, dt, &x, self.seed, self.steps);
        self.steps = self.steps.wrapping_add(1);
        let sample = self.interface.as_ref().map(|interface| sampled(interface, &parts.decomposition));
        let points = sample.as_ref().unwrap_or(&parts.points);
        let mut interface = None;
        if !points.is_empty() {
            let found = self.estimator.estimate(&problem, points, &mut parts.strips)?;
            work += found.work;
            interface = Some(summary(mesh, parts.points.len(), &found, &parts.strips, problem.stiffness())?);
            x.copy_from_slice(&found.guess);
            points.iter().zip(&found.points).for_each(|(&k, estimate)| x[k] = estimate.x);
            if sample.is_some() {
                filled(&parts.decomposition, points, &found.guess, &mut x);
            }
        }
        let seconds = started.elapsed().as_secs_f64();

        let (jump, size) = (mesh.jump(), size(mesh));
        let solved = Ranks::here().map_mut(&mut parts.patches, |(patch, solver)| {
            operator.solve::<S, D>(*patch, mesh.x(), &x, jump, solver, size)
        });
        for ((patch, _), solved) in parts.patches.iter().zip(solved) {
            let (inside, cost) = solved?;
            work += cost;
            patch.scatter(lattice, &inside, &mut x, jump);
        }
        let interface = Interface { seconds, ..interface.unwrap_or_default() };
        Ok(Moved { mesh: mesh.moved(x)?, work, interface: Some(interface) })
    }
}

impl<E: Estimator> MeshGenerator for Stochastic<E> {
    fn solve(&mut self, equation: &Mmpde, mesh: &Mesh<2>, rho: &Density, dt: f64) -> Result<Moved, Failure> {
        let sampled = |interface: &Interpolation, cuts: &Decomposition| interface.sample(cuts, rho.largest());
        self.advance(equation, mesh, (rho, dt), sampled, |cuts, points, guess, x| {
            interpolation::fill(cuts, mesh, points, guess, x);
        })
    }

    fn keep(&self, kept: &mut Kept) {
        kept.put("mesh steps", &self.steps);
    }

    fn resume(&mut self, _mesh: &Mesh<2>, kept: &Kept) -> Result<(), Unfit> {
        self.steps = kept.get("mesh steps")?;
        Ok(())
    }
}

impl<E: Estimator<1, 3>> MeshGenerator<1> for Stochastic<E, 1, 3> {
    fn solve(&mut self, equation: &Mmpde, mesh: &Mesh<1>, rho: &Density, dt: f64) -> Result<Moved<1>, Failure> {
        self.advance(equation, mesh, (rho, dt), |_, cuts| cuts.points(), |_, _, _, _| ())
    }

    fn keep(&self, kept: &mut Kept) {
        kept.put("mesh steps", &self.steps);
    }

    fn resume(&mut self, _mesh: &Mesh<1>, kept: &Kept) -> Result<(), Unfit> {
        self.steps = kept.get("mesh steps")?;
        Ok(())
    }
}

/// Figures of all estimates together; a failure where their noise is as large as an edge of the mesh.
fn summary<const D: usize, const S: usize>(
    mesh: &Mesh<D>,
    points: usize,
    found: &Estimates<D>,
    strips: &Strips<D, S>,
    stiffness: [f64; D],
) -> Result<Interface, Failure> {
    let squares = found.points.iter().flat_map(|e| e.standard_error).map(|s| s * s);
    let rms = (squares.sum::<f64>() / (D * found.points.len()).max(1) as f64).sqrt();
    let edge = mesh.shortest_edge();
    if rms > edge {
        return Err(Failure::NoisyInterface { noise: rms, edge, stiffness: stiffness.into_iter().fold(0.0, f64::max) });
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
