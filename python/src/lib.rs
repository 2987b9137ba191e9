//! The native half of the Python package.
use pyo3::prelude::*;

#[pymodule]
fn _driftmesh(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add("__version__", env!("CARGO_PKG_VERSION"))
}
