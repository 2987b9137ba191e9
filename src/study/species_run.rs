//! Studies of kind `stefan` with `[species]`: how they run.

use super::front_figures::FrontParts;
use super::kind::{Running, SpentBy};
use super::runner::Stage;
use super::species_figures::{SpeciesReport, SpeciesSummary, Table};
use crate::error::{Error, Moment, Result, Unfit};
use crate::kept::Kept;
use crate::output::{Curve, Figure, FramesAt, RunDirectory, Scale, Spent, Summary, final_arrays};
use crate::simulation::{Event, Scene, Schedule, Snapshot, Values, WorkTotal};
use crate::species::{Species, SpeciesState};
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::time::Instant;

/// The estimated error of an automatic step.
const TOLERANCE: f64 = 1e-5;
/// How much shorter and longer than an automatic step the next one may be.
const PACE: [f64; 2] = [0.2, 2.0];
/// The first automatic step, as a share of the run.
const FIRST: f64 = 1e-5;
/// Automatic steps are at most the whole run over this number, which bounds what formulas of time may hide in a step.
const PARTS: f64 = 50.0;
/// How often an automatic step that fails is halved before the run fails.
const HALVINGS: usize = 12;
/// Automatic steps that are shorter than this share of the run are not halved again.
const SHORTEST: f64 = 1e-7;
/// How often an automatic step with too large an error is shortened before it is taken as it is.
const REJECTIONS: usize = 12;

/// Fronts between species while they run.
pub struct SpeciesRun {
    name: String,
    /// The problem.
    pub species: Species,
    schedule: Schedule,
    at: FramesAt,
    /// How far it came.
    pub course: SpeciesCourse,
    table: Option<Table>,
}

/// Everything that the steps of a run to come depend on, and what was found in those done.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct SpeciesCourse {
    /// The last good state.
    pub state: SpeciesState,
    seconds: Spent<FrontParts>,
    /// Steps and their cost.
    pub work: WorkTotal,
    /// One entry for each time of `time.report` that was reached.
    pub reports: Vec<SpeciesReport>,
    warnings: Vec<String>,
    /// Times and places of the fronts.
    path: Vec<(f64, Vec<f64>)>,
    /// Length of the next automatic step; none before the first.
    pace: Option<f64>,
    /// In a checkpoint, what frames, tables and observers carry; empty in a run.
    kept: Kept,
}

impl SpeciesRun {
    /// Before the first step.
    pub(super) fn of(name: &str, species: Species, (state, schedule): (SpeciesState, Schedule), at: FramesAt) -> Self {
        let course = SpeciesCourse {
            state,
            seconds: Spent::default(),
            work: WorkTotal::default(),
            reports: Vec::new(),
            warnings: Vec::new(),
            path: Vec::new(),
            pace: None,
            kept: Kept::default(),
        };
        Self { name: name.into(), species, schedule, at, course, table: None }
    }

    /// Every phase with its species, and the phase by number; places of fronts occur twice.
    pub fn scene(&self) -> Scene {
        let state = &self.course.state;
        let (x, phases, values) = self.species.profile(state);
        let names = self.species.names.species().iter().cloned();
        let mut nodal: Vec<(String, Values)> = names.zip(values.into_iter().map(Values::Scalars)).collect();
        nodal.push(("phase".into(), Values::Scalars(phases.into_iter().map(|phase| phase as f64).collect())));
        let [lower, upper] = self.species.walls;
        Scene {
            t: state.t,
            step: state.step,
            cells: [x.len() - 1, 0],
            periodic: [false; 2],
            closed: [false; 2],
            lower: [lower, 0.0],
            extent: [upper - lower, 0.0],
            points: x.into_iter().map(|[x]| [x, 0.0]).collect(),
            nodal,
            density: None,
            in_cells: Vec::new(),
            curve: Vec::new(),
        }
    }

    fn span(&self) -> f64 {
        self.schedule.end() - self.schedule.start()
    }

    /// Shows the state; `dt` is the length of the step that led to it.
    fn tell(&mut self, event: Event, dt: f64, stage: &mut Stage<'_>) -> Result<()> {
        stage.output(|stage| {
            let mut table = self.table.take();
            let told = self.show(event, dt, stage, table.as_mut());
            self.table = table;
            told
        })
    }

    fn show(&mut self, event: Event, dt: f64, stage: &mut Stage<'_>, mut table: Option<&mut Table>) -> Result<()> {
        let (state, seconds) = (&self.course.state, stage.wall());
        let t = state.t;
        let report = SpeciesReport::of(&self.species, state);
        if matches!(event, Event::Started | Event::Stepped) {
            if let Some(table) = &mut table {
                table.write(&report, dt, (self.course.work.work.newton_iterations, seconds))?;
            }
            self.course.path.push((t, report.front.x.clone()));
        }
        // an earlier run that ended here may have made no report
        if self.schedule.reports_at(t) && self.course.reports.last().is_none_or(|report| report.t != t) {
            self.course.reports.push(report);
        }
        let thinnest = self.species.widths_at(&self.course.state).into_iter().fold(f64::INFINITY, f64::min);
        let snapshot = Snapshot {
            t,
            step: self.course.state.step,
            dt,
            steps: self.schedule.steps(),
            share: (t - self.schedule.start()) / self.span(),
            smallest: thinnest,
            seconds,
            nodes: &[],
            scene: &|| self.scene(),
            moving: None,
        };
        stage.show(event, &snapshot, self.course.seconds.parts, |seconds, mut kept| {
            table.iter_mut().try_for_each(|table| table.keep(&mut kept))?;
            Ok(SpeciesCourse { seconds, kept, ..self.course.clone() })
        })
    }

    /// Time at the end of the next step; none at the end.
    fn next(&self) -> Option<f64> {
        let (state, schedule) = (&self.course.state, &self.schedule);
        if !schedule.is_automatic() {
            return schedule.step_from(state.step).map(|_| schedule.time(state.step + 1));
        }
        let dt = self.course.pace.unwrap_or(FIRST * self.span());
        schedule.after(state.t, dt.min(self.span() / PARTS))
    }

    /// Whether an automatic step of this length with this error will do; sets the length of the next one.
    fn judge(&mut self, dt: f64, error: f64, rejections: usize) -> bool {
        if !self.schedule.is_automatic() {
            return true;
        }
        let [shorter, longer] = PACE;
        let next = dt * (0.9 * (TOLERANCE / error).sqrt()).clamp(shorter, longer);
        let good = error <= TOLERANCE || rejections == REJECTIONS;
        // a step that ends at a report may be shorter than it could be
        let before = self.course.pace.filter(|before| good && dt < *before).unwrap_or(0.0);
        self.course.pace = Some(next.max(before));
        good
    }

    /// Places of the fronts over time.
    fn figure(&self) -> Figure {
        let path = &self.course.path;
        let curve = |k: usize| Curve {
            name: if self.species.laws.len() == 1 { String::new() } else { format!("front {}", k + 1) },
            points: path.iter().map(|(t, x)| [*t, x[k]]).collect(),
            plain: true,
            ..Curve::default()
        };
        Figure {
            title: format!("{}, the front over time", self.name),
            labels: ["t".into(), "x".into()],
            scales: [Scale::Linear; 2],
            curves: (0..self.species.laws.len()).map(curve).map(Curve::outlined).collect(),
            room: Vec::new(),
        }
    }
}

impl Running for SpeciesRun {
    type Figures = SpeciesSummary;
    type Checkpoint = SpeciesCourse;

    fn go(&mut self, stage: &mut Stage<'_>) -> Result<()> {
        if self.table.is_none() {
            self.table = stage.directory.map(|to| Table::create(to.path(), &self.species)).transpose()?;
        }
        self.tell(stage.begins, 0.0, stage)?;
        let (mut halvings, mut rejections) = (0, 0);
        while let Some(t) = self.next() {
            let (began, dt) = (Instant::now(), t - self.course.state.t);
            let attempt = self.species.attempt(&self.course.state, t);
            self.course.seconds.parts.pde += began.elapsed().as_secs_f64();
            let attempt = match attempt {
                Ok(attempt) => attempt,
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
            self.course.work.work += attempt.work;
            if !self.judge(dt, attempt.error, rejections) {
                rejections += 1;
                self.course.work.rejected_steps += 1;
                continue;
            }
            (halvings, rejections) = (0, 0);
            self.course.state = attempt.state;
            self.course.work.steps += 1;
            self.tell(Event::Stepped, dt, stage)?;
        }
        self.tell(Event::Finished, 0.0, stage)
    }

    fn resume(&mut self, found: SpeciesCourse, directory: Option<&Path>) -> Result<(SpentBy<Self>, Kept), Unfit> {
        let (state, fronts) = (&found.state, self.species.laws.len());
        if !self.species.knows(state) || found.path.iter().any(|(_, x)| x.len() != fronts) {
            return Err(Unfit::Damaged("its state is none of the study".into()));
        }
        if !self.schedule.meets(state.step, state.t) {
            return Err(Unfit::Damaged(format!("its step {} at t = {} is none of the run", state.step, state.t)));
        }
        self.course = found;
        let (seconds, kept) = (self.course.seconds, std::mem::take(&mut self.course.kept));
        self.table = directory.map(|to| Table::resume(to, &kept)).transpose()?;
        Ok((seconds, kept))
    }

    fn schedule(&mut self) -> Option<&mut Schedule> {
        Some(&mut self.schedule)
    }

    fn frames(&self) -> (FramesAt, [usize; 2]) {
        (self.at.clone(), [1, 1])
    }

    fn scenes(&self) -> Result<Vec<Scene>> {
        Ok(vec![self.scene()])
    }

    fn leave(&mut self, directory: &RunDirectory) -> Result<()> {
        directory.write("final.npz", &final_arrays(&self.scene()))?;
        self.figure().draw().write(directory.path(), "front")
    }

    fn tell(&self, summary: &mut Summary<SpeciesSummary>) {
        let SpeciesCourse { seconds, work, reports, warnings, .. } = self.course.clone();
        summary.figures = SpeciesSummary { work, reports };
        (summary.seconds, summary.warnings) = (seconds, warnings);
    }

    fn warn(&mut self, warnings: Vec<String>) {
        self.course.warnings.extend(warnings);
    }
}
