use super::LineDensity;
use super::conditions::End;
use super::cumulative::Cumulative;
use crate::error::Failure;
use crate::numerics::linear::tridiagonal;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How M is averaged over a cell.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum FaceDensity {
    /// The trapezoidal rule: the mean of M at both ends of the cell.
    #[default]
    Trapezoid,
    /// The midpoint rule: M in the middle of the cell.
    Midpoint,
    /// ∫M over the cell, divided by its length. The nodes of the discrete problem are then those of the continuous one.
    Exact,
}

/// M̄ of a cell with its derivatives by the left and the right node.
#[derive(Debug, Clone, Copy)]
struct Face {
    mean: f64,
    by: [f64; 2],
}

impl Face {
    /// By the trapezoidal rule, from M and M_x at both nodes.
    fn trapezoid([[left, left_slope], [right, right_slope]]: [[f64; 2]; 2]) -> Self {
        Self { mean: 0.5 * (left + right), by: [0.5 * left_slope, 0.5 * right_slope] }
    }

    /// The flux of a cell, and its derivatives by the left and the right node; `h` is its width in ξ.
    fn flux(self, width: f64, h: f64) -> [f64; 3] {
        [self.mean * width, self.by[0] * width - self.mean, self.by[1] * width + self.mean].map(|v| v / h)
    }
}

/// The backward Euler step of x_t = (1/τ) (M x_ξ)_ξ.
#[derive(Debug, Clone, Copy)]
pub(super) struct Step<'a> {
    /// Nodes of this piece before the step.
    pub old: &'a [f64],
    /// τ/Δt.
    pub ratio: f64,
}

impl Step<'_> {
    /// The change of the flux over half a cell beside node i, which is at x, and its derivative by x.
    pub fn half(&self, h: f64, i: usize, x: f64) -> [f64; 2] {
        let slope = 0.5 * self.ratio * h;
        [slope * (x - self.old[i]), slope]
    }
}

/// (M x_ξ)_ξ = 0 on nodes ξ_i a distance `h` apart, as F_{i+½} = F_{i−½} with F_{i+½} = M̄ (x_{i+1} − x_i)/h.
#[derive(Debug, Clone, Copy)]
pub(super) struct Chain<'a> {
    pub density: &'a LineDensity,
    pub face: FaceDensity,
    pub t: f64,
    pub h: f64,
    /// The ends of the line in x.
    pub ends: [f64; 2],
    /// ∫M from the beginning of the line to any place, where it has been computed.
    pub cumulative: Option<&'a Cumulative>,
}

/// The equations of a piece: a chain with conditions at its ends, in a time step or, where there is none, without time.
#[derive(Debug, Clone, Copy)]
pub(super) struct Equations<'a> {
    pub chain: &'a Chain<'a>,
    pub ends: [End<'a>; 2],
    pub step: Option<Step<'a>>,
}

impl Chain<'_> {
    /// ∫M from a to b.
    pub fn integral(&self, a: f64, b: f64) -> Result<f64, Failure> {
        match self.cumulative {
            Some(cumulative) => Ok(cumulative.up_to(b) - cumulative.up_to(a)),
            None => self.density.integral(self.t, a, b),
        }
    }

    /// M̄ of all cells.
    fn faces(&self, x: &[f64]) -> Result<Vec<Face>, Failure> {
        if self.face == FaceDensity::Midpoint {
            let middles: Vec<f64> = x.windows(2).map(|x| 0.5 * (x[0] + x[1])).collect();
            let m = self.density.at_each(self.t, &middles)?;
            return Ok(m.into_iter().map(|[m, slope]| Face { mean: m, by: [0.5 * slope; 2] }).collect());
        }
        let m = self.density.at_each(self.t, x)?;
        let face = |(x, m): (&[f64], &[[f64; 2]])| {
            let width = x[1] - x[0];
            if self.face == FaceDensity::Trapezoid || width == 0.0 {
                return Ok(Face::trapezoid([m[0], m[1]]));
            }
            let mean = self.integral(x[0], x[1])? / width;
            Ok(Face { mean, by: [(mean - m[0][0]) / width, (m[1][0] - mean) / width] })
        };
        x.windows(2).zip(m.windows(2)).map(face).collect()
    }

    /// The fluxes between the nodes.
    pub fn fluxes(&self, x: &[f64]) -> Result<Vec<f64>, Failure> {
        Ok(self.faces(x)?.iter().zip(x.windows(2)).map(|(face, x)| face.flux(x[1] - x[0], self.h)[0]).collect())
    }

    /// The flux of one cell.
    pub fn flux(&self, left: f64, right: f64) -> Result<f64, Failure> {
        Ok(self.fluxes(&[left, right])?[0])
    }

    /// The flux of one cell, and its derivatives by the nodes at its ends.
    pub fn flux_of_cell(&self, left: f64, right: f64) -> Result<[f64; 3], Failure> {
        Ok(self.faces(&[left, right])?[0].flux(right - left, self.h))
    }

    /// One linear solve with the face densities of given nodes frozen.
    ///
    /// # Errors
    /// [`Failure::LineDensity`].
    pub fn frozen(&self, at: &[f64], ends: [f64; 2], step: Option<Step<'_>>) -> Result<Vec<f64>, Failure> {
        let faces = self.faces(at)?;
        let n = faces.len();
        let mut right = vec![0.0; n + 1];
        let mut rows = vec![[0.0, 1.0, 0.0]; n + 1];
        (right[0], right[n]) = (ends[0], ends[1]);
        for i in 1..n {
            let (a, b) = (faces[i - 1].mean / self.h, faces[i].mean / self.h);
            rows[i] = [-a, a + b, -b];
            if let Some(Step { old, ratio }) = step {
                rows[i][1] += ratio * self.h;
                right[i] = ratio * self.h * old[i];
            }
        }
        Ok(tridiagonal(&rows, &right))
    }
}

impl Equations<'_> {
    /// Residuals at all nodes, 0 where the node is given, and their derivatives: below, own, above.
    pub fn linearised(&self, x: &[f64]) -> Result<(Vec<f64>, Vec<[f64; 3]>), Failure> {
        let Self { chain, ends, step } = *self;
        let (faces, h) = (chain.faces(x)?, chain.h);
        let n = faces.len();
        let mut residual = vec![0.0; n + 1];
        let mut rows = vec![[0.0, 1.0, 0.0]; n + 1];
        let flux = |i: usize| faces[i].flux(x[i + 1] - x[i], h);
        let mut below = flux(0);
        for i in 1..n {
            let above = flux(i);
            residual[i] = above[0] - below[0];
            rows[i] = [-below[1], above[1] - below[2], above[2]];
            if let Some(Step { old, ratio }) = step {
                residual[i] -= ratio * h * (x[i] - old[i]);
                rows[i][1] -= ratio * h;
            }
            below = above;
        }
        for (end, i) in ends.into_iter().zip([0, n]) {
            if let End::Flux { g, law } = end {
                let ([f, by_left, by_right], [phi, slope]) = (flux(i.min(n - 1)), law.at(chain, x[i])?);
                // from the middle of the outermost cell to the end node the flux changes by half a cell's share
                let [more, by_node] = step.map_or([0.0; 2], |step| step.half(h, i, x[i]));
                let sign = if i == 0 { -1.0 } else { 1.0 };
                residual[i] = f + sign * more - g - phi;
                let own = sign * by_node - slope;
                rows[i] = if i == 0 { [0.0, by_left + own, by_right] } else { [by_left, by_right + own, 0.0] };
            }
        }
        Ok((residual, rows))
    }
}

/// The largest magnitude; infinite where a value is NaN.
pub(super) fn largest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, |m, value| if value.is_nan() { f64::INFINITY } else { m.max(value.abs()) })
}
