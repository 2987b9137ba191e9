//! The recipe that needs no number: its errors beside those of two independent implementations.

use driftmesh::study::{MovingMesh, Source, compute};

/// A study of the front with nothing but these set.
fn front(viscosity: f64, cells: usize, end: f64, set: &[&str]) -> MovingMesh {
    let mut source = Source::new(
        "front",
        format!(
            "[study]\nname = \"front\"\nkind = \"moving-mesh\"\n[grid]\ncells = [{cells}, {cells}]\n\
             [time]\nstart = 0.25\nend = {end}\n[pde]\nkind = \"burgers\"\nviscosity = {viscosity:e}\n"
        ),
    );
    set.iter().for_each(|assignment| source.set(assignment).unwrap());
    MovingMesh::from_source(&source).unwrap()
}

/// l_inf at the end, and the number of steps.
fn run(study: &MovingMesh) -> (f64, usize) {
    let (record, failure) = compute(study).unwrap();
    assert!(failure.is_none(), "{failure:?}");
    assert!(record.warnings.is_empty(), "{:?}", record.warnings);
    (record.reports.last().unwrap().error.unwrap().linf, record.work.steps)
}

/// l_inf within 5 % of the figures measured in C, with Δt = ν as given and as found automatically.
#[test]
fn a_front_of_any_width_is_resolved_without_a_number() {
    for (viscosity, cells, expected) in [(5e-3, 20, 8.36e-3), (2e-3, 30, 6.52e-3), (1e-3, 40, 4.90e-3)] {
        let step = format!("time.step={viscosity:e}");
        for set in [&[step.as_str()][..], &[]] {
            let (l_inf, steps) = run(&front(viscosity, cells, 0.75, set));
            assert!((l_inf / expected - 1.0).abs() < 0.05, "ν = {viscosity}: {l_inf:e} against {expected:e}");
            let as_long = 0.5 / viscosity;
            assert!((steps as f64 / as_long - 1.0).abs() < 0.05, "ν = {viscosity}: {steps} steps against {as_long}");
        }
    }
}

/// Past t = 1, where the front rounds the corners: Δt = ν/2 and τ = 40 Δt on 51² nodes.
#[test]
fn the_front_passes_the_corners() {
    let study = front(1e-3, 50, 1.25, &["time.step=5e-4", "mesh.relaxation.steps=40"]);
    let (l_inf, _) = run(&study);
    assert!((l_inf / 1.205e-2 - 1.0).abs() < 0.05, "{l_inf:e}");
}

/// Subdomains by walks follow the single solve: within 1 % of its error, at a = Δt/(τh²) = 64.
#[test]
fn walks_follow_the_conservative_form() {
    let (whole, _) = run(&front(2e-3, 40, 0.5, &[]));
    let stochastic = "mesh.generator={kind=\"stochastic\",subdomains=[4,4]}";
    let (walks, _) = run(&front(2e-3, 40, 0.5, &[stochastic]));
    assert!((walks / whole - 1.0).abs() < 0.01, "{walks:e} against {whole:e}");
}

/// A constant has nothing to follow: the mesh stays, and so does the constant, in the fewest steps there are.
#[test]
fn a_constant_rests() {
    let set = ["pde={kind=\"burgers\",viscosity=0.01,initial=\"0.7\",boundary=\"0.7\"}"];
    let (record, failure) = compute(&front(0.01, 12, 1.0, &set)).unwrap();
    assert!(failure.is_none() && record.work.steps == 100, "{:?}", record.work);
    let quality = record.reports[0].quality;
    assert!((quality.q_max - 1.0).abs() < 1e-12 && (quality.equidistribution - 1.0).abs() < 1e-12, "{quality:?}");
}

/// A restless mesh is warned of, and ends the run by name where no step is short enough for it.
#[test]
fn a_restless_mesh_is_named() {
    let study = front(1e-3, 40, 1.25, &["mesh.relaxation.steps=5"]);
    assert!(study.warnings().unwrap()[0].contains("5 steps: below 15"), "{:?}", study.warnings());
    let (_, failure) = compute(&study).unwrap();
    let failure = failure.unwrap();
    assert!(failure.to_string().contains("automatic time steps shrank"), "{failure}");
    assert!(study.remedy(&failure).unwrap().contains("mesh.relaxation (now { steps = 5.0 })"), "{failure}");
}
