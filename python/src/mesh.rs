//! Meshes as arrays of shape (nx + 1, ny + 1, 2), the closing nodes of periodic axes included.

use crate::errors::plain;
use crate::threads::compute;
use driftmesh::Failure;
use driftmesh::geometry::{self, DualCells, Lattice, Mesh};
use driftmesh::study::check_memory;
use numpy::ndarray::{Array2, Array3};
use numpy::{IntoPyArray, PyArray2, PyArray3, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// Memory for each node while a mesh is moved, about.
const BYTES_PER_NODE: u128 = 1000;

/// A mesh as the package hands it over: contiguous nodes and the box.
#[derive(FromPyObject)]
pub struct Given<'py>(PyReadonlyArray3<'py, f64>, [f64; 2], [f64; 2], [bool; 2]);

impl Given<'_> {
    pub fn mesh(&self, py: Python<'_>) -> PyResult<Mesh<2>> {
        let Self(nodes, lower, upper, periodic) = self;
        let [n, m, _] = *nodes.shape() else { unreachable!("an array of three axes") };
        let lattice = Lattice::new([n - 1, m - 1], *periodic).map_err(|error| plain(py, error))?;
        let mesh = Mesh::uniform(lattice, *lower, *upper).map_err(|error| plain(py, error))?;
        let closed = nodes.as_slice()?.as_chunks::<2>().0;
        mesh.moved(opened(&lattice, closed)).map_err(|error| plain(py, error))
    }
}

/// Values without the closing nodes of periodic axes.
fn opened<T: Copy>(lattice: &Lattice<2>, closed: &[T]) -> Vec<T> {
    let ([n, m], row) = (lattice.nodes(), lattice.cells()[1] + 1);
    closed.chunks_exact(row).take(n).flat_map(|row| &row[..m]).copied().collect()
}

/// Nodal values of a mesh from an array of the same shape.
pub fn nodal(mesh: &Mesh<2>, values: &PyReadonlyArray2<'_, f64>) -> PyResult<Vec<f64>> {
    Ok(opened(mesh.lattice(), values.as_slice()?))
}

/// An array of shape cells + 1 from nodal values.
pub fn array<'py>(py: Python<'py>, mesh: &Mesh<2>, values: &[f64]) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let [n, m] = mesh.lattice().cells().map(|n| n + 1);
    let array = Array2::from_shape_vec((n, m), mesh.lattice().closed(values).into_owned());
    Ok(array.map_err(|error| PyValueError::new_err(error.to_string()))?.into_pyarray(py))
}

/// The nodes of a mesh.
pub fn nodes<'py>(py: Python<'py>, mesh: &Mesh<2>) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let [n, m] = mesh.lattice().cells().map(|n| n + 1);
    let array = Array3::from_shape_vec((n, m, 2), mesh.closed().into_owned().into_flattened());
    Ok(array.map_err(|error| PyValueError::new_err(error.to_string()))?.into_pyarray(py))
}

/// The nodes of the uniform mesh.
#[pyfunction]
pub fn uniform<'py>(
    py: Python<'py>,
    cells: [usize; 2],
    lower: [f64; 2],
    upper: [f64; 2],
    periodic: [bool; 2],
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let mesh = Lattice::new(cells, periodic).and_then(|lattice| {
        check_memory(lattice.len() as u128, BYTES_PER_NODE, &cells)?;
        Mesh::uniform(lattice, lower, upper)
    });
    nodes(py, &mesh.map_err(|error| plain(py, error))?)
}

/// `q_max`, `q_mean`, `min_scaled_jacobian` and `equidistribution` of a mesh under a density.
#[pyfunction]
pub fn quality(py: Python<'_>, mesh: Given<'_>, density: PyReadonlyArray2<'_, f64>) -> PyResult<[f64; 4]> {
    let mesh = mesh.mesh(py)?;
    let rho = nodal(&mesh, &density)?;
    let q = compute(py, move || geometry::quality(&mesh, &rho))?.map_err(|failure| plain(py, failure))?;
    Ok([q.q_max, q.q_mean, q.min_scaled_jacobian, q.equidistribution])
}

/// Areas of the dual cells; closing nodes of periodic axes, which are counted at the other end, have none.
#[pyfunction]
pub fn areas<'py>(py: Python<'py>, mesh: Given<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let mesh = mesh.mesh(py)?;
    let [n, m] = mesh.lattice().nodes();
    let open = Array2::from_shape_vec((n, m), DualCells::new(&mesh).areas().to_vec());
    let open = open.map_err(|error| PyValueError::new_err(error.to_string()))?;
    let [rows, columns] = mesh.lattice().cells().map(|n| n + 1);
    let closed = Array2::from_shape_fn((rows, columns), |place| open.get(place).copied().unwrap_or(0.0));
    Ok(closed.into_pyarray(py))
}

/// A nodal field on another mesh.
#[pyfunction]
pub fn transfer<'py>(
    py: Python<'py>,
    values: PyReadonlyArray2<'py, f64>,
    old: Given<'py>,
    new: Given<'py>,
    conservative: bool,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let (old, new) = (old.mesh(py)?, new.mesh(py)?);
    let values = nodal(&old, &values)?;
    let carried = compute(py, move || {
        let carried = if conservative {
            geometry::remap(&old, &values, &new)?
        } else {
            geometry::check_unfolded(&old)?;
            geometry::check_unfolded(&new)?;
            geometry::interpolate(&old, &values, &new)
        };
        Ok::<_, Failure>((new, carried))
    })?;
    let (new, carried) = carried.map_err(|failure| plain(py, failure))?;
    array(py, &new, &carried)
}
