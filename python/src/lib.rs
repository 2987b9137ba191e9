//! The native half of the Python package: arrays to library types and back, errors to exceptions.
//!
//! What it exports is private to the package; `driftmesh/*.py` checks shapes and values and gives them names.

mod chart;
mod errors;
mod generator;
mod line;
mod memory;
mod mesh;
mod mover;
mod program;
mod stencils;
mod study;
mod threads;

use pyo3::prelude::*;

#[pymodule]
mod _driftmesh {
    #[pymodule_export]
    use super::chart::{Chart, read_nodes};
    #[pymodule_export]
    use super::generator::Generator;
    #[pymodule_export]
    use super::line::{equidistribute, schwarz};
    #[pymodule_export]
    use super::mesh::{areas, interpolate, quality, transfer, uniform};
    #[pymodule_export]
    use super::program::{program, write_examples};
    #[pymodule_export]
    use super::stencils::{edges, poisson, quarters};
    #[pymodule_export]
    use super::study::{check, run};
    #[pymodule_export]
    const VERSION: &str = env!("CARGO_PKG_VERSION");
}
