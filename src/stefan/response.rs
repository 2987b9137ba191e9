//! How the velocity of a front answers to its place.

use super::columns::{Columns, LOWER, UPPER};
use super::front;
use super::material::Material;
use super::solver::Front;
use faer::linalg::solvers::Solve;
use std::f64::consts::PI;

/// The approximate derivative of the jump of the heat flux by the height of the front
///
/// ```text
/// δJ = Σ_i k_i ∂u_i/∂y √(κ² + 1/(D_i Δt)) δh   for each wave number κ
/// ```
///
/// If the front rises by δh, its old place gets the temperature −∂u/∂y δh, which in an implicit Euler step decays over
/// the distance 1/√(κ² + 1/(DΔt)). Phases are assumed to be thicker than that. A fixed-point iteration without this
/// derivative would converge only up to half the explicit step limit.
pub(super) struct Response {
    /// √(κ² + 1/(D_i Δt)) as a matrix over the columns, for each phase.
    roots: [Vec<f64>; 2],
    n: usize,
}

impl std::fmt::Debug for Response {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Response")
    }
}

impl Response {
    pub fn new(columns: &Columns, material: &Material, dt: f64) -> Self {
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
                    (k * k + 1.0 / (material.diffusivity(phase) * dt)).sqrt() * 2.0 / last * half(m)
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

    /// The correction of the front `h` that removes its residual r = h − hⁿ − Δt/Λ (1 + h_x²) F[J], where no wall is
    /// `bare`. `slopes` are ∂u_i/∂y at the front.
    pub fn correct(
        &self,
        front: &Front,
        (h, bare): (&[f64], &[Option<usize>]),
        slopes: &[Vec<f64>; 2],
        dt: f64,
        residual: &[f64],
    ) -> Vec<f64> {
        let (n, mirrored) = (self.n, front.mirrored());
        let strength = [LOWER, UPPER]
            .map(|phase| slopes[phase].iter().map(|s| -front.material.conductivity[phase] * s).collect::<Vec<f64>>());
        let stretch: Vec<f64> = front::tilt(&front.columns, h, mirrored).iter().map(|s| 1.0 + s * s).collect();
        let factor = dt / front.latent_heat();
        let mut matrix = faer::Mat::<f64>::identity(n, n);
        for j in 0..n {
            let answer: Vec<f64> = (0..n)
                .map(|i| (0..2).map(|phase| strength[phase][i] * self.roots[phase][i * n + j]).sum::<f64>())
                .collect();
            for (i, answer) in front.filter.apply(&answer, mirrored).into_iter().enumerate() {
                matrix[(i, j)] += factor * stretch[i] * answer;
            }
        }
        // some heights are given
        let given = |i: usize| front.held_at(i) || bare[i].is_some();
        for (i, j) in (0..n).filter(|&i| given(i)).flat_map(|i| (0..n).map(move |j| (i, j))) {
            matrix[(i, j)] = if i == j { 1.0 } else { 0.0 };
        }
        let mut correction = faer::Mat::<f64>::from_fn(n, 1, |i, _| -residual[i]);
        matrix.partial_piv_lu().solve_in_place(&mut correction);
        (0..n).map(|i| correction[(i, 0)]).collect()
    }
}
