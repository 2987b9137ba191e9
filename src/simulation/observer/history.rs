use super::{Event, Observer, Snapshot};
use crate::error::{Error, Result, Unfit};
use crate::kept::Kept;
use serde::Serialize;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// `history.csv`: one row for the initial state and one a step; iterations, rejected steps and seconds are totals since the start.
///
/// Rows reach the file whole, so that a run that is killed leaves whole rows, and twice a second: a call of the system for
/// each would cost as much as a small step.
#[derive(Debug)]
pub struct History {
    path: PathBuf,
    writer: csv::Writer<File>,
    flushed: Instant,
}

const BETWEEN_FLUSHES: Duration = Duration::from_millis(500);
/// Bytes for the rows of that time, at any speed.
const BUFFER: usize = 1 << 20;

#[derive(Serialize)]
struct Row {
    t: f64,
    dt: f64,
    min_scaled_jacobian: f64,
    q_max: f64,
    q_mean: f64,
    error_linf: Option<f64>,
    error_l2: Option<f64>,
    linear_iterations: usize,
    newton_iterations: usize,
    interface_standard_error: Option<f64>,
    interface_noise: Option<f64>,
    contraction_observed: Option<f64>,
    contraction_predicted: Option<f64>,
    rejected_steps: usize,
    seconds: f64,
}

impl History {
    /// Starts the file.
    ///
    /// # Errors
    /// [`Error::Unwritable`].
    pub fn create(path: &Path) -> Result<Self> {
        let path = path.to_path_buf();
        match csv::WriterBuilder::new().buffer_capacity(BUFFER).from_path(&path) {
            Ok(writer) => Ok(Self { path, writer, flushed: Instant::now() }),
            Err(error) => Err(Error::Unwritable { path, reason: error.to_string() }),
        }
    }

    /// Writes the rows that wait.
    ///
    /// # Errors
    /// [`Error::Unwritable`].
    pub fn flush(&mut self) -> Result<()> {
        self.flushed = Instant::now();
        self.writer.flush().map_err(|error| self.unwritable(error.to_string()))
    }

    fn unwritable(&self, reason: String) -> Error {
        Error::Unwritable { path: self.path.clone(), reason }
    }

    /// Goes on behind the rows that a checkpoint knows of; later ones are dropped.
    ///
    /// # Errors
    /// [`Unfit`] where they are not there.
    pub(crate) fn resume(path: &Path, kept: &Kept) -> Result<Self, Unfit> {
        let file = reopened(path, kept.get("history")?)?;
        let writer = csv::WriterBuilder::new().has_headers(false).buffer_capacity(BUFFER).from_writer(file);
        Ok(Self { path: path.to_path_buf(), writer, flushed: Instant::now() })
    }
}

/// A file of rows cut back to a length at which one ended, ready for the next.
pub(crate) fn reopened(path: &Path, length: u64) -> Result<File, Unfit> {
    let file = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let beside = |reason: String| Unfit::Beside { file: file.clone(), reason };
    let open = || -> std::io::Result<Result<File, Unfit>> {
        let mut rows = File::options().read(true).write(true).open(path)?;
        let there = rows.metadata()?.len();
        if there < length {
            return Ok(Err(beside(format!("it has {there} bytes of the {length} that it had"))));
        }
        let mut end = [0];
        rows.seek(SeekFrom::Start(length.saturating_sub(1)))?;
        rows.read_exact(&mut end)?;
        if end != *b"\n" {
            return Ok(Err(beside(format!("no row ends at byte {length}, where one did"))));
        }
        rows.set_len(length)?;
        rows.seek(SeekFrom::Start(length))?;
        Ok(Ok(rows))
    };
    open().unwrap_or_else(|error| Err(beside(error.to_string())))
}

/// The length of a file of whole rows, which are on the disk then.
pub(crate) fn synced(file: &File) -> std::io::Result<u64> {
    file.sync_data()?;
    Ok(file.metadata()?.len())
}

impl Observer for History {
    fn observe(&mut self, event: Event, snapshot: &Snapshot<'_>) -> Result<()> {
        match event {
            Event::Resumed => return Ok(()),
            Event::Finished => return self.flush(),
            Event::Started | Event::Stepped => {}
        }
        let work = snapshot.work.work;
        let contraction = snapshot.interface.and_then(|i| i.contraction);
        let row = Row {
            t: snapshot.state.t,
            dt: snapshot.dt,
            min_scaled_jacobian: snapshot.quality.min_scaled_jacobian,
            q_max: snapshot.quality.q_max,
            q_mean: snapshot.quality.q_mean,
            error_linf: snapshot.error.map(|e| e.linf),
            error_l2: snapshot.error.map(|e| e.l2),
            linear_iterations: work.linear_iterations,
            newton_iterations: work.newton_iterations,
            interface_standard_error: snapshot.interface.and_then(|i| i.standard_error),
            interface_noise: snapshot.interface.and_then(|i| i.noise),
            contraction_observed: contraction.map(|c| c.observed),
            contraction_predicted: contraction.map(|c| c.predicted),
            rejected_steps: snapshot.work.rejected_steps,
            seconds: snapshot.seconds,
        };
        self.writer.serialize(row).map_err(|error| self.unwritable(error.to_string()))?;
        if self.flushed.elapsed() < BETWEEN_FLUSHES { Ok(()) } else { self.flush() }
    }

    fn keep(&mut self, kept: &mut Kept) -> Result<()> {
        self.flush()?;
        let length = synced(self.writer.get_ref()).map_err(|error| self.unwritable(error.to_string()))?;
        kept.put("history", &length);
        Ok(())
    }
}
