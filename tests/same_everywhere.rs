//! Unknowns that are the same everywhere: ordinary differential equations, whose solutions are known.

use driftmesh::Error;
use driftmesh::error::{Cause, Failure};
use driftmesh::study::{Kind, MovingMesh, MovingRun, Source};

/// A run on a square with u = 1 at the start, and nothing through its sides.
fn run(source: &str, end: f64, step: &str) -> (MovingRun<2>, Option<Error>) {
    let text = format!(
        "[study]\nname = \"same\"\nkind = \"moving-mesh\"\n[grid]\ncells = [30, 30]\n[time]\nstart = 0\nend = {end}\n\
         step = {step}\n[pde]\nkind = \"formula\"\nunknowns = [\"u\"]\ndiffusivity = {{ u = \"0.01\" }}\n\
         source = {{ u = \"{source}\" }}\ninitial = {{ u = \"1\" }}\nboundary = {{ u = \"no-flux\" }}\n"
    );
    MovingMesh::from_source(&Source::new("the study", text)).unwrap().compute().unwrap()
}

/// Differences from node to node that Newton's method leaves neither shorten steps nor move nodes.
#[test]
fn what_solvers_leave_is_not_followed() {
    for step in ["\"auto\"", "0.01"] {
        for (source, exact, off) in [("1", 2.0, 1e-6), ("-u", (-1.0_f64).exp(), 1e-3), ("u*(2 - u)", 1.761_594, 1e-3)] {
            let (run, failure) = run(source, 1.0, step);
            assert!(failure.is_none(), "{source}, {step}: {failure:?}");
            let state = run.state.unwrap();
            let error = state.u.component(0).fold(0.0, |most: f64, u| most.max((u - exact).abs()));
            assert!(error < off * exact, "{source}, {step}: off by {error:.1e}");
            let [steps, newton] = [run.record.work.steps, run.record.work.work.newton_iterations];
            assert!(steps <= 100 && newton <= 5 * steps, "{source}, {step}: {steps} steps, {newton} iterations");
            let equal = state.mesh.even(*state.mesh.lattice()).unwrap();
            let moved = state.mesh.farthest(&equal);
            assert!(moved < 1e-6, "{source}, {step}: nodes went as far as {moved:.1e}");
        }
    }
}

/// u' = u² with u(0) = 1 blows up at t = 1, and the run says so.
#[test]
fn a_constant_that_blows_up_is_told() {
    let (run, failure) = run("u^2", 2.0, "\"auto\"");
    let blows_up = |failure: &Error| {
        matches!(failure, Error::Failed { failure: Failure::VanishingStep { cause: Cause::BlowUp, .. }, .. })
    };
    assert!(failure.as_ref().is_some_and(blows_up), "{failure:?}");
    let warnings = &run.record.warnings;
    assert!(warnings.iter().any(|said| said.starts_with("blow-up: `u` grows")), "{warnings:?}");
    let t = run.state.unwrap().t;
    assert!((t - 1.0).abs() < 0.03, "it ends at t = {t}");
}
