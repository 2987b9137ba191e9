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

/// ∫|u − exact| over the line, u linear between its nodes.
pub fn distance(run: &MovingRun<1>, unknown: usize, exact: impl Fn(f64) -> f64) -> f64 {
    let state = run.state.as_ref().unwrap();
    let x: Vec<f64> = state.mesh.x().iter().map(|[x]| *x).collect();
    let u: Vec<f64> = state.u.component(unknown).collect();
    let mut sum = 0.0;
    for (x, u) in x.windows(2).zip(u.windows(2)) {
        for k in 0..20 {
            let share = (k as f64 + 0.5) / 20.0;
            let at = x[0] + share * (x[1] - x[0]);
            sum += (u[0] + share * (u[1] - u[0]) - exact(at)).abs() * (x[1] - x[0]) / 20.0;
        }
    }
    sum
}
