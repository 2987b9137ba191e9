//! The time loop: mesh, then physics, then whoever watches.

mod assess;
mod benefit;
mod checkpoint;
mod clock;
mod conserved;
mod consistent;
mod control;
mod coupling;
mod doors;
mod doubts;
mod forced;
mod growth;
mod journey;
mod observer;
mod pace;
mod record;
mod safety;
mod scene;
mod schedule;
mod shocks;
mod warnings;

pub use crate::stopwatch::Spent;
pub use benefit::Benefit;
pub(crate) use checkpoint::{Checkpoint, Course, Keeper};
pub use conserved::{Amount, Conserved};
use coupling::Advanced;
pub use coupling::Coupling;
pub use observer::{Event, Moving, Observer, Snapshot};
pub use record::{ErrorNorms, MovingParts, Record, Report, WorkTotal};
pub use safety::{Retries, Safety};
pub use scene::{Scene, Values};
pub(crate) use schedule::Past;
pub use schedule::Schedule;

use crate::density::Monitor;
use crate::error::{Error, Failure, Moment, Result};
use crate::geometry::{Density, Field, Mesh, check_unfolded};
use crate::kept::Kept;
use crate::meshing::Movable;
use crate::mover::{self, Gait, Mover, Start};
use crate::numerics::ends;
use crate::physics::Physics;
use clock::Clock;
use conserved::AtStart;
use forced::Forced;
use pace::Pace;
use std::any::Any;
use std::time::Instant;

/// Everything that changes from step to step.
#[derive(Debug, Clone, PartialEq)]
pub struct State<const D: usize = 2> {
    /// Time.
    pub t: f64,
    /// Steps done.
    pub step: usize,
    /// The mesh.
    pub mesh: Mesh<D>,
    /// The solution on it.
    pub u: Field,
    /// The density that follows from both: what moves the mesh next.
    pub rho: Density,
    /// The mover's memory of the last steps: velocity of the nodes, τ, and how the mesh was going.
    pub gait: Gait<D>,
    /// How fast the solution changes by itself: the largest change at a fixed place in the last step, as a share of its
    /// range and less what moving the nodes did, over the time that it took; 0 before the first step.
    pub own_change: f64,
}

/// A moving mesh, the physics on it, and how they are advanced together.
///
/// # Example
/// ```
/// use driftmesh::{density::Arclength, geometry::{Lattice, Mesh}, meshing::Whole, mover::Mover};
/// use driftmesh::{physics::{Burgers, Convection}, simulation::{Coupling, Record, Safety, Schedule, Simulation}};
///
/// let mut simulation = Simulation {
///     physics: Box::new(Burgers::new(0.005, Convection::Conservative)?),
///     monitor: Box::new(Arclength::default()),
///     mover: Mover::new(Whole::default()),
///     coupling: Coupling::default(),
///     safety: Safety::default(),
///     schedule: Schedule::new(0.25, 0.30, 1e-3, vec![0.30])?,
/// };
/// let mesh = Mesh::uniform(Lattice::bounded([20, 20])?, [0.0, 0.0], [1.0, 1.0])?;
/// let mut state = simulation.start(mesh)?;
/// let mut record = Record::default();
/// simulation.run(&mut state, &mut record, &mut [])?;
/// assert_eq!(record.work.steps, 50);
/// assert!(record.reports[0].quality.min_scaled_jacobian > 0.0);
/// # Ok::<(), driftmesh::Error>(())
/// ```
pub struct Simulation<const D: usize = 2> {
    /// The equation on the mesh.
    pub physics: Box<dyn Physics<D>>,
    /// Where the mesh should be fine.
    pub monitor: Box<dyn Monitor<D>>,
    /// How the mesh follows it; how often it tries again is for `safety` to say.
    pub mover: Mover<D>,
    /// How often mesh and physics alternate in a step.
    pub coupling: Coupling,
    /// How far a step that fails is tried again.
    pub safety: Safety,
    /// Start, end, steps and report times of the run.
    pub schedule: Schedule,
}

/// Standard error of the nodes on interfaces between subdomains, as a share of the shortest edge of the mesh, above
/// which a run warns that they are noisy.
pub const INTERFACE_NOISE_WORTH_A_WARNING: f64 = 0.05;

impl<const D: usize> Simulation<D>
where
    Mesh<D>: Movable<D>,
{
    /// See [`Simulation::start`].
    pub(crate) fn started(&self, mesh: Mesh<D>) -> Result<State<D>> {
        let t = self.schedule.start();
        let at_start = |failure| self.at_start(failure);
        check_unfolded(&mesh).map_err(at_start)?;
        let u = self.physics.initial(t, &mesh);
        self.physics.check(t, &mesh, &u).map_err(at_start)?;
        if let Some(place) = u.values().iter().position(|v| !v.is_finite()) {
            let (value, k) = (u.values()[place], place / u.components());
            let at = mesh.node_place(k);
            return Err(at_start(Failure::NonFinite { what: "the initial solution", value, at }));
        }
        let rho = coupling::density(self.physics.as_ref(), self.monitor.as_ref(), t, &mesh, &u).map_err(at_start)?;
        let gait = Gait::at_rest(&mesh);
        Ok(State { t, step: 0, mesh, u, rho, gait, own_change: 0.0 })
    }

    /// See [`Simulation::adapted`].
    pub(crate) fn adapted_from(&self, mesh: Mesh<D>, observers: &mut [&mut dyn Observer]) -> Result<Start<D>> {
        mover::adapted_to_all(mesh, self.mover.equation.form, &mut |mesh| {
            let state = self.with_sides(self.started(mesh.clone())?)?;
            observers.iter_mut().try_for_each(|observer| observer.adapting(state.t))?;
            end_where_asked(observers, &state)?;
            let u = self.monitor.followed(state.t, &state.mesh, &state.u).map_err(|failure| self.at_start(failure))?;
            let others = (1..state.u.components()).map(|c| state.u.component(c).collect());
            Ok((std::iter::once(u).chain(others).collect(), state.rho))
        })
    }

    /// A start with the values that its sides will have: where they differ from the initial solution, a layer begins
    /// there.
    fn with_sides(&self, mut state: State<D>) -> Result<State<D>> {
        let (lattice, count) = (*state.mesh.lattice(), state.u.components());
        let mut differs = false;
        for k in lattice.sides() {
            let values = self.physics.side_values(state.t, state.mesh.image(state.mesh.x()[k]), lattice.beyond(k));
            for (c, value) in values.into_iter().enumerate() {
                let u = &mut state.u.values_mut()[k * count + c];
                let value = value.unwrap_or(*u);
                differs |= *u != value;
                *u = value;
            }
        }
        if differs {
            let State { t, mesh, u, .. } = &state;
            let rho = coupling::density(self.physics.as_ref(), self.monitor.as_ref(), *t, mesh, u);
            state.rho = rho.map_err(|failure| self.at_start(failure))?;
        }
        Ok(state)
    }

    /// What the user should know of a start although nothing failed: a density that is noise at the scale of its cells,
    /// and unknowns of which the mesh misses something.
    pub fn doubts(&self, start: &State<D>) -> Vec<String> {
        doubts::doubts(self, start)
    }

    fn at_start(&self, failure: Failure) -> Error {
        Error::Failed { failure, moment: Some(Moment { t: self.schedule.start(), step: 0 }) }
    }

    /// See [`Simulation::run`].
    pub(crate) fn ran(
        &mut self,
        state: &mut State<D>,
        record: &mut Record,
        observers: &mut [&mut dyn Observer],
    ) -> Result<()> {
        self.run_on(state, record, observers, None, None)
    }

    /// Runs to the end with checkpoints; with a `course` it goes on from the checkpoint to which the state belongs.
    pub(crate) fn run_on(
        &mut self,
        state: &mut State<D>,
        record: &mut Record,
        observers: &mut [&mut dyn Observer],
        keeper: Option<&mut dyn Keeper<D>>,
        course: Option<Course>,
    ) -> Result<()> {
        record.timed(|record| self.run_steps(state, record, observers, keeper, course))
    }

    fn run_steps(
        &mut self,
        state: &mut State<D>,
        record: &mut Record,
        observers: &mut [&mut dyn Observer],
        mut keeper: Option<&mut dyn Keeper<D>>,
        course: Option<Course>,
    ) -> Result<()> {
        let clock = Clock::start(course.as_ref(), record);
        if course.is_none() {
            self.make_consistent(state);
        }
        let (event, at_start) = match &course {
            Some(course) => (Event::Resumed, course.at_start.clone()),
            None => (Event::Started, AtStart::of(&*self.physics, &state.mesh, &state.u)),
        };
        self.show(event, state, record, observers, 0.0, &clock)?;
        // at the start; and at the end of an earlier run that made no report there
        if self.schedule.reports_at(state.t) && record.reports.last().is_none_or(|report| report.t != state.t) {
            let report = self.report(state, &at_start, record.interface);
            record.reports.push(report);
        }
        if record.data.is_empty() {
            record.data = (0..state.u.components()).map(|c| ends(state.u.component(c))).collect();
        }
        let mut course = match course {
            Some(course) => course,
            None => self.begin(state, at_start, record)?,
        };
        self.pause(state, record, observers, &mut keeper, &clock, &course)?;
        while let Some((t, dt)) = course.pace.next(&self.schedule, state) {
            let next = self.advance(state, (t, dt), &mut course, record);
            let next = next.inspect_err(|error| self.warn_of_blow_up(error, state, record));
            let Some(next) = next? else {
                if observers.iter().any(|observer| observer.interrupts()) {
                    self.pause(state, record, observers, &mut keeper, &clock, &course)?;
                }
                continue;
            };
            record.travelled += next.state.mesh.farthest(&state.mesh);
            *state = next.state;
            record.work.add(next.work);
            record.interface = next.interface;
            self.warn(state, dt, record);
            if self.schedule.reports_at(t) {
                let report = self.report(state, &course.at_start, record.interface);
                record.reports.push(report);
            }
            self.show(Event::Stepped, state, record, observers, dt, &clock)?;
            self.pause(state, record, observers, &mut keeper, &clock, &course)?;
        }
        if let Some(keeper) = keeper {
            self.checkpoint(state, record, observers, keeper, &clock, &course)?;
        }
        self.show(Event::Finished, state, record, observers, 0.0, &clock)
    }

    /// What the loop carries from step to step, before the first.
    fn begin(&mut self, state: &State<D>, at_start: AtStart, record: &mut Record) -> Result<Course> {
        timed(&mut record.seconds.parts.pde, || {
            let (mut pace, forced) = (Pace::new(self, state)?, Forced::of(self, state));
            pace.foresee(forced.sizes(&state.mesh));
            Ok(Course { at_start, pace, forced, seconds: 0.0 })
        })
    }

    /// Tries a step; none is returned where a shorter one has to be tried.
    fn advance(
        &mut self,
        state: &State<D>,
        (t, dt): (f64, f64),
        course: &mut Course,
        record: &mut Record,
    ) -> Result<Option<Advanced<D>>> {
        let moment = Some(Moment { t, step: state.step + 1 });
        let next = course.pace.step(self, state, (t, dt), record);
        let Some(next) = next.map_err(|failure| Error::Failed { failure, moment })? else { return Ok(None) };
        let hidden = timed(&mut record.seconds.parts.pde, || course.forced.hidden(self, state, &next.state));
        match hidden {
            Some(_) if course.pace.shorten(dt) => {
                record.work.rejected_steps += 1;
                return Ok(None);
            }
            Some(hidden) => self.warn_of_hidden(hidden, state.t, dt, record),
            None => {}
        }
        Ok(Some(next))
    }

    /// Writes a checkpoint where one is due, and ends the run where an observer asks for that.
    fn pause(
        &self,
        state: &State<D>,
        record: &mut Record,
        observers: &mut [&mut dyn Observer],
        keeper: &mut Option<&mut dyn Keeper<D>>,
        clock: &Clock,
        course: &Course,
    ) -> Result<()> {
        let asked = end_where_asked(observers, state);
        if let Some(keeper) = keeper
            && (asked.is_err() || keeper.due(state.step))
        {
            self.checkpoint(state, record, observers, *keeper, clock, course)?;
        }
        asked
    }

    fn checkpoint(
        &self,
        state: &State<D>,
        record: &mut Record,
        observers: &mut [&mut dyn Observer],
        keeper: &mut dyn Keeper<D>,
        clock: &Clock,
        course: &Course,
    ) -> Result<()> {
        let began = Instant::now();
        let mut kept = Kept::default();
        self.mover.generator.keep(&mut kept);
        observers.iter_mut().try_for_each(|observer| observer.keep(&mut kept))?;
        let last = state.t >= self.schedule.end();
        let course = Course { seconds: clock.seconds(), ..course.clone() };
        keeper.keep(&Checkpoint::of(state, clock.counted(record), course, kept), last)?;
        record.seconds.output += began.elapsed().as_secs_f64();
        Ok(())
    }

    fn show(
        &self,
        event: Event,
        state: &State<D>,
        record: &mut Record,
        observers: &mut [&mut dyn Observer],
        dt: f64,
        clock: &Clock,
    ) -> Result<()> {
        if observers.is_empty() {
            return Ok(());
        }
        let output = Instant::now();
        let (quality, error) = self.assess(state);
        let snapshot = Snapshot {
            t: state.t,
            step: state.step,
            dt,
            steps: self.schedule.steps(),
            share: self.schedule.share(state.t),
            smallest: quality.min_scaled_jacobian,
            seconds: clock.seconds(),
            nodes: in_plane(&state.mesh).map_or(&[], Mesh::x),
            scene: &|| state.scene(&self.physics.unknowns()),
            moving: Some(Moving { state, quality, error, work: record.work, interface: record.interface }),
        };
        let outcome = observers.iter_mut().try_for_each(|observer| observer.observe(event, &snapshot));
        record.seconds.output += output.elapsed().as_secs_f64();
        outcome
    }
}

/// A mesh of two dimensions as one; none of another.
fn in_plane<const D: usize>(mesh: &Mesh<D>) -> Option<&Mesh<2>> {
    (mesh as &dyn Any).downcast_ref()
}

/// Ends a run where an observer asks for that.
fn end_where_asked<const D: usize>(observers: &[&mut dyn Observer], state: &State<D>) -> Result<()> {
    match observers.iter().any(|observer| observer.interrupts()) {
        true => Err(Error::Interrupted(Moment { t: state.t, step: state.step })),
        false => Ok(()),
    }
}

/// Time and result of a computation.
pub(crate) fn timed<T>(seconds: &mut f64, compute: impl FnOnce() -> T) -> T {
    let start = Instant::now();
    let result = compute();
    *seconds += start.elapsed().as_secs_f64();
    result
}
