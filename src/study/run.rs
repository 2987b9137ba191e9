use super::MovingMesh;
use crate::error::{Error, Result};
use crate::simulation::{
    Failed, Frames, History, Observer, Parallel, Record, RunDirectory, State, Summary, draw, final_arrays,
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
/// A numerical failure is not an error of this function: everything up to the last good state is written as for a
/// completed run, and [`Finished::failure`] says what happened.
///
/// # Errors
/// [`Error::Invalid`] or [`Error::ForeignDirectory`] before anything is written; [`Error::Unwritable`] where the
/// directory cannot be written.
pub fn run(study: &MovingMesh, directory: &Path, watchers: &mut [&mut dyn Observer]) -> Result<Finished> {
    let mut study = study.clone();
    study.resolve()?;
    let mut simulation = study.simulation()?;
    let mut state = simulation.start(study.initial_mesh()?)?;
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
    };
    directory.write("study.toml", study.to_toml().as_bytes())?;
    directory.write_summary(&summary)?;
    let mut history = History::create(&directory.path().join("history.csv"))?;
    let mut frames = Frames::create(directory.path(), study.frames())?;

    let mut record = Record::default();
    let mut observers: Vec<&mut dyn Observer> = vec![&mut history, &mut frames];
    watchers.iter_mut().for_each(|watcher| observers.push(*watcher));
    let failure = simulation.run(&mut state, &mut record, &mut observers).err();

    let output = Instant::now();
    if failure.is_some() {
        frames.write(&unknowns, &state)?; // the last good state
    }
    directory.write("final.npz", &final_arrays(&unknowns, &state))?;
    let picture = draw(&format!("{}, t = {}", study.study.name, rounded(state.t)), &unknowns[0], &state);
    directory.write("mesh.svg", picture.svg.as_bytes())?;
    directory.write("mesh.png", &picture.png)?;
    let spent = output.elapsed().as_secs_f64();
    record.seconds.output += spent;
    record.seconds.wall += spent;

    summary.status = if failure.is_some() { "failed" } else { "completed" }.into();
    summary.error = failure.as_ref().map(Failed::from);
    summary.seconds = record.seconds;
    summary.work = record.work;
    summary.reports = record.reports;
    directory.write_summary(&summary)?;
    Ok(Finished { summary, state, failure })
}

/// A time without the tail that binary fractions have.
fn rounded(t: f64) -> f64 {
    format!("{t:.9}").parse().unwrap_or(t)
}
