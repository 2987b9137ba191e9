//! The one runner: a study of any kind → run directory.

use super::kind::{Kind, Running, SpentBy};
use super::together::Together;
use crate::error::{Error, Moment, Result, Unfit};
use crate::kept::Kept;
use crate::output::{
    Behind, Checkpoints, Frames, Resumed, RunDirectory, Spent, Summary, draw, final_arrays, names, structured,
};
use crate::parallel::join;
use crate::ranks::Ranks;
use crate::report;
use crate::simulation::{Event, Observer, Scene, Snapshot};
use crate::stopwatch::Stopwatch;
use serde::Serialize;
use std::path::Path;
use std::time::Instant;

/// Where a run begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Begin {
    /// At its start.
    Anew,
    /// At the newest checkpoint, and on to the bits of a run that nothing disturbed; at its start where there is none.
    /// A complete run goes on behind its last step where the study ends later now.
    Resumed,
}

/// What a run left behind.
#[derive(Debug)]
pub struct Finished<R: Running> {
    /// What `summary.json` holds.
    pub summary: Summary<R::Figures>,
    /// What ran, as far as it came: the last good state, and what was found on the way.
    pub run: R,
    /// Why the run ended early, if it did.
    pub failure: Option<Error>,
}

/// Who watches a run, and what it leaves as it goes.
pub struct Stage<'a> {
    /// Where the run writes; nowhere if nothing is to be left.
    pub(super) directory: Option<&'a RunDirectory>,
    /// The event with which the run begins: [`Event::Started`] or [`Event::Resumed`].
    pub(super) begins: Event,
    frames: Option<Frames>,
    together: Together<'a>,
    checkpoints: Option<Checkpoints>,
    clock: Stopwatch,
    /// Seconds of watching and writing.
    pub(super) output: f64,
}

impl<'a> Stage<'a> {
    /// The stage of a run that leaves nothing.
    fn bare() -> Self {
        Self {
            directory: None,
            begins: Event::Started,
            frames: None,
            together: Together::default(),
            checkpoints: None,
            clock: Stopwatch::start(),
            output: 0.0,
        }
    }

    /// Lets watchers follow the run.
    fn watched_by(&mut self, watchers: &'a mut [&mut dyn Observer]) {
        watchers.iter_mut().for_each(|watcher| self.together.watchers.push(*watcher));
    }

    /// Frames and watchers.
    pub(super) fn observers(&mut self) -> Vec<&mut dyn Observer> {
        self.parts().0
    }

    /// Frames and watchers, and the checkpoints beside them.
    pub(super) fn parts(&mut self) -> (Vec<&mut dyn Observer>, Option<&mut Checkpoints>) {
        let mut observers: Vec<&mut dyn Observer> = Vec::new();
        self.frames.iter_mut().for_each(|frames| observers.push(frames));
        observers.push(&mut self.together);
        (observers, self.checkpoints.as_mut())
    }

    /// Shows an event to all observers. A checkpoint is written where one is due, and at the end of the run, which
    /// `keep` makes of the seconds up to now and of what observers carry, and the run ends where an observer asks for
    /// that.
    ///
    /// # Errors
    /// What an observer returned; [`Error::Unwritable`]; [`Error::Interrupted`].
    pub(super) fn show<P, C: Serialize>(
        &mut self,
        event: Event,
        snapshot: &Snapshot<'_>,
        parts: P,
        keep: impl FnOnce(Spent<P>, Kept) -> Result<C>,
    ) -> Result<()> {
        let spent = self.spent(parts);
        let (mut observers, checkpoints) = self.parts();
        let mut kept = Kept::default();
        if event == Event::Finished {
            // before the last frame, which a run that goes on to a later end may not have
            if let Some(checkpoints) = checkpoints {
                observers.iter_mut().try_for_each(|observer| observer.keep(&mut kept))?;
                checkpoints.write_last(snapshot.step, &keep(spent, kept)?)?;
            }
            return observers.iter_mut().try_for_each(|observer| observer.observe(event, snapshot));
        }
        observers.iter_mut().try_for_each(|observer| observer.observe(event, snapshot))?;
        let ends = observers.iter().any(|observer| observer.interrupts());
        if let Some(checkpoints) = checkpoints
            && (ends || checkpoints.is_due(snapshot.step))
        {
            observers.iter_mut().try_for_each(|observer| observer.keep(&mut kept))?;
            checkpoints.write(snapshot.step, &keep(spent, kept)?)?;
        }
        match ends {
            true => Err(Error::Interrupted(Moment { t: snapshot.t, step: snapshot.step })),
            false => Ok(()),
        }
    }

    /// Does something that is no computation, and counts its seconds as those of output.
    pub(super) fn output<T>(&mut self, write: impl FnOnce(&mut Self) -> T) -> T {
        let began = Instant::now();
        let result = write(self);
        self.output += began.elapsed().as_secs_f64();
        result
    }

    /// Does something whose seconds count nowhere, such as another run that this one is compared with.
    pub(super) fn beside<T>(&mut self, other: impl FnOnce(&mut Self) -> T) -> T {
        let before = self.clock.elapsed();
        let result = other(self);
        self.clock = Stopwatch::start().after(before);
        result
    }

    /// Seconds up to now, with those of the parts of the run.
    pub(super) fn spent<P>(&self, parts: P) -> Spent<P> {
        let [wall, cpu] = self.clock.elapsed();
        Spent { wall, cpu, parts, output: self.output }
    }

    /// Mean messages and bytes that came from other ranks in a step.
    fn received(&self) -> (f64, f64) {
        (self.together.received.messages, self.together.received.bytes)
    }

    /// Seconds by the clock, over all parts of the run.
    pub(super) fn wall(&self) -> f64 {
        self.clock.wall()
    }
}

/// See [`Kind::compute`].
pub(super) fn compute<K: Kind>(study: &K) -> Result<(K::Run, Option<Error>)> {
    let mut study = study.clone();
    study.ready()?;
    study.data().known(|| {
        let mut run = study.begin()?;
        match run.go(&mut Stage::bare()) {
            Err(error) if run.scenes().is_ok_and(|scenes| scenes.is_empty()) => Err(error),
            outcome => Ok((run, outcome.err())),
        }
    })
}

/// See [`Kind::run`].
pub(super) fn run<K: Kind>(
    study: &K,
    path: &Path,
    begin: Begin,
    watchers: &mut [&mut dyn Observer],
) -> Result<Finished<K::Run>> {
    let clock = Stopwatch::start();
    let mut study = study.clone();
    study.ready()?;
    study.data().known(|| match Ranks::here().is_first() {
        true => run_ready(&study, path, begin, watchers, clock),
        false => follow(&study, watchers),
    })
}

/// Runs a study on another rank than the first, which gives the checkpoint to begin at: the same steps, and nothing is
/// written.
fn follow<K: Kind>(study: &K, watchers: &mut [&mut dyn Observer]) -> Result<Finished<K::Run>> {
    let mut run = study.begin()?;
    let mut stage = Stage::bare();
    stage.watched_by(watchers);
    let checkpoint = sent(Vec::new());
    if !checkpoint.is_empty() {
        let checkpoints = Checkpoints::new(Path::new(""), study.common().1.checkpoint, &study.to_toml())?;
        let refused = |unfit| Error::Checkpoint { refused: vec![("the checkpoint of rank 0".into(), unfit)] };
        let (behind, found) = checkpoints.read(&checkpoint, true).map_err(refused)?;
        behind.followed_by(run.schedule()).map_err(refused)?;
        run.resume(found, None).map_err(refused)?;
        stage.begins = Event::Resumed;
    }
    let failure = run.go(&mut stage).err();
    let mut summary = Summary::running(&study.common().0.name, K::KIND.name());
    run.tell(&mut summary);
    summary.note(failure.as_ref(), |_| None);
    Ok(Finished { summary, run, failure })
}

/// Runs a study that is resolved, where its formulas may name its tables.
fn run_ready<K: Kind>(
    study: &K,
    path: &Path,
    begin: Begin,
    watchers: &mut [&mut dyn Observer],
    clock: Stopwatch,
) -> Result<Finished<K::Run>> {
    let (mut run, warnings) = (study.begin()?, study.warnings()?);
    let (header, output) = study.common();
    let directory = RunDirectory::open(path)?;
    let mut checkpoints = Checkpoints::new(path, output.checkpoint, &study.to_toml())?;
    let resumed = match begin {
        Begin::Anew => None,
        Begin::Resumed => checkpoints.resume(|found, behind| take_up(study, path, found, behind))?,
    };
    let mut stage = Stage::bare();
    let mut checkpoint = Vec::new();
    match resumed {
        Some(Resumed { taken: (resumed, frames, before), refused, sealed }) => {
            checkpoint = sealed;
            directory.clear_ended()?;
            run = resumed;
            run.warn(refused);
            (stage.begins, stage.frames, stage.output) = (Event::Resumed, Some(frames), before.output);
            stage.clock = clock.after([before.wall, before.cpu]);
        }
        None => {
            directory.clear()?;
            run.warn(warnings);
            let (at, subdomains) = run.frames();
            (stage.clock, stage.frames) = (clock, Some(Frames::create(path, at, subdomains)));
        }
    }
    checkpoints.past = run.schedule().map(|schedule| schedule.past());
    stage.directory = Some(&directory);
    stage.checkpoints = Some(checkpoints);
    stage.watched_by(watchers);
    let summary = Summary::running(&header.name, K::KIND.name());
    directory.write_summary(&summary)?;
    directory.write(names::STUDY, study.to_toml().as_bytes())?;
    run.warn(idle(Ranks::here(), run.frames().1));
    sent(checkpoint);
    let failure = run.go(&mut stage).err();
    end(study, stage, &directory, Finished { summary, run, failure })
}

/// The checkpoint from which rank 0 goes on, on all ranks; nothing where the run begins anew.
fn sent(checkpoint: Vec<u8>) -> Vec<u8> {
    Ranks::here().from_first(|| Ok(checkpoint)).unwrap_or_default()
}

/// Says so where ranks have nothing to share.
fn idle(ranks: Ranks, subdomains: [usize; 2]) -> Vec<String> {
    let idle = ranks.count() > 1 && subdomains == [1, 1];
    let warning = format!(
        "{} ranks compute the same, each on its own: only meshes by the generators `stochastic` and `schwarz` are \
         shared among ranks",
        ranks.count()
    );
    if idle { vec![warning] } else { Vec::new() }
}

/// What runs, at a checkpoint, with the frames that were there by then and the seconds that it took.
type TakenUp<R> = (R, Frames, SpentBy<R>);

/// Takes up a checkpoint, and takes the files of the directory back to what they were then.
fn take_up<K: Kind>(
    study: &K,
    path: &Path,
    found: <K::Run as Running>::Checkpoint,
    behind: &Behind,
) -> Result<TakenUp<K::Run>, Unfit> {
    let mut run = begun(study)?;
    let later = behind.followed_by(run.schedule())?;
    let (before, kept) = run.resume(found, Some(path))?;
    if later {
        run.lengthen(path)?;
    }
    let (at, subdomains) = run.frames();
    Ok((run, Frames::resume(path, at, subdomains, &kept)?, before))
}

fn begun<K: Kind>(study: &K) -> Result<K::Run, Unfit> {
    study.begin().map_err(|error| Unfit::Damaged(error.to_string()))
}

/// See [`Study::decode`](super::Study::decode).
pub(super) fn decode<K: Kind>(study: &K, bytes: &[u8]) -> Result<usize, Unfit> {
    study.data().known(|| decode_known(study, bytes))
}

fn decode_known<K: Kind>(study: &K, bytes: &[u8]) -> Result<usize, Unfit> {
    let checkpoints = Checkpoints::new(Path::new(""), study.common().1.checkpoint, &study.to_toml());
    let (behind, found) = checkpoints.map_err(|error| Unfit::Damaged(error.to_string()))?.read(bytes, false)?;
    let mut run = begun(study)?;
    behind.followed_by(run.schedule())?;
    run.resume(found, None)?;
    Ok(behind.step)
}

/// Ends a run: writes what is left of it, its summary, then the report and what else is drawn, then the summary again
/// with what that took or failed with. What went wrong first is what is told.
fn end<K: Kind>(
    study: &K,
    mut stage: Stage<'_>,
    directory: &RunDirectory,
    finished: Finished<K::Run>,
) -> Result<Finished<K::Run>> {
    let Finished { mut summary, mut run, failure } = finished;
    let (last, left) = stage.output(|stage| leave(&mut run, stage, directory));
    let failure = failure.or(left.err());
    run.tell(&mut summary);
    (summary.parallel.messages, summary.parallel.bytes) = stage.received();
    summary.warnings.extend(study.data().warnings());
    let note = |summary: &mut Summary<_>, failure: Option<&Error>, stage: &Stage<'_>| {
        summary.note(failure, |error| study.remedy(error));
        summary.seconds = stage.spent(summary.seconds.parts);
    };
    note(&mut summary, failure.as_ref(), &stage);
    // what is on the disk is not called completed before all is there: there may be no space to take that back
    let status = std::mem::replace(&mut summary.status, "running");
    let written = directory.write_summary(&summary);
    let drawn = stage.output(|_| written.and_then(|()| draw_all(study, directory, &run, last.as_ref(), status)));
    let failure = failure.or(drawn.err());
    note(&mut summary, failure.as_ref(), &stage);
    let failure = failure.or(directory.write_summary(&summary).err());
    let goes_on = failure.as_ref().is_some_and(Error::is_resumable);
    let removed = stage.checkpoints.iter().filter(|_| !goes_on).try_for_each(Checkpoints::remove);
    match failure.or(removed.err()) {
        Some(error) if last.is_none() => Err(error),
        failure => Ok(Finished { summary, run, failure }),
    }
}

/// Writes what only a run of this kind leaves, and the frames that must not be missing. Returns the last scene, too.
fn leave<R: Running>(run: &mut R, stage: &mut Stage<'_>, directory: &RunDirectory) -> (Option<Scene>, Result<()>) {
    let left = run.leave(directory);
    let scenes = match run.scenes() {
        Ok(scenes) => scenes,
        Err(error) => return (None, left.and(Err(error))),
    };
    let last = scenes.last().cloned();
    let written = match &mut stage.frames {
        Some(frames) => frames.write(scenes),
        None => Ok(()),
    };
    (last, left.and(written))
}

/// Writes arrays and a picture of the last scene, beside the report.
fn draw_all<K: Kind>(
    study: &K,
    directory: &RunDirectory,
    run: &K::Run,
    last: Option<&Scene>,
    status: &str,
) -> Result<()> {
    let (header, output) = study.common();
    let drawn = last.filter(|scene| scene.cells[1] > 0);
    let drawn = drawn.map(|scene| (scene, format!("{}, {}", header.name, run.caption(scene))));
    let picture = || match &drawn {
        Some((scene, title)) => {
            directory.write(names::ARRAYS, &final_arrays(scene))?;
            directory.write(names::GRID, structured(scene).as_bytes())?;
            draw(title, scene).write(directory.path(), names::MESH)
        }
        None => Ok(()),
    };
    let reported = last.is_some() || study.has_steps();
    let animated = output.animation && last.is_some();
    let (picture, report) = join(picture, || match reported {
        true => report::finish(directory.path(), output.report, animated, status),
        false => Ok(()),
    });
    picture.and(report)
}
