//! The time loop: mesh, then physics, then whoever watches.

mod coupling;
mod observer;
mod report;
mod schedule;

pub use coupling::Coupling;
pub use observer::{Event, Frames, FramesAt, History, Observer, Snapshot};
pub use report::{Conserved, ErrorNorms, Failed, Parallel, Report, RunDirectory, Seconds, Summary, WorkTotal};
pub use report::{Picture, draw, final_arrays};
pub use schedule::Schedule;

use crate::density::Monitor;
use crate::error::{Error, Moment, Result};
use crate::geometry::{Field, Mesh, check_unfolded, node_areas, quality};
use crate::meshing::{MeshGenerator, Mmpde};
use crate::physics::Physics;
use crate::work::Work;
use std::time::Instant;

/// Everything that changes from step to step.
#[derive(Debug, Clone, PartialEq)]
pub struct State {
    /// Time.
    pub t: f64,
    /// Steps done.
    pub step: usize,
    /// The mesh.
    pub mesh: Mesh<2>,
    /// The solution on it.
    pub u: Field,
    /// The density that follows from both: what moves the mesh next.
    pub rho: Vec<f64>,
}

/// What a run did so far.
#[derive(Debug, Clone, Default)]
pub struct Record {
    /// Steps and their cost.
    pub work: WorkTotal,
    /// Where the time went.
    pub seconds: Seconds,
    /// One report for each time asked for.
    pub reports: Vec<Report>,
}

/// A moving mesh, the physics on it, and how they are advanced together.
///
/// # Example
/// ```
/// use driftmesh::{density::Arclength, geometry::{Lattice, Mesh}, meshing::{Mmpde, Whole}};
/// use driftmesh::{physics::{Burgers, Convection}, simulation::{Coupling, Record, Schedule, Simulation}};
///
/// let mut simulation = Simulation {
///     physics: Box::new(Burgers::new(0.005, Convection::Conservative)?),
///     monitor: Box::new(Arclength::default()),
///     generator: Box::new(Whole::default()),
///     equation: Mmpde::default(),
///     coupling: Coupling::default(),
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
pub struct Simulation {
    /// The equation on the mesh.
    pub physics: Box<dyn Physics>,
    /// Where the mesh should be fine.
    pub monitor: Box<dyn Monitor>,
    /// How the mesh equation is solved.
    pub generator: Box<dyn MeshGenerator>,
    /// The mesh equation.
    pub equation: Mmpde,
    /// How often mesh and physics alternate in a step.
    pub coupling: Coupling,
    /// When.
    pub schedule: Schedule,
}

impl Simulation {
    /// The state at the start, on a given mesh.
    ///
    /// # Errors
    /// [`Error::Failed`] where the mesh is folded or the initial solution has no finite density.
    pub fn start(&self, mesh: Mesh<2>) -> Result<State> {
        let t = self.schedule.start();
        let moment = Some(Moment { t, step: 0 });
        let at_start = |failure| Error::Failed { failure, moment };
        check_unfolded(&mesh).map_err(at_start)?;
        let u = self.physics.initial(t, &mesh);
        let monitored: Vec<f64> = u.component(0).collect();
        let rho = self.monitor.density(&mesh, &monitored).map_err(at_start)?;
        Ok(State { t, step: 0, mesh, u, rho })
    }

    /// Runs to the end of the schedule
    ///
    /// `state` advances step by step; after an error it is the last good one. `record` adds up what was done.
    ///
    /// # Errors
    /// [`Error::Failed`] with the time and step of a numerical failure, or what an observer returned.
    pub fn run(&mut self, state: &mut State, record: &mut Record, observers: &mut [&mut dyn Observer]) -> Result<()> {
        let (wall, cpu) = (Instant::now(), cpu_time::ProcessTime::now());
        let before = record.seconds;
        let outcome = self.run_steps(state, record, observers);
        record.seconds.wall = before.wall + wall.elapsed().as_secs_f64();
        record.seconds.cpu = before.cpu + cpu.elapsed().as_secs_f64();
        outcome
    }

    fn run_steps(&mut self, state: &mut State, record: &mut Record, observers: &mut [&mut dyn Observer]) -> Result<()> {
        let started = Instant::now();
        let mass_at_start = self.physics.conserved(&state.mesh, &state.u);
        self.show(Event::Started, state, record, observers, 0.0, started)?;
        if self.schedule.reports_at(state.t) {
            record.reports.push(self.report(state, mass_at_start));
        }
        while let Some(dt) = self.schedule.step_from(state.step) {
            let step = state.step + 1;
            let t = self.schedule.time(step);
            let (next, work) = coupling::advance(self, state, t, dt, &mut record.seconds)
                .map_err(|failure| Error::Failed { failure, moment: Some(Moment { t, step }) })?;
            *state = next;
            record.work.add(work);
            if self.schedule.reports_at(t) {
                record.reports.push(self.report(state, mass_at_start));
            }
            self.show(Event::Stepped, state, record, observers, dt, started)?;
        }
        self.show(Event::Finished, state, record, observers, 0.0, started)
    }

    fn show(
        &self,
        event: Event,
        state: &State,
        record: &mut Record,
        observers: &mut [&mut dyn Observer],
        dt: f64,
        started: Instant,
    ) -> Result<()> {
        if observers.is_empty() {
            return Ok(());
        }
        let output = Instant::now();
        let snapshot = Snapshot {
            state,
            unknowns: &self.physics.unknowns(),
            dt,
            steps: self.schedule.steps(),
            quality: quality(&state.mesh, &state.rho),
            error: self.error(state),
            work: record.work,
            seconds: started.elapsed().as_secs_f64(),
        };
        let outcome = observers.iter_mut().try_for_each(|observer| observer.observe(event, &snapshot));
        record.seconds.output += output.elapsed().as_secs_f64();
        outcome
    }

    fn error(&self, state: &State) -> Option<ErrorNorms> {
        let exact = self.physics.exact(state.t, &state.mesh)?;
        let areas = node_areas(&state.mesh);
        let components = state.u.components();
        let (mut linf, mut square, mut area) = (0.0_f64, 0.0, 0.0);
        for (k, (u, e)) in state.u.values().iter().zip(exact.values()).enumerate() {
            let share = areas[k / components];
            linf = linf.max((u - e).abs());
            square += (u - e) * (u - e) * share;
            area += share;
        }
        Some(ErrorNorms { linf, l2: (square / area).sqrt() })
    }

    fn report(&self, state: &State, mass_at_start: f64) -> Report {
        let mass = self.physics.conserved(&state.mesh, &state.u);
        let drift = if mass_at_start == 0.0 { mass } else { (mass - mass_at_start) / mass_at_start.abs() };
        Report {
            t: state.t,
            error: self.error(state),
            quality: quality(&state.mesh, &state.rho),
            conserved: Conserved { mass, drift },
        }
    }
}

/// Time and result of a computation.
fn timed<T>(seconds: &mut f64, compute: impl FnOnce() -> T) -> T {
    let start = Instant::now();
    let result = compute();
    *seconds += start.elapsed().as_secs_f64();
    result
}

impl WorkTotal {
    fn add(&mut self, work: Work) {
        self.steps += 1;
        self.work += work;
    }
}
