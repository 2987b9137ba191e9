use crate::errors::plain;
use pyo3::prelude::*;
use std::ffi::OsString;
use std::path::PathBuf;

/// Runs the program `driftmesh` with a command line, and returns its exit status.
#[pyfunction]
pub fn program(py: Python<'_>, words: Vec<OsString>) -> u8 {
    py.detach(|| driftmesh_cli::program(words))
}

/// Writes the example studies into a directory.
#[pyfunction]
pub fn write_examples(py: Python<'_>, directory: PathBuf) -> PyResult<Vec<PathBuf>> {
    driftmesh::study::write_examples(&directory).map_err(|error| plain(py, error))
}
