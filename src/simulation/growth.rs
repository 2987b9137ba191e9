//! Cells in which small values grow.

use crate::geometry::{Cells, Mesh, node_areas};
use crate::numerics::sum;

/// Cells that are to be narrower than equal ones are at most this many times as wide as these: nodes for that are not
/// taken from where they are needed.
const WIDER: f64 = 1.05;
/// Iterations of Newton's method for the mean, whose equation is piecewise linear and convex.
const MEANS: usize = 10;

/// A density with which cells get no wider than `widest`, as far as there are nodes for that
///
/// A mesh that follows a front has its widest cells ahead of it. Where small values grow by themselves, a front ahead
/// of which cells are wider than 2√(D/k) is pulled by what grows in these, and runs away. So ρ is at least
///
/// ```text
/// min(h/w, 1/1.05) ⟨ρ⟩,   h the width of equal cells, w that of the widest, ⟨ρ⟩ the mean of the result
/// ```
pub(super) fn narrowed<const D: usize>(mesh: &Mesh<D>, rho: Vec<f64>, widest: &[f64]) -> Vec<f64>
where
    Mesh<D>: Cells<D>,
{
    let cells = mesh.lattice().cells();
    let equal = (0..D).map(|d| mesh.extent()[d] / cells[d] as f64).fold(f64::INFINITY, f64::min);
    let shares: Vec<f64> = widest.iter().map(|widest| (equal / widest).min(1.0 / WIDER)).collect();
    let areas = node_areas(mesh);
    let whole = sum(areas.iter().copied());
    let held = |mean: f64, k: usize| shares[k] * mean > rho[k];
    let integral = |of: &dyn Fn(usize) -> f64| sum((0..rho.len()).map(|k| areas[k] * of(k)));
    let mut mean = integral(&|k| rho[k]) / whole;
    for _ in 0..MEANS {
        let free = integral(&|k| if held(mean, k) { 0.0 } else { rho[k] });
        mean = free / (whole - integral(&|k| if held(mean, k) { shares[k] } else { 0.0 }));
    }
    (0..rho.len()).map(|k| rho[k].max(shares[k] * mean)).collect()
}
