use super::{Monitor, smoothing::smooth_widely};
use crate::error::{Failure, Result};
use crate::geometry::{Mesh, check_length};
use crate::numerics::{larger, sum};

/// The root of the slope, over its mean: no number to set
///
/// ```text
/// ρ = 1 + 4 s r / ⟨r⟩,   r = max(√|∇u| − b, 0),   b = ⟨|∇u|^⅛⟩⁴,   ⟨·⟩ the mean over the domain
/// ```
///
/// with ∇u in each mesh cell, per uniform cell along each axis: |∇u|² = (h_x u_x)² + (h_y u_y)², so that a box of any shape is
/// treated alike. A layer of any width gets the same share of the nodes, about half of them: the mean of the root falls with
/// the width as fast as its largest value grows. The background b is 0 where u is flat outside its layers, and takes out the
/// slopes between the shocks of a saw tooth, which would share the nodes otherwise.
///
/// The need s is 0 where u changes by less than 0.18 of its range over a uniform cell everywhere: equal cells resolve it. It is 1
/// where u changes by more than a quarter of its range over one somewhere. The largest ρ over the smallest is at most 10⁶.
///
/// Along an axis of n nodes round(8 (n/41)²) passes of the filter (1 2 1)/4 follow, at least one: a width of a twentieth of
/// the domain. Their cost does not depend on their number. Where u is constant, ρ = 1.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct RootGradient {}

/// Share of the layer in the density.
const BETA: f64 = 4.0;
/// Changes of u over a uniform cell, as shares of its range, that equal cells resolve at most, and that take the whole
/// density at least: a Gaussian is interpolated to 1 % of its range at the first and to 2 % at the second.
const RESOLVED: f64 = 0.18;
const UNRESOLVED: f64 = 0.25;
/// The largest ρ over the smallest, before it is smoothed.
const CONTRAST: f64 = 1e6;
/// Passes of the filter on 41 × 41 nodes.
const PASSES: f64 = 8.0;
/// Differences of u below this share of its size are rounding.
const ROUNDING: f64 = 1e-10;

impl Monitor for RootGradient {
    fn density(&self, mesh: &Mesh<2>, u: &[f64], _gradient: Option<&[[f64; 2]]>) -> Result<Vec<f64>, Failure> {
        let lattice = mesh.lattice();
        check_length(lattice, "what the mesh follows", u.len())?;
        let ([n, m], periodic) = (lattice.cells(), lattice.periodic());
        let (x, values) = (mesh.closed(), lattice.closed(u));
        let [low, high] = values.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], u| [l.min(*u), h.max(*u)]);
        // slopes of u over its range, so that squares of no unit overflow
        let (range, size) = (high - low, high.max(-low));
        let unit = if range > 0.0 { range } else { 1.0 };
        let h = [0, 1].map(|d| mesh.extent()[d] / lattice.cells()[d] as f64);
        let cells = || (0..n).flat_map(|i| i * (m + 1)..i * (m + 1) + m);
        // the four corners of a cell and its diagonals
        let corners = |k: usize| [k, k + m + 2, k + 1, k + m + 1];
        let diagonals = |[a, c, b, d]: [usize; 4]| (minus(x[c], x[a]), minus(x[b], x[d]));
        let twice_area = |([px, py], [qx, qy]): ([f64; 2], [f64; 2])| px * qy - py * qx;
        let mut rho = Vec::with_capacity(n * m);
        let mut steepest = 0.0;
        let domain = mesh.extent()[0] * mesh.extent()[1];
        let background = sum(cells().map(|k| {
            let corners @ [a, c, b, d] = corners(k);
            let diagonals = diagonals(corners);
            let ([px, py], [qx, qy]) = diagonals;
            let (p, q) = ((values[c] - values[a]) / unit, (values[b] - values[d]) / unit);
            let twice = twice_area(diagonals);
            let (gx, gy) = (h[0] * (p * qy - q * py), h[1] * (q * px - p * qx));
            let slope = (gx * gx + gy * gy).sqrt() / twice;
            steepest = larger(steepest, slope);
            let root = slope.sqrt();
            rho.push(root);
            0.5 * twice * root.sqrt().sqrt()
        }));
        let background = (background / domain).powi(4);
        let excess = |root: f64| (root - background).max(0.0);
        let areas = cells().map(|k| 0.5 * twice_area(diagonals(corners(k))));
        let mean = sum(rho.iter().zip(areas).map(|(root, area)| excess(*root) * area)) / domain;
        // all of a jump is in one cell, and the smaller that gets, the larger ρ would be there
        let mean = mean.max(BETA * excess(steepest.sqrt()) / CONTRAST);
        if mean <= ROUNDING * background || steepest * unit * n.max(m) as f64 <= ROUNDING * size {
            return Ok(vec![1.0; lattice.len()]);
        }
        let beta = BETA * need(steepest);
        rho.iter_mut().for_each(|root| *root = 1.0 + beta * excess(*root) / mean);
        // from cells to nodes and back is a pass
        let passes = [n, m].map(|n| ((PASSES * ((n + 1) as f64 / 41.0).powi(2)).round() - 1.0).max(0.0));
        smooth_widely([n, m], periodic, &mut rho, passes);
        // the cells on both sides of node i along an axis of n cells
        let beside = |i: usize, n: usize, wraps: bool| match i {
            0 if wraps => [n - 1, 0],
            0 => [0, 0],
            i if i == n => [n - 1, n - 1],
            i => [i - 1, i],
        };
        let [rows, columns] = lattice.nodes();
        let columns: Vec<[usize; 2]> = (0..columns).map(|j| beside(j, m, periodic[1])).collect();
        let mut nodal = Vec::with_capacity(lattice.len());
        for i in 0..rows {
            let [below, above] = beside(i, n, periodic[0]).map(|i| &rho[i * m..(i + 1) * m]);
            let means = columns.iter().map(|&[c, d]| 0.25 * ((below[c] + above[d]) + (below[d] + above[c])));
            nodal.extend(means);
        }
        match nodal.iter().position(|rho| !rho.is_finite()) {
            None => Ok(nodal),
            Some(k) => Err(Failure::NonFinite {
                what: "the mesh density",
                value: nodal[k],
                node: lattice.node(k),
                x: mesh.x()[k],
            }),
        }
    }
}

/// s where u changes by this share of its range over a uniform cell at most.
pub(crate) fn need(share: f64) -> f64 {
    let s = ((share - RESOLVED) / (UNRESOLVED - RESOLVED)).clamp(0.0, 1.0);
    s * s * (3.0 - 2.0 * s)
}

fn minus(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Lattice;

    /// Equal cells that resolve u have an even density; ten times thinner, the layer has most of it.
    #[test]
    fn what_equal_cells_resolve_asks_for_nothing() {
        let mesh = Mesh::uniform(Lattice::bounded([40, 4]).unwrap(), [0.0; 2], [1.0, 0.1]).unwrap();
        let density = |w: f64| {
            let u: Vec<f64> = mesh.x().iter().map(|x| (w * (x[0] - 0.5)).tanh()).collect();
            RootGradient::default().density(&mesh, &u, None).unwrap()
        };
        assert_eq!(density(8.0), vec![1.0; mesh.x().len()]);
        assert!(density(80.0).iter().fold(0.0, |m: f64, rho| m.max(*rho)) > 10.0);
    }

    /// A box of any shape has the same density: slopes count by the cell.
    #[test]
    fn the_shape_of_the_box_does_not_matter() {
        let density = |height: f64| {
            let mesh = Mesh::uniform(Lattice::bounded([24, 16]).unwrap(), [0.0; 2], [1.0, height]).unwrap();
            let u: Vec<f64> = mesh.x().iter().map(|x| (60.0 * (x[0] + 0.3 * x[1] / height - 0.6)).tanh()).collect();
            RootGradient::default().density(&mesh, &u, None).unwrap()
        };
        let (square, thin) = (density(1.0), density(1e-4));
        assert!(square.iter().zip(&thin).all(|(a, b)| (a / b - 1.0).abs() < 1e-9));
    }

    /// A constant has the density 1 to the last bit, and so has its rounding.
    #[test]
    fn a_constant_has_no_slope() {
        let mesh = Mesh::uniform(Lattice::new([7, 5], [true, false]).unwrap(), [0.0; 2], [1.0; 2]).unwrap();
        for noise in [0.0, 1e-15] {
            let u: Vec<f64> = (0..mesh.x().len()).map(|k| 3.0 + noise * (k % 3) as f64).collect();
            assert_eq!(RootGradient::default().density(&mesh, &u, None).unwrap(), vec![1.0; mesh.x().len()]);
        }
    }

    /// ∇u is exact for linear u on any cells, and so ρ is even, whatever the unit of u is.
    #[test]
    fn linear_functions_have_an_even_density() {
        let mesh = Mesh::uniform(Lattice::bounded([3, 4]).unwrap(), [0.0; 2], [2.0, 1.0]).unwrap();
        let bent = mesh.x().iter().map(|&[x, y]| [x + 0.1 * (x * (2.0 - x)) * y, y + 0.1 * (y * (1.0 - y)) * x]);
        let mesh = mesh.moved(bent.collect()).unwrap();
        for unit in [1.0, 1e-6, 1e200, 1e-200] {
            let u: Vec<f64> = mesh.x().iter().map(|[x, y]| unit * (3.0 * x - 2.0 * y)).collect();
            let rho = RootGradient::default().density(&mesh, &u, None).unwrap();
            assert!(rho.iter().all(|rho| (rho - 1.0).abs() < 1e-9), "{rho:?}");
        }
        // half a per cent of curvature is not even any more
        let u: Vec<f64> = mesh.x().iter().map(|[x, y]| 3.0 * x - 2.0 * y + 0.005 * x * x).collect();
        let rho = RootGradient::default().density(&mesh, &u, None).unwrap();
        assert!(rho.iter().any(|rho| (rho - 1.0).abs() > 0.1), "{rho:?}");
    }
}
