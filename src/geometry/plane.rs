//! Cells in the plane.

use super::locate::{cells_in_plane, interpolate_in_plane, parameters_in_plane, places_in_plane};
use super::points::Place;
use super::quality::{Quality, jacobians_in_plane, minus, node_areas_in_plane, qualities_in_plane, quality_in_plane};
use super::{Cells, DualCells, Lattice, Mesh};
use std::borrow::Cow;

impl Cells<2> for Mesh<2> {
    fn dual_cells(&self) -> DualCells<2> {
        DualCells::of_plane(self)
    }

    fn swept(from: &DualCells<2>, to: &DualCells<2>) -> Vec<[f64; 2]> {
        from.swept_in_plane(to)
    }

    fn volumes(&self) -> impl Iterator<Item = f64> {
        let [n, m] = self.lattice().cells();
        let x = self.closed();
        lower_corners(n, m).map(move |k| 0.5 * twice_area(diagonals(&x, k, m)))
    }

    fn slopes(&self, u: &[f64], unit: f64) -> impl Iterator<Item = [f64; 2]> {
        let ([n, m], [width, height]) = (self.lattice().cells(), self.extent());
        let (x, u) = (self.closed(), self.lattice().closed(u));
        let h = [width / n as f64, height / m as f64];
        lower_corners(n, m).map(move |k| {
            let diagonals @ ([px, py], [qx, qy]) = diagonals(&x, k, m);
            let (p, q) = ((u[k + m + 2] - u[k]) / unit, (u[k + 1] - u[k + m + 1]) / unit);
            let twice = twice_area(diagonals);
            [h[0] * (p * qy - q * py) / twice, h[1] * (q * px - p * qx) / twice]
        })
    }

    fn node_volumes(&self) -> Vec<f64> {
        node_areas_in_plane(self)
    }

    fn at_nodes(lattice: &Lattice<2>, in_cells: Vec<f64>) -> Vec<f64> {
        at_nodes(lattice, in_cells)
    }

    fn qualities(&self) -> Vec<f64> {
        qualities_in_plane(self)
    }

    fn jacobians(&self) -> Vec<f64> {
        jacobians_in_plane(self)
    }

    fn quality_and_integral(&self, rho: &[f64], values: &[f64]) -> (Quality, f64) {
        quality_in_plane(self, rho, values)
    }

    fn interpolated(&self, values: &[f64], to: &Self) -> Vec<f64> {
        interpolate_in_plane(self, values, to)
    }

    fn holding(&self, points: impl Iterator<Item = [f64; 2]>) -> Vec<[usize; 2]> {
        cells_in_plane(self, points)
    }

    fn parameters_of<'a>(&self, points: &'a [[f64; 2]]) -> Result<Cow<'a, [[f64; 2]]>, usize> {
        parameters_in_plane(self, points)
    }

    fn places(&self, points: &[[f64; 2]]) -> Vec<Option<Place<2>>> {
        places_in_plane(self, points)
    }
}

/// The lowest corner of each cell, in arrays of shape cells + 1.
fn lower_corners(n: usize, m: usize) -> impl Iterator<Item = usize> {
    (0..n).flat_map(move |i| i * (m + 1)..i * (m + 1) + m)
}

/// Both diagonals of the cell whose lowest corner is k, m cells in a row.
fn diagonals(x: &[[f64; 2]], k: usize, m: usize) -> ([f64; 2], [f64; 2]) {
    (minus(x[k + m + 2], x[k]), minus(x[k + 1], x[k + m + 1]))
}

fn twice_area(([px, py], [qx, qy]): ([f64; 2], [f64; 2])) -> f64 {
    px * qy - py * qx
}

/// [`Cells::at_nodes`], in place from the last row on: row i of the nodes begins where row i of the cells does, or
/// later.
fn at_nodes(lattice: &Lattice<2>, mut rho: Vec<f64>) -> Vec<f64> {
    let ([n, m], [rows, columns], periodic) = (lattice.cells(), lattice.nodes(), lattice.periodic());
    // the cells on both sides of node i along an axis of n cells
    let beside = |i: usize, n: usize, wraps: bool| match i {
        0 if wraps => [n - 1, 0],
        0 => [0, 0],
        i if i == n => [n - 1, n - 1],
        i => [i - 1, i],
    };
    let beside_column: Vec<[usize; 2]> = (0..columns).map(|j| beside(j, m, periodic[1])).collect();
    let last_row = rho[(n - 1) * m..].to_vec();
    let (mut below, mut above) = (last_row.clone(), last_row.clone());
    rho.resize(lattice.len(), 0.0);
    for i in (0..rows).rev() {
        let cells = beside(i, n, periodic[0]);
        for (row, i) in [&mut below, &mut above].into_iter().zip(cells) {
            row.copy_from_slice(if i == n - 1 { &last_row } else { &rho[i * m..(i + 1) * m] });
        }
        let means = beside_column.iter().map(|&[c, d]| 0.25 * ((below[c] + above[d]) + (below[d] + above[c])));
        rho[i * columns..(i + 1) * columns].iter_mut().zip(means).for_each(|(rho, mean)| *rho = mean);
    }
    rho
}
