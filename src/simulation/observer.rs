//! Who watches a run: each observer is told of every step.

use super::{ErrorNorms, Scene, State, WorkTotal};
use crate::error::Result;
use crate::geometry::Quality;
use crate::kept::Kept;
use crate::meshing::Interface;
use std::any::Any;

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

/// What an observer sees of a run of any kind.
pub struct Snapshot<'a> {
    /// Simulated time.
    pub t: f64,
    /// Time steps done.
    pub step: usize,
    /// Length of the step that led here; 0 at the start.
    pub dt: f64,
    /// Time steps of the whole run, where they are known before.
    pub steps: Option<usize>,
    /// Share of the simulated time that is done, 0 … 1.
    pub share: f64,
    /// The smallest corner Jacobian over that of equal cells; on a line, the shortest cell over the mean one.
    pub smallest: f64,
    /// Seconds since the run began, over all its parts.
    pub seconds: f64,
    /// Positions of the nodes of a mesh in two dimensions, in lattice order; empty for a line.
    pub nodes: &'a [[f64; 2]],
    /// Makes the scene of this moment. It is a function, since a scene costs as much as a small step and most steps are
    /// not drawn.
    pub scene: &'a dyn Fn() -> Scene,
    /// More of a simulation of a moving mesh; none of a run of another kind.
    pub moving: Option<Moving<'a>>,
}

/// What an observer sees of a simulation of a moving mesh beside what runs of all kinds have.
#[derive(Debug)]
pub struct Moving<'a> {
    /// Time, mesh, solution and density: a [`State`] of the dimension of the mesh, which [`Snapshot::state`] finds.
    pub state: &'a dyn Any,
    /// Quality of the mesh.
    pub quality: Quality,
    /// Error of the solution where an exact one is known.
    pub error: Option<ErrorNorms>,
    /// Work so far.
    pub work: WorkTotal,
    /// What the last step found at the interfaces between subdomains.
    pub interface: Option<Interface>,
}

impl<'a> Snapshot<'a> {
    /// The state of a moving mesh of D dimensions; none of a run of another kind.
    pub fn state<const D: usize>(&self) -> Option<&'a State<D>> {
        self.moving.as_ref().and_then(|moving| moving.state.downcast_ref())
    }
}

/// Something that follows a run.
pub trait Observer {
    /// Called after every event. An error ends the run.
    ///
    /// # Errors
    /// Whatever stops the observer from doing its work, such as a full disk.
    fn observe(&mut self, event: Event, snapshot: &Snapshot<'_>) -> Result<()>;

    /// Called before the run, for every mesh on the way to the one that is adapted to the initial solution at time t.
    /// An error ends the run.
    ///
    /// # Errors
    /// Whatever stops the observer from doing its work.
    fn adapting(&mut self, _t: f64) -> Result<()> {
        Ok(())
    }

    /// Asked after every step: true ends the run there, with a checkpoint where it has any.
    fn interrupts(&self) -> bool {
        false
    }

    /// Puts what it carries from step to step into a checkpoint, and makes sure that what it wrote so far is on the
    /// disk.
    ///
    /// # Errors
    /// Whatever keeps the observer from doing so, such as a full disk.
    fn keep(&mut self, _kept: &mut Kept) -> Result<()> {
        Ok(())
    }
}
