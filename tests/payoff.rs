//! The recipe that needs no number: its errors beside those of two independent implementations.

use driftmesh::geometry::Mesh;
use driftmesh::simulation::Record;
use driftmesh::study::{Kind, MovingMesh, MovingRun, Source};

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
    let (MovingRun { record, .. }, failure) = study.compute().unwrap();
    assert!(failure.is_none(), "{failure:?}");
    assert!(record.warnings.is_empty(), "{:?}", record.warnings);
    (record.reports.last().unwrap().error.unwrap().linf, record.work.steps)
}

/// l_inf within 5 % of the figures measured in C, with Δt = ν, τ = 25 Δt and no prediction.
#[test]
fn the_recipe_has_the_errors_of_an_independent_implementation() {
    for (viscosity, cells, expected) in [(5e-3, 20, 8.36e-3), (2e-3, 30, 6.52e-3), (1e-3, 40, 4.90e-3)] {
        let step = format!("time.step={viscosity:e}");
        let (l_inf, _) = run(&front(viscosity, cells, 0.75, &[&step, "mesh.relaxation={steps=25}"]));
        assert!((l_inf / expected - 1.0).abs() < 0.05, "ν = {viscosity}: {l_inf:e} against {expected:e}");
    }
}

/// Past t = 1, where the front rounds the corners: Δt = ν/2 and τ = 40 Δt on 51² nodes.
#[test]
fn the_front_passes_the_corners() {
    let study = front(1e-3, 50, 1.25, &["time.step=5e-4", "mesh.relaxation={steps=40}"]);
    let (l_inf, _) = run(&study);
    assert!((l_inf / 1.205e-2 - 1.0).abs() < 0.05, "{l_inf:e}");
}

/// With nothing set but the cells, a front of any width takes few steps, each many times as long as the front is wide,
/// to an error of 1e-2; without prediction about Δt = ν is needed.
#[test]
fn a_front_of_any_width_is_resolved_without_a_number() {
    for (viscosity, cells, most) in [(5e-3, 22, 50), (2e-3, 27, 50), (1e-3, 34, 60), (2e-4, 66, 70)] {
        let (l_inf, steps) = run(&front(viscosity, cells, 0.75, &[]));
        assert!(l_inf < 1e-2 && steps < most, "ν = {viscosity}: {l_inf:e} after {steps} steps");
    }
    let (l_inf, steps) = run(&front(1e-3, 40, 0.75, &["mesh.relaxation={steps=25}"]));
    assert!(l_inf < 1e-2 && steps > 300, "{l_inf:e} after {steps} steps");
}

/// The mesh must let go of the front at t = 1, where steps shrink by themselves, and be there again after.
#[test]
fn long_steps_pass_the_corners() {
    for (viscosity, cells, error) in [(5e-3, 24, 1.5e-2), (1e-3, 50, 1.5e-2), (2e-4, 60, 6e-2)] {
        let (l_inf, steps) = run(&front(viscosity, cells, 1.25, &[]));
        assert!(l_inf < error && steps < 250, "ν = {viscosity}: {l_inf:e} after {steps} steps");
    }
}

/// A layer that moves evenly: where the mesh lags behind by a good part of a cell, a prediction leaves a twentieth of
/// it.
#[test]
fn a_prediction_has_no_lag() {
    let study = |start: f64, end: f64, relaxation: &str| {
        let text = format!(
            "[study]\nname = \"layer\"\nkind = \"moving-mesh\"\n[grid]\ncells = [40, 4]\n\
             [time]\nstart = {start}\nend = {end}\nstep = 2e-3\n\
             [pde]\nkind = \"prescribed\"\nu = \"tanh(30*(x - 0.3 - 0.4*t))\"\n[mesh]\nrelaxation = {relaxation}\n"
        );
        MovingMesh::from_source(&Source::new("layer", text)).unwrap()
    };
    let at_end = |start: f64, relaxation: &str| {
        let study = study(start, 1.0, relaxation);
        let mut simulation = study.simulation().unwrap();
        let mut record = Record::default();
        let mut state = study.start(&simulation, &mut record, &mut []).unwrap();
        if start < 0.9 {
            simulation.run(&mut state, &mut record, &mut []).unwrap();
        }
        state.mesh
    };
    // adapted to the layer where it is in the end
    let rest = at_end(0.999_999, "{ steps = 40 }");
    let off = |mesh: &Mesh<2>| {
        mesh.x().iter().zip(rest.x()).map(|(a, b)| (a[0] - b[0]).abs()).fold(0.0, f64::max) / rest.shortest_edge()
    };
    let (lag, none) = (off(&at_end(0.0, "{ steps = 40 }")), off(&at_end(0.0, "{ steps = 40, prediction = 0.2 }")));
    assert!(lag > 0.2 && none < lag / 20.0, "{none} against {lag} of the shortest edge");
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
    let (MovingRun { record, .. }, failure) = front(0.01, 12, 1.0, &set).compute().unwrap();
    assert!(failure.is_none() && record.work.steps == 20, "{:?}", record.work);
    let quality = record.reports[0].quality;
    assert!((quality.q_max - 1.0).abs() < 1e-12 && (quality.equidistribution - 1.0).abs() < 1e-12, "{quality:?}");
}

/// A jump that the sides keep up: a warning, and the run completes without a new extremum.
#[test]
fn a_jump_on_the_sides_is_kept() {
    let jump = "pde={kind=\"burgers\",viscosity=0.01,initial=\"if(x<0.3,0,1)\",boundary=\"if(x<0.3,0,1)\"}";
    let study = front(0.01, 20, 1.0, &[jump]);
    let mut simulation = study.simulation().unwrap();
    let mut record = Record::default();
    let mut state = study.start(&simulation, &mut record, &mut []).unwrap();
    assert!(record.warnings[0].contains("within one of the thinnest cells"), "{:?}", record.warnings);
    simulation.run(&mut state, &mut record, &mut []).unwrap();
    assert!(state.u.values().iter().all(|u| (-1e-3..1.001).contains(u)));
}

/// A jump at the start alone is smoothed out: a warning, and the run completes.
#[test]
fn a_jump_at_the_start_is_smoothed_out() {
    let jump = "pde={kind=\"burgers\",viscosity=0.01,initial=\"if(abs(x-0.4)+abs(y-0.4)<0.2,1,0.2)\",boundary=\"0.2\"}";
    let (MovingRun { record, .. }, failure) = front(0.01, 20, 0.5, &[jump]).compute().unwrap();
    assert!(failure.is_none(), "{failure:?}");
    assert!(record.warnings[0].contains("`mesh.start`"), "{:?}", record.warnings);
    assert!(record.work.steps < 300, "{:?}", record.work);
}
