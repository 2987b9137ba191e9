//! Runs of two-phase studies from text, with some settings on top.

use driftmesh::Error;
use driftmesh::study::{FrontCourse, Kind, Source, StefanStudy, Study};

/// Nothing set on top.
#[allow(dead_code, reason = "not every test needs it")]
pub const AS_IT_IS: &[&str] = &[];

fn source(text: &str, set: &[impl AsRef<str>]) -> Source {
    let mut source = Source::new("front", text.to_string());
    set.iter().for_each(|assignment| source.set(assignment.as_ref()).unwrap());
    source
}

/// The study.
pub fn study(text: &str, set: &[impl AsRef<str>]) -> StefanStudy {
    StefanStudy::from_source(&source(text, set)).unwrap()
}

/// A run to its end.
pub fn course(text: &str, set: &[impl AsRef<str> + std::fmt::Debug]) -> FrontCourse {
    let (run, failure) = study(text, set).compute().unwrap();
    assert!(failure.is_none(), "{set:?}: {failure:?}");
    run.course
}

/// What a study is refused with.
#[allow(dead_code, reason = "not every test refuses something")]
pub fn refused(text: &str, set: &[impl AsRef<str>]) -> Error {
    Study::from_source(&source(text, set)).unwrap_err()
}
