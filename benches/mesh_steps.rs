//! Mesh stepping by itself: the mesh of 113² nodes follows a front for 100 steps. `benches/mesh_steps.py` does the same
//! from Python.

use driftmesh::density::{Arclength, Monitor};
use driftmesh::geometry::{Lattice, Mesh};
use driftmesh::meshing::{Form, MeshGenerator, Mmpde, Whole};
use std::time::Instant;

fn main() -> driftmesh::Result<()> {
    let (mut best, mut middle) = (f64::INFINITY, 0.0);
    for _ in 0..3 {
        let start = Instant::now();
        let mut mesh = Mesh::uniform(Lattice::bounded([112; 2])?, [0.0; 2], [1.0; 2])?;
        let (monitor, mut generator) = (Arclength::default(), Whole::default());
        let equation = Mmpde { relaxation: 0.1.into(), form: Form::Conservative };
        for step in 0..100 {
            let t = 1e-3 * f64::from(step);
            let u: Vec<f64> = mesh.x().iter().map(|[x, y]| (40.0 * (x + y - 0.8 - t)).tanh()).collect();
            let rho = monitor.density(&mesh, &u, None)?;
            mesh = generator.step(&equation, &mesh, &rho, 1e-3)?.mesh;
        }
        best = best.min(start.elapsed().as_secs_f64());
        middle = mesh.x()[mesh.lattice().index([40, 56])][0];
    }
    println!("{best} {middle}");
    Ok(())
}
