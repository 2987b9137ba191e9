//! The two mesh solves of one step: ours beside the sparse LU, for the mesh of case B half way.
//!
//! `cargo bench --bench mesh_solve` prints milliseconds, best of many. With a file name after `--` it also writes the
//! system there as `.npz` for `benches/mesh_solve.py`, which sets scipy beside it.

use driftmesh::geometry::Patch;
use driftmesh::meshing::{MeshGenerator, Mmpde, Moved, Whole};
use driftmesh::numerics::linear::{Bicgstab, LatticeMatrix, LinearSolver, SparseLu};
use driftmesh::simulation::{Record, State};
use driftmesh::study::{Kind, MovingMesh, Source};
use ndarray::{Array1, Array2};
use std::time::Instant;

const DT: f64 = 1e-3;
const TOLERANCE: [f64; 2] = [1e-12; 2];

/// Case B on n × n cells, carried to t = 0.3 so that the mesh is developed.
fn developed(n: usize) -> State {
    let mut source = Source::new("burgers", include_str!("../studies/burgers-b-stochastic.toml"));
    for assignment in [&format!("grid.cells=[{n},{n}]"), "time.end=0.3", "time.report=[0.3]"] {
        source.set(assignment).unwrap();
    }
    let study = MovingMesh::from_source(&source).unwrap();
    let mut simulation = study.simulation().unwrap();
    let mut state = study.start(&simulation, &mut Record::default(), &mut []).unwrap();
    simulation.run(&mut state, &mut Record::default(), &mut []).unwrap();
    state
}

fn best_ms(repeats: usize, mut f: impl FnMut()) -> f64 {
    let time = |f: &mut dyn FnMut()| {
        let start = Instant::now();
        f();
        1e3 * start.elapsed().as_secs_f64()
    };
    (0..repeats).map(|_| time(&mut f)).fold(f64::INFINITY, f64::min)
}

fn main() {
    let export = std::env::args().skip(1).find(|argument| !argument.starts_with("--"));
    println!("{:>6} {:>12} {:>12} {:>12} {:>6} {:>12}", "nodes", "step ms", "solve ms", "LU ms", "its", "difference");
    for n in [40, 112, 256] {
        let state = developed(n);
        let lattice = *state.mesh.lattice();
        let operator = Mmpde::published().operator(&lattice, &state.rho, DT).unwrap();
        let patch = Patch::whole(&lattice);
        // the sides at their new places
        let Moved { mesh: moved, .. } =
            Whole::default().step(&Mmpde::published(), &state.mesh, &state.rho, DT).unwrap();
        let mut guess = state.mesh.x().to_vec();
        lattice.sides().for_each(|k| guess[k] = moved.x()[k]);
        let right: Vec<[f64; 2]> = patch.nodes(&lattice).map(|k| state.mesh.x()[k]).collect();
        let padded = patch.gather(&lattice, &guess, [[0.0; 2]; 2]);

        let mut whole = Whole::default();
        let step = best_ms(50, || drop(whole.step(&Mmpde::published(), &state.mesh, &state.rho, DT).unwrap()));
        let (mut fast, mut iterations) = (Bicgstab::default(), 0);
        let mut x = padded.clone();
        let solve = best_ms(50, || {
            x.copy_from_slice(&padded);
            let matrix: LatticeMatrix<2, 5> = operator.matrix(patch);
            iterations = fast.solve(&matrix, &right, &mut x, TOLERANCE).unwrap().linear_iterations;
        });
        let mut direct = SparseLu::default();
        let mut y = padded.clone();
        let lu = best_ms(5, || {
            y.copy_from_slice(&padded);
            let matrix: LatticeMatrix<2, 5> = operator.matrix(patch);
            direct.solve(&matrix, &right, &mut y, TOLERANCE).unwrap();
        });
        let difference = x.as_flattened().iter().zip(y.as_flattened()).fold(0.0_f64, |m, (x, y)| m.max((x - y).abs()));
        println!(
            "{:>6} {step:>12.3} {solve:>12.3} {lu:>12.3} {iterations:>6} {difference:>12.1e}",
            format!("{}²", n + 1)
        );
        if let (Some(file), 112) = (&export, n) {
            write(file, &operator.matrix(patch), &right, &padded, &x, solve);
        }
    }
}

/// Rows, right-hand sides, known values (padded), our solution and its milliseconds.
fn write(file: &str, matrix: &LatticeMatrix<2, 5>, b: &[[f64; 2]], known: &[[f64; 2]], x: &[[f64; 2]], ms: f64) {
    let pairs = |v: &[[f64; 2]]| Array2::from_shape_vec((v.len(), 2), v.as_flattened().to_vec()).unwrap();
    let rows = Array2::from_shape_vec((matrix.rows.len(), 5), matrix.rows.as_flattened().to_vec()).unwrap();
    let mut npz = ndarray_npy::NpzWriter::new(std::fs::File::create(file).unwrap());
    npz.add_array("rows", &rows).unwrap();
    npz.add_array("b", &pairs(b)).unwrap();
    npz.add_array("known", &pairs(known)).unwrap();
    npz.add_array("x", &pairs(x)).unwrap();
    npz.add_array("ms", &Array1::from_vec(vec![ms])).unwrap();
    npz.finish().unwrap();
}
