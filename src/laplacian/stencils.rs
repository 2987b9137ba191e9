use super::{Laplacian, NEAR_DEGENERATE, node};
use crate::error::Failure;
use crate::geometry::{Mesh, Patch};
use crate::numerics::linear::LatticeMatrix;

/// A node whose neighbours hardly determine its Laplacian.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NearDegenerate {
    /// Indices of the node along ξ and η.
    pub node: [usize; 2],
    /// Where the node is.
    pub x: [f64; 2],
    /// Condition number of its stencil.
    pub condition: f64,
}

/// One row of the compact scheme: its points, and their weights.
#[derive(Debug, Clone)]
pub(super) struct Window {
    /// Lattice node of the first of the 5 × 5 points.
    pub first: [usize; 2],
    /// Weights on u.
    pub a: [f64; 25],
    /// Weights on Δu.
    pub b: [f64; 25],
}

#[derive(Debug, Clone)]
enum Rows {
    Nine(Vec<[f64; 9]>),
    TwentyFive(Vec<Window>),
}

/// The discrete Laplacian of a mesh, one row for each node that is not on a bounded side.
#[derive(Debug, Clone)]
pub struct Stencils {
    laplacian: Laplacian,
    patch: Patch<2>,
    nodes: [usize; 2],
    rows: Rows,
    near_degenerate: Vec<NearDegenerate>,
}

impl Stencils {
    pub(super) fn nine(
        mesh: &Mesh<2>,
        laplacian: Laplacian,
        patch: Patch<2>,
        rows: Vec<[f64; 9]>,
        conditions: &[f64],
    ) -> Self {
        Self { rows: Rows::Nine(rows), ..Self::new(mesh, laplacian, patch, conditions) }
    }

    pub(super) fn twenty_five(mesh: &Mesh<2>, patch: Patch<2>, rows: Vec<Window>, conditions: &[f64]) -> Self {
        Self { rows: Rows::TwentyFive(rows), ..Self::new(mesh, Laplacian::Compact25, patch, conditions) }
    }

    fn new(mesh: &Mesh<2>, laplacian: Laplacian, patch: Patch<2>, conditions: &[f64]) -> Self {
        let tell = |(k, &condition): (usize, &f64)| {
            let node = node(&patch, k);
            let x = mesh.x()[mesh.lattice().index(node)];
            // The columns of the published method differ in size by design: their condition number says nothing about
            // the mesh.
            let near = !matches!(laplacian, Laplacian::Published { .. })
                && (condition.is_nan() || condition > NEAR_DEGENERATE);
            near.then_some(NearDegenerate { node, x, condition })
        };
        let near_degenerate = conditions.iter().enumerate().filter_map(tell).collect();
        Self { laplacian, patch, nodes: mesh.lattice().nodes(), rows: Rows::Nine(Vec::new()), near_degenerate }
    }

    /// The same stencils with other weights of nine points.
    pub(super) fn with_rows(&self, rows: Vec<[f64; 9]>) -> Self {
        Self { rows: Rows::Nine(rows), ..self.clone() }
    }

    /// The kind of Laplacian.
    pub fn laplacian(&self) -> Laplacian {
        self.laplacian
    }

    /// The patch of the nodes that have a row.
    pub fn patch(&self) -> &Patch<2> {
        &self.patch
    }

    /// Nodes whose stencil has a condition number above [`NEAR_DEGENERATE`].
    pub fn near_degenerate(&self) -> &[NearDegenerate] {
        &self.near_degenerate
    }

    /// The nine-point rows, in the order of [`LatticeMatrix::POINTS`]; none for `compact25`.
    pub fn nine_points(&self) -> Option<&[[f64; 9]]> {
        match &self.rows {
            Rows::Nine(rows) => Some(rows),
            Rows::TwentyFive(_) => None,
        }
    }

    /// Lattice index of the node of row k.
    pub fn index(&self, k: usize) -> usize {
        let [i, j] = node(&self.patch, k);
        i * self.nodes[1] + j
    }

    /// (lattice index, weight on u, weight on Δu) of all points of row k; none where k is too large.
    pub fn row(&self, k: usize) -> Option<Vec<(usize, f64, f64)>> {
        (k < self.patch.len()).then(|| self.points(k))
    }

    /// The points of row k, which must exist.
    pub(super) fn points(&self, k: usize) -> Vec<(usize, f64, f64)> {
        let [i, j] = node(&self.patch, k);
        match &self.rows {
            Rows::Nine(rows) => {
                let place =
                    |c: usize, d: usize, step: isize| (c as isize + step).rem_euclid(self.nodes[d] as isize) as usize;
                let points = LatticeMatrix::<2, 9>::POINTS.iter().zip(&rows[k]);
                let entry = |([p, q], a): (&[isize; 2], &f64)| {
                    let source = if *p == 0 && *q == 0 { 1.0 } else { 0.0 };
                    (place(i, 0, *p) * self.nodes[1] + place(j, 1, *q), *a, source)
                };
                points.map(entry).collect()
            }
            Rows::TwentyFive(rows) => {
                let Window { first, a, b } = &rows[k];
                let at = |p: usize| (first[0] + p / 5) * self.nodes[1] + first[1] + p % 5;
                (0..25).map(|p| (at(p), a[p], b[p])).collect()
            }
        }
    }

    /// A u at the nodes of [`patch`](Self::patch), in order, from the values at all nodes of the lattice.
    ///
    /// # Errors
    /// [`Failure::WrongLength`] where `u` has not one value a node.
    pub fn apply(&self, u: &[f64]) -> Result<Vec<f64>, Failure> {
        let expected = self.nodes[0] * self.nodes[1];
        if u.len() != expected {
            return Err(Failure::WrongLength { what: "what the Laplacian is applied to", found: u.len(), expected });
        }
        Ok((0..self.patch.len()).map(|k| self.points(k).iter().map(|&(index, a, _)| a * u[index]).sum()).collect())
    }

    /// The share of rows in which all neighbours have weights ≥ 0.
    pub fn nonnegative_fraction(&self) -> f64 {
        let kept = |k: &usize| {
            let (own, row) = (self.index(*k), self.points(*k));
            let size = row.iter().fold(0.0_f64, |m, &(_, a, _)| m.max(a.abs()));
            row.iter().all(|&(index, a, _)| index == own || a >= -1e-12 * size)
        };
        (0..self.patch.len()).filter(kept).count() as f64 / self.patch.len() as f64
    }

    /// The largest error over all rows on the monomials of each degree from 0 to 6, in local units of length
    ///
    /// ```text
    /// |Σ a_j p(d_j/h) h² − Σ b_j (Δp)(d_j/h)|,   h = the largest distance to a neighbour along an axis
    /// ```
    pub fn residuals(&self, mesh: &Mesh<2>) -> [f64; 7] {
        self.residuals_in(mesh, |_| 1.0)
    }

    /// The same errors in units that are a function of the sum of the magnitudes of all terms.
    fn residuals_in(&self, mesh: &Mesh<2>, unit: impl Fn(f64) -> f64) -> [f64; 7] {
        let (x, jump) = (mesh.x(), mesh.jump());
        let mut worst = [0.0_f64; 7];
        for k in 0..self.patch.len() {
            let (own, row) = (self.index(k), self.points(k));
            let distance = |index: usize| -> [f64; 2] {
                std::array::from_fn(|c| {
                    let d = x[index][c] - x[own][c];
                    // the difference to the nearest image
                    let turn = if mesh.lattice().periodic()[c] { jump[c][c] } else { 0.0 };
                    if turn > 0.0 { d - turn * (d / turn).round() } else { d }
                })
            };
            let [i, j] = node(&self.patch, k);
            let near = |index: usize| {
                let apart = |a: usize, b: usize, n: usize| {
                    let d = a.abs_diff(b);
                    d.min(n - d) <= 1
                };
                apart(index / self.nodes[1], i, self.nodes[0]) && apart(index % self.nodes[1], j, self.nodes[1])
            };
            let h = row.iter().filter(|p| near(p.0)).fold(0.0_f64, |h, &(index, ..)| {
                let [dx, dy] = distance(index);
                h.max(dx.abs()).max(dy.abs())
            });
            for degree in 0..7_i32 {
                for m in 0..=degree {
                    let n = degree - m;
                    let (mut sum, mut size) = (0.0, 0.0);
                    for &(index, a, b) in &row {
                        let [x, y] = distance(index).map(|d| d / h);
                        let term = a * h * h * x.powi(m) * y.powi(n);
                        sum += term;
                        size += term.abs();
                        let second = |k: i32, x: f64| if k < 2 { 0.0 } else { f64::from(k * (k - 1)) * x.powi(k - 2) };
                        sum -= b * (second(m, x) * y.powi(n) + x.powi(m) * second(n, y));
                    }
                    let worst = &mut worst[degree as usize];
                    *worst = crate::numerics::larger(*worst, sum / unit(size));
                }
            }
        }
        worst
    }

    /// The highest degree up to which the Laplacian of every polynomial is exact at every node; none where not even
    /// constants are. Exact means an error of at most 1e-9, in local units or of the terms that cancel, which are large
    /// where cells are flat.
    pub fn exact_degree(&self, mesh: &Mesh<2>) -> Option<usize> {
        let residuals = self.residuals_in(mesh, |size| size.max(1.0));
        residuals.iter().take_while(|&&residual| residual <= 1e-9).count().checked_sub(1)
    }
}
