//! Phases that vanish, and phases that appear.

use super::columns::{LOWER, UPPER};
use super::conduct::{Fields, velocity};
use super::exact::Similarity;
use super::material::Material;
use super::solver::{Attempt, Front, FrontState, Problem};
use crate::error::{Error, Failure, Result};
use crate::work::Work;
use serde::{Deserialize, Serialize};

/// A phase that is nowhere thicker than this share of the distance between the walls vanishes at its speed then.
const THIN: f64 = 0.01;
/// A phase appears with this share of the distance between the walls.
const SEED: f64 = 4e-3;
/// The share of the way to the wall that a front moves in a part of a step before it reaches the wall.
const PART: f64 = 0.2;
/// Parts of a step after which it is given up.
const MOST_PARTS: usize = 60;

/// What happens to a phase.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Change {
    /// It is there from now on.
    Appeared,
    /// It is gone.
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
    fn new(t: f64, event: Change, phase: usize) -> Self {
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
        let dt = 1e-3 * self.limit(state).min(1.0);
        let moved = self.moved(problem, [&state.front; 2], &self.slopes(&state.front, &state.u), [state.t, dt]).ok()?;
        Some(state.front.iter().zip(&moved).map(|(a, b)| (b - a) / dt).collect())
    }

    /// The phase that is thin everywhere and melts or freezes away, and when it is gone.
    fn vanishing(&self, problem: &dyn Problem, state: &FrontState) -> Option<(usize, f64)> {
        let speed = self.speed(problem, state)?;
        let [bottom, top] = [LOWER, UPPER].map(|phase| self.columns.wall(phase));
        [LOWER, UPPER].into_iter().find_map(|phase| {
            let wall = self.columns.wall(phase);
            let left = |i: usize| (wall[i] - state.front[i]).abs();
            let thin = (0..wall.len()).all(|i| left(i) <= THIN * (top[i] - bottom[i]));
            let toward: f64 = speed.iter().sum::<f64>() * if phase == UPPER { 1.0 } else { -1.0 };
            let thickness: f64 = (0..wall.len()).map(left).sum();
            (thin && toward > 0.0).then(|| (phase, state.t + thickness / toward))
        })
    }

    /// A step to `t` in which a phase vanishes; `failure` where none does.
    pub(super) fn cross(
        &mut self,
        problem: &dyn Problem,
        state: &FrontState,
        t: f64,
        failure: Failure,
    ) -> Result<Attempt> {
        let (mut now, mut work, mut part) = (state.clone(), Work::default(), PART);
        for _ in 0..MOST_PARTS {
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
            let to = (now.t + part * self.passage(problem, &now)).min(t);
            match self.plain(problem, &now, to) {
                Ok(mut reached) => {
                    work += reached.work;
                    reached.state.step = state.step + 1;
                    if to == t {
                        return Ok(Attempt { work, error: None, ..reached });
                    }
                    now = reached.state;
                }
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
        u[rest] = self.conduct_in(problem, (rest, None), [&new, &from.u[rest]], Some(&motion), [t, dt])?;
        let end = Fields { h, u, alone: Some(rest) };
        Ok(self.rebalanced(state, end, t))
    }

    /// A state with another energy, for which nothing has flowed.
    fn rebalanced(&self, state: &FrontState, end: Fields, t: f64) -> FrontState {
        let mut energy = state.energy;
        let now = self.content(&end);
        energy.inflow += now - energy.now;
        energy.inflow_by_differences += now - energy.now;
        energy.now = now;
        FrontState { t, step: state.step + 1, front: end.h, u: end.u, alone: end.alone, energy }
    }

    /// The state soon after the other phase has appeared at its wall, whose temperature is beyond melting; none where
    /// it is not. The new phase and what it does to the other one are Neumann's solution.
    pub(super) fn appear(
        &self,
        problem: &dyn Problem,
        state: &FrontState,
        t: f64,
    ) -> Result<Option<(FrontState, PhaseEvent)>> {
        let Some(alone) = state.alone else { return Ok(None) };
        let (phase, melting, columns) = (1 - alone, self.material.melting, &self.columns);
        if self.has_flux(problem, phase, t) || self.undercooled.is_some() {
            return Ok(None);
        }
        let (wall, other, n) = (columns.wall(phase), columns.wall(alone), columns.x().len());
        let nodes = columns.rows(alone) + 1;
        let at = if phase == LOWER { 0 } else { nodes - 1 };
        // as if the new phase were the warm one
        let sign = if phase == LOWER { 1.0 } else { -1.0 };
        let mean = |f: &dyn Fn(usize) -> f64| (0..n).map(f).sum::<f64>() / n as f64;
        let hot = sign * (mean(&|i| problem.boundary(phase, [columns.x()[i], wall[i]], t)) - melting);
        let far = sign * (mean(&|i| state.u[alone][i * nodes + at]) - melting);
        if hot.is_nan() || hot <= 0.0 {
            return Ok(None);
        }
        let pair = |values: [f64; 2]| [values[phase], values[alone]];
        let Material { conductivity, capacity, latent_heat, .. } = self.material;
        let scaled = Material::new(pair(conductivity), pair(capacity), latent_heat, 0.0)?;
        let solution = Similarity::planar([hot, far.min(0.0)], scaled, 0.0, 0.0)?;
        let gap = (0..n).map(|i| (wall[i] - other[i]).abs()).fold(0.0, f64::max);
        let grown = solution.time(SEED * gap).min(t - state.t);
        let h: Vec<f64> = wall.iter().map(|wall| wall + sign * SEED * gap).collect();
        let time = solution.time(SEED * gap);
        let [full, y] = [&state.front, &h].map(|h| self.heights(h));
        let mut u = state.u.clone();
        for (k, u) in u[phase].iter_mut().enumerate() {
            let s = sign * (y[phase][k] - wall[k / (columns.rows(phase) + 1)]);
            *u = melting + sign * solution.temperature([0.0, s], time);
        }
        for (k, u) in u[alone].iter_mut().enumerate() {
            let column = k / nodes * nodes..(k / nodes + 1) * nodes;
            let before = along(&full[alone][column.clone()], &state.u[alone][column], y[alone][k]);
            let s = sign * (y[alone][k] - wall[k / nodes]);
            *u = before + sign * (solution.temperature([0.0, s], time) - far.min(0.0));
        }
        let event = PhaseEvent::new(state.t, Change::Appeared, phase);
        Ok(Some((self.rebalanced(state, Fields { h, u, alone: None }, state.t + grown), event)))
    }

    /// The phase that would appear at a wall with a given flux, where its temperature is beyond melting.
    pub fn overdue(&self, problem: &dyn Problem, state: &FrontState) -> Option<&'static str> {
        const BEYOND: f64 = 1e-6;
        let alone = state.alone?;
        let (phase, nodes) = (1 - alone, self.columns.rows(alone) + 1);
        let at = if phase == LOWER { 0 } else { nodes - 1 };
        let beyond = |u: &f64| (u - self.material.melting) * if phase == LOWER { 1.0 } else { -1.0 };
        let farthest = state.u[alone].iter().skip(at).step_by(nodes).map(beyond).fold(f64::MIN, f64::max);
        let size = state.u[alone].iter().map(|u| beyond(u).abs()).fold(0.0, f64::max);
        (self.has_flux(problem, phase, state.t) && farthest > BEYOND * size).then_some(["lower", "upper"][phase])
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
fn along(y: &[f64], u: &[f64], at: f64) -> f64 {
    let k = y.partition_point(|y| *y <= at).clamp(1, y.len() - 1);
    u[k - 1] + (u[k] - u[k - 1]) * (at - y[k - 1]) / (y[k] - y[k - 1])
}
