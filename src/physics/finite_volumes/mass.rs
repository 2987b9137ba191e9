//! The mass of nodal values: what they make of the integrals over dual cells.

use super::{Block, Law};
use crate::geometry::{Cells, DualCells, Mesh, Patch, dot, strides};
use crate::numerics::linear::LatticeMatrix;

/// The part C of the mass matrix of linear elements that couples neighbours where cells grow, less that of equal cells
///
/// Between nodes u is linear along the axes, and its integral against the hat function of node i is A u plus a share of
/// the differences to the neighbours. On a line
///
/// ```text
/// (M u)_i = A u_i + (C u)_i,   (C u)_i = w₊ (u_{i+1} − u_i) − w₋ (u_i − u_{i−1}),   w = (h² − h_min²)/(6h)
/// ```
///
/// with the lengths h of the cells on both sides of i. Without C a function that is linear around a node is integrated
/// as if the node was in the middle of its dual cell, with an error of the first order of h₊ − h₋. With h_min = 0 this
/// would be the mass matrix of linear elements, which overshoots at jumps; but only the differences of w h count, so
/// that nothing need be added where cells are smallest or equal: in the layers that the mesh resolves. In the plane C
/// is the product over both axes in each mesh cell. Its columns add up to 0, so that Σ A u stays what is conserved.
///
/// M = A + s C with a weight s, which is 1 but for fronts between two states that a source of u alone keeps stable
/// ([`BISTABLE`]) and fronts into states that grow.
///
/// # Source
/// Strang and Fix, *An Analysis of the Finite Element Method* (1973), for the mass matrix.
#[derive(Debug, Clone)]
pub(super) struct Excess<const B: usize, const D: usize, const S: usize> {
    /// The matrix C.
    matrix: LatticeMatrix<D, S>,
    offsets: [isize; S],
    /// The weight s of C for each unknown.
    weights: [f64; B],
}

/// The weight s of C for a front u(x − ct) of u_t = (D u')' + f(u) between two stable states
///
/// With cells whose lengths h change slowly, the truncation error is, up to parts that do not move a front,
///
/// ```text
/// τ = −(1/12) h² g″ − (1/6) (h²)′ g′ + (s/6) (h² g′)′,   g = f(u) − u_t = −D u″
/// ```
///
/// and changes its speed by −∫τ u′ / ∫u′². By parts that is (1 + 2s)/24 ∫D (h²)′ u″² / ∫u′²: with s = −½ the growth of
/// cells does not change the speed, while s = 1 has the smaller error where nothing moves.
pub(in crate::physics) const BISTABLE: f64 = -0.5;

impl<const B: usize, const D: usize, const S: usize> Excess<B, D, S> {
    /// The coupling C of a mesh, with a weight for each unknown.
    pub fn of(mesh: &Mesh<D>, weights: [f64; B]) -> Self
    where
        Mesh<D>: Cells<D>,
    {
        let lattice = mesh.lattice();
        let patch = Patch { origin: [0; D], size: lattice.nodes(), wraps: lattice.periodic() };
        let mut matrix = LatticeMatrix::<D, S>::zero(patch);
        let (nodes, node_strides, shares) = (lattice.nodes(), lattice.strides(), shares(mesh));
        let cells = lattice.cells();
        let (cell_strides, pairs) = (strides(cells), pairs::<D, S>());
        for (c, volume) in mesh.volumes().enumerate() {
            let cell: [usize; D] = std::array::from_fn(|d| c / cell_strides[d] % cells[d]);
            for &(from, to, point) in &pairs {
                let node: usize = (0..D).map(|d| (cell[d] + (from >> d & 1)) % nodes[d] * node_strides[d]).sum();
                // the mass of the cell between two of its corners, less its lumped mass
                let along = |d: usize| if (from ^ to) >> d & 1 == 1 { shares[c][d] } else { 0.5 - shares[c][d] };
                let mass: f64 = (0..D).map(along).product();
                let lumped = if from == to { 0.5_f64.powi(D as i32) } else { 0.0 };
                matrix.rows[node][point] += volume * (mass - lumped);
            }
        }
        let offsets = matrix.offsets();
        Self { matrix, offsets, weights }
    }

    /// s C v at node i, at place k of padded vectors.
    #[inline(always)]
    pub fn product(&self, i: usize, k: usize, v: impl Fn(usize) -> [f64; B]) -> [f64; B] {
        let mut sum = [0.0; B];
        for (weight, offset) in self.matrix.rows[i].iter().zip(self.offsets) {
            let v = v(k.wrapping_add_signed(offset));
            (0..B).for_each(|c| sum[c] += weight * v[c]);
        }
        std::array::from_fn(|c| if self.weights[c] == 0.0 { 0.0 } else { self.weights[c] * sum[c] })
    }

    /// Adds s C (I − ½ Δt S')/A to a row of a matrix, S' being the derivative of the source.
    #[inline(always)]
    pub fn add_to_row<L: Law<B, D>>(
        &self,
        row: &mut [Block<B>; S],
        (i, k): (usize, usize),
        (law, nodes): (&L, &[L::Node]),
        [area, dt]: [f64; 2],
    ) {
        for ((entry, weight), offset) in row.iter_mut().zip(&self.matrix.rows[i]).zip(self.offsets) {
            let weight = weight / area;
            let source = law.source(&nodes[k.wrapping_add_signed(offset)]);
            for c in (0..B).filter(|&c| self.weights[c] != 0.0) {
                let weight = self.weights[c] * weight;
                entry[c][c] += weight;
                if let Some((_, derivative)) = &source {
                    (0..B).for_each(|e| entry[c][e] -= 0.5 * dt * weight * derivative[c][e]);
                }
            }
        }
    }
}

/// All pairs of corners of a cell, by their bits along the axes, and where in a stencil the second lies from the first.
fn pairs<const D: usize, const S: usize>() -> Vec<(usize, usize, usize)> {
    let points = LatticeMatrix::<D, S>::POINTS;
    let corners = 1_usize << D;
    let pair = |from: usize, to: usize| {
        let way: [isize; D] = std::array::from_fn(|d| (to >> d & 1) as isize - (from >> d & 1) as isize);
        let point = points.iter().position(|point| *point == way);
        (from, to, point.expect("a stencil holds all corners of the cells around"))
    };
    (0..corners).flat_map(|from| (0..corners).map(move |to| (from, to))).map(|(from, to)| pair(from, to)).collect()
}

/// (d_k − d_i)·N for each face, d being the ways of the nodes on both sides in a step and N the mean normal, padded
///
/// Between nodes d and u are linear, and the mean of what a face carries is the product of means and a twelfth of the
/// product of these changes.
pub(super) fn stretched<const D: usize>([old, new]: [&DualCells<D>; 2], [from, to]: [&[[f64; D]]; 2]) -> Vec<[f64; D]> {
    let patch = new.patch();
    let strides = patch.padded_strides();
    let mut stretched = vec![[0.0; D]; from.len()];
    let way = |k: usize| -> [f64; D] { std::array::from_fn(|c| to[k][c] - from[k][c]) };
    for k in patch.places() {
        let own = way(k);
        for (d, s) in strides.into_iter().enumerate() {
            let other = way(k + s);
            let normal: [f64; D] = std::array::from_fn(|c| 0.5 * (old.normals()[k][d][c] + new.normals()[k][d][c]));
            stretched[k][d] = dot(std::array::from_fn(|c| other[c] - own[c]), normal);
        }
    }
    patch.wrap(&mut stretched);
    stretched
}

/// w/h of each cell along each axis: at most a sixth, so that A + C is positive definite.
pub(super) fn shares<const D: usize>(mesh: &Mesh<D>) -> Vec<[f64; D]> {
    let (cells, x) = (mesh.lattice().cells(), mesh.closed());
    let (cell_strides, corner_strides) = (strides(cells), strides(cells.map(|n| n + 1)));
    let count: usize = cells.iter().product();
    let length2 = |c: usize, axis: usize| {
        let lowest: usize = (0..D).map(|d| c / cell_strides[d] % cells[d] * corner_strides[d]).sum();
        // the mean of the edges along the axis
        let mut edge = [0.0; D];
        for corner in (0..1_usize << D).filter(|corner| corner >> axis & 1 == 0) {
            let a = lowest + (0..D).filter(|d| corner >> d & 1 == 1).map(|d| corner_strides[d]).sum::<usize>();
            let b = a + corner_strides[axis];
            (0..D).for_each(|d| edge[d] += x[b][d] - x[a][d]);
        }
        dot(edge, edge)
    };
    let mut shares = vec![[0.0; D]; count];
    for axis in 0..D {
        let (n, s) = (cells[axis], cell_strides[axis]);
        for first in (0..count).filter(|c| c / s % n == 0) {
            let line = || (0..n).map(|i| first + i * s);
            let least = line().map(|c| length2(c, axis)).fold(f64::INFINITY, f64::min);
            line().for_each(|c| shares[c][axis] = (1.0 - least / length2(c, axis)) / 6.0);
        }
    }
    shares
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Lattice, node_areas, padded};

    /// On a line whose cells grow, M integrates x against the hat functions but for the same number at all nodes
    /// within:
    /// ∫ x φ_i = A x_i + (h₊² − h₋²)/6. Columns of C add up to 0.
    #[test]
    fn linear_functions_have_their_mass() {
        let mesh = Mesh::uniform(Lattice::bounded([8]).unwrap(), [0.0], [1.0]).unwrap();
        let mesh = mesh.moved(mesh.x().iter().map(|[x]| [0.3 * x + 0.7 * x * x]).collect()).unwrap();
        let x: Vec<f64> = mesh.x().iter().map(|[x]| *x).collect();
        let padded = padded(mesh.lattice(), x.as_chunks::<1>().0, [[0.0]]);
        let excess = Excess::<1, 1, 3>::of(&mesh, [1.0]);
        let found: Vec<f64> = (0..9).map(|i| excess.product(i, i + 1, |k| padded[k])[0]).collect();
        for i in 1..8 {
            let [below, above] = [x[i] - x[i - 1], x[i + 1] - x[i]];
            assert!((found[i] - (above * above - below * below) / 6.0).abs() < 1e-15);
        }
        assert!(found.iter().sum::<f64>().abs() < 1e-15);
    }

    /// Equal cells have none; in the plane columns and rows of C add up to 0, and M is positive definite: no u has
    /// uᵀ M u < 0.
    #[test]
    fn mass_is_symmetric_and_positive() {
        let square = Mesh::uniform(Lattice::new([6, 7], [false, true]).unwrap(), [0.0; 2], [1.0; 2]).unwrap();
        let none = Excess::<1, 2, 9>::of(&square, [1.0]);
        assert!(none.matrix.rows.as_flattened().iter().all(|entry| entry.abs() < 1e-15));
        let bent =
            square.x().iter().map(|&[x, y]| [x * x, y + 0.1 * (std::f64::consts::TAU * y).sin() * x * (1.0 - x)]);
        let mesh = square.moved(bent.collect()).unwrap();
        let excess = Excess::<1, 2, 9>::of(&mesh, [1.0]);
        let areas = node_areas(&mesh);
        for p in 0..mesh.x().len() {
            let checkered = |k: usize| if (k / 7 + k % 7 + k * p).is_multiple_of(3) { 1.0 } else { -1.0 };
            let u: Vec<[f64; 1]> = (0..mesh.x().len()).map(|k| [checkered(k)]).collect();
            let padded = padded(mesh.lattice(), &u, [[0.0]; 2]);
            let places: Vec<usize> = Patch { origin: [0; 2], size: [7, 7], wraps: [false, true] }.places().collect();
            let product: Vec<f64> = (0..u.len()).map(|i| excess.product(i, places[i], |k| padded[k])[0]).collect();
            assert!(product.iter().sum::<f64>().abs() < 1e-14);
            assert!((0..u.len()).map(|i| u[i][0] * (areas[i] * u[i][0] + product[i])).sum::<f64>() > 0.0);
        }
    }
}
