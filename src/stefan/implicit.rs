//! The implicit front: it moves by the temperatures at the end of the step, which Newton's method finds.

use super::columns::{Columns, LOWER, UPPER};
use super::front;
use super::solver::{Front, FrontState, Problem};
use crate::error::{Failure, Result};
use crate::numerics::larger;
use crate::work::Work;
use faer::linalg::solvers::Solve;
use std::f64::consts::PI;

/// Newton's method has converged once the residual of the front is below this share of the height of the box, or of
/// that times the largest temperature if it is above 1.
const CONVERGED: f64 = 1e-11;
/// Round-off of a height, as a share of its distance from the origin: some fifty units in the last place.
const ROUNDING: f64 = 1e-14;
/// Newton steps after which a time step is given up. Seven are usual.
const MOST_STEPS: usize = 40;

impl Front {
    /// Front and temperatures at time `t` that are consistent with each other. `slopes` are those at the start.
    #[allow(clippy::type_complexity)]
    pub(super) fn newton(
        &mut self,
        problem: &dyn Problem,
        state: &FrontState,
        slopes: &[Vec<f64>; 2],
        t: f64,
        work: &mut Work,
    ) -> Result<(Vec<f64>, [Vec<f64>; 2])> {
        let dt = t - state.t;
        let response = match self.response.take() {
            Some((known, response)) if known == dt => response,
            _ => Response::new(&self.columns, self.diffusivity, dt),
        };
        let tolerance = self.tolerance(state);
        // the old front lies in the box, which a long explicit step might leave; where sides are given it follows them
        let mut h = state.front.clone();
        if !self.mirrored() {
            h = self.moved(problem, &state.front, &state.front, slopes, state.t, 0.0)?;
            self.hold_ends(problem, &mut h, t);
        }
        let mut miss = f64::INFINITY;
        for _ in 0..MOST_STEPS {
            self.columns.check(&h)?;
            let u = self.conduct(problem, state, &h, t)?;
            work.linear_solves += 2;
            work.newton_iterations += 1;
            let slopes = self.slopes(&h, &u);
            let target = self.moved(problem, &state.front, &h, &slopes, t, dt)?;
            let residual: Vec<f64> = h.iter().zip(&target).map(|(h, target)| h - target).collect();
            miss = residual.iter().copied().fold(0.0, larger);
            if miss <= tolerance {
                self.response = Some((dt, response));
                return Ok((h, u));
            }
            let correction = response.correct(self, &h, &slopes, dt, &residual);
            h.iter_mut().zip(correction).for_each(|(h, c)| *h += c);
        }
        Err(Failure::NewtonStalled { residual: miss, tolerance, iterations: MOST_STEPS }.into())
    }

    /// The residual of the front at which Newton's method has converged.
    fn tolerance(&self, state: &FrontState) -> f64 {
        let [bottom, top] = [LOWER, UPPER].map(|phase| self.columns.wall(phase));
        let height = top.iter().zip(bottom).fold(0.0_f64, |m, (top, bottom)| m.max(top - bottom));
        // the jump has the round-off of the temperatures
        let size = state.u.iter().flatten().copied().fold(1.0, larger);
        // and heights have that of their distance from the origin
        let farthest = bottom.iter().chain(top).copied().fold(0.0, larger);
        CONVERGED * height * size + ROUNDING * farthest
    }
}

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

impl std::fmt::Debug for Response {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Response")
    }
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

    /// The correction of the front `h` that removes its residual r = h − hⁿ − Δt L (1 + h_x²) F[J]. `slopes` are
    /// ∂u_i/∂y at the front.
    fn correct(&self, front: &Front, h: &[f64], slopes: &[Vec<f64>; 2], dt: f64, residual: &[f64]) -> Vec<f64> {
        let (n, mirrored) = (self.n, front.mirrored());
        let strength = [LOWER, UPPER]
            .map(|phase| slopes[phase].iter().map(|s| (front.diffusivity[phase] * s).abs()).collect::<Vec<f64>>());
        let stretch: Vec<f64> = front::tilt(&front.columns, h, mirrored).iter().map(|s| 1.0 + s * s).collect();
        let factor = dt * front.mobility;
        let mut matrix = faer::Mat::<f64>::identity(n, n);
        for j in 0..n {
            let answer: Vec<f64> = (0..n)
                .map(|i| (0..2).map(|phase| strength[phase][i] * self.roots[phase][i * n + j]).sum::<f64>())
                .collect();
            for (i, answer) in front.filter.apply(&answer, mirrored).into_iter().enumerate() {
                matrix[(i, j)] += factor * stretch[i] * answer;
            }
        }
        if !mirrored {
            // the ends are given
            for (i, j) in [0, n - 1].into_iter().flat_map(|i| (0..n).map(move |j| (i, j))) {
                matrix[(i, j)] = if i == j { 1.0 } else { 0.0 };
            }
        }
        let mut correction = faer::Mat::<f64>::from_fn(n, 1, |i, _| -residual[i]);
        matrix.partial_piv_lu().solve_in_place(&mut correction);
        (0..n).map(|i| correction[(i, 0)]).collect()
    }
}
