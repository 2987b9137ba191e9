//! What a step cost, counted rather than timed.

use serde::{Deserialize, Serialize};

/// Counters of work done, the same on every machine
///
/// They add up: over the parts of a step, and over the steps of a run.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Work {
    /// Right-hand sides solved for, of every size (the sides of the domain included).
    pub linear_solves: usize,
    /// Iterations of the linear solver over all systems, alternating-direction sweeps or products with a block matrix; 0 for
    /// direct solves.
    pub linear_iterations: usize,
    /// Newton iterations of the physics.
    pub newton_iterations: usize,
    /// Explicit substeps of the physics.
    pub substeps: usize,
    /// Steps of random walks.
    pub path_steps: usize,
}

impl std::ops::AddAssign for Work {
    fn add_assign(&mut self, other: Self) {
        self.linear_solves += other.linear_solves;
        self.linear_iterations += other.linear_iterations;
        self.newton_iterations += other.newton_iterations;
        self.substeps += other.substeps;
        self.path_steps += other.path_steps;
    }
}
