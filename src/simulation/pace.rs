use super::coupling::Advanced;
use super::{Simulation, State};
use crate::error::{Error, Failure, Moment, Result};
use crate::geometry::{DualCells, Field, Lattice, padded};
use crate::numerics::larger;
use crate::physics::Motion;
use serde::{Deserialize, Serialize};

/// Steps as long as the solution and the mesh allow: at no moving node does the first unknown change by much more than
/// three hundredths of the largest range that it had
///
/// Where the mesh goes along with a front, little changes at its nodes, and a step may carry the front over many times its
/// width. The next step is chosen from the change in the last one; a step in which much more changes, or that fails, is
/// refused and tried again with a shorter one. A trial on the resting mesh chooses the first.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Pace {
    dt: f64,
    longest: f64,
    scale: f64,
    /// The largest range of the first unknown so far.
    range: f64,
}

/// Change in a step, as a share of the range.
const CHANGE: f64 = 0.03;
/// A step with so many times that change is refused.
const TOO_MUCH: f64 = 2.0;
/// A step is at most so much longer and shorter than the one before.
const GROWTH: [f64; 2] = [0.5, 1.2];
/// A share of the longest step below which the run would take millions of steps.
const SHORTEST: f64 = 1e-5;
/// Steps in a run in which nothing changes.
const FEWEST: f64 = 20.0;
/// The first trial, as a share of the longest step, and how many there may be, each a hundredth of the one before.
const TRIAL: f64 = 1e-2;
const TRIALS: usize = 3;

impl Pace {
    /// The first step from a state.
    pub fn new(simulation: &mut Simulation, state: &State) -> Result<Self> {
        let longest = (simulation.schedule.end() - simulation.schedule.start()) / FEWEST;
        let range = range(&state.u);
        let mut trial = TRIAL * longest;
        let mut number = 1;
        loop {
            let motion = Motion { t: state.t, dt: trial, old: &state.mesh, new: &state.mesh };
            match simulation.physics.step(motion, &state.u) {
                Ok((u, _)) => {
                    let share = share(change_at_nodes(state.mesh.lattice(), &state.u, &u), range);
                    // a trial in which too much happens says little
                    if share <= CHANGE || number == TRIALS {
                        let dt = (trial * CHANGE / share).min(longest);
                        return Ok(Self { dt, longest, scale: dt, range });
                    }
                }
                Err(failure) if number == TRIALS => {
                    return Err(Error::Failed { failure, moment: Some(Moment { t: state.t + trial, step: 1 }) });
                }
                Err(_) => {}
            }
            trial *= 0.01;
            number += 1;
        }
    }

    /// True where steps can be so.
    pub fn is_sound(&self) -> bool {
        [self.dt, self.longest, self.scale].iter().all(|dt| dt.is_finite() && *dt > 0.0)
            && self.range.is_finite()
            && self.range >= 0.0
    }

    /// Length of the next step, if nothing ends before.
    pub fn step(&self) -> f64 {
        self.dt
    }

    /// The step that τ is measured in: the next one, or the time in which the solution changes as much at a fixed place.
    /// A mesh that sweeps its nodes through a front shortens the steps; were τ shortened with them, it would sweep faster.
    pub fn scale(&self) -> f64 {
        self.scale
    }

    /// Learns from a step; none is returned where it is refused.
    ///
    /// # Errors
    /// What a step failed with, or [`Failure::VanishingStep`], where the next would be too short.
    pub(super) fn judge(
        &mut self,
        before: &State,
        step: Result<Advanced, Failure>,
    ) -> Result<Option<Advanced>, Failure> {
        let step = match step {
            Ok(step) => step,
            Err(failure) => {
                self.dt *= GROWTH[0];
                return if self.dt < SHORTEST * self.longest { Err(failure) } else { Ok(None) };
            }
        };
        let after = &step.state;
        self.range = self.range.max(range(&after.u));
        let dt = after.t - before.t;
        let share = share(change_at_nodes(after.mesh.lattice(), &before.u, &after.u), self.range);
        // a step that was cut short to meet a report says what a whole one would have done
        let whole = share * self.dt / dt;
        let factor = if whole.is_finite() { (CHANGE / whole).clamp(GROWTH[0], GROWTH[1]) } else { GROWTH[0] };
        self.dt = (self.dt * factor).min(self.longest);
        if self.dt < SHORTEST * self.longest {
            return Err(Failure::VanishingStep { dt: self.dt });
        }
        if share > TOO_MUCH * CHANGE {
            return Ok(None);
        }
        let mut scale = self.dt;
        if scale < self.scale {
            let in_place = dt * CHANGE / self::share(change_in_place(before, after), self.range);
            scale = scale.max(in_place.min(self.scale));
        }
        self.scale = scale;
        Ok(Some(step))
    }
}

/// The largest change of the first unknown at a node inside. On sides, where values are
/// given, nothing has to be solved for.
fn change_at_nodes(lattice: &Lattice<2>, before: &Field, after: &Field) -> f64 {
    let changes = before.component(0).zip(after.component(0)).map(|(before, after)| after - before);
    let inside = changes.enumerate().filter(|(k, _)| lattice.beyond(*k) == [[false; 2]; 2]);
    inside.fold(0.0, |m, (_, change)| larger(m, change))
}

/// The largest change of the first unknown at a fixed place, past which the nodes move.
fn change_in_place(before: &State, after: &State) -> f64 {
    let (from, to) = (DualCells::new(&before.mesh), DualCells::new(&after.mesh));
    let swept = from.swept(&to);
    let strides = to.patch().padded_strides();
    let [old, new] = [&before.u, &after.u].map(|u| {
        let first: Vec<[f64; 1]> = u.component(0).map(|u| [u]).collect();
        padded(after.mesh.lattice(), &first, [[0.0]; 2])
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

/// The range of the first unknown; 0 where it is of rounding.
fn range(u: &Field) -> f64 {
    let extremes = (f64::INFINITY, f64::NEG_INFINITY);
    let (low, high) = u.component(0).fold(extremes, |(low, high), u| (low.min(u), high.max(u)));
    if high - low > 1e-12 * low.abs().max(high.abs()) { high - low } else { 0.0 }
}

/// A change as a share of a range; 0 for constants.
fn share(change: f64, range: f64) -> f64 {
    if range > 0.0 { change / range } else { 0.0 }
}
