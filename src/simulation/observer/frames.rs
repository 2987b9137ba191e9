use super::{Event, Observer, Snapshot, vtu};
use crate::error::{Error, Result};
use crate::simulation::State;
use crate::simulation::report::write_file;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// When frames are written; the first and the last state are always among them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
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

/// `frames/*.vtu` and the `run.pvd` that puts them in time, for ParaView, PyVista and meshio.
#[derive(Debug)]
pub struct Frames {
    directory: PathBuf,
    at: FramesAt,
    written: Vec<(f64, String)>,
}

impl Frames {
    /// Starts the series in a run directory.
    ///
    /// # Errors
    /// [`Error::Unwritable`].
    pub fn create(directory: &Path, at: FramesAt) -> Result<Self> {
        let frames = directory.join("frames");
        std::fs::create_dir_all(&frames)
            .map_err(|error| Error::Unwritable { path: frames, reason: error.to_string() })?;
        Ok(Self { directory: directory.to_path_buf(), at, written: Vec::new() })
    }

    /// Writes one frame, unless the state has one already. The series is complete after every call.
    ///
    /// # Errors
    /// [`Error::Unwritable`].
    pub fn write(&mut self, unknowns: &[String], state: &State) -> Result<()> {
        let name = format!("frames/step-{:06}.vtu", state.step);
        if self.written.iter().any(|(_, written)| *written == name) {
            return Ok(());
        }
        let lattice = state.mesh.lattice();
        let mut fields: Vec<(&str, Vec<f64>)> = (unknowns.iter().enumerate())
            .map(|(c, unknown)| {
                let values: Vec<f64> = state.u.component(c).collect();
                (unknown.as_str(), lattice.closed(&values).into_owned())
            })
            .collect();
        // an unknown may have that name
        let density = if unknowns.iter().any(|unknown| unknown == "rho") { "mesh density" } else { "rho" };
        fields.push((density, lattice.closed(&state.rho).into_owned()));
        let document = vtu::document(lattice.cells(), &state.mesh.closed(), &fields);
        write_file(&self.directory.join(&name), document.as_bytes())?;
        self.written.push((state.t, name));
        let entries: String =
            (self.written.iter()).map(|(t, name)| format!("<DataSet timestep=\"{t}\" file=\"{name}\"/>\n")).collect();
        let series = format!(
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"1.0\" byte_order=\"LittleEndian\">\n\
             <Collection>\n{entries}</Collection>\n</VTKFile>\n"
        );
        write_file(&self.directory.join("run.pvd"), series.as_bytes())
    }
}

impl Observer for Frames {
    fn observe(&mut self, event: Event, snapshot: &Snapshot<'_>) -> Result<()> {
        let due = event != Event::Stepped || self.at.due(snapshot.state.step, snapshot.state.t, snapshot.dt);
        if due { self.write(snapshot.unknowns, snapshot.state) } else { Ok(()) }
    }
}
