//! Stochastic domain decomposition: random walks give the values between the subdomains, then each is solved alone.

mod interpolation;
mod lattice_walk;
mod monte_carlo;
mod paths;
mod surface;

pub use interpolation::{Interpolation, Placement};
pub use lattice_walk::{GridWalk, ResidualWalk};
pub use monte_carlo::MonteCarlo;

use super::sides::{jump, size};
use super::{Decomposition, Interface, MeshGenerator, MeshOperator, Mmpde, Moved, move_sides};
use crate::error::{Error, Failure, Result, Unfit};
use crate::geometry::{Lattice, Mesh, Patch};
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
/// The new mesh at every node between the S_ξ × S_η subdomains is estimated by random walks, each node by itself; with
/// these values each subdomain is one solve of its own. Nothing is iterated, and subdomains exchange nothing else.
///
/// # Source
/// Bihlo, Haynes and Walsh, *Stochastic domain decomposition for time dependent adaptive mesh generation* (2015).
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Stochastic {
    /// Along each axis.
    #[serde(deserialize_with = "pair")]
    pub subdomains: [usize; 2],
    /// Of all random numbers, 0 … 2⁶³ − 1.
    #[serde(default)]
    pub seed: u64,
    /// How values on the interfaces are estimated.
    #[serde(default)]
    pub estimator: EstimatorKind,
    /// Estimates only a sample of each interface; all of its nodes where this is left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub interface: Option<Interpolation>,
    #[serde(skip)]
    line: Robust<1>,
    #[serde(skip)]
    parts: Option<Parts>,
    /// Steps done: with the seed, the key of all random numbers.
    #[serde(skip)]
    steps: u32,
}

/// The subdomains of a lattice with the memory of their solvers.
#[derive(Debug, Clone)]
struct Parts {
    lattice: Lattice<2>,
    decomposition: Decomposition,
    points: Vec<usize>,
    patches: Vec<(Patch<2>, Robust<2>)>,
}

/// One mesh step, as an estimator sees it.
#[derive(Debug)]
pub struct Problem<'a> {
    /// The mesh equation.
    pub equation: &'a Mmpde,
    /// The same as a linear system.
    pub operator: &'a MeshOperator<2>,
    /// The mesh at the start of the step.
    pub mesh: &'a Mesh<2>,
    /// The density at its nodes.
    pub rho: &'a [f64],
    /// Length of the step.
    pub dt: f64,
    /// New positions of the nodes on bounded sides; old ones elsewhere.
    pub new: &'a [[f64; 2]],
    random: Philox,
    step: u32,
}

impl<'a> Problem<'a> {
    /// A mesh step whose random numbers belong to a seed and a step number.
    #[allow(clippy::too_many_arguments)] // what a step is made of
    pub fn new(
        equation: &'a Mmpde,
        operator: &'a MeshOperator<2>,
        mesh: &'a Mesh<2>,
        rho: &'a [f64],
        dt: f64,
        new: &'a [[f64; 2]],
        seed: u64,
        step: u32,
    ) -> Self {
        Self { equation, operator, mesh, rho, dt, new, random: Philox::new(seed), step }
    }

    /// Δt/(τh²) along each axis.
    pub fn stiffness(&self) -> [f64; 2] {
        self.equation.stiffness(self.mesh.lattice(), self.dt)
    }
}

/// The new position of one node.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// Mean over the samples.
    pub x: [f64; 2],
    /// Its standard error; NaN where there was one sample only.
    pub standard_error: [f64; 2],
}

/// What an estimator found.
#[derive(Debug, Clone)]
pub struct Estimates {
    /// One a point asked for.
    pub points: Vec<Estimate>,
    /// Positions near the new ones at all nodes, exact on bounded sides: where solves and interpolations start from.
    pub guess: Vec<[f64; 2]>,
    /// What it cost.
    pub work: Work,
    /// Relaxation sweeps over the whole lattice.
    pub sweeps: usize,
}

/// A way to compute the solution of a mesh step at single nodes.
pub trait Estimator: Sync {
    /// The new positions of `points`, each by itself.
    ///
    /// # Errors
    /// [`Failure::SteepDensity`] where the operator's weights are no probabilities.
    fn estimate(&self, problem: &Problem<'_>, points: &[usize]) -> Result<Estimates, Failure>;
}

kinds! {
    /// `mesh.generator.estimator` of a study.
    EstimatorKind {
        "residual-walk" = ResidualWalk: "sweeps of relaxation, then random walks on the lattice for what they leave",
        "grid-walk" = GridWalk: "random walks on the lattice, unbiased for the discrete equation",
        "monte-carlo" = MonteCarlo: "as published: Euler-Maruyama paths with a Brownian-bridge exit test",
    }
}

impl Default for EstimatorKind {
    fn default() -> Self {
        Self::ResidualWalk(ResidualWalk::default())
    }
}

impl EstimatorKind {
    /// Refuses settings out of range.
    ///
    /// # Errors
    /// [`Error::Invalid`].
    pub fn check(&self) -> Result<()> {
        match self {
            Self::ResidualWalk(walk) => walk.check(),
            Self::GridWalk(walk) => walk.check(),
            Self::MonteCarlo(paths) => paths.check(),
        }
    }

    /// The estimator itself.
    pub fn estimator(&self) -> &dyn Estimator {
        match self {
            Self::ResidualWalk(walk) => walk,
            Self::GridWalk(walk) => walk,
            Self::MonteCarlo(paths) => paths,
        }
    }
}

impl Stochastic {
    /// Subdomains whose interfaces an estimator provides.
    pub fn new(subdomains: [usize; 2], seed: u64, estimator: EstimatorKind) -> Self {
        Self { subdomains, seed, estimator, interface: None, line: Robust::default(), parts: None, steps: 0 }
    }

    /// Refuses settings out of range for a lattice.
    ///
    /// # Errors
    /// [`Error::Invalid`].
    pub fn check(&self, lattice: &Lattice<2>) -> Result<()> {
        Decomposition::new(lattice, self.subdomains)?;
        if self.seed > i64::MAX as u64 {
            return Err(Error::invalid("seed", self.seed, "must be a whole number from 0 to 2^63 - 1"));
        }
        self.estimator.check().map_err(|error| error.within("estimator"))?;
        self.interface.as_ref().map_or(Ok(()), |interface| interface.check().map_err(|error| error.within("interface")))
    }
}

impl Parts {
    fn new(lattice: &Lattice<2>, subdomains: [usize; 2]) -> Result<Self, Failure> {
        let decomposition = Decomposition::new(lattice, subdomains)
            .map_err(|_| Failure::Subdomains { subdomains, cells: lattice.cells() })?;
        let patches = decomposition.patches().into_iter().map(|patch| (patch, Robust::default())).collect();
        Ok(Self { lattice: *lattice, points: decomposition.points(), decomposition, patches })
    }
}

impl MeshGenerator for Stochastic {
    fn step(&mut self, equation: &Mmpde, mesh: &Mesh<2>, rho: &[f64], dt: f64) -> Result<Moved, Failure> {
        let lattice = mesh.lattice();
        let parts = match self.parts.take().filter(|parts| parts.lattice == *lattice) {
            Some(parts) => parts,
            None => Parts::new(lattice, self.subdomains)?,
        };
        let parts = self.parts.insert(parts);
        let operator = equation.operator(lattice, rho, dt)?;
        let mut x = mesh.x().to_vec();
        let mut work = move_sides(equation, mesh, rho, dt, &mut x, &mut self.line)?;

        let started = Instant::now();
        let problem = Problem::new(equation, &operator, mesh, rho, dt, &x, self.seed, self.steps);
        self.steps = self.steps.wrapping_add(1);
        let estimator = self.estimator.estimator();
        let sample = self.interface.as_ref().map(|i| i.sample(&parts.decomposition, rho));
        let points = sample.as_ref().unwrap_or(&parts.points);
        let Estimates { points: estimates, guess, work: cost, sweeps } = estimator.estimate(&problem, points)?;
        work += cost;
        let stiffness = problem.stiffness();
        x.copy_from_slice(&guess);
        points.iter().zip(&estimates).for_each(|(&k, estimate)| x[k] = estimate.x);
        if sample.is_some() {
            interpolation::fill(&parts.decomposition, mesh, points, &guess, &mut x);
        }
        let mut interface = summary(mesh, parts.points.len(), &estimates, stiffness)?;
        interface.sweeps = sweeps;
        interface.seconds = started.elapsed().as_secs_f64();

        let (jump, size) = (jump(mesh), size(mesh));
        let solved = parallel::map_mut(&mut parts.patches, |(patch, solver)| {
            operator.solve::<5, 2>(*patch, mesh.x(), &x, jump, solver, size)
        });
        for ((patch, _), solved) in parts.patches.iter().zip(solved) {
            let (inside, cost) = solved?;
            work += cost;
            patch.scatter(lattice, &inside, &mut x, jump);
        }
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

/// The noise of all estimates together; a failure where it is as large as an edge of the mesh.
fn summary(mesh: &Mesh<2>, points: usize, estimates: &[Estimate], stiffness: [f64; 2]) -> Result<Interface, Failure> {
    let squares = estimates.iter().flat_map(|e| e.standard_error).map(|s| s * s);
    let rms = (squares.sum::<f64>() / (2 * estimates.len()).max(1) as f64).sqrt();
    let edge = mesh.shortest_edge();
    if rms > edge {
        return Err(Failure::NoisyInterface { noise: rms, edge, stiffness: stiffness[0].max(stiffness[1]) });
    }
    let known = rms.is_finite() && !estimates.is_empty();
    Ok(Interface {
        points,
        standard_error: known.then_some(rms),
        noise: known.then_some(rms / edge),
        sweeps: 0,
        contraction: None,
        seconds: 0.0,
    })
}
