//! What is taken where nothing is said, and that every door says the same.

use driftmesh::meshing::{Mmpde, Whole};
use driftmesh::mover::Mover;
use driftmesh::study::{Kind, MovingMesh, Source};

/// A study that says as little as it may.
fn resolved(more: &str) -> MovingMesh {
    let text = format!(
        "[study]\nname = \"short\"\nkind = \"moving-mesh\"\n[grid]\ncells = [8, 8]\n[time]\nstart = 0.25\nend = 0.5\n\
         {more}"
    );
    MovingMesh::from_source(&Source::new("short.toml", text)).unwrap()
}

/// Hovering over `[monitor]` tells which one is taken where it is left out, and that one is.
#[test]
fn the_schema_names_the_default_monitor() {
    let schema = serde_json::to_value(schemars::schema_for!(MovingMesh)).unwrap();
    let said = schema["properties"]["monitor"]["description"].as_str().unwrap();
    let burgers = "[pde]\nkind = \"burgers\"\nviscosity = 0.05\n";
    for (more, kind) in [
        (burgers.to_string(), "auto"),
        (format!("{burgers}[mesh]\ngenerator = {{ kind = \"fixed\" }}\n"), "arclength"),
        ("[pde]\nkind = \"prescribed\"\nrho = \"1 + x\"\n".into(), "given"),
    ] {
        assert_eq!(resolved(&more).monitor.unwrap().name(), kind);
        assert!(said.contains(&format!("`{kind}`")), "{kind} is not in {said:?}");
    }
    assert!(said.starts_with("`[monitor]`. Left out, it is `auto`;"), "{said}");
}

/// A study that says nothing of its mesh equation has the one that the library takes where nothing is said.
#[test]
fn one_mesh_equation_is_the_default_of_the_library_and_of_studies() {
    let study = resolved("[pde]\nkind = \"burgers\"\nviscosity = 0.05\n");
    assert_eq!(study.simulation().unwrap().mover.equation, Mmpde::default());
    assert_eq!(Mover::new(Whole::<2>::default()).equation, Mmpde::default());
    assert_ne!(Mmpde::published(), Mmpde::default());
}
