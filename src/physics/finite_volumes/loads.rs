//! Sources of place, integrated over cells.

use super::mass::shares;
use super::{Half, Law};
use crate::error::Failure;
use crate::geometry::{Cells, Mesh, determinant, strides};

/// Gauss points along each axis of a cell, on (0, 1), and their weights.
const POINTS: [(f64, f64); 3] = [(0.1127016653792583, 5.0 / 18.0), (0.5, 4.0 / 9.0), (0.8872983346207417, 5.0 / 18.0)];

/// Cells with a σ below this count as equal cells: the difference is rounding.
const EQUAL: f64 = 1e-9;

impl<const D: usize> Half<'_, D>
where
    Mesh<D>: Cells<D>,
{
    /// ½ Δt times what integrating a source f of place over cells adds to its nodal value times the mass; empty where a
    /// law has no such source
    ///
    /// ```text
    /// Σ_cells σ ∫ (f − I f) φ_i,   σ = the largest 1 − (h_min/h)² of both axes
    /// ```
    ///
    /// I f is linear between nodes along the axes, φ_i the hat function of node i, and h_min the smallest cell of a
    /// lattice line, as in [`Excess`](super::Excess). M f adds up to the trapezoid rule, which is accurate for smooth f
    /// on equal cells, but not where cells grow: sources and fluxes that should balance would not. With σ = 1 this and
    /// M f are ∫ f φ_i, for which diffusion is exact at the nodes of a line; with σ = 0 nothing is added, since on
    /// equal cells time derivatives are taken at the nodes, too, and both errors cancel.
    ///
    /// # Source
    /// Strang and Fix, *An Analysis of the Finite Element Method* (1973), 1.6.
    pub(super) fn loads<const B: usize, L: Law<B, D>>(
        &self,
        law: &L,
        u: &[[f64; B]],
    ) -> Result<Vec<[f64; B]>, Failure> {
        let patch = self.cells.patch();
        // any values will do: f does not depend on these
        let Some(first) = patch.places().next().filter(|_| law.has_loads()) else { return Ok(Vec::new()) };
        let lattice = self.mesh.lattice();
        let at = |x: &[[f64; D]]| law.loads(self.t, self.mesh, x, u[first]);
        let (cells, closed) = (lattice.cells(), self.mesh.closed());
        let corners =
            Corners { cells: strides(cells), nodes: lattice.strides(), closed: strides(cells.map(|n| n + 1)) };
        let corner = |cell: usize, corner: usize| corners.of(cell, corner, cells, lattice.nodes());
        let stretched = shares(self.mesh).into_iter().map(|shares| 6.0 * shares.into_iter().fold(0.0, f64::max));
        let stretched: Vec<(usize, f64)> = stretched.enumerate().filter(|(_, sigma)| *sigma > EQUAL).collect();
        let count = POINTS.len().pow(D as u32);
        let inner: Vec<Gauss<D>> = stretched
            .iter()
            .flat_map(|&(cell, _)| {
                let x: [[f64; D]; 8] = std::array::from_fn(|n| closed[corner(cell, n % (1 << D))[1]]);
                (0..count).map(move |n| Gauss::of(&x, n))
            })
            .collect();
        let x: Vec<[f64; D]> = inner.iter().map(|gauss| self.mesh.image(gauss.x)).collect();
        let (nodal, values) = (at(&self.mesh.images())?, at(&x)?);
        let mut loads = vec![[0.0; B]; nodal.len()];
        for ((&(cell, sigma), inner), values) in stretched.iter().zip(inner.chunks(count)).zip(values.chunks(count)) {
            let places: [usize; 8] = std::array::from_fn(|n| corner(cell, n % (1 << D))[0]);
            let places = &places[..1 << D];
            for (gauss, value) in inner.iter().zip(values) {
                for c in 0..B {
                    let linear: f64 = places.iter().zip(gauss.shapes).map(|(n, shape)| shape * nodal[*n][c]).sum();
                    let beyond = 0.5 * self.dt * sigma * gauss.weight * (value[c] - linear);
                    places.iter().zip(gauss.shapes).for_each(|(n, shape)| loads[*n][c] += shape * beyond);
                }
            }
        }
        Ok(loads)
    }
}

/// Strides of the lattices of cells, of nodes, and of nodes with those that close periodic axes.
struct Corners<const D: usize> {
    cells: [usize; D],
    nodes: [usize; D],
    closed: [usize; D],
}

impl<const D: usize> Corners<D> {
    /// A corner of a cell, given by its bits along the axes, among the nodes, and among the nodes with those that close
    /// periodic axes.
    fn of(&self, cell: usize, corner: usize, cells: [usize; D], nodes: [usize; D]) -> [usize; 2] {
        (0..D).fold([0; 2], |[node, closed], d| {
            let along = cell / self.cells[d] % cells[d] + (corner >> d & 1);
            [node + along % nodes[d] * self.nodes[d], closed + along * self.closed[d]]
        })
    }
}

/// A Gauss point of a cell.
struct Gauss<const D: usize> {
    x: [f64; D],
    /// Weight of the point, times the Jacobian of the cell there.
    weight: f64,
    /// The hat functions of the corners there.
    shapes: [f64; 8],
}

impl<const D: usize> Gauss<D> {
    /// The n-th one of the cell with these corners.
    fn of(corners: &[[f64; D]; 8], n: usize) -> Self {
        let points: [(f64, f64); D] = std::array::from_fn(|d| POINTS[n / POINTS.len().pow(d as u32) % POINTS.len()]);
        let along = |corner: usize, d: usize| if corner >> d & 1 == 1 { points[d].0 } else { 1.0 - points[d].0 };
        let (mut shapes, mut x, mut rows) = ([0.0; 8], [0.0; D], [[0.0; D]; D]);
        for corner in 0..1 << D {
            shapes[corner] = (0..D).map(|d| along(corner, d)).product();
            for c in 0..D {
                x[c] += shapes[corner] * corners[corner][c];
                for (d, row) in rows.iter_mut().enumerate() {
                    let sign = if corner >> d & 1 == 1 { 1.0 } else { -1.0 };
                    let others: f64 = (0..D).filter(|e| *e != d).map(|e| along(corner, e)).product();
                    row[c] += sign * others * corners[corner][c];
                }
            }
        }
        let weight = determinant(rows) * points.iter().map(|(_, weight)| weight).product::<f64>();
        Self { x, weight, shapes }
    }
}
