//! Phases that appear at a wall, everywhere or in part, and walls that a phase has left bare in part.
//!
//! Where a wall is bare the front stays in front of it, at a small share of the distance between the walls: what is
//! between them is at the melting temperature and takes no part, and the other phase has the condition of the wall.

use super::columns::{FILM, LOWER, UPPER};
use super::conduct::Fields;
use super::events::{Change, PhaseEvent, along};
use super::exact::Similarity;
use super::material::Material;
use super::solver::{Front, FrontState, Problem};
use crate::error::{Failure, Result};

/// A phase appears with this share of the distance between the walls, where it is thickest.
const SEED: f64 = 4e-3;
/// A phase leaves a wall bare at a column where it is thinner than this share of the distance between the walls.
const LEAVES: f64 = 2.0 * FILM;
/// A temperature counts as beyond melting only by more than this share of the largest temperature: less is rounding.
const ROUNDING: f64 = 1e-9;
/// A wall on the wrong side of melting by less than this share of the largest temperature is accepted: steps overshoot
/// by as much.
const OVERSHOOT: f64 = 1e-6;

/// 1 where a phase lies above its wall and is the warm one, −1 for the other.
fn sign(phase: usize) -> f64 {
    if phase == LOWER { 1.0 } else { -1.0 }
}

impl Front {
    /// The largest temperature above or below melting.
    fn size(&self, state: &FrontState) -> f64 {
        state.u.iter().flatten().map(|u| (u - self.material.melting).abs()).fold(0.0, f64::max)
    }

    /// How far the wall of a phase is at a column beyond melting, on the side of the phase, if it reaches the other
    /// one: by its given temperature at time `t`, or by the heat that this holds.
    fn beyond(&self, problem: &dyn Problem, state: &FrontState, (phase, i): (usize, usize), t: f64) -> f64 {
        let (columns, melting) = (&self.columns, self.material.melting);
        if !self.has_flux(problem, phase, t) {
            return sign(phase) * (problem.boundary(phase, [columns.x()[i], columns.wall(phase)[i]], t) - melting);
        }
        let (y, u) = self.column(state, 1 - phase, i);
        let above: Vec<f64> = u.iter().map(|u| (sign(phase) * (u - melting)).max(0.0)).collect();
        let cells = y.windows(2).zip(above.windows(2));
        let heat: f64 = cells.map(|(y, u)| 0.5 * (y[1] - y[0]) * (u[0] + u[1])).sum();
        let enough = self.material.latent_heat * FILM * columns.gap(i);
        let at_wall = above[if phase == LOWER { 0 } else { above.len() - 1 }];
        if self.material.capacity[1 - phase] * heat >= enough { at_wall } else { 0.0 }
    }

    /// Heights and temperatures of a phase at a column.
    fn column(&self, state: &FrontState, phase: usize, i: usize) -> (Vec<f64>, Vec<f64>) {
        let nodes = self.columns.rows(phase) + 1;
        let own = i * nodes..(i + 1) * nodes;
        (self.columns.heights(phase, &state.front)[own.clone()].to_vec(), state.u[phase][own].to_vec())
    }

    /// The state soon after the other phase has appeared at its wall, which is beyond the melting temperature
    /// somewhere; none where it is not. The new phase and what it does to the other one are, column by column,
    /// Neumann's solution; at a wall with a given flux, what the heat beyond melting makes melt.
    pub(super) fn appear(
        &self,
        problem: &dyn Problem,
        state: &FrontState,
        t: f64,
    ) -> Result<Option<(FrontState, PhaseEvent)>> {
        let Some(alone) = state.alone.filter(|_| self.undercooled.is_none()) else { return Ok(None) };
        let (phase, n) = (1 - alone, self.columns.x().len());
        let limit = ROUNDING * self.size(state);
        let hot: Vec<f64> = (0..n).map(|i| self.beyond(problem, state, (phase, i), t)).collect();
        if !hot.iter().any(|hot| *hot > limit) {
            return Ok(None);
        }
        let event = PhaseEvent::new(state.t, Change::Appeared, phase);
        if self.has_flux(problem, phase, t) {
            let mut bare = state.fields();
            bare.h = (0..n).map(|i| self.columns.film(phase, i)).collect();
            (bare.alone, bare.bare) = (None, vec![Some(phase); n]);
            bare.u[phase].fill(self.material.melting);
            bare.u[alone] = self.interpolated(state, alone, &bare.h);
            let found = self.rebalanced(state, bare, state.t);
            let hot: Vec<usize> = (0..n).filter(|&i| hot[i] > limit).collect();
            return Ok(Some((self.melted(problem, &found, phase, &hot, t), event)));
        }
        let Some((fields, grown)) = self.seeded(state, phase, &hot)? else { return Ok(None) };
        Ok(Some((self.rebalanced(state, fields, state.t + grown.min(t - state.t)), event)))
    }

    /// Temperatures of a phase that fills the box, on rows that end at the front `h`.
    fn interpolated(&self, state: &FrontState, alone: usize, h: &[f64]) -> Vec<f64> {
        let (full, nodes) = (self.columns.heights(alone, &state.front), self.columns.rows(alone) + 1);
        let at = |(k, y): (usize, &f64)| {
            let column = k / nodes * nodes..(k / nodes + 1) * nodes;
            along(&full[column.clone()], &state.u[alone][column], *y)
        };
        self.columns.heights(alone, h).iter().enumerate().map(at).collect()
    }

    /// Neumann's solution at each column whose wall is `hot`, at the time at which it is [`SEED`] thick somewhere; and
    /// this time.
    fn seeded(&self, state: &FrontState, phase: usize, hot: &[f64]) -> Result<Option<(Fields, f64)>> {
        let (alone, columns, melting) = (1 - phase, &self.columns, self.material.melting);
        let (sign, n) = (sign(phase), hot.len());
        let pair = |values: [f64; 2]| [values[phase], values[alone]];
        let Material { conductivity, capacity, latent_heat, .. } = self.material;
        // as if the new phase were the warm one
        let scaled = Material::new(pair(conductivity), pair(capacity), latent_heat, 0.0)?;
        let far: Vec<f64> = (0..n)
            .map(|i| {
                let (_, u) = self.column(state, alone, i);
                (sign * (u[if phase == LOWER { 0 } else { u.len() - 1 }] - melting)).min(0.0)
            })
            .collect();
        let of = |i: usize| Similarity::planar([hot[i], far[i]], scaled, 0.0, 0.0).ok();
        let solutions: Vec<Option<Similarity>> = (0..n).map(of).collect();
        let soonest = |i: usize| solutions[i].map(|solution| solution.time(SEED * columns.gap(i)));
        let time = (0..n).filter_map(soonest).fold(f64::INFINITY, f64::min);
        if time == f64::INFINITY {
            return Ok(None);
        }
        let thickness = |i: usize| solutions[i].map(|solution| 2.0 * solution.lambda() * time.sqrt());
        let bare = (0..n).map(|i| thickness(i).is_none_or(|s| s < FILM * columns.gap(i)).then_some(phase));
        let bare: Vec<Option<usize>> = bare.collect();
        let height = |i: usize| match thickness(i).filter(|_| bare[i].is_none()) {
            Some(thickness) => columns.wall(phase)[i] + sign * thickness,
            None => columns.film(phase, i),
        };
        let h: Vec<f64> = (0..n).map(height).collect();
        let y = self.heights(&h);
        let mut u = [LOWER, UPPER].map(|p| vec![melting; y[p].len()]);
        u[alone] = self.interpolated(state, alone, &h);
        for p in [LOWER, UPPER] {
            for (k, u) in u[p].iter_mut().enumerate() {
                let i = k / (columns.rows(p) + 1);
                let Some(solution) = solutions[i].filter(|_| bare[i].is_none()) else { continue };
                let s = sign * (y[p][k] - columns.wall(phase)[i]);
                let change = if p == phase { 0.0 } else { far[i] };
                *u += sign * (solution.temperature([0.0, s], time) - change);
            }
        }
        Ok(Some((Fields { h, u, alone: None, bare }, time)))
    }

    /// A state in which `phase` is there at columns `hot`, whose walls are bare so far.
    fn melted(&self, problem: &dyn Problem, state: &FrontState, phase: usize, hot: &[usize], t: f64) -> FrontState {
        let (columns, melting) = (&self.columns, self.material.melting);
        let mut end = state.fields();
        for &i in hot {
            end.bare[i] = None;
            let place = [columns.x()[i], columns.wall(phase)[i]];
            let (y, _) = self.column(state, phase, i);
            let outward = -sign(phase) / self.material.conductivity[phase];
            let slope = match problem.flux(phase, place, melting, t) {
                Some([flux, _]) => outward * flux,
                None => (melting - problem.boundary(phase, place, t)) / (state.front[i] - place[1]),
            };
            let nodes = y.len();
            for (j, y) in y.iter().enumerate() {
                end.u[phase][i * nodes + j] = melting + slope * (y - state.front[i]);
            }
            let nodes = columns.rows(1 - phase) + 1;
            // what the other phase holds beyond melting has melted
            for u in &mut end.u[1 - phase][i * nodes..(i + 1) * nodes] {
                *u = sign(phase) * (sign(phase) * *u).min(sign(phase) * melting);
            }
        }
        self.rebalanced(state, end, state.t)
    }

    /// The state before a step to `t`, with the phase at bare walls that are beyond the melting temperature then; none
    /// where no wall is.
    pub(super) fn covered(&self, problem: &dyn Problem, state: &FrontState, t: f64) -> Option<FrontState> {
        let limit = ROUNDING * self.size(state);
        let phase = state.bare.iter().copied().flatten().next()?;
        let hot = |i: &usize| state.bare[*i] == Some(phase) && self.beyond(problem, state, (phase, *i), t) > limit;
        let mut hot: Vec<usize> = (0..state.bare.len()).filter(hot).collect();
        while !hot.is_empty() {
            let mut end = self.melted(problem, state, phase, &hot, t);
            let speed = self.speed(problem, &end)?;
            let stays = |i: &usize| sign(phase) * speed[*i] > 0.0;
            if hot.iter().all(stays) {
                end.step = state.step;
                return Some(end);
            }
            hot.retain(stays);
        }
        None
    }

    /// The state with walls bare where a phase is about to leave them; none where it does not.
    pub(super) fn uncovered(&self, problem: &dyn Problem, state: &FrontState) -> Option<FrontState> {
        if self.mirrored() != [true; 2] || state.alone.is_some() || self.undercooled.is_some() {
            return None;
        }
        let speed = self.speed(problem, state)?;
        let taken = state.bare.iter().copied().flatten().next();
        let phase = [LOWER, UPPER]
            .into_iter()
            .filter(|phase| taken.is_none_or(|taken| taken == *phase))
            .find(|&p| (0..speed.len()).any(|i| self.leaves(state, &speed, (p, i))))?;
        let mut end = state.fields();
        for i in (0..speed.len()).filter(|&i| self.leaves(state, &speed, (phase, i))) {
            end.bare[i] = Some(phase);
            end.h[i] = self.columns.film(phase, i);
            let nodes = self.columns.rows(phase) + 1;
            end.u[phase][i * nodes..(i + 1) * nodes].fill(self.material.melting);
        }
        let step = state.step;
        Some(FrontState { step, ..self.rebalanced(state, end, state.t) })
    }

    fn leaves(&self, state: &FrontState, speed: &[f64], (phase, i): (usize, usize)) -> bool {
        let thickness = (state.front[i] - self.columns.wall(phase)[i]).abs();
        state.bare[i].is_none() && sign(phase) * speed[i] < 0.0 && thickness <= LEAVES * self.columns.gap(i)
    }

    /// Refuses a phase whose own wall has passed the melting temperature: the other one would appear there.
    pub(super) fn check_walls(&self, state: &FrontState) -> Result<(), Failure> {
        if self.undercooled.is_some() {
            return Ok(());
        }
        let limit = OVERSHOOT * self.size(state);
        for phase in super::conduct::present(state.alone) {
            let (nodes, [_, wall]) = (self.columns.rows(phase) + 1, self.columns.ends(phase));
            for i in (0..state.front.len()).filter(|&i| state.bare[i] != Some(phase)) {
                let value = state.u[phase][i * nodes + wall];
                if sign(phase) * (value - self.material.melting) < -limit {
                    let (x, melting) = (self.columns.x()[i], self.material.melting);
                    let wall = ["bottom", "top"][phase];
                    return Err(Failure::WallPassesMelting { wall, x, value, melting });
                }
            }
        }
        Ok(())
    }
}
