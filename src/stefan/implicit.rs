//! The implicit front: it moves by the temperatures at the end of the step, which Newton's method finds.

use super::columns::{Columns, LOWER, UPPER};
use super::front::Filter;
use crate::error::Failure;
use faer::linalg::solvers::Solve;
use std::f64::consts::PI;

/// The approximate derivative of the jump of the heat flux by the height of the front
///
/// ```text
/// δJ = −Σ_i |D_i ∂u_i/∂y| √(k² + 1/(D_i Δt)) δh   for each wave number k
/// ```
///
/// If the front rises by δh, its old place gets the temperature −∂u/∂y δh, which in an implicit Euler step decays over
/// the distance 1/√(k² + 1/(DΔt)). Phases are assumed to be thicker than that. A fixed-point iteration without this
/// derivative would converge only up to half the explicit step limit.
pub(super) struct Response {
    /// √(k² + 1/(D_i Δt)) as a matrix over the columns, for each phase.
    roots: [Vec<f64>; 2],
    n: usize,
}

impl Response {
    pub fn new(columns: &Columns, diffusivity: [f64; 2], dt: f64) -> Self {
        let n = columns.x().len();
        let last = (n - 1) as f64;
        // cosine waves, which are even at both ends and orthogonal with half weights there
        let half = |i: usize| if i == 0 || i == n - 1 { 0.5 } else { 1.0 };
        // of the angle π·m·i/last only the remainder matters
        let wave: Vec<f64> = (0..2 * (n - 1)).map(|k| (PI * k as f64 / last).cos()).collect();
        let roots = [LOWER, UPPER].map(|phase| {
            let root: Vec<f64> = (0..n)
                .map(|m| {
                    let k = PI * m as f64 / (last * columns.spacing());
                    (k * k + 1.0 / (diffusivity[phase] * dt)).sqrt() * 2.0 / last * half(m)
                })
                .collect();
            // Σ_m root_m cos(m i) cos(m j) = ½ (c(i − j) + c(i + j))
            let c: Vec<f64> =
                (0..2 * (n - 1)).map(|d| (0..n).map(|m| root[m] * wave[m * d % wave.len()]).sum::<f64>()).collect();
            let entry = |i: usize, j: usize| 0.5 * (c[i.abs_diff(j)] + c[(i + j) % c.len()]) * half(j);
            (0..n * n).map(|k| entry(k / n, k % n)).collect()
        });
        Self { roots, n }
    }

    /// The correction of the front that removes its residual r = h − hⁿ − Δt L (1 + h_x²) F[J].
    pub fn correct(
        &self,
        slopes: [&[f64]; 2],
        stretch: &[f64],
        factor: f64,
        filter: Filter,
        fixed_ends: bool,
        residual: &[f64],
    ) -> Result<Vec<f64>, Failure> {
        let n = self.n;
        let mut matrix = faer::Mat::<f64>::identity(n, n);
        for j in 0..n {
            let answer: Vec<f64> = (0..n)
                .map(|i| (0..2).map(|phase| slopes[phase][i].abs() * self.roots[phase][i * n + j]).sum::<f64>())
                .collect();
            for (i, answer) in filter.apply(&answer, !fixed_ends).into_iter().enumerate() {
                matrix[(i, j)] += factor * stretch[i] * answer;
            }
        }
        if fixed_ends {
            for (i, j) in [0, n - 1].into_iter().flat_map(|i| (0..n).map(move |j| (i, j))) {
                matrix[(i, j)] = if i == j { 1.0 } else { 0.0 };
            }
        }
        let mut correction = faer::Mat::<f64>::from_fn(n, 1, |i, _| -residual[i]);
        matrix.partial_piv_lu().solve_in_place(&mut correction);
        Ok((0..n).map(|i| correction[(i, 0)]).collect())
    }
}
