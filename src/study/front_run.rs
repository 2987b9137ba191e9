//! Studies of kind `stefan`: how they run.

use super::front_figures::{FrontParts, FrontReport, FrontSummary, Row, Tables};
use super::front_given::Given;
use super::kind::{Running, SpentBy};
use super::runner::Stage;
use crate::error::{Error, Moment, Result, Unfit};
use crate::geometry::{Mesh, quality};
use crate::kept::{Kept, check_nodal};
use crate::output::{FramesAt, Picture, RunDirectory, Spent, Summary, draw_curves};
use crate::simulation::{Event, Scene, Schedule, Snapshot, Values, WorkTotal};
use crate::stefan::{Attempt, Energy, Front, FrontState, LOWER, PhaseEvent, Stepping, UPPER};
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::time::Instant;

/// Automatic steps of an explicit front are at most this share of the longest stable one.
const OF_THE_LIMIT: f64 = 0.5;
/// In an automatic step an explicit front moves at most by this share of its distance from the nearer wall; in the
/// first one of an implicit front, too.
const OF_THE_ROOM: f64 = 0.002;
/// Automatic steps are at most the whole run over this number, which bounds what formulas of time may hide in a step.
const PARTS: f64 = 50.0;
/// The estimated error of an automatic step of an implicit front.
const TOLERANCE: f64 = 1e-6;
/// How much shorter and longer than an automatic step of an implicit front the next one may be.
const PACE: [f64; 2] = [0.2, 2.0];
/// How often an automatic step that fails is halved before the run fails.
const HALVINGS: i32 = 6;
/// Automatic steps that are shorter than this share of the run are not halved again.
const SHORTEST: f64 = 1e-7;
/// How often an automatic step with too large an error is shortened before it is taken as it is.
const REJECTIONS: usize = 12;
/// Fronts that the picture over time shows, about.
const CURVES: usize = 16;

/// A front while it runs.
pub struct FrontRun {
    name: String,
    /// The columns, and how the front moves through them.
    pub front: Front,
    pub(super) given: Given,
    schedule: Schedule,
    at: FramesAt,
    /// How far it came.
    pub course: FrontCourse,
    tables: Option<Tables>,
}

/// Everything that the steps of a run to come depend on, and what was found in those done.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct FrontCourse {
    /// The last good state.
    pub state: FrontState,
    seconds: Spent<FrontParts>,
    /// Steps and their cost.
    pub work: WorkTotal,
    /// One entry for each time of `time.report` that was reached.
    pub reports: Vec<FrontReport>,
    warnings: Vec<String>,
    /// Times and fronts, some of them.
    fronts: Vec<(f64, Vec<f64>)>,
    /// Phases that have appeared or vanished.
    pub phases: Vec<PhaseEvent>,
    /// Length of the next automatic step of an implicit front; none before the first.
    pace: Option<f64>,
    /// In a checkpoint, what frames, tables and observers carry; empty in a run.
    kept: Kept,
}

impl FrontCourse {
    /// Refuses what cannot be a state of the study.
    fn check(&self, FrontRun { front, schedule, .. }: &FrontRun) -> Result<(), Unfit> {
        let (columns, state) = (&front.columns, &self.state);
        let heights = |front: &[f64]| check_nodal("front", front.as_chunks::<1>().0, columns.x().len());
        heights(&state.front)?;
        if state.bare.len() != columns.x().len() || state.bare.iter().flatten().any(|phase| *phase > UPPER) {
            return Err(Unfit::Damaged("its bare walls are none of the study".into()));
        }
        self.fronts.iter().try_for_each(|(_, front)| heights(front))?;
        if state.alone.is_none() {
            columns.check(&state.front, &state.bare).map_err(|failure| Unfit::Damaged(failure.to_string()))?;
        }
        for phase in [LOWER, UPPER] {
            let nodes = columns.x().len() * (columns.rows(phase) + 1);
            check_nodal("temperature", state.u[phase].as_chunks::<1>().0, nodes)?;
        }
        let Energy { start, now, inflow, inflow_by_differences, moved } = state.energy;
        let times: Vec<[f64; 1]> = self.fronts.iter().map(|(t, _)| [*t]).collect();
        check_nodal("energy", &[[start, now, inflow, inflow_by_differences, moved, state.way[0], state.way[1]]], 1)?;
        check_nodal("times of fronts", &times, times.len())?;
        match schedule.meets(state.step, state.t) {
            true => Ok(()),
            false => Err(Unfit::Damaged(format!("its step {} at t = {} is none of the run", state.step, state.t))),
        }
    }
}

impl FrontRun {
    /// Before the first step.
    pub(super) fn of(
        name: &str,
        front: Front,
        given: Given,
        (state, schedule): (FrontState, Schedule),
        at: FramesAt,
    ) -> Self {
        let course = FrontCourse {
            state,
            seconds: Spent::default(),
            work: WorkTotal::default(),
            reports: Vec::new(),
            warnings: Vec::new(),
            fronts: Vec::new(),
            phases: Vec::new(),
            pace: None,
            kept: Kept::default(),
        };
        Self { name: name.into(), front, given, schedule, at, course, tables: None }
    }

    /// Both phases of the last good state as one mesh, with the front over it.
    ///
    /// # Errors
    /// [`Error::Failed`] where the front has left its columns.
    pub fn scene(&self) -> Result<Scene> {
        Ok(self.scene_on(&self.mesh()?))
    }

    fn mesh(&self) -> Result<Mesh<2>> {
        self.front.columns.whole(&self.front.shown(&self.course.state).0)
    }

    fn scene_on(&self, mesh: &Mesh<2>) -> Scene {
        let (columns, FrontState { t, step, front, .. }) = (&self.front.columns, &self.course.state);
        let curve = columns.x().iter().zip(front).map(|(x, y)| [*x, *y]).collect();
        let (_, u) = self.front.shown(&self.course.state);
        let [at_nodes, in_cells] = self.front.phases(&self.course.state);
        let nodal = vec![("u".into(), columns.joined(&u)), ("phase".into(), at_nodes)];
        let mut scene = Scene { curve, ..Scene::of_mesh(*t, *step, mesh, nodal) };
        scene.in_cells.push(("phase".into(), Values::Scalars(in_cells)));
        scene
    }

    /// Fronts over time, the last good one among them.
    pub fn picture(&self, title: &str) -> Picture {
        let mut fronts = self.course.fronts.clone();
        if fronts.last().is_none_or(|(t, _)| *t != self.course.state.t) {
            fronts.push((self.course.state.t, self.course.state.front.clone()));
        }
        let all = || fronts.iter().flat_map(|(_, h)| h.iter().copied());
        let (low, high) = (all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max));
        let margin = (0.05 * (high - low)).max(1e-3 * high.abs().max(1e-12));
        let x = self.front.columns.x();
        let last = x[x.len() - 1];
        draw_curves(
            &format!("{title}, the front over time"),
            "t",
            x,
            &fronts,
            [x[0], low - margin],
            [last, high + margin],
        )
    }

    /// The share of the run that is done at a time.
    fn share(&self, t: f64) -> f64 {
        (t - self.schedule.start()) / (self.schedule.end() - self.schedule.start())
    }

    /// Keeps some of the fronts, evenly over the run.
    fn collect(&mut self, t: f64, front: impl FnOnce(&Self) -> Vec<f64>) {
        let kept = self.course.fronts.len();
        if kept == 0 || self.share(t) >= kept as f64 / CURVES as f64 - 1e-9 {
            let front = front(self);
            self.course.fronts.push((t, front));
        }
    }

    /// Shows the state; `dt` is the length of the step that led to it.
    fn tell(&mut self, event: Event, dt: f64, stage: &mut Stage<'_>) -> Result<()> {
        stage.output(|stage| {
            let mut tables = self.tables.take();
            let told = self.show(event, dt, stage, tables.as_mut());
            self.tables = tables;
            told
        })
    }

    fn show(&mut self, event: Event, dt: f64, stage: &mut Stage<'_>, mut tables: Option<&mut Tables>) -> Result<()> {
        let (mesh, seconds) = (self.mesh()?, stage.wall());
        let quality = quality(&mesh, &vec![1.0; mesh.x().len()])?;
        let t = self.course.state.t;
        let report = FrontReport::of(&self.front, &self.given, &self.course.state);
        if matches!(event, Event::Started | Event::Stepped) {
            if let Some(tables) = &mut tables {
                let spent = (self.course.work.work.newton_iterations, seconds);
                let temperatures = self.front.temperatures(&self.course.state);
                tables.write(Row::of(&report, temperatures, dt, quality, spent), &self.course.state.front)?;
            }
            self.collect(t, |run| run.course.state.front.clone());
        }
        // an earlier run that ended here may have made no report
        if self.schedule.reports_at(t) && self.course.reports.last().is_none_or(|report| report.t != t) {
            self.course.reports.push(report);
        }
        let snapshot = Snapshot {
            t,
            step: self.course.state.step,
            dt,
            steps: self.schedule.steps(),
            share: self.share(t),
            smallest: quality.min_scaled_jacobian,
            seconds,
            nodes: mesh.x(),
            scene: &|| self.scene_on(&mesh),
            moving: None,
        };
        stage.show(event, &snapshot, self.course.seconds.parts, |seconds, mut kept| {
            tables.iter_mut().try_for_each(|tables| tables.keep(&mut kept))?;
            Ok(FrontCourse { seconds, kept, ..self.course.clone() })
        })
    }

    /// Time at the end of the next step; none at the end.
    fn next(&self, halvings: i32) -> Option<f64> {
        let (front, state, schedule) = (&self.front, &self.course.state, &self.schedule);
        if !schedule.is_automatic() {
            return schedule.step_from(state.step).map(|_| schedule.time(state.step + 1));
        }
        let slow = || OF_THE_ROOM * front.passage(&self.given, state);
        let dt = match front.stepping {
            // the schedule may lengthen a step by a third
            Stepping::Explicit => (OF_THE_LIMIT * front.limit(state)).min(slow()) * 0.5_f64.powi(halvings),
            Stepping::Implicit => self.course.pace.unwrap_or_else(slow),
        };
        let longest = self.span() / PARTS;
        schedule.after(state.t, dt.min(longest))
    }

    /// Warns of a front whose way depends on how many rows there are.
    fn warn_at_end(&mut self) {
        const DOUBTFUL: f64 = 0.01;
        let doubt = self.front.doubt(&self.course.state).filter(|doubt| *doubt > DOUBTFUL);
        let said = doubt.map(|doubt| {
            let (percent, [rows, way]) = (100.0 * doubt, [self.course.state.way[1], self.course.state.way[0]]);
            if doubt > rows / way {
                return format!(
                    "the front may have gone too far or not far enough by {percent:.1} % of its way: growth into this \
                     melt turns on the last per cent of the heat, and its balance misses more; raise grid.cells"
                );
            }
            format!(
                "gradients at the front over four rows in place of three would change its way by {percent:.1} %: rows \
                 there are too few for the temperature; raise grid.cells or grid.grading"
            )
        });
        self.course.warnings.extend(said.filter(|said| !self.course.warnings.contains(said)));
    }

    fn span(&self) -> f64 {
        self.schedule.end() - self.schedule.start()
    }

    /// Whether an automatic step of this length with this error will do; sets the length of the next one.
    fn judge(&mut self, dt: f64, error: Option<f64>, rejections: usize) -> bool {
        let Some(error) = error.filter(|_| self.schedule.is_automatic()) else { return true };
        let [shorter, longer] = PACE;
        let next = dt * (0.9 * (TOLERANCE / error).cbrt()).clamp(shorter, longer);
        let good = error <= TOLERANCE || rejections == REJECTIONS;
        // a step that ends at a report may be shorter than it could be
        let before = self.course.pace.filter(|before| good && dt < *before).unwrap_or(0.0);
        self.course.pace = Some(next.max(before));
        good
    }
}

impl Running for FrontRun {
    type Figures = FrontSummary;
    type Checkpoint = FrontCourse;

    fn go(&mut self, stage: &mut Stage<'_>) -> Result<()> {
        if self.tables.is_none() {
            let x = self.front.columns.x();
            self.tables = stage.directory.map(|to| Tables::create(to.path(), x)).transpose()?;
        }
        self.tell(stage.begins, 0.0, stage)?;
        let (mut halvings, mut rejections) = (0, 0);
        while let Some(t) = self.next(halvings) {
            let (began, dt) = (Instant::now(), t - self.course.state.t);
            let attempt = self.front.attempt(&self.given, &self.course.state, t);
            self.course.seconds.parts.pde += began.elapsed().as_secs_f64();
            let Attempt { state, work, error, event } = match attempt {
                Ok(attempt) => attempt,
                // the state is as it was
                Err(Error::Failed { .. })
                    if self.schedule.is_automatic() && halvings < HALVINGS && dt > SHORTEST * self.span() =>
                {
                    halvings += 1;
                    self.course.pace = Some(0.5 * dt);
                    self.course.work.rejected_steps += 1;
                    continue;
                }
                Err(Error::Failed { failure, .. }) => {
                    let moment = Some(Moment { t, step: self.course.state.step + 1 });
                    return Err(Error::Failed { failure, moment });
                }
                Err(other) => return Err(other),
            };
            self.course.work.work += work;
            if !self.judge(dt, error, rejections) {
                rejections += 1;
                self.course.work.rejected_steps += 1;
                continue;
            }
            (halvings, rejections) = (0, 0);
            self.course.state = state;
            self.course.phases.extend(event);
            self.course.work.steps += 1;
            self.tell(Event::Stepped, dt, stage)?;
        }
        self.tell(Event::Finished, 0.0, stage)?;
        self.warn_at_end();
        Ok(())
    }

    fn resume(&mut self, found: FrontCourse, directory: Option<&Path>) -> Result<(SpentBy<Self>, Kept), Unfit> {
        found.check(self)?;
        self.course = found;
        let (seconds, kept) = (self.course.seconds, std::mem::take(&mut self.course.kept));
        self.tables = directory.map(|to| Tables::resume(to, &kept)).transpose()?;
        Ok((seconds, kept))
    }

    fn schedule(&mut self) -> Option<&mut Schedule> {
        Some(&mut self.schedule)
    }

    /// Chooses the fronts of the picture from all of them, as a run to this end would have.
    fn lengthen(&mut self, directory: &Path) -> Result<(), Unfit> {
        let fronts = Tables::fronts(directory)?;
        let heights: Vec<[f64; 1]> = fronts.iter().flatten().map(|height| [*height]).collect();
        check_nodal("front.csv", &heights, fronts.len() * (self.front.columns.x().len() + 1))?;
        self.course.fronts.clear();
        fronts.iter().for_each(|row| self.collect(row[0], |_| row[1..].to_vec()));
        Ok(())
    }

    fn frames(&self) -> (FramesAt, [usize; 2]) {
        (self.at.clone(), [1, 1])
    }

    fn scenes(&self) -> Result<Vec<Scene>> {
        Ok(vec![self.scene()?])
    }

    fn leave(&mut self, directory: &RunDirectory) -> Result<()> {
        self.picture(&self.name).write(directory.path(), "front")
    }

    fn tell(&self, summary: &mut Summary<FrontSummary>) {
        let FrontCourse { seconds, work, reports, warnings, phases, .. } = self.course.clone();
        summary.figures = FrontSummary { work, reports, phases };
        (summary.seconds, summary.warnings) = (seconds, warnings);
    }

    fn warn(&mut self, warnings: Vec<String>) {
        self.course.warnings.extend(warnings);
    }
}

// the phases are told by number where a study tells them by name
const _: () = assert!(LOWER == 0 && UPPER == 1);
