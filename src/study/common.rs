//! The tables that studies of all kinds have.

use crate::error::{Error, Result};
use crate::output::{CheckpointsAt, FramesAt};
use crate::ranks::Ranks;
use crate::simulation::Schedule;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::io::Read;

/// `[study]`: name and kind of the study.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Header {
    /// Name of the study and of its run directory: letters, digits, `-`, `_` and `.`.
    pub name: String,
    /// What the study is about, which decides what other tables it has.
    pub kind: StudyKind,
}

impl Header {
    /// Refuses a name that no directory can have.
    ///
    /// # Errors
    /// [`Error::Invalid`].
    pub(super) fn check_name(&self) -> Result<()> {
        let name = &self.name;
        let plain = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
        if name.is_empty() || name.len() > 100 || name.starts_with('.') || !name.chars().all(plain) {
            let rule = "must be 1 to 100 of the characters a-z A-Z 0-9 - _ . and not begin with a dot";
            return Err(Error::invalid("study.name", format!("{name:?}"), rule));
        }
        Ok(())
    }
}

/// What a study is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum StudyKind {
    /// A PDE in one or two dimensions on a moving mesh.
    MovingMesh,
    /// Poisson's equation on a mesh of any shape.
    Poisson,
    /// Two phases and the front between them.
    Stefan,
    /// A mesh on a line, and the Schwarz methods for it.
    Equidistribution,
}

impl StudyKind {
    /// The name of the kind in a study file.
    pub fn name(self) -> &'static str {
        match self {
            Self::MovingMesh => "moving-mesh",
            Self::Poisson => "poisson",
            Self::Stefan => "stefan",
            Self::Equidistribution => "equidistribution",
        }
    }
}

/// `[output]`: what a run leaves behind in its directory.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Output {
    /// When frames are written; about twenty of them where nothing is said.
    pub frames: Option<FramesAt>,
    /// When a checkpoint is written, from which a run that ends early goes on; every minute where nothing is said. A
    /// study without time steps has none, and begins again.
    pub checkpoint: CheckpointsAt,
    /// Whether the frames become `animation.gif`.
    pub animation: bool,
    /// Whether the run ends with `report.html` and its plots.
    pub report: bool,
}

/// Number of frames of a run in time where `output.frames` is not given.
const FRAMES_BY_DEFAULT: usize = 20;

impl Default for Output {
    fn default() -> Self {
        Self { frames: None, checkpoint: CheckpointsAt::default(), animation: false, report: true }
    }
}

impl Output {
    /// Refuses settings out of range that do not depend on the rest of the study.
    ///
    /// # Errors
    /// [`Error::Invalid`].
    pub(super) fn check(&self) -> Result<()> {
        self.checkpoint.check().map_err(|error| error.within("output"))
    }

    /// When frames are written, about twenty times where nothing is said.
    ///
    /// # Errors
    /// [`Error::Invalid`] for settings out of range.
    pub(super) fn frames_of(&self, schedule: &Schedule) -> Result<FramesAt> {
        let [start, end] = [schedule.start(), schedule.end()];
        let frames = self.frames.clone().unwrap_or_else(|| match schedule.steps() {
            Some(steps) => FramesAt::Every(steps.div_ceil(FRAMES_BY_DEFAULT)),
            None => {
                let part = |n: usize| start + (end - start) * n as f64 / FRAMES_BY_DEFAULT as f64;
                FramesAt::Times((1..FRAMES_BY_DEFAULT).map(part).collect())
            }
        });
        frames.check([start, end]).map_err(|error| error.within("output"))?;
        Ok(frames)
    }
}

/// A study is a page of text; more is some other file.
const MAX_BYTES: u64 = 1 << 20;

/// The text of a study, which rank 0 reads and sends to the others.
pub(super) fn text_of<R: Read>(open: impl FnOnce() -> Result<R, String>) -> Result<String, String> {
    let bytes = Ranks::here().from_first(|| {
        let mut bytes = Vec::new();
        open()?.take(MAX_BYTES + 1).read_to_end(&mut bytes).map_err(|error| error.to_string())?;
        match bytes.len() as u64 > MAX_BYTES {
            true => Err(format!("it has more than {MAX_BYTES} bytes, which no study has")),
            false => Ok(bytes),
        }
    })?;
    String::from_utf8(bytes).map_err(|error| {
        let at = error.utf8_error().valid_up_to();
        let line = error.as_bytes()[..at].iter().filter(|&&b| b == b'\n').count() + 1;
        format!("it is not UTF-8 text (byte {at}, line {line}); save it as UTF-8")
    })
}
