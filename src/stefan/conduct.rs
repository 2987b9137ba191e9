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
}

impl Fields {
    /// Σ weight × fields.
    pub fn sum<const N: usize>(parts: [(f64, &Self); N]) -> Self {
        let add = |values: [&[f64]; N]| -> Vec<f64> {
            let at = |k: usize| (0..N).map(|n| parts[n].0 * values[n][k]).sum();
            (0..values[0].len()).map(at).collect()
        };
        let u = [LOWER, UPPER].map(|phase| add(parts.map(|(_, fields)| &fields.u[phase][..])));
        Self { h: add(parts.map(|(_, fields)| &fields.h[..])), u }
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
        let mut out = [Vec::new(), Vec::new()];
        for phase in [LOWER, UPPER] {
            let (old, new) = (&old[phase], &new[phase]);
            let velocity = velocity(old, new, dt);
            let mut u = from.u[phase].clone();
            if self.transfer == Transfer::Interpolate {
                let (nodes, [front, _]) = (self.columns.rows(phase) + 1, self.columns.ends(phase));
                let columns = u.chunks_exact_mut(nodes).zip(from.u[phase].chunks_exact(nodes));
                for ((to, u), (y, new)) in columns.zip(old.chunks_exact(nodes).zip(new.chunks_exact(nodes))) {
                    carry(y, u, front, new, to);
                }
            }
            let mut sides = self.given(problem, phase, new, &u, t)?;
            out[phase] = 'solved: {
                let mut slopes = self.wall_slopes(problem, phase, &sides, t)?;
                for _ in 0..MOST_SLOPES {
                    let mut solver = std::mem::take(&mut self.solvers[phase]);
                    let ale = (self.transfer == Transfer::Ale).then_some(&velocity[..]);
                    let step = self.heat(phase, dt, [new, &u, &sides], ale, slopes.as_deref());
                    let solved = step.solve(&mut solver, self.laplacian);
                    self.solvers[phase] = solver;
                    sides = solved?;
                    let Some(known) = slopes else { break 'solved sides };
                    let next = self.wall_slopes(problem, phase, &sides, t)?.unwrap_or_default();
                    if self.slopes_miss(phase, [&known, &next], new, &sides) <= SETTLED {
                        break 'solved sides;
                    }
                    slopes = Some(next);
                }
                let tolerance = SETTLED;
                return Err(Failure::NewtonStalled { residual: f64::NAN, tolerance, iterations: MOST_SLOPES }.into());
            };
        }
        Ok(out)
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
        let gain = |phase: usize| {
            let slopes = self.wall_slopes(problem, phase, &at.u[phase], t)?;
            let fields = [&y[phase][..], &at.u[phase], &at.u[phase]];
            self.heat(phase, dt, fields, Some(&velocity[phase]), slopes.as_deref()).gain(self.laplacian)
        };
        Ok([gain(LOWER)?, gain(UPPER)?])
    }

    /// The step of the heat equation in a phase, for heights, temperatures at the start and given ones.
    pub(super) fn heat<'a>(
        &'a self,
        phase: usize,
        dt: f64,
        [y, u, sides]: [&'a [f64]; 3],
        velocity: Option<&'a [f64]>,
        wall: Option<&'a [[f64; 2]]>,
    ) -> HeatStep<'a> {
        let (columns, mirrored) = (&self.columns, self.mirrored());
        HeatStep {
            columns,
            phase,
            diffusivity: self.material.diffusivity(phase),
            dt,
            y,
            velocity,
            u,
            sides,
            wall,
            mirrored,
        }
    }

    /// `u` with the temperatures that are given at time `t`: on the front, on walls without a flux and on sides.
    fn given(&self, problem: &dyn Problem, phase: usize, y: &[f64], u: &[f64], t: f64) -> Result<Vec<f64>> {
        let (nodes, last) = (self.columns.rows(phase) + 1, self.columns.x().len() - 1);
        let [front, wall] = self.columns.ends(phase);
        let flux = self.has_flux(problem, phase, t);
        let mut given = u.to_vec();
        for (k, given) in given.iter_mut().enumerate() {
            let (i, j) = (k / nodes, k % nodes);
            let side = !self.mirrored() && (i == 0 || i == last);
            if j == front {
                *given = self.material.melting;
            } else if side || j == wall && !flux {
                *given = problem.boundary(phase, [self.columns.x()[i], y[k]], t);
                if !given.is_finite() {
                    return Err(self.columns.not_finite("the boundary temperature", *given, phase, k, y[k]).into());
                }
            }
        }
        Ok(given)
    }

    /// Whether a flux is given on the wall of a phase.
    pub(super) fn has_flux(&self, problem: &dyn Problem, phase: usize, t: f64) -> bool {
        let place = [self.columns.x()[0], self.columns.wall(phase)[0]];
        problem.flux(phase, place, self.material.melting, t).is_some()
    }

    /// a and b of the slope ∂u/∂y = a + b u at each column of a wall with a given flux q
    ///
    /// ```text
    /// ∂u/∂y = (w' du/dx ± q √(1 + w'²) / k) / (1 + w'²)
    /// ```
    ///
    /// w' is the slope of the wall, du/dx the derivative along it; + is for the top, − for the bottom. q is linearised
    /// at the temperatures u. None where temperatures are given.
    fn wall_slopes(&self, problem: &dyn Problem, phase: usize, u: &[f64], t: f64) -> Result<Option<Vec<[f64; 2]>>> {
        if !self.has_flux(problem, phase, t) {
            return Ok(None);
        }
        let (nodes, [_, wall]) = (self.columns.rows(phase) + 1, self.columns.ends(phase));
        let (x, y) = (self.columns.x(), self.columns.wall(phase));
        let on_wall: Vec<f64> = u.iter().skip(wall).step_by(nodes).copied().collect();
        let [rise, along] = [y, &on_wall].map(|values| tilt(&self.columns, values, self.mirrored()));
        let outward = if phase == UPPER { 1.0 } else { -1.0 };
        let slope = |i: usize| {
            let [flux, by_u] = problem.flux(phase, [x[i], y[i]], on_wall[i], t).unwrap_or_default();
            if !flux.is_finite() {
                return Err(self.columns.not_finite("the flux through a wall", flux, phase, i * nodes + wall, y[i]));
            }
            let stretch = 1.0 + rise[i] * rise[i];
            let factor = outward * stretch.sqrt() / self.material.conductivity[phase];
            let constant = rise[i] * along[i] + factor * (flux - by_u * on_wall[i]);
            Ok([constant / stretch, factor * by_u / stretch])
        };
        Ok(Some((0..x.len()).map(slope).collect::<Result<_, _>>()?))
    }

    /// The largest change between two slopes at a wall over the row next to it, as a share of the temperatures.
    fn slopes_miss(&self, phase: usize, [before, after]: [&[[f64; 2]]; 2], y: &[f64], u: &[f64]) -> f64 {
        let (nodes, [_, wall]) = (self.columns.rows(phase) + 1, self.columns.ends(phase));
        let next = if phase == LOWER { 1 } else { wall - 1 };
        let change = |(i, ([a, b], [c, d])): (usize, (&[f64; 2], &[f64; 2]))| {
            let k = i * nodes;
            (c - a + (d - b) * u[k + wall]) * (y[k + wall] - y[k + next])
        };
        let size = u.iter().copied().fold(f64::MIN_POSITIVE, larger);
        before.iter().zip(after).enumerate().map(change).fold(0.0, larger) / size
    }
}

/// Velocities of nodes that have moved from `old` to `new` heights.
pub(super) fn velocity(old: &[f64], new: &[f64], dt: f64) -> Vec<f64> {
    old.iter().zip(new).map(|(a, b)| (b - a) / dt).collect()
}
