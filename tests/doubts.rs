//! What a run warns of although nothing fails.

use driftmesh::Error;
use driftmesh::simulation::Record;
use driftmesh::study::{Kind, MovingMesh, MovingRun, Source};

fn study(time: &str, pde: &str, more: &str) -> MovingMesh {
    let text = format!(
        "[study]\nname = \"doubts\"\nkind = \"moving-mesh\"\n[grid]\ncells = [40, 40]\n[time]\n{time}\n[pde]\n{pde}\n\
         {more}\n"
    );
    MovingMesh::from_source(&Source::new("the study", text)).unwrap()
}

/// The warnings of a run, which completes.
fn warnings(study: &MovingMesh) -> Vec<String> {
    let (MovingRun { record: summary, .. }, failure) = study.compute().unwrap();
    assert!(failure.is_none(), "{failure:?}");
    summary.warnings
}

fn standing_front(width: f64, relaxation: &str) -> MovingMesh {
    let pde = format!("kind = \"prescribed\"\nu = \"tanh({width}*(x + 0.09*sin(2*pi*y) - 0.5))\"");
    study("start = 0\nend = 1\nstep = 0.01", &pde, &format!("[mesh]\nrelaxation = {relaxation}"))
}

/// A number that is too small for the front is named with one that is not; with that, and without any, nothing is said.
#[test]
fn a_relaxation_that_is_too_short_is_told_the_limit() {
    for (width, short) in [(150.0, 2.0), (300.0, 6.0)] {
        let said = warnings(&standing_front(width, &format!("{{ steps = {short}, prediction = 0.2 }}")));
        let [said] = &said[..] else { panic!("{said:?}") };
        assert!(said.starts_with("`mesh.relaxation` is short: at t = 0."), "{said}");
        assert!(
            said.contains(&format!("it is {short:.1} time steps, and the mesh turns back from step to step")),
            "{said}"
        );
        let limit = said.split("the mesh rests at ").nth(1).and_then(|text| text.split(' ').next());
        let limit: f64 = limit.unwrap_or_else(|| panic!("{said}")).parse().unwrap();
        assert!(limit > short, "{said}");
        let enough = format!("{{ steps = {}, prediction = 0.2 }}", limit);
        assert_eq!(warnings(&standing_front(width, &enough)), [""; 0], "{width}: {limit}");
        assert_eq!(warnings(&standing_front(width, "\"auto\"")), [""; 0]);
    }
}

/// The start of a study, and what it warns of.
fn doubts(study: &MovingMesh) -> Vec<String> {
    let simulation = study.simulation().unwrap();
    let mut record = Record::default();
    study.start(&simulation, &mut record, &mut []).unwrap();
    record.warnings
}

/// A blob of a second unknown that falls between the nodes is missed; one that equal cells see is not.
#[test]
fn what_the_mesh_misses_of_an_unknown_is_told() {
    let blob = |width: f64, of: &str| {
        let pde = format!(
            "kind = \"formula\"\nunknowns = [\"u\", \"v\"]\ndiffusivity = {{ u = \"1e-3\", v = \"1e-3\" }}\n\
             initial = {{ u = \"tanh(100*(x - 0.2))\", v = \"1 + exp(-((x-0.737)^2 + (y-0.513)^2)/{width}^2)\" }}\n\
             boundary = {{ u = \"no-flux\", v = \"no-flux\" }}"
        );
        study("start = 0\nend = 0.1", &pde, &format!("[monitor]\nkind = \"auto\"\nof = \"{of}\""))
    };
    let said = doubts(&blob(0.008, "u"));
    assert!(matches!(&said[..], [said] if said.starts_with("`v`: the mesh at the start holds 0 %")), "{said:?}");
    assert_eq!(doubts(&blob(0.008, "v")), [""; 0], "the mesh sees what it follows");
    assert_eq!(doubts(&blob(0.15, "u")), [""; 0]);
}

/// A blob too small to matter for the content of an unknown that slopes is told by its place; peaks, jumps and ridges
/// that the mesh sees are not.
#[test]
fn what_hides_between_the_nodes_is_told() {
    let given = |u: &str| study("start = 0\nend = 0.1", &format!("kind = \"prescribed\"\nu = \"{u}\""), "");
    let said = doubts(&given("2*x + exp(-((x-0.7375)^2 + (y-0.5125)^2)/0.006^2)"));
    assert!(matches!(&said[..], [said] if said.contains("at x = 0.737500, y = 0.512500")), "{said:?}");
    for u in [
        "2*x + exp(-((x-0.7375)^2 + (y-0.5125)^2)/0.1^2)",
        "tanh(300*(x - 0.5 + 0.1*y))",
        "max(0, 1 - 20*abs(x - 0.5))",
    ] {
        assert_eq!(doubts(&given(u)), [""; 0], "{u}");
    }
}

/// A blob far from a layer, where the cells of the adapted mesh are many times as wide as it is; a disk whose edge is
/// all that nodes miss is seen. What follows u alone is not told to follow it.
#[test]
fn what_is_smaller_than_any_part_of_a_wide_cell_is_told() {
    let at_start = |u: &str| {
        let pde = format!(
            "kind = \"formula\"\nunknowns = [\"u\"]\ndiffusivity = {{ u = \"1e-3\" }}\ninitial = {{ u = \"{u}\" }}\n\
             boundary = {{ u = \"no-flux\" }}"
        );
        doubts(&study("start = 0\nend = 0.1", &pde, ""))
    };
    let said = at_start("tanh((x-0.7)/0.01) + exp(-((x-0.2125)^2+(y-0.7125)^2)/1e-5)");
    assert!(
        said.iter().any(|said| said.contains("the mesh does not see that; refine `grid.cells`, or make")),
        "{said:?}"
    );
    let said = at_start("if((x-0.3)^2+(y-0.3)^2 < 0.04, 1, 0)");
    assert!(!said.iter().any(|said| said.contains("does not see")), "{said:?}");
}

/// What is followed may be said of the default monitor without its name.
#[test]
fn what_the_mesh_follows_needs_no_kind() {
    let pde = "kind = \"burgers\"\nviscosity = 0.01";
    let short = study("start = 0.25\nend = 0.5", pde, "[monitor]\nof = \"u^2\"");
    let long = study("start = 0.25\nend = 0.5", pde, "[monitor]\nkind = \"auto\"\nof = \"u^2\"");
    assert_eq!(short.to_toml(), long.to_toml());
}

/// Data that go up and down from node to node are noise; a front or a ridge of one node is none.
#[test]
fn noise_is_named() {
    let given = |u: &str| study("start = 0\nend = 0.1", &format!("kind = \"prescribed\"\nu = \"{u}\""), "");
    let said = doubts(&given("sin(1e7*x + 3e6*y*y)"));
    assert!(said.iter().any(|said| said.starts_with("noisy-density: ")), "{said:?}");
    for u in ["tanh(1e3*(x - 0.5))", "exp(-(1e3*(x - 0.5))^2)", "sin(2*pi*x)*sin(2*pi*y)", "1"] {
        let said = doubts(&given(u));
        assert!(!said.iter().any(|said| said.starts_with("noisy-density")), "{u}: {said:?}");
    }
}

/// Steps that vanish are told apart: u_t = u² ends in a finite time, and what jumps all the time has no such end.
#[test]
fn steps_that_vanish_say_why() {
    let pde = "kind = \"formula\"\nunknowns = [\"u\"]\nsource = { u = \"u^2\" }\ndiffusivity = { u = \"1e-4\" }\n\
               initial = { u = \"1 + exp(-((x-0.5)^2 + (y-0.5)^2)/0.1^2)\" }\nboundary = { u = \"no-flux\" }";
    let failed = |study: &MovingMesh| match study.compute().unwrap().1 {
        Some(error @ Error::Failed { .. }) => (error.to_string(), study.remedy(&error).unwrap()),
        other => panic!("{other:?}"),
    };
    let (message, help) = failed(&study("start = 0\nend = 1", pde, ""));
    assert!(message.contains("the solution grows faster than any step can follow"), "{message}");
    assert!(help.contains("time.end"), "{help}");
}

/// A periodic axis of one cell is that of a problem in one dimension: two cells have the same solution.
#[test]
fn one_cell_on_a_periodic_axis_is_enough() {
    for (cells, upper, periodic, x, generator) in [
        ([[60, 1], [60, 2]], "[1.0, 0.1]", "[false, true]", "x", "whole"),
        ([[1, 60], [2, 60]], "[0.1, 1.0]", "[true, false]", "y", "whole"),
        ([[60, 1], [60, 2]], "[1.0, 0.1]", "[true, true]", "x", "whole"),
        ([[60, 1], [60, 2]], "[1.0, 0.1]", "[false, true]", "x", "fixed"),
    ] {
        let conditions = if periodic == "[true, true]" { "" } else { "boundary = { u = \"no-flux\" }" };
        let largest = cells.map(|cells| {
            let text = format!(
                "[study]\nname = \"strip\"\nkind = \"moving-mesh\"\n[domain]\nlower = [0.0, 0.0]\nupper = {upper}\n\
                 periodic = {periodic}\n[grid]\ncells = {cells:?}\n[time]\nstart = 0\nend = 0.1\nstep = 1e-3\n[pde]\n\
                 kind = \"formula\"\nunknowns = [\"u\"]\nflux = {{ u = [\"u^2/2\", \"u^2/2\"] }}\n\
                 diffusivity = {{ u = \"2e-3\" }}\ninitial = {{ u = \"exp(-(({x} - 0.4)/0.05)^2)\" }}\n{conditions}\n\
                 [mesh]\nform = \"gradient\"\ngenerator = {{ kind = \"{generator}\" }}\n"
            );
            let study = MovingMesh::from_source(&Source::new("the study", text)).unwrap();
            let mut simulation = study.simulation().unwrap();
            let mut record = Record::default();
            let mut state = study.start(&simulation, &mut record, &mut []).unwrap();
            simulation.run(&mut state, &mut record, &mut []).unwrap();
            state.u.values().iter().copied().fold(0.0, f64::max)
        });
        assert!((largest[0] - largest[1]).abs() < 1e-7 && largest[0] > 0.1, "{cells:?}: {largest:?}");
    }
}
