//! From a density to a mesh: the mesh equation, and the ways to solve it.

mod fixed;
mod mmpde;
mod sides;
mod whole;

pub use fixed::Fixed;
pub use mmpde::{MeshOperator, Mmpde};
pub use sides::move_sides;
pub use whole::Whole;

use crate::error::{Failure, Result};
use crate::geometry::Mesh;
use crate::kind::kinds;
use crate::work::Work;

/// A way to advance the mesh by one time step.
///
/// Laws, tested for every implementation: the mesh does not change under ρ → cρ; constant ρ leaves a uniform mesh at
/// rest; side nodes stay exactly on the box.
pub trait MeshGenerator: Send {
    /// The mesh at t + `dt` from the mesh at t and the density on it, one value a node.
    ///
    /// # Errors
    /// A [`Failure`] where a system cannot be solved or the arrays do not fit.
    fn step(&mut self, equation: &Mmpde, mesh: &Mesh<2>, rho: &[f64], dt: f64) -> Result<(Mesh<2>, Work), Failure>;
}

kinds! {
    /// `mesh.generator` of a study.
    GeneratorKind {
        "whole" = Whole: "one implicit solve of the mesh equation on the whole domain",
        "fixed" = Fixed: "the mesh does not move",
    }
}

impl Default for GeneratorKind {
    fn default() -> Self {
        Self::Whole(Whole::default())
    }
}

impl GeneratorKind {
    /// The generator, ready to step.
    pub fn into_generator(self) -> Box<dyn MeshGenerator> {
        match self {
            Self::Whole(whole) => Box::new(whole),
            Self::Fixed(fixed) => Box::new(fixed),
        }
    }
}

#[cfg(test)]
mod tests;
