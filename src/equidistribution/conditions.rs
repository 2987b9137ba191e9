//! Boundary conditions at the ends of a piece of a line.

use super::beyond::Beyond;
use super::chain::Chain;
use crate::error::Failure;

/// A transmission condition at an end of a piece: the flux there is g + φ(x), with φ as follows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Law<'a> {
    /// φ = slope · x.
    Robin { slope: f64 },
    /// φ = (∫ M from x to `to`) / `length`: the flux of the rest of the line, which begins at x and is `length` long in
    /// ξ. The integral is exact, or by the trapezoidal rule with `panels`.
    Rest { to: f64, length: f64, panels: Option<usize> },
    /// φ = the flux of a time step into the rest of the line.
    Beyond(Beyond<'a>),
}

/// The boundary condition at an end of a piece of the line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum End<'a> {
    /// The position of the node.
    Value(f64),
    /// The flux F = g + φ(x).
    Flux { g: f64, law: Law<'a> },
}

impl Law<'_> {
    /// φ and φ′ for the end node at x.
    pub fn at(self, chain: &Chain<'_>, x: f64) -> Result<[f64; 2], Failure> {
        let (density, t) = (chain.density, chain.t);
        match self {
            Self::Robin { slope } => Ok([slope * x, slope]),
            Self::Beyond(beyond) => beyond.flux(chain, x),
            Self::Rest { to, length, panels: None } => {
                Ok([chain.integral(x, to)? / length, -density.at(t, x)?[0] / length])
            }
            Self::Rest { to, length, panels: Some(n) } => {
                let step = (to - x) / n as f64;
                let places: Vec<f64> = (0..=n).map(|k| x + k as f64 * step).collect();
                let (mut sum, mut slope) = (0.0, 0.0);
                for (k, [m, m_x]) in density.at_each(t, &places)?.into_iter().enumerate() {
                    let weight = if k == 0 || k == n { 0.5 } else { 1.0 };
                    sum += weight * m;
                    slope += weight * m_x * (1.0 - k as f64 / n as f64);
                }
                Ok([step * sum / length, (step * slope - sum / n as f64) / length])
            }
        }
    }
}

/// Moves the end nodes that are given to their places.
pub(super) fn pin(x: &mut [f64], ends: [End<'_>; 2]) {
    let last = x.len() - 1;
    for (end, node) in ends.into_iter().zip([0, last]) {
        if let End::Value(given) = end {
            x[node] = given;
        }
    }
}
