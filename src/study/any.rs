use super::{EquidistributionStudy, MovingMesh, PoissonStudy, Source, StefanStudy, StudyKind};
use crate::error::Result;
use serde::Deserialize;

/// A study of any kind.
#[derive(Debug, Clone)]
#[allow(clippy::large_enum_variant)] // one value a run
pub enum Study {
    /// Of kind `moving-mesh`.
    MovingMesh(MovingMesh),
    /// Of kind `poisson`.
    Poisson(PoissonStudy),
    /// Of kind `stefan`.
    Stefan(StefanStudy),
    /// Of kind `equidistribution`.
    Equidistribution(EquidistributionStudy),
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
        // whatever is wrong before the kind is known is told by the reader of the first kind
        match source.parse::<Peek>().map(|peek| peek.study.kind) {
            Ok(StudyKind::Poisson) => PoissonStudy::from_source(source).map(Self::Poisson),
            Ok(StudyKind::Stefan) => StefanStudy::from_source(source).map(Self::Stefan),
            Ok(StudyKind::Equidistribution) => EquidistributionStudy::from_source(source).map(Self::Equidistribution),
            _ => MovingMesh::from_source(source).map(Self::MovingMesh),
        }
    }

    /// Its name.
    pub fn name(&self) -> &str {
        match self {
            Self::MovingMesh(study) => &study.study.name,
            Self::Poisson(study) => &study.study.name,
            Self::Stefan(study) => &study.study.name,
            Self::Equidistribution(study) => &study.study.name,
        }
    }
}
