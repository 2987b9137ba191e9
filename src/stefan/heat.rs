//! One implicit step of the heat equation in one phase.

use super::columns::Columns;
use crate::error::{Failure, Result};
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

impl HeatStep<'_> {
    /// (u − uⁿ)/Δt − w ∂u/∂y = D Δu for u on the new mesh.
    pub fn solve(&self, solver: &mut Robust<1>, laplacian: Laplacian) -> Result<Vec<f64>> {
        let mesh = self.columns.mesh(self.phase, self.y, self.mirrored)?;
        let stencils = unchecked(&mesh, laplacian)?;
        let Some(nine) = stencils.nine_points() else { return Ok(self.sides.to_vec()) };
        let nodes = self.columns.rows(self.phase) + 1;
        let first = usize::from(!self.mirrored);
        let patch = Patch { wraps: [false; 2], ..*stencils.patch() };
        let [count, inside] = patch.size;
        let mut matrix = LatticeMatrix::<2, 9>::zero(patch);
        let mut b = vec![[0.0]; patch.len()];
        let mut x = vec![[0.0]; patch.padded_len()];
        let mut largest = 1.0_f64;
        for i in 0..count {
            for j in 0..inside {
                let (k, own) = (i * inside + j, (i + first) * nodes + j + 1);
                let mut row = nine[k].map(|a| -self.dt * self.diffusivity * a);
                row[0] += 1.0;
                if let Some(w) = self.velocity {
                    let weights = slope([self.y[own - 1], self.y[own], self.y[own + 1]]);
                    // the node and its neighbours along the column
                    for (place, weight) in [3, 0, 4].into_iter().zip(weights) {
                        row[place] -= self.dt * w[own] * weight;
                    }
                }
                if self.mirrored {
                    // (−,·) is the image of (+,·) beyond the left side, and the other way round
                    let pairs = [(1, 2), (5, 7), (6, 8)];
                    let fold = |(from, to): (usize, usize), row: &mut [f64; 9]| {
                        row[to] += row[from];
                        row[from] = 0.0;
                    };
                    if i == 0 {
                        pairs.into_iter().for_each(|pair| fold(pair, &mut row));
                    }
                    if i + 1 == count {
                        pairs.into_iter().for_each(|(a, b)| fold((b, a), &mut row));
                    }
                }
                // Relative to the row itself: rows near a finely graded front are larger by orders of magnitude, and a
                // common tolerance would be set by the rounding of these.
                let own_size = row[0].abs().max(1.0);
                let row = row.map(|a| a / own_size);
                largest = row.iter().fold(largest, |m, a| m.max(a.abs()));
                matrix.rows[k] = row;
                b[k] = [self.u[own] / own_size];
            }
        }
        // columns of the patch with the ring around them
        let width = inside + 2;
        for (p, x) in x.chunks_exact_mut(width).enumerate() {
            let Some(i) = (p + first).checked_sub(1).filter(|&i| i < self.columns.x().len()) else { continue };
            x.iter_mut().zip(&self.sides[i * nodes..]).for_each(|(x, side)| x[0] = *side);
        }
        let size = self.sides.iter().chain(self.u).copied().fold(0.0, larger);
        // the round-off of a sum of nine terms
        solver.solve(&matrix, &b, &mut x, [2e-14 * largest * size.max(f64::MIN_POSITIVE)])?;
        let mut u = self.sides.to_vec();
        for (p, x) in x.chunks_exact(width).enumerate().skip(1).take(count) {
            let i = p + first - 1;
            for j in 1..=inside {
                u[i * nodes + j] = x[j][0];
            }
        }
        match u.iter().position(|u| !u.is_finite()) {
            None => Ok(u),
            Some(k) => {
                let (i, j) = (k / nodes, k % nodes);
                let x = [self.columns.x()[i], self.y[k]];
                Err(Failure::NonFinite { what: "the temperature", value: u[k], node: [i, j], x }.into())
            }
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
