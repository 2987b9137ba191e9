//! The work of a step, counted instead of timed.

use serde::{Deserialize, Serialize};

/// Counters of work done, the same on every machine
///
/// They add up: over the parts of a step, and over the steps of a run.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Work {
    /// Right-hand sides that were solved for, in systems of every size (those of the sides of the domain included).
    pub linear_solves: usize,
    /// Iterations of the linear solvers over all systems: alternating-direction sweeps, or products with the matrix.
    /// Direct solves have none; those of an iteration that failed are counted, too.
    pub linear_iterations: usize,
    /// Right-hand sides of `linear_solves` that sparse elimination solved because the iteration could not begin: a
    /// pivot of its preconditioner was not positive, or the guess was not finite.
    pub direct_unstarted: usize,
    /// Right-hand sides of `linear_solves` that sparse elimination solved because the iteration ended above its
    /// tolerance.
    pub direct_stalled: usize,
    /// Newton iterations of the physics.
    pub newton_iterations: usize,
    /// Explicit substeps of the physics.
    pub substeps: usize,
    /// Steps of random walks.
    pub path_steps: usize,
}

impl Work {
    /// Right-hand sides that sparse elimination solved because an iteration did not.
    pub fn direct_solves(&self) -> usize {
        self.direct_unstarted + self.direct_stalled
    }
}

impl std::ops::AddAssign for Work {
    fn add_assign(&mut self, other: Self) {
        self.linear_solves += other.linear_solves;
        self.linear_iterations += other.linear_iterations;
        self.direct_unstarted += other.direct_unstarted;
        self.direct_stalled += other.direct_stalled;
        self.newton_iterations += other.newton_iterations;
        self.substeps += other.substeps;
        self.path_steps += other.path_steps;
    }
}
