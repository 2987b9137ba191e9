use super::directory::is_frame;
use super::vtu::{self, Values};
use crate::error::{Error, Result, Unfit};
use crate::geometry::{cell_jacobians, cell_qualities};
use crate::kept::{Kept, check_nodal};
use crate::meshing::Decomposition;
use crate::output::write_file;
use crate::simulation::State;
use crate::simulation::{Event, Observer, Snapshot};
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
    /// After so many steps each.
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

/// `frames/*.vtu` and the `run.pvd` that puts them in time, for ParaView, PyVista and meshio: the unknowns, ρ and the mesh
/// velocity at the nodes; Q, the smallest corner Jacobian and the number of the subdomain in the cells.
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

/// A thread beside the run that writes one frame at a time; starting one a frame would cost more than to prepare the frame.
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
    /// Starts the series in a run directory.
    ///
    /// # Errors
    /// [`Error::Unwritable`].
    pub fn create(directory: &Path, at: FramesAt, subdomains: [usize; 2]) -> Result<Self> {
        Self::named(directory, at, subdomains, ["frames", "run.pvd"])
    }

    /// Starts the series of the run that this one is compared with: `compare/*.vtu` and `compare.pvd`.
    ///
    /// # Errors
    /// [`Error::Unwritable`].
    pub fn of_reference(directory: &Path, at: FramesAt, subdomains: [usize; 2]) -> Result<Self> {
        Self::named(directory, at, subdomains, ["compare", "compare.pvd"])
    }

    fn named(directory: &Path, at: FramesAt, subdomains: [usize; 2], names: [&'static str; 2]) -> Result<Self> {
        let frames = directory.join(names[0]);
        std::fs::create_dir_all(&frames)
            .map_err(|error| Error::Unwritable { path: frames, reason: error.to_string() })?;
        let directory = directory.to_path_buf();
        Ok(Self {
            directory,
            at,
            subdomains,
            names,
            grid: None,
            nodes: [None, None],
            written: Vec::new(),
            writer: None,
        })
    }

    /// Writes one frame, unless the state has one already. The series is complete after every call.
    ///
    /// # Errors
    /// [`Error::Unwritable`].
    pub fn write(&mut self, unknowns: &[String], state: &State) -> Result<()> {
        self.start(unknowns, state)?;
        self.wait()
    }

    /// The same, with compressing and writing left to a thread beside the run.
    fn start(&mut self, unknowns: &[String], state: &State) -> Result<()> {
        self.wait()?;
        if self.written.iter().any(|(_, written)| *written == state.step) {
            return Ok(());
        }
        let lattice = state.mesh.lattice();
        let scalars = |values: &[f64]| Values::Scalars(lattice.closed(values).into_owned());
        let mut nodes: Vec<(String, Values)> = (unknowns.iter().enumerate())
            .map(|(c, unknown)| (unknown.clone(), scalars(&state.u.component(c).collect::<Vec<f64>>())))
            .collect();
        // an unknown may have that name
        let density = if unknowns.iter().any(|unknown| unknown == "rho") { "mesh density" } else { "rho" };
        nodes.push((density.into(), scalars(&state.rho)));
        nodes.push(("mesh velocity".into(), Values::Vectors(lattice.closed(&self.velocity(state)).into_owned())));
        let subdomains = Decomposition::new(lattice, self.subdomains)?.of_cells();
        let inside = |name: &str| match unknowns.iter().any(|unknown| unknown == name) {
            true => format!("{name} of cells"),
            false => name.into(),
        };
        let cells = [
            (inside("Q"), Values::Scalars(cell_qualities(&state.mesh))),
            (inside("jacobian"), Values::Scalars(cell_jacobians(&state.mesh))),
            (inside("subdomain"), Values::Numbers(subdomains)),
        ];
        let points = state.mesh.closed().into_owned();
        self.written.push((state.t, state.step));
        let series = self.series();
        let grid = self.grid.get_or_insert_with(|| Arc::new(vtu::Grid::new(lattice.cells()))).clone();
        let [frame, index] = [self.name(state.step).as_str(), self.names[1]].map(|name| self.directory.join(name));
        self.writer.get_or_insert_with(Writer::start).write(Box::new(move || {
            write_file(&frame, grid.document(&points, &nodes, &cells).as_bytes())?;
            write_file(&index, series.as_bytes())
        }));
        Ok(())
    }

    fn name(&self, step: usize) -> String {
        frame_name(self.names[0], step)
    }

    /// The file that puts the frames in time.
    fn series(&self) -> String {
        vtu::collection(self.written.iter().map(|(t, step)| (*t, self.name(*step))))
    }

    /// Goes on behind the frames that a checkpoint knows of, from its state; later ones are removed.
    ///
    /// # Errors
    /// [`Unfit`] where they are not there.
    pub(crate) fn resume(
        directory: &Path,
        at: FramesAt,
        subdomains: [usize; 2],
        state: &State,
        kept: &Kept,
    ) -> Result<Self, Unfit> {
        let beside = |file: &Path, error: &dyn std::fmt::Display| Unfit::Beside {
            file: file.display().to_string(),
            reason: error.to_string(),
        };
        let mut frames = Self::create(directory, at, subdomains).map_err(|error| beside(directory, &error))?;
        let KeptFrames { written, before } = kept.get("frames")?;
        let names: Vec<PathBuf> = written.iter().map(|(_, step)| directory.join(frames.name(*step))).collect();
        if let Some(missing) = names.iter().find(|name| !name.is_file()) {
            return Err(beside(missing, &"it is not there"));
        }
        if let Some((t, x)) = before {
            check_nodal("frame before", &x, state.mesh.x().len())?;
            frames.nodes[1] = Some((t, x));
        }
        frames.nodes[0] = Some((state.t, state.mesh.x().to_vec()));
        frames.written = written;
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

    /// How fast the nodes moved in the step that led to a state; they rest at the start.
    fn velocity(&self, state: &State) -> Vec<[f64; 2]> {
        match &self.nodes {
            [Some((t, x)), Some((before, old))] if *t == state.t && t > before => {
                let per = 1.0 / (t - before);
                x.iter().zip(old).map(|(x, old)| [0, 1].map(|d| (x[d] - old[d]) * per)).collect()
            }
            _ => vec![[0.0; 2]; state.rho.len()],
        }
    }
}

impl Observer for Frames {
    fn observe(&mut self, event: Event, snapshot: &Snapshot<'_>) -> Result<()> {
        let state = snapshot.state;
        if event == Event::Resumed {
            return Ok(());
        }
        if event != Event::Finished {
            self.nodes.swap(0, 1);
            let [newest, _] = &mut self.nodes;
            let (t, x) = newest.get_or_insert_default();
            *t = state.t;
            x.clear();
            x.extend_from_slice(state.mesh.x());
        }
        match event {
            Event::Stepped if !self.at.due(state.step, state.t, snapshot.dt) => Ok(()),
            Event::Finished => self.write(snapshot.unknowns, state),
            _ => self.start(snapshot.unknowns, state),
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
