mod equation;
mod generators;
mod stochastic;

use super::*;
use crate::geometry::{Lattice, Patch};
use crate::numerics::linear::SparseLu;
use std::f64::consts::PI;

const DT: f64 = 1e-3;

fn mesh(cells: [usize; 2], periodic: [bool; 2]) -> Mesh<2> {
    Mesh::uniform(Lattice::new(cells, periodic).unwrap(), [-1.0, 2.0], [1.0, 3.0]).unwrap()
}

/// A smooth density with a bump of the given height, periodic on the box.
fn bump(mesh: &Mesh<2>, height: f64, centre: f64) -> Density {
    let wave = |s: f64| (2.0 * PI * (s - centre)).cos();
    let place = |x: [f64; 2]| [0.5 * (x[0] + 1.0), x[1] - 2.0];
    mesh.x().iter().map(|&x| place(x)).map(|[s, r]| 1.0 + height * (2.0 * (wave(s) + wave(r) - 2.0)).exp()).collect()
}

fn advance(generator: &mut dyn MeshGenerator, mesh: &Mesh<2>, rho: &Density, steps: usize) -> Mesh<2> {
    advance_with(&Mmpde::published(), generator, mesh, rho, steps)
}

fn advance_with(
    equation: &Mmpde,
    generator: &mut dyn MeshGenerator,
    mesh: &Mesh<2>,
    rho: &Density,
    steps: usize,
) -> Mesh<2> {
    (0..steps).fold(mesh.clone(), |mesh, _| generator.step(equation, &mesh, rho, DT).unwrap().mesh)
}

/// Both forms of the mesh equation.
fn forms() -> [Mmpde; 2] {
    let conservative = Mmpde { relaxation: Relaxation::steps(25.0), form: Form::Conservative };
    [Mmpde::published(), conservative]
}

/// A step solved by the direct solver.
fn exact_step(equation: &Mmpde, mesh: &Mesh<2>, rho: &Density) -> Mesh<2> {
    let (lattice, mut x) = (*mesh.lattice(), mesh.x().to_vec());
    move_sides(equation, mesh, rho, DT, &mut x, &mut Default::default()).unwrap();
    let (patch, [width, height]) = (Patch::whole(&lattice), mesh.extent());
    let jump = [[width, 0.0], [0.0, height]];
    let operator = equation.operator(&lattice, rho, DT).unwrap();
    let solver = &mut SparseLu::default();
    let (new, _) = operator.solve::<5, 2>(patch, mesh.x(), &x, jump, solver, [3.0; 2]).unwrap();
    patch.scatter(&lattice, &new, &mut x, jump);
    mesh.moved(x).unwrap()
}

fn largest_difference(a: &Mesh<2>, b: &Mesh<2>) -> f64 {
    let pairs = a.x().as_flattened().iter().zip(b.x().as_flattened());
    pairs.fold(0.0, |m, (a, b)| m.max((a - b).abs()))
}
