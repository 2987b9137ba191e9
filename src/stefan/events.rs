//! Phases that vanish, and phases that appear.

use super::columns::{LOWER, UPPER};
use super::conduct::{Fields, Reach, velocity};
use super::solver::{Attempt, Front, FrontState, Problem};
use crate::error::{Error, Failure, Result};
use crate::work::Work;
use serde::{Deserialize, Serialize};

/// A phase that is nowhere thicker than this share of the distance between the walls is taken to vanish at the speed
/// that its front has.
const THIN: f64 = 0.01;
/// The share of the way to the wall that a front moves in a part of a step before it reaches the wall.
const PART: f64 = 0.2;
/// Parts of a step after which it is given up.
const MOST_PARTS: usize = 60;

/// What happens to a phase.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Change {
    /// The phase is there from now on.
    Appeared,
    /// The phase is gone.
    Vanished,
}

/// A phase that appears or vanishes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PhaseEvent {
    /// When.
    pub t: f64,
    /// What.
    pub event: Change,
    /// `lower` or `upper`.
    pub phase: String,
}

impl PhaseEvent {
    pub(super) fn new(t: f64, event: Change, phase: usize) -> Self {
        Self { t, event, phase: ["lower", "upper"][phase].into() }
    }
}

impl Front {
    /// The phase that fills the box where a front lies on a wall everywhere.
    pub(super) fn fills(&self, h: &[f64]) -> Option<usize> {
        let [bottom, top] = [LOWER, UPPER].map(|phase| self.columns.wall(phase));
        let on = |wall: &[f64]| (0..h.len()).all(|i| (h[i] - wall[i]).abs() <= 1e-12 * (top[i] - bottom[i]));
        if on(top) { Some(LOWER) } else { on(bottom).then_some(UPPER) }
    }

    /// Speed of the front at each column.
    pub(super) fn speed(&self, problem: &dyn Problem, state: &FrontState) -> Option<Vec<f64>> {
        let limit = self.limit(state);
        let dt = if limit.is_finite() { 1e-3 * limit } else { 1.0 };
        let slopes = self.slopes(&state.front, &state.u, &state.bare);
        let moved = self.moved(problem, &state.fields(), &state.front, &slopes, [state.t, dt]).ok()?;
        Some(state.front.iter().zip(&moved).map(|(a, b)| (b - a) / dt).collect())
    }

    /// The phase that is thin everywhere and melts or freezes away, and when it is gone.
    fn vanishing(&self, problem: &dyn Problem, state: &FrontState) -> Option<(usize, f64)> {
        let speed = self.speed(problem, state)?;
        let [bottom, top] = [LOWER, UPPER].map(|phase| self.columns.wall(phase));
        [LOWER, UPPER].into_iter().find_map(|phase| {
            let wall = self.columns.wall(phase);
            let left = |i: usize| (wall[i] - state.front[i]).abs();
            let there = || (0..wall.len()).filter(|&i| state.bare[i] != Some(phase));
            let thin = there().all(|i| state.bare[i].is_none() && left(i) <= THIN * (top[i] - bottom[i]));
            let toward: f64 = there().map(|i| speed[i]).sum::<f64>() * if phase == UPPER { 1.0 } else { -1.0 };
            let thickness: f64 = there().map(left).sum();
            (thin && toward > 0.0).then(|| (phase, state.t + thickness / toward))
        })
    }

    /// A step to `t` in which a phase vanishes, everywhere or at some columns; `failure` where none does.
    pub(super) fn cross(
        &mut self,
        problem: &dyn Problem,
        state: &FrontState,
        t: f64,
        failure: Failure,
    ) -> Result<Attempt> {
        let (mut now, mut work, mut part) = (state.clone(), Work::default(), PART);
        for _ in 0..MOST_PARTS + 2 * state.front.len() {
            if let Some((phase, gone)) = self.vanishing(problem, &now) {
                let left = self.vanish(problem, &now, phase, [gone, gone.min(t)])?;
                let mut end = Attempt { state: left, work, error: None, event: None };
                if end.state.t < t {
                    end = self.plain(problem, &end.state, t)?;
                }
                end.state.step = state.step + 1;
                end.work += work;
                end.event = Some(PhaseEvent::new(gone, Change::Vanished, phase));
                return Ok(end);
            }
            let uncovered = self.uncovered(problem, &now);
            // the rest may go on by itself once a wall is bare
            let whole = uncovered.is_some();
            let to = if whole { t } else { (now.t + part * self.passage(problem, &now)).min(t) };
            now = uncovered.unwrap_or(now);
            match self.plain(problem, &now, to) {
                Ok(mut reached) => {
                    work += reached.work;
                    reached.state.step = state.step + 1;
                    if to == t {
                        return Ok(Attempt { work, error: None, ..reached });
                    }
                    now = reached.state;
                }
                Err(Error::Failed { .. }) if whole => (),
                Err(Error::Failed { .. }) => part *= 0.5,
                Err(other) => return Err(other),
            }
        }
        Err(failure.into())
    }

    /// The state at a time `t`, without a phase that is gone at the time `gone`. What its last per cent took is not
    /// part of the balance of energy.
    fn vanish(
        &mut self,
        problem: &dyn Problem,
        state: &FrontState,
        phase: usize,
        [gone, t]: [f64; 2],
    ) -> Result<FrontState> {
        let (rest, from) = (1 - phase, state.fields());
        let h = self.columns.wall(phase).to_vec();
        let dt = (gone - state.t).max(1e-12 * gone.abs()).max(f64::MIN_POSITIVE);
        let [old, new] = [&from.h, &h].map(|h| self.columns.heights(rest, h));
        let motion = velocity(&old, &new, dt);
        let mut u = from.u.each_ref().map(|u| vec![self.material.melting; u.len()]);
        let reach = Reach { phase: rest, alone: None, bare: &from.bare };
        u[rest] = self.conduct_in(problem, reach, [&new, &from.u[rest], &from.u[rest]], Some(&motion), [t, dt])?;
        let end = Fields { bare: vec![None; h.len()], h, u, alone: Some(rest) };
        Ok(self.rebalanced(state, end, t))
    }

    /// A state with another energy, for which nothing has flowed.
    pub(super) fn rebalanced(&self, state: &FrontState, end: Fields, t: f64) -> FrontState {
        let mut energy = state.energy;
        let now = self.content(&end);
        energy.inflow += now - energy.now;
        energy.inflow_by_differences += now - energy.now;
        energy.now = now;
        FrontState::of(end, (t, state.step + 1), energy, state.way)
    }

    /// Front and temperatures on a mesh that can be drawn: where a phase fills the box, its rows and those of the other
    /// one share it.
    pub fn shown(&self, state: &FrontState) -> (Vec<f64>, [Vec<f64>; 2]) {
        let Some(alone) = state.alone else { return (state.front.clone(), state.u.clone()) };
        let columns = &self.columns;
        let [bottom, top] = [LOWER, UPPER].map(|phase| columns.wall(phase));
        let [n, m] = [LOWER, UPPER].map(|phase| columns.rows(phase) as f64);
        let h: Vec<f64> = bottom.iter().zip(top).map(|(b, c)| b + (c - b) * n / (n + m)).collect();
        let (full, nodes) = (columns.heights(alone, &state.front), columns.rows(alone) + 1);
        let u = [LOWER, UPPER].map(|phase| {
            let rows = columns.rows(phase) + 1;
            let at = |(k, y): (usize, &f64)| {
                let column = k / rows * nodes..(k / rows + 1) * nodes;
                along(&full[column.clone()], &state.u[alone][column], *y)
            };
            columns.heights(phase, &h).iter().enumerate().map(at).collect()
        });
        (h, u)
    }
}

/// Values along a column, interpolated linearly at a height.
pub(super) fn along(y: &[f64], u: &[f64], at: f64) -> f64 {
    let k = y.partition_point(|y| *y <= at).clamp(1, y.len() - 1);
    u[k - 1] + (u[k] - u[k - 1]) * (at - y[k - 1]) / (y[k] - y[k - 1])
}
