use super::chain::{Chain, Equations, Step};
use super::conditions::End;
use crate::error::Failure;
use crate::numerics::linear::tridiagonal;

/// The flux of a time step into the part of the line beyond a cut: the optimal transmission condition
///
/// ```text
/// φ(x) = M y_ξ at the cut,   (τ/Δt)(y − y_old) = (M y_ξ)_ξ beyond it,   y = x at the cut, y given at the other end
/// ```
///
/// Without time, φ(x) is ∫M over the part beyond the cut, divided by its length in ξ: (4.3) of the source. In time
/// there is no such integral: φ takes a nonlinear solve of the part beyond the cut, and φ′ one linear solve more.
///
/// # Source
/// M. J. Gander and R. D. Haynes (2012), who leave the extension of section 4 to section 7 to the future.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Beyond<'a> {
    /// Nodes of the part beyond the cut, before the step.
    pub old: &'a [f64],
    /// τ/Δt.
    pub ratio: f64,
    /// Whether the cut is its left end.
    pub cut_at_left: bool,
}

impl Beyond<'_> {
    /// φ and φ′.
    pub fn flux(self, chain: &Chain<'_>, x: f64) -> Result<[f64; 2], Failure> {
        let Self { old, ratio, cut_at_left } = self;
        let n = old.len() - 1;
        let step = Step { old, ratio };
        let ends = if cut_at_left { [x, old[n]] } else { [old[0], x] }.map(End::Value);
        let equations = Equations { chain, ends, step: Some(step) };
        let (y, _) = equations.newton(old)?;
        // the derivative of each node y_i by the node at the cut
        let (_, rows) = equations.linearised(&y)?;
        let mut right = vec![0.0; n + 1];
        right[if cut_at_left { 0 } else { n }] = 1.0;
        let follows = tridiagonal(&rows, &right);
        // the flux in the middle of the cell beside the cut, and what half a cell adds up to the cut
        let (first, cut, sign) = if cut_at_left { (0, 0, -1.0) } else { (n - 1, n, 1.0) };
        let [flux, by_left, by_right] = chain.flux_of_cell(y[first], y[first + 1])?;
        let [more, by_node] = step.half(chain.h, cut, x);
        let slope = by_left * follows[first] + by_right * follows[first + 1];
        Ok([flux + sign * more, slope + sign * by_node])
    }
}
