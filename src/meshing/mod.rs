//! From a density to a mesh: the mesh equation, and the ways to solve it.

mod checked;
mod decomposition;
mod fixed;
mod mmpde;
mod overlap;
mod relaxation;
mod ring;
mod schwarz;
mod sides;
mod stochastic;
mod whole;

pub use decomposition::{Cut, Decomposition};
pub use fixed::Fixed;
pub use mmpde::{Form, MeshOperator, Mmpde};
pub use relaxation::{Relaxation, STEPS_TO_BEGIN_WITH, Steps};
pub use schwarz::{Schwarz, Transmission};
pub use sides::move_sides;
pub use stochastic::{
    Estimate, Estimates, Estimator, EstimatorKind, GridWalk, Interpolation, MonteCarlo, Placement, Problem,
    ResidualWalk, Stochastic, Strip, Strips,
};
pub use whole::Whole;

use crate::error::{Failure, Result, Unfit};
use crate::geometry::{Lattice, Mesh};
use crate::kept::Kept;
use crate::kind::kinds;
use crate::work::Work;
use serde::{Deserialize, Serialize};

/// A way to advance the mesh by one time step.
///
/// Laws, tested for every implementation: the mesh does not change under ρ → cρ; constant ρ leaves a uniform mesh at
/// rest; side nodes stay exactly on the box.
pub trait MeshGenerator<const D: usize = 2>: Send {
    /// The mesh at t + `dt` from the mesh at t and the density on it, one value a node: [`solve`](Self::solve), with
    /// checks of what it is given and of what it returns.
    ///
    /// # Errors
    /// [`Failure::OutOfRange`] for a `dt` or τ that is not finite and positive, and for a prediction, which takes a
    /// [`Mover`](crate::mover::Mover); [`Failure::WrongLength`], [`Failure::NonFinite`] or [`Failure::NotPositive`] for
    /// the density; [`Failure::NotABox`] for a mesh whose sides are not those of the box around it;
    /// [`Failure::Folded`] for a new mesh with a folded cell; or what `solve` fails with.
    ///
    /// # Example
    /// ```
    /// use driftmesh::geometry::{Lattice, Mesh};
    /// use driftmesh::{Failure, meshing::{MeshGenerator, Mmpde, Whole}};
    /// let mesh = Mesh::uniform(Lattice::bounded([4, 4])?, [0.0; 2], [1.0; 2])?;
    /// let refused = Whole::default().step(&Mmpde::default(), &mesh, &[0.0; 25], 1e-3);
    /// assert!(matches!(refused, Err(Failure::NotPositive { node: [0, 0], .. })));
    /// # Ok::<(), driftmesh::Error>(())
    /// ```
    fn step(&mut self, equation: &Mmpde, mesh: &Mesh<D>, rho: &[f64], dt: f64) -> Result<Moved<D>, Failure> {
        checked::check_given(equation, mesh, rho, dt)?;
        if self.moves() {
            checked::check_box(mesh)?;
        }
        checked::check_made(self.solve(equation, mesh, rho, dt)?)
    }

    /// Solves for that mesh: what an implementation writes, and nobody calls but [`step`](Self::step).
    ///
    /// # Errors
    /// A [`Failure`] where a system cannot be solved or the settings do not fit the lattice.
    fn solve(&mut self, equation: &Mmpde, mesh: &Mesh<D>, rho: &[f64], dt: f64) -> Result<Moved<D>, Failure>;

    /// False for a mesh that stays, which nothing predicts either.
    fn moves(&self) -> bool {
        true
    }

    /// Puts what it carries from step to step into a checkpoint; nothing where steps depend on their arguments alone.
    fn keep(&self, _kept: &mut Kept) {}

    /// Goes on from what [`keep`](Self::keep) left. `mesh` is any mesh of the run.
    ///
    /// # Errors
    /// [`Unfit`] where that is not there, or cannot be.
    fn resume(&mut self, _mesh: &Mesh<D>, _kept: &Kept) -> Result<(), Unfit> {
        Ok(())
    }
}

/// A mesh that was moved.
#[derive(Debug, Clone)]
pub struct Moved<const D: usize = 2> {
    /// The mesh at the end of the step.
    pub mesh: Mesh<D>,
    /// What it cost.
    pub work: Work,
    /// How well the subdomains fit together, where there are any.
    pub interface: Option<Interface>,
}

/// What one step knows about the values at which subdomains meet.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Interface {
    /// Nodes at which subdomains meet.
    pub points: usize,
    /// Root mean square of the standard errors of their values, both coordinates of all points; none where a single
    /// sample has no spread, and none for deterministic methods.
    pub standard_error: Option<f64>,
    /// That over the shortest edge of the mesh.
    pub noise: Option<f64>,
    /// Relaxation sweeps in strips before the walks.
    pub sweeps: usize,
    /// Walks or paths from each point; 0 of deterministic methods, and where strips alone are better than walks.
    pub walks: usize,
    /// Exchanges between neighbours.
    pub exchanges: usize,
    /// Nodes that the subdomain with the most to read reads from its neighbours in one exchange.
    pub read: usize,
    /// Unknowns of a coarse lattice, whose right-hand sides are gathered in an exchange.
    pub gathered: usize,
    /// Walks that ended where another subdomain pays.
    pub handed_on: usize,
    /// How fast an iteration between the subdomains converged.
    pub contraction: Option<Contraction>,
    /// Seconds spent on interface values.
    #[serde(skip)]
    pub seconds: f64,
}

/// Convergence of an iteration between subdomains.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Contraction {
    /// Iterations done.
    pub iterations: usize,
    /// Bound on the factor by which an iteration shrinks the error, from the operator itself; none of optimised
    /// conditions.
    pub predicted: Option<f64>,
    /// Geometric mean of the factors seen between the first and the last change.
    pub observed: f64,
}

kinds! {
    /// `mesh.generator` of a study.
    GeneratorKind {
        "whole" = Whole: "one implicit solve of the mesh equation on the whole domain",
        "stochastic" = Stochastic: "walks or strips give the interfaces between subdomains, then each is solved by \
                                    itself",
        "schwarz" = Schwarz: "overlapping subdomains, solved in parallel and iterated to a tolerance or so many times",
        "fixed" = Fixed: "the mesh does not move",
    }
}

impl Default for GeneratorKind {
    fn default() -> Self {
        Self::Whole(Whole::default())
    }
}

impl GeneratorKind {
    /// Refuses settings out of range for a lattice.
    ///
    /// # Errors
    /// [`Error::Invalid`](crate::Error::Invalid).
    pub fn check(&self, lattice: &Lattice<2>) -> Result<()> {
        match self {
            Self::Whole(_) | Self::Fixed(_) => Ok(()),
            Self::Stochastic(stochastic) => stochastic.check(lattice),
            Self::Schwarz(schwarz) => schwarz.check(lattice),
        }
    }

    /// Subdomains along each axis.
    pub fn subdomains(&self) -> [usize; 2] {
        match self {
            Self::Whole(_) | Self::Fixed(_) => [1, 1],
            Self::Stochastic(stochastic) => stochastic.subdomains,
            Self::Schwarz(schwarz) => schwarz.subdomains,
        }
    }

    /// The generator, ready to step.
    pub fn into_generator(self) -> Box<dyn MeshGenerator> {
        match self {
            Self::Whole(whole) => Box::new(whole),
            Self::Stochastic(stochastic) => Box::new(stochastic),
            Self::Schwarz(schwarz) => Box::new(schwarz),
            Self::Fixed(fixed) => Box::new(fixed),
        }
    }
}

#[cfg(test)]
mod tests;
