//! Two phases and the front between them.
//!
//! ```text
//! ∂u_i/∂t = D_i Δu_i in each phase,   u = 0 on the front y = h(x, t),   h_t = L (1 + h_x²) (D₀ ∂u₀/∂y − D₁ ∂u₁/∂y)
//! ```
//!
//! Phase 1 is the warm one below the front, phase 0 the cold one above. Nodes stay on fixed columns; their rows follow
//! the front, and the motion enters as a term −w ∂u/∂y on the new mesh. Each step moves the front, then solves the heat
//! equation in both phases by implicit Euler with the optimised Laplacian ([`Front`]).
//!
//! # Source
//! Castillo and Izsák, *Efficient discretization of the Laplacian: application to moving boundary problems* (2024); the
//! treatment of the mesh motion, the filter and the implicit front are this project's.

mod columns;
mod energy;
mod exact;
mod front;
mod heat;
mod implicit;
mod solver;

pub use columns::{Columns, LOWER, UPPER};
pub use energy::Energy;
pub use exact::Similarity;
pub use front::{Filter, Method};
pub(crate) use solver::INITIAL;
pub use solver::{Front, FrontState, Problem, Sides, Stepping, Transfer};
