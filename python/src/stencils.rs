use crate::errors::plain;
use crate::mesh::Given;
use crate::threads::compute;
use driftmesh::laplacian::{self, Laplacian, Polynomials, Scaling};
use numpy::{IntoPyArray, PyArray1};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// Rows of a matrix: row, column, weight on u, weight on Δu of each entry; then node and condition number where the
/// mesh hardly determines a Laplacian.
type Entries<'py> = (
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
    Vec<([usize; 2], f64)>,
);

/// The weights of the discrete Laplacian of a mesh of any shape; nodes without the closing ones of periodic axes.
#[pyfunction]
pub fn stencils<'py>(
    py: Python<'py>,
    mesh: Given<'py>,
    kind: &str,
    polynomials: Option<&str>,
    scaling: Option<&str>,
) -> PyResult<Entries<'py>> {
    let raise = |error| plain(py, error);
    let polynomials = polynomials.map(|name| match name {
        "printed" => Ok(Polynomials::Printed),
        "harmonic" => Ok(Polynomials::Harmonic),
        _ => Err(PyValueError::new_err(format!("`polynomials` is \"{name}\", but must be printed or harmonic"))),
    });
    let scaling = scaling.map(|name| match name {
        "none" => Ok(Scaling::None),
        "global" => Ok(Scaling::Global),
        "local" => Ok(Scaling::Local),
        _ => Err(PyValueError::new_err(format!("`scaling` is \"{name}\", but must be none, global or local"))),
    });
    let laplacian = Laplacian::named(kind, polynomials.transpose()?, scaling.transpose()?).map_err(raise)?;
    let mesh = mesh.mesh::<2>(py)?;
    let entries = compute(py, None, move || {
        let stencils = laplacian::stencils(&mesh, laplacian)?;
        let (mut rows, mut columns, mut a, mut b) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for k in 0..stencils.patch().len() {
            for (column, on_u, on_source) in stencils.row(k).into_iter().flatten() {
                rows.push(stencils.index(k) as i64);
                columns.push(column as i64);
                a.push(on_u);
                b.push(on_source);
            }
        }
        let near = stencils.near_degenerate().iter().map(|near| (near.node, near.condition)).collect();
        Ok::<_, driftmesh::Error>((rows, columns, a, b, near))
    })?;
    let (rows, columns, a, b, near) = entries.map_err(raise)?;
    Ok((rows.into_pyarray(py), columns.into_pyarray(py), a.into_pyarray(py), b.into_pyarray(py), near))
}
