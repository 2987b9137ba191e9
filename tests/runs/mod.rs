//! Runs of moving meshes from the text of a study without its `[study]`.

#![allow(dead_code)] // each test takes what it needs

use driftmesh::study::{Kind, MovingLine, MovingMesh, MovingRun, Source};

pub const HEAD: &str = "[study]\nname = \"test\"\nkind = \"moving-mesh\"\n";

/// On a line; it has to complete.
pub fn line(text: &str) -> MovingRun<1> {
    let study = MovingLine::from_source(&Source::new("line.toml", format!("{HEAD}{text}"))).unwrap();
    let (run, failure) = study.compute().unwrap();
    assert!(failure.is_none(), "{failure:?}");
    run
}

/// In the plane; it has to complete.
pub fn plane(text: &str) -> MovingRun {
    let study = MovingMesh::from_source(&Source::new("plane.toml", format!("{HEAD}{text}"))).unwrap();
    let (run, failure) = study.compute().unwrap();
    assert!(failure.is_none(), "{failure:?}");
    run
}
