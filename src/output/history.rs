use super::rows::Rows;
use crate::error::{Result, Unfit};
use crate::kept::Kept;
use crate::simulation::{Event, Moving, Observer, Snapshot};
use serde::Serialize;
use std::path::Path;
use std::time::{Duration, Instant};

/// `history.csv`: one row for the initial state and one a step; iterations, rejected steps and seconds are totals since
/// the start.
///
/// Rows reach the file whole, and twice a second: a call of the system for each would cost as much as a small step.
#[derive(Debug)]
pub struct History {
    rows: Rows,
    flushed: Instant,
}

/// Least time between two writings of rows to the file: a watching reader waits no longer, and short steps cost little.
const BETWEEN_FLUSHES: Duration = Duration::from_millis(500);

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
    /// [`Error::Unwritable`](crate::Error::Unwritable).
    pub fn create(path: &Path) -> Result<Self> {
        Ok(Self { rows: Rows::create(path)?, flushed: Instant::now() })
    }

    /// Writes the rows that wait.
    ///
    /// # Errors
    /// [`Error::Unwritable`](crate::Error::Unwritable).
    pub fn flush(&mut self) -> Result<()> {
        self.flushed = Instant::now();
        self.rows.flush()
    }

    /// Goes on behind the rows that a checkpoint knows of; later ones are dropped.
    ///
    /// # Errors
    /// [`Unfit`] where they are not there.
    pub(crate) fn resume(path: &Path, kept: &Kept) -> Result<Self, Unfit> {
        Ok(Self { rows: Rows::reopen(path, kept.get("history")?)?, flushed: Instant::now() })
    }
}

impl Observer for History {
    fn observe(&mut self, event: Event, snapshot: &Snapshot<'_>) -> Result<()> {
        match event {
            Event::Resumed => return Ok(()),
            Event::Finished => return self.flush(),
            Event::Started | Event::Stepped => {}
        }
        // runs of other kinds have other columns
        let Some(Moving { quality, error, work: total, interface, .. }) = &snapshot.moving else { return Ok(()) };
        let contraction = interface.and_then(|i| i.contraction);
        let row = Row {
            t: snapshot.t,
            dt: snapshot.dt,
            min_scaled_jacobian: quality.min_scaled_jacobian,
            q_max: quality.q_max,
            q_mean: quality.q_mean,
            error_linf: error.map(|e| e.linf),
            error_l2: error.map(|e| e.l2),
            linear_iterations: total.work.linear_iterations,
            newton_iterations: total.work.newton_iterations,
            interface_standard_error: interface.and_then(|i| i.standard_error),
            interface_noise: interface.and_then(|i| i.noise),
            contraction_observed: contraction.map(|c| c.observed),
            contraction_predicted: contraction.and_then(|c| c.predicted),
            rejected_steps: total.rejected_steps,
            seconds: snapshot.seconds,
        };
        self.rows.add(row)?;
        if self.flushed.elapsed() < BETWEEN_FLUSHES { Ok(()) } else { self.flush() }
    }

    fn keep(&mut self, kept: &mut Kept) -> Result<()> {
        kept.put("history", &self.rows.sync()?);
        Ok(())
    }
}
