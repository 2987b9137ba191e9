//! Studies of kind `stefan`: how they run, and what they leave.

use super::StefanStudy;
use super::any::Begin;
use super::ending::end;
use super::stefan::Prepared;
use crate::error::{Error, Moment, Result, Unfit};
use crate::geometry::{Field, quality};
use crate::kept::{Kept, check_nodal};
use crate::mover::Gait;
use crate::output::{
    Checkpoints, Failed, Frames, Parallel, Picture, Rows, RunDirectory, draw, draw_curves, final_arrays, moment, status,
};
use crate::report;
use crate::simulation::{Event, Observer, Schedule, Snapshot, State, WorkTotal};
use crate::stefan::{Energy, Front, FrontState, LOWER, Problem, Stepping, UPPER};
use crate::stopwatch::Stopwatch;
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::time::Instant;

/// `summary.json` of a study of kind `stefan`.
#[derive(Debug, Clone, Serialize)]
pub struct StefanSummary {
    /// Version of this format.
    pub schema: u32,
    /// Name of the study.
    pub study: String,
    /// `stefan`.
    pub kind: String,
    /// Version of the program.
    pub version: String,
    /// `running`, `completed` or `failed`.
    pub status: String,
    /// What failed and when, if it did.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<Failed>,
    /// Where the time went.
    pub seconds: FrontSeconds,
    /// What the run had at its disposal.
    pub parallel: Parallel,
    /// Steps and their cost.
    pub work: WorkTotal,
    /// One entry for each time of `time.report` that was reached.
    pub reports: Vec<FrontReport>,
    /// What the user should know although nothing failed.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
}

/// Seconds by part.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
pub struct FrontSeconds {
    /// By the clock.
    pub wall: f64,
    /// Of all threads.
    pub cpu: f64,
    /// Moving the front and solving the heat equation.
    pub pde: f64,
    /// History, frames, pictures.
    pub output: f64,
}

/// The state at one of the times asked for.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub struct FrontReport {
    /// Time.
    pub t: f64,
    /// Of the front.
    pub front: FrontFigures,
    /// Of the temperature, where an exact solution is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<FrontError>,
    /// |ΔE − ∫F dt| / |ΔE| with fluxes by weighted residual; none before anything changed.
    pub energy_imbalance: Option<f64>,
    /// The same with fluxes by differences over three rows.
    pub energy_imbalance_by_differences: Option<f64>,
    /// The longest stable explicit step, as estimated; none where the front is at rest.
    pub step_limit: Option<f64>,
}

/// Of the front.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub struct FrontFigures {
    /// Mean height over the width.
    pub mean: f64,
    /// Lowest and highest point.
    pub range: [f64; 2],
    /// Largest error of its height, where an exact solution is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error_linf: Option<f64>,
}

/// Error of the temperature.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub struct FrontError {
    /// Largest over the nodes.
    pub linf: f64,
}

/// What a run of a front left behind.
#[derive(Debug)]
pub struct FrontFinished {
    /// What `summary.json` holds.
    pub summary: StefanSummary,
    /// The last good state.
    pub state: FrontState,
    /// x of its columns.
    pub columns: Vec<f64>,
    /// Times and fronts, some of them.
    pub fronts: Vec<(f64, Vec<f64>)>,
    /// Both phases of the last good state as one mesh.
    pub whole: State,
    /// Why the run ended early, if it did.
    pub failure: Option<Error>,
}

/// Automatic steps are at most this share of what is stable …
const OF_THE_LIMIT: f64 = 0.5;
/// … and this part of the run.
const PARTS: f64 = 50.0;
/// An implicit front has no limit but accuracy.
const IMPLICIT_PARTS: f64 = 100.0;
/// How often an automatic step that fails is halved. Each begins anew, so that a run that goes on takes the same steps.
const HALVINGS: i32 = 6;
/// Fronts drawn over time.
const CURVES: usize = 16;

#[derive(Serialize)]
struct Row {
    t: f64,
    dt: f64,
    front_mean: f64,
    front_min: f64,
    front_max: f64,
    front_error_linf: Option<f64>,
    error_linf: Option<f64>,
    energy_imbalance: Option<f64>,
    energy_imbalance_by_differences: Option<f64>,
    step_limit: Option<f64>,
    min_scaled_jacobian: f64,
    q_max: f64,
    q_mean: f64,
    newton_iterations: usize,
    seconds: f64,
}

/// Everything that the steps of a run to come depend on, and what was found in those done.
#[derive(Serialize, Deserialize)]
struct FrontCheckpoint {
    state: FrontState,
    seconds: FrontSeconds,
    work: WorkTotal,
    reports: Vec<FrontReport>,
    warnings: Vec<String>,
    fronts: Vec<(f64, Vec<f64>)>,
    kept: Kept,
}

impl FrontCheckpoint {
    /// Refuses what cannot be a state of the study.
    fn check(&self, Prepared { front, schedule, .. }: &Prepared) -> Result<(), Unfit> {
        let (columns, state) = (&front.columns, &self.state);
        let heights = |front: &[f64]| check_nodal("front", front.as_chunks::<1>().0, columns.x().len());
        heights(&state.front)?;
        self.fronts.iter().try_for_each(|(_, front)| heights(front))?;
        columns.check(&state.front).map_err(|failure| Unfit::Damaged(failure.to_string()))?;
        for phase in [LOWER, UPPER] {
            let nodes = columns.x().len() * (columns.rows(phase) + 1);
            check_nodal("temperature", state.u[phase].as_chunks::<1>().0, nodes)?;
        }
        let Energy { start, now, inflow, inflow_by_differences } = state.energy;
        let times: Vec<[f64; 1]> = self.fronts.iter().map(|(t, _)| [*t]).collect();
        check_nodal("energy", &[[start, now, inflow, inflow_by_differences]], 1)?;
        check_nodal("times of fronts", &times, times.len())?;
        match schedule.meets(state.step, state.t) {
            true => Ok(()),
            false => Err(Unfit::Damaged(format!("its step {} at t = {} is none of the run", state.step, state.t))),
        }
    }
}

/// `history.csv` and `front.csv`.
struct Tables {
    history: Rows,
    fronts: Rows,
}

impl Tables {
    const NAMES: [&str; 2] = ["history.csv", "front.csv"];

    fn create(directory: &Path, x: &[f64]) -> Result<Self> {
        let [history, fronts] = Self::NAMES.map(|name| Rows::create(&directory.join(name)));
        let mut tables = Self { history: history?, fronts: fronts? };
        let heads = ["t".to_string()].into_iter().chain(x.iter().map(|x| format!("x={x}")));
        tables.fronts.add(heads.collect::<Vec<_>>())?;
        Ok(tables)
    }

    /// Goes on behind the rows that a checkpoint knows of.
    fn resume(directory: &Path, kept: &Kept) -> Result<Self, Unfit> {
        let [history, fronts] = Self::NAMES.map(|name| Rows::reopen(&directory.join(name), kept.get(name)?));
        Ok(Self { history: history?, fronts: fronts? })
    }

    fn keep(&mut self, kept: &mut Kept) -> Result<()> {
        for (name, table) in Self::NAMES.into_iter().zip([&mut self.history, &mut self.fronts]) {
            kept.put(name, &table.sync()?);
        }
        Ok(())
    }

    fn write(&mut self, row: Row, front: &[f64]) -> Result<()> {
        let heights = [row.t].into_iter().chain(front.iter().copied()).map(|value| value.to_string());
        self.fronts.add(heights.collect::<Vec<_>>())?;
        self.history.add(row)?;
        self.history.flush().and(self.fronts.flush())
    }
}

impl StefanStudy {
    /// Runs the study into a directory, with further observers watching
    ///
    /// A failure after the start is not an error of this function: everything up to the last good state is written, and
    /// [`FrontFinished::failure`] says what happened. `summary.json` tells the same.
    ///
    /// # Errors
    /// As [`StefanStudy::check`]; [`Error::ForeignDirectory`], [`Error::Busy`] or [`Error::Unwritable`] for the directory.
    pub fn run(&self, directory: &Path, watchers: &mut [&mut dyn Observer]) -> Result<FrontFinished> {
        self.run_from(directory, watchers, Begin::Anew)
    }

    /// The same from the newest checkpoint in the directory, to the bits of a run that nothing disturbed; from the start
    /// where there is none.
    ///
    /// # Errors
    /// As [`StefanStudy::run`], and [`Error::Checkpoint`] where there are checkpoints, but none that will do.
    pub fn resume(&self, directory: &Path, watchers: &mut [&mut dyn Observer]) -> Result<FrontFinished> {
        self.run_from(directory, watchers, Begin::Resumed)
    }

    fn run_from(&self, path: &Path, watchers: &mut [&mut dyn Observer], begin: Begin) -> Result<FrontFinished> {
        let clock = Stopwatch::start();
        let mut prepared = self.prepare()?;
        let mut summary = self.summary();
        summary.warnings = self.warnings()?;
        let directory = RunDirectory::open(path)?;
        let mut checkpoints = Checkpoints::new(path, self.output.checkpoint, &self.to_toml())?;
        let resumed = match begin {
            Begin::Anew => None,
            Begin::Resumed => checkpoints.resume(|found: FrontCheckpoint| {
                found.check(&prepared)?;
                let picture =
                    pictured(&prepared.front, &found.state).map_err(|error| Unfit::Damaged(error.to_string()))?;
                let tables = Tables::resume(path, &found.kept)?;
                let frames = Frames::resume(path, prepared.frames.clone(), [1, 1], &picture, &found.kept)?;
                Ok((found, tables, frames))
            })?,
        };
        let (event, mut tables, mut frames, mut fronts) = match resumed {
            Some(((found, tables, frames), refused)) => {
                directory.clear_ended(&RunDirectory::GROWING)?;
                prepared.state = found.state;
                (summary.seconds, summary.work, summary.reports) = (found.seconds, found.work, found.reports);
                summary.warnings = [found.warnings, refused].concat();
                (Event::Resumed, tables, frames, found.fronts)
            }
            None => {
                directory.clear()?;
                let tables = Tables::create(path, prepared.front.columns.x())?;
                (Event::Started, tables, Frames::create(path, prepared.frames.clone(), [1, 1])?, Vec::new())
            }
        };
        directory.write_summary(&summary)?;
        directory.write("study.toml", self.to_toml().as_bytes())?;
        let clock = clock.after([summary.seconds.wall, summary.seconds.cpu]);
        let failure = {
            let mut leave =
                |event, snapshot: &Snapshot<'_>, row: Option<Row>, state: &FrontState, so_far: &StefanSummary| {
                    if let Some(row) = row {
                        tables.write(row, &state.front)?;
                        collect(&mut fronts, snapshot.share, state);
                    }
                    frames.observe(event, snapshot)?;
                    watchers.iter_mut().try_for_each(|watcher| watcher.observe(event, snapshot))?;
                    let ends = event != Event::Finished && watchers.iter().any(|watcher| watcher.interrupts());
                    if ends || event != Event::Finished && checkpoints.is_due(state.step) {
                        let mut kept = Kept::default();
                        tables.keep(&mut kept)?;
                        frames.keep(&mut kept)?;
                        let StefanSummary { seconds, work, reports, warnings, .. } = so_far.clone();
                        let (state, fronts) = (state.clone(), fronts.clone());
                        let found = FrontCheckpoint { state, seconds, work, reports, warnings, fronts, kept };
                        checkpoints.write(found.state.step, &found)?;
                    }
                    match ends {
                        true => Err(Error::Interrupted(Moment { t: state.t, step: state.step })),
                        false => Ok(()),
                    }
                };
            go(&mut prepared, &mut summary, event, &clock, &mut leave).err()
        };
        let output = Instant::now();
        let mut finished = FrontFinished::of(summary, prepared, fronts, failure)?;
        let kept = self.keep(&directory, &finished, &mut frames);
        let FrontFinished { summary, failure, .. } = &mut finished;
        summary.seconds.output += output.elapsed().as_secs_f64();
        let note = |summary: &mut StefanSummary, failure: Option<&Error>, output: f64| {
            summary.status = status(failure).into();
            summary.error = failure.map(|error| Failed::of(error, self.remedy(error)));
            summary.seconds.output += output;
            [summary.seconds.wall, summary.seconds.cpu] = clock.elapsed();
        };
        // what went wrong first is what is reported
        *failure = end(&directory, summary, failure.take().or(kept.err()), note, |status| {
            report::finish(directory.path(), self.output.report, self.output.animation, status)
        });
        if !failure.as_ref().is_some_and(Error::is_resumable) {
            *failure = failure.take().or(checkpoints.remove().err());
        }
        Ok(finished)
    }

    /// See [`Study::decode`](super::Study::decode).
    pub(super) fn decode(&self, bytes: &[u8]) -> Result<usize, Unfit> {
        let damaged = |error: Error| Unfit::Damaged(error.to_string());
        let checkpoints = Checkpoints::new(Path::new(""), self.output.checkpoint, &self.to_toml()).map_err(damaged)?;
        let (step, found) = checkpoints.read::<FrontCheckpoint>(bytes)?;
        found.check(&self.prepare().map_err(damaged)?)?;
        Ok(step)
    }

    /// Runs the study without leaving anything on disk.
    ///
    /// # Errors
    /// As [`StefanStudy::check`].
    pub fn compute(&self) -> Result<FrontFinished> {
        let mut prepared = self.prepare()?;
        let mut summary = self.summary();
        let mut fronts = Vec::new();
        let mut leave = |_, snapshot: &Snapshot<'_>, row: Option<Row>, state: &FrontState, _: &StefanSummary| {
            row.iter().for_each(|_| collect(&mut fronts, snapshot.share, state));
            Ok(())
        };
        let clock = Stopwatch::start();
        let failure = go(&mut prepared, &mut summary, Event::Started, &clock, &mut leave).err();
        summary.status = status(failure.as_ref()).into();
        FrontFinished::of(summary, prepared, fronts, failure)
    }

    fn summary(&self) -> StefanSummary {
        StefanSummary {
            schema: 1,
            study: self.study.name.clone(),
            kind: "stefan".into(),
            version: env!("CARGO_PKG_VERSION").into(),
            status: "running".into(),
            error: None,
            seconds: FrontSeconds::default(),
            parallel: Parallel { ranks: 1, threads: rayon::current_num_threads() },
            work: WorkTotal::default(),
            reports: Vec::new(),
            warnings: Vec::new(),
        }
    }

    /// Writes the last good state: as a frame, as arrays, as pictures.
    fn keep(&self, directory: &RunDirectory, finished: &FrontFinished, frames: &mut Frames) -> Result<()> {
        let names = ["u".to_string()];
        frames.write(&names, &finished.whole)?;
        directory.write("final.npz", &final_arrays(&names, &finished.whole))?;
        for (name, picture) in ["mesh", "front"].into_iter().zip(finished.pictures(&self.study.name)) {
            picture.write(directory.path(), name)?;
        }
        Ok(())
    }
}

/// Keeps some of the fronts, evenly over the run.
fn collect(fronts: &mut Vec<(f64, Vec<f64>)>, share: f64, state: &FrontState) {
    if fronts.is_empty() || share >= fronts.len() as f64 / CURVES as f64 - 1e-9 {
        fronts.push((state.t, state.front.clone()));
    }
}

impl FrontFinished {
    fn of(
        summary: StefanSummary,
        prepared: Prepared,
        mut fronts: Vec<(f64, Vec<f64>)>,
        failure: Option<Error>,
    ) -> Result<Self> {
        let Prepared { front, state, .. } = prepared;
        if fronts.last().is_none_or(|(t, _)| *t != state.t) {
            fronts.push((state.t, state.front.clone()));
        }
        let whole = pictured(&front, &state)?;
        Ok(Self { summary, columns: front.columns.x().to_vec(), fronts, whole, state, failure })
    }

    /// The mesh over the temperature, and the fronts over time.
    pub fn pictures(&self, title: &str) -> [Picture; 2] {
        let all = || self.fronts.iter().flat_map(|(_, h)| h.iter().copied());
        let (low, high) = (all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max));
        let margin = (0.05 * (high - low)).max(1e-3 * high.abs().max(1e-12));
        let (x, last) = (&self.columns, self.columns.len() - 1);
        let line: Vec<[f64; 2]> = x.iter().zip(&self.state.front).map(|(x, y)| [*x, *y]).collect();
        let over_time = format!("{title}, the front over time");
        [
            draw(&format!("{title}, t = {}", moment(self.state.t)), "u", &self.whole, &line),
            draw_curves(&over_time, "t", x, &self.fronts, [x[0], low - margin], [x[last], high + margin]),
        ]
    }
}

/// Both phases as one state.
fn pictured(front: &Front, state: &FrontState) -> Result<State> {
    let mesh = front.columns.whole(&state.front)?;
    let u = front.columns.joined(&state.u);
    let rho = vec![1.0; u.len()];
    let gait = Gait::at_rest(&mesh);
    Ok(State { t: state.t, step: state.step, mesh, u: Field::scalar(u), rho, gait, own_change: 0.0 })
}

type Leave<'a> = dyn FnMut(Event, &Snapshot<'_>, Option<Row>, &FrontState, &StefanSummary) -> Result<()> + 'a;

/// The time loop, which begins with an event; `clock` began with the run.
fn go(
    prepared: &mut Prepared,
    summary: &mut StefanSummary,
    begin: Event,
    clock: &Stopwatch,
    leave: &mut Leave<'_>,
) -> Result<()> {
    let Prepared { front, given, state, schedule, .. } = prepared;
    let [start, end] = [schedule.start(), schedule.end()];
    let names = ["u".to_string()];
    let mut tell = |event, front: &Front, state: &FrontState, dt: f64, summary: &mut StefanSummary| {
        let output = Instant::now();
        let picture = pictured(front, state)?;
        let quality = quality(&picture.mesh, &picture.rho)?;
        let report = reported(front, given, state);
        let [seconds, _] = clock.elapsed();
        let new = matches!(event, Event::Started | Event::Stepped);
        let row = new.then(|| Row {
            t: state.t,
            dt,
            front_mean: report.front.mean,
            front_min: report.front.range[0],
            front_max: report.front.range[1],
            front_error_linf: report.front.error_linf,
            error_linf: report.error.map(|error| error.linf),
            energy_imbalance: report.energy_imbalance,
            energy_imbalance_by_differences: report.energy_imbalance_by_differences,
            step_limit: report.step_limit,
            min_scaled_jacobian: quality.min_scaled_jacobian,
            q_max: quality.q_max,
            q_mean: quality.q_mean,
            newton_iterations: summary.work.work.newton_iterations,
            seconds,
        });
        if new && schedule.reports_at(state.t) {
            summary.reports.push(report);
        }
        let snapshot = Snapshot {
            state: &picture,
            unknowns: &names,
            dt,
            steps: schedule.steps(),
            share: (state.t - start) / (end - start),
            quality,
            error: None,
            work: summary.work,
            interface: None,
            seconds,
        };
        let left = leave(event, &snapshot, row, state, summary);
        summary.seconds.output += output.elapsed().as_secs_f64();
        left
    };
    tell(begin, front, state, 0.0, summary)?;
    let mut halvings = 0;
    while let Some(t) = next(front, state, schedule, halvings) {
        let (began, dt) = (Instant::now(), t - state.t);
        let stepped = front.step(given, state, t);
        summary.seconds.pde += began.elapsed().as_secs_f64();
        summary.work.work += match stepped {
            Ok(work) => work,
            // the state is as it was
            Err(Error::Failed { .. }) if schedule.is_automatic() && halvings < HALVINGS => {
                halvings += 1;
                summary.work.rejected_steps += 1;
                continue;
            }
            Err(Error::Failed { failure, .. }) => {
                let moment = Some(Moment { t, step: state.step + 1 });
                return Err(Error::Failed { failure, moment });
            }
            Err(other) => return Err(other),
        };
        halvings = 0;
        summary.work.steps += 1;
        [summary.seconds.wall, summary.seconds.cpu] = clock.elapsed();
        tell(Event::Stepped, front, state, dt, summary)?;
    }
    tell(Event::Finished, front, state, 0.0, summary)
}

/// Time at the end of the next step; none at the end.
fn next(front: &Front, state: &FrontState, schedule: &Schedule, halvings: i32) -> Option<f64> {
    if !schedule.is_automatic() {
        return schedule.step_from(state.step).map(|_| schedule.time(state.step + 1));
    }
    let span = schedule.end() - schedule.start();
    let dt = match front.stepping {
        // the schedule may lengthen a step by a third
        Stepping::Explicit => (OF_THE_LIMIT * front.limit(state)).min(span / PARTS),
        Stepping::Implicit => span / IMPLICIT_PARTS,
    };
    schedule.after(state.t, dt * 0.5_f64.powi(halvings))
}

fn reported(front: &Front, given: &dyn Problem, state: &FrontState) -> FrontReport {
    let (h, last) = (&state.front, state.front.len() - 1);
    let inner: f64 = h[1..last].iter().sum();
    let errors = front.errors(given, state);
    let limit = front.limit(state);
    FrontReport {
        t: state.t,
        front: FrontFigures {
            mean: (inner + 0.5 * (h[0] + h[last])) / last as f64,
            range: [
                h.iter().copied().fold(f64::INFINITY, f64::min),
                h.iter().copied().fold(f64::NEG_INFINITY, f64::max),
            ],
            error_linf: errors.map(|[front, _]| front),
        },
        error: errors.map(|[_, linf]| FrontError { linf }),
        energy_imbalance: state.energy.imbalance(),
        energy_imbalance_by_differences: state.energy.imbalance_by_differences(),
        step_limit: limit.is_finite().then_some(limit),
    }
}

// the phases are told by number where a study tells them by name
const _: () = assert!(LOWER == 0 && UPPER == 1);
