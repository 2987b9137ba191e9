use super::directory::is_frame;
use super::{names, vtu};
use crate::error::{Error, Result, Unfit};
use crate::geometry::Lattice;
use crate::kept::Kept;
use crate::meshing::Decomposition;
use crate::output::write_file;
use crate::parallel::map;
use crate::simulation::{Event, Observer, Scene, Snapshot, Values};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;

/// When frames are written; the first and the last state are always among them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum FramesAt {
    /// Every n steps.
    Every(usize),
    /// At the first step not before each of these times, which lie within the run.
    Times(Vec<f64>),
}

impl FramesAt {
    /// Refuses settings out of range.
    ///
    /// # Errors
    /// [`Error::Invalid`] for every = 0 or a time that is not within the run.
    pub fn check(&self, [start, end]: [f64; 2]) -> Result<()> {
        match self {
            Self::Every(0) => Err(Error::invalid("frames.every", 0, "must be 1 or more")),
            Self::Every(_) => Ok(()),
            Self::Times(times) => match times.iter().find(|t| !(start..=end).contains(*t)) {
                Some(t) => {
                    let rule = format!("must lie between time.start = {start} and time.end = {end}");
                    Err(Error::invalid("frames.times", t, rule))
                }
                None => Ok(()),
            },
        }
    }

    /// Whether a frame is due at time `now`, after a step of length `dt`.
    pub(crate) fn due(&self, step: usize, now: f64, dt: f64) -> bool {
        match self {
            Self::Every(n) => step.is_multiple_of(*n),
            // due where the time lies in the step that led here, give or take round-off
            Self::Times(times) => times.iter().any(|&t| {
                let slack = 1e-9 * dt;
                t <= now + slack && t > now - dt + slack
            }),
        }
    }
}

/// `frames/*.vtu` and the `run.pvd` that puts them in time, for ParaView, PyVista and meshio
///
/// A frame holds what its scene does. To a mesh in two dimensions that a density moves it adds ρ at the nodes and the
/// number of the subdomain in the cells, and to every mesh that moves its velocity at the nodes.
#[derive(Debug)]
pub struct Frames {
    directory: PathBuf,
    at: FramesAt,
    subdomains: [usize; 2],
    /// Folder of the frames, and the file that puts them in time.
    names: [&'static str; 2],
    grid: Option<Arc<vtu::Grid>>,
    /// Nodes of the last mesh and of the one before, with their times.
    nodes: [Option<(f64, Vec<[f64; 2]>)>; 2],
    /// Times and steps of the frames.
    written: Vec<(f64, usize)>,
    /// Compresses and writes frames while the run goes on.
    writer: Option<Writer>,
}

/// The file of a frame, in its folder.
pub(crate) fn frame_name(folder: &str, number: usize) -> String {
    format!("{folder}/step-{number:06}.vtu")
}

/// A thread beside the run that writes one frame at a time; starting one a frame would cost more than to prepare the
/// frame.
#[derive(Debug)]
struct Writer {
    jobs: Sender<Job>,
    outcomes: Receiver<Result<()>>,
    thread: JoinHandle<()>,
    busy: bool,
}

type Job = Box<dyn FnOnce() -> Result<()> + Send>;

impl Writer {
    fn start() -> Self {
        let (jobs, waiting) = channel::<Job>();
        let (done, outcomes) = channel();
        let thread = std::thread::spawn(move || {
            let _ = waiting.into_iter().try_for_each(|job| done.send(job()));
        });
        Self { jobs, outcomes, thread, busy: false }
    }

    /// Hands over a frame, when the one before is written.
    fn write(&mut self, job: Job) {
        self.busy = true;
        // a thread that is no more is noticed where it is waited for
        let _ = self.jobs.send(job);
    }

    /// Ends the thread, with its panic where it had one.
    fn end(self) {
        drop(self.jobs);
        if let Err(panic) = self.thread.join() {
            std::panic::resume_unwind(panic);
        }
    }
}

/// What frames to come depend on, beside the state.
#[derive(Serialize, Deserialize)]
struct KeptFrames {
    written: Vec<(f64, usize)>,
    before: Option<(f64, Vec<[f64; 2]>)>,
}

impl Frames {
    /// Starts the series in a run directory, of a mesh with this number of subdomains along each axis.
    pub fn create(directory: &Path, at: FramesAt, subdomains: [usize; 2]) -> Self {
        Self::named(directory, at, subdomains, names::FRAMES)
    }

    /// Starts the series of the run that this one is compared with: `compare/*.vtu` and `compare.pvd`.
    pub fn of_reference(directory: &Path, at: FramesAt, subdomains: [usize; 2]) -> Self {
        Self::named(directory, at, subdomains, names::COMPARED)
    }

    fn named(directory: &Path, at: FramesAt, subdomains: [usize; 2], names: [&'static str; 2]) -> Self {
        let directory = directory.to_path_buf();
        Self { directory, at, subdomains, names, grid: None, nodes: [None, None], written: Vec::new(), writer: None }
    }

    /// Writes a frame of each scene whose step has none yet, side by side. The series is complete after every call.
    ///
    /// # Errors
    /// [`Error::Unwritable`].
    pub fn write(&mut self, scenes: Vec<Scene>) -> Result<()> {
        self.wait()?;
        let mut new = Vec::new();
        for scene in scenes {
            let entered = self.entered(scene)?;
            new.extend(entered.map(|scene| (self.directory.join(self.name(scene.step)), scene)));
        }
        let Some(grid) = self.grid.as_ref().filter(|_| !new.is_empty()) else { return Ok(()) };
        let written = map(&new, |(path, scene)| write_file(path, grid.document(scene).as_bytes()));
        written.into_iter().collect::<Result<()>>()?;
        write_file(&self.directory.join(self.names[1]), self.series().as_bytes())
    }

    /// Enters one scene in the series; a thread beside the run compresses and writes it.
    fn start(&mut self, scene: Scene) -> Result<()> {
        self.wait()?;
        if let (Some(scene), Some(grid)) = (self.entered(scene)?, self.grid.clone()) {
            let series = self.series();
            let [frame, index] = [self.name(scene.step).as_str(), self.names[1]].map(|name| self.directory.join(name));
            self.writer.get_or_insert_with(Writer::start).write(Box::new(move || {
                write_file(&frame, grid.document(&scene).as_bytes())?;
                write_file(&index, series.as_bytes())
            }));
        }
        Ok(())
    }

    /// Enters a scene in the series, with what every frame has; none where its step has a frame.
    fn entered(&mut self, mut scene: Scene) -> Result<Option<Scene>> {
        if self.written.iter().any(|(_, written)| *written == scene.step) {
            return Ok(None);
        }
        if scene.cells[1] > 0 {
            self.complete(&mut scene)?;
        }
        if self.grid.is_none() {
            let folder = self.directory.join(self.names[0]);
            std::fs::create_dir_all(&folder).map_err(Error::unwritable(&folder))?;
            self.grid = Some(Arc::new(vtu::Grid::new(scene.cells)));
        }
        self.written.push((scene.t, scene.step));
        Ok(Some(scene))
    }

    /// Adds what every frame of a mesh in two dimensions has.
    fn complete(&self, scene: &mut Scene) -> Result<()> {
        let wraps = [0, 1].map(|d| scene.periodic[d] || scene.closed[d]);
        let lattice = Lattice::new(scene.cells, wraps)?;
        let moves = scene.moves();
        if let Some(density) = scene.density.take() {
            // an unknown may have that name
            let name = if scene.has("rho") { "mesh density" } else { "rho" };
            let subdomains = Decomposition::new(&lattice, self.subdomains)?.of_cells();
            scene.add_to_cells("subdomain", Values::Numbers(subdomains));
            scene.nodal.push((name.into(), Values::Scalars(density)));
        }
        if moves {
            let velocity = lattice.closed(&self.velocity(scene.t, lattice.len())).into_owned();
            scene.nodal.push(("mesh velocity".into(), Values::Vectors(velocity)));
        }
        Ok(())
    }

    fn name(&self, step: usize) -> String {
        frame_name(self.names[0], step)
    }

    /// The file that puts the frames in time.
    fn series(&self) -> String {
        vtu::collection(self.written.iter().map(|(t, step)| (*t, self.name(*step))))
    }

    /// Goes on behind the frames that a checkpoint knows of; later ones are removed.
    ///
    /// # Errors
    /// [`Unfit`] where they are not there.
    pub(crate) fn resume(directory: &Path, at: FramesAt, subdomains: [usize; 2], kept: &Kept) -> Result<Self, Unfit> {
        let beside = |file: &Path, error: &dyn std::fmt::Display| Unfit::Beside {
            file: file.display().to_string(),
            reason: error.to_string(),
        };
        let KeptFrames { written, before } = kept.get("frames")?;
        let mut frames = Self::create(directory, at, subdomains);
        (frames.written, frames.nodes) = (written, [None, before]);
        let names: Vec<PathBuf> = frames.written.iter().map(|(_, step)| directory.join(frames.name(*step))).collect();
        if let Some(missing) = names.iter().find(|name| !name.is_file()) {
            return Err(beside(missing, &"it is not there"));
        }
        let entries = std::fs::read_dir(directory.join(frames.names[0])).into_iter().flatten().flatten();
        for later in entries.map(|entry| entry.path()).filter(|path| is_frame(path) && !names.contains(path)) {
            std::fs::remove_file(&later).map_err(|error| beside(&later, &error))?;
        }
        let index = directory.join(frames.names[1]);
        write_file(&index, frames.series().as_bytes()).map_err(|error| beside(&index, &error))?;
        Ok(frames)
    }

    fn wait(&mut self) -> Result<()> {
        let wanted = self.writer.as_mut().filter(|writer| writer.busy).map(|writer| {
            writer.busy = false;
            writer.outcomes.recv()
        });
        match wanted {
            None => Ok(()),
            Some(Ok(written)) => written,
            Some(Err(_)) => {
                self.writer.take().into_iter().for_each(Writer::end);
                Ok(())
            }
        }
    }

    /// How fast the nodes moved in the step that led to a time; they rest at the start.
    fn velocity(&self, now: f64, nodes: usize) -> Vec<[f64; 2]> {
        match &self.nodes {
            [Some((t, x)), Some((before, old))] if *t == now && t > before && x.len() == old.len() => {
                let per = 1.0 / (t - before);
                x.iter().zip(old).map(|(x, old)| [0, 1].map(|d| (x[d] - old[d]) * per)).collect()
            }
            _ => vec![[0.0; 2]; nodes],
        }
    }
}

impl Observer for Frames {
    fn observe(&mut self, event: Event, snapshot: &Snapshot<'_>) -> Result<()> {
        // the nodes before those of a checkpoint are in it
        if matches!(event, Event::Started | Event::Stepped) {
            self.nodes.swap(0, 1);
        }
        if event != Event::Finished {
            let (t, x) = self.nodes[0].get_or_insert_default();
            *t = snapshot.t;
            x.clear();
            x.extend_from_slice(snapshot.nodes);
        }
        match event {
            Event::Resumed => Ok(()),
            Event::Stepped if !self.at.due(snapshot.step, snapshot.t, snapshot.dt) => Ok(()),
            Event::Finished => self.write(vec![(snapshot.scene)()]),
            _ => self.start((snapshot.scene)()),
        }
    }

    fn keep(&mut self, kept: &mut Kept) -> Result<()> {
        self.wait()?;
        let before = self.nodes[1].clone();
        kept.put("frames", &KeptFrames { written: self.written.clone(), before });
        Ok(())
    }
}

impl Drop for Frames {
    /// A run that ends early leaves no thread behind.
    fn drop(&mut self) {
        let _ = self.wait();
        self.writer.take().into_iter().for_each(Writer::end);
    }
}
