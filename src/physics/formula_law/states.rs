//! States that an equation keeps.

use super::FormulaLaw;
use crate::numerics::ends;
use crate::physics::finite_volumes::{Law, Side};

impl<const D: usize, const B: usize, const P: usize, const K: usize, Solver> FormulaLaw<D, B, P, K, Solver>
where
    Solver: Default + Sync,
{
    /// Whether unknown c stays at a value: it has no source there at any place, and one flux everywhere.
    fn is_kept(&self, t: f64, x: &[[f64; D]], u: &[[f64; B]], (c, state): (usize, f64)) -> bool {
        let there: Vec<[f64; B]> =
            (u.iter()).map(|u| std::array::from_fn(|e| if e == c { state } else { u[e] })).collect();
        let nodes = self.nodes(t, x, &there);
        let flux = |node: &[f64; K]| -> [f64; D] { std::array::from_fn(|d| Self::value(node, d, c)) };
        nodes.iter().all(|node| Self::value(node, Self::SOURCE, c) == 0.0 && flux(node) == flux(&nodes[0]))
    }

    /// For each unknown the states that it keeps and that all its values are above or below of, as a lower and an upper
    /// end; ±∞ for none.
    pub(super) fn kept(
        &self,
        (t, x): (f64, &[[f64; D]]),
        u: &[[f64; B]],
        sides: &[Side<B>],
        states: &[Vec<f64>; B],
    ) -> [[f64; 2]; B] {
        std::array::from_fn(|c| {
            let given = sides.iter().filter_map(|side| side.given[c]);
            let values = u.iter().map(|u| u[c]).chain(given);
            let [least, most] = ends(values);
            let mut kept = [f64::NEG_INFINITY, f64::INFINITY];
            for &state in &states[c] {
                if (state <= least || state >= most) && self.is_kept(t, x, u, (c, state)) {
                    kept[usize::from(state >= most)] = state;
                }
            }
            kept
        })
    }
}
