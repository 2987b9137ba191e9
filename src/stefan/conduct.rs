//! Temperatures of both phases at the end of a step, for a front whose place there is known.

use super::columns::{LOWER, UPPER};
use super::front::tilt;
use super::heat::{HeatStep, carry};
use super::solver::{Front, Problem, Transfer};
use crate::error::{Failure, Result};
use crate::numerics::larger;

/// How often the slope at a wall whose flux depends on temperature is sought before a step is given up. Two to four
/// times are usual.
const MOST_SLOPES: usize = 40;
/// What such slopes may change over a row once they are found, as a share of the largest temperature.
const SETTLED: f64 = 1e-12;

/// Heights of the front and temperatures of both phases, or a linear combination of several of these.
#[derive(Debug, Clone)]
pub(super) struct Fields {
    pub h: Vec<f64>,
    pub u: [Vec<f64>; 2],
    /// The phase that fills the box, if one does: the front then lies on the wall of the other one.
    pub alone: Option<usize>,
}

/// The phases that there are.
pub(super) fn present(alone: Option<usize>) -> impl Iterator<Item = usize> {
    [LOWER, UPPER].into_iter().filter(move |&phase| alone.is_none_or(|alone| alone == phase))
}

impl Fields {
    /// Σ weight × fields.
    pub fn sum<const N: usize>(parts: [(f64, &Self); N]) -> Self {
        let add = |values: [&[f64]; N]| -> Vec<f64> {
            let at = |k: usize| (0..N).map(|n| parts[n].0 * values[n][k]).sum();
            (0..values[0].len()).map(at).collect()
        };
        let u = [LOWER, UPPER].map(|phase| add(parts.map(|(_, fields)| &fields.u[phase][..])));
        Self { h: add(parts.map(|(_, fields)| &fields.h[..])), u, alone: parts[0].1.alone }
    }
}

impl Front {
    /// Temperatures at time `t` after a step of `dt` from `from`, when the front is at `h`.
    pub(super) fn conduct(
        &mut self,
        problem: &dyn Problem,
        from: &Fields,
        h: &[f64],
        [t, dt]: [f64; 2],
    ) -> Result<[Vec<f64>; 2]> {
        let (old, new) = (self.heights(&from.h), self.heights(h));
        let mut out = from.u.clone();
        for phase in present(from.alone) {
            let (old, new) = (&old[phase], &new[phase]);
            let velocity = velocity(old, new, dt);
            if self.transfer == Transfer::Interpolate {
                let (nodes, [front, _]) = (self.columns.rows(phase) + 1, self.columns.ends(phase));
                let columns = out[phase].chunks_exact_mut(nodes).zip(from.u[phase].chunks_exact(nodes));
                for ((to, u), (y, new)) in columns.zip(old.chunks_exact(nodes).zip(new.chunks_exact(nodes))) {
                    carry(y, u, front, new, to);
                }
            }
            let ale = (self.transfer == Transfer::Ale).then_some(&velocity[..]);
            out[phase] = self.conduct_in(problem, (phase, from.alone), [new, &out[phase]], ale, [t, dt])?;
        }
        Ok(out)
    }

    /// Temperatures of a phase at time `t` after a step of `dt`, from those at the start and the heights at the end.
    pub(super) fn conduct_in(
        &mut self,
        problem: &dyn Problem,
        (phase, alone): (usize, Option<usize>),
        [y, u]: [&[f64]; 2],
        velocity: Option<&[f64]>,
        [t, dt]: [f64; 2],
    ) -> Result<Vec<f64>> {
        let mut now = self.given(problem, (phase, alone), y, u, t)?;
        let mut slopes = self.end_slopes(problem, (phase, alone), &now, t)?;
        let mut miss = f64::INFINITY;
        for _ in 0..MOST_SLOPES {
            let mut solver = std::mem::take(&mut self.solvers[phase]);
            let solved = self.heat(phase, dt, [y, u, &now], velocity, &slopes).solve(&mut solver, self.laplacian);
            self.solvers[phase] = solver;
            now = solved?;
            let next = self.end_slopes(problem, (phase, alone), &now, t)?;
            miss = self.slopes_miss(phase, [&slopes, &next], y, &now);
            if miss <= SETTLED {
                return Ok(now);
            }
            slopes = next;
        }
        Err(Failure::NewtonStalled { residual: miss, tolerance: SETTLED, iterations: MOST_SLOPES }.into())
    }

    /// What temperatures gain in a time `dt` at the rate of the state `at`, whose nodes move with `velocity`.
    pub(super) fn gain(
        &self,
        problem: &dyn Problem,
        at: &Fields,
        velocity: &[Vec<f64>; 2],
        [t, dt]: [f64; 2],
    ) -> Result<[Vec<f64>; 2]> {
        let y = self.heights(&at.h);
        let mut gain = at.u.each_ref().map(|u| vec![0.0; u.len()]);
        for phase in present(at.alone) {
            let slopes = self.end_slopes(problem, (phase, at.alone), &at.u[phase], t)?;
            let fields = [&y[phase][..], &at.u[phase], &at.u[phase]];
            gain[phase] = self.heat(phase, dt, fields, Some(&velocity[phase]), &slopes).gain(self.laplacian)?;
        }
        Ok(gain)
    }

    /// The step of the heat equation in a phase, for heights, temperatures at the start and given ones.
    pub(super) fn heat<'a>(
        &'a self,
        phase: usize,
        dt: f64,
        [y, u, sides]: [&'a [f64]; 3],
        velocity: Option<&'a [f64]>,
        slopes: &'a [Slopes; 2],
    ) -> HeatStep<'a> {
        let (columns, mirrored) = (&self.columns, self.mirrored());
        let ends = slopes.each_ref().map(|slopes| slopes.as_deref());
        HeatStep {
            columns,
            phase,
            diffusivity: self.material.diffusivity(phase),
            dt,
            y,
            velocity,
            u,
            sides,
            ends,
            mirrored,
        }
    }

    /// `u` with the temperatures that are given at time `t`: on the front, on walls without a flux and on sides.
    fn given(
        &self,
        problem: &dyn Problem,
        (phase, alone): (usize, Option<usize>),
        y: &[f64],
        u: &[f64],
        t: f64,
    ) -> Result<Vec<f64>> {
        let (nodes, last) = (self.columns.rows(phase) + 1, self.columns.x().len() - 1);
        let ends = [0, 1].map(|end| wall_at(phase, alone, end));
        let flux = ends.map(|wall| wall.is_some_and(|wall| self.has_flux(problem, wall, t)));
        let mut given = u.to_vec();
        for (k, given) in given.iter_mut().enumerate() {
            let (i, j) = (k / nodes, k % nodes);
            let side = !self.mirrored() && (i == 0 || i == last);
            let end = if j == 0 { Some(0) } else { (j + 1 == nodes).then_some(1) };
            let of = match end {
                Some(end) if ends[end].is_none() => {
                    *given = self.material.melting;
                    continue;
                }
                Some(end) if side || !flux[end] => ends[end].unwrap_or(phase),
                _ if side => phase,
                _ => continue,
            };
            *given = problem.boundary(of, [self.columns.x()[i], y[k]], t);
            if !given.is_finite() {
                return Err(self.columns.not_finite("the boundary temperature", *given, phase, k, y[k]).into());
            }
        }
        Ok(given)
    }

    /// Whether a flux is given on the wall of a phase.
    pub(super) fn has_flux(&self, problem: &dyn Problem, phase: usize, t: f64) -> bool {
        let place = [self.columns.x()[0], self.columns.wall(phase)[0]];
        problem.flux(phase, place, self.material.melting, t).is_some()
    }

    /// Slopes at the lowest and the highest row of a phase, where these lie on walls with a given flux.
    fn end_slopes(
        &self,
        problem: &dyn Problem,
        (phase, alone): (usize, Option<usize>),
        u: &[f64],
        t: f64,
    ) -> Result<[Slopes; 2]> {
        let slopes = |end: usize| match wall_at(phase, alone, end) {
            Some(wall) if self.has_flux(problem, wall, t) => self.wall_slopes(problem, [phase, wall], u, t).map(Some),
            _ => Ok(None),
        };
        Ok([slopes(0)?, slopes(1)?])
    }

    /// a and b of the slope ∂u/∂y = a + b u at each column of a wall with a given flux q
    ///
    /// ```text
    /// ∂u/∂y = (w' du/dx ± q √(1 + w'²) / k) / (1 + w'²)
    /// ```
    ///
    /// w' is the slope of the wall, du/dx the derivative along it; + is for the top, − for the bottom. q is linearised
    /// at the temperatures u of the phase that reaches the wall.
    fn wall_slopes(
        &self,
        problem: &dyn Problem,
        [phase, wall]: [usize; 2],
        u: &[f64],
        t: f64,
    ) -> Result<Vec<[f64; 2]>> {
        let nodes = self.columns.rows(phase) + 1;
        let at = if wall == LOWER { 0 } else { nodes - 1 };
        let (x, y) = (self.columns.x(), self.columns.wall(wall));
        let on_wall: Vec<f64> = u.iter().skip(at).step_by(nodes).copied().collect();
        let [rise, along] = [y, &on_wall].map(|values| tilt(&self.columns, values, self.mirrored()));
        let outward = if wall == UPPER { 1.0 } else { -1.0 };
        let slope = |i: usize| {
            let [flux, by_u] = problem.flux(wall, [x[i], y[i]], on_wall[i], t).unwrap_or_default();
            if !flux.is_finite() {
                return Err(self.columns.not_finite("the flux through a wall", flux, phase, i * nodes + at, y[i]));
            }
            let stretch = 1.0 + rise[i] * rise[i];
            let factor = outward * stretch.sqrt() / self.material.conductivity[phase];
            let constant = rise[i] * along[i] + factor * (flux - by_u * on_wall[i]);
            Ok([constant / stretch, factor * by_u / stretch])
        };
        Ok((0..x.len()).map(slope).collect::<Result<_, _>>()?)
    }

    /// The largest change between slopes at walls over the row next to them, as a share of the temperatures.
    fn slopes_miss(&self, phase: usize, [before, after]: [&[Slopes; 2]; 2], y: &[f64], u: &[f64]) -> f64 {
        let nodes = self.columns.rows(phase) + 1;
        let mut miss = 0.0;
        for (end, [at, next]) in [[0, 1], [nodes - 1, nodes - 2]].into_iter().enumerate() {
            let (Some(before), Some(after)) = (&before[end], &after[end]) else { continue };
            for (i, ([a, b], [c, d])) in before.iter().zip(after).enumerate() {
                let k = i * nodes;
                miss = larger(miss, (c - a + (d - b) * u[k + at]) * (y[k + at] - y[k + next]));
            }
        }
        miss / u.iter().copied().fold(f64::MIN_POSITIVE, larger)
    }
}

/// a and b of the slope ∂u/∂y = a + b u at each column, where no temperature is given.
pub(super) type Slopes = Option<Vec<[f64; 2]>>;

/// The wall, by the phase that it belongs to, at the lower or the upper end of a phase; none where the front is.
fn wall_at(phase: usize, alone: Option<usize>, end: usize) -> Option<usize> {
    let wall = if end == 0 { LOWER } else { UPPER };
    (phase == wall || alone.is_some()).then_some(wall)
}

/// Velocities of nodes that have moved from `old` to `new` heights.
pub(super) fn velocity(old: &[f64], new: &[f64], dt: f64) -> Vec<f64> {
    old.iter().zip(new).map(|(a, b)| (b - a) / dt).collect()
}
