//! Cells around shocks, which form where nothing diffuses.

use crate::geometry::Density;
use crate::numerics::ends;

/// Largest ratio of two values of the density along an axis: cells at a shock are about a tenth of equal ones.
const CONTRAST: f64 = 10.0;

/// A density that draws no more nodes into a shock than it takes
///
/// A shock is as thin as the thinnest cell, so that a density that is as steep as it would make cells ever thinner; and
/// the thinner they are, the shorter are the steps in which nodes that tremble about the shock do not cross it. So
///
/// ```text
/// ρ ← 1 + s (ρ − 1),   s ≤ 1 such that ρ ≤ 10,   ρ in units of its smallest value
/// ```
///
/// along each axis.
pub(super) fn blunted(rho: &Density) -> Density {
    rho.map(|rho| {
        let [low, high] = ends(rho.iter().copied());
        let share = ((CONTRAST - 1.0) * low / (high - low)).min(1.0);
        rho.iter().map(|rho| low + share * (rho - low)).collect()
    })
}
