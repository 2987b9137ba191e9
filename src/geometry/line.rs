//! Cells of a line.

use super::field::largest;
use super::points::{Place, lies_within};
use super::{Cells, DualCells, Lattice, Mesh, Patch, Quality, padded};
use crate::parallel;

impl Cells<1> for Mesh<1> {
    fn dual_cells(&self) -> DualCells<1> {
        dual_cells(self, 0)
    }

    fn swept(from: &DualCells<1>, to: &DualCells<1>) -> Vec<[f64; 1]> {
        let mut swept: Vec<[f64; 1]> = to.centres.iter().zip(&from.centres).map(|(b, a)| [b[0] - a[0]]).collect();
        from.patch.wrap(&mut swept);
        swept
    }

    fn volumes(&self) -> impl Iterator<Item = f64> {
        let x = self.closed();
        (0..x.len() - 1).map(move |k| x[k + 1][0] - x[k][0])
    }

    fn slopes(&self, u: &[f64], unit: f64) -> impl Iterator<Item = [f64; 1]> {
        let (x, u) = (self.closed(), self.lattice().closed(u));
        let h = self.extent()[0] / self.lattice().cells()[0] as f64;
        (0..x.len() - 1).map(move |k| [h * ((u[k + 1] - u[k]) / unit) / (x[k + 1][0] - x[k][0])])
    }

    fn node_volumes(&self) -> Vec<f64> {
        self.dual_cells().areas
    }

    fn at_nodes(lattice: &Lattice<1>, in_cells: Vec<f64>) -> Vec<f64> {
        let (n, wraps) = (in_cells.len(), lattice.periodic()[0]);
        let beside = |i: usize| match i {
            0 => [if wraps { n - 1 } else { 0 }, 0],
            i => [i - 1, i.min(n - 1)],
        };
        (0..lattice.len()).map(|i| beside(i).map(|c| in_cells[c])).map(|[a, b]| 0.5 * (a + b)).collect()
    }

    /// A cell of a line has no shape.
    fn qualities(&self) -> Vec<f64> {
        vec![1.0; self.lattice().cells()[0]]
    }

    fn jacobians(&self) -> Vec<f64> {
        let uniform = self.extent()[0] / self.lattice().cells()[0] as f64;
        self.volumes().map(|length| length / uniform).collect()
    }

    fn quality_and_integral(&self, rho: &[f64], values: &[f64]) -> (Quality, f64) {
        let (rho, values) = (self.lattice().closed(rho), self.lattice().closed(values));
        let n = self.lattice().cells()[0] as f64;
        // the scale of ρ cancels, and products with it must not overflow
        let half = 0.5 * largest(&rho).recip();
        let (mut most, mut all, mut integral, mut least) = (0.0_f64, 0.0, 0.0, f64::INFINITY);
        for (k, length) in self.volumes().enumerate() {
            let share = (rho[k] + rho[k + 1]) * half * length;
            most = most.max(share);
            all += share;
            integral += 0.5 * (values[k] + values[k + 1]) * length;
            least = least.min(length);
        }
        let uniform = self.extent()[0] / n;
        let quality =
            Quality { q_max: 1.0, q_mean: 1.0, min_scaled_jacobian: least / uniform, equidistribution: most * n / all };
        (quality, integral)
    }

    fn interpolated(&self, values: &[f64], to: &Self) -> Vec<f64> {
        let (x, values) = (self.closed(), self.lattice().closed(values));
        let between = |&[point]: &[f64; 1]| {
            let (cell, share) = self.find(&x, point);
            values[cell] + share * (values[cell + 1] - values[cell])
        };
        to.x().iter().map(between).collect()
    }

    fn holding(&self, points: impl Iterator<Item = [f64; 1]>) -> Vec<[usize; 1]> {
        let x = self.closed();
        points.map(|[point]| [self.find(&x, point).0]).collect()
    }

    fn places(&self, points: &[[f64; 1]]) -> Vec<Option<Place<1>>> {
        let (x, wraps) = (self.closed(), self.lattice().periodic()[0]);
        let mut places = vec![None; points.len()];
        parallel::for_each_piece(&mut places, |first, piece| {
            for (place, &[point]) in piece.iter_mut().zip(&points[first..]) {
                let (cell, share) = self.find(&x, point);
                let found = x[cell][0] + share * (x[cell + 1][0] - x[cell][0]);
                let inside = wraps || lies_within(self, [found], [point]);
                *place = inside.then_some(Place { cell: [cell], share: [share] });
            }
        });
        places
    }
}

impl DualCells<1> {
    /// Dual cells of a line along the radius of cylinders: rings, per radian and length, with faces of area r.
    pub fn cylindrical(mesh: &Mesh<1>) -> Self {
        dual_cells(mesh, 1)
    }

    /// Dual cells of a line along the radius of spheres: shells, per steradian, with faces of area r².
    pub fn spherical(mesh: &Mesh<1>) -> Self {
        dual_cells(mesh, 2)
    }
}

/// Dual cells with the weight r^m: in the place of their ends r stands the volume r^{m+1}/(m+1) within, so that volumes
/// and what faces sweep are exact.
fn dual_cells(mesh: &Mesh<1>, m: i32) -> DualCells<1> {
    let (lattice, [extent]) = (mesh.lattice(), mesh.extent());
    let ([n], wraps) = (lattice.nodes(), lattice.periodic());
    let patch = Patch { origin: [0], size: [n], wraps };
    let x = padded(lattice, mesh.x(), [[extent]]);
    let middle = |x: &[[f64; 1]]| 0.5 * (x[0][0] + x[1][0]);
    let within = |r: f64| [r.powi(m + 1) / f64::from(m + 1)];
    let mut centres: Vec<[f64; 1]> = x.windows(2).map(|x| within(middle(x))).collect();
    let mut normals: Vec<[[f64; 1]; 1]> = x.windows(2).map(|x| [[middle(x).powi(m)]]).collect();
    let areas = centres.windows(2).map(|c| c[1][0] - c[0][0]).collect();
    centres.push([0.0]);
    normals.push([[1.0]]);
    DualCells { patch, centres, normals, areas, curved: None }
}

impl Mesh<1> {
    /// The cell that holds a point, or an image of it, and at which share of the cell it lies; `x` are the positions
    /// of both ends of all cells. Points outside of a bounded line are moved to its end.
    fn find(&self, x: &[[f64; 1]], point: f64) -> (usize, f64) {
        let ([first], [last]) = (x[0], x[x.len() - 1]);
        let extent = self.extent()[0];
        let point = match self.lattice().periodic()[0] {
            true => point - extent * ((point - first) / extent).floor(),
            false => point,
        };
        let point = point.clamp(first, last);
        let cell = x.partition_point(|x| x[0] <= point).clamp(1, x.len() - 1) - 1;
        (cell, (point - x[cell][0]) / (x[cell + 1][0] - x[cell][0]))
    }
}

#[cfg(test)]
mod tests {
    use crate::geometry::{DualCells, Lattice, Mesh, cell_areas, interpolate, node_areas, quality};

    fn bent(periodic: bool, amount: f64) -> Mesh<1> {
        let mesh = Mesh::uniform(Lattice::new([20], [periodic]).unwrap(), [0.0], [2.0]).unwrap();
        let x = mesh.x().iter().map(|[x]| [x + amount * (std::f64::consts::PI * x).sin()]);
        mesh.moved(x.collect()).unwrap()
    }

    /// Dual cells tile the line, and grow by what their faces sweep.
    #[test]
    fn the_geometric_conservation_law_holds() {
        for periodic in [false, true] {
            let [old, new] = [0.1, -0.2].map(|amount| DualCells::new(&bent(periodic, amount)));
            let swept = old.swept(&new);
            assert!((new.areas().iter().sum::<f64>() - 2.0).abs() < 1e-14);
            for (i, k) in new.patch().places().enumerate() {
                let growth = new.areas()[i] - old.areas()[i];
                assert!((growth - (swept[k][0] - swept[k - 1][0])).abs() < 1e-14);
            }
        }
    }

    /// Linear functions are carried exactly on bounded lines, waves by any number of periods on periodic ones.
    #[test]
    fn interpolation_is_linear_and_knows_images() {
        let (from, to) = (bent(false, 0.2), bent(false, -0.2));
        let values: Vec<f64> = from.x().iter().map(|[x]| 3.0 - 2.0 * x).collect();
        let carried = interpolate(&from, &values, &to);
        assert!(carried.iter().zip(to.x()).all(|(u, [x])| (u - (3.0 - 2.0 * x)).abs() < 1e-14));
        let from = bent(true, 0.2);
        let values: Vec<f64> = from.x().iter().map(|[x]| (std::f64::consts::PI * x).cos()).collect();
        let shifted = from.moved(from.x().iter().map(|[x]| [x - 14.0]).collect()).unwrap();
        assert!(interpolate(&from, &values, &shifted).iter().zip(&values).all(|(a, b)| (a - b).abs() < 1e-12));
    }

    /// ρ = 1/x equidistributes cells that grow by a factor of 1.1 each, to the error of the trapezoid; their lengths
    /// add up.
    #[test]
    fn quality_tells_equidistribution() {
        let mesh = Mesh::uniform(Lattice::bounded([20]).unwrap(), [1.0], [1.1_f64.powi(20)]).unwrap();
        let mesh = mesh.moved((0..=20).map(|k| [1.1_f64.powi(k)]).collect()).unwrap();
        let rho: Vec<f64> = mesh.x().iter().map(|[x]| 1.0 / x).collect();
        let found = quality(&mesh, &rho).unwrap();
        assert!((found.equidistribution - 1.0).abs() < 1e-12 && found.q_max == 1.0, "{found:?}");
        let uniform = mesh.extent()[0] / 20.0;
        assert!((found.min_scaled_jacobian - 0.1 / uniform).abs() < 1e-12);
        for lengths in [cell_areas(&mesh), node_areas(&mesh)] {
            assert!((lengths.iter().sum::<f64>() - mesh.extent()[0]).abs() < 1e-12);
        }
    }
}
