//! Laplacians and what holds on the sides as entries of matrices.

use crate::errors::plain;
use crate::mesh::{Array, Given, array, nodal, shaped};
use crate::threads::compute;
use driftmesh::Error;
use driftmesh::geometry::{Mesh, node_areas};
use driftmesh::laplacian::{
    self, Entry, Laplacian, Poisson, Polynomials, Scaling, Stencils, diffusion_by, edge_places,
};
use numpy::{IntoPyArray, PyArray1, PyReadonlyArrayDyn};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// Row, column, weight on u and weight on Δu of each entry; then node and condition number where the mesh hardly
/// determines a Laplacian.
type Entries<'py> = (
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
    Vec<([usize; 2], f64)>,
);

/// A kind of Laplacian, with the polynomials and the scaling of "published".
type Named<'a> = (&'a str, Option<&'a str>, Option<&'a str>);

fn named(py: Python<'_>, (kind, polynomials, scaling): Named<'_>) -> PyResult<Laplacian> {
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
    Laplacian::named(kind, polynomials.transpose()?, scaling.transpose()?).map_err(|error| plain(py, error))
}

fn listed<'py>(py: Python<'py>, entries: &[Entry], stencils: &Stencils) -> Entries<'py> {
    let index = |of: fn(&Entry) -> usize| entries.iter().map(|entry| of(entry) as i64).collect::<Vec<_>>();
    let weight = |of: fn(&Entry) -> f64| entries.iter().map(of).collect::<Vec<_>>();
    (
        index(|entry| entry.row).into_pyarray(py),
        index(|entry| entry.column).into_pyarray(py),
        weight(|entry| entry.on_u).into_pyarray(py),
        weight(|entry| entry.on_source).into_pyarray(py),
        stencils.near_degenerate().iter().map(|near| (near.node, near.condition)).collect(),
    )
}

/// The places at which [`poisson`] wants D where that is a function, eight along each edge, shape (edges, 8, 2).
#[pyfunction]
pub fn edges<'py>(py: Python<'py>, mesh: Given<'py>, kind: Named<'_>) -> PyResult<Array<'py>> {
    let (mesh, laplacian) = (mesh.mesh::<2>(py)?, named(py, kind)?);
    let places = compute(py, None, move || edge_places(&mesh, &laplacian::stencils(&mesh, laplacian)?))?;
    let places = places.map_err(|error| plain(py, error))?;
    shaped(py, &[places.len() / 8, 8, 2], places.into_flattened())
}

/// The equations of a mesh of any shape, A u = B f + g, or with no sides said the rows of nodes inside alone; nodes
/// without the closing ones of periodic axes. `diffusivity` has D at the nodes, and at the places of [`edges`] where it
/// is a function; `sides` has what the fluxes take of u, and which sides have fluxes.
#[pyfunction]
pub fn poisson<'py>(
    py: Python<'py>,
    mesh: Given<'py>,
    kind: Named<'_>,
    diffusivity: Option<(PyReadonlyArrayDyn<'py, f64>, Option<PyReadonlyArrayDyn<'py, f64>>)>,
    sides: Option<(PyReadonlyArrayDyn<'py, f64>, [[bool; 2]; 2])>,
) -> PyResult<Entries<'py>> {
    let (mesh, laplacian) = (mesh.mesh::<2>(py)?, named(py, kind)?);
    let lattice = *mesh.lattice();
    let diffusivity = match &diffusivity {
        None => None,
        Some((nodes, None)) => Some((nodal(&lattice, nodes)?, None)),
        Some((nodes, Some(along))) => Some((nodal(&lattice, nodes)?, Some(along.as_slice()?.to_vec()))),
    };
    let sides = match &sides {
        None => None,
        Some((robin, neumann)) => Some((nodal(&lattice, robin)?, *neumann)),
    };
    let found = compute(py, None, move || {
        let stencils = laplacian::stencils(&mesh, laplacian)?;
        let weighted = match &diffusivity {
            None => None,
            Some((_, Some(along))) => Some(diffusion_by(&mesh, &stencils, along)?),
            Some((nodes, None)) => Some(diffusion_by(&mesh, &stencils, &halves(&stencils, nodes))?),
        };
        let weighted = weighted.as_ref().unwrap_or(&stencils);
        let at_nodes = diffusivity.as_ref().map_or(&[][..], |(nodes, _)| nodes);
        let entries = match &sides {
            None => inside(weighted),
            Some((robin, neumann)) => Poisson { robin, diffusivity: at_nodes, neumann: *neumann, ..Poisson::default() }
                .entries(&mesh, weighted)?,
        };
        Ok::<_, Error>((entries, stencils))
    })?;
    let (entries, stencils) = found.map_err(|error| plain(py, error))?;
    Ok(listed(py, &entries, &stencils))
}

/// D along the edges where each node has its own up to the middle of the way to the next.
fn halves(stencils: &Stencils, nodes: &[f64]) -> Vec<f64> {
    let rows = (0..stencils.patch().len()).filter_map(|k| stencils.row(k));
    let ends = rows.flat_map(|row| {
        let own = nodes[row[0].0];
        row.into_iter().skip(1).map(move |(other, ..)| [own, nodes[other]])
    });
    ends.flat_map(|[own, other]| [own, own, own, own, other, other, other, other]).collect()
}

fn inside(stencils: &Stencils) -> Vec<Entry> {
    let rows = (0..stencils.patch().len()).map(|k| (stencils.index(k), stencils.row(k)));
    rows.flat_map(|(row, points)| {
        let entry = move |(column, on_u, on_source)| Entry { row, column, on_u, on_source };
        points.into_iter().flatten().map(entry)
    })
    .collect()
}

/// The areas by which `poisson` weights a mean: a quarter of each cell for its corners.
#[pyfunction]
pub fn quarters<'py>(py: Python<'py>, mesh: Given<'py>) -> PyResult<Array<'py>> {
    let mesh: Mesh<2> = mesh.mesh(py)?;
    let areas = node_areas(&mesh);
    array(py, mesh.lattice(), &areas)
}
