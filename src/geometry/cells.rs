//! What is measured of the cells of a mesh.

use super::nodal::check_length;
use super::points::Place;
use super::{DualCells, Lattice, Mesh, Quality};
use crate::error::Failure;
use std::borrow::Cow;

/// What depends on the shape of cells, written once for lines and once for the plane
///
/// Whatever holds for [`Mesh<D>`](Mesh) with `Mesh<D>: Cells<D>` runs in one dimension and in two.
pub trait Cells<const D: usize>: Sized {
    /// The dual cells of the nodes.
    fn dual_cells(&self) -> DualCells<D>;

    /// What the faces of dual cells sweep on the way to later ones: [`DualCells::swept`].
    fn swept(from: &DualCells<D>, to: &DualCells<D>) -> Vec<[f64; D]>;

    /// Areas of the cells, lengths in one dimension, in lattice order.
    fn volumes(&self) -> impl Iterator<Item = f64>;

    /// ∇u in each cell, in lattice order, the length of a uniform cell being the unit along each axis. u is measured in
    /// `unit`.
    fn slopes(&self, u: &[f64], unit: f64) -> impl Iterator<Item = [f64; D]>;

    /// The area of each node: an equal share of every cell around it. These add up to the area of the box.
    fn node_volumes(&self) -> Vec<f64>;

    /// Values at the nodes: means of the cells around each node; at a bounded side only the cells inside count.
    fn at_nodes(lattice: &Lattice<D>, in_cells: Vec<f64>) -> Vec<f64>;

    /// Q of every cell, in lattice order.
    fn qualities(&self) -> Vec<f64>;

    /// Smallest corner Jacobian of every cell over that of the uniform mesh, in lattice order.
    fn jacobians(&self) -> Vec<f64>;

    /// All quality figures under a density, and the integral of nodal values: over each cell, its area times the mean
    /// at its corners. The arrays have one value a node.
    fn quality_and_integral(&self, rho: &[f64], values: &[f64]) -> (Quality, f64);

    /// [`interpolate`], for arrays that fit.
    fn interpolated(&self, values: &[f64], to: &Self) -> Vec<f64>;

    /// The cell, by its lowest corner, that holds each of some points. The search begins in the cell of the point
    /// before, so that neighbouring points cost a few tests each.
    fn holding(&self, points: impl Iterator<Item = [f64; D]>) -> Vec<[usize; D]>;

    /// The places in the unit box of points in a domain with a chart, and the points themselves in a box; else the
    /// index of the first point outside.
    fn parameters_of<'a>(&self, points: &'a [[f64; D]]) -> Result<Cow<'a, [[f64; D]]>, usize> {
        Ok(Cow::Borrowed(points))
    }

    /// The cell of each of some points, and where in it the point lies; nothing for points outside. After a point
    /// outside others may be left without a place, too.
    fn places(&self, points: &[[f64; D]]) -> Vec<Option<Place<D>>>;
}

/// Areas of the cells, in lattice order; lengths in one dimension.
pub fn cell_areas<const D: usize>(mesh: &Mesh<D>) -> Vec<f64>
where
    Mesh<D>: Cells<D>,
{
    mesh.volumes().collect()
}

/// The area of each node: an equal share of every cell around it. These add up to the area of the box.
pub fn node_areas<const D: usize>(mesh: &Mesh<D>) -> Vec<f64>
where
    Mesh<D>: Cells<D>,
{
    mesh.node_volumes()
}

/// All quality figures of a mesh under a density `rho`, one value a node.
///
/// # Errors
/// [`Failure::WrongLength`] where `rho` has not one value a node.
///
/// # Example
/// ```
/// use driftmesh::geometry::{quality, Lattice, Mesh};
/// // cells of 1 × 2: Q = ½ (1 + 4) / 2 = 1.25
/// let mesh = Mesh::uniform(Lattice::bounded([3, 3])?, [0.0, 0.0], [3.0, 6.0])?;
/// let q = quality(&mesh, &vec![1.0; 16])?;
/// assert!((q.q_max - 1.25).abs() < 1e-14);
/// assert!((q.equidistribution - 1.0).abs() < 1e-14);
/// # Ok::<(), driftmesh::Error>(())
/// ```
pub fn quality<const D: usize>(mesh: &Mesh<D>, rho: &[f64]) -> Result<Quality, Failure>
where
    Mesh<D>: Cells<D>,
{
    check_length(mesh.lattice(), "the density", rho.len())?;
    Ok(mesh.quality_and_integral(rho, rho).0)
}

/// Quality of a mesh relative to that of a reference over the same lattice.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Comparison {
    /// Largest Q of the reference over largest Q of the mesh.
    pub r_max: f64,
    /// Mean Q of the reference over mean Q of the mesh.
    pub r_mean: f64,
    /// Largest ratio, over the cells, of Q in the reference to Q in the mesh.
    pub cell_max: f64,
    /// Root mean square, over the nodes, of the distance between the two meshes.
    pub mesh_rms: f64,
}

/// Compares a mesh with a reference.
///
/// # Source
/// Section 3.7 of Bihlo, Haynes and Walsh (2015).
///
/// # Panics
/// If the two meshes have different lattices.
pub fn compare<const D: usize>(mesh: &Mesh<D>, reference: &Mesh<D>) -> Comparison
where
    Mesh<D>: Cells<D>,
{
    assert_eq!(mesh.lattice(), reference.lattice(), "both meshes need the same lattice");
    let [ours, theirs] = [mesh, reference].map(Mesh::qualities);
    let max = |q: &[f64]| q.iter().copied().fold(0.0, f64::max);
    let mean = |q: &[f64]| q.iter().sum::<f64>() / q.len() as f64;
    let distance2 = |(a, b): (&[f64; D], &[f64; D])| (0..D).map(|d| (a[d] - b[d]).powi(2)).sum::<f64>();
    let distances = mesh.x().iter().zip(reference.x()).map(distance2);
    Comparison {
        r_max: max(&theirs) / max(&ours),
        r_mean: mean(&theirs) / mean(&ours),
        cell_max: theirs.iter().zip(&ours).map(|(t, o)| t / o).fold(0.0, f64::max),
        mesh_rms: (distances.sum::<f64>() / mesh.x().len() as f64).sqrt(),
    }
}

/// Smallest corner Jacobian of every cell over that of the uniform mesh, in lattice order.
pub fn cell_jacobians<const D: usize>(mesh: &Mesh<D>) -> Vec<f64>
where
    Mesh<D>: Cells<D>,
{
    mesh.jacobians()
}

/// Q of every cell, in lattice order.
pub fn cell_qualities<const D: usize>(mesh: &Mesh<D>) -> Vec<f64>
where
    Mesh<D>: Cells<D>,
{
    mesh.qualities()
}

/// Interpolates a nodal field from one mesh to the nodes of another over the same lattice and box
///
/// Every cell is divided into two triangles by its diagonal from (i, j) to (i+1, j+1), and the field is linear on each.
/// The search for a node begins as many cells from the one with its index as the search for its neighbour ended, so
/// that it costs a few tests, whatever the meshes are. On periodic axes the image next to that cell is searched for:
/// the meshes may have drifted apart by any number of periods. Points outside a bounded box take the value at the
/// nearest point of the cell where the search ends. In a domain with a chart all of this is done in the unit box.
///
/// # Example
/// ```
/// use driftmesh::geometry::{interpolate, Lattice, Mesh};
/// let a = Mesh::uniform(Lattice::bounded([4, 4])?, [0.0, 0.0], [1.0, 1.0])?;
/// let b = a.moved(a.x().iter().map(|&[x, y]| [x * x, y]).collect())?;
/// // a linear field is carried exactly
/// let f: Vec<f64> = a.x().iter().map(|[x, y]| 1.0 + 2.0 * x - y).collect();
/// let g = interpolate(&a, &f, &b);
/// for (g, [x, y]) in g.iter().zip(b.x()) {
///     assert!((g - (1.0 + 2.0 * x - y)).abs() < 1e-14);
/// }
/// # Ok::<(), driftmesh::Error>(())
/// ```
///
/// # Panics
/// If the two meshes have different lattices or `values` has not one value a node.
pub fn interpolate<const D: usize>(from: &Mesh<D>, values: &[f64], to: &Mesh<D>) -> Vec<f64>
where
    Mesh<D>: Cells<D>,
{
    assert_eq!(from.lattice(), to.lattice(), "both meshes need the same lattice");
    assert_eq!(values.len(), from.lattice().len(), "one value a node");
    match from.chart().is_some() && to.chart().is_some() {
        true => from.parameters().interpolated(values, to.parameters()),
        false => from.interpolated(values, to),
    }
}
