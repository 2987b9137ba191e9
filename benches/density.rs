//! What a density costs a node, from small lattices to large ones: `cargo bench -p driftmesh --bench density`.
//!
//! The figure is the smallest of several times over the number of nodes, as a ratio to that at 64 × 64 cells.

use driftmesh::density::{Monitor, RootGradient};
use driftmesh::geometry::{Lattice, Mesh};
use std::time::Instant;

fn main() -> driftmesh::Result<()> {
    let mut first = None;
    println!("| cells | ns a node | over that at 64² |\n| ---: | ---: | ---: |");
    for n in [64_usize, 128, 256, 512, 1024] {
        let mesh = Mesh::uniform(Lattice::bounded([n, n])?, [0.0; 2], [1.0; 2])?;
        let u: Vec<f64> = mesh.x().iter().map(|x| (n as f64 * (x[0] + 0.3 * x[1] - 0.6)).tanh()).collect();
        let mut best = f64::INFINITY;
        for _ in 0..(1 << 24) / (n * n) {
            let start = Instant::now();
            std::hint::black_box(RootGradient::default().density(&mesh, &u, None)?);
            best = best.min(start.elapsed().as_secs_f64());
        }
        let node = 1e9 * best / mesh.x().len() as f64;
        let first = *first.get_or_insert(node);
        println!("| {n}² | {node:.1} | {:.2} |", node / first);
    }
    Ok(())
}
