//! Sources of place, integrated over cells.

use super::{Excess, Half, Law};
use crate::error::Failure;
use crate::geometry::{Cells, Mesh, determinant, padded, strides};

/// Gauss points along each axis of a cell, on (0, 1), and their weights.
const POINTS: [(f64, f64); 3] = [(0.1127016653792583, 5.0 / 18.0), (0.5, 4.0 / 9.0), (0.8872983346207417, 5.0 / 18.0)];

impl<const D: usize> Half<'_, D>
where
    Mesh<D>: Cells<D>,
{
    /// ½ Δt of what a source of place f brings to each node beyond A f and its share of [`Excess`]; empty where a law
    /// has none
    ///
    /// ```text
    /// ∫ (f − I f) φ_i + (C₀ f)_i − (C f)_i
    /// ```
    ///
    /// I f is linear between nodes along the axes, φ_i the hat function of node i, and C₀ is [`Excess`] with h_min = 0:
    /// with A f this is ∫ f φ_i where nodes stand in the middle of their dual cells. A f alone adds up to the trapezoid
    /// rule, which is accurate for smooth f on equal cells but not where cells grow, so that what sources and fluxes
    /// should balance would not. On a line, diffusion with this load is exact at the nodes.
    ///
    /// # Source
    /// Strang and Fix, *An Analysis of the Finite Element Method* (1973), 1.6.
    pub(super) fn loads<const S: usize, const B: usize, L: Law<B, D>>(
        &self,
        law: &L,
        excess: Option<&Excess<B, D, S>>,
        u: &[[f64; B]],
    ) -> Result<Vec<[f64; B]>, Failure> {
        let patch = self.cells.patch();
        // any values will do: f does not depend on these
        let Some(first) = patch.places().next().filter(|_| law.has_loads()) else { return Ok(Vec::new()) };
        let lattice = self.mesh.lattice();
        let at = |x: &[[f64; D]]| law.loads(self.t, self.mesh, x, u[first]);
        let nodal = at(&self.mesh.images())?;
        let (cells, closed) = (lattice.cells(), self.mesh.closed());
        let corners =
            Corners { cells: strides(cells), nodes: lattice.strides(), closed: strides(cells.map(|n| n + 1)) };
        let corner = |cell: usize, corner: usize| corners.of(cell, corner, cells, lattice.nodes());
        let inner: Vec<Gauss<D>> = (0..cells.iter().product::<usize>())
            .flat_map(|cell| {
                let x: [[f64; D]; 8] = std::array::from_fn(|n| closed[corner(cell, n % (1 << D))[1]]);
                (0..POINTS.len().pow(D as u32)).map(move |n| Gauss::of(&x, n))
            })
            .collect();
        let x: Vec<[f64; D]> = inner.iter().map(|gauss| self.mesh.image(gauss.x)).collect();
        let values = at(&x)?;
        let (half, count) = (0.5 * self.dt, POINTS.len().pow(D as u32));
        let mut loads = vec![[0.0; B]; nodal.len()];
        for (cell, volume) in self.mesh.volumes().enumerate() {
            let places: [usize; 8] = std::array::from_fn(|n| corner(cell, n % (1 << D))[0]);
            let places = &places[..1 << D];
            for (from, &node) in places.iter().enumerate() {
                for (to, &other) in places.iter().enumerate() {
                    let apart = (from ^ to).count_ones() as i32;
                    let mass = (1.0_f64 / 6.0).powi(apart) * (1.0_f64 / 3.0).powi(D as i32 - apart);
                    let lumped = if from == to { 0.5_f64.powi(D as i32) } else { 0.0 };
                    (0..B).for_each(|c| loads[node][c] += half * volume * (mass - lumped) * nodal[other][c]);
                }
            }
            for (gauss, value) in inner.iter().zip(&values).skip(cell * count).take(count) {
                for c in 0..B {
                    let linear: f64 = places.iter().zip(gauss.shapes).map(|(n, shape)| shape * nodal[*n][c]).sum();
                    let beyond = half * gauss.weight * (value[c] - linear);
                    places.iter().zip(gauss.shapes).for_each(|(n, shape)| loads[*n][c] += shape * beyond);
                }
            }
        }
        if let Some(excess) = excess {
            let padded = padded(lattice, &nodal, [[0.0; B]; D]);
            for ((i, k), load) in patch.places().enumerate().zip(&mut loads) {
                let known = excess.product(i, k, |n| padded[n]);
                (0..B).for_each(|c| load[c] -= half * known[c]);
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
    /// With the Jacobian of the cell.
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
