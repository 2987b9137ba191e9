//! What a front shows: gradients and speed, how far they can be trusted, errors.

use super::columns::{LOWER, UPPER};
use super::front;
use super::heat::{end_slope, end_slope_of_four};
use super::solver::{Front, FrontState, Problem};
use crate::error::Failure;
use crate::numerics::larger;

/// Where a phase at its melting temperature begins to be warmed from a wall, its gradient at the front is below the
/// round-off and the overshoot of a step: at most this share of the gradient across the phase, of any sign.
const OVERSHOOT: f64 = 1e-6;

impl Front {
    /// The number of the phase on the mesh of [`Columns::whole`](super::Columns::whole), at its nodes and in its cells:
    /// 1 below the front and on it, 0 above.
    pub fn phases(&self, state: &FrontState) -> [Vec<f64>; 2] {
        let [n, m] = [LOWER, UPPER].map(|phase| self.columns.rows(phase));
        let lower = |i: usize, below: bool| match (state.alone, state.bare[i]) {
            (Some(alone), _) => alone == LOWER,
            (None, Some(missing)) => missing == UPPER,
            (None, None) => below,
        };
        let number = |lower: bool| if lower { 1.0 } else { 0.0 };
        let columns = state.front.len();
        let at_nodes = (0..columns * (n + m + 1)).map(|k| number(lower(k / (n + m + 1), k % (n + m + 1) <= n)));
        let cell = |k: usize| {
            let (i, below) = (k / (n + m), k % (n + m) < n);
            let [left, right] = [lower(i, below), lower(i + 1, below)];
            number(if below { left || right } else { left && right })
        };
        [at_nodes.collect(), (0..(columns - 1) * (n + m)).map(cell).collect()]
    }

    /// Refuses a state with the warm phase above the front.
    pub(super) fn check_warm_below(&self, state: &FrontState) -> Result<(), Failure> {
        if self.undercooled.is_some() || state.alone.is_some() {
            return Ok(());
        }
        let slopes = self.slopes(&state.front, &state.u, &state.bare);
        let conductivity = self.material.conductivity;
        // of the largest difference of temperature over the height of a phase
        let flux = |phase: usize| {
            let most = state.u[phase].iter().fold(0.0_f64, |most, u| most.max((u - self.material.melting).abs()));
            let y = self.columns.heights(phase, &state.front);
            conductivity[phase] * most / (y[self.columns.rows(phase)] - y[0]).abs()
        };
        let negligible = OVERSHOOT * flux(LOWER).max(flux(UPPER));
        front::check_warm_below(&self.columns, &state.front, &slopes, conductivity, negligible)
    }

    pub(super) fn heights(&self, h: &[f64]) -> [Vec<f64>; 2] {
        [LOWER, UPPER].map(|phase| self.columns.heights(phase, h))
    }

    /// Slopes of the temperatures u of both phases at a front, over three rows; 0 where a wall is bare.
    pub(super) fn slopes(&self, h: &[f64], u: &[Vec<f64>; 2], bare: &[Option<usize>]) -> [Vec<f64>; 2] {
        let mut slopes = front::slopes(&self.columns, &self.heights(h), u, end_slope);
        for slopes in &mut slopes {
            slopes.iter_mut().zip(bare).filter(|(_, bare)| bare.is_some()).for_each(|(slope, _)| *slope = 0.0);
        }
        slopes
    }

    /// The speed of the front, and what it would be more by gradients over four rows; means of sizes over the columns.
    pub(super) fn pace(&self, state: &FrontState) -> [f64; 2] {
        let y = self.heights(&state.front);
        let tilt = front::tilt(&self.columns, &state.front, self.mirrored());
        let [three, four] = [
            front::slopes(&self.columns, &y, &state.u, end_slope),
            front::slopes(&self.columns, &y, &state.u, end_slope_of_four),
        ]
        .map(|slopes| front::jump(&slopes, self.material.conductivity));
        let mut sums = [0.0; 2];
        for i in (0..tilt.len()).filter(|&i| state.bare[i].is_none()) {
            let factor = (1.0 + tilt[i] * tilt[i]) / (self.material.latent_heat * tilt.len() as f64);
            sums[0] += factor * three[i].abs();
            sums[1] += factor * (four[i] - three[i]).abs();
        }
        sums
    }

    /// The share of its way by which the front is in doubt, since rows are few; none before it has moved
    ///
    /// It is by how much the way would be another one if gradients at the front were taken over four rows in place of
    /// three; in an undercooled melt at least the gap ε of the balance of energy times what the speed of growth answers
    /// to a change of the heat, for a flat front about
    ///
    /// ```text
    /// ε (1 − S/2) / (1 − S),      S = C (T_m − u) / Λ of the coldest melt
    /// ```
    pub fn doubt(&self, state: &FrontState) -> Option<f64> {
        let rows = (state.way[0] > 0.0).then(|| state.way[1] / state.way[0])?;
        let Some(melt) = self.undercooled else { return Some(rows) };
        let s = self.undercooling(melt, state);
        let answer = if s < 1.0 { (1.0 - 0.5 * s) / (1.0 - s) } else { f64::MAX };
        Some(state.energy.imbalance().map_or(rows, |gap| rows.max(gap * answer)))
    }

    /// C (T_m − u) / Λ of the coldest place of a melt: at 1 what freezes there gives just the heat that warms the melt
    /// up to melting.
    pub fn undercooling(&self, melt: usize, state: &FrontState) -> f64 {
        let coldest = state.u[melt].iter().copied().fold(self.material.melting, f64::min);
        self.material.capacity[melt] * (self.material.melting - coldest) / self.material.latent_heat
    }

    /// The longest step for which the explicit front is stable, as estimated from the temperatures at the front.
    pub fn limit(&self, state: &FrontState) -> f64 {
        match state.alone {
            Some(_) => f64::INFINITY,
            None => {
                let slopes = self.slopes(&state.front, &state.u, &state.bare);
                front::limit(&self.columns, &slopes, &self.material, self.filter)
            }
        }
    }

    /// The time in which the front, at its speed now, would move as far as it is from the nearer wall.
    pub fn passage(&self, problem: &dyn Problem, state: &FrontState) -> f64 {
        let speed = if state.alone.is_none() { self.speed(problem, state) } else { None };
        let time = |(i, speed): (usize, &f64)| self.columns.room(i, state.front[i]) / speed.abs();
        speed.unwrap_or_default().iter().enumerate().map(time).fold(f64::INFINITY, f64::min)
    }

    /// The lowest and the highest temperature, and the means of those of the bottom and of the top.
    pub fn temperatures(&self, state: &FrontState) -> [f64; 4] {
        let there = || super::conduct::present(state.alone).flat_map(|phase| &state.u[phase]).copied();
        let last = state.front.len() - 1;
        let mean = |wall: usize| {
            let at = |i: usize| {
                let reaches =
                    state.alone.or(state.bare[i].filter(|missing| *missing == wall).map(|missing| 1 - missing));
                let phase = reaches.unwrap_or(wall);
                let nodes = self.columns.rows(phase) + 1;
                let row = if wall == LOWER { 0 } else { nodes - 1 };
                state.u[phase][i * nodes + row] * if i == 0 || i == last { 0.5 } else { 1.0 }
            };
            (0..=last).map(at).sum::<f64>() / last as f64
        };
        [there().fold(f64::INFINITY, f64::min), there().fold(f64::NEG_INFINITY, f64::max), mean(LOWER), mean(UPPER)]
    }

    /// Largest errors of the front and of the temperature, where the problem knows the exact solution.
    pub fn errors(&self, problem: &dyn Problem, state: &FrontState) -> Option<[f64; 2]> {
        if state.alone.is_some() {
            return None;
        }
        let x = self.columns.x();
        let mut worst = [0.0, 0.0];
        for (&x, &h) in x.iter().zip(&state.front) {
            worst[0] = larger(worst[0], h - problem.exact_front(x, state.t)?);
        }
        for phase in [LOWER, UPPER] {
            let nodes = self.columns.rows(phase) + 1;
            for (k, (y, u)) in self.columns.heights(phase, &state.front).iter().zip(&state.u[phase]).enumerate() {
                worst[1] = larger(worst[1], u - problem.exact([x[k / nodes], *y], state.t)?);
            }
        }
        Some(worst)
    }
}
