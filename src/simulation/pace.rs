mod change;

pub(crate) use change::{ALIKE, rushed};

use super::control::Control;
use super::coupling::{Advanced, Stretch, attempt};
use super::journey::{change_in_place, range};
use super::safety::{Safety, divided};
use super::schedule::{Schedule, Steps};
use super::{Record, Simulation, State};
use crate::error::{Cause, Error, Failure, Moment, Result};
use crate::geometry::{Field, Mesh};
use crate::meshing::Movable;
use crate::numerics::larger;
use crate::physics::Motion;
use change::{at_rest, change_at_nodes, largest, relative, scale, share};
use serde::{Deserialize, Serialize};

/// How long time steps are, and what is remembered for the next.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) enum Pace {
    /// As the schedule says; the last step was done in 2^`halvings` parts.
    Even {
        /// 0 where nothing failed.
        halvings: usize,
    },
    /// As long as the solution and the mesh allow.
    Free(Free),
}

impl Pace {
    /// Before the first step from a state.
    pub fn new<const D: usize>(simulation: &mut Simulation<D>, state: &State<D>) -> Result<Self>
    where
        Mesh<D>: Movable<D>,
    {
        match simulation.schedule.decided_by() {
            Steps::Even => Ok(Self::Even { halvings: 0 }),
            Steps::ByChange => Ok(Self::Free(Free::new(simulation, state, None, None)?)),
            Steps::ByError { tolerance, longest } => {
                Ok(Self::Free(Free::new(simulation, state, Some(Control::to(tolerance)), longest)?))
            }
        }
    }

    /// True where a run of this schedule and safety can be so.
    pub fn is_sound(&self, schedule: &Schedule, safety: Safety) -> bool {
        match (self, schedule.decided_by()) {
            (Self::Even { halvings }, Steps::Even) => *halvings <= safety.halvings,
            (Self::Free(free), Steps::ByChange) => free.control.is_none() && free.is_sound(),
            (Self::Free(free), Steps::ByError { tolerance, .. }) => {
                free.control.as_ref().is_some_and(|control| control.is_sound(tolerance)) && free.is_sound()
            }
            _ => false,
        }
    }

    /// The time after the next step, and its length; none at the end.
    pub fn next<const D: usize>(&self, schedule: &Schedule, state: &State<D>) -> Option<(f64, f64)> {
        match self {
            Self::Even { .. } => Some((schedule.time(state.step + 1), schedule.step_from(state.step)?)),
            Self::Free(free) => schedule.after(state.t, free.dt).map(|t| (t, t - state.t)),
        }
    }

    /// Sets the sizes that prescribed formulas will give to the unknowns: while values are far below them, their
    /// changes do not shorten steps.
    pub fn foresee(&mut self, sizes: impl Iterator<Item = f64>) {
        if let Self::Free(free) = self {
            free.foreseen.iter_mut().zip(sizes).for_each(|(foreseen, size)| *foreseen = size);
        }
    }

    /// Makes the next step shorter than one that took `dt`; false where it may not be.
    pub fn shorten(&mut self, dt: f64) -> bool {
        match self {
            Self::Even { .. } => false,
            Self::Free(free) => {
                let shorter = GROWTH[0] * dt;
                let may = shorter > SHORTEST * free.longest;
                if may {
                    free.dt = shorter;
                }
                may
            }
        }
    }

    /// Tries the next step; none is returned where it is refused.
    ///
    /// # Errors
    /// The failure of the step, after all that may be tried was tried.
    pub(super) fn step<const D: usize>(
        &mut self,
        simulation: &mut Simulation<D>,
        state: &State<D>,
        (t, dt): (f64, f64),
        record: &mut Record,
    ) -> Result<Option<Advanced<D>>, Failure>
    where
        Mesh<D>: Movable<D>,
    {
        match self {
            Self::Even { halvings } => {
                let stretch = Stretch { t, dt, scale: dt, estimated: false };
                let (next, took) = divided(simulation, state, stretch, [halvings.saturating_sub(1), 0], record)?;
                *halvings = took;
                Ok(Some(next))
            }
            Self::Free(free) => {
                let stretch = Stretch { t, dt, scale: free.scale, estimated: free.control.is_some() };
                let next = attempt(simulation, state, stretch, record);
                free.judge(simulation, state, next, record)
            }
        }
    }
}

/// Steps as long as the solution and the mesh allow: at no moving node does the first unknown change by much more than
/// three hundredths of the largest range that it had, or the error of a step stays below a tolerance
///
/// Where the mesh goes along with a front, little changes at its nodes, and a step may carry the front over many times
/// its width. The next step is chosen from the last one; a step in which much more changes, or that fails, is refused
/// and tried again with a shorter one. A trial on the resting mesh chooses the first.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Free {
    dt: f64,
    longest: f64,
    scale: f64,
    /// The largest range of each unknown so far.
    ranges: Vec<f64>,
    /// The largest size of each unknown so far.
    sizes: Vec<f64>,
    /// The size that prescribed formulas will give to each unknown in the run.
    foreseen: Vec<f64>,
    /// The controller of the error, where errors decide how long steps are, not changes.
    control: Option<Control>,
    /// Number of steps that failed since the last one that did not.
    failures: usize,
    /// Number of very short steps in a row.
    short: usize,
}

/// Change of the first unknown at a moving node in a step, as a share of its range, at which steps aim where no
/// tolerance is given.
const CHANGE: f64 = 0.03;
/// A step is refused whose change is more than this multiple of the one at which steps aim.
const TOO_MUCH: f64 = 2.0;
/// Factors by which a step is at most shorter and longer than the one before it.
const GROWTH: [f64; 2] = [0.5, 1.2];
/// A step shorter than this share of the longest counts as very short: a run of such steps would take millions.
const SHORT: f64 = 1e-5;
/// After more than this number of very short steps in a row a run ends with vanishing-step. Jumps at the start, or from
/// one moment to the next, take some.
const MOST_SHORT: usize = 1000;
/// A step shorter than this share of the longest is lost in rounding, and ends the run.
const SHORTEST: f64 = 1e-12;
/// Factor by which the first step is shortened where it fails: it is a guess, and may be far too long.
const FIRST_AGAIN: f64 = 0.1;
/// Shortest step, as a share of the longest, where the solution is prescribed: a prescribed solution has no error that
/// shorter steps could lower.
const GIVEN: f64 = 0.02;
/// Smallest number of steps of a run: no step is longer than the whole run divided by this, even if nothing changes.
const FEWEST: f64 = 20.0;
/// Ratio of two measures of a change below which the change is doubted. The time of which τ is a multiple may fall to
/// this share from one step to the next; where the change at fixed places asks for less, that change is measured again
/// on a mesh at rest. Short steps are blamed on the moving mesh if the solution changes on a mesh at rest by less than
/// this share of its change on the moving one.
const DOUBTED: f64 = 0.5;
/// Steps are short because of a blow-up if the range of the first unknown, or its size where it is the same everywhere,
/// grows by more than this share of its largest change at a node.
const GROWS: f64 = 0.5;
/// Steps are short because of the start up to this share of the run.
const AT_START: f64 = 1e-3;
/// Length of the first trial step on the resting mesh, as a share of the longest step; each further trial is a
/// hundredth of the one before.
const TRIAL: f64 = 1e-2;
/// Largest number of trial steps because of their change; there may be more where trials fail.
const TRIALS: usize = 3;
/// An unknown whose range is below this share of the largest of all ranges is made of rounding, and its error does not
/// count.
const OF_ROUNDING: f64 = 1e-9;
/// A solution has begun to change once it exceeds this share of the size that prescribed formulas will give to it:
/// below that, changes are measured by this share.
const BEGUN: f64 = 1e-4;
impl Free {
    fn new<const D: usize>(
        simulation: &mut Simulation<D>,
        state: &State<D>,
        control: Option<Control>,
        first: Option<f64>,
    ) -> Result<Self>
    where
        Mesh<D>: Movable<D>,
    {
        let ranges: Vec<f64> = (0..state.u.components()).map(|c| range(&state.u, c)).collect();
        let free = |dt: f64, longest: f64| Self {
            dt,
            longest,
            scale: dt,
            ranges: ranges.clone(),
            sizes: vec![0.0; ranges.len()],
            foreseen: vec![0.0; ranges.len()],
            control,
            failures: 0,
            short: 0,
        };
        if let Some(first) = first {
            return Ok(free(first, first));
        }
        let longest = simulation.schedule.span() / FEWEST;
        let mut trial = TRIAL * longest;
        let mut number = 1;
        loop {
            let motion = Motion { t: state.t, dt: trial, old: &state.mesh, new: &state.mesh };
            match simulation.physics.step(motion, &state.u) {
                Ok((u, _)) => {
                    let share = share(change_at_nodes(state.mesh.lattice(), &state.u, &u), ranges[0]);
                    // a trial in which too much happens says little
                    if share <= CHANGE || number >= TRIALS {
                        let least = if simulation.physics.is_given() { GIVEN * longest } else { 0.0 };
                        return Ok(free((trial * CHANGE / share).clamp(least, longest), longest));
                    }
                }
                Err(failure) if !failure.is_curable() || 0.01 * trial < SHORTEST * longest => {
                    return Err(Error::Failed { failure, moment: Some(Moment { t: state.t + trial, step: 1 }) });
                }
                Err(_) => {}
            }
            trial *= 0.01;
            number += 1;
        }
    }

    fn is_sound(&self) -> bool {
        [self.dt, self.longest, self.scale].iter().all(|dt| dt.is_finite() && *dt > 0.0)
            && !self.ranges.is_empty()
            && [&self.sizes, &self.foreseen].iter().all(|sizes| sizes.len() == self.ranges.len())
            && self.ranges.iter().chain(&self.sizes).chain(&self.foreseen).all(|size| size.is_finite() && *size >= 0.0)
    }

    /// Learns from a step; none is returned where it is refused.
    ///
    /// # Errors
    /// The failure of a step that was halved as often as may be, or [`Failure::VanishingStep`] where the next step
    /// would be too short.
    fn judge<const D: usize>(
        &mut self,
        simulation: &mut Simulation<D>,
        before: &State<D>,
        step: Result<Advanced<D>, Failure>,
        record: &mut Record,
    ) -> Result<Option<Advanced<D>>, Failure>
    where
        Mesh<D>: Movable<D>,
    {
        let step = match step {
            Ok(step) => step,
            Err(failure) => return self.try_shorter(before, failure, simulation.safety, record).map(|()| None),
        };
        self.failures = 0;
        let after = &step.state;
        for (c, largest) in self.ranges.iter_mut().enumerate() {
            *largest = largest.max(range(&after.u, c));
        }
        let dt = after.t - before.t;
        // a step that was cut short to meet a report says what a whole one would have done
        let cut = self.dt / dt;
        for (c, size) in self.sizes.iter_mut().enumerate() {
            *size = before.u.component(c).fold(*size, larger);
        }
        let scales = self.scales();
        let (taken, factor) = match (&mut self.control, &step.errors) {
            (Some(control), Some(errors)) => control.judge(relative(errors, &scales), cut),
            _ => {
                let share = share(change_at_nodes(after.mesh.lattice(), &before.u, &after.u), scales[0]);
                let whole = share * cut;
                let factor = if whole.is_finite() { (CHANGE / whole).clamp(GROWTH[0], GROWTH[1]) } else { GROWTH[0] };
                (share <= TOO_MUCH * CHANGE, factor)
            }
        };
        let tried = self.dt;
        self.dt = (self.dt * factor).min(self.longest);
        self.dt = self.dt.min(simulation.longest_of_growth(after));
        // of a solution that is given nothing is lost where nodes pass a jump in it
        if simulation.physics.is_given() {
            self.dt = self.dt.max(GIVEN * self.longest);
        }
        self.short = if self.dt < SHORT * self.longest { self.short + 1 } else { 0 };
        if self.short > MOST_SHORT || self.dt < SHORTEST * self.longest {
            let cause = self.cause(simulation, before, after, dt);
            return Err(Failure::VanishingStep { dt: self.dt, cause });
        }
        if !(taken || simulation.physics.is_given() && tried <= GIVEN * self.longest) {
            record.work.rejected_steps += 1;
            return Ok(None);
        }
        self.scale = self.scale_after(simulation, before, after, dt);
        Ok(Some(step))
    }

    /// After a step that failed, halves its length; fails as that step did where a shorter one is of no use.
    fn try_shorter<const D: usize>(
        &mut self,
        before: &State<D>,
        failure: Failure,
        safety: Safety,
        record: &mut Record,
    ) -> Result<(), Failure> {
        // the first step is a guess, which may be far too long where a layer begins at a side
        self.dt *= if before.step == 0 { FIRST_AGAIN } else { 0.5 };
        self.failures += 1;
        if self.failures > safety.halvings || self.dt < SHORTEST * self.longest || !failure.is_curable() {
            return Err(failure);
        }
        record.work.rejected_steps += 1;
        record.safety.shortened += 1;
        Ok(())
    }

    /// The time step of which τ is a multiple, after a step of length `dt`
    ///
    /// A mesh that sweeps its nodes through a front shortens the steps. Were τ shortened with them, the mesh would
    /// sweep faster: τ keeps to the time in which the solution changes as much at a fixed place.
    fn scale_after<const D: usize>(
        &self,
        simulation: &mut Simulation<D>,
        before: &State<D>,
        after: &State<D>,
        dt: f64,
    ) -> f64
    where
        Mesh<D>: Movable<D>,
    {
        if self.dt >= self.scale {
            return self.dt;
        }
        let mut in_place = dt * CHANGE / share(change_in_place(before, after, 0), self.scales()[0]);
        if in_place < DOUBTED * self.scale {
            // the change at fixed places contains the errors of interpolation that the moving mesh makes; a τ
            // shortened by these would move the mesh faster and make more of them
            in_place = in_place.max(self.dt * CHANGE / self.share_of(at_rest(simulation, after, self.dt)));
        }
        self.dt.max(in_place.min(self.scale))
    }

    /// The cause of steps that are too short.
    fn cause<const D: usize>(
        &self,
        simulation: &mut Simulation<D>,
        before: &State<D>,
        after: &State<D>,
        dt: f64,
    ) -> Cause
    where
        Mesh<D>: Movable<D>,
    {
        let change = change_at_nodes(after.mesh.lattice(), &before.u, &after.u);
        let (start, end) = (simulation.schedule.start(), simulation.schedule.end());
        let at_rest = at_rest(simulation, before, self.dt);
        let size = |u: &Field| scale(range(u, 0), largest(u, 0));
        let grows = |change: f64, u: &Field| size(u) - size(&before.u) > GROWS * change;
        // what sweeps over a peak that grows lowers it at its nodes now and then
        if grows(change, &after.u) || at_rest.as_ref().is_some_and(|(change, u)| grows(*change, u)) {
            Cause::BlowUp
        } else if self.share_of(at_rest) / self.dt < DOUBTED * share(change, self.scales()[0]) / dt {
            Cause::Restless
        } else if after.t - start < AT_START * (end - start) {
            Cause::Start
        } else {
            Cause::Stiff
        }
    }

    /// What the change of each unknown is measured by: its range, or its largest size so far where it is the same
    /// everywhere; but at least a small share of the size that prescribed formulas will give to it.
    fn scales(&self) -> Vec<f64> {
        let scale = |c: usize| scale(self.ranges[c], self.sizes[c]).max(BEGUN * self.foreseen[c]);
        (0..self.ranges.len()).map(scale).collect()
    }

    /// A change as a share of the range; infinite where there is none.
    fn share_of(&self, changed: Option<(f64, Field)>) -> f64 {
        changed.map_or(f64::INFINITY, |(change, _)| share(change, self.scales()[0]))
    }
}
