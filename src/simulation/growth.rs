//! Cells in which small values grow.

use super::doubts::named;
use super::pace::ALIKE;
use super::{Record, Simulation, State};
use crate::geometry::{Cells, Density, Mesh, node_areas};
use crate::meshing::Movable;
use crate::numerics::{ends, larger, sum};

/// Least limit on the width of a cell, as a multiple of an equal cell, where small values grow: with a narrower limit
/// cells ahead of the front would take nodes from it.
const WIDER: f64 = 1.05;
/// Number of iterations of Newton's method for the mean of the narrowed density, whose equation is piecewise linear and
/// convex.
const MEANS: usize = 10;

/// An unknown has a front where it changes by more than this share of its range over the width of an equal cell.
const FRONT: f64 = 0.18;
/// A node is ahead of a front, or behind it, where its value is within this share of the range from an end of the
/// range.
const AHEAD: f64 = 1e-3;
/// Largest k Δt for values that grow like e^(kt) ahead of a front. TR-BDF2 then misses the growth in a step by the
/// share 0.04 (k Δt)², and so the speed of a front that small values pull.
const GROWN: f64 = 0.2;
/// Width of a cell, as a multiple of √(D/k) with the diffusivity D and the growth rate k of small values, above which a
/// run warns: values in it grow before the front arrives.
const OUTRUNS: f64 = 2.0;
const GROWS: &str = "small values grow in cells that are too wide";

impl<const D: usize> Simulation<D>
where
    Mesh<D>: Movable<D>,
{
    /// The longest step in which small values ahead of fronts grow as they should. At the nodes of a mesh that goes
    /// along with a front little changes, so that nothing else would limit the step.
    pub(super) fn longest_of_growth(&self, state: &State<D>) -> f64 {
        let State { t, mesh, u, .. } = state;
        if !self.mover.generator.moves() {
            return f64::INFINITY;
        }
        let rates = self.physics.growth_rates(*t, mesh, u);
        if rates.is_empty() {
            return f64::INFINITY;
        }
        let fastest = (0..u.components()).fold(0.0, |most, c| {
            let [low, high] = ends(u.component(c));
            let ahead = |value: f64| (value - low).min(high - value) <= AHEAD * (high - low);
            let rates = rates.iter().skip(c).step_by(u.components());
            let rates = rates.zip(u.component(c)).filter(|(_, value)| ahead(*value));
            rates.fold(most, |most, (rate, _)| larger(most, *rate))
        });
        GROWN / fastest
    }

    /// Says once in a run that cells ahead of a front are wider than the front can cross before they grow.
    pub(super) fn warn_of_growth(&self, state: &State<D>, record: &mut Record) {
        if record.warnings.iter().any(|said| said.contains(GROWS)) {
            return;
        }
        let State { t, mesh, u, .. } = state;
        let widest = self.physics.widest_cells(*t, mesh, u);
        if widest.is_empty() {
            return;
        }
        let (lattice, equal) = (mesh.lattice(), mesh.equal_cell());
        let edges = || {
            (0..D).flat_map(|axis| {
                let stride = lattice.strides()[axis];
                let inside = move |k: &usize| lattice.node(*k)[axis] + 1 < lattice.nodes()[axis];
                (0..lattice.len()).filter(inside).map(move |k| {
                    let way = (0..D).map(|d| (mesh.x()[k + stride][d] - mesh.x()[k][d]).powi(2)).sum::<f64>();
                    (k, k + stride, way.sqrt())
                })
            })
        };
        let mut worst = (OUTRUNS, None);
        for (c, name) in self.physics.unknowns().into_iter().enumerate() {
            let value = |k: usize| u.values()[k * u.components() + c];
            let [low, high] = ends(u.component(c));
            if high - low <= ALIKE * high.abs().max(low.abs()) {
                continue;
            }
            let steepest = edges().fold(0.0, |most, (a, b, way)| larger(most, (value(b) - value(a)) / way));
            if steepest * equal <= FRONT * (high - low) {
                continue;
            }
            let ahead = |k: usize| (value(k) - low).min(high - value(k)) <= AHEAD * (high - low);
            for (a, _, way) in edges().filter(|(a, b, _)| ahead(*a) && ahead(*b)) {
                if way > worst.0 * widest[a] {
                    worst = (way / widest[a], Some((name.clone(), a)));
                }
            }
        }
        let (times, Some((name, k))) = worst else { return };
        let times = (10.0 * times / OUTRUNS).ceil() / 10.0;
        record.warnings.push(format!(
            "`{name}`: {GROWS}: at t = {t}, {}, a cell is {times:.1} times as wide as 2√(D/k), the width that a front \
             of the diffusivity D crosses before values that grow at the rate k do, and the front may be at the wrong \
             place; refine `grid.cells` {times:.1} times",
            named(mesh.image(mesh.x()[k]))
        ));
    }
}

/// A density with which cells get no wider than `widest`, as far as there are nodes for that
///
/// A mesh that follows a front has its widest cells ahead of it. Where small values grow by themselves, a front ahead
/// of which cells are wider than 2√(D/k) is pulled by what grows in these, and runs away. So the result is at least
///
/// ```text
/// min(h/w, 1/1.05) ⟨ρ⟩,   h the width of equal cells, w that of `widest`, ⟨ρ⟩ the mean of the result
/// ```
///
/// along each axis.
pub(super) fn narrowed<const D: usize>(mesh: &Mesh<D>, rho: &Density, widest: &[f64]) -> Density
where
    Mesh<D>: Cells<D>,
{
    let equal = mesh.equal_cell();
    let shares: Vec<f64> = widest.iter().map(|widest| (equal / widest).min(1.0 / WIDER)).collect();
    let areas = node_areas(mesh);
    let whole = sum(areas.iter().copied());
    let integral = |of: &dyn Fn(usize) -> f64| sum((0..areas.len()).map(|k| areas[k] * of(k)));
    rho.map(|rho| {
        let held = |mean: f64, k: usize| shares[k] * mean > rho[k];
        let mut mean = integral(&|k| rho[k]) / whole;
        for _ in 0..MEANS {
            let free = integral(&|k| if held(mean, k) { 0.0 } else { rho[k] });
            mean = free / (whole - integral(&|k| if held(mean, k) { shares[k] } else { 0.0 }));
        }
        (0..rho.len()).map(|k| rho[k].max(shares[k] * mean)).collect()
    })
}
