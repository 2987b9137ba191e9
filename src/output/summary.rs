use crate::error::{Error, Failure};
use crate::ranks::Ranks;
use crate::stopwatch::Spent;
use serde::Serialize;

/// `summary.json`: what runs of all kinds of studies say, and the figures of one kind.
#[derive(Debug, Clone, Serialize)]
#[serde(bound = "")]
pub struct Summary<F: Figures> {
    /// Version of this format.
    pub schema: u32,
    /// Name of the study.
    pub study: String,
    /// Kind of the study.
    pub kind: &'static str,
    /// Version of the program.
    pub version: &'static str,
    /// `running`, `completed`, `interrupted`, `not-converged` or `failed`.
    pub status: &'static str,
    /// What failed and when, if something did.
    #[serde(flatten)]
    pub ended: Option<Ended>,
    /// Where the time went.
    pub seconds: Spent<F::Parts>,
    /// What the run had at its disposal.
    pub parallel: Parallel,
    /// What a study of this kind finds.
    #[serde(flatten)]
    pub figures: F,
    /// What the user should know although nothing failed; empty where that is nothing.
    pub warnings: Vec<String>,
}

impl<F: Figures> Summary<F> {
    /// The summary of a run that has just begun.
    pub(crate) fn running(study: &str, kind: &'static str) -> Self {
        Self {
            schema: 1,
            study: study.into(),
            kind,
            version: env!("CARGO_PKG_VERSION"),
            status: "running",
            ended: None,
            seconds: Spent::default(),
            parallel: Parallel::here(),
            figures: F::default(),
            warnings: Vec::new(),
        }
    }

    /// Notes how the run ended, with the remedy of a failure in the words of the study.
    pub(crate) fn note(&mut self, failure: Option<&Error>, remedy: impl Fn(&Error) -> Option<String>) {
        self.status = status(failure);
        self.ended = failure.map(|error| F::ENDED(Failed::of(error, remedy(error))));
    }
}

/// What a study of one kind finds, as `summary.json` has it.
pub trait Figures: Clone + Default + Serialize {
    /// Seconds of the parts of a run.
    type Parts: std::fmt::Debug + Copy + Default + Serialize;

    /// The name under which `summary.json` has a failure.
    const ENDED: fn(Failed) -> Ended = Ended::Error;
}

/// What ended a run early, under the name that it has in `summary.json`.
#[derive(Debug, Clone, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Ended {
    /// `error`, of kinds that tell the errors of the solution report by report.
    Error(Failed),
    /// `failure`, of kinds whose `error` is, or could be taken for, an error of the solution.
    Failure(Failed),
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
    /// The entry for an error, with the remedy in the words of the study.
    fn of(error: &Error, help: Option<String>) -> Self {
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
fn status(failure: Option<&Error>) -> &'static str {
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
    /// Messages that rank 0 received from other ranks in a step, in the mean over the steps.
    pub messages: f64,
    /// Bytes in them.
    pub bytes: f64,
}

impl Parallel {
    fn here() -> Self {
        let ranks = Ranks::here().count();
        Self { ranks, threads: rayon::current_num_threads(), messages: 0.0, bytes: 0.0 }
    }
}
