//! Moving meshes for time-dependent partial differential equations.

pub mod density;
pub mod error;
pub mod geometry;
mod kind;
pub mod meshing;
pub mod numerics;
mod parallel;
pub mod physics;
pub mod simulation;
pub mod study;
mod work;

pub use error::{Error, Failure, Result};
pub use work::Work;
