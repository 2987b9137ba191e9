//! Meshes as arrays of shape (nx + 1, ny + 1, 2), of a line (nx + 1, 1), the closing nodes of periodic axes included.

use crate::chart::Chart;
use crate::errors::plain;
use crate::threads::{Threads, compute};
use driftmesh::Failure;
use driftmesh::geometry::{self, Cells, Degree, DualCells, Interpolator, Lattice, Mesh};
use driftmesh::study::check_memory;
use numpy::ndarray::{ArrayD, IxDyn};
use numpy::{IntoPyArray, PyArrayDyn, PyReadonlyArray2, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use std::any::Any;
use std::sync::Arc;

/// Bytes of memory for each node while a mesh is moved, about.
const BYTES_PER_NODE: u128 = 1000;

/// An array of a shape that depends on the number of dimensions.
pub type Array<'py> = Bound<'py, PyArrayDyn<f64>>;

/// A mesh as the package hands it over: contiguous nodes and the box; or the places of nodes in the unit square, which
/// is then the box, which of its axes are closed, and the domain that is its image.
#[derive(FromPyObject)]
pub struct Given<'py>(PyReadonlyArrayDyn<'py, f64>, Vec<f64>, Vec<f64>, Vec<bool>, Option<Py<Chart>>);

/// Calls a function for the dimension of a mesh: 1 for a line, 2 in the plane.
macro_rules! in_dimensions {
    ($given:expr, $call:ident($($argument:expr),*)) => {
        match $given.dimensions() {
            1 => $call::<1>($($argument),*),
            _ => $call::<2>($($argument),*),
        }
    };
}
pub(crate) use in_dimensions;

impl Given<'_> {
    pub fn dimensions(&self) -> usize {
        self.3.len()
    }

    pub fn mesh<const D: usize>(&self, py: Python<'_>) -> PyResult<Mesh<D>> {
        let Self(nodes, lower, upper, periodic, chart) = self;
        let cells: Vec<usize> = nodes.shape().iter().take(D).map(|n| n - 1).collect();
        let lattice = Lattice::new(fixed(&cells), fixed(periodic)).map_err(|error| plain(py, error))?;
        let mesh = match chart.as_ref().and_then(|chart| in_dimension(chart.get().chart.clone())) {
            Some(chart) => Mesh::charted(lattice, chart),
            None => Mesh::uniform(lattice, fixed(lower), fixed(upper)),
        };
        let closed = nodes.as_slice()?.as_chunks::<D>().0;
        let placed = mesh.and_then(|mesh| Ok(mesh.placed(opened(&lattice, closed))?));
        placed.map_err(|error| plain(py, error))
    }
}

/// A chart of the plane as one of D dimensions, where that is the same.
fn in_dimension<const D: usize>(chart: Arc<geometry::Chart>) -> Option<Arc<geometry::Chart<D>>> {
    (Box::new(chart) as Box<dyn Any>).downcast().ok().map(|chart| *chart)
}

fn fixed<T: Copy, const D: usize>(values: &[T]) -> [T; D] {
    std::array::from_fn(|d| values[d])
}

/// Values without the closing nodes of periodic axes.
fn opened<T: Copy, const D: usize>(lattice: &Lattice<D>, closed: &[T]) -> Vec<T> {
    let size = lattice.cells().map(|n| n + 1);
    let place = |node: [usize; D]| (0..D).fold(0, |place, d| place * size[d] + node[d]);
    (0..lattice.len()).map(|k| closed[place(lattice.node(k))]).collect()
}

/// Nodal values of a mesh from an array of the same shape.
pub fn nodal<const D: usize>(lattice: &Lattice<D>, values: &PyReadonlyArrayDyn<'_, f64>) -> PyResult<Vec<f64>> {
    Ok(opened(lattice, values.as_slice()?))
}

/// An array of shape cells + 1 from nodal values.
pub fn array<'py, const D: usize>(py: Python<'py>, lattice: &Lattice<D>, values: &[f64]) -> PyResult<Array<'py>> {
    shaped(py, &lattice.cells().map(|n| n + 1), lattice.closed(values).into_owned())
}

/// The nodes of a mesh; their places in the unit square where it lies in a domain that is no box.
pub fn nodes<'py, const D: usize>(py: Python<'py>, mesh: &Mesh<D>) -> PyResult<Array<'py>> {
    let shape: Vec<usize> = mesh.lattice().cells().into_iter().map(|n| n + 1).chain([D]).collect();
    shaped(py, &shape, mesh.parameters().closed().into_owned().into_flattened())
}

pub fn shaped<'py>(py: Python<'py>, shape: &[usize], values: Vec<f64>) -> PyResult<Array<'py>> {
    let array = ArrayD::from_shape_vec(IxDyn(shape), values);
    Ok(array.map_err(|error| PyValueError::new_err(error.to_string()))?.into_pyarray(py))
}

/// The nodes of the uniform mesh.
#[pyfunction]
pub fn uniform<'py>(
    py: Python<'py>,
    cells: Vec<usize>,
    lower: Vec<f64>,
    upper: Vec<f64>,
    periodic: Vec<bool>,
) -> PyResult<Array<'py>> {
    fn equal<'py, const D: usize>(
        py: Python<'py>,
        cells: &[usize],
        [lower, upper]: [&[f64]; 2],
        periodic: &[bool],
    ) -> PyResult<Array<'py>> {
        let mesh = Lattice::new(fixed(cells), fixed(periodic)).and_then(|lattice: Lattice<D>| {
            check_memory(lattice.len() as u128, BYTES_PER_NODE, cells)?;
            Mesh::uniform(lattice, fixed(lower), fixed(upper))
        });
        nodes(py, &mesh.map_err(|error| plain(py, error))?)
    }
    match cells.len() {
        1 => equal::<1>(py, &cells, [&lower, &upper], &periodic),
        _ => equal::<2>(py, &cells, [&lower, &upper], &periodic),
    }
}

/// `q_max`, `q_mean`, `min_scaled_jacobian` and `equidistribution` of a mesh under a density.
#[pyfunction]
pub fn quality(py: Python<'_>, mesh: Given<'_>, density: PyReadonlyArrayDyn<'_, f64>) -> PyResult<[f64; 4]> {
    fn of<const D: usize>(py: Python<'_>, mesh: &Given<'_>, density: &PyReadonlyArrayDyn<'_, f64>) -> PyResult<[f64; 4]>
    where
        Mesh<D>: Cells<D>,
    {
        let mesh = mesh.mesh::<D>(py)?;
        let rho = nodal(mesh.lattice(), density)?;
        let q = compute(py, None, move || geometry::quality(&mesh, &rho))?.map_err(|failure| plain(py, failure))?;
        Ok([q.q_max, q.q_mean, q.min_scaled_jacobian, q.equidistribution])
    }
    in_dimensions!(mesh, of(py, &mesh, &density))
}

/// Areas of the dual cells; closing nodes of periodic axes, which are counted at the other end, have none.
#[pyfunction]
pub fn areas<'py>(py: Python<'py>, mesh: Given<'py>) -> PyResult<Array<'py>> {
    fn of<'py, const D: usize>(py: Python<'py>, mesh: &Given<'py>) -> PyResult<Array<'py>>
    where
        Mesh<D>: Cells<D>,
    {
        let mesh = mesh.mesh::<D>(py)?;
        let (nodes, size) = (mesh.lattice().nodes(), mesh.lattice().cells().map(|n| n + 1));
        let open = ArrayD::from_shape_vec(IxDyn(&nodes), DualCells::new(&mesh).areas().to_vec());
        let open = open.map_err(|error| PyValueError::new_err(error.to_string()))?;
        let closed = ArrayD::from_shape_fn(IxDyn(&size), |place| open.get(place).copied().unwrap_or(0.0));
        Ok(closed.into_pyarray(py))
    }
    in_dimensions!(mesh, of(py, &mesh))
}

/// A nodal field on another mesh.
#[pyfunction]
#[pyo3(signature = (values, old, new, how, threads))]
pub fn transfer<'py>(
    py: Python<'py>,
    values: PyReadonlyArrayDyn<'py, f64>,
    old: Given<'py>,
    new: Given<'py>,
    how: (u8, Option<[f64; 2]>),
    threads: Threads,
) -> PyResult<Array<'py>> {
    fn carried<'py, const D: usize>(
        py: Python<'py>,
        values: &PyReadonlyArrayDyn<'py, f64>,
        [old, new]: [&Given<'py>; 2],
        (order, bounds): (u8, Option<[f64; 2]>),
        threads: Threads,
    ) -> PyResult<Array<'py>>
    where
        Mesh<D>: Cells<D>,
    {
        let (old, new) = (old.mesh::<D>(py)?, new.mesh::<D>(py)?);
        let lattice = *old.lattice();
        let values = nodal(&lattice, values)?;
        let carried = compute(py, threads, move || {
            // 1 stands for interpolation
            if order > 1 {
                let how = if order == 3 { geometry::Remap::Parabolic(bounds) } else { geometry::Remap::Limited };
                return Ok(geometry::remap_all(&old, &[&values], &new, how)?.swap_remove(0));
            }
            geometry::check_unfolded(&old)?;
            geometry::check_unfolded(&new)?;
            Ok::<_, Failure>(geometry::interpolate(&old, &values, &new))
        })?;
        array(py, &lattice, &carried.map_err(|failure| plain(py, failure))?)
    }
    in_dimensions!(old, carried(py, &values, [&old, &new], how, threads))
}

/// Nodal fields, one a row, at points, one a row; nothing but its index where a point lies outside.
#[pyfunction]
pub fn interpolate<'py>(
    py: Python<'py>,
    mesh: Given<'py>,
    fields: PyReadonlyArray2<'py, f64>,
    points: PyReadonlyArray2<'py, f64>,
    cubic: bool,
) -> PyResult<(Option<Array<'py>>, usize)> {
    fn at<'py, const D: usize>(
        py: Python<'py>,
        mesh: &Given<'py>,
        fields: &PyReadonlyArray2<'py, f64>,
        points: &PyReadonlyArray2<'py, f64>,
        degree: Degree,
    ) -> PyResult<(Option<Array<'py>>, usize)>
    where
        Mesh<D>: Cells<D>,
    {
        let mesh = mesh.mesh::<D>(py)?;
        let ([count, size], points) = ([fields.shape()[0], fields.shape()[1]], points.as_slice()?.as_chunks::<D>().0);
        let fields: Vec<Vec<f64>> =
            fields.as_slice()?.chunks_exact(size).map(|field| opened(mesh.lattice(), field)).collect();
        let (points, number) = (points.to_vec(), points.len());
        let found = compute(py, None, move || {
            geometry::check_unfolded(&mesh)?;
            Ok::<_, Failure>(
                Interpolator::new(&mesh, &points, degree)
                    .map(|at| fields.iter().flat_map(|field| at.values(field)).collect::<Vec<f64>>()),
            )
        })?;
        match found.map_err(|failure| plain(py, failure))? {
            Ok(values) => Ok((Some(shaped(py, &[count, number], values)?), 0)),
            Err(outside) => Ok((None, outside)),
        }
    }
    let degree = if cubic { Degree::Cubic } else { Degree::Linear };
    in_dimensions!(mesh, at(py, &mesh, &fields, &points, degree))
}
