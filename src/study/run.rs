use super::MovingMesh;
use crate::error::{Error, Result};
use crate::geometry::{Mesh, compare};
use crate::report;
use crate::simulation::{
    Event, Failed, Frames, History, Observer, Parallel, Record, RunDirectory, Snapshot, State, Summary, draw,
    final_arrays, status,
};
use std::path::Path;
use std::time::Instant;

/// What a run left behind.
#[derive(Debug)]
pub struct Finished {
    /// What `summary.json` holds.
    pub summary: Summary,
    /// The last good state.
    pub state: State,
    /// Why the run ended early, if it did.
    pub failure: Option<Error>,
}

/// Runs a study into a directory, with further observers watching
///
/// A failure after the start is not an error of this function: everything up to the last good state is written as for
/// a completed run, and [`Finished::failure`] says what happened. `summary.json` tells the same.
///
/// # Errors
/// [`Error::Invalid`], [`Error::ForeignDirectory`] or [`Error::Busy`] before anything is written; [`Error::Failed`] where
/// the initial state cannot be computed; [`Error::Unwritable`] where the directory cannot be written.
pub fn run(study: &MovingMesh, directory: &Path, watchers: &mut [&mut dyn Observer]) -> Result<Finished> {
    let mut study = study.clone();
    study.resolve()?;
    let mut simulation = study.simulation()?;
    let unknowns = simulation.physics.unknowns();

    let directory = RunDirectory::claim(directory)?;
    let mut summary = Summary {
        schema: 1,
        study: study.study.name.clone(),
        kind: "moving-mesh".into(),
        version: env!("CARGO_PKG_VERSION").into(),
        status: "running".into(),
        error: None,
        seconds: Default::default(),
        parallel: Parallel { ranks: 1, threads: rayon::current_num_threads() },
        work: Default::default(),
        reports: Vec::new(),
        warnings: Vec::new(),
    };
    directory.write("study.toml", study.to_toml().as_bytes())?;
    directory.write_summary(&summary)?;
    let mut record = Record { warnings: study.warnings()?, ..Record::default() };
    let outcome = study.start(&simulation, &mut record, watchers).and_then(|mut state| {
        let mut history = History::create(&directory.path().join("history.csv"))?;
        let mut frames = Frames::create(directory.path(), study.frames(), study.mesh.generator.subdomains())?;
        let mut meshes = Meshes::of(&study);
        let mut observers: Vec<&mut dyn Observer> = vec![&mut history, &mut frames, &mut meshes];
        watchers.iter_mut().for_each(|watcher| observers.push(*watcher));
        let failure = simulation.run(&mut state, &mut record, &mut observers).err();
        let failure = failure.map_or_else(|| reference_into(&directory, &study, &meshes, &mut record).err(), Some);
        let output = Instant::now();
        let kept = keep(&study, &directory, &unknowns, &state, &mut frames);
        let spent = output.elapsed().as_secs_f64();
        record.seconds.output += spent;
        record.seconds.wall += spent;
        // what went wrong first is what is reported
        match (failure, kept) {
            (None, Err(error)) => Err(error),
            (failure, _) => Ok((state, failure)),
        }
    });

    let failure = outcome.as_ref().map_or_else(Some, |(_, failure)| failure.as_ref());
    summary.status = status(failure).into();
    summary.error = failure.map(Failed::from);
    summary.seconds = record.seconds;
    summary.work = record.work;
    summary.reports = record.reports;
    summary.warnings = record.warnings;
    let written = directory.write_summary(&summary);
    let (state, failure) = outcome?;
    written?;
    // the report shows the summary; what it took itself is added afterwards
    let output = Instant::now();
    report::finish(directory.path(), study.output.report, study.output.animation)?;
    let spent = output.elapsed().as_secs_f64();
    summary.seconds.output += spent;
    summary.seconds.wall += spent;
    directory.write_summary(&summary)?;
    Ok(Finished { summary, state, failure })
}

/// Runs a study without leaving anything on disk; a failure after the start ends it early.
///
/// # Errors
/// As [`run`] before anything is computed.
pub fn compute(study: &MovingMesh) -> Result<(Record, Option<Error>)> {
    let mut study = study.clone();
    study.resolve()?;
    let mut simulation = study.simulation()?;
    let mut record = Record::default();
    let mut state = study.start(&simulation, &mut record, &mut [])?;
    let mut meshes = Meshes::of(&study);
    let failure = simulation.run(&mut state, &mut record, &mut [&mut meshes]).err();
    let failure = failure.map_or_else(|| compare_with_reference(&study, &meshes, &mut record, &mut []).err(), Some);
    Ok((record, failure))
}

/// Keeps the meshes at the report times, if there is something to compare them with.
struct Meshes {
    at: Vec<f64>,
    found: Vec<(f64, Mesh<2>)>,
}

impl Meshes {
    fn of(study: &MovingMesh) -> Self {
        let at = if study.compare.is_some() { study.time.report.clone() } else { Vec::new() };
        Self { at, found: Vec::new() }
    }
}

impl Observer for Meshes {
    fn observe(&mut self, event: Event, snapshot: &Snapshot<'_>) -> Result<()> {
        if event != Event::Finished && self.at.contains(&snapshot.state.t) {
            self.found.push((snapshot.state.t, snapshot.state.mesh.clone()));
        }
        Ok(())
    }
}

/// As [`compare_with_reference`], which leaves its frames beside those of the run.
fn reference_into(directory: &RunDirectory, study: &MovingMesh, meshes: &Meshes, record: &mut Record) -> Result<()> {
    let Some(compare) = &study.compare else { return Ok(()) };
    let mut frames = Frames::of_reference(directory.path(), study.frames(), compare.generator.subdomains())?;
    compare_with_reference(study, meshes, record, &mut [&mut frames])
}

/// Runs the study with the generator of `[compare]` and adds to each report how the meshes compare.
fn compare_with_reference(
    study: &MovingMesh,
    meshes: &Meshes,
    record: &mut Record,
    watchers: &mut [&mut dyn Observer],
) -> Result<()> {
    let Some(reference) = study.reference() else { return Ok(()) };
    let mut simulation = reference.simulation()?;
    let mut state = reference.start(&simulation, &mut Record::default(), &mut [])?;
    let mut theirs = Meshes::of(study);
    let mut observers: Vec<&mut dyn Observer> = vec![&mut theirs];
    watchers.iter_mut().for_each(|watcher| observers.push(*watcher));
    simulation.run(&mut state, &mut Record::default(), &mut observers)?;
    for report in &mut record.reports {
        let at = |meshes: &Meshes| meshes.found.iter().find(|(t, _)| *t == report.t).map(|(_, mesh)| mesh.clone());
        report.comparison = at(meshes).zip(at(&theirs)).map(|(ours, theirs)| compare(&ours, &theirs));
    }
    Ok(())
}

/// Writes the last good state: as a frame, as arrays, as a picture.
fn keep(
    study: &MovingMesh,
    directory: &RunDirectory,
    unknowns: &[String],
    state: &State,
    frames: &mut Frames,
) -> Result<()> {
    frames.write(unknowns, state)?;
    directory.write("final.npz", &final_arrays(unknowns, state))?;
    let picture = draw(&format!("{}, t = {}", study.study.name, rounded(state.t)), &unknowns[0], state);
    directory.write("mesh.svg", picture.svg.as_bytes())?;
    directory.write("mesh.png", &picture.png)
}

/// A time without the tail that binary fractions have.
fn rounded(t: f64) -> f64 {
    format!("{t:.9}").parse().unwrap_or(t)
}
