//! The lattice of computational nodes, the mesh over it, fields on it, and the quality of the mesh.

mod dual;
mod field;
mod folded;
mod lattice;
mod locate;
mod mesh;
mod nodal;
mod patch;
mod quality;
mod remap;
mod simple;

pub use dual::{DualCells, padded};
pub use field::Field;
pub(crate) use field::largest;
pub use folded::check_unfolded;
pub use lattice::Lattice;
pub(crate) use lattice::strides;
pub(crate) use locate::cells_of;
pub use locate::interpolate;
pub use mesh::Mesh;
pub(crate) use nodal::{check_length, check_positive};
pub use patch::Patch;
pub(crate) use quality::quality_and_integral;
pub use quality::{Comparison, Quality, cell_areas, cell_jacobians, cell_qualities, compare, node_areas, quality};
pub use remap::remap;
pub use simple::check_simple;
