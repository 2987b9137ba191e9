//! What is solved on the moving mesh.

mod burgers;
mod curvilinear;

pub use burgers::{Burgers, Convection};

use crate::error::{Failure, Result};
use crate::geometry::{Field, Mesh};
use crate::kind::kinds;
use crate::work::Work;

/// One time step over a mesh that moves.
#[derive(Debug, Clone, Copy)]
pub struct Motion<'a> {
    /// Time at the start.
    pub t: f64,
    /// Length of the step.
    pub dt: f64,
    /// The mesh at t.
    pub old: &'a Mesh<2>,
    /// The mesh at t + dt.
    pub new: &'a Mesh<2>,
}

/// A partial differential equation that can be advanced on a moving mesh.
pub trait Physics: Send {
    /// Names of the unknowns.
    fn unknowns(&self) -> Vec<String>;

    /// The solution at time t on a mesh.
    fn initial(&self, t: f64, mesh: &Mesh<2>) -> Field;

    /// The solution at t + dt on the new mesh from the one at t on the old mesh.
    ///
    /// # Errors
    /// A [`Failure`] where the step cannot be solved; [`Failure::NonFinite`] where its result is not finite.
    fn step(&mut self, motion: Motion<'_>, u: &Field) -> Result<(Field, Work), Failure>;

    /// ∇ of the first unknown at all nodes, where it is known exactly.
    fn gradient(&self, _t: f64, _mesh: &Mesh<2>) -> Option<Vec<[f64; 2]>> {
        None
    }

    /// The exact solution where it is known.
    fn exact(&self, _t: f64, _mesh: &Mesh<2>) -> Option<Field> {
        None
    }
}

kinds! {
    /// `[pde]` of a study.
    PdeKind {
        "burgers" = Burgers: "u_t + u u_x + u u_y = nu (u_xx + u_yy), an oblique front with exact solution",
    }
}

impl PdeKind {
    /// Refuses settings out of range.
    ///
    /// # Errors
    /// [`Error::Invalid`](crate::Error::Invalid).
    pub fn check(&self) -> Result<()> {
        match self {
            Self::Burgers(burgers) => burgers.check(),
        }
    }

    /// The equation, ready to step.
    pub fn into_physics(self) -> Box<dyn Physics> {
        match self {
            Self::Burgers(burgers) => Box::new(burgers),
        }
    }
}

/// Refuses values that are not finite, one unknown a node.
fn check_finite(what: &'static str, mesh: &Mesh<2>, values: &[f64]) -> Result<(), Failure> {
    match values.iter().position(|v| !v.is_finite()) {
        None => Ok(()),
        Some(k) => Err(Failure::NonFinite { what, value: values[k], node: mesh.lattice().node(k), x: mesh.x()[k] }),
    }
}
