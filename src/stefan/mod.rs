//! Two phases and the front between them.
//!
//! ```text
//! C_i ∂u_i/∂t = k_i Δu_i in each phase,      u = T_m on the front y = h(x, t),
//! Λ h_t = (1 + h_x²) (k₀ ∂u₀/∂y − k₁ ∂u₁/∂y)
//! ```
//!
//! Phase 1 is the warm one below the front, phase 0 the cold one above ([`Material`]). Nodes stay on fixed columns;
//! their rows follow the front, and the motion enters as a term −w ∂u/∂y. A step of TR-BDF2 advances front and
//! temperatures together, with the optimised Laplacian in both phases; or the front moves explicitly, before the
//! temperatures ([`Front`]).
//!
//! # Source
//! Castillo and Izsák, *Efficient discretization of the Laplacian: application to moving boundary problems* (2024); the
//! treatment of the mesh motion, the filter and the implicit front are this project's.

mod balance;
mod columns;
mod conduct;
mod energy;
mod events;
mod exact;
mod films;
mod front;
mod heat;
mod implicit;
mod look;
mod material;
mod response;
mod solver;

pub use columns::{Columns, LOWER, UPPER};
pub use energy::Energy;
pub use events::{Change, PhaseEvent};
pub use exact::Similarity;
pub use front::{Filter, Method};
pub use material::Material;
pub(crate) use solver::INITIAL;
pub use solver::{Attempt, Front, FrontState, Problem, Side, Stepping, Transfer};
