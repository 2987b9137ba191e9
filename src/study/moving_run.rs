//! Studies of kind `moving-mesh`: how they run, and what they leave.

use super::MovingStudy;
use super::dimension::{GeneratorTable, Studied};
use super::kind::{Running, SpentBy};
use super::rest::at_rest;
use super::runner::Stage;
use crate::error::{Error, Result, Unfit};
use crate::geometry::{Mesh, compare};
use crate::kept::{Kept, check_nodal};
use crate::output::{
    Curve, Figure, Figures, Frames, FramesAt, History, RunDirectory, Scale, Summary, final_arrays, moment, names,
};
use crate::simulation::{
    Checkpoint, Course, Event, Keeper, MovingParts, Observer, Record, Report, Retries, Scene, Schedule, Simulation,
    Snapshot, State, Values, WorkTotal,
};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// What `summary.json` says of a moving mesh.
#[derive(Debug, Clone, Default, Serialize)]
pub struct MovingFigures {
    /// Steps and their cost.
    pub work: WorkTotal,
    /// Steps that were tried again.
    pub safety: Retries,
    /// One entry for each time of `time.report` that was reached.
    pub reports: Vec<Report>,
}

impl Figures for MovingFigures {
    type Parts = MovingParts;
}

/// A moving mesh while it runs.
pub struct MovingRun<const D: usize = 2>
where
    Mesh<D>: Studied<D>,
{
    study: MovingStudy<D>,
    simulation: Simulation<D>,
    /// The last good state; none before the mesh is adapted to the initial solution.
    pub state: Option<State<D>>,
    /// What was found in the steps done, and what they cost.
    pub record: Record,
    /// What the loop of a checkpoint carries.
    course: Option<Course>,
    history: Option<History>,
    meshes: Meshes<D>,
}

impl<const D: usize> MovingRun<D>
where
    Mesh<D>: Studied<D>,
{
    /// Before anything is computed.
    pub(super) fn of(study: &MovingStudy<D>) -> Result<Self> {
        let (simulation, meshes, study) = (study.simulation()?, Meshes::of(study), study.clone());
        let record = Record::default();
        Ok(Self { study, simulation, state: None, record, course: None, history: None, meshes })
    }

    /// Takes the steps that are left.
    fn steps(&mut self, state: &mut State<D>, stage: &mut Stage<'_>) -> Result<()> {
        let (watching, checkpoints) = stage.parts();
        let mut observers: Vec<&mut dyn Observer> = Vec::new();
        self.history.iter_mut().for_each(|history| observers.push(history));
        observers.push(&mut self.meshes);
        observers.extend(watching);
        let keeper = checkpoints.map(|checkpoints| checkpoints as &mut dyn Keeper<D>);
        self.simulation.run_on(state, &mut self.record, &mut observers, keeper, self.course.take())
    }

    /// Runs the study with the generator of `[compare]`, leaves its frames beside those of this run, and adds to each
    /// report how the meshes compare.
    fn compare(&mut self, stage: &mut Stage<'_>) -> Result<()> {
        let Some(reference) = self.study.reference() else { return Ok(()) };
        let subdomains = reference.mesh.generator.subdomains();
        let directory = stage.directory;
        let mut frames = directory.map(|to| Frames::of_reference(to.path(), reference.frames(), subdomains));
        let (mut theirs, mut ends) = (Meshes::of(&self.study), Ends(stage.observers()));
        let mut observers: Vec<&mut dyn Observer> = vec![&mut theirs, &mut ends];
        frames.iter_mut().for_each(|frames| observers.push(frames));
        let mut simulation = reference.simulation()?;
        let mut state = reference.start(&simulation, &mut Record::default(), &mut observers)?;
        simulation.ran(&mut state, &mut Record::default(), &mut observers)?;
        for report in &mut self.record.reports {
            let at =
                |meshes: &Meshes<D>| meshes.found.iter().find(|(t, _)| *t == report.t).map(|(_, mesh)| mesh.clone());
            report.comparison = at(&self.meshes).zip(at(&theirs)).map(|(ours, theirs)| compare(&ours, &theirs));
        }
        Ok(())
    }

    /// Goes on to the end.
    pub(super) fn gone(&mut self, stage: &mut Stage<'_>) -> Result<()> {
        let mut state = match self.state.take() {
            Some(state) => state,
            None => {
                let start = self.study.start(&self.simulation, &mut self.record, &mut stage.observers())?;
                self.history =
                    stage.directory.map(|to| History::create(&to.path().join(names::HISTORY))).transpose()?;
                start
            }
        };
        let ended = self.steps(&mut state, stage);
        stage.output = self.record.seconds.output;
        let state = self.state.insert(state);
        ended?;
        self.record.warnings.extend(at_rest(&self.study, &self.simulation, state, &self.record)?);
        let written = stage.directory.is_some();
        stage.beside(|stage| self.compare(stage)).map_err(|error| match written {
            true => Error::Compared(Box::new(error)),
            false => error,
        })
    }

    /// Takes up a checkpoint.
    pub(super) fn taken_up(
        &mut self,
        MovingCheckpoint(found): MovingCheckpoint<D>,
        directory: Option<&Path>,
    ) -> Result<(SpentBy<Self>, Kept), Unfit> {
        let mesh = self.study.uniform_mesh().map_err(|error| Unfit::Damaged(error.to_string()))?;
        let Simulation { physics, schedule, safety, mover, .. } = &mut self.simulation;
        let state = found.state(&mesh, physics.as_ref(), schedule, *safety)?;
        mover.generator.resume(mesh.parameters(), &found.kept)?;
        self.meshes = Meshes::resume(&self.study, &mesh, &found.kept)?;
        let Checkpoint { record, course, kept, .. } = found;
        self.history = directory.map(|to| History::resume(&to.join(names::HISTORY), &kept)).transpose()?;
        (self.state, self.record, self.course) = (Some(state), record, Some(course));
        Ok((self.record.seconds, kept))
    }

    pub(super) fn last_scene(&self) -> Result<Vec<Scene>> {
        let unknowns = self.simulation.physics.unknowns();
        Ok(self.state.iter().map(|state| state.scene(&unknowns)).collect())
    }

    /// Leaves the history, and of a line arrays and a plot.
    pub(super) fn left(&mut self, directory: &RunDirectory) -> Result<()> {
        self.history.iter_mut().try_for_each(History::flush)?;
        match self.last_scene()?.last().filter(|_| D == 1) {
            Some(scene) => leave_line(&self.study.study.name, scene, directory),
            None => Ok(()),
        }
    }
}

impl<const D: usize> Running for MovingRun<D>
where
    Mesh<D>: Studied<D>,
{
    type Figures = MovingFigures;
    type Checkpoint = MovingCheckpoint<D>;

    fn go(&mut self, stage: &mut Stage<'_>) -> Result<()> {
        Mesh::go(self, stage)
    }

    fn resume(&mut self, found: MovingCheckpoint<D>, directory: Option<&Path>) -> Result<(SpentBy<Self>, Kept), Unfit> {
        Mesh::take_up(self, found, directory)
    }

    fn schedule(&mut self) -> Option<&mut Schedule> {
        Some(&mut self.simulation.schedule)
    }

    fn frames(&self) -> (FramesAt, [usize; 2]) {
        (self.study.frames(), self.study.mesh.generator.subdomains())
    }

    fn scenes(&self) -> Result<Vec<Scene>> {
        Mesh::scenes(self)
    }

    fn leave(&mut self, directory: &RunDirectory) -> Result<()> {
        Mesh::leave(self, directory)
    }

    fn tell(&self, summary: &mut Summary<MovingFigures>) {
        let Record { work, safety, reports, warnings, .. } = self.record.clone();
        summary.figures = MovingFigures { work, safety, reports };
        (summary.seconds, summary.warnings) = (self.record.seconds, warnings);
    }

    fn warn(&mut self, warnings: Vec<String>) {
        self.record.warnings.extend(warnings);
    }
}

/// Everything that the steps of a run to come depend on, and what was found in those done.
#[derive(Deserialize)]
pub struct MovingCheckpoint<const D: usize = 2>(Checkpoint<D>);

/// Leaves the arrays of a line and a plot of its first unknown.
fn leave_line(name: &str, scene: &Scene, directory: &RunDirectory) -> Result<()> {
    directory.write(names::ARRAYS, &final_arrays(scene))?;
    let curves = scene.nodal.iter().filter_map(|(name, values)| match values {
        Values::Scalars(values) => {
            let points = scene.points.iter().zip(values).map(|(x, u)| [x[0], *u]).collect();
            Some(Curve { name: name.clone(), points, ..Curve::default() })
        }
        _ => None,
    });
    let figure = Figure {
        title: format!("{name}, t = {}", moment(scene.t)),
        labels: ["x".into(), scene.nodal.first().map_or("u".into(), |(name, _)| name.clone())],
        scales: [Scale::Linear; 2],
        curves: curves.collect(),
        ..Figure::default()
    };
    figure.draw().write(directory.path(), names::MESH)
}

/// Keeps the meshes at the times of reports, where `[compare]` gives something to compare them with.
struct Meshes<const D: usize> {
    at: Vec<f64>,
    found: Vec<(f64, Mesh<D>)>,
}

impl<const D: usize> Meshes<D>
where
    Mesh<D>: Studied<D>,
{
    fn of(study: &MovingStudy<D>) -> Self {
        let at = if study.compare.is_some() { study.time.report.clone() } else { Vec::new() };
        Self { at, found: Vec::new() }
    }

    fn resume(study: &MovingStudy<D>, mesh: &Mesh<D>, kept: &Kept) -> Result<Self, Unfit> {
        let found: Vec<(f64, Vec<f64>)> = kept.get("meshes")?;
        let moved = |(t, x): (f64, Vec<f64>)| {
            let (x, rest) = x.as_chunks::<D>();
            check_nodal("mesh at a report", x, mesh.lattice().len() + rest.len())?;
            Ok((t, mesh.placed(x.to_vec()).map_err(|failure| Unfit::Damaged(failure.to_string()))?))
        };
        Ok(Self { found: found.into_iter().map(moved).collect::<Result<_, Unfit>>()?, ..Self::of(study) })
    }
}

impl<const D: usize> Observer for Meshes<D> {
    fn observe(&mut self, event: Event, snapshot: &Snapshot<'_>) -> Result<()> {
        if let Some(state) = snapshot.state::<D>()
            && event != Event::Finished
            && self.at.contains(&state.t)
            && self.found.last().is_none_or(|(t, _)| *t != state.t)
        {
            self.found.push((state.t, state.mesh.clone()));
        }
        Ok(())
    }

    fn keep(&mut self, kept: &mut Kept) -> Result<()> {
        kept.put(
            "meshes",
            &self.found.iter().map(|(t, mesh)| (t, mesh.parameters().x().as_flattened())).collect::<Vec<_>>(),
        );
        Ok(())
    }
}

/// Ends the run of `[compare]` where those who watch the run itself ask for that.
struct Ends<'a>(Vec<&'a mut dyn Observer>);

impl Observer for Ends<'_> {
    fn observe(&mut self, _event: Event, _snapshot: &Snapshot<'_>) -> Result<()> {
        Ok(())
    }

    fn interrupts(&self) -> bool {
        self.0.iter().any(|watcher| watcher.interrupts())
    }
}
