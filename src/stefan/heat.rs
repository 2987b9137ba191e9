//! One implicit step of the heat equation in one phase.

use super::columns::Columns;
use crate::error::Result;
use crate::geometry::Patch;
use crate::laplacian::{Laplacian, unchecked};
use crate::numerics::larger;
use crate::numerics::linear::{LatticeMatrix, LinearSolver, Robust};

/// The data of one phase in a step.
pub(super) struct HeatStep<'a> {
    pub columns: &'a Columns,
    pub phase: usize,
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
    /// Whether nothing flows through the sides; otherwise their values are given.
    pub mirrored: bool,
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

/// The largest residual of the linear system, as a share of its largest entry times the largest temperature: the
/// round-off of a sum of nine terms.
const ROUNDING: f64 = 2e-14;

impl HeatStep<'_> {
    /// (u − uⁿ)/Δt − w ∂u/∂y = D Δu for u on the new mesh.
    pub fn solve(&self, solver: &mut Robust<1>, laplacian: Laplacian) -> Result<Vec<f64>> {
        let mesh = self.columns.mesh(self.phase, self.y, self.mirrored)?;
        let stencils = unchecked(&mesh, laplacian)?;
        let Some(nine) = stencils.nine_points() else { return Ok(self.sides.to_vec()) };
        let patch = Patch { wraps: [false; 2], ..*stencils.patch() };
        let (matrix, b) = self.system(patch, nine);
        let mut x = vec![[0.0]; patch.padded_len()];
        let (nodes, width) = (self.nodes(), patch.size[1] + 2);
        for (p, x) in x.chunks_exact_mut(width).enumerate() {
            let Some(i) = self.column(p) else { continue };
            x.iter_mut().zip(&self.sides[i * nodes..]).for_each(|(x, side)| x[0] = *side);
        }
        let largest = matrix.rows.as_flattened().iter().fold(1.0_f64, |m, a| m.max(a.abs()));
        let size = self.sides.iter().chain(self.u).copied().fold(0.0, larger);
        solver.solve(&matrix, &b, &mut x, [ROUNDING * largest * size.max(f64::MIN_POSITIVE)])?;
        let mut u = self.sides.to_vec();
        for (p, x) in x.chunks_exact(width).enumerate().skip(1).take(patch.size[0]) {
            let Some(i) = self.column(p) else { continue };
            u[i * nodes..][1..width - 1].iter_mut().zip(&x[1..]).for_each(|(u, x)| *u = x[0]);
        }
        match u.iter().position(|u| !u.is_finite()) {
            None => Ok(u),
            Some(k) => Err(self.columns.not_finite("the temperature", u[k], self.phase, k, self.y[k]).into()),
        }
    }

    /// Number of nodes in a column of the phase.
    fn nodes(&self) -> usize {
        self.columns.rows(self.phase) + 1
    }

    /// The column that is the p-th of a padded vector, whose ring lies on sides with given values and beyond mirrored
    /// ones.
    fn column(&self, p: usize) -> Option<usize> {
        (p + usize::from(!self.mirrored)).checked_sub(1).filter(|&i| i < self.columns.x().len())
    }

    /// The linear system for the nodes of a patch, of which `nine` holds the weights of the Laplacian. Each row is
    /// divided by its own entry if that is above 1: rows near a finely graded front are larger by orders of magnitude,
    /// and a common tolerance would be set by the rounding of these.
    fn system(&self, patch: Patch<2>, nine: &[[f64; 9]]) -> (LatticeMatrix<2, 9>, Vec<[f64; 1]>) {
        let [count, inside] = patch.size;
        let mut matrix = LatticeMatrix::<2, 9>::zero(patch);
        let mut b = vec![[0.0]; patch.len()];
        for (k, laplacian) in nine.iter().enumerate() {
            let (i, j) = (k / inside, k % inside);
            let own = (i + usize::from(!self.mirrored)) * self.nodes() + j + 1;
            let mut row = self.row(own, laplacian);
            if self.mirrored {
                fold(&mut row, [i == 0, i + 1 == count]);
            }
            let size = row[0].abs().max(1.0);
            matrix.rows[k] = row.map(|a| a / size);
            b[k] = [self.u[own] / size];
        }
        (matrix, b)
    }

    /// The coefficients of 1 − Δt (D Δ + w ∂/∂y) at node `own`.
    fn row(&self, own: usize, laplacian: &[f64; 9]) -> [f64; 9] {
        let mut row = laplacian.map(|a| -self.dt * self.diffusivity * a);
        row[0] += 1.0;
        if let Some(w) = self.velocity {
            let weights = slope([self.y[own - 1], self.y[own], self.y[own + 1]]);
            // the node and its neighbours along the column
            for (place, weight) in [3, 0, 4].into_iter().zip(weights) {
                row[place] -= self.dt * w[own] * weight;
            }
        }
        row
    }
}

/// Adds the coefficients of the points beyond a mirrored left or right side to those of their images.
fn fold(row: &mut [f64; 9], [left, right]: [bool; 2]) {
    // (−,·) is the image of (+,·) beyond the left side, and the other way round
    for (low, high) in [(1, 2), (5, 7), (6, 8)] {
        if left {
            row[high] += std::mem::take(&mut row[low]);
        }
        if right {
            row[low] += std::mem::take(&mut row[high]);
        }
    }
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
    known.push((h, 0.0));
    let mut k = 0;
    for j in (0..=last).map(toward) {
        while k + 2 < known.len() && up * (new[j] - known[k + 1].0) > 0.0 {
            k += 1;
        }
        let [(y0, u0), (y1, u1)] = [known[k], known[(k + 1).min(known.len() - 1)]];
        to[j] = if y1 == y0 { u0 } else { u0 + (u1 - u0) * (new[j] - y0) / (y1 - y0) };
    }
}
