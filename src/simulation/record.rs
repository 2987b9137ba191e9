//! What a run did: its reports, its cost and where its time went.

use super::{Benefit, Conserved, Retries};
use crate::geometry::{Comparison, Quality};
use crate::meshing::Interface;
use crate::stopwatch::{Spent, Stopwatch};
use crate::work::Work;
use serde::{Deserialize, Serialize};

/// The record of a run so far.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct Record {
    /// Steps and their cost.
    pub work: WorkTotal,
    /// Steps that were tried again.
    pub safety: Retries,
    /// How far nodes went: the sum over all steps of the longest way of a node.
    pub travelled: f64,
    /// Where the time went.
    pub seconds: Spent<MovingParts>,
    /// One report for each time asked for.
    pub reports: Vec<Report>,
    /// What the last step knows about the interfaces between subdomains.
    pub interface: Option<Interface>,
    /// What the user should know although nothing failed.
    pub warnings: Vec<String>,
    /// The least and the largest initial or side value of each unknown so far.
    pub(crate) data: Vec<[f64; 2]>,
}

impl Record {
    /// Adds the time that a computation takes.
    pub(crate) fn timed<T>(&mut self, compute: impl FnOnce(&mut Self) -> T) -> T {
        let clock = Stopwatch::start().after([self.seconds.wall, self.seconds.cpu]);
        let result = compute(self);
        [self.seconds.wall, self.seconds.cpu] = clock.elapsed();
        result
    }
}

/// Seconds of a moving mesh, by part.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
pub struct MovingParts {
    /// Computing the density.
    pub monitor: f64,
    /// Estimating interface values.
    pub interface: f64,
    /// Solving the mesh equation, `interface` not included.
    pub mesh: f64,
    /// Solving the physics.
    pub pde: f64,
}

/// Steps and their cost.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct WorkTotal {
    /// Time steps accepted.
    pub steps: usize,
    /// Time steps tried in vain.
    pub rejected_steps: usize,
    /// Cost of the accepted steps.
    #[serde(flatten)]
    pub work: Work,
}

/// The state of a run at one of the times asked for.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Report {
    /// Time.
    pub t: f64,
    /// Error of the solution, where an exact one is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<ErrorNorms>,
    /// Quality of the mesh.
    pub quality: Quality,
    /// Integrals of the solution.
    pub conserved: Conserved,
    /// What the last step knows about the interfaces between subdomains, where there are any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub interface: Option<Interface>,
    /// Difference to the mesh of another generator, where the study compares with one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub comparison: Option<Comparison>,
    /// How well this mesh and equal cells interpolate the solution.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub benefit: Option<Benefit>,
}

/// Error of the solution against the exact one.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ErrorNorms {
    /// Largest error at a node.
    pub linf: f64,
    /// √(Σ e²·area / Σ area), a node's area being a quarter of its cells'.
    pub l2: f64,
}

impl WorkTotal {
    pub(super) fn add(&mut self, work: Work) {
        self.steps += 1;
        self.work += work;
    }
}
