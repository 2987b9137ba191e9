//! From a density to a mesh: the moving mesh equation, and the methods to solve it.

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
mod told;
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
pub use whole::{Movable, Whole};

use crate::error::{Failure, Result, Unfit};
use crate::geometry::{Density, Lattice, Mesh};
use crate::kept::Kept;
use crate::kind::kinds;
use crate::work::Work;
use serde::{Deserialize, Serialize};

/// A method to advance the mesh by one time step.
///
/// Every implementation is tested for these laws: the mesh does not change under ρ → cρ, a constant ρ leaves a uniform
/// mesh at rest, and nodes on sides stay exactly on the box.
pub trait MeshGenerator<const D: usize = 2>: Send {
    /// The mesh at t + `dt`, from the mesh at t and the density at its nodes. It calls [`solve`](Self::solve), and
    /// checks what is given and what is returned. In a domain with a chart it solves for the parameters of the nodes;
    /// places around cells that would fold although those of the unit box do not are evened out.
    ///
    /// # Errors
    /// [`Failure::OutOfRange`] for a `dt` or τ that is not finite and positive, and for a prediction, which needs a
    /// [`Mover`](crate::mover::Mover). [`Failure::WrongLength`], [`Failure::NonFinite`] or [`Failure::NotPositive`] for
    /// the density. [`Failure::NotABox`] for a mesh whose sides are not those of the box around it. [`Failure::Folded`]
    /// for a new mesh with a folded cell. Any failure of `solve`.
    ///
    /// # Example
    /// ```
    /// use driftmesh::geometry::{Lattice, Mesh};
    /// use driftmesh::{Failure, meshing::{MeshGenerator, Mmpde, Whole}};
    /// let mesh = Mesh::uniform(Lattice::bounded([4, 4])?, [0.0; 2], [1.0; 2])?;
    /// let refused = Whole::default().step(&Mmpde::default(), &mesh, &vec![0.0; 25].into(), 1e-3);
    /// assert!(matches!(refused, Err(Failure::NotPositive { at, .. }) if *at.node == [0, 0]));
    /// # Ok::<(), driftmesh::Error>(())
    /// ```
    fn step(&mut self, equation: &Mmpde, mesh: &Mesh<D>, rho: &Density, dt: f64) -> Result<Moved<D>, Failure> {
        checked::check_given(equation, mesh, rho, dt)?;
        let places = mesh.parameters();
        if self.moves() {
            checked::check_box(places)?;
        }
        let moved = self.solve(equation, places, rho, dt)?;
        let made = match mesh.chart() {
            Some(_) => Moved { mesh: checked::held_within(mesh, &moved.mesh)?, ..moved },
            None => moved,
        };
        checked::check_made(made)
    }

    /// Solves for the new mesh, without checks. Implementations write this method; callers use [`step`](Self::step).
    ///
    /// # Errors
    /// A [`Failure`] where a system cannot be solved or the settings do not fit the lattice.
    fn solve(&mut self, equation: &Mmpde, mesh: &Mesh<D>, rho: &Density, dt: f64) -> Result<Moved<D>, Failure>;

    /// Whether the method moves the mesh at all; a mesh that stays is not predicted either.
    fn moves(&self) -> bool {
        true
    }

    /// Puts the state that it carries from step to step into a checkpoint. There is none if a step depends on its
    /// arguments alone.
    fn keep(&self, _kept: &mut Kept) {}

    /// Restores the state that [`keep`](Self::keep) stored. `mesh` is any mesh of the run.
    ///
    /// # Errors
    /// [`Unfit`] where the state is missing or does not fit.
    fn resume(&mut self, _mesh: &Mesh<D>, _kept: &Kept) -> Result<(), Unfit> {
        Ok(())
    }
}

/// The result of a step of a mesh generator.
#[derive(Debug, Clone)]
pub struct Moved<const D: usize = 2> {
    /// The mesh at the end of the step.
    pub mesh: Mesh<D>,
    /// The work of the step.
    pub work: Work,
    /// How well the subdomains fit together; none for methods without subdomains.
    pub interface: Option<Interface>,
}

/// What one step tells of the interface values, at which subdomains meet.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Interface {
    /// Nodes at which subdomains meet.
    pub points: usize,
    /// Root mean square of the standard errors of the interface values, over both coordinates of all points. None for
    /// deterministic methods, and for a single sample, which has no spread.
    pub standard_error: Option<f64>,
    /// `standard_error` as a share of the shortest edge of the mesh.
    pub noise: Option<f64>,
    /// Relaxation sweeps in the strips before the walks.
    pub sweeps: usize,
    /// Walks or paths from each point; 0 for deterministic methods, and where strips alone are better than walks.
    pub walks: usize,
    /// Exchanges of data between neighbouring subdomains.
    pub exchanges: usize,
    /// Nodes that a subdomain reads from its neighbours in one exchange; the largest number over the subdomains.
    pub read: usize,
    /// Unknowns of the coarse lattice, whose right-hand sides are gathered from all subdomains in each exchange.
    pub gathered: usize,
    /// Walks that ended so far away that their value had to come from another subdomain.
    pub handed_on: usize,
    /// Convergence of a Schwarz iteration between the subdomains; none for other methods.
    pub contraction: Option<Contraction>,
    /// Seconds spent on the interface values.
    #[serde(skip)]
    pub seconds: f64,
}

/// Convergence of an iteration between subdomains.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Contraction {
    /// Iterations done.
    pub iterations: usize,
    /// Bound on the factor by which an iteration reduces the error, computed from the operator; none for optimised
    /// conditions.
    pub predicted: Option<f64>,
    /// Geometric mean of the factors by which the change of the mesh shrank from iteration to iteration.
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

/// [`Whole`] on a line.
pub type LineWhole = Whole<1>;

/// [`Stochastic`] on a line, where subdomains meet in single nodes.
pub type LineStochastic = Stochastic<EstimatorKind, 1, 3>;

/// [`Schwarz`] on a line.
pub type LineSchwarz = Schwarz<1, 3>;

kinds! {
    /// `mesh.generator` of a study in one dimension.
    LineGeneratorKind {
        "whole" = LineWhole: "one implicit solve of the mesh equation on the whole line",
        "stochastic" = LineStochastic: "walks or strips give the nodes between subdomains, then each is solved by \
                                        itself",
        "schwarz" = LineSchwarz: "overlapping subdomains, solved in parallel and iterated to a tolerance or so many \
                                  times",
        "fixed" = Fixed: "the mesh does not move",
    }
}

impl Default for LineGeneratorKind {
    fn default() -> Self {
        Self::LineWhole(Whole::default())
    }
}

impl LineGeneratorKind {
    /// Refuses settings out of range for a lattice.
    ///
    /// # Errors
    /// [`Error::Invalid`](crate::Error::Invalid).
    pub fn check(&self, lattice: &Lattice<1>) -> Result<()> {
        match self {
            Self::LineWhole(_) | Self::Fixed(_) => Ok(()),
            Self::LineStochastic(stochastic) => stochastic.check(lattice),
            Self::LineSchwarz(schwarz) => schwarz.check(lattice),
        }
    }

    /// Number of subdomains.
    pub fn subdomains(&self) -> usize {
        match self {
            Self::LineWhole(_) | Self::Fixed(_) => 1,
            Self::LineStochastic(stochastic) => stochastic.subdomains[0],
            Self::LineSchwarz(schwarz) => schwarz.subdomains[0],
        }
    }

    /// The generator, ready to step.
    pub fn into_generator(self) -> Box<dyn MeshGenerator<1>> {
        match self {
            Self::LineWhole(whole) => Box::new(whole),
            Self::LineStochastic(stochastic) => Box::new(stochastic),
            Self::LineSchwarz(schwarz) => Box::new(schwarz),
            Self::Fixed(fixed) => Box::new(fixed),
        }
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
            Self::Stochastic(stochastic) => *stochastic.subdomains,
            Self::Schwarz(schwarz) => *schwarz.subdomains,
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
