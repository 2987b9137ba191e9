//! How much the mass that neighbours share counts.

use super::FormulaLaw;
use crate::numerics::larger;
use crate::physics::finite_volumes::BISTABLE;

/// Weight s of the mass that neighbours share (`Excess`) where the state ahead of a front is unstable, so that small
/// values pull the front: full coupling (1) reaches 0.27ⁿ of n nodes ahead at once and starts growth there, none makes
/// the speed of the front wrong to second order in wide cells.
const PULLED: f64 = 0.5;
/// No mass is shared where D in the unstable state ahead of a front is below this share of the largest D: diffusion
/// would not damp overshoots there.
const DAMPS: f64 = 0.5;
/// A state rests where the source is at most this share of the largest source.
const RESTS: f64 = 1e-3;

impl<const D: usize, const B: usize, const P: usize, const K: usize, Solver: Default> FormulaLaw<D, B, P, K, Solver> {
    /// The weight of each unknown: [`BISTABLE`] where the source draws the least and the largest values back and pushes
    /// values between them away, [`PULLED`] where it pushes one of these ends away, which is a state at rest, and else
    /// 1; 0 for those that share no mass. `nodes` gives the formulas at the nodes.
    pub(super) fn weights_of_neighbours(&self, nodes: impl FnOnce() -> Vec<[f64; K]>, u: &[[f64; B]]) -> [f64; B] {
        let mut weights = self.kinds.shares.map(|shares| if shares { 1.0 } else { 0.0 });
        if !self.kinds.bends.contains(&true) {
            return weights;
        }
        let nodes = nodes();
        for c in (0..B).filter(|&c| self.kinds.bends[c]) {
            let slope = |k: usize| Self::slope(&nodes[k], Self::SOURCE, c, c);
            let by_value = |a: &usize, b: &usize| u[*a][c].total_cmp(&u[*b][c]);
            let ends = [(0..u.len()).min_by(by_value), (0..u.len()).max_by(by_value)];
            let spread = |k: usize| Self::value(&nodes[k], Self::DIFFUSIVITY, c);
            let source = |k: usize| Self::value(&nodes[k], Self::SOURCE, c);
            let largest = |of: &dyn Fn(usize) -> f64| (0..u.len()).map(of).fold(0.0, larger);
            let (most, strongest) = (largest(&spread), largest(&source));
            let grows = |k: &usize| slope(*k) > 0.0 && source(*k).abs() <= RESTS * strongest;
            if let Some(unstable) = ends.into_iter().flatten().find(grows) {
                weights[c] = if spread(unstable) > DAMPS * most { PULLED } else { 0.0 };
                continue;
            }
            let keeps = ends.into_iter().flatten().all(|k| slope(k) < 0.0);
            if self.kinds.reacts_alike[c] && keeps && (0..u.len()).any(|k| slope(k) > 0.0) {
                weights[c] = BISTABLE;
            }
        }
        weights
    }
}
