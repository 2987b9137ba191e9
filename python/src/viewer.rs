//! The viewer of the report, for notebooks.

use crate::errors::plain;
use driftmesh::report::{self, Frame};
use numpy::{PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use std::path::PathBuf;

/// A mesh by time, x and y of the shape of the mesh, and fields by name.
type Shown<'py> =
    (f64, PyReadonlyArrayDyn<'py, f64>, PyReadonlyArrayDyn<'py, f64>, Vec<(String, PyReadonlyArrayDyn<'py, f64>)>);

/// What the viewer shows of a run, as JSON; nothing where it has no frames yet.
#[pyfunction]
pub fn viewer_data(py: Python<'_>, directory: PathBuf) -> PyResult<Option<String>> {
    py.detach(|| report::viewer_data(&directory)).map_err(|error| plain(py, error))
}

/// The same of meshes of one shape with the same fields, in a box of these corners or in the smallest one.
#[pyfunction]
pub fn viewer_data_of(
    py: Python<'_>,
    frames: Vec<Shown<'_>>,
    corners: Option<[[f64; 2]; 2]>,
    periodic: [bool; 2],
) -> PyResult<Option<String>> {
    let frame = |(t, x, y, fields): &Shown<'_>| {
        let n = |axis: usize| x.shape().get(axis).map_or(0, |n| n - 1);
        let nodes = x.as_slice()?.iter().zip(y.as_slice()?).map(|(x, y)| [*x, *y]).collect();
        let fields = fields.iter().map(|(name, values)| Ok((name.clone(), values.as_slice()?.to_vec())));
        Ok(Frame {
            t: *t,
            cells: [n(0), n(1)],
            x: nodes,
            fields: fields.collect::<PyResult<_>>()?,
            cell_fields: Vec::new(),
            cuts: Default::default(),
        })
    };
    let frames = frames.iter().map(frame).collect::<PyResult<Vec<Frame>>>()?;
    Ok(py.detach(|| report::viewer_data_of(&frames, corners, periodic)))
}

/// The page of the viewer of a mesh or a line whose frames are numbered by `clock`, and the module of its widget.
#[pyfunction]
pub fn viewer_files(line: bool, clock: &str) -> (String, &'static str) {
    let clock = ["t", "iteration"].into_iter().find(|known| *known == clock).unwrap_or("");
    (report::viewer_page(line, clock), report::WIDGET_MODULE)
}
