use super::need::{bends, need, need_by_bends};
use super::{Monitor, smoothing::smooth_widely};
use crate::error::{Failure, Result};
use crate::geometry::{Lattice, Mesh, check_length};
use crate::numerics::{larger, sum};

/// The root of the slope, over its mean: no number to set
///
/// ```text
/// ρ = 1 + 4 s r / ⟨r⟩,   r = max(√|∇u| − b, 0),   b = ⟨|∇u|^⅛⟩⁴,   ⟨·⟩ the mean over the domain
/// ```
///
/// with ∇u in each mesh cell, per uniform cell along each axis: |∇u|² = (h_x u_x)² + (h_y u_y)², so that a box of any
/// shape is treated alike. A layer of any width gets the same share of the nodes, about half of them: the mean of the
/// root falls with the width as fast as its largest value grows. The background b is 0 where u is flat outside its
/// layers, and takes out the slopes between the shocks of a saw tooth, which would share the nodes otherwise.
///
/// The need s is 0 where equal cells resolve u: where it changes by less than 0.18 of its range over a uniform cell
/// everywhere, and by less than 0.06 within a few nodes bends both ways. It is 1 where it changes by more than a
/// quarter of its range over a uniform cell somewhere, or by more than 0.09 bends both ways. The largest ρ over the
/// smallest is at most 10⁶.
///
/// Along an axis of n nodes round(8 (n/41)²) passes of the filter (1 2 1)/4 follow, at least one: a width of a
/// twentieth of the domain. Where lattice lines along it meet k > 2 layers on average there are (2/k)² as many. Their
/// cost does not depend on their number. Where u is constant, ρ = 1.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct RootGradient {}

/// Share of the layer in the density.
const BETA: f64 = 4.0;
/// The largest ρ over the smallest, before it is smoothed.
const CONTRAST: f64 = 1e6;
/// Passes of the filter on 41 × 41 nodes.
const PASSES: f64 = 8.0;
/// So many layers on a line are smoothed as one is. Were two of them smoothed less, on periodic axes or where a front
/// winds across the lines, a mesh of 40 cells would not come to rest around layers thinner than a hundredth of the box.
const FEW: f64 = 2.0;
/// Differences of u below this share of its size are rounding.
const ROUNDING: f64 = 1e-10;

impl Monitor for RootGradient {
    fn density(&self, mesh: &Mesh<2>, u: &[f64], _gradient: Option<&[[f64; 2]]>) -> Result<Vec<f64>, Failure> {
        let lattice = mesh.lattice();
        check_length(lattice, "what the mesh follows", u.len())?;
        let even = || Ok(vec![1.0; lattice.len()]);
        let [low, high] = u.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], u| [l.min(*u), h.max(*u)]);
        let (range, size) = (high - low, high.max(-low));
        let Roots { mut roots, background, mean, steepest } = Roots::of(mesh, u, range);
        let longest = lattice.cells().into_iter().max().unwrap_or(1) as f64;
        if mean <= ROUNDING * background || steepest * range * longest <= ROUNDING * size {
            return even();
        }
        let need = match need(steepest) {
            1.0 => 1.0,
            by_slope => by_slope.max(need_by_bends(bends(mesh, u) / range)),
        };
        let beta = BETA * need;
        if beta == 0.0 {
            return even();
        }
        // all of a jump is in one cell, and the smaller that gets, the larger ρ would be there
        let mean = mean.max(BETA * (steepest.sqrt() - background) / CONTRAST);
        roots.iter_mut().for_each(|root| *root = 1.0 + beta * (*root - background).max(0.0) / mean);
        let mut rho = roots;
        let (cells, layers) = (lattice.cells(), layers(lattice, &rho));
        let passes = [0, 1].map(|d| {
            let passes = (PASSES * ((cells[d] + 1) as f64 / 41.0).powi(2)).round() * (FEW / layers[d].max(FEW)).powi(2);
            // from cells to nodes is one of them
            (passes - 1.0).max(0.0)
        });
        smooth_widely(cells, lattice.periodic(), &mut rho, passes);
        let nodal = at_nodes(lattice, rho);
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

/// √|∇u| of the cells of a mesh, u in units of its range so that squares of no unit overflow.
struct Roots {
    /// One a cell, last axis fastest.
    roots: Vec<f64>,
    /// ⟨|∇u|^⅛⟩⁴.
    background: f64,
    /// Of what exceeds the background.
    mean: f64,
    /// The largest |∇u|.
    steepest: f64,
}

impl Roots {
    fn of(mesh: &Mesh<2>, u: &[f64], range: f64) -> Self {
        let lattice = mesh.lattice();
        let ([n, m], x, values) = (lattice.cells(), mesh.closed(), lattice.closed(u));
        let unit = if range > 0.0 { range } else { 1.0 };
        let [width, height] = mesh.extent();
        let h = [width / n as f64, height / m as f64];
        let cells = || (0..n).flat_map(|i| i * (m + 1)..i * (m + 1) + m);
        // both diagonals of a cell, and twice its area
        let diagonals = |k: usize| (minus(x[k + m + 2], x[k]), minus(x[k + 1], x[k + m + 1]));
        let twice_area = |([px, py], [qx, qy]): ([f64; 2], [f64; 2])| px * qy - py * qx;
        // room for one a node, too
        let mut roots = Vec::with_capacity((n + 1) * (m + 1));
        let mut steepest = 0.0;
        let background = sum(cells().map(|k| {
            let diagonals = diagonals(k);
            let ([px, py], [qx, qy]) = diagonals;
            let (p, q) = ((values[k + m + 2] - values[k]) / unit, (values[k + 1] - values[k + m + 1]) / unit);
            let twice = twice_area(diagonals);
            let (gx, gy) = (h[0] * (p * qy - q * py), h[1] * (q * px - p * qx));
            let slope = (gx * gx + gy * gy).sqrt() / twice;
            steepest = larger(steepest, slope);
            let root = slope.sqrt();
            roots.push(root);
            0.5 * twice * root.sqrt().sqrt()
        }));
        let background = (background / (width * height)).powi(4);
        let areas = cells().map(|k| 0.5 * twice_area(diagonals(k)));
        let above = sum(roots.iter().zip(areas).map(|(root, area)| (root - background).max(0.0) * area));
        Self { roots, background, mean: above / (width * height), steepest }
    }
}

/// How many layers the lattice lines along each axis meet: half of all that ρ, given by the cell, rises and falls along
/// them over the sum of the largest ρ − 1 of each line, so that the lines through the strongest layers count most.
fn layers(lattice: &Lattice<2>, rho: &[f64]) -> [f64; 2] {
    let ([n, m], wraps) = (lattice.cells(), lattice.periodic());
    let row = |i: usize| &rho[i * m..(i + 1) * m];
    let mut changes = [0.0; 2];
    let mut across = vec![1.0; m];
    let mut highest = [0.0; 2];
    let mut below = row(if wraps[0] { n - 1 } else { 0 });
    for i in 0..n {
        let row = row(i);
        let (mut last, mut along) = (row[if wraps[1] { m - 1 } else { 0 }], 1.0);
        for ((rho, below), across) in row.iter().zip(below).zip(&mut across) {
            changes[0] += (rho - below).abs();
            changes[1] += (rho - last).abs();
            last = *rho;
            *across = f64::max(*across, *rho);
            along = f64::max(along, *rho);
        }
        highest[1] += along - 1.0;
        below = row;
    }
    highest[0] = across.iter().map(|rho| rho - 1.0).sum();
    [0, 1].map(|d| if highest[d] > 0.0 { 0.5 * changes[d] / highest[d] } else { 0.0 })
}

/// The means of the cells around each node; beyond bounded sides stand the cells beside them again. In place, from the
/// last row on: row i of the nodes begins where row i of the cells does, or later.
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

fn minus(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

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

    /// Eight fronts in a row are as thick after smoothing, as shares of what each has, as two are, and each has as much
    /// of ρ.
    #[test]
    fn each_of_many_layers_has_its_share() {
        let contrast = |fronts: f64| {
            let cells = [20 * fronts as usize, 2];
            let mesh = Mesh::uniform(Lattice::new(cells, [true, false]).unwrap(), [0.0; 2], [fronts, 1.0]).unwrap();
            let u: Vec<f64> = mesh.x().iter().map(|x| (50.0 * (PI * (x[0] + 0.2)).sin()).tanh()).collect();
            let rho = RootGradient::default().density(&mesh, &u, None).unwrap();
            let [low, high] = rho.iter().fold([f64::INFINITY, 0.0], |[l, h], rho| [l.min(*rho), h.max(*rho)]);
            high / low
        };
        let (few, many) = (contrast(2.0), contrast(8.0));
        assert!((many / few - 1.0).abs() < 0.2, "{many} against {few}");
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
