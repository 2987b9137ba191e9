use super::kind::{Kind, Running};
use super::runner::{self, Begin};
use super::{
    EquidistributionStudy, Header, MovingLine, MovingMesh, PoissonStudy, Source, SpeciesStudy, StefanStudy, StudyKind,
};
use crate::error::{Act, Error, Failure, Result, Unfit};
use crate::output::{Checkpoints, CheckpointsAt, RunDirectory, Standing, names};
use crate::simulation::{Observer, Schedule};
use schemars::generate::SchemaSettings;
use serde::Deserialize;
use serde_json::json;
use std::path::Path;

/// A study of any kind.
#[derive(Debug, Clone)]
#[allow(clippy::large_enum_variant)] // one value a run
pub enum Study {
    /// A study of kind `moving-mesh` in two dimensions.
    MovingMesh(MovingMesh),
    /// A study of kind `moving-mesh` in one dimension.
    MovingLine(MovingLine),
    /// A study of kind `poisson`.
    Poisson(PoissonStudy),
    /// A study of kind `stefan` with heat in two phases.
    Stefan(StefanStudy),
    /// A study of kind `stefan` with species on a line.
    Species(SpeciesStudy),
    /// A study of kind `equidistribution`.
    Equidistribution(EquidistributionStudy),
}

/// Does the same with a study of any [`Kind`].
macro_rules! each {
    ($study:expr, $it:ident => $does:expr) => {
        match $study {
            Study::MovingMesh($it) => $does,
            Study::MovingLine($it) => $does,
            Study::Poisson($it) => $does,
            Study::Stefan($it) => $does,
            Study::Species($it) => $does,
            Study::Equidistribution($it) => $does,
        }
    };
}

impl Study {
    /// Reads and checks a study, every default filled in.
    ///
    /// # Errors
    /// [`Error::Study`](crate::Error::Study) at the place of the first mistake.
    pub fn from_source(source: &Source) -> Result<Self> {
        #[derive(Deserialize)]
        struct Peek {
            study: PeekHeader,
        }
        #[derive(Deserialize)]
        struct PeekHeader {
            kind: StudyKind,
        }
        /// The axes of a moving mesh.
        #[derive(Deserialize)]
        struct PeekGrid {
            grid: PeekCells,
        }
        #[derive(Deserialize)]
        struct PeekCells {
            cells: Vec<serde::de::IgnoredAny>,
        }
        /// What only a front between species has.
        #[derive(Deserialize)]
        struct PeekSpecies {
            #[serde(rename = "species")]
            _species: toml::Value,
        }
        let is_line = || source.parse::<PeekGrid>().is_ok_and(|peek| peek.grid.cells.len() == 1);
        let has_species = || source.parse::<PeekSpecies>().is_ok();
        // whatever is wrong before the kind is known is told by the reader of the first kind
        match source.parse::<Peek>().map(|peek| peek.study.kind) {
            Ok(StudyKind::Poisson) => PoissonStudy::from_source(source).map(Self::Poisson),
            Ok(StudyKind::Stefan) if has_species() => SpeciesStudy::from_source(source).map(Self::Species),
            Ok(StudyKind::Stefan) => StefanStudy::from_source(source).map(Self::Stefan),
            Ok(StudyKind::Equidistribution) => EquidistributionStudy::from_source(source).map(Self::Equidistribution),
            Ok(StudyKind::MovingMesh) if is_line() => MovingLine::from_source(source).map(Self::MovingLine),
            _ => MovingMesh::from_source(source).map(Self::MovingMesh),
        }
    }

    /// The JSON Schema of a study file, for editors.
    pub fn schema() -> serde_json::Value {
        let mut generator = SchemaSettings::draft2020_12().for_deserialize().into_generator();
        let moving = json!({
            "if": {
                "properties": { "grid": { "properties": { "cells": { "maxItems": 1 } }, "required": ["cells"] } },
                "required": ["grid"],
            },
            "then": generator.subschema_for::<MovingLine>(),
            "else": generator.subschema_for::<MovingMesh>(),
        });
        let fronts = json!({
            "if": { "required": ["species"] },
            "then": generator.subschema_for::<SpeciesStudy>(),
            "else": generator.subschema_for::<StefanStudy>(),
        });
        let kinds = [
            (StudyKind::MovingMesh, moving),
            (StudyKind::Poisson, json!(generator.subschema_for::<PoissonStudy>())),
            (StudyKind::Stefan, fronts),
            (StudyKind::Equidistribution, json!(generator.subschema_for::<EquidistributionStudy>())),
        ];
        // the kind decides, so that an editor complains of what is wrong in it and not of four kinds
        let each = kinds.map(|(kind, schema)| {
            let named = json!({ "properties": { "study": { "properties": { "kind": { "const": kind.name() } } } } });
            json!({ "if": named, "then": schema })
        });
        json!({
            "$schema": "https://json-schema.org/draft/2020-12/schema",
            "title": "A study of driftmesh",
            "type": "object",
            "required": ["study"],
            "properties": { "study": generator.subschema_for::<Header>() },
            "allOf": each,
            "$defs": generator.take_definitions(true),
        })
    }

    /// Runs it into a directory, and says why it ended early, if it did. Observers watch what goes step by step.
    ///
    /// # Errors
    /// As [`Kind::run`].
    pub fn run(&self, directory: &Path, begin: Begin, watchers: &mut [&mut dyn Observer]) -> Result<Option<Error>> {
        each!(self, study => study.run(directory, begin, watchers).map(|finished| finished.failure))
    }

    /// How far the run of this very study in a directory came.
    ///
    /// # Errors
    /// [`Error::Checkpoint`] where it is complete, but of other settings than how far it goes.
    pub fn standing(&self, directory: &Path) -> Result<Standing> {
        let standing = RunDirectory::standing(directory);
        if standing != Standing::Complete {
            return Ok(standing);
        }
        let path = directory.join(names::STUDY);
        let text = std::fs::read_to_string(&path)
            .map_err(|error| Error::Unreadable { path: path.clone(), reason: error.to_string() })?;
        let checkpoints = Checkpoints::new(directory, CheckpointsAt::default(), &self.to_toml())?;
        let refused = |(file, unfit): (&str, Unfit)| Error::Checkpoint { refused: vec![(directory.join(file), unfit)] };
        match checkpoints.behind(&text).map_err(refused)? {
            None => Ok(Standing::Complete),
            Some(behind) => {
                let followed = behind.followed_by(self.schedule()?.as_mut());
                followed.map(|_| Standing::Shorter).map_err(|unfit| refused((names::STUDY, unfit)))
            }
        }
    }

    /// The times of its steps, where it has some.
    fn schedule(&self) -> Result<Option<Schedule>> {
        each!(self, study => study.data.known(|| study.begin().map(|mut run| run.schedule().cloned())))
    }

    /// The step of a checkpoint of this study, from the bytes behind its checksum: whatever they are, what a run could
    /// not go on from is refused, and nothing is allocated that they do not fill.
    ///
    /// # Errors
    /// [`Unfit`] with what is wrong.
    pub fn decode(&self, bytes: &[u8]) -> Result<usize, Unfit> {
        each!(self, study => runner::decode(study, bytes))
    }

    /// The remedy for an error, in the keys of this study.
    pub fn remedy(&self, error: &Error) -> Option<String> {
        each!(self, study => study.remedy(error))
    }

    /// What this study may change against a failure, each with the keys that take the change.
    pub fn offers(&self, failure: &Failure) -> Vec<(Act, Vec<String>)> {
        each!(self, study => study.offers(failure))
    }

    /// The study as a file, every default filled in.
    pub fn to_toml(&self) -> String {
        each!(self, study => study.to_toml())
    }

    /// Its name.
    pub fn name(&self) -> &str {
        each!(self, study => &study.common().0.name)
    }

    /// Memory that the run needs, in bytes.
    pub fn memory(&self) -> u128 {
        each!(self, study => study.memory())
    }

    /// What is allowed but probably not meant.
    ///
    /// # Errors
    /// As [`Kind::resolve`].
    pub fn warnings(&self) -> Result<Vec<String>> {
        each!(self, study => study.data.known(|| study.warnings()))
    }

    /// Tries what a check of the settings alone does not tell, as far as that takes no time.
    ///
    /// # Errors
    /// [`Error::Failed`] with what a run would end with at its start.
    pub fn try_start(&self) -> Result<()> {
        each!(self, study => study.data.known(|| study.try_start()))
    }
}
