//! Temperatures of both phases at the end of a step, for a front whose place there is known.

use super::columns::{LOWER, UPPER};
use super::front::tilt;
use super::heat::{HeatStep, carry};
use super::solver::{Front, Problem, Side, Transfer};
use crate::error::{Error, Failure, Result};
use crate::numerics::larger;

/// Iterations for the slope of the temperature at walls and sides whose flux depends on temperature, after which a step
/// is given up. Two to four are usual.
const MOST_SLOPES: usize = 40;
/// The iteration for the slope at walls and sides has converged once the slope times the height of a row changes by
/// less than this share of the largest temperature: rounding.
const SETTLED: f64 = 1e-12;
/// A place on the front is moved into its phase by this share of the thickness of the phase, so that a formula by place
/// knows which of the two phases is meant.
const INSIDE: f64 = 1e-7;

/// Heights of the front and temperatures of both phases, or a linear combination of several of these.
#[derive(Debug, Clone)]
pub(super) struct Fields {
    pub h: Vec<f64>,
    pub u: [Vec<f64>; 2],
    /// The phase that fills the box, if one does: the front then lies on the wall of the other one.
    pub alone: Option<usize>,
    /// At each column the phase, if there is one, whose wall the other one reaches.
    pub bare: Vec<Option<usize>>,
}

/// A phase, and what it reaches.
#[derive(Clone, Copy)]
pub(super) struct Reach<'a> {
    pub phase: usize,
    pub alone: Option<usize>,
    pub bare: &'a [Option<usize>],
}

impl Reach<'_> {
    /// The wall, by the phase that it belongs to, at the lower or the upper end of a column; none where the front is.
    fn wall(&self, end: usize, i: usize) -> Option<usize> {
        let wall = if end == 0 { LOWER } else { UPPER };
        (self.phase == wall || self.alone.is_some() || self.bare[i] == Some(wall)).then_some(wall)
    }

    /// Whether the phase is missing at a column.
    pub fn missing(&self, i: usize) -> bool {
        self.bare[i] == Some(self.phase)
    }
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
        let Self { alone, bare, .. } = parts[0].1;
        Self { h: add(parts.map(|(_, fields)| &fields.h[..])), u, alone: *alone, bare: bare.clone() }
    }

    /// A phase of these.
    pub fn reach(&self, phase: usize) -> Reach<'_> {
        Reach { phase, alone: self.alone, bare: &self.bare }
    }
}

impl Front {
    /// Temperatures at time `t` after a step of `dt` from `from`, when the front is at `h`, from a guess.
    pub(super) fn conduct(
        &mut self,
        problem: &dyn Problem,
        from: &Fields,
        (h, guess): (&[f64], &[Vec<f64>; 2]),
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
            out[phase] =
                self.conduct_in(problem, from.reach(phase), [new, &out[phase], &guess[phase]], ale, [t, dt])?;
        }
        Ok(out)
    }

    /// Temperatures of a phase at time `t` after a step of `dt`, from heights at the end, temperatures at the start and
    /// a guess.
    pub(super) fn conduct_in(
        &mut self,
        problem: &dyn Problem,
        reach: Reach<'_>,
        [y, u, guess]: [&[f64]; 3],
        velocity: Option<&[f64]>,
        [t, dt]: [f64; 2],
    ) -> Result<Vec<f64>> {
        let phase = reach.phase;
        let mut now = self.given(problem, reach, y, guess, t)?;
        let mut edges = self.edges(problem, reach, [y, &now], t)?;
        let mut miss = f64::INFINITY;
        for _ in 0..MOST_SLOPES {
            let mut solver = std::mem::take(&mut self.solvers[phase]);
            let solved = self.heat(reach, dt, [y, u, &now], velocity, &edges).solve(&mut solver, self.laplacian);
            self.solvers[phase] = solver;
            let (found, work) = solved?;
            self.spent += work;
            now = found;
            let next = self.edges(problem, reach, [y, &now], t)?;
            miss = self.edges_miss(phase, [&edges, &next], y, &now);
            if miss <= SETTLED {
                return Ok(now);
            }
            edges = next;
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
            let edges = self.edges(problem, at.reach(phase), [&y[phase], &at.u[phase]], t)?;
            let fields = [&y[phase][..], &at.u[phase], &at.u[phase]];
            gain[phase] =
                self.heat(at.reach(phase), dt, fields, Some(&velocity[phase]), &edges).gain(self.laplacian)?;
        }
        Ok(gain)
    }

    /// The step of the heat equation in a phase, for heights, temperatures at the start and given ones.
    pub(super) fn heat<'a>(
        &'a self,
        reach: Reach<'a>,
        dt: f64,
        [y, u, sides]: [&'a [f64]; 3],
        velocity: Option<&'a [f64]>,
        edges: &'a Edges,
    ) -> HeatStep<'a> {
        let columns = &self.columns;
        HeatStep {
            columns,
            reach,
            diffusivity: self.material.diffusivity(reach.phase),
            dt,
            y,
            velocity,
            u,
            sides,
            edges,
            held: self.held(),
        }
    }

    /// `u` with the temperatures that are given at time `t`: on the front, on walls without a flux and on sides.
    fn given(&self, problem: &dyn Problem, reach: Reach<'_>, y: &[f64], u: &[f64], t: f64) -> Result<Vec<f64>> {
        let phase = reach.phase;
        let nodes = self.columns.rows(phase) + 1;
        let flux = [LOWER, UPPER].map(|wall| self.has_flux(problem, wall, t));
        let mut given = u.to_vec();
        for (k, given) in given.iter_mut().enumerate() {
            let (i, j) = (k / nodes, k % nodes);
            let side = self.held_at(i);
            let end = if j == 0 { Some(0) } else { (j + 1 == nodes).then_some(1) };
            let wall = end.map(|end| reach.wall(end, i));
            let of = match wall {
                _ if reach.missing(i) => None,
                Some(Some(wall)) if side || !flux[wall] => Some(wall),
                Some(None) => None,
                _ if side => Some(phase),
                _ => continue,
            };
            let Some(of) = of else {
                *given = self.material.melting;
                continue;
            };
            let place = [self.columns.x()[i], y[k]];
            *given = if side { problem.side(of, place, t) } else { problem.boundary(of, place, t) };
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

    /// Slopes at the edges of a phase with these heights and temperatures, where fluxes are given.
    fn edges(&self, problem: &dyn Problem, reach: Reach<'_>, [y, u]: [&[f64]; 2], t: f64) -> Result<Edges> {
        let flux = [LOWER, UPPER].map(|wall| self.has_flux(problem, wall, t));
        let slopes = |end: usize| {
            let at = |i: usize| reach.wall(end, i).filter(|wall| flux[*wall] && !reach.missing(i));
            let walls: Vec<Option<usize>> = (0..self.columns.x().len()).map(at).collect();
            let Some(wall) = walls.iter().copied().flatten().next() else { return Ok(None) };
            let all = self.wall_slopes(problem, [reach.phase, wall], u, t)?;
            Ok::<_, Error>(Some(walls.iter().zip(all).map(|(wall, slope)| wall.map(|_| slope)).collect()))
        };
        let sides = [0, 1].map(|side| match self.sides[side] {
            Side::Flux => self.side_slopes(problem, (reach.phase, side), [y, u], t),
            Side::Insulated | Side::Given => Ok(None),
        });
        let [left, right] = sides;
        Ok(Edges { ends: [slopes(0)?, slopes(1)?], sides: [left?, right?] })
    }

    /// What flows into a phase through the left or the right side at its k-th node. Formulas that tell the phases apart
    /// take a node on the front to be within the phase.
    pub(super) fn side_flux(
        &self,
        problem: &dyn Problem,
        (phase, side): (usize, usize),
        [y, u]: [&[f64]; 2],
        (k, t): (usize, f64),
    ) -> Option<[f64; 2]> {
        let (nodes, [front, wall]) = (self.columns.rows(phase) + 1, self.columns.ends(phase));
        let first = k / nodes * nodes;
        let next = if front == 0 { 1 } else { front - 1 };
        let [to_wall, to_next] = [y[first + wall] - y[k], u[first + next] - u[k]];
        let inside = if k - first == front { INSIDE } else { 0.0 };
        let place = [self.columns.x()[k / nodes], y[k] + inside * to_wall];
        problem.side_flux(side, place, u[k] + inside * to_next, t)
    }

    /// a and b of the outward slope ∂u/∂n = a + b u at each row of the left or the right side; none where nothing
    /// flows.
    fn side_slopes(
        &self,
        problem: &dyn Problem,
        (phase, side): (usize, usize),
        [y, u]: [&[f64]; 2],
        t: f64,
    ) -> Result<Option<Vec<[f64; 2]>>> {
        let nodes = self.columns.rows(phase) + 1;
        let i = if side == 0 { 0 } else { self.columns.x().len() - 1 };
        let slope = |j: usize| {
            let k = i * nodes + j;
            let Some([flux, by_u]) = self.side_flux(problem, (phase, side), [y, u], (k, t)) else { return Ok(None) };
            if !flux.is_finite() {
                return Err(self.columns.not_finite("the flux through a side", flux, phase, k, y[k]));
            }
            let conductivity = self.material.conductivity[phase];
            Ok(Some([(flux - by_u * u[k]) / conductivity, by_u / conductivity]))
        };
        let slopes: Vec<Option<[f64; 2]>> = (0..nodes).map(slope).collect::<Result<_, Failure>>()?;
        Ok(slopes.into_iter().collect())
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

    /// The largest change between slopes at edges over the row or column next to them, as a share of the temperatures.
    fn edges_miss(&self, phase: usize, [before, after]: [&Edges; 2], y: &[f64], u: &[f64]) -> f64 {
        let (nodes, last) = (self.columns.rows(phase) + 1, self.columns.x().len() - 1);
        let mut miss = 0.0;
        for (end, [at, next]) in [[0, 1], [nodes - 1, nodes - 2]].into_iter().enumerate() {
            let (Some(before), Some(after)) = (&before.ends[end], &after.ends[end]) else { continue };
            for (i, pair) in before.iter().zip(after).enumerate() {
                let (Some([a, b]), Some([c, d])) = pair else { continue };
                let k = i * nodes;
                miss = larger(miss, (c - a + (d - b) * u[k + at]) * (y[k + at] - y[k + next]));
            }
        }
        for (side, i) in [0, last].into_iter().enumerate() {
            let (Some(before), Some(after)) = (&before.sides[side], &after.sides[side]) else { continue };
            for (j, ([a, b], [c, d])) in before.iter().zip(after).enumerate() {
                miss = larger(miss, (c - a + (d - b) * u[i * nodes + j]) * self.columns.spacing());
            }
        }
        miss / u.iter().copied().fold(f64::MIN_POSITIVE, larger)
    }
}

/// Slopes at the edges of a phase where no temperature is given.
#[derive(Debug, Clone, Default)]
pub(super) struct Edges {
    /// At the lowest and the highest row.
    pub ends: [Slopes; 2],
    /// a and b of the outward slope ∂u/∂n = a + b u at each row of the left and the right side; none where it is 0.
    pub sides: [Option<Vec<[f64; 2]>>; 2],
}

/// a and b of the slope ∂u/∂y = a + b u at each column, where no temperature is given.
pub(super) type Slopes = Option<Vec<Option<[f64; 2]>>>;

/// Velocities of nodes that have moved from `old` to `new` heights.
pub(super) fn velocity(old: &[f64], new: &[f64], dt: f64) -> Vec<f64> {
    old.iter().zip(new).map(|(a, b)| (b - a) / dt).collect()
}
