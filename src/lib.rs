//! Moving meshes for time-dependent partial differential equations.

pub mod error;
pub mod geometry;
pub mod numerics;

pub use error::{Error, Failure, Result};
