//! Motion of the front.

use super::columns::{Columns, LOWER, UPPER};
use super::material::Material;
use crate::error::{Error, Failure, Result};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// How the front is moved in a step.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// Column by column, as a graph over x.
    #[default]
    Graph,
    /// Segments are shifted along their normals, their ends meet in the middle, and columns cut the result. As
    /// published; less accurate.
    Segments,
}

/// Weights across three columns that smooth the velocity of the front; a single weight is no filter
///
/// ```text
/// F(θ) = (b + 2a cos θ)/(b + 2a)   for [a, b, a]
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Filter(pub Option<[f64; 3]>);

impl Default for Filter {
    fn default() -> Self {
        Self(Some([1.0, 6.0, 1.0]))
    }
}

impl Filter {
    /// Refuses weights that are not symmetric and positive, or that reverse the sign of a sawtooth.
    ///
    /// # Errors
    /// [`Error::Invalid`].
    pub fn check(&self) -> Result<()> {
        let Some([a, b, c]) = self.0 else { return Ok(()) };
        if a == c && a >= 0.0 && b > 0.0 && b >= 2.0 * a && b.is_finite() {
            return Ok(());
        }
        let rule = "must be symmetric, [a, b, a] with 0 <= 2a <= b, such as [1, 6, 1]";
        Err(Error::invalid("filter", format!("{:?}", [a, b, c]), rule))
    }

    /// Weights of the filter on the node itself, and on both neighbours together.
    fn weights(&self) -> [f64; 2] {
        self.0.map_or([1.0, 0.0], |[a, b, _]| [b / (b + 2.0 * a), 2.0 * a / (b + 2.0 * a)])
    }

    /// Smooths values. Those at ends that are `mirrored` see their mirror images, those at others stay.
    pub(super) fn apply(&self, values: &[f64], mirrored: [bool; 2]) -> Vec<f64> {
        let [own, other] = self.weights();
        let last = values.len() - 1;
        let smooth = |i: usize| {
            let (before, after) = match i {
                0 if mirrored[0] => (values[1], values[1]),
                i if i == last && mirrored[1] => (values[last - 1], values[last - 1]),
                0 => return values[0],
                i if i == last => return values[last],
                i => (values[i - 1], values[i + 1]),
            };
            own * values[i] + other * (0.5 * (before + after))
        };
        (0..=last).map(smooth).collect()
    }

    /// The factor by which the filter lengthens the longest stable step: π / max θ F(θ).
    pub fn relief(&self) -> f64 {
        /// Number of angles θ in (0, π] among which the largest θ F(θ) is looked for.
        const SAMPLES: usize = 2000;
        let [own, other] = self.weights();
        let wave = |k: usize| {
            let theta = PI * k as f64 / SAMPLES as f64;
            theta * (own + other * theta.cos())
        };
        PI / (1..=SAMPLES).map(wave).fold(0.0, f64::max)
    }
}

/// Slopes of the temperature at the front, column by column, below and above it, from heights and values at N rows.
pub(super) fn slopes<const N: usize>(
    columns: &Columns,
    y: &[Vec<f64>; 2],
    u: &[Vec<f64>; 2],
    slope: impl Fn([f64; N], [f64; N]) -> f64,
) -> [Vec<f64>; 2] {
    [LOWER, UPPER].map(|phase| {
        let nodes = columns.rows(phase) + 1;
        let [front, _] = columns.ends(phase);
        let take = |values: &[f64], i: usize| {
            let column = &values[i * nodes..(i + 1) * nodes];
            std::array::from_fn(|j| column[if front == 0 { j } else { front - j }])
        };
        (0..columns.x().len()).map(|i| slope(take(&y[phase], i), take(&u[phase], i))).collect()
    })
}

/// dh/dx by central differences; 0 at mirrored sides, one-sided at others.
pub(super) fn tilt(columns: &Columns, h: &[f64], mirrored: [bool; 2]) -> Vec<f64> {
    let (last, dx) = (h.len() - 1, columns.spacing());
    let at = |i: usize| match i {
        i if i > 0 && i < last => (h[i + 1] - h[i - 1]) / (2.0 * dx),
        _ if mirrored[usize::from(i == last)] => 0.0,
        0 => (4.0 * h[1] - 3.0 * h[0] - h[2]) / (2.0 * dx),
        _ => (3.0 * h[last] - 4.0 * h[last - 1] + h[last - 2]) / (2.0 * dx),
    };
    (0..=last).map(at).collect()
}

/// J = k₀ ∂u₀/∂y − k₁ ∂u₁/∂y.
pub(super) fn jump(slopes: &[Vec<f64>; 2], conductivity: [f64; 2]) -> Vec<f64> {
    let pairs = slopes[UPPER].iter().zip(&slopes[LOWER]);
    pairs.map(|(above, below)| conductivity[UPPER] * above - conductivity[LOWER] * below).collect()
}

/// Refuses a front with the warm phase above it, where more than a `negligible` flux tells of that.
pub(super) fn check_warm_below(
    columns: &Columns,
    h: &[f64],
    slopes: &[Vec<f64>; 2],
    conductivity: [f64; 2],
    negligible: f64,
) -> Result<(), Failure> {
    for (i, (above, below)) in slopes[UPPER].iter().zip(&slopes[LOWER]).enumerate() {
        let (above, below) = (conductivity[UPPER] * above, conductivity[LOWER] * below);
        if above + below > negligible + 1e-12 * (above.abs() + below.abs()) {
            return Err(Failure::WrongSide { x: [columns.x()[i], h[i]], slope: above + below });
        }
    }
    Ok(())
}

/// The longest step for which a sawtooth of the explicit front does not grow
///
/// ```text
/// Δt ≤ 2 hx Λ / (π max(|k₀ ∂u₀/∂y| + |k₁ ∂u₁/∂y|)) × relief of the filter
/// ```
pub(super) fn limit(columns: &Columns, slopes: &[Vec<f64>; 2], material: &Material, filter: Filter) -> f64 {
    let [below, above] = material.conductivity;
    let pairs = slopes[UPPER].iter().zip(&slopes[LOWER]);
    let steepest = pairs.map(|(u, l)| (above * u).abs() + (below * l).abs()).fold(0.0_f64, f64::max);
    2.0 * columns.spacing() * material.latent_heat / (PI * steepest) * filter.relief()
}

/// The front after a step, from the filtered jump J: column by column.
pub(super) fn graph(h: &[f64], tilt: &[f64], jump: &[f64], factor: f64) -> Vec<f64> {
    (0..h.len()).map(|i| h[i] + factor * (1.0 + tilt[i] * tilt[i]) * jump[i]).collect()
}

/// The front after a step by segments that shift along their normals
///
/// ```text
/// d_i = Δt ⟦k ∂_ν u⟧/Λ ν_i,   vertices shift by the mean of their two segments
/// ```
pub(super) fn segments(
    columns: &Columns,
    h: &[f64],
    tilt: &[f64],
    jump: &[f64],
    factor: f64,
    mirrored: [bool; 2],
) -> Result<Vec<f64>, Failure> {
    let (x, last) = (columns.x(), h.len() - 1);
    let shift: Vec<[f64; 2]> = (0..last)
        .map(|i| {
            let (dx, dh) = (x[i + 1] - x[i], h[i + 1] - h[i]);
            let length = dx.hypot(dh);
            let nu = [-dh / length, dx / length];
            // u = 0 along the front: ∇u = ∂u/∂y (−h_x, 1)
            let normal = |k: usize| jump[k] * (nu[1] - tilt[k] * nu[0]);
            nu.map(|n| factor * 0.5 * (normal(i) + normal(i + 1)) * n)
        })
        .collect();
    let moved: Vec<[f64; 2]> = (0..=last)
        .map(|i| {
            let by = match i {
                // the other segment is its mirror image
                0 if mirrored[0] => [0.0, shift[0][1]],
                i if i == last && mirrored[1] => [0.0, shift[last - 1][1]],
                0 => shift[0],
                i if i == last => shift[last - 1],
                i => [0, 1].map(|c| 0.5 * (shift[i - 1][c] + shift[i][c])),
            };
            [x[i] + by[0], h[i] + by[1]]
        })
        .collect();
    if let Some(pair) = moved.windows(2).find(|pair| pair[1][0] <= pair[0][0]) {
        let slope = (pair[1][1] - pair[0][1]) / (pair[1][0] - pair[0][0]).abs();
        return Err(Failure::NotAGraph { x: pair[0], slope });
    }
    let mut k = 0;
    let cut = |x: &f64| {
        while k + 2 < moved.len() && moved[k + 1][0] < *x {
            k += 1;
        }
        let [a, b] = [moved[k], moved[k + 1]];
        a[1] + (b[1] - a[1]) * (x - a[0]) / (b[0] - a[0])
    };
    Ok(x.iter().map(cut).collect())
}
