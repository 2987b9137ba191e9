//! Everything that can go wrong, as data.
//!
//! Two enums: a [`Failure`] is what the mathematics can do wrong in a step (it knows *what* and *where*), an [`Error`]
//! is what reaches the caller (it adds *when*, and covers settings and files). A failure offers [remedies](Remedy) by
//! their meaning; a study says those that it has in its own keys, Python in its arguments, and `help` in plain words.

mod cause;
mod diagnostic;
mod failure;
mod node_place;
mod remedies;
mod remedy;
mod words;

pub use cause::Cause;
pub use diagnostic::Diagnostic;
pub use failure::Failure;
pub use node_place::NodePlace;
pub use remedy::{Act, Door, Plain, Remedy, Setting, sentence};
pub(crate) use words::line_rule;

use std::path::PathBuf;

/// `Result` with the library's own [`Error`].
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// When something happened.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moment {
    /// Simulated time.
    pub t: f64,
    /// Step number; the initial state is step 0.
    pub step: usize,
}

/// What reaches the caller.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A numerical failure, and when it happened if a time loop was running.
    #[error("{}{failure}", at(.moment))]
    Failed {
        /// The failure.
        failure: Failure,
        /// The step that failed.
        moment: Option<Moment>,
    },
    /// What ended the run that a complete one is compared with.
    #[error("the run itself is complete; in the one of [compare]: {0}")]
    Compared(Box<Error>),
    /// Somebody asked a run to end.
    #[error("interrupted at t = {:.6} (step {})", .0.t, .0.step)]
    Interrupted(Moment),
    /// A setting is out of range.
    #[error("`{key}` is {value}, but {rule}")]
    Invalid {
        /// Dotted key as in a study file.
        key: String,
        /// Value found.
        value: String,
        /// What must hold, and how to make it hold.
        rule: String,
    },
    /// A setting is no formula.
    #[error("`{key}`: {message}\n  {text}\n  {}", carets(text, at))]
    Formula {
        /// Dotted key as in a study file.
        key: String,
        /// The formula.
        text: String,
        /// The bytes of it that are meant.
        at: std::ops::Range<usize>,
        /// What is wrong.
        message: String,
        /// The remedy.
        help: Option<String>,
    },
    /// A study file (or a `--set`) is wrong at a known place.
    #[error("{0}")]
    Study(Box<Diagnostic>),
    /// A file could not be read.
    #[error("cannot read {}: {reason}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// A file or directory could not be written.
    #[error("cannot write {}: {reason}", path.display())]
    Unwritable {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// A run cannot go on: there are checkpoints, but none that will do.
    #[error("cannot go on: {}", refusals(refused))]
    Checkpoint {
        /// Each file with what is wrong with it.
        refused: Vec<(PathBuf, Unfit)>,
    },
    /// Another run is writing to the output directory.
    #[error("another run is writing to {}", path.display())]
    Busy {
        /// The directory.
        path: PathBuf,
    },
    /// Several processes of a program without MPI were started for one run.
    #[error("{count} processes were started for one run, and this program was built without MPI to share it")]
    SeparateProcesses {
        /// How many, as their launcher says.
        count: usize,
    },
    /// Ranks that cannot work together.
    #[error("rank {rank} has another {what} than rank 0")]
    UnlikeRanks {
        /// The first that differs.
        rank: usize,
        /// What differs.
        what: &'static str,
    },
    /// A directory that holds no run.
    #[error("{} is no run directory: {reason}", path.display())]
    NotARun {
        /// The directory.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// The output directory holds something that no run of ours wrote.
    #[error("{} is not empty and was not written by driftmesh (it holds {found})", path.display())]
    ForeignDirectory {
        /// The directory.
        path: PathBuf,
        /// Something found in it.
        found: String,
    },
}

/// Why a run cannot go on from a file.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Unfit {
    /// The file is of another format.
    #[error("it is no checkpoint that this program can read")]
    Foreign,
    /// Bytes are missing or wrong, or what they say cannot be.
    #[error("it is damaged: {0}")]
    Damaged(String),
    /// Another program wrote it, whose numbers may differ.
    #[error("it was written by driftmesh {found}, and this is driftmesh {}", env!("CARGO_PKG_VERSION"))]
    Version {
        /// The version of the other.
        found: String,
    },
    /// The checkpoint belongs to a study with other settings.
    #[error("it belongs to a study in which `{key}` is {was}; here it is {is}")]
    Study {
        /// Dotted key of the first setting that differs.
        key: String,
        /// Value of that setting in the checkpoint's study.
        was: String,
        /// Value of that setting in this study.
        is: String,
    },
    /// The run came to its end, behind which it is not to go on.
    #[error("its run is complete up to t = {was}, and here it would end at t = {is}")]
    Earlier {
        /// The end of the run.
        was: f64,
        /// The end that is asked for.
        is: f64,
    },
    /// A complete run goes on from it alone.
    #[error("it is not there, and a complete run goes on to a later end from it alone")]
    Missing,
    /// What the run left beside it does not fit.
    #[error("{file} does not go with it: {reason}")]
    Beside {
        /// The file.
        file: String,
        /// Why.
        reason: String,
    },
}

/// Files with what is wrong with each.
fn refusals(refused: &[(PathBuf, Unfit)]) -> String {
    let each = refused.iter().map(|(path, unfit)| format!("{}: {unfit}", path.display()));
    each.collect::<Vec<_>>().join("; ")
}

/// Marks a part of a text, on the line below it.
fn carets(text: &str, at: &std::ops::Range<usize>) -> String {
    let before = text.get(..at.start).map_or(0, |t| t.chars().count());
    let width = text.get(at.clone()).map_or(1, |t| t.chars().count().max(1));
    " ".repeat(before) + &"^".repeat(width)
}

fn at(moment: &Option<Moment>) -> String {
    moment.map_or(String::new(), |m| format!("at t = {:.6} (step {}): ", m.t, m.step))
}

impl From<Failure> for Error {
    fn from(failure: Failure) -> Self {
        Self::Failed { failure, moment: None }
    }
}

impl Failure {
    /// The failure that stands for an error where a step cannot return it.
    pub(crate) fn refusing(error: Error) -> Self {
        match error {
            Error::Failed { failure, .. } => failure,
            Error::Invalid { key, value, rule } => Self::OutOfRange { what: format!("`{key}`"), value, rule },
            other => Self::out_of_range("a setting", "not usable", &other.to_string()),
        }
    }
}

impl Error {
    /// A setting out of range.
    pub fn invalid(key: impl Into<String>, value: impl std::fmt::Display, rule: impl Into<String>) -> Self {
        let text = value.to_string();
        // very large and very small numbers as powers of ten
        let value = match text.parse::<f64>() {
            Ok(number) if text.len() > 20 || text.len() > 14 && text.contains('.') => format!("{number:e}"),
            _ => text,
        };
        Self::Invalid { key: key.into(), value, rule: rule.into() }
    }

    /// The error of a file or directory that could not be written, from the reason.
    pub(crate) fn unwritable<E: std::fmt::Display>(path: &std::path::Path) -> impl Fn(E) -> Self + Copy {
        |reason| Self::Unwritable { path: path.into(), reason: reason.to_string() }
    }

    /// The same error with its key seen from one table further out: `viscosity` becomes `pde.viscosity`.
    pub fn within(self, table: &str) -> Self {
        match self {
            Self::Invalid { key, value, rule } => Self::Invalid { key: format!("{table}.{key}"), value, rule },
            Self::Formula { key, text, at, message, help } => {
                Self::Formula { key: format!("{table}.{key}"), text, at, message, help }
            }
            other => other,
        }
    }

    /// What went wrong, in whichever run.
    pub fn cause(&self) -> &Self {
        match self {
            Self::Compared(cause) => cause,
            other => other,
        }
    }

    /// What to do about it, where there is one answer; of a failure in plain words, for which a study has keys
    /// ([`Study::remedy`](crate::study::Study::remedy)).
    pub fn help(&self) -> Option<String> {
        match self {
            Self::Failed { failure, .. } => failure.help(),
            Self::Compared(cause) => cause.help(),
            Self::Study(diagnostic) => diagnostic.help.clone(),
            Self::Formula { help, .. } => help.clone(),
            Self::Busy { .. } => Some("wait for it to end, or name another directory with --out".into()),
            Self::SeparateProcesses { .. } => Some(
                "build it by `cargo build --release -p driftmesh-cli --features mpi`, or start it once, without mpirun"
                    .into(),
            ),
            Self::UnlikeRanks { .. } => Some("start the same program with the same arguments on every rank".into()),
            Self::ForeignDirectory { .. } => Some("name another directory with --out, or empty this one".into()),
            Self::NotARun { .. } => Some("name the directory that `driftmesh run` printed behind `run`".into()),
            Self::Checkpoint { refused } => Some(match refused.first() {
                Some((_, Unfit::Study { .. })) => {
                    "go on with the settings in its study.toml; or leave --resume out to begin anew, or name another \
                     directory with --out"
                }
                Some((_, Unfit::Earlier { .. })) => {
                    "a complete run goes on to a later time.end only; leave --resume out to begin anew, or name \
                     another directory with --out"
                }
                Some((_, Unfit::Version { .. })) => "go on with that version, or leave --resume out to begin anew",
                _ => "leave --resume out to begin anew",
            }.into()),
            Self::Unwritable { .. } => {
                Some("free some space or mend the permissions there, or name another directory with --out".into())
            }
            Self::Interrupted(_) | Self::Invalid { .. } | Self::Unreadable { .. } => None,
        }
    }

    /// True if what ended a run lies outside it: it may go on from its checkpoint.
    pub fn is_resumable(&self) -> bool {
        matches!(self.cause(), Self::Interrupted(_) | Self::Unwritable { .. })
    }

    /// True if the computation failed (exit status 1), false if what was asked for is wrong (exit status 2).
    pub fn is_failure(&self) -> bool {
        matches!(self.cause(), Self::Failed { .. } | Self::Interrupted(_) | Self::Unwritable { .. })
    }
}
