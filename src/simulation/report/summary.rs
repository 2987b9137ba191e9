use crate::error::{Error, Failure};
use crate::geometry::{Comparison, Quality};
use crate::meshing::Interface;
use crate::simulation::{Benefit, Retries};
use crate::work::Work;
use serde::{Deserialize, Serialize};

/// `summary.json`.
#[derive(Debug, Clone, Serialize)]
pub struct Summary {
    /// Version of this format.
    pub schema: u32,
    /// Name of the study.
    pub study: String,
    /// Kind of the study.
    pub kind: String,
    /// Version of the program.
    pub version: String,
    /// `running`, `completed`, `interrupted` or `failed`.
    pub status: String,
    /// What failed and when, if it did.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<Failed>,
    /// Where the time went.
    pub seconds: Seconds,
    /// What the run had at its disposal.
    pub parallel: Parallel,
    /// Steps and their cost.
    pub work: WorkTotal,
    /// Steps that were tried again.
    pub safety: Retries,
    /// One entry for each time of `time.report` that was reached.
    pub reports: Vec<Report>,
    /// What the user should know although nothing failed.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
}

/// A failure in `summary.json`.
#[derive(Debug, Clone, Serialize)]
pub struct Failed {
    /// Short name.
    pub kind: String,
    /// As shown to the user.
    pub message: String,
    /// What may cure it, where that is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub help: Option<String>,
    /// Time of the step that failed.
    pub t: Option<f64>,
    /// The step that failed.
    pub step: Option<usize>,
    /// Whether that was in the run of `[compare]`, and the run itself is complete.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub compared: bool,
}

impl Failed {
    /// What is told of an error, with the remedy in the words of the study.
    pub(crate) fn of(error: &Error, help: Option<String>) -> Self {
        let (kind, moment) = match error.cause() {
            Error::Failed { failure, moment } => (failure.name(), *moment),
            Error::Interrupted(moment) => ("interrupted", Some(*moment)),
            _ => ("unwritable", None),
        };
        Self {
            kind: kind.into(),
            message: error.to_string(),
            help,
            t: moment.map(|m| m.t),
            step: moment.map(|m| m.step),
            compared: matches!(error, Error::Compared(_)),
        }
    }
}

/// `status` of a run that has ended, from what ended it early.
pub(crate) fn status(failure: Option<&Error>) -> &'static str {
    match failure.map(Error::cause) {
        None => "completed",
        Some(Error::Failed { failure: Failure::NotConverged { .. }, .. }) => "not-converged",
        Some(Error::Interrupted(_)) => "interrupted",
        Some(_) => "failed",
    }
}

/// Seconds by part.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
pub struct Seconds {
    /// By the clock.
    pub wall: f64,
    /// Of all threads.
    pub cpu: f64,
    /// Computing the density.
    pub monitor: f64,
    /// Estimating interface values.
    pub interface: f64,
    /// Solving the mesh equation, `interface` not included.
    pub mesh: f64,
    /// Solving the physics.
    pub pde: f64,
    /// Observers: history, frames, progress.
    pub output: f64,
}

/// What a run had at its disposal.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Parallel {
    /// Processes.
    pub ranks: usize,
    /// Threads of each.
    pub threads: usize,
}

/// Steps and their cost.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct WorkTotal {
    /// Time steps accepted.
    pub steps: usize,
    /// Time steps tried in vain.
    pub rejected_steps: usize,
    /// What all of them cost.
    #[serde(flatten)]
    pub work: Work,
}

/// The state of a run at one of the times asked for.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub struct Report {
    /// Time.
    pub t: f64,
    /// Where an exact solution is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<ErrorNorms>,
    /// Of the mesh.
    pub quality: Quality,
    /// Integrals of the solution.
    pub conserved: Conserved,
    /// Where there are subdomains.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub interface: Option<Interface>,
    /// Where the study compares with another generator.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub comparison: Option<Comparison>,
    /// What adaptation brought.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub benefit: Option<Benefit>,
}

/// Error against the exact solution.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ErrorNorms {
    /// Largest over the nodes.
    pub linf: f64,
    /// √(Σ e²·area / Σ area), a node's area being a quarter of its cells'.
    pub l2: f64,
}

/// What a conservative scheme keeps, up to what flows through the sides.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub struct Conserved {
    /// ∫u dA of the first unknown.
    pub mass: f64,
    /// Its change since the start over its size there (its change itself where it was 0).
    pub drift: f64,
}
