//! What a mesh may do to the solution on its way.

use super::State;
use crate::density::{Need, interpolation_errors, largest_step};
use crate::geometry::{Cells, DualCells, Field, Mesh, length, padded};
use crate::numerics::difference::Metrics;
use crate::numerics::larger;

/// Moving the nodes through a solution may add at most this share of its range to its error over a whole run.
const MOST: f64 = 3e-3;
/// Moving the nodes may add over a whole run at most this share of the error with which equal cells interpolate the
/// solution, where that is less than `MOST` allows: a moving mesh is to be better than equal cells.
const OF_UNIFORM: f64 = 0.25;
/// Moving the nodes in a step may add this share of what the solution changes by itself.
const OF_CHANGE: f64 = 0.2;
/// Moving the nodes in a step may add this share of what the solution changes by itself where equal cells do not
/// resolve the unknown, as when a layer forms: it gets thinner while the mesh is on its way, and a mesh that is too
/// slow never arrives.
const WHERE_UNRESOLVED: f64 = 1.0;
/// Linear interpolation of a layer that changes by the share g of its range over a cell has an error of this times g²,
/// as a share of the range.
const INTERPOLATION: f64 = 0.2;

/// How far a mesh goes, and what that does to the solution.
#[derive(Debug, Clone, Copy)]
pub(super) struct Way {
    /// The share of the way that it goes.
    pub share: f64,
    /// The largest error that this adds to an unknown, as a share of its range.
    pub harm: f64,
}

impl Way {
    /// All of the way, of which nobody asks what it does.
    pub const WHOLE: Self = Self { share: 1.0, harm: 0.0 };
    /// None of the way.
    pub const NONE: Self = Self { share: 0.0, harm: 0.0 };
}

/// The share of the way of the mesh, from where it is predicted to where the mesh equation takes it, that keeps the
/// error that it adds to the solution within a budget: 1 for all of the way
///
/// A face that sweeps the area s over the solution transports s (u_i + u_k)/2, with an error of s e,
///
/// ```text
/// e = (δ²u_i + δ²u_k)/16,   δ² the second difference along the lattice
/// ```
///
/// Where the solution stands still nothing removes these errors, and they add up. In a step Δt of a run of length T
/// they may therefore change an unknown by at most this share of its range:
///
/// ```text
/// min(0.003, E₀/4) Δt/T + c n U Δt + max(E − E₀, 0)
/// ```
///
/// E₀ and E are the errors with which equal cells and this mesh interpolate the unknown, estimated from its largest
/// change over a cell, so that over a run the error stays below a quarter of the one of equal cells. U is what the
/// solution changes by itself in a unit of time, of which a mesh that follows may add the share c: from 0.2 where equal
/// cells resolve the unknown to 1 where they do not. n is the [`Need`], which is 0 where equal cells resolve all
/// unknowns. The last term is for the way back to equal cells, where these have become better than this mesh; there E
/// and E₀ from second differences along the lattice count, too, which see wide cells at the crest of a wave.
pub(super) fn allowed<const D: usize>(state: &State<D>, from: &Mesh<D>, to: &Mesh<D>, dt: f64, span: f64) -> Way
where
    Mesh<D>: Cells<D>,
{
    let (begin, end) = (DualCells::new(from), DualCells::new(to));
    let swept = begin.swept(&end);
    let patch = *begin.patch();
    let strides = patch.padded_strides();
    let places = state.mesh.parameters();
    let metrics = Metrics::new(places);
    let lattice = places.lattice();
    let h: [f64; D] = std::array::from_fn(|d| places.extent()[d] / lattice.cells()[d] as f64);
    let unknowns: Vec<(Vec<f64>, f64, f64)> = (0..state.u.components())
        .map(|c| (state.u.component(c).collect::<Vec<f64>>(), range(&state.u, c)))
        .filter(|(_, range)| *range > 0.0)
        .map(|(values, range)| {
            let slopes = metrics
                .gradient(&values)
                .into_iter()
                .map(|g| length(std::array::from_fn::<f64, D, _>(|d| g[d] * h[d])));
            let over_cell = slopes.fold(0.0, larger) / range;
            (values, range, over_cell)
        })
        .collect();
    // one unknown that equal cells do not resolve is reason enough to hurry
    let need = Need::on(&state.mesh);
    let hurry = unknowns.iter().fold(0.0, |m, (_, _, over_cell)| larger(m, need.by_slopes(*over_cell)));
    let mut way = Way::WHOLE;
    for (values, range, over_cell) in unknowns {
        let u: Vec<f64> = padded(lattice, values.as_chunks::<1>().0, [[0.0]; D]).into_flattened();
        let mut second = vec![[0.0; D]; u.len()];
        for k in patch.places() {
            second[k] = strides.map(|s| u[k - s] - 2.0 * u[k] + u[k + s]);
        }
        patch.wrap(&mut second);
        let off = |k: usize, d: usize| swept[k][d] * (second[k][d] + second[k + strides[d]][d]) / 16.0;
        let harms = patch
            .places()
            .zip(end.areas())
            .map(|(k, area)| (0..D).map(|d| off(k, d) - off(k - strides[d], d)).sum::<f64>() / area);
        let harm = harms.fold(0.0, larger) / range;
        let jump = largest_step(lattice, &values) / range;
        let unresolved = Need::OF_EQUAL_CELLS.by_slopes(over_cell);
        let of_change = OF_CHANGE + unresolved * (WHERE_UNRESOLVED - OF_CHANGE);
        let uniform = INTERPOLATION * over_cell * over_cell;
        let [here, equal] = interpolation_errors(places, &values);
        let excess = (INTERPOLATION * jump * jump - uniform).max((here - equal) / range).max(0.0);
        let budget = MOST.min(OF_UNIFORM * uniform) * dt / span + of_change * hurry * state.own_change * dt + excess;
        way.harm = larger(way.harm, harm);
        if harm > budget {
            way.share = way.share.min(budget / harm);
        }
    }
    Way { harm: way.share * way.harm, ..way }
}

/// What the solution changes by itself in a unit of time: the largest change of an unknown at a fixed place in a step,
/// as a share of its range, less the `harm` that moving the nodes did in it
///
/// The equation repairs that harm, and what it repairs is a change, too. A mesh that may add a share of all changes
/// would add the more, the more it adds.
pub(super) fn own_change<const D: usize>(before: &State<D>, mesh: &Mesh<D>, u: &Field, harm: f64, dt: f64) -> f64
where
    Mesh<D>: Cells<D>,
{
    let share = |c: usize| {
        let range = range(u, c).max(range(&before.u, c));
        if range > 0.0 { change(before, mesh, u, c) / range } else { 0.0 }
    };
    let all = (0..u.components()).map(share).fold(0.0, f64::max);
    (all - harm).max(0.0) / dt
}

/// The largest change of an unknown at a fixed place, past which the nodes move.
pub(super) fn change_in_place<const D: usize>(before: &State<D>, after: &State<D>, c: usize) -> f64
where
    Mesh<D>: Cells<D>,
{
    change(before, &after.mesh, &after.u, c)
}

fn change<const D: usize>(before: &State<D>, mesh: &Mesh<D>, u: &Field, c: usize) -> f64
where
    Mesh<D>: Cells<D>,
{
    let (from, to) = (DualCells::new(&before.mesh), DualCells::new(mesh));
    let swept = from.swept(&to);
    let strides = to.patch().padded_strides();
    let [old, new] = [&before.u, u].map(|u| {
        let values: Vec<[f64; 1]> = u.component(c).map(|u| [u]).collect();
        padded(mesh.lattice(), &values, [[0.0]; D])
    });
    let middle = |k: usize, n: usize| 0.25 * ((old[k][0] + old[n][0]) + (new[k][0] + new[n][0]));
    let changes = to.patch().places().enumerate().map(|(i, k)| {
        // what the moving mesh alone would have made of the old values
        let mut carried = from.areas()[i] * old[k][0];
        for (d, s) in strides.into_iter().enumerate() {
            carried += swept[k][d] * middle(k, k + s) - swept[k - s][d] * middle(k - s, k);
        }
        new[k][0] - carried / to.areas()[i]
    });
    changes.fold(0.0, larger)
}

/// The range of an unknown; 0 where it is made of rounding.
pub(super) fn range(u: &Field, c: usize) -> f64 {
    let extremes = (f64::INFINITY, f64::NEG_INFINITY);
    let (low, high) = u.component(c).fold(extremes, |(low, high), u| (low.min(u), high.max(u)));
    if high - low > 1e-12 * low.abs().max(high.abs()) { high - low } else { 0.0 }
}
