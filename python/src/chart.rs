//! Domains that are not boxes, as the package hands them over.

use crate::errors::plain;
use crate::mesh::{Array, shaped};
use driftmesh::formula::Formula;
use driftmesh::geometry::{self, FormulaMap};
use driftmesh::study::read_mesh;
use driftmesh::{Error, Result};
use numpy::{PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use std::path::PathBuf;
use std::sync::Arc;

/// What a domain is the image of.
#[derive(Clone, PartialEq)]
enum Shape {
    Formulas([String; 2]),
    Nodes([usize; 2], Vec<[f64; 2]>),
}

/// A domain that is the image of the unit square.
#[pyclass(frozen, eq, module = "driftmesh._driftmesh")]
#[derive(Clone)]
pub struct Chart {
    shape: Shape,
    closed: [bool; 2],
    pub chart: Arc<geometry::Chart>,
}

impl PartialEq for Chart {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.chart, &other.chart) || (&self.shape, self.closed) == (&other.shape, other.closed)
    }
}

impl Chart {
    fn of(shape: Shape, closed: [bool; 2]) -> Result<Self> {
        let chart = match &shape {
            Shape::Formulas(texts) => {
                let [x, y] = ["x", "y"].map(|name| name.to_string());
                let read = |key: String, text: &str| {
                    Formula::parse(text, &["s", "r"]).map_err(|mistake| Error::Formula {
                        key,
                        text: text.into(),
                        at: mistake.at,
                        message: mistake.message,
                        help: mistake.help,
                    })
                };
                let map = FormulaMap::new([read(x, &texts[0])?, read(y, &texts[1])?])?;
                Arc::new(geometry::Chart::oriented(map, closed, true)?)
            }
            Shape::Nodes(nodes, x) => geometry::Chart::through(*nodes, x.clone(), closed)?,
        };
        Ok(Self { shape, closed, chart })
    }
}

#[pymethods]
impl Chart {
    /// The image of the unit square (s, r) by two formulas.
    #[staticmethod]
    fn formulas(py: Python<'_>, x: String, y: String, closed: [bool; 2]) -> PyResult<Self> {
        Self::of(Shape::Formulas([x, y]), closed).map_err(|error| plain(py, error))
    }

    /// The domain of a structured mesh, by its nodes of shape (nx + 1, ny + 1, 2).
    #[staticmethod]
    fn nodes(py: Python<'_>, nodes: PyReadonlyArrayDyn<'_, f64>, closed: [bool; 2]) -> PyResult<Self> {
        let (shape, x) = ([nodes.shape()[0], nodes.shape()[1]], nodes.as_slice()?.as_chunks::<2>().0.to_vec());
        Self::of(Shape::Nodes(shape, x), closed).map_err(|error| plain(py, error))
    }

    /// Positions from places in the unit square, of any shape whose last axis has two entries.
    fn positions<'py>(&self, py: Python<'py>, places: PyReadonlyArrayDyn<'py, f64>) -> PyResult<Array<'py>> {
        let places_of = places.as_slice()?.as_chunks::<2>().0;
        let x: Vec<[f64; 2]> = places_of.iter().map(|place| self.chart.at(*place)).collect();
        shaped(py, places.shape(), x.into_flattened())
    }

    /// Lower and upper corner of the box around it.
    fn ends(&self) -> ([f64; 2], [f64; 2]) {
        self.chart.ends()
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let kind = py.get_type::<Self>();
        match &self.shape {
            Shape::Formulas([x, y]) => Ok((kind.getattr("formulas")?, (x, y, self.closed).into_pyobject(py)?)),
            Shape::Nodes(nodes, x) => {
                let array = shaped(py, &[nodes[0], nodes[1], 2], x.clone().into_flattened())?;
                Ok((kind.getattr("nodes")?, (array, self.closed).into_pyobject(py)?))
            }
        }
    }
}

/// The nodes in a file with a structured mesh, of shape (nx + 1, ny + 1, 2).
#[pyfunction]
pub fn read_nodes(py: Python<'_>, path: PathBuf) -> PyResult<Array<'_>> {
    let given = read_mesh(&path).map_err(|error| plain(py, error))?;
    shaped(py, &[given.nodes[0], given.nodes[1], 2], given.x.into_flattened())
}
