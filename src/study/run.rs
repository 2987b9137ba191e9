use super::MovingMesh;
use super::any::Begin;
use super::ending::end;
use super::rest::at_rest;
use crate::error::{Error, Result, Unfit};
use crate::geometry::{Mesh, compare};
use crate::kept::{Kept, check_nodal};
use crate::output::{
    Checkpoints, Failed, Frames, History, Parallel, RunDirectory, Summary, draw, final_arrays, moment, status,
};
use crate::parallel::join;
use crate::report;
use crate::simulation::{Checkpoint, Course, Event, Observer, Record, Simulation, Snapshot, State};
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
    run_from(study, directory, watchers, Begin::Anew)
}

/// The same from the newest checkpoint in the directory, to the bits of a run that nothing disturbed; from the start where
/// there is none.
///
/// # Errors
/// As [`run`], and [`Error::Checkpoint`] where there are checkpoints, but none that will do.
pub fn resume(study: &MovingMesh, directory: &Path, watchers: &mut [&mut dyn Observer]) -> Result<Finished> {
    run_from(study, directory, watchers, Begin::Resumed)
}

fn run_from(
    study: &MovingMesh,
    directory: &Path,
    watchers: &mut [&mut dyn Observer],
    begin: Begin,
) -> Result<Finished> {
    let mut study = study.clone();
    study.resolve()?;
    let mut simulation = study.simulation()?;
    let unknowns = simulation.physics.unknowns();

    let directory = RunDirectory::open(directory)?;
    let mut checkpoints = Checkpoints::new(directory.path(), study.output.checkpoint, &study.to_toml())?;
    checkpoints.at_the_end = study.compare.is_some();
    let resumed = match begin {
        Begin::Anew => None,
        Begin::Resumed => checkpoints.resume(|found| Underway::resume(&study, &mut simulation, &directory, found))?,
    };
    match &resumed {
        Some(_) => directory.clear_ended(&RunDirectory::GROWING)?,
        None => directory.clear()?,
    }
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
        safety: Default::default(),
        reports: Vec::new(),
        warnings: Vec::new(),
    };
    directory.write_summary(&summary)?;
    directory.write("study.toml", study.to_toml().as_bytes())?;
    let mut record = Record::default();
    let underway = match resumed {
        Some((underway, refused)) => {
            record = underway.record.clone();
            record.warnings.extend(refused);
            Ok(underway)
        }
        None => {
            record.warnings = study.warnings()?;
            Underway::start(&study, &simulation, &directory, &mut record, watchers)
        }
    };
    let outcome = underway.map(|underway| {
        let Underway { mut state, course, mut history, mut frames, mut meshes, .. } = underway;
        let mut observers: Vec<&mut dyn Observer> = vec![&mut history, &mut frames, &mut meshes];
        watchers.iter_mut().for_each(|watcher| observers.push(*watcher));
        let failure = simulation.run_on(&mut state, &mut record, &mut observers, Some(&mut checkpoints), course).err();
        let failure = match failure {
            None => warn_of_rest(&study, &simulation, &state, &mut record)
                .and_then(|()| reference_into(&directory, &study, &meshes, &mut record, watchers))
                .err(),
            failure => failure,
        };
        let output = Instant::now();
        let kept = history.flush().and_then(|()| frames.write(&unknowns, &state));
        let spent = output.elapsed().as_secs_f64();
        record.seconds.output += spent;
        record.seconds.wall += spent;
        // what went wrong first is what is reported
        (state, failure.or(kept.err()))
    });

    let note = |summary: &mut Summary, failure: Option<&Error>, output: f64| {
        summary.status = status(failure).into();
        summary.error = failure.map(|error| Failed::of(error, study.remedy(error)));
        summary.seconds.output += output;
        summary.seconds.wall += output;
    };
    summary.seconds = record.seconds;
    summary.work = record.work;
    summary.safety = record.safety;
    summary.reports = record.reports;
    summary.warnings = record.warnings;
    let (state, failure) = match outcome {
        Ok(ended) => ended,
        Err(error) => {
            let told = |status: &str| report::finish(directory.path(), study.output.report, false, status);
            return Err(end(&directory, &mut summary, Some(error), note, told).expect("what failed is told of"));
        }
    };
    let failure = end(&directory, &mut summary, failure, note, |status| {
        let (picture, report) = join(
            || {
                let arrays = directory.write("final.npz", &final_arrays(&unknowns, &state));
                arrays.and(draw_mesh(&study, &directory, &unknowns, &state))
            },
            || report::finish(directory.path(), study.output.report, study.output.animation, status),
        );
        picture.and(report)
    });
    let removed = if failure.as_ref().is_some_and(Error::is_resumable) { Ok(()) } else { checkpoints.remove() };
    Ok(Finished { summary, state, failure: failure.or(removed.err()) })
}

/// A run between two steps, with what leaves its traces on the disk.
struct Underway {
    state: State,
    record: Record,
    course: Option<Course>,
    history: History,
    frames: Frames,
    meshes: Meshes,
}

impl Underway {
    fn start(
        study: &MovingMesh,
        simulation: &Simulation,
        directory: &RunDirectory,
        record: &mut Record,
        watchers: &mut [&mut dyn Observer],
    ) -> Result<Self> {
        let state = study.start(simulation, record, watchers)?;
        let history = History::create(&directory.path().join("history.csv"))?;
        let frames = Frames::create(directory.path(), study.frames(), study.mesh.generator.subdomains())?;
        Ok(Self { state, record: record.clone(), course: None, history, frames, meshes: Meshes::of(study) })
    }

    fn resume(
        study: &MovingMesh,
        simulation: &mut Simulation,
        directory: &RunDirectory,
        found: Checkpoint,
    ) -> Result<Self, Unfit> {
        let (state, meshes) = accept(study, simulation, &found)?;
        let Checkpoint { record, course, kept, .. } = found;
        let (path, subdomains) = (directory.path(), study.mesh.generator.subdomains());
        let history = History::resume(&path.join("history.csv"), &kept)?;
        let frames = Frames::resume(path, study.frames(), subdomains, &state, &kept)?;
        Ok(Self { state, record, course: Some(course), history, frames, meshes })
    }
}

/// What a checkpoint holds, if the study can go on from it.
fn accept(study: &MovingMesh, simulation: &mut Simulation, found: &Checkpoint) -> Result<(State, Meshes), Unfit> {
    let mesh = study.uniform_mesh().map_err(|error| Unfit::Damaged(error.to_string()))?;
    let state = found.state(&mesh, simulation.physics.as_ref(), &simulation.schedule, simulation.safety)?;
    simulation.mover.generator.resume(&mesh, &found.kept)?;
    Ok((state, Meshes::resume(study, &mesh, &found.kept)?))
}

/// See [`Study::decode`](super::Study::decode).
pub(super) fn decode(study: &MovingMesh, bytes: &[u8]) -> Result<usize, Unfit> {
    let damaged = |error: Error| Unfit::Damaged(error.to_string());
    let checkpoints = Checkpoints::new(Path::new(""), study.output.checkpoint, &study.to_toml()).map_err(damaged)?;
    let (step, found) = checkpoints.read(bytes)?;
    accept(study, &mut study.simulation().map_err(damaged)?, &found)?;
    Ok(step)
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
    let outcome = simulation
        .run(&mut state, &mut record, &mut [&mut meshes])
        .and_then(|()| warn_of_rest(&study, &simulation, &state, &mut record))
        .and_then(|()| compare_with_reference(&study, &meshes, &mut record, &mut []));
    Ok((record, outcome.err()))
}

/// Says why the mesh did not move, where it should have.
fn warn_of_rest(study: &MovingMesh, simulation: &Simulation, state: &State, record: &mut Record) -> Result<()> {
    let warning = at_rest(study, simulation, state, record)?;
    record.warnings.extend(warning);
    Ok(())
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

    fn resume(study: &MovingMesh, mesh: &Mesh<2>, kept: &Kept) -> Result<Self, Unfit> {
        let found: Vec<(f64, Vec<[f64; 2]>)> = kept.get("meshes")?;
        let moved = |(t, x): (f64, Vec<[f64; 2]>)| {
            check_nodal("mesh at a report", &x, mesh.lattice().len())?;
            Ok((t, mesh.moved(x).map_err(|failure| Unfit::Damaged(failure.to_string()))?))
        };
        Ok(Self { found: found.into_iter().map(moved).collect::<Result<_, Unfit>>()?, ..Self::of(study) })
    }
}

impl Observer for Meshes {
    fn observe(&mut self, event: Event, snapshot: &Snapshot<'_>) -> Result<()> {
        if matches!(event, Event::Started | Event::Stepped) && self.at.contains(&snapshot.state.t) {
            self.found.push((snapshot.state.t, snapshot.state.mesh.clone()));
        }
        Ok(())
    }

    fn keep(&mut self, kept: &mut Kept) -> Result<()> {
        kept.put("meshes", &self.found.iter().map(|(t, mesh)| (t, mesh.x())).collect::<Vec<_>>());
        Ok(())
    }
}

/// Asks whether a run is to end, of those who watch another.
struct Ends<'a, 'w>(&'a [&'w mut dyn Observer]);

impl Observer for Ends<'_, '_> {
    fn observe(&mut self, _event: Event, _snapshot: &Snapshot<'_>) -> Result<()> {
        Ok(())
    }

    fn interrupts(&self) -> bool {
        self.0.iter().any(|watcher| watcher.interrupts())
    }
}

/// As [`compare_with_reference`], which leaves its frames beside those of the run.
fn reference_into(
    directory: &RunDirectory,
    study: &MovingMesh,
    meshes: &Meshes,
    record: &mut Record,
    watchers: &[&mut dyn Observer],
) -> Result<()> {
    let Some(compare) = &study.compare else { return Ok(()) };
    let mut frames = Frames::of_reference(directory.path(), study.frames(), compare.generator.subdomains())?;
    let compared = compare_with_reference(study, meshes, record, &mut [&mut frames, &mut Ends(watchers)]);
    compared.map_err(|error| Error::Compared(Box::new(error)))
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
    let mut state = reference.start(&simulation, &mut Record::default(), watchers)?;
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

/// Draws the last good state.
fn draw_mesh(study: &MovingMesh, directory: &RunDirectory, unknowns: &[String], state: &State) -> Result<()> {
    let picture = draw(&format!("{}, t = {}", study.study.name, moment(state.t)), &unknowns[0], state, &[]);
    picture.write(directory.path(), "mesh")
}
