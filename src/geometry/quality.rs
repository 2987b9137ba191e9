use super::Mesh;
use super::field::largest;
use std::ops::Range;

/// How good a mesh is
///
/// ```text
/// Q(K) = ½ tr(JᵀJ) / √det(JᵀJ) ≥ 1,   J = the averaged edge vectors of cell K
/// ```
///
/// Q is 1 exactly for a square cell; stretching and shearing raise it. In one dimension it is 1.
///
/// # Source
/// (3.4) of Bihlo, Haynes and Walsh, *Stochastic domain decomposition for time dependent adaptive mesh generation*
/// (2015).
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Quality {
    /// Largest Q over the cells.
    pub q_max: f64,
    /// Mean Q over the cells.
    pub q_mean: f64,
    /// Smallest corner Jacobian over that of the uniform mesh; positive exactly if no cell is folded.
    pub min_scaled_jacobian: f64,
    /// max / mean of ρ·area over the cells; 1 is perfect equidistribution.
    pub equidistribution: f64,
}

/// Corners of a cell, counter-clockwise: (i, j), (i+1, j), (i+1, j+1), (i, j+1).
type Corners = [[f64; 2]; 4];

#[inline(always)]
pub(super) fn minus(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

#[inline(always)]
pub(super) fn cross(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

/// Calls `visit(cell, corner indices, corners)` for every cell, in lattice order, on arrays of shape cells + 1.
fn for_each_cell(mesh: &Mesh<2>, mut visit: impl FnMut([usize; 2], [usize; 4], Corners)) {
    let x = mesh.closed();
    let [n, m] = mesh.lattice().cells();
    for i in 0..n {
        for j in 0..m {
            let k = i * (m + 1) + j;
            let corners = [k, k + m + 1, k + m + 2, k + 1];
            visit([i, j], corners, corners.map(|c| x[c]));
        }
    }
}

/// The nodes on both sides of a row of cells, x and y in separate arrays, over which the compiler can vectorise.
struct Row<'a> {
    before: [&'a [f64]; 2],
    after: [&'a [f64]; 2],
}

impl Row<'_> {
    #[inline(always)]
    fn cell(&self, j: usize) -> Edges {
        let [before, after] = [self.before, self.after].map(|[x, y]| [[x[j], y[j]], [x[j + 1], y[j + 1]]]);
        Edges::of([before[0], after[0], after[1], before[1]])
    }
}

/// Calls `visit(nodes before, nodes after, row)` for every row of cells, in lattice order. The first two are the ranges
/// of its nodes in arrays of shape cells + 1, the third their positions.
#[inline(always)]
fn for_each_row_of_cells(mesh: &Mesh<2>, mut visit: impl FnMut([Range<usize>; 2], &Row<'_>)) {
    let x = mesh.closed();
    let [n, m] = mesh.lattice().cells();
    let range = |i: usize| i * (m + 1)..(i + 1) * (m + 1);
    let column = |i: usize, d: usize| x[range(i)].iter().map(move |x| x[d]);
    let mut before = [0, 1].map(|d| column(0, d).collect::<Vec<f64>>());
    let mut after = before.clone();
    for i in 0..n {
        for (d, after) in after.iter_mut().enumerate() {
            after.iter_mut().zip(column(i + 1, d)).for_each(|(to, from)| *to = from);
        }
        // slices of a known length, so that the loops over them need no bounds checks
        let [before_it, after_it] = [&before, &after].map(|[x, y]| [&x[..m + 1], &y[..m + 1]]);
        visit([range(i), range(i + 1)], &Row { before: before_it, after: after_it });
        std::mem::swap(&mut before, &mut after);
    }
}

/// The edges of a cell at its south, east, north and west, each in the direction of its axis.
struct Edges([[f64; 2]; 4]);

impl Edges {
    #[inline(always)]
    fn of([a, b, c, d]: Corners) -> Self {
        Self([minus(b, a), minus(c, b), minus(c, d), minus(d, a)])
    }

    /// The Jacobian at each corner: the cross product of the two edges that meet there.
    #[inline(always)]
    fn corner_jacobians(&self) -> [f64; 4] {
        let Self([south, east, north, west]) = *self;
        [cross(south, west), cross(south, east), cross(north, east), cross(north, west)]
    }

    #[inline(always)]
    fn least_jacobian(&self) -> f64 {
        let [a, b, c, d] = self.corner_jacobians();
        smaller(smaller(a, b), smaller(c, d))
    }

    /// Edges averaged over opposite sides.
    #[inline(always)]
    fn averaged(&self) -> [[f64; 2]; 2] {
        let Self([south, east, north, west]) = *self;
        [[south, north], [west, east]].map(|[p, q]| [0, 1].map(|d| 0.5 * (p[d] + q[d])))
    }

    /// Q and the area of the cell.
    #[inline(always)]
    fn shape(&self) -> [f64; 2] {
        let [e, f] = self.averaged();
        let area = cross(e, f);
        [0.5 * (e[0] * e[0] + e[1] * e[1] + f[0] * f[0] + f[1] * f[1]) / area.abs(), area]
    }
}

/// The minimum of two numbers in one instruction; `f64::min` takes four, to handle NaN.
#[inline(always)]
fn smaller(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

fn area([a, b, c, d]: Corners) -> f64 {
    0.5 * cross(minus(c, a), minus(d, b))
}

/// Area of the domain over the number of cells, which is every corner Jacobian of the uniform mesh.
fn uniform_jacobian(mesh: &Mesh<2>) -> f64 {
    let [n, m] = mesh.lattice().cells();
    mesh.volume() / (n * m) as f64
}

pub(super) fn node_areas_in_plane(mesh: &Mesh<2>) -> Vec<f64> {
    let lattice = mesh.lattice();
    let nodes = lattice.nodes();
    let mut areas = vec![0.0; lattice.len()];
    let bounded = lattice.periodic() == [false; 2];
    for_each_cell(mesh, |[i, j], closed, corners| {
        let share = 0.25 * area(corners);
        if bounded {
            closed.into_iter().for_each(|k| areas[k] += share);
        } else {
            for (di, dj) in [(0, 0), (1, 0), (1, 1), (0, 1)] {
                areas[lattice.index([(i + di) % nodes[0], (j + dj) % nodes[1]])] += share;
            }
        }
    });
    areas
}

/// The quality figures, and the integral of nodal values: over each cell, its area times the mean at its corners.
pub(super) fn quality_in_plane(mesh: &Mesh<2>, rho: &[f64], values: &[f64]) -> (Quality, f64) {
    let lattice = mesh.lattice();
    let (rho, values) = (lattice.closed(rho), lattice.closed(values));
    let (mut quality, integral) = pulp::Arch::new().dispatch(AllCells { mesh, rho: &rho, values: &values });
    if mesh.chart().is_some() {
        // ρ is that of the unit box, in which equal cells are those of the map
        let places = AllCells { mesh: mesh.parameters(), rho: &rho, values: &rho };
        quality.equidistribution = pulp::Arch::new().dispatch(places).0.equidistribution;
    }
    (quality, integral)
}

/// The figures of all cells as a task for [`pulp`], which compiles it once more for wider vectors and runs what the
/// machine supports. Products and sums are not fused, so that the bits are the same on every machine.
struct AllCells<'a> {
    mesh: &'a Mesh<2>,
    /// ρ at the nodes, of shape cells + 1.
    rho: &'a [f64],
    values: &'a [f64],
}

impl pulp::WithSimd for AllCells<'_> {
    type Output = (Quality, f64);

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) -> (Quality, f64) {
        let Self { mesh, rho, values } = self;
        let [n, m] = mesh.lattice().cells();
        // the scale of ρ cancels, and products with it must not overflow
        let quarter = 0.25 * largest(rho).recip();
        let [mut q, mut share, mut part, mut least] = [0; 4].map(|_| vec![0.0; m]);
        // accumulated for each column of cells: within a row every sum would wait for the last one
        let mut q_all = Column::new(m);
        let mut share_all = Column::new(m);
        let (mut parts, mut least_all) = (vec![0.0; m], vec![f64::INFINITY; m]);
        for_each_row_of_cells(mesh, |nodes, row| {
            let [rho_before, rho_after] = nodes.clone().map(|nodes| &rho[nodes][..m + 1]);
            let [before, after] = nodes.map(|nodes| &values[nodes][..m + 1]);
            let (q, share, part, least) = (&mut q[..m], &mut share[..m], &mut part[..m], &mut least[..m]);
            for j in 0..m {
                let cell = row.cell(j);
                let area;
                [q[j], area] = cell.shape();
                share[j] = (rho_before[j] + rho_after[j] + (rho_after[j + 1] + rho_before[j + 1])) * quarter * area;
                part[j] = (before[j] + after[j] + (after[j + 1] + before[j + 1])) * area;
                least[j] = cell.least_jacobian();
            }
            q_all.add(q);
            share_all.add(share);
            parts.iter_mut().zip(&*part).for_each(|(sum, part)| *sum += part);
            least_all.iter_mut().zip(&*least).for_each(|(least, &j)| *least = smaller(*least, j));
        });
        let count = (n * m) as f64;
        let quality = Quality {
            q_max: q_all.largest(),
            q_mean: q_all.sum() / count,
            min_scaled_jacobian: least_all.into_iter().fold(f64::INFINITY, smaller) / uniform_jacobian(mesh),
            equidistribution: share_all.largest() * count / share_all.sum(),
        };
        (quality, 0.25 * parts.iter().sum::<f64>())
    }
}

/// Sums and maxima over rows of positive numbers, for each place of a row.
struct Column {
    sums: Vec<f64>,
    most: Vec<f64>,
}

impl Column {
    fn new(places: usize) -> Self {
        Self { sums: vec![0.0; places], most: vec![0.0; places] }
    }

    #[inline(always)]
    fn add(&mut self, row: &[f64]) {
        self.sums.iter_mut().zip(row).for_each(|(sum, value)| *sum += value);
        self.most.iter_mut().zip(row).for_each(|(most, &value)| *most = if value > *most { value } else { *most });
    }

    fn sum(&self) -> f64 {
        self.sums.iter().sum()
    }

    fn largest(&self) -> f64 {
        self.most.iter().copied().fold(0.0, f64::max)
    }
}

pub(super) fn jacobians_in_plane(mesh: &Mesh<2>) -> Vec<f64> {
    let uniform = uniform_jacobian(mesh);
    let mut all = Vec::with_capacity(mesh.lattice().cells().iter().product());
    for_each_cell(mesh, |_, _, corners| {
        all.push(Edges::of(corners).least_jacobian() / uniform);
    });
    all
}

pub(super) fn qualities_in_plane(mesh: &Mesh<2>) -> Vec<f64> {
    let mut all = Vec::with_capacity(mesh.lattice().cells().iter().product());
    for_each_cell(mesh, |_, _, corners| all.push(Edges::of(corners).shape()[0]));
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Failure;
    use crate::geometry::{Cells, Lattice, cell_areas, check_unfolded, node_areas, quality};

    fn square(cells: usize) -> Mesh<2> {
        Mesh::uniform(Lattice::bounded([cells, cells]).unwrap(), [0.0, 0.0], [1.0, 1.0]).unwrap()
    }

    /// A shear of the unit square by s has J = [[1, s], [0, 1]], so Q = ½ (2 + s²) and every Jacobian ratio is 1.
    #[test]
    fn a_sheared_mesh_has_the_q_of_its_shear() {
        let mesh = square(4);
        let sheared = mesh.moved(mesh.x().iter().map(|&[x, y]| [x + 0.5 * y, y]).collect()).unwrap();
        let q = quality(&sheared, &[1.0; 25]).unwrap();
        assert!((q.q_max - 1.125).abs() < 1e-14 && (q.q_mean - 1.125).abs() < 1e-14);
        assert!((q.min_scaled_jacobian - 1.0).abs() < 1e-13);
    }

    #[test]
    fn node_areas_add_up_to_the_box() {
        let mesh = square(5);
        let moved =
            mesh.moved(mesh.x().iter().map(|&[x, y]| [x * x, (y + 0.2 * x * (1.0 - y) * y)]).collect()).unwrap();
        assert!((node_areas(&moved).iter().sum::<f64>() - 1.0).abs() < 1e-14);
        assert!((cell_areas(&moved).iter().sum::<f64>() - 1.0).abs() < 1e-14);
    }

    /// On bounded and on periodic meshes it is the sum over the nodes with their areas.
    #[test]
    fn an_integral_is_a_sum_over_the_areas_of_nodes() {
        for periodic in [[false; 2], [true, false], [true; 2]] {
            let mesh = Mesh::uniform(Lattice::new([7, 5], periodic).unwrap(), [0.0, 0.0], [1.0, 2.0]).unwrap();
            let moved =
                mesh.moved(mesh.x().iter().map(|&[x, y]| [x, y + 0.01 * (6.3 * x).sin() * y * (2.0 - y)]).collect());
            let moved = moved.unwrap();
            let values: Vec<f64> = moved.x().iter().map(|[x, y]| 1.0 + x * x + 3.0 * y).collect();
            let sum: f64 = node_areas(&moved).iter().zip(&values).map(|(area, value)| area * value).sum();
            assert!((moved.quality_and_integral(&values, &values).1 - sum).abs() < 1e-13 * sum, "{periodic:?}");
        }
    }

    /// Moving node (2, 2) of a 4 × 4 mesh past (3, 3) folds the cell between them.
    #[test]
    fn a_folded_cell_is_named() {
        let mesh = square(4);
        let mut x = mesh.x().to_vec();
        x[12] = [0.8, 0.8];
        let error = check_unfolded(&mesh.moved(x.clone()).unwrap()).unwrap_err();
        assert!(
            matches!(error, Failure::Folded { ref cell, jacobian, .. } if jacobian < 0.0 && cell == &[2, 2]),
            "{error}"
        );
        x[12] = [f64::NAN, 0.5];
        let error = mesh.moved(x).unwrap_err();
        assert!(matches!(error, Failure::NonFinite { ref at, .. } if *at.node == [2, 2]), "{error}");
        assert!(check_unfolded(&mesh).is_ok());
    }
}
