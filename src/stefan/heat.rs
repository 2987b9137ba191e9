//! One implicit step of the heat equation in one phase.

use super::columns::Columns;
use super::conduct::{Edges, Reach};
use crate::error::{Failure, Result};
use crate::geometry::{Mesh, Patch};
use crate::laplacian::{Laplacian, unchecked};
use crate::numerics::larger;
use crate::numerics::linear::{BlockMatrix, LatticeMatrix, LinearSolver, Robust, RobustTransport};
use crate::work::Work;

/// The data of one phase in a step.
pub(super) struct HeatStep<'a> {
    pub columns: &'a Columns,
    pub reach: Reach<'a>,
    pub diffusivity: f64,
    pub dt: f64,
    /// Heights of the nodes at the end of the step.
    pub y: &'a [f64],
    /// Velocities of the nodes; none where the values have been carried to the new places before the step.
    pub velocity: Option<&'a [f64]>,
    /// Values at the start.
    pub u: &'a [f64],
    /// At the end of the step: given values on walls, front and Dirichlet sides; a guess elsewhere.
    pub sides: &'a [f64],
    /// Slopes at the edges where no value is given.
    pub edges: &'a Edges,
    /// Whether values are given on the left and the right side.
    pub held: [bool; 2],
}

/// Unknowns from which on multigrid is faster than alternating directions, which keep symmetry to round-off.
const MANY: usize = 4096;

/// The linear solvers of a phase.
#[derive(Debug, Default)]
pub(super) struct Solver {
    few: Robust<1>,
    many: RobustTransport<1>,
}

impl Solver {
    fn solve(
        &mut self,
        matrix: &LatticeMatrix<2, 9>,
        b: &[[f64; 1]],
        x: &mut [[f64; 1]],
        tolerance: [f64; 1],
    ) -> Result<Work, Failure> {
        if matrix.rows.len() < MANY {
            return self.few.solve(matrix, b, x, tolerance);
        }
        let rows = matrix.rows.iter().map(|row| row.map(|a| [[a]])).collect();
        self.many.solve(&BlockMatrix::<2, 9, 1> { patch: matrix.patch, rows }, b, x, tolerance)
    }
}

/// The rows of 1 − Δt (D Δ + w ∂/∂y) for the unknowns of a phase, and what the slope at the wall adds to the right
/// side.
struct Rows {
    matrix: LatticeMatrix<2, 9>,
    source: Vec<f64>,
}

/// Weights of ∂/∂y at the middle of three heights, exact for quadratics.
pub(super) fn slope([below, here, above]: [f64; 3]) -> [f64; 3] {
    let (a, b) = (here - below, above - here);
    [-b / (a * (a + b)), (b - a) / (a * b), a / (b * (a + b))]
}

/// ∂/∂y at the first of three heights, exact for quadratics.
pub(super) fn end_slope(y: [f64; 3], u: [f64; 3]) -> f64 {
    let (a, b) = (y[1] - y[0], y[2] - y[0]);
    (u[1] - u[0]) * b / (a * (b - a)) - (u[2] - u[0]) * a / (b * (b - a))
}

/// ∂/∂y at the first of four heights, exact for cubics.
pub(super) fn end_slope_of_four(y: [f64; 4], u: [f64; 4]) -> f64 {
    // Newton's divided differences
    let over = |a: f64, b: f64, i: usize, j: usize| (b - a) / (y[j] - y[i]);
    let first = [0, 1, 2].map(|i| over(u[i], u[i + 1], i, i + 1));
    let second = [0, 1].map(|i| over(first[i], first[i + 1], i, i + 2));
    let third = over(second[0], second[1], 0, 3);
    first[0] + (y[0] - y[1]) * (second[0] + (y[0] - y[2]) * third)
}

/// The largest residual of the linear system, as a share of its largest entry times the largest temperature: the
/// round-off of a sum of nine terms.
const ROUNDING: f64 = 2e-14;

impl HeatStep<'_> {
    /// (u − uⁿ)/Δt − w ∂u/∂y = D Δu for u on the new mesh.
    pub fn solve(&self, solver: &mut Solver, laplacian: Laplacian) -> Result<(Vec<f64>, Work)> {
        let Some(Rows { mut matrix, source }) = self.rows(laplacian)? else {
            return Ok((self.sides.to_vec(), Work::default()));
        };
        let value = |(k, source): (usize, &f64)| [self.u[self.own(&matrix.patch, k)] + source];
        let mut b: Vec<[f64; 1]> = source.iter().enumerate().map(value).collect();
        // rows near a finely graded front are larger by orders of magnitude than the others, and a common tolerance
        // would be set by their rounding
        for (row, b) in matrix.rows.iter_mut().zip(&mut b) {
            let size = row[0].abs().max(1.0);
            *row = row.map(|a| a / size);
            b[0] /= size;
        }
        let mut x = self.padded(&matrix.patch, self.sides);
        let largest = matrix.rows.as_flattened().iter().fold(1.0_f64, |m, a| m.max(a.abs()));
        let size = self.sides.iter().chain(self.u).chain(&source).copied().fold(0.0, larger);
        let work = solver.solve(&matrix, &b, &mut x, [ROUNDING * largest * size.max(f64::MIN_POSITIVE)])?;
        let mut u = self.sides.to_vec();
        for k in 0..matrix.patch.len() {
            u[self.own(&matrix.patch, k)] = x[place(&matrix.patch, k)][0];
        }
        match u.iter().position(|u| !u.is_finite()) {
            None => Ok((u, work)),
            Some(k) => Err(self.columns.not_finite("the temperature", u[k], self.reach.phase, k, self.y[k]).into()),
        }
    }

    /// What the nodes that are unknown gain in a time Δt at the rate D Δu + w ∂u/∂y of the values u; 0 at the others.
    pub fn gain(&self, laplacian: Laplacian) -> Result<Vec<f64>> {
        let mut gain = vec![0.0; self.u.len()];
        let Some(Rows { matrix, source }) = self.rows(laplacian)? else { return Ok(gain) };
        let mut product = vec![[0.0]; matrix.patch.padded_len()];
        matrix.multiply(&self.padded(&matrix.patch, self.u), &mut product);
        for (k, source) in source.into_iter().enumerate() {
            let own = self.own(&matrix.patch, k);
            gain[own] = self.u[own] + source - product[place(&matrix.patch, k)][0];
        }
        Ok(gain)
    }

    /// Number of nodes in a column of the phase.
    fn nodes(&self) -> usize {
        self.columns.rows(self.reach.phase) + 1
    }

    /// Rows of the mesh below the lowest node: one of ghosts where no value is given there.
    fn below(&self) -> usize {
        usize::from(self.edges.ends[0].is_some())
    }

    /// The node of the k-th unknown.
    fn own(&self, patch: &Patch<2>, k: usize) -> usize {
        let [i, j] = [k / patch.size[1], k % patch.size[1]];
        (i + usize::from(self.held[0])) * self.nodes() + j + 1 - self.below()
    }

    /// Values of the nodes as a padded vector, whose ring lies on sides with given values and beyond others, where it
    /// is 0.
    fn padded(&self, patch: &Patch<2>, values: &[f64]) -> Vec<[f64; 1]> {
        let (width, nodes) = (patch.size[1] + 2, self.nodes());
        let mut x = vec![[0.0]; patch.padded_len()];
        for (p, x) in x.chunks_exact_mut(width).enumerate() {
            let column = (p + usize::from(self.held[0])).checked_sub(1).filter(|&i| i < self.columns.x().len());
            let Some(i) = column else { continue };
            x[self.below()..].iter_mut().zip(&values[i * nodes..(i + 1) * nodes]).for_each(|(x, value)| x[0] = *value);
        }
        x
    }

    /// The mesh of the phase with mirrored columns beyond the sides, and with ghosts beyond a row without a given
    /// value: the mirror images of the nodes next to it.
    fn mesh(&self) -> Result<Mesh<2>> {
        let ends = &self.edges.ends;
        let ghosts = ends.iter().flatten().count();
        let mut y = Vec::with_capacity(self.y.len() + ghosts * self.columns.x().len());
        for column in self.y.chunks_exact(self.nodes()) {
            let last = column.len() - 1;
            y.extend(ends[0].iter().map(|_| 2.0 * column[0] - column[1]));
            y.extend_from_slice(column);
            y.extend(ends[1].iter().map(|_| 2.0 * column[last] - column[last - 1]));
        }
        self.columns.mesh(self.nodes() + ghosts, &y, self.held.map(|held| !held))
    }

    fn rows(&self, laplacian: Laplacian) -> Result<Option<Rows>> {
        let stencils = unchecked(&self.mesh()?, laplacian)?;
        let Some(nine) = stencils.nine_points() else { return Ok(None) };
        let patch = Patch { wraps: [false; 2], ..*stencils.patch() };
        let [count, inside] = patch.size;
        let mut matrix = LatticeMatrix::<2, 9>::zero(patch);
        let mut source = vec![0.0; patch.len()];
        let last = self.nodes() - 1;
        for (k, laplacian) in nine.iter().enumerate() {
            let i = k / inside;
            let own = self.own(&patch, k);
            if self.is_given(own) {
                matrix.rows[k][0] = 1.0;
                source[k] = self.sides[own] - self.u[own];
                continue;
            }
            let mut row = self.row(own, laplacian);
            for (end, at) in [0, last].into_iter().enumerate() {
                if let Some(slopes) = self.edges.ends[end].as_ref().filter(|_| own % self.nodes() == at) {
                    source[k] = -self.reflect(&mut row, [own / self.nodes(), end], slopes);
                }
            }
            for (side, on) in [i == 0, i + 1 == count].into_iter().enumerate() {
                if on && !self.held[side] {
                    source[k] -= self.fold(&mut row, own, side);
                }
            }
            matrix.rows[k] = row;
        }
        Ok(Some(Rows { matrix, source }))
    }

    /// Whether a value is given at a node among the unknowns.
    fn is_given(&self, own: usize) -> bool {
        let (i, j, last) = (own / self.nodes(), own % self.nodes(), self.nodes() - 1);
        let on = |end: usize| self.edges.ends[end].as_ref().is_some_and(|slopes| slopes[i].is_none());
        self.reach.missing(i) || j == 0 && on(0) || j == last && on(1)
    }

    /// The coefficients of 1 − Δt (D Δ + w ∂/∂y) at node `own`.
    fn row(&self, own: usize, laplacian: &[f64; 9]) -> [f64; 9] {
        let mut row = laplacian.map(|a| -self.dt * self.diffusivity * a);
        row[0] += 1.0;
        // only walls are unknown at an end, and do not move
        let inside = !own.is_multiple_of(self.nodes()) && !(own + 1).is_multiple_of(self.nodes());
        if let Some(w) = self.velocity.filter(|_| inside) {
            let weights = slope([self.y[own - 1], self.y[own], self.y[own + 1]]);
            // the node and its neighbours along the column
            for (place, weight) in [3, 0, 4].into_iter().zip(weights) {
                row[place] -= self.dt * w[own] * weight;
            }
        }
        row
    }

    /// Adds the coefficients of the points beyond the left or the right side to those of their images, from which they
    /// differ by the slope at the side; returns the constant of the row that this leaves.
    fn fold(&self, row: &mut [f64; 9], own: usize, side: usize) -> f64 {
        const PLACES: [usize; 3] = [3, 0, 4];
        let (i, j, nodes) = (own / self.nodes(), own % self.nodes(), self.nodes());
        let next = if side == 0 { i + 1 } else { i - 1 };
        let distance = 2.0 * self.columns.spacing();
        let mut constant = 0.0;
        // (−,·) is the image of (+,·) beyond the left side, and the other way round
        for (low, high, up) in [(5, 7, -1), (1, 2, 0), (6, 8, 1)] {
            let (ghost, image) = if side == 0 { (low, high) } else { (high, low) };
            let weight = std::mem::take(&mut row[ghost]);
            row[image] += weight;
            let at = j.checked_add_signed(up).filter(|at| *at < nodes);
            let (Some(at), Some(slopes)) = (at, &self.edges.sides[side]) else { continue };
            // at the height of the image, from two rows
            let y = |j: usize| self.y[i * nodes + j];
            let off = self.y[next * nodes + at] - y(at);
            let other = match up {
                0 if (off > 0.0 || j == 0) && j + 1 < nodes => j + 1,
                0 => j - 1,
                _ => j,
            };
            let share = off / (y(other) - y(at));
            for (k, part) in [(at, 1.0 - share), (other, share)] {
                let [a, b] = slopes[k];
                row[PLACES[k + 1 - j]] += weight * distance * part * b;
                constant += weight * distance * part * a;
            }
        }
        constant
    }

    /// Expresses the ghosts beyond an end of the i-th column by their images and by the slope at the end, and returns
    /// the constant of the row that this leaves.
    fn reflect(&self, row: &mut [f64; 9], [i, end]: [usize; 2], slopes: &[Option<[f64; 2]>]) -> f64 {
        let (nodes, last) = (self.nodes(), self.columns.x().len() - 1);
        let [at, next] = if end == 0 { [0, 1] } else { [nodes - 1, nodes - 2] };
        // the place of the node at the end, and of its neighbours below and above
        let columns = [(i, [0, 3, 4]), (i.checked_sub(1).unwrap_or(1), [1, 5, 6]), (i + 1, [2, 7, 8])];
        let mut constant = 0.0;
        for (column, [on_wall, low, high]) in columns {
            let column = if column > last { last - 1 } else { column };
            let (ghost, image) = if end == 0 { (low, high) } else { (high, low) };
            let weight = std::mem::take(&mut row[ghost]);
            let [a, b] = slopes[column].or(slopes[i]).unwrap_or_default();
            // u at the ghost is u at its image plus this distance times the slope
            let distance = 2.0 * (self.y[column * nodes + at] - self.y[column * nodes + next]);
            row[image] += weight;
            row[on_wall] += weight * distance * b;
            constant += weight * distance * a;
        }
        constant
    }
}

/// The place of the k-th unknown in a padded vector.
fn place(patch: &Patch<2>, k: usize) -> usize {
    (k / patch.size[1] + 1) * (patch.size[1] + 2) + k % patch.size[1] + 1
}

/// Interpolates the values of a column linearly at other heights. The front node takes the new place of the front at
/// once, and nodes that the front has passed are dropped.
pub(super) fn carry(y: &[f64], u: &[f64], front: usize, new: &[f64], to: &mut [f64]) {
    let last = y.len() - 1;
    // row numbers counted from the wall to the front
    let toward = |j: usize| if front == last { j } else { last - j };
    let up = if front == last { 1.0 } else { -1.0 };
    let h = new[front];
    let mut known: Vec<(f64, f64)> =
        (0..last).map(toward).map(|j| (y[j], u[j])).filter(|(y, _)| up * (h - y) > 0.0).collect();
    known.push((h, u[front]));
    let mut k = 0;
    for j in (0..=last).map(toward) {
        while k + 2 < known.len() && up * (new[j] - known[k + 1].0) > 0.0 {
            k += 1;
        }
        let [(y0, u0), (y1, u1)] = [known[k], known[(k + 1).min(known.len() - 1)]];
        to[j] = if y1 == y0 { u0 } else { u0 + (u1 - u0) * (new[j] - y0) / (y1 - y0) };
    }
}
