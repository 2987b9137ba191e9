//! What a kind of study is to the one runner of all kinds: its settings, and what runs.

use super::runner::{self, Finished, Stage};
use super::{Begin, DataTables, Header, Output, Source, StudyKind};
use crate::error::{Act, Error, Failure, Result, Unfit};
use crate::kept::Kept;
use crate::output::{Figures, FramesAt, RunDirectory, Spent, Summary, moment};
use crate::simulation::{Observer, Scene, Schedule};
use serde::{Serialize, de::DeserializeOwned};
use std::path::Path;

/// The tables that studies of all kinds have, as functions of [`Kind`], from fields of their names.
macro_rules! common_tables {
    () => {
        fn common(&self) -> (&$crate::study::Header, &$crate::study::Output) {
            (&self.study, &self.output)
        }

        fn data(&self) -> &$crate::study::DataTables {
            &self.data
        }

        fn data_mut(&mut self) -> &mut $crate::study::DataTables {
            &mut self.data
        }
    };
}
pub(super) use common_tables;

/// The settings of a study of one kind, and how a run of them begins.
pub trait Kind: Clone + Serialize + DeserializeOwned {
    /// What runs.
    type Run: Running;

    /// The kind, as `study.kind` says it.
    const KIND: StudyKind;

    /// `[study]` and `[output]`.
    fn common(&self) -> (&Header, &Output);

    /// `[data]`.
    fn data(&self) -> &DataTables;

    /// `[data]`, to be read.
    fn data_mut(&mut self) -> &mut DataTables;

    /// Checks all settings and fills in the defaults that depend on others.
    ///
    /// # Errors
    /// [`Error::Invalid`] or [`Error::Formula`] with the dotted key of the first setting out of range.
    fn resolve(&mut self) -> Result<()>;

    /// Memory that the run needs, in bytes.
    fn memory(&self) -> u128;

    /// What is allowed but probably not meant.
    ///
    /// # Errors
    /// As [`Kind::resolve`].
    fn warnings(&self) -> Result<Vec<String>> {
        Ok(Vec::new())
    }

    /// Whether the run goes step by step: only then it can be interrupted, and leaves checkpoints.
    fn has_steps(&self) -> bool {
        true
    }

    /// Computes the state at the start where that takes no time, so that a check of the study finds what is wrong with
    /// it.
    ///
    /// # Errors
    /// [`Error::Failed`] with what a run would end with at its start.
    fn try_start(&self) -> Result<()> {
        Ok(())
    }

    /// What runs, before it has computed anything.
    ///
    /// # Errors
    /// As [`Kind::resolve`].
    fn begin(&self) -> Result<Self::Run>;

    /// Reads the files of `[data]`, then [resolves](Kind::resolve) the study.
    ///
    /// # Errors
    /// [`Error::Invalid`] where a file makes no table; as [`Kind::resolve`].
    fn ready(&mut self) -> Result<()> {
        self.data_mut().load()?;
        let tables = self.data().clone();
        tables.known(|| self.resolve())
    }

    /// Reads and checks a study, every default filled in.
    ///
    /// # Errors
    /// [`Error::Study`] at the place of the first mistake.
    fn from_source(source: &Source) -> Result<Self> {
        let mut study: Self = source.parse()?;
        study.data_mut().lie_in(source.directory());
        study.ready().map_err(|error| source.locate(error))?;
        Ok(study)
    }

    /// The study as a file, every default filled in.
    fn to_toml(&self) -> String {
        toml::to_string(self).expect("a study is plain data")
    }

    /// The remedy for an error in the keys of this study, with the value that each has now.
    fn remedy(&self, error: &Error) -> Option<String> {
        super::remedy::remedy(self, error)
    }

    /// What this study may change against a failure, each with the keys that take the change.
    fn offers(&self, failure: &Failure) -> Vec<(Act, Vec<String>)> {
        super::remedy::offers(self, failure)
    }

    /// Runs the study into a directory, with observers watching
    ///
    /// A failure after the start is not an error of this function: everything up to the last good state is written as
    /// for a completed run, and [`Finished::failure`] says what happened. `summary.json` tells the same.
    ///
    /// # Errors
    /// [`Error::Invalid`], [`Error::ForeignDirectory`] or [`Error::Busy`] before anything is written;
    /// [`Error::Checkpoint`] where there are checkpoints, but none that will do; [`Error::Failed`] where there is no
    /// state to begin with; [`Error::Unwritable`] where the directory cannot be written.
    fn run(&self, directory: &Path, begin: Begin, watchers: &mut [&mut dyn Observer]) -> Result<Finished<Self::Run>> {
        runner::run(self, directory, begin, watchers)
    }

    /// Runs the study without leaving anything on disk; a failure after the start ends it early.
    ///
    /// # Errors
    /// As [`Kind::run`] before anything is computed.
    fn compute(&self) -> Result<(Self::Run, Option<Error>)> {
        runner::compute(self)
    }
}

/// A run of a study of one kind, between two steps.
pub trait Running: Sized {
    /// What it says in `summary.json`.
    type Figures: Figures;

    /// Everything that the steps to come depend on, and what was found in those done.
    type Checkpoint: DeserializeOwned;

    /// Runs to the end, telling the stage of each step.
    ///
    /// # Errors
    /// [`Error::Failed`] with the time and step of a numerical failure, or what an observer or a full disk returned.
    fn go(&mut self, stage: &mut Stage<'_>) -> Result<()>;

    /// Takes up a checkpoint. In a directory, tables of its own are cut back to the rows that they had then. Returns
    /// the seconds up to the checkpoint, and what observers had put there.
    ///
    /// # Errors
    /// [`Unfit`] where it cannot be one of this study, or where the tables are not there.
    fn resume(&mut self, found: Self::Checkpoint, directory: Option<&Path>) -> Result<(SpentBy<Self>, Kept), Unfit>;

    /// The times of its steps; none where it has no steps in time.
    fn schedule(&mut self) -> Option<&mut Schedule> {
        None
    }

    /// Turns from a run that was complete into one that goes on to a later end: takes back what is there only because
    /// it was at its end. Called after [`resume`](Self::resume).
    ///
    /// # Errors
    /// [`Unfit`] where what it needs for that is not in the directory.
    fn lengthen(&mut self, _directory: &Path) -> Result<(), Unfit> {
        Ok(())
    }

    /// When frames are written, and into how many subdomains along each axis a mesh in two dimensions is divided.
    fn frames(&self) -> (FramesAt, [usize; 2]) {
        (FramesAt::Every(1), [1, 1])
    }

    /// What must be among the frames at the end: the last good state, or one scene an iteration; nothing where the run
    /// ended before it had a state.
    ///
    /// # Errors
    /// [`Error::Failed`] where there is no mesh.
    fn scenes(&self) -> Result<Vec<Scene>>;

    /// What a picture of a scene says beside the name of the study.
    fn caption(&self, scene: &Scene) -> String {
        format!("t = {}", moment(scene.t))
    }

    /// Writes what runs of other kinds do not have: rows that wait for their file, arrays, pictures. Called once at the
    /// end, after a failure, too.
    ///
    /// # Errors
    /// [`Error::Unwritable`], or what hinders drawing.
    fn leave(&mut self, _directory: &RunDirectory) -> Result<()> {
        Ok(())
    }

    /// Puts figures, seconds of its parts and warnings into a summary.
    fn tell(&self, summary: &mut Summary<Self::Figures>);

    /// Adds warnings: those of the settings, and of checkpoints that would not do.
    fn warn(&mut self, warnings: Vec<String>);
}

/// Seconds of a run, with those of the parts that a run of its kind has.
pub type SpentBy<R> = Spent<<<R as Running>::Figures as Figures>::Parts>;
