//! Studies of kind `equidistribution`: how they run, and what they leave.

use super::EquidistributionStudy;
use super::any::Begin;
use super::ending::end;
use super::line_files::{keep, thinned, write_series};
use crate::equidistribution::{FaceDensity, History, Iterate, Line, Settled};
use crate::error::{Error, Moment, Result, Unfit};
use crate::kept::check_nodal;
use crate::output::{Checkpoints, Failed, Parallel, RunDirectory, status};
use crate::report;
use crate::simulation::{Advance, Observer};
use crate::stopwatch::Stopwatch;
use serde::{Deserialize, Serialize};
use std::cell::Cell;
use std::path::Path;
use std::time::Instant;

/// `summary.json` of a study of kind `equidistribution`.
#[derive(Debug, Clone, Serialize)]
pub struct EquidistributionSummary {
    /// Version of this format.
    pub schema: u32,
    /// Name of the study.
    pub study: String,
    /// `equidistribution`.
    pub kind: String,
    /// Version of the program.
    pub version: String,
    /// `running`, `completed`, `not-converged` or `failed`.
    pub status: String,
    /// What failed and when, if something did.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub failure: Option<Failed>,
    /// Where the time went.
    pub seconds: LineSeconds,
    /// What the run had at its disposal.
    pub parallel: Parallel,
    /// What it cost.
    pub work: LineWork,
    /// Of the last mesh.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quality: Option<LineQuality>,
    /// The start and every iterate; in time those of the last step.
    pub iterations: Vec<NumberedIterate>,
    /// Contraction in two iterations; in time that of the last step.
    pub rate: Rate,
    /// Whether the tolerance was met, in time in every step; null where none is asked for.
    pub converged: Option<bool>,
    /// The first iterate that meets it.
    pub iterations_to_tolerance: Option<usize>,
    /// In time.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub iterations_per_step: Option<PerStep>,
    /// The last mesh, glued from the subdomains.
    pub mesh: Vec<f64>,
    /// What the user should know although nothing failed.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
}

/// Seconds by part.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
pub struct LineSeconds {
    /// By the clock.
    pub wall: f64,
    /// Of all threads.
    pub cpu: f64,
    /// Solving, the single-domain solution for comparison included.
    pub mesh: f64,
    /// Writing.
    pub output: f64,
}

/// What a run cost.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub struct LineWork {
    /// Time steps.
    pub steps: usize,
    /// Linear solves of the subdomains, or of the whole line where there are none.
    pub linear_solves: usize,
}

/// Of a mesh.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct LineQuality {
    /// max/mean of ∫M over the cells, by trapezoids.
    pub equidistribution: f64,
    /// Shortest cell over the mean one.
    pub shortest_cell: f64,
    /// Largest distance from the continuous mesh, of up to a thousand nodes; not in time.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error_linf: Option<f64>,
}

/// An iterate.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub struct NumberedIterate {
    /// Its number; the start is 0.
    pub n: usize,
    /// Largest distance from the discrete single-domain mesh, over the subdomains.
    pub error_linf: f64,
    /// Largest change since the iterate before; none of the start.
    pub increment: Option<f64>,
    /// Largest error of linear interpolation on the glued mesh.
    pub interpolation_error: Option<f64>,
    /// 2 max |u_i − u_{i−1}| of it.
    pub largest_jump: Option<f64>,
    /// So far.
    pub linear_solves: usize,
}

/// Contraction of the error.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Rate {
    /// As the iterates show it.
    pub observed: Option<f64>,
    /// By theory.
    pub predicted: Option<f64>,
    /// By theory at most.
    pub bound: Option<f64>,
    /// Iterations that it is of.
    pub stride: usize,
}

/// Iterations in a time step.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct PerStep {
    /// Mean over the steps.
    pub mean: f64,
    /// Fewest.
    pub min: usize,
    /// Most.
    pub max: usize,
}

/// What a run left behind.
#[derive(Debug)]
pub struct LineFinished {
    /// What `summary.json` holds.
    pub summary: EquidistributionSummary,
    /// What was computed.
    pub evolution: Evolution,
    /// Why the run is no success, if it is none.
    pub failure: Option<Error>,
}

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
#[derive(Default, Serialize, Deserialize)]
struct LineCheckpoint {
    evolution: Evolution,
    seconds: LineSeconds,
}

/// A step in `history.csv`.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
pub struct StepRow {
    /// Time.
    pub t: f64,
    /// Iterations, of Newton's method where there are no subdomains.
    pub iterations: usize,
    /// Error of the last against the discrete single-domain mesh, where there are subdomains.
    pub error_linf: Option<f64>,
    /// Contraction in two iterations.
    pub observed_rate: Option<f64>,
    /// By theory at most.
    pub bound: Option<f64>,
    /// max/mean of ∫M over the cells.
    pub equidistribution: f64,
    /// Shortest cell over the mean one.
    pub shortest_cell: f64,
}

/// Seconds of a run in time after which it leaves what it has.
const SECONDS_UNSEEN: f64 = 1.0;
/// Nodes compared with the continuous mesh, and cells over which M is integrated to round-off.
const COMPARED: usize = 1000;
const EXACTLY: usize = 100_000;
/// Places at which the density is looked at, and a share of ∫M that tells of a layer unseen.
const PLACES: usize = 20_000;
const NOTICEABLE: f64 = 0.2;

impl EquidistributionStudy {
    /// Solves, or moves the mesh through time.
    ///
    /// # Errors
    /// [`Error::Failed`], also where an iteration misses its tolerance; `evolution` then holds what was done.
    pub fn compute(&self, line: &Line, evolution: &mut Evolution) -> Result<()> {
        self.evolve(line, evolution, &mut |_, _| Ok(()))
    }

    /// The same from what was done already, with something to do after each step, at its time.
    fn evolve(
        &self,
        line: &Line,
        evolution: &mut Evolution,
        after: &mut dyn FnMut(f64, &Evolution) -> Result<()>,
    ) -> Result<()> {
        let schedule = self.time.map(|time| time.schedule()).transpose()?;
        let (steps, start) = schedule.as_ref().map_or((1, 0.0), |s| (s.steps().unwrap_or(1), s.time(0)));
        let divided = self.decomposition()?;
        if evolution.newest.is_empty() {
            evolution.newest = match self.given_start()? {
                Some(mesh) => mesh,
                None => evolution.settled(line.settled(start)?).0,
            };
            evolution.keep(start);
        }
        for step in evolution.done + 1..=steps {
            let mesh = std::mem::take(&mut evolution.newest);
            let [before, t] = schedule.as_ref().map_or([start; 2], |s| [s.time(step - 1), s.time(step)]);
            let dt = t - before;
            let during = |error: Error| match (error, self.time) {
                (Error::Failed { failure, .. }, Some(_)) => Error::Failed { failure, moment: Some(Moment { t, step }) },
                (other, _) => other,
            };
            let old = self.time.map(|time| (mesh.as_slice(), time.relaxation / dt));
            let next = match &divided {
                None => {
                    let (next, solves) = match old {
                        Some(_) => line.solve(t, &mesh, old).map_err(during)?,
                        None => evolution.settled(line.settled(t)?),
                    };
                    evolution.linear_solves += solves;
                    if self.time.is_some() {
                        evolution.steps.push(StepRow::new(line, t, &next, solves).map_err(during)?);
                    }
                    next
                }
                Some((method, ranges)) => {
                    let history = line.iterate(t, ranges, *method, &mesh, old, self.until()).map_err(during)?;
                    let (next, missed) = (history.mesh.clone(), history.missed(*method, self.until()));
                    evolution.tell(line, t, history).map_err(during)?;
                    if let Some(failure) = missed {
                        return Err(during(failure.into()));
                    }
                    next
                }
            };
            evolution.newest = next;
            evolution.done = step;
            let kept = self.output.frames.as_ref().is_none_or(|frames| frames.due(step, t, dt));
            if kept || step == steps {
                evolution.keep(t);
            }
            after(t, evolution)?;
        }
        Ok(())
    }

    /// Refuses what cannot have been done of this study.
    fn accept(&self, line: &Line, LineCheckpoint { evolution, .. }: &LineCheckpoint) -> Result<(), Unfit> {
        let damaged = |error: Error| Unfit::Damaged(error.to_string());
        let schedule = self.time.map(|time| time.schedule()).transpose().map_err(damaged)?;
        let divided = self.decomposition().map_err(damaged)?.is_some();
        let Evolution { times, meshes, kept, steps, last, done, newest, .. } = evolution;
        let nodes = |mesh: &Vec<f64>| check_nodal("mesh", mesh.as_chunks::<1>().0, line.cells + 1);
        let glued = last.iter().flat_map(|history| [&history.mesh, &history.reference]);
        meshes.iter().chain([newest]).chain(glued).try_for_each(nodes)?;
        let counted = schedule.and_then(|schedule| schedule.steps()).is_some_and(|steps| *done <= steps)
            && [times.len(), kept.len()] == [meshes.len(); 2]
            && !times.is_empty()
            && steps.len() == *done
            && last.is_some() == (divided && *done > 0)
            && last.as_ref().is_none_or(|history| !history.iterates.is_empty());
        match counted && newest.is_sorted_by(|a, b| a < b) {
            true => Ok(()),
            false => Err(Unfit::Damaged(format!("its meshes of {done} steps are none of the run"))),
        }
    }

    /// See [`Study::decode`](super::Study::decode).
    pub(super) fn decode(&self, bytes: &[u8]) -> Result<usize, Unfit> {
        let damaged = |error: Error| Unfit::Damaged(error.to_string());
        let checkpoints = Checkpoints::new(Path::new(""), self.output.checkpoint, &self.to_toml()).map_err(damaged)?;
        let (step, found) = checkpoints.read::<LineCheckpoint>(bytes)?;
        self.accept(&self.problem().map_err(damaged)?, &found)?;
        Ok(step)
    }

    /// Runs the study into a directory.
    ///
    /// # Errors
    /// Settings out of range, and what hinders writing. What fails in the computation is in [`LineFinished::failure`].
    pub fn run(&self, directory: &Path) -> Result<LineFinished> {
        self.run_from(directory, &mut [], Begin::Anew)
    }

    /// The same from the newest checkpoint in the directory, to the bits of a run that nothing disturbed; from the start
    /// where there is none, as there is without `[time]`. Watchers are told of each step of `[time]`, and asked whether to end.
    ///
    /// # Errors
    /// As [`EquidistributionStudy::run`], and [`Error::Checkpoint`] where there are checkpoints, but none that will do.
    pub fn run_from(&self, path: &Path, watchers: &mut [&mut dyn Observer], begin: Begin) -> Result<LineFinished> {
        let clock = Stopwatch::start();
        let mut study = self.clone();
        study.resolve()?;
        let line = study.problem()?;
        let directory = RunDirectory::open(path)?;
        let mut checkpoints = Checkpoints::new(path, study.output.checkpoint, &study.to_toml())?;
        let resumed = match begin {
            Begin::Anew => None,
            Begin::Resumed => {
                checkpoints.resume(|found: LineCheckpoint| study.accept(&line, &found).map(|()| found))?
            }
        };
        match &resumed {
            Some(_) => directory.clear_ended(&[])?,
            None => directory.clear()?,
        }
        let mut summary = study.summary();
        directory.write_summary(&summary)?;
        directory.write("study.toml", study.to_toml().as_bytes())?;
        let (LineCheckpoint { mut evolution, seconds }, refused) = resumed.unwrap_or_default();
        let clock = clock.after([seconds.wall, seconds.cpu]);
        // seconds of writing while it solves
        let (solving, shown) = (Instant::now(), Cell::new(0.0));
        let spent = || {
            let [wall, cpu] = clock.elapsed();
            let (mesh, output) = (solving.elapsed().as_secs_f64() - shown.get(), shown.get());
            LineSeconds { wall, cpu, mesh: seconds.mesh + mesh, output: seconds.output + output }
        };
        let schedule = study.time.map(|time| time.schedule()).transpose()?;
        let (mut written, mut looked) = (0, Instant::now());
        let outcome = study.evolve(&line, &mut evolution, &mut |t, evolution| {
            let step = evolution.done;
            if let (Some(time), Some(row)) = (study.time, evolution.steps.last()) {
                let steps = schedule.as_ref().and_then(|schedule| schedule.steps());
                let share = (t - time.start) / (time.end - time.start);
                let advance = Advance { t, step, steps, share, smallest: row.shortest_cell, seconds: spent().wall };
                watchers.iter_mut().for_each(|watcher| watcher.advanced(&advance));
            }
            let ends = study.time.is_some() && watchers.iter().any(|watcher| watcher.interrupts());
            if ends || study.time.is_some() && checkpoints.is_due(step) {
                checkpoints.write(step, &LineCheckpoint { evolution: evolution.clone(), seconds: spent() })?;
            }
            // what a report of a run that goes on or is killed can show
            if study.time.is_some() && looked.elapsed().as_secs_f64() > SECONDS_UNSEEN {
                let output = Instant::now();
                written = write_series(&study, &line, &directory, evolution, written)?;
                shown.set(shown.get() + output.elapsed().as_secs_f64());
                looked = Instant::now();
            }
            if ends { Err(Error::Interrupted(Moment { t, step })) } else { Ok(()) }
        });
        let failure = outcome.err();
        if let Some(Error::Interrupted(Moment { t, .. })) = failure
            && evolution.times.last() != Some(&t)
        {
            evolution.keep(t);
        }
        summary.seconds = spent();
        let output = Instant::now();
        // what the density turns out to be between the nodes may be a failure of its own
        let told = summary.tell(&study, &line, &evolution);
        let failure = failure.or(told.err());
        summary.warnings.extend(refused);
        // what went wrong first is what is reported
        let failure = failure.or(keep(&study, &line, &directory, &evolution, written).err());
        summary.seconds.output += output.elapsed().as_secs_f64();
        let note = |summary: &mut EquidistributionSummary, failure: Option<&Error>, output: f64| {
            summary.status = status(failure).into();
            summary.failure = failure.map(|error| Failed::of(error, study.remedy(error)));
            summary.seconds.output += output;
            [summary.seconds.wall, summary.seconds.cpu] = clock.elapsed();
        };
        let failure = end(&directory, &mut summary, failure, note, |status| {
            report::finish(directory.path(), study.output.report, study.output.animation, status)
        });
        let removed = if failure.as_ref().is_some_and(Error::is_resumable) { Ok(()) } else { checkpoints.remove() };
        Ok(LineFinished { summary, evolution, failure: failure.or(removed.err()) })
    }

    fn summary(&self) -> EquidistributionSummary {
        EquidistributionSummary {
            schema: 1,
            study: self.study.name.clone(),
            kind: "equidistribution".into(),
            version: env!("CARGO_PKG_VERSION").into(),
            status: "running".into(),
            failure: None,
            seconds: LineSeconds::default(),
            parallel: Parallel { ranks: 1, threads: rayon::current_num_threads() },
            work: LineWork::default(),
            quality: None,
            iterations: Vec::new(),
            rate: Rate { observed: None, predicted: None, bound: None, stride: 2 },
            converged: None,
            iterations_to_tolerance: None,
            iterations_per_step: None,
            mesh: Vec::new(),
            warnings: Vec::new(),
        }
    }
}

impl Evolution {
    /// The mesh of the whole line with its linear solves; a warning where it is not what was asked for.
    fn settled(&mut self, Settled { mesh, linear_solves, stalled }: Settled) -> (Vec<f64>, usize) {
        let warn = |failure| {
            format!(
                "`equidistribution.face_density`: {failure}; the nodes are those of \"exact\", which a density that jumps or peaks \
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

impl StepRow {
    fn new(line: &Line, t: f64, mesh: &[f64], iterations: usize) -> Result<Self> {
        let shares = line.shares(t, mesh)?;
        let largest = shares.iter().copied().fold(0.0, f64::max);
        let equidistribution = largest * line.cells as f64 / shares.iter().sum::<f64>();
        let shortest_cell = shortest(line, mesh);
        Ok(Self { t, iterations, error_linf: None, observed_rate: None, bound: None, equidistribution, shortest_cell })
    }
}

/// The shortest cell over the mean one.
fn shortest(line: &Line, mesh: &[f64]) -> f64 {
    let shortest = mesh.windows(2).map(|x| x[1] - x[0]).fold(f64::INFINITY, f64::min);
    shortest * line.cells as f64 / (line.ends[1] - line.ends[0])
}

impl EquidistributionSummary {
    fn tell(&mut self, study: &EquidistributionStudy, line: &Line, evolution: &Evolution) -> Result<()> {
        self.work = LineWork { steps: evolution.done, linear_solves: evolution.linear_solves };
        self.mesh = evolution.mesh().to_vec();
        let t = evolution.steps.last().map_or_else(|| *evolution.times.last().unwrap_or(&0.0), |step| step.t);
        let tolerance = study.until().tolerance;
        if let Some(history) = &evolution.last {
            self.tell_iterations(study, evolution, history, tolerance);
        }
        self.quality = Some(LineQuality::of(line, t, &self.mesh, study.time.is_none())?);
        self.warnings = evolution.warnings.clone();
        // averages for which there is no mesh see another density than there is
        if self.warnings.is_empty() {
            self.warnings.extend(unseen(line, t, &self.mesh)?);
        }
        Ok(())
    }

    fn tell_iterations(
        &mut self,
        study: &EquidistributionStudy,
        evolution: &Evolution,
        history: &History,
        tolerance: Option<f64>,
    ) {
        self.iterations = history.iterates.iter().enumerate().map(|(n, it)| NumberedIterate::new(n, it)).collect();
        let prediction = history.prediction;
        self.rate =
            Rate { observed: history.observed, predicted: prediction.predicted, bound: prediction.bound, stride: 2 };
        self.converged = tolerance.map(|_| history.converged);
        self.iterations_to_tolerance = tolerance.filter(|_| history.converged).map(|_| history.count());
        if study.time.is_some() {
            let counts = || evolution.steps.iter().map(|step| step.iterations);
            self.iterations_per_step = Some(PerStep {
                mean: counts().sum::<usize>() as f64 / evolution.steps.len() as f64,
                min: counts().min().unwrap_or(0),
                max: counts().max().unwrap_or(0),
            });
        }
    }
}

impl NumberedIterate {
    pub(super) fn new(n: usize, iterate: &Iterate) -> Self {
        let Iterate { error, increment, largest_jump, interpolation_error, linear_solves } = *iterate;
        let increment = (n > 0).then_some(increment);
        Self { n, error_linf: error, increment, interpolation_error, largest_jump, linear_solves }
    }
}

impl LineQuality {
    fn of(line: &Line, t: f64, mesh: &[f64], steady: bool) -> Result<Self> {
        // exact integrals, unless there are so many cells that each is as good as its trapezoid
        let face = if line.cells <= EXACTLY { FaceDensity::Exact } else { FaceDensity::Trapezoid };
        let shares = Line { face, ..line.clone() }.shares(t, mesh)?;
        let mean = shares.iter().sum::<f64>() / line.cells as f64;
        let compared = |cells: usize| -> Result<f64> {
            let nodes: Vec<usize> = thinned(cells + 1, COMPARED).collect();
            let xi: Vec<f64> = nodes.iter().map(|&i| i as f64 / cells as f64).collect();
            let exact = line.exact(t, &xi)?;
            Ok(nodes.iter().zip(exact).map(|(&i, exact)| (mesh[i] - exact).abs()).fold(0.0, f64::max))
        };
        Ok(Self {
            equidistribution: shares.iter().copied().fold(0.0, f64::max) / mean,
            shortest_cell: shortest(line, mesh),
            error_linf: steady.then(|| compared(line.cells)).transpose()?,
        })
    }
}

/// Says so where the cells see another density than there is: a layer between two nodes is none to them.
fn unseen(line: &Line, t: f64, mesh: &[f64]) -> Result<Option<String>> {
    let [a, b] = line.ends;
    let seen: f64 = line.shares(t, mesh)?.iter().sum();
    let mut places: Vec<f64> = (0..=PLACES).map(|k| a + (b - a) * k as f64 / PLACES as f64).collect();
    places.extend(thinned(mesh.len(), PLACES).map(|i| mesh[i]));
    places.sort_by(f64::total_cmp);
    let m = line.density.at_each(t, &places)?;
    let there: f64 = match line.density.followed(t, &places) {
        // chords are no longer than the arc, and no layer is too thin for them
        Some(u) => (1..u.len()).map(|i| (places[i] - places[i - 1]).hypot(u[i] - u[i - 1])).sum(),
        None => (1..m.len()).map(|i| 0.5 * (m[i - 1][0] + m[i][0]) * (places[i] - places[i - 1])).sum(),
    };
    Ok(((seen - there).abs() > NOTICEABLE * there).then(|| {
        format!(
            "the cells see another density than there is: ∫M is {seen:.3} over them and {there:.3} in truth; name the \
             place of its layer in equidistribution.points, or refine grid.cells"
        )
    }))
}
