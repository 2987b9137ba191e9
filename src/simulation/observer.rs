//! Who watches a run: each observer sees the state after every step.

use super::{ErrorNorms, State, WorkTotal};
use crate::error::Result;
use crate::geometry::Quality;
use crate::kept::Kept;
use crate::meshing::Interface;

/// What just happened.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Event {
    /// The initial state is there.
    Started,
    /// The state of a checkpoint is there, from which the run goes on.
    Resumed,
    /// A step was done.
    Stepped,
    /// The end was reached.
    Finished,
}

/// What an observer sees.
#[derive(Debug)]
pub struct Snapshot<'a> {
    /// Time, mesh and solution.
    pub state: &'a State,
    /// Names of the unknowns.
    pub unknowns: &'a [String],
    /// Length of the step that led here; 0 at the start.
    pub dt: f64,
    /// Number of steps of the whole run.
    pub steps: Option<usize>,
    /// Share of the simulated time that is done, 0 … 1.
    pub share: f64,
    /// Quality of the mesh.
    pub quality: Quality,
    /// Error where an exact solution is known.
    pub error: Option<ErrorNorms>,
    /// Work so far.
    pub work: WorkTotal,
    /// What the last step knows about the interfaces between subdomains.
    pub interface: Option<Interface>,
    /// Seconds since the run began, over all its parts.
    pub seconds: f64,
}

/// How far a run on a line has come in time.
#[derive(Debug, Clone, Copy)]
pub struct Advance {
    /// Time.
    pub t: f64,
    /// Steps done.
    pub step: usize,
    /// Steps of the whole run, where they are known.
    pub steps: Option<usize>,
    /// Share of the simulated time that is done, 0 … 1.
    pub share: f64,
    /// The smallest Jacobian over that of equal cells: on a line, the shortest cell over the mean one.
    pub smallest: f64,
    /// Seconds since the run began, over all its parts.
    pub seconds: f64,
}

/// Something that follows a run.
pub trait Observer {
    /// Called after every event. An error ends the run.
    ///
    /// # Errors
    /// Whatever stops the observer from doing its work, such as a full disk.
    fn observe(&mut self, event: Event, snapshot: &Snapshot<'_>) -> Result<()>;

    /// Called before the run, with every mesh on the way to the one that is adapted to the initial solution. An error
    /// ends the run.
    ///
    /// # Errors
    /// Whatever stops the observer from doing its work.
    fn adapting(&mut self, _state: &State) -> Result<()> {
        Ok(())
    }

    /// Called in place of [`observe`](Self::observe) after every step of a run on a line.
    fn advanced(&mut self, _advance: &Advance) {}

    /// Asked after every step: true ends the run there, with a checkpoint where it has any.
    fn interrupts(&self) -> bool {
        false
    }

    /// Puts what it carries from step to step into a checkpoint, and makes sure that what it wrote so far is on the
    /// disk.
    ///
    /// # Errors
    /// What hinders that.
    fn keep(&mut self, _kept: &mut Kept) -> Result<()> {
        Ok(())
    }
}
