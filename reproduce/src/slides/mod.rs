//! S. J. Castillo and F. Izsák, *Efficient discretization of the Laplacian: application to moving boundary problems*
//! (2024).

mod errata;
mod fronts;
mod laplacian;

pub use errata::errata;
pub use fronts::{exact as stefan_exact, slides as stefan_slides};
pub use laplacian::{run as laplacian_table, slides_error};
