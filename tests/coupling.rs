//! M^kP and (MP)^l, with a density that is a known function of x and physics that stands still or moves.

use driftmesh::density::{Arclength, Density, Monitor};
use driftmesh::geometry::{Field, Lattice, Mesh};
use driftmesh::meshing::{Mmpde, Whole};
use driftmesh::mover::Mover;
use driftmesh::physics::{Burgers, Convection, Motion, Physics};
use driftmesh::simulation::{Coupling, Record, Safety, Schedule, Simulation, State};
use driftmesh::{Failure, Work};

/// A bump at the centre, whatever u is.
struct Bump;

impl Monitor for Bump {
    fn density(&self, mesh: &Mesh<2>, _u: &[f64], _gradient: Option<&[[f64; 2]]>) -> Result<Density, Failure> {
        Ok(mesh.x().iter().map(|[x, y]| 1.0 + 5.0 * (-30.0 * ((x - 0.5).powi(2) + (y - 0.5).powi(2))).exp()).collect())
    }
}

/// Nothing happens.
struct Still;

impl Physics for Still {
    fn unknowns(&self) -> Vec<String> {
        vec!["u".into()]
    }

    fn initial(&self, _t: f64, mesh: &Mesh<2>) -> Field {
        Field::scalar(vec![0.0; mesh.x().len()])
    }

    fn step(&mut self, _motion: Motion<'_>, u: &Field) -> Result<(Field, Work), Failure> {
        Ok((u.clone(), Work::default()))
    }
}

fn simulate(
    physics: Box<dyn Physics>,
    monitor: Box<dyn Monitor>,
    coupling: Coupling,
    start: f64,
    end: f64,
    dt: f64,
) -> (State, Record) {
    let mut simulation = Simulation {
        physics,
        monitor,
        mover: Mover::by(Box::new(Whole::default()), Mmpde { relaxation: 0.2.into(), ..Mmpde::published() }),
        coupling,
        safety: Safety::default(),
        schedule: Schedule::new(start, end, dt, vec![end]).unwrap(),
    };
    let mesh = Mesh::uniform(Lattice::bounded([20, 20]).unwrap(), [0.0; 2], [1.0; 2]).unwrap();
    let mut state = simulation.start(mesh).unwrap();
    let mut record = Record::default();
    simulation.run(&mut state, &mut record, &mut []).unwrap();
    (state, record)
}

fn largest_difference(a: &State, b: &State) -> f64 {
    let pairs = a.mesh.x().as_flattened().iter().zip(b.mesh.x().as_flattened());
    pairs.fold(0.0, |m, (a, b)| m.max((a - b).abs()))
}

/// Sub-steps carry ρ(x) along: eight of them come at least four times closer to the mesh of very small steps.
#[test]
fn mesh_sub_steps_follow_the_density_in_x() {
    let run = |mesh_steps, dt| {
        let coupling = Coupling { mesh_steps, ..Coupling::default() };
        simulate(Box::new(Still), Box::new(Bump), coupling, 0.0, 0.02, dt).0
    };
    let reference = run(1, 1e-5);
    let [one, eight] = [1, 8].map(|k| largest_difference(&run(k, 0.01), &reference));
    assert!(eight < 0.25 * one, "M⁸P is {eight:.2e} away, MP {one:.2e}");
}

/// One sub-step is MP itself, and each costs one mesh solve.
#[test]
fn work_counts_sub_steps_and_iterations() {
    let solves = |mesh_steps, iterations| {
        let coupling = Coupling { mesh_steps, iterations, tolerance: 0.0 };
        simulate(Box::new(Still), Box::new(Bump), coupling, 0.0, 0.05, 0.01).1.work.work.linear_solves
    };
    // five steps, each four sides and two coordinates
    assert_eq!(solves(1, 1), 30);
    assert_eq!(solves(3, 1), 90);
    assert_eq!(solves(1, 2), 60);
    assert_eq!(solves(3, 2), 180);
}

/// (MP)^l converges to the simultaneous solution: further iterations change the mesh less and less.
#[test]
fn iterations_converge_to_the_simultaneous_solution() {
    let run = |iterations| {
        let coupling = Coupling { iterations, ..Coupling::default() };
        let physics = Box::new(Burgers::new(0.02, Convection::Conservative).unwrap());
        simulate(physics, Box::new(Arclength::default()), coupling, 0.25, 0.35, 0.01).0
    };
    let states = [1, 2, 3, 4].map(run);
    let changes: Vec<f64> = states.windows(2).map(|pair| largest_difference(&pair[0], &pair[1])).collect();
    assert!(changes[0] > 1e-4, "the coupling does nothing: {changes:?}");
    assert!(changes[1] < changes[0] && changes[2] < 0.25 * changes[0], "{changes:?}");
}

/// With a tolerance rounds end when the mesh no longer changes, well before the most, and the mesh is that of many
/// rounds; sub-steps are doubled no further than the mesh needs.
#[test]
fn a_tolerance_ends_rounds_and_doubling() {
    let run = |coupling| {
        let physics = Box::new(Burgers::new(0.02, Convection::Conservative).unwrap());
        let (state, record) = simulate(physics, Box::new(Arclength::default()), coupling, 0.25, 0.35, 0.01);
        (state, record.work.work.linear_solves)
    };
    let (settled, solves) = run(Coupling { iterations: 100, tolerance: 1e-8, ..Coupling::default() });
    let (many, most) = run(Coupling { iterations: 30, ..Coupling::default() });
    let (one, _) = run(Coupling::default());
    assert!(largest_difference(&settled, &many) < 1e-7, "{:e}", largest_difference(&settled, &many));
    assert!(largest_difference(&one, &many) > 1e-4 && solves < most, "{solves} against {most}");
    let (rough, few) = run(Coupling { mesh_steps: 64, tolerance: 1e-2, ..Coupling::default() });
    let (fine, more) = run(Coupling { mesh_steps: 64, tolerance: 1e-4, ..Coupling::default() });
    let (finest, _) = run(Coupling { mesh_steps: 64, ..Coupling::default() });
    assert!(few < more, "{few} against {more}");
    let [far, near] = [&rough, &fine].map(|state| largest_difference(state, &finest));
    assert!(near < far && near < 1e-3, "{far:e}, {near:e}");
}
