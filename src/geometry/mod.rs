//! The lattice of computational nodes, the mesh over it, fields on it, and the quality of the mesh.

mod cells;
mod chart;
mod curved;
mod density;
mod determinant;
mod dual;
mod field;
mod folded;
mod grid_map;
mod lattice;
mod line;
mod locate;
mod map;
mod mesh;
mod nodal;
mod patch;
mod plane;
mod points;
mod quality;
mod remap;
mod simple;
mod vector;

pub use cells::{
    Cells, Comparison, cell_areas, cell_jacobians, cell_qualities, compare, interpolate, node_areas, quality,
};
pub use chart::Chart;
pub use density::Density;
pub(crate) use determinant::{cofactors, determinant};
pub use dual::{DualCells, padded};
pub use field::Field;
pub(crate) use field::largest;
pub use folded::check_unfolded;
pub(crate) use folded::mark_folded;
pub use grid_map::GridMap;
pub use lattice::Lattice;
pub(crate) use lattice::{diagonal, strides};
pub use map::{BetweenCurves, FormulaMap, Map};
pub use mesh::Mesh;
pub(crate) use mesh::first_two;
pub(crate) use nodal::{check_finite, check_length, check_positive};
pub use patch::Patch;
pub use points::{Degree, Interpolator, Place};
pub use quality::Quality;
pub use remap::{Remap, remap, remap_all};
pub use simple::check_simple;
pub(crate) use vector::{dot, length};
