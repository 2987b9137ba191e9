use super::{Event, Observer, Snapshot};
use crate::error::{Error, Result};
use serde::Serialize;
use std::fs::File;
use std::path::{Path, PathBuf};

/// `history.csv`: one row for the initial state and one a step; iterations and seconds are totals since the start.
#[derive(Debug)]
pub struct History {
    path: PathBuf,
    writer: csv::Writer<File>,
}

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
    seconds: f64,
}

impl History {
    /// Starts the file.
    ///
    /// # Errors
    /// [`Error::Unwritable`].
    pub fn create(path: &Path) -> Result<Self> {
        let path = path.to_path_buf();
        match csv::Writer::from_path(&path) {
            Ok(writer) => Ok(Self { path, writer }),
            Err(error) => Err(Error::Unwritable { path, reason: error.to_string() }),
        }
    }
}

impl Observer for History {
    fn observe(&mut self, event: Event, snapshot: &Snapshot<'_>) -> Result<()> {
        if event == Event::Finished {
            return Ok(());
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
            seconds: snapshot.seconds,
        };
        // row by row, so that a run that is killed leaves whole rows
        let written = self.writer.serialize(row).map_err(|error| error.to_string());
        let written = written.and_then(|()| self.writer.flush().map_err(|error| error.to_string()));
        written.map_err(|reason| Error::Unwritable { path: self.path.clone(), reason })
    }
}
