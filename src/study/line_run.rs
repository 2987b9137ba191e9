//! Studies of kind `equidistribution`: how they run.

use super::EquidistributionStudy;
use super::kind::{Running, SpentBy};
use super::line_figures::{LineFigures, LineParts, StepRow, shortest};
use super::line_files::{keep, scene, write_history};
use super::runner::Stage;
use crate::equidistribution::{History, Line, Method, Settled};
use crate::error::{Error, Moment, Result, Unfit};
use crate::kept::{Kept, check_nodal};
use crate::output::{FramesAt, RunDirectory, Spent, Summary};
use crate::simulation::{Event, Scene, Schedule, Snapshot};
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::time::Instant;

/// What was computed, as far as it came.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct Evolution {
    /// Times of the meshes kept, the first and the last among them; 0 and 0 where there is no time.
    pub times: Vec<f64>,
    /// The meshes.
    pub meshes: Vec<Vec<f64>>,
    /// The steps that led to them.
    pub kept: Vec<usize>,
    /// How each step went, in a line; without subdomains of steps in time only.
    pub steps: Vec<StepRow>,
    /// The last of these iterations.
    pub last: Option<History>,
    /// Steps done.
    pub done: usize,
    /// The mesh after them, from which the next one starts.
    pub newest: Vec<f64>,
    /// Linear solves in them.
    pub linear_solves: usize,
    /// What the user should know although nothing failed.
    #[serde(default)]
    pub warnings: Vec<String>,
}

/// What a run in time goes on from.
#[derive(Serialize, Deserialize)]
pub struct LineCheckpoint {
    evolution: Evolution,
    seconds: Spent<LineParts>,
    kept: Kept,
}

/// Seconds between two writings of `history.csv` while a mesh moves: what a report of a run that still goes on lacks at
/// most.
const SECONDS_UNSEEN: f64 = 1.0;

/// A line while its mesh is found, or moves.
pub struct LineRun {
    study: EquidistributionStudy,
    line: Line,
    /// The times of all steps; none where the mesh does not move.
    schedule: Option<Schedule>,
    divided: Option<(Method, Vec<[usize; 2]>)>,
    /// What was computed.
    pub evolution: Evolution,
    figures: LineFigures,
    parts: LineParts,
    warnings: Vec<String>,
}

impl LineRun {
    /// Before anything is computed.
    pub(super) fn of(study: &EquidistributionStudy) -> Result<Self> {
        Ok(Self {
            study: study.clone(),
            line: study.problem()?,
            schedule: study.time.map(|time| time.schedule()).transpose()?,
            divided: study.decomposition()?,
            evolution: Evolution::default(),
            figures: LineFigures::default(),
            parts: LineParts::default(),
            warnings: Vec::new(),
        })
    }

    /// The time after a number of steps; 0 where the mesh does not move.
    fn time(&self, step: usize) -> f64 {
        self.schedule.as_ref().map_or(0.0, |schedule| schedule.time(step))
    }

    /// Finds the mesh at the start.
    fn start(&mut self) -> Result<()> {
        let start = self.time(0);
        self.evolution.newest = match self.study.given_start()? {
            Some(mesh) => mesh,
            None => self.evolution.settled(self.line.settled(start)?).0,
        };
        self.evolution.keep(start);
        Ok(())
    }

    /// Finds the mesh after the next step, which is the only one where the mesh does not move.
    fn step(&mut self) -> Result<()> {
        let step = self.evolution.done + 1;
        let [before, t] = [self.time(step - 1), self.time(step)];
        let in_time = self.study.time;
        let during = |error: Error| match (error, in_time) {
            (Error::Failed { failure, .. }, Some(_)) => Error::Failed { failure, moment: Some(Moment { t, step }) },
            (other, _) => other,
        };
        let (last, line, evolution) = (step == self.steps(), &self.line, &mut self.evolution);
        let mesh = std::mem::take(&mut evolution.newest);
        let old = in_time.map(|time| (mesh.as_slice(), time.relaxation / (t - before)));
        evolution.newest = match &self.divided {
            None => {
                let (next, solves) = match old {
                    Some(_) => line.solve(t, &mesh, old).map_err(during)?,
                    None => evolution.settled(line.settled(t)?),
                };
                evolution.linear_solves += solves;
                if in_time.is_some() {
                    evolution.steps.push(StepRow::new(line, t, &next, solves).map_err(during)?);
                }
                next
            }
            Some((method, ranges)) => {
                let until = self.study.until();
                let history = line.iterate(t, ranges, *method, &mesh, old, until).map_err(during)?;
                let (next, missed) = (history.mesh.clone(), history.missed(*method, until));
                evolution.tell(line, t, history).map_err(during)?;
                if let Some(failure) = missed {
                    return Err(during(failure.into()));
                }
                next
            }
        };
        evolution.done = step;
        let kept = self.study.output.frames.as_ref().is_none_or(|frames| frames.due(step, t, t - before));
        if kept || last {
            evolution.keep(t);
        }
        Ok(())
    }

    /// Steps of the whole run; one solve where the mesh does not move.
    fn steps(&self) -> usize {
        self.schedule.as_ref().and_then(Schedule::steps).unwrap_or(1)
    }

    /// Shows the newest mesh; `dt` is the length of the step that led to it.
    fn tell(&mut self, event: Event, dt: f64, stage: &mut Stage<'_>) -> Result<()> {
        let Evolution { done: step, newest, .. } = &self.evolution;
        let t = self.time(*step);
        let snapshot = Snapshot {
            t,
            step: *step,
            dt,
            steps: Some(self.steps()),
            share: self.schedule.as_ref().map_or(0.0, |schedule| schedule.share(t)),
            smallest: shortest(&self.line, newest),
            seconds: stage.wall(),
            nodes: &[],
            scene: &|| self.scene((*step, t), t, newest),
            moving: None,
        };
        let told = stage.output(|stage| {
            stage.show(event, &snapshot, self.parts, |seconds, kept| {
                Ok(LineCheckpoint { evolution: self.evolution.clone(), seconds, kept })
            })
        });
        if matches!(told, Err(Error::Interrupted(_))) && self.evolution.times.last() != Some(&t) {
            self.evolution.keep(t);
        }
        told
    }

    /// A mesh at time t, shown with a number and at a place on the axis of time of its own.
    fn scene(&self, shown: (usize, f64), t: f64, mesh: &[f64]) -> Scene {
        let ranges = self.divided.as_ref().map_or(&[][..], |(_, ranges)| ranges);
        scene(&self.line, shown, t, mesh, ranges)
    }

    /// The iterates of the only solve, as far as they are kept, and the last one.
    fn iterates(&self, history: &History) -> Vec<Scene> {
        let last = (history.count(), history.mesh.as_slice());
        let path = history.path.iter().map(|(n, mesh)| (*n, mesh.as_slice())).filter(|(n, _)| *n < last.0);
        path.chain([last]).map(|(n, mesh)| self.scene((n, n as f64), 0.0, mesh)).collect()
    }

    /// Counts the seconds of solving.
    fn solving(&mut self, solve: impl FnOnce(&mut Self) -> Result<()>) -> Result<()> {
        let began = Instant::now();
        let solved = solve(self);
        self.parts.mesh += began.elapsed().as_secs_f64();
        solved
    }
}

impl Running for LineRun {
    type Figures = LineFigures;
    type Checkpoint = LineCheckpoint;

    fn go(&mut self, stage: &mut Stage<'_>) -> Result<()> {
        let in_time = self.schedule.is_some();
        if self.evolution.newest.is_empty() {
            self.solving(Self::start)?;
        }
        if in_time {
            self.tell(stage.begins, 0.0, stage)?;
        }
        let mut looked = Instant::now();
        while self.evolution.done < self.steps() {
            self.solving(Self::step)?;
            if !in_time {
                continue;
            }
            let dt = self.time(self.evolution.done) - self.time(self.evolution.done - 1);
            self.tell(Event::Stepped, dt, stage)?;
            // what a report of a run that goes on or is killed can show
            if let Some(directory) = stage.directory.filter(|_| looked.elapsed().as_secs_f64() > SECONDS_UNSEEN) {
                stage.output(|_| write_history(&self.study, directory, &self.evolution))?;
                looked = Instant::now();
            }
        }
        if in_time { self.tell(Event::Finished, 0.0, stage) } else { Ok(()) }
    }

    fn resume(&mut self, found: LineCheckpoint, _directory: Option<&Path>) -> Result<(SpentBy<Self>, Kept), Unfit> {
        let LineCheckpoint { evolution, seconds, kept } = found;
        evolution.check(self)?;
        (self.evolution, self.parts) = (evolution, seconds.parts);
        Ok((seconds, kept))
    }

    fn schedule(&mut self) -> Option<&mut Schedule> {
        self.schedule.as_mut()
    }

    /// The last mesh is kept whether a frame is due or not.
    fn lengthen(&mut self, _directory: &Path) -> Result<(), Unfit> {
        let done = self.evolution.done;
        let [before, t] = [done.saturating_sub(1), done].map(|step| self.time(step));
        let due = self.study.output.frames.as_ref().is_none_or(|frames| frames.due(done, t, t - before));
        let Evolution { times, meshes, kept, .. } = &mut self.evolution;
        if !due && done > 0 && kept.last() == Some(&done) {
            times.pop();
            meshes.pop();
            kept.pop();
        }
        Ok(())
    }

    fn frames(&self) -> (FramesAt, [usize; 2]) {
        (self.study.output.frames.clone().unwrap_or(FramesAt::Every(1)), [1, 1])
    }

    fn scenes(&self) -> Result<Vec<Scene>> {
        let Evolution { times, meshes, kept, last, .. } = &self.evolution;
        Ok(match (&self.schedule, last) {
            (Some(_), _) => match (kept.last(), times.last(), meshes.last()) {
                (Some(step), Some(t), Some(mesh)) => vec![self.scene((*step, *t), *t, mesh)],
                _ => Vec::new(),
            },
            (None, Some(history)) => self.iterates(history),
            (None, None) => meshes.last().iter().map(|mesh| self.scene((0, 0.0), 0.0, mesh)).collect(),
        })
    }

    fn leave(&mut self, directory: &RunDirectory) -> Result<()> {
        let unseen = self.figures.tell(&self.study, &self.line, &self.evolution);
        let written = write_history(&self.study, directory, &self.evolution)
            .and_then(|()| keep(&self.study, &self.line, directory, &self.evolution));
        self.evolution.warnings.extend(unseen?);
        written
    }

    fn tell(&self, summary: &mut Summary<LineFigures>) {
        (summary.figures, summary.seconds.parts) = (self.figures.clone(), self.parts);
        summary.warnings = [&self.evolution.warnings[..], &self.warnings].concat();
    }

    fn warn(&mut self, warnings: Vec<String>) {
        self.warnings.extend(warnings);
    }
}

impl Evolution {
    /// Refuses what cannot have been computed in a run.
    fn check(&self, LineRun { line, schedule, divided, .. }: &LineRun) -> Result<(), Unfit> {
        let Self { times, meshes, kept, steps, last, done, newest, .. } = self;
        let nodes = |mesh: &Vec<f64>| check_nodal("mesh", mesh.as_chunks::<1>().0, line.cells + 1);
        let glued = last.iter().flat_map(|history| [&history.mesh, &history.reference]);
        meshes.iter().chain([newest]).chain(glued).try_for_each(nodes)?;
        let counted = schedule.as_ref().and_then(Schedule::steps).is_some_and(|steps| *done <= steps)
            && [times.len(), kept.len()] == [meshes.len(); 2]
            && !times.is_empty()
            && steps.len() == *done
            && last.is_some() == (divided.is_some() && *done > 0)
            && last.as_ref().is_none_or(|history| !history.iterates.is_empty());
        match counted && newest.is_sorted_by(|a, b| a < b) {
            true => Ok(()),
            false => Err(Unfit::Damaged(format!("its meshes of {done} steps are none of the run"))),
        }
    }

    /// The mesh of the whole line with its linear solves; a warning where it is not what was asked for.
    fn settled(&mut self, Settled { mesh, linear_solves, stalled }: Settled) -> (Vec<f64>, usize) {
        let warn = |failure| {
            format!(
                "`equidistribution.face_density`: {failure}; the nodes are those of \"exact\", which a density that \
                 jumps or peaks \
                 within a cell has always"
            )
        };
        self.warnings = stalled.map(warn).into_iter().collect();
        (mesh, linear_solves)
    }

    /// Keeps the newest mesh, of this time.
    fn keep(&mut self, t: f64) {
        self.times.push(t);
        self.meshes.push(self.newest.clone());
        self.kept.push(self.done);
    }

    fn tell(&mut self, line: &Line, t: f64, history: History) -> Result<()> {
        let last = history.iterates[history.count()];
        let row = StepRow::new(line, t, &history.mesh, history.count());
        let (observed_rate, bound) = (history.observed, history.prediction.bound);
        self.linear_solves += last.linear_solves;
        self.last = Some(history);
        self.steps.push(StepRow { error_linf: Some(last.error), observed_rate, bound, ..row? });
        Ok(())
    }

    /// The last mesh; that of an iteration which missed its tolerance, where one did.
    pub fn mesh(&self) -> &[f64] {
        match &self.last {
            Some(history) => &history.mesh,
            None => self.meshes.last().map_or(&[], Vec::as_slice),
        }
    }
}
