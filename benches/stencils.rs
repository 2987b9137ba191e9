//! Nine-point stencils a second, on one thread: `cargo bench -p driftmesh --bench stencils`.

use driftmesh::geometry::{Lattice, Mesh};
use driftmesh::laplacian::{Laplacian, Polynomials, Scaling, stencils};
use std::time::Instant;

fn main() {
    let n = 400;
    let lattice = Lattice::bounded([n + 1, n + 1]).unwrap();
    let x = (0..lattice.len()).map(|k| {
        let [i, j] = lattice.node(k).map(|i| i as f64 / (n + 1) as f64);
        [i + 0.05 * (6.0 * j).sin() * i * (1.0 - i), j + 0.05 * (5.0 * i).sin() * j * (1.0 - j)]
    });
    let mesh = Mesh::mapped(lattice, x.collect()).unwrap();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let published = Laplacian::Published { polynomials: Polynomials::Harmonic, scaling: Scaling::Global };
    for kind in [Laplacian::Optimised, Laplacian::Harmonic, published, Laplacian::Mapped, Laplacian::Compact25] {
        let best = (0..7).map(|_| {
            let clock = Instant::now();
            pool.install(|| std::hint::black_box(stencils(&mesh, kind).unwrap()));
            clock.elapsed().as_secs_f64()
        });
        let rate = (n * n) as f64 / best.fold(f64::INFINITY, f64::min);
        println!("{:12} {rate:.3e}", kind.name());
    }
}
