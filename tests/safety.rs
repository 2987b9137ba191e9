//! No folded mesh is accepted, and no run is lost to one that a shorter step avoids.

use driftmesh::study::{MovingMesh, Source, compute};

#[path = "../examples/sweep.rs"]
mod sweep;

fn study(set: &[&str]) -> MovingMesh {
    let mut source = Source::new("b.toml", include_str!("../studies/burgers-b-conservative.toml"));
    set.iter().for_each(|assignment| source.set(assignment).unwrap());
    MovingMesh::from_source(&source).unwrap()
}

const OFF: [&str; 3] = ["safety.substeps=0", "safety.smoothing=0", "safety.halvings=0"];

/// A mesh that follows within two steps folds; in sub-steps it does not.
#[test]
fn a_folded_mesh_is_tried_again() {
    let hasty = [
        "mesh.relaxation=3e-3",
        "monitor.strength.relative=1000",
        "monitor.smoothing=0",
        "time.end=0.26",
        "time.report=[0.26]",
    ];
    let (_, failure) = compute(&study(&[&hasty[..], &OFF].concat())).unwrap();
    let failure = failure.unwrap().to_string();
    assert!(failure.contains("the mesh folded"), "{failure}");
    let (record, failure) = compute(&study(&hasty)).unwrap();
    assert!(failure.is_none(), "{failure:?}");
    assert!(record.safety.substeps > 0 && record.reports[0].quality.min_scaled_jacobian > 0.0, "{:?}", record.safety);
    assert!(record.warnings.iter().any(|said| said.starts_with("`[safety]`")), "{:?}", record.warnings);
}

/// Where nothing folds, nothing is done, and no bit changes.
#[test]
fn safety_costs_nothing_where_it_is_not_needed() {
    let short = ["time.end=0.3", "time.report=[0.3]"];
    let (with, _) = compute(&study(&short)).unwrap();
    let (without, _) = compute(&study(&[&short[..], &OFF].concat())).unwrap();
    assert_eq!(with.safety, Default::default());
    assert_eq!(format!("{:?}", with.reports), format!("{:?}", without.reports));
    assert!(with.warnings.is_empty() && with.motion > 0.1, "{:?}", with.warnings);
}

/// A mesh that stays although its density asks it to move says why; one that is meant to stay does not.
#[test]
fn a_mesh_that_does_not_move_is_told_of() {
    let said = |set: &[&str]| {
        let short = ["time.end=0.3", "time.report=[0.3]"];
        compute(&study(&[&short[..], set].concat())).unwrap().0.warnings.join("\n")
    };
    assert!(said(&["mesh.relaxation=1e6"]).contains("mesh.relaxation = 1000000 is longer than the run"));
    assert!(said(&["mesh.relaxation=0.05", "monitor.strength={ absolute = 1e-12 }"]).contains("look at monitor.of"));
    assert_eq!(said(&["mesh.generator.kind=fixed"]), "");
}

/// Random studies end completed or with a named failure, most of them completed.
#[test]
fn a_small_sweep() {
    let sweep = sweep::sweep(24);
    assert!(sweep.broken.is_empty(), "{:#?}", sweep.broken);
    assert!(sweep.completed >= 20 && sweep.rescued > 0, "{:?}", sweep.failed);
}
