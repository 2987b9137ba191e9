//! Folded cells, in any number of dimensions.

use super::determinant::determinant;
use super::lattice::strides;
use super::{Mesh, check_finite};
use crate::error::Failure;

/// Refuses a mesh with a node that is not finite or a cell that is folded
///
/// A cell is folded where at one of its 2^D corners the edges that leave it do not span a positive volume,
///
/// ```text
/// det(x_{c+e_1} − x_c, …, x_{c+e_D} − x_c) ≤ 0,
/// ```
///
/// where edges that run against their axis are taken with the opposite sign.
///
/// # Errors
/// [`Failure::NonFinite`] for the first such node, else [`Failure::Folded`] for the worst cell.
///
/// # Example
/// ```
/// use driftmesh::geometry::{Lattice, Mesh, check_unfolded};
/// let line = Mesh::uniform(Lattice::bounded([2])?, [0.0], [1.0])?;
/// assert!(check_unfolded(&line).is_ok());
/// assert!(check_unfolded(&line.moved(vec![[0.0], [1.5], [1.0]])?).is_err());
/// # Ok::<(), driftmesh::Error>(())
/// ```
pub fn check_unfolded<const D: usize>(mesh: &Mesh<D>) -> Result<(), Failure> {
    check_finite(["the mesh"; D], mesh, mesh.x())?;
    if mesh.chart().is_some() {
        check_unfolded(mesh.parameters())?;
    }
    let (cells, x) = (mesh.lattice().cells(), mesh.closed());
    let steps = strides(cells.map(|n| n + 1));
    let mut worst: Option<(f64, usize, usize)> = None;
    for start in pencils(cells, steps) {
        for cell in start..start + cells[D - 1] {
            for corner in 0..1 << D {
                let at = (0..D).filter(|d| corner >> d & 1 == 1).map(|d| steps[d]).sum::<usize>() + cell;
                let volume = corner_volume(&x, at, corner, steps);
                // not `<=` alone: a volume that overflowed to NaN is not positive either, and NaN is not ≤ 0
                if volume.is_nan() || volume <= worst.map_or(0.0, |worst| worst.0) {
                    worst = Some((volume, cell, at));
                }
            }
        }
    }
    let Some((volume, cell, at)) = worst else { return Ok(()) };
    let uniform = mesh.volume() / cells.iter().product::<usize>() as f64;
    let cell: [usize; D] = std::array::from_fn(|d| cell / steps[d] % (cells[d] + 1));
    Err(Failure::Folded { cell: cell.to_vec(), jacobian: volume / uniform, x: x[at].to_vec(), noise: None })
}

/// Marks the nodes at the corners of folded cells; see [`check_unfolded`]. Returns whether there are any.
pub(crate) fn mark_folded<const D: usize>(mesh: &Mesh<D>, marks: &mut [bool]) -> bool {
    let (lattice, x) = (mesh.lattice(), mesh.closed());
    let (cells, nodes) = (lattice.cells(), lattice.nodes());
    let steps = strides(cells.map(|n| n + 1));
    let mut any = false;
    for start in pencils(cells, steps) {
        for cell in start..start + cells[D - 1] {
            let corners = |corner: usize| (0..D).map(|d| (corner >> d & 1) * steps[d]).sum::<usize>() + cell;
            let sound = (0..1 << D).all(|corner| corner_volume(&x, corners(corner), corner, steps) > 0.0);
            if !sound {
                any = true;
                for corner in (0..1 << D).map(corners) {
                    let node = std::array::from_fn(|d| corner / steps[d] % (cells[d] + 1) % nodes[d]);
                    marks[lattice.index(node)] = true;
                }
            }
        }
    }
    any
}

/// The first cells of all rows along the last axis, in an array of nodes with these strides.
fn pencils<const D: usize>(cells: [usize; D], steps: [usize; D]) -> impl Iterator<Item = usize> {
    let count: usize = cells[..D - 1].iter().product();
    (0..count).map(move |p| {
        let mut rest = p;
        (0..D - 1).rev().fold(0, |sum, d| {
            let place = rest % cells[d];
            rest /= cells[d];
            sum + place * steps[d]
        })
    })
}

/// The volume that the edges from a corner span.
fn corner_volume<const D: usize>(x: &[[f64; D]], at: usize, corner: usize, steps: [usize; D]) -> f64 {
    determinant::<D>(std::array::from_fn(|d| {
        let upper = corner >> d & 1 == 1;
        let (a, b) = if upper { (x[at - steps[d]], x[at]) } else { (x[at], x[at + steps[d]]) };
        std::array::from_fn(|c| b[c] - a[c])
    }))
}
