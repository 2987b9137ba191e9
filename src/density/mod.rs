//! The mesh density ρ: large where the mesh should be fine.
//!
//! Every density is positive and finite, and only its ratios matter: ρ and cρ give the same mesh.

mod arclength;
mod smoothing;

pub use arclength::{Arclength, Strength};
pub use smoothing::smooth;

use crate::error::{Failure, Result};
use crate::geometry::Mesh;
use crate::kind::kinds;

/// Where a mesh should be fine, decided from the solution on the mesh it has.
pub trait Monitor: Send {
    /// ρ at every node from one value of u a node, both in lattice order.
    ///
    /// # Errors
    /// [`Failure::NonFinite`] names the first node where ρ is not a finite number.
    fn density(&self, mesh: &Mesh<2>, u: &[f64]) -> Result<Vec<f64>, Failure>;
}

kinds! {
    /// `[monitor]` of a study.
    MonitorKind {
        "arclength" = Arclength: "rho = sqrt(1 + alpha |grad u|^2), smoothed",
    }
}
