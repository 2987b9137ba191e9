use crate::error::{Error, Failure};
use crate::simulation::{Report, Retries, Seconds, WorkTotal};
use serde::Serialize;

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

/// What a run had at its disposal.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Parallel {
    /// Processes.
    pub ranks: usize,
    /// Threads of each.
    pub threads: usize,
}
