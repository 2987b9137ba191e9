//! Studies of kind `stefan`: the one time loop of all problems with fronts.

use super::front_figures::{FrontParts, FrontReport, FrontSummary};
use super::fronts::{Fronts, Progress, View};
use super::kind::{Running, SpentBy};
use super::runner::Stage;
use crate::error::{Error, Moment, Result, Unfit};
use crate::kept::{Kept, check_nodal};
use crate::output::{FramesAt, Picture, Rows, RunDirectory, Spent, Summary, names};
use crate::simulation::{Event, Scene, Schedule, Snapshot, WorkTotal, timed};
use crate::stefan::{Attempt, FrontState, PhaseEvent};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Automatic steps are at most the whole run over this number, which bounds what formulas of time may hide in a step.
const PARTS: f64 = 50.0;
/// Automatic steps that are shorter than this share of the run are not halved again.
const SHORTEST: f64 = 1e-7;

/// A problem with fronts while it runs.
pub struct TimeLoop<F: Fronts> {
    name: String,
    /// The problem.
    pub problem: F,
    schedule: Schedule,
    at: FramesAt,
    /// How far it came.
    pub course: FrontCourse<F::State, F::Report>,
    /// Those of [`Fronts::TABLES`]; none before the first step, and where nothing is written.
    tables: Vec<Rows>,
}

/// Everything that the steps of a run to come depend on, and what was found in those done.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct FrontCourse<S = FrontState, R = FrontReport> {
    /// The last good state.
    pub state: S,
    seconds: Spent<FrontParts>,
    /// Steps and their cost.
    pub work: WorkTotal,
    /// One entry for each time of `time.report` that was reached.
    pub reports: Vec<R>,
    warnings: Vec<String>,
    /// Times and places of fronts for the picture.
    // older checkpoints of fronts between species have it as `path`, and no phases
    #[serde(alias = "path")]
    fronts: Vec<(f64, Vec<f64>)>,
    /// Phases that have appeared or vanished.
    #[serde(default)]
    pub phases: Vec<PhaseEvent>,
    /// Length of the next automatic step, where an estimated error decides it; none before the first.
    pace: Option<f64>,
    /// In a checkpoint, what frames, tables and observers carry; empty in a run.
    kept: Kept,
}

impl<F: Fronts> TimeLoop<F> {
    /// Before the first step.
    pub(super) fn of(name: &str, problem: F, (state, schedule): (F::State, Schedule), at: FramesAt) -> Self {
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
        Self { name: name.into(), problem, schedule, at, course, tables: Vec::new() }
    }

    /// The last good state as what can be drawn and written.
    ///
    /// # Errors
    /// [`Error::Failed`] where the front has left the mesh.
    pub fn scene(&self) -> Result<Scene> {
        self.problem.scene(&self.course.state)
    }

    /// Fronts over time, the last good one among them.
    pub fn picture(&self, title: &str) -> Picture {
        let FrontCourse { state, fronts, .. } = &self.course;
        let (mut fronts, t) = (fronts.clone(), F::moment(state).t);
        if fronts.last().is_none_or(|(last, _)| *last != t) {
            fronts.push((t, self.problem.places(state).to_vec()));
        }
        self.problem.picture(title, &fronts)
    }

    /// Shows the state; `dt` is the length of the step that led to it.
    fn show(&mut self, event: Event, dt: f64, stage: &mut Stage<'_>) -> Result<()> {
        stage.output(|stage| {
            let Self { problem, schedule, course, tables, .. } = self;
            let (Moment { t, step }, seconds) = (F::moment(&course.state), stage.wall());
            let is_new = matches!(event, Event::Started | Event::Stepped);
            let progress = Progress { dt, newton_iterations: course.work.work.newton_iterations, seconds };
            let rows = if is_new { &mut tables[..] } else { &mut [] };
            let View { report, smallest, nodes, scene } = problem.view(&course.state, progress, rows)?;
            let share = schedule.share(t);
            if is_new && is_pictured(F::PICTURED, course.fronts.len(), share) {
                course.fronts.push((t, problem.places(&course.state).to_vec()));
            }
            // an earlier run that ended here may have made no report
            if schedule.reports_at(t) && course.reports.last().is_none_or(|report| F::reported(report) != t) {
                course.reports.push(report);
            }
            let steps = schedule.steps();
            let snapshot =
                Snapshot { t, step, dt, steps, share, smallest, seconds, nodes: &nodes, scene: &scene, moving: None };
            stage.show(event, &snapshot, course.seconds.parts, |seconds, mut kept| {
                tables.iter_mut().try_for_each(|table| table.keep(&mut kept))?;
                Ok(FrontCourse { seconds, kept, ..course.clone() })
            })
        })
    }

    /// Time at the end of the next step; none at the end.
    fn next(&self, halvings: i32) -> Option<f64> {
        let (schedule, state) = (&self.schedule, &self.course.state);
        let Moment { t, step } = F::moment(state);
        if !schedule.is_automatic() {
            return schedule.step_from(step).map(|_| schedule.time(step + 1));
        }
        let dt = self.problem.step_length(state, self.course.pace, halvings, schedule.span());
        schedule.after(t, dt.min(schedule.span() / PARTS))
    }

    /// Whether a step of this length that failed may be tried again with half of it.
    fn may_halve(&self, dt: f64, halvings: i32) -> bool {
        let Self { schedule, .. } = self;
        schedule.is_automatic() && halvings < F::CONTROLLER.halvings && dt > SHORTEST * schedule.span()
    }
}

/// Whether the picture shows another front, with `there` of them up to this share of the run.
fn is_pictured(most: Option<usize>, there: usize, share: f64) -> bool {
    most.is_none_or(|most| there == 0 || share >= there as f64 / most as f64 - 1e-9)
}

impl<F: Fronts> Running for TimeLoop<F> {
    type Figures = FrontSummary<F::Report>;
    type Checkpoint = FrontCourse<F::State, F::Report>;

    fn go(&mut self, stage: &mut Stage<'_>) -> Result<()> {
        if let Some(to) = stage.directory.filter(|_| self.tables.is_empty()) {
            let create = |name: &&str| Rows::create(&to.path().join(name));
            self.tables = F::TABLES.iter().map(create).collect::<Result<_>>()?;
            self.problem.write_heads(&mut self.tables)?;
        }
        self.show(stage.begins, 0.0, stage)?;
        let (mut halvings, mut rejections) = (0, 0);
        while let Some(t) = self.next(halvings) {
            let Self { problem, course, .. } = self;
            let Moment { t: before, step } = F::moment(&course.state);
            let dt = t - before;
            let Attempt { state, work, error, event } =
                match timed(&mut course.seconds.parts.pde, || problem.attempt(&course.state, t)) {
                    Err(Error::Failed { .. }) if self.may_halve(dt, halvings) => {
                        halvings += 1;
                        self.course.pace = Some(0.5 * dt);
                        self.course.work.rejected_steps += 1;
                        continue;
                    }
                    Err(Error::Failed { failure, .. }) => {
                        return Err(Error::Failed { failure, moment: Some(Moment { t, step: step + 1 }) });
                    }
                    attempted => attempted?,
                };
            self.course.work.work += work;
            let judged = error.filter(|_| self.schedule.is_automatic());
            let judge = |error| F::CONTROLLER.judge(dt, error, rejections, &mut self.course.pace);
            if !judged.is_none_or(judge) {
                rejections += 1;
                self.course.work.rejected_steps += 1;
                continue;
            }
            (halvings, rejections) = (0, 0);
            self.course.state = state;
            self.course.phases.extend(event);
            self.course.work.steps += 1;
            self.show(Event::Stepped, dt, stage)?;
        }
        self.show(Event::Finished, 0.0, stage)?;
        let doubt = self.problem.doubt(&self.course.state);
        self.course.warnings.extend(doubt.filter(|doubt| !self.course.warnings.contains(doubt)));
        Ok(())
    }

    fn resume(
        &mut self,
        mut found: Self::Checkpoint,
        directory: Option<&Path>,
    ) -> Result<(SpentBy<Self>, Kept), Unfit> {
        self.problem.check(&found.state)?;
        let (Moment { t, step }, places) = (F::moment(&found.state), self.problem.places(&found.state).len());
        for (t, front) in &found.fronts {
            check_nodal("time of a front", &[[*t]], 1)?;
            check_nodal("front", front.as_chunks::<1>().0, places)?;
        }
        if !self.schedule.meets(step, t) {
            return Err(Unfit::Damaged(format!("its step {step} at t = {t} is none of the run")));
        }
        let kept = std::mem::take(&mut found.kept);
        let tables = directory.into_iter().flat_map(|to| F::TABLES.iter().map(|name| Rows::resume(to, name, &kept)));
        self.tables = tables.collect::<Result<_, _>>()?;
        self.course = found;
        Ok((self.course.seconds, kept))
    }

    fn schedule(&mut self) -> Option<&mut Schedule> {
        Some(&mut self.schedule)
    }

    /// Chooses the fronts of the picture from all of them, as a run to this end would have.
    fn lengthen(&mut self, directory: &Path) -> Result<(), Unfit> {
        if F::PICTURED.is_none() {
            return Ok(());
        }
        let written = self.problem.written(directory)?;
        let fronts = &mut self.course.fronts;
        fronts.clear();
        for (t, front) in written {
            if is_pictured(F::PICTURED, fronts.len(), self.schedule.share(t)) {
                fronts.push((t, front));
            }
        }
        Ok(())
    }

    fn frames(&self) -> (FramesAt, [usize; 2]) {
        (self.at.clone(), [1, 1])
    }

    fn scenes(&self) -> Result<Vec<Scene>> {
        Ok(vec![self.scene()?])
    }

    fn leave(&mut self, directory: &RunDirectory) -> Result<()> {
        self.problem.leave(&self.course.state, directory)?;
        self.picture(&self.name).write(directory.path(), names::FRONT)
    }

    fn tell(&self, summary: &mut Summary<Self::Figures>) {
        let FrontCourse { seconds, work, reports, warnings, phases, .. } = self.course.clone();
        summary.figures = FrontSummary { work, reports, phases };
        (summary.seconds, summary.warnings) = (seconds, warnings);
    }

    fn warn(&mut self, warnings: Vec<String>) {
        self.course.warnings.extend(warnings);
    }
}
