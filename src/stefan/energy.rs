//! The balance of energy: what flows in, compared with the change of what is there.

use super::columns::{Columns, LOWER, UPPER};
use super::heat::{end_slope, slope};
use serde::{Deserialize, Serialize};

/// The balance of energy since the start
///
/// ```text
/// E = ∫C (u − T_m) dA + Λ (area below the front),      imbalance = |ΔE − ∫F dt| / M
/// ```
///
/// M is the heat that was moved: half of Σ|change| over both walls, both phases and the latent heat, step by step,
/// since what one of them gives another one takes.
///
/// F is the flux through walls and sides: by the weighted residual
///
/// ```text
/// F = d/dt ∫C u Φ + k ∫∇u·∇Φ + ∫C w u ∂Φ/∂y,   Φ linear in the row from 1 on the wall to 0 on the front
/// ```
///
/// and for comparison by one-sided differences over three rows.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Energy {
    /// E at the start.
    pub start: f64,
    /// E now.
    pub now: f64,
    /// ∫F dt by the weighted residual.
    pub inflow: f64,
    /// ∫F dt by differences over three rows.
    pub inflow_by_differences: f64,
    /// M.
    pub moved: f64,
}

impl Energy {
    /// |ΔE − ∫F dt| / M; none before heat has moved.
    pub fn imbalance(&self) -> Option<f64> {
        self.miss(self.inflow)
    }

    /// |ΔE − ∫F dt| / M with the flux F by one-sided differences; none before heat has moved.
    pub fn imbalance_by_differences(&self) -> Option<f64> {
        self.miss(self.inflow_by_differences)
    }

    fn miss(&self, inflow: f64) -> Option<f64> {
        (self.moved > 0.0).then(|| (self.now - self.start - inflow).abs() / self.moved)
    }
}

/// A phase at one time.
#[derive(Clone, Copy)]
pub(super) struct Phase<'a> {
    pub columns: &'a Columns,
    pub phase: usize,
    pub y: &'a [f64],
    /// Temperatures above that of melting.
    pub u: &'a [f64],
    pub conductivity: f64,
    pub capacity: f64,
}

/// A point of two-point Gauss quadrature in a cell: its share of the area, and values and gradients there of the
/// bilinear functions of the corners.
struct Point {
    area: f64,
    value: [f64; 4],
    gradient: [[f64; 2]; 4],
}

impl Phase<'_> {
    fn nodes(&self) -> usize {
        self.columns.rows(self.phase) + 1
    }

    /// Calls `f(corners, first row, point)` for all quadrature points; corners are (i, j), (i+1, j), (i, j+1), (i+1,
    /// j+1).
    fn integrate(&self, mut f: impl FnMut([usize; 4], &Point)) {
        let (m, dx) = (self.nodes(), self.columns.spacing());
        let gauss = [0.5 - 0.5 / 3.0_f64.sqrt(), 0.5 + 0.5 / 3.0_f64.sqrt()];
        for i in 0..self.columns.x().len() - 1 {
            for j in 0..m - 1 {
                let k = i * m + j;
                let corners = [k, k + m, k + 1, k + m + 1];
                let y = corners.map(|k| self.y[k]);
                for (s, r) in gauss.into_iter().flat_map(|s| gauss.map(|r| (s, r))) {
                    let value = [(1.0 - s) * (1.0 - r), s * (1.0 - r), (1.0 - s) * r, s * r];
                    let by_s = [-(1.0 - r), 1.0 - r, -r, r];
                    let by_r = [-(1.0 - s), -s, 1.0 - s, s];
                    let sum = |w: [f64; 4]| (0..4).map(|c| w[c] * y[c]).sum::<f64>();
                    let (y_s, y_r) = (sum(by_s), sum(by_r));
                    // columns are vertical, so that x_s = dx and x_r = 0
                    let gradient = std::array::from_fn(|c| [(by_s[c] - by_r[c] * y_s / y_r) / dx, by_r[c] / y_r]);
                    f(corners, &Point { area: 0.25 * dx * y_r, value, gradient });
                }
            }
        }
    }

    /// Φ at a node.
    pub fn test(&self, k: usize) -> f64 {
        let rows = (self.nodes() - 1) as f64;
        let up = (k % self.nodes()) as f64 / rows;
        if self.phase == LOWER { 1.0 - up } else { up }
    }

    /// ∫C u and ∫C u Φ.
    pub fn content(&self) -> [f64; 2] {
        let mut sums = [0.0; 2];
        self.integrate(|corners, point| {
            let at = |f: &dyn Fn(usize) -> f64| (0..4).map(|c| point.value[c] * f(corners[c])).sum::<f64>();
            let (u, phi) = (at(&|k| self.u[k]), at(&|k| self.test(k)));
            sums[0] += point.area * self.capacity * u;
            sums[1] += point.area * self.capacity * u * phi;
        });
        sums
    }

    /// k ∫∇u·∇Φ + ∫C w u ∂Φ/∂y.
    pub fn flow(&self, velocity: &[f64]) -> f64 {
        let mut sum = 0.0;
        self.integrate(|corners, point| {
            let (mut du, mut dphi, mut u, mut w) = ([0.0; 2], [0.0; 2], 0.0, 0.0);
            for (c, k) in corners.into_iter().enumerate() {
                for d in 0..2 {
                    du[d] += point.gradient[c][d] * self.u[k];
                    dphi[d] += point.gradient[c][d] * self.test(k);
                }
                u += point.value[c] * self.u[k];
                w += point.value[c] * velocity[k];
            }
            let conducted = self.conductivity * (du[0] * dphi[0] + du[1] * dphi[1]);
            sum += point.area * (conducted + self.capacity * w * u * dphi[1]);
        });
        sum
    }

    /// Flux in through the wall, by one-sided differences.
    pub fn wall_flux(&self) -> f64 {
        let (m, dx, n) = (self.nodes(), self.columns.spacing(), self.columns.x().len());
        let [_, wall] = self.columns.ends(self.phase);
        let on_wall: Vec<f64> = (0..n).map(|i| self.u[i * m + wall]).collect();
        let [u_x, slope_x] = [&on_wall, &self.columns.wall(self.phase).to_vec()]
            .map(|f| super::front::tilt(self.columns, f, [false; 2]));
        let flux = |i: usize| {
            let row = |k: usize| i * m + if wall == 0 { k } else { wall - k };
            let at = |f: &[f64]| [f[row(0)], f[row(1)], f[row(2)]];
            let u_y = end_slope(at(self.y), at(self.u));
            let outward = if self.phase == LOWER { -1.0 } else { 1.0 };
            outward * self.conductivity * (u_y * (1.0 + slope_x[i] * slope_x[i]) - slope_x[i] * u_x[i])
        };
        (0..n).map(|i| flux(i) * if i == 0 || i + 1 == n { 0.5 * dx } else { dx }).sum()
    }

    /// Adds the flux in through the left (0) or the right side (1) by one-sided differences: the whole flux, and
    /// ∫k ∂_n u (1 − Φ).
    pub fn add_side_flux(&self, side: usize, sums: &mut [f64; 2]) {
        let (m, dx, n) = (self.nodes(), self.columns.spacing(), self.columns.x().len());
        let [side, inner, outer] = [[0, 1, 2], [n - 1, n - 2, n - 3]][side];
        let flux = |j: usize| {
            let along = |f: &[f64]| (4.0 * f[inner * m + j] - 3.0 * f[side * m + j] - f[outer * m + j]) / (2.0 * dx);
            let k = side * m + j;
            let u_y = match j {
                0 => end_slope([self.y[k], self.y[k + 1], self.y[k + 2]], [self.u[k], self.u[k + 1], self.u[k + 2]]),
                j if j + 1 == m => {
                    end_slope([self.y[k], self.y[k - 1], self.y[k - 2]], [self.u[k], self.u[k - 1], self.u[k - 2]])
                }
                _ => {
                    let w = slope([self.y[k - 1], self.y[k], self.y[k + 1]]);
                    w[0] * self.u[k - 1] + w[1] * self.u[k] + w[2] * self.u[k + 1]
                }
            };
            // the derivative along the row, corrected by ∂u/∂y for the slope of the row
            -self.conductivity * (along(self.u) - u_y * along(self.y))
        };
        for j in 0..m - 1 {
            let k = side * m + j;
            let height = self.y[k + 1] - self.y[k];
            let (a, b) = (flux(j), flux(j + 1));
            sums[0] += 0.5 * height * (a + b);
            sums[1] += 0.5 * height * (a * (1.0 - self.test(k)) + b * (1.0 - self.test(k + 1)));
        }
    }
}

/// E from ∫C (u − T_m) of both phases and the front.
pub(super) fn total(columns: &Columns, h: &[f64], contents: [f64; 2], latent_heat: f64) -> f64 {
    let dx = columns.spacing();
    let last = h.len() - 1;
    let below = |i: usize| (h[i] - columns.wall(LOWER)[i]) * if i == 0 || i == last { 0.5 * dx } else { dx };
    contents[LOWER] + contents[UPPER] + (0..=last).map(below).sum::<f64>() * latent_heat
}
