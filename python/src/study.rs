use crate::errors::raised;
use crate::threads::{BRIEFLY, Ended, PATIENCE, Threads, calls, interruptible};
use driftmesh::output::{RunDirectory, Standing};
use driftmesh::simulation::{Event, Observer, Snapshot};
use driftmesh::study::{Begin, Source, Study};
use driftmesh::{Error, Result};
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// What the thread that computes tells, and what it is told.
#[derive(Default)]
struct Seen {
    /// Share of the run, time and step; nothing of a study that cannot be watched.
    progress: Mutex<Option<(f64, f64, usize)>>,
    stop: AtomicBool,
}

impl Seen {
    fn progress(&self) -> MutexGuard<'_, Option<(f64, f64, usize)>> {
        self.progress.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

struct Watcher(Arc<Seen>);

impl Observer for Watcher {
    fn observe(&mut self, event: Event, snapshot: &Snapshot<'_>) -> Result<()> {
        if event != Event::Finished {
            *self.0.progress() = Some((snapshot.share, snapshot.t, snapshot.step));
        }
        Ok(())
    }

    fn adapting(&mut self, t: f64) -> Result<()> {
        *self.0.progress() = Some((0.0, t, 0));
        Ok(())
    }

    fn interrupts(&self) -> bool {
        self.0.stop.load(Ordering::Relaxed)
    }
}

/// A study from a file, or from text where `origin` names it, with assignments `KEY=VALUE` on top.
fn read(path: Option<PathBuf>, origin: &str, text: &str, set: &[String]) -> Result<Study> {
    let mut source = match path {
        Some(path) => Source::read(&path)?,
        None => Source::new(origin, text),
    };
    let study = set.iter().try_for_each(|assignment| source.set(assignment)).and_then(|()| Study::from_source(&source));
    study.map_err(|error| match error {
        // not an option here, but an argument
        Error::Study(mut mistake) if mistake.origin == "--set" => {
            mistake.origin = "set".into();
            Error::Study(mistake)
        }
        error => error,
    })
}

/// The name of a study that has no mistake.
#[pyfunction]
#[pyo3(signature = (path, origin, text, set))]
pub fn check(py: Python<'_>, path: Option<PathBuf>, origin: &str, text: &str, set: Vec<String>) -> PyResult<String> {
    let study = py.detach(|| read(path, origin, text, &set)).map_err(|error| raised(py, &error, error.help()))?;
    Ok(study.name().into())
}

/// Runs a study into a directory, with so many threads. `told(share, t, step)` is called every now and then.
///
/// `resume` goes on from the newest checkpoint, and does nothing where the run is complete.
///
/// Returns what was raised in Python or by the study, and whether the run has ended: a study that cannot be stopped
/// half-way goes on in the background.
#[pyfunction]
#[pyo3(signature = (path, origin, text, set, out, resume, threads, told))]
#[allow(clippy::too_many_arguments)] // four of them are one study
pub fn run(
    py: Python<'_>,
    path: Option<PathBuf>,
    origin: &str,
    text: &str,
    set: Vec<String>,
    out: PathBuf,
    resume: bool,
    threads: Threads,
    told: Option<Py<PyAny>>,
) -> PyResult<(Option<PyErr>, bool)> {
    let raise = |error: &Error| raised(py, error, error.help());
    let study = py.detach(|| read(path, origin, text, &set)).map_err(|error| raise(&error))?;
    RunDirectory::check(&out).map_err(|error| raise(&error))?;
    if resume && study.standing(&out).map_err(|error| raise(&error))? == Standing::Complete {
        return Ok((None, true));
    }
    let begin = if resume { Begin::Resumed } else { Begin::Anew };
    let seen = Arc::new(Seen::default());
    let (study, theirs) = (Arc::new(study), seen.clone());
    let computing = study.clone();
    let ended = interruptible(
        py,
        threads,
        calls(),
        move || computing.run(&out, begin, &mut [&mut Watcher(theirs)]),
        || {
            seen.stop.store(true, Ordering::Relaxed);
            if seen.progress().is_some() { PATIENCE } else { BRIEFLY }
        },
        |py| {
            let progress = *seen.progress();
            told.iter().zip(progress).try_for_each(|(told, progress)| told.call1(py, progress).map(|_| ()))
        },
    )?;
    Ok(match ended {
        Ended::Itself(outcome) => match outcome {
            Ok(None) => (None, true),
            Ok(Some(error)) => (Some(raised(py, &error, study.remedy(&error))), true),
            Err(error) => return Err(raised(py, &error, study.remedy(&error))),
        },
        Ended::Stopped(error, outcome) => (Some(error), outcome.is_some()),
    })
}
