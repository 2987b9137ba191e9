//! The uniform solver: nanoseconds a node and Runge–Kutta substep, by order, size and threads, in one run.

use driftmesh::geometry::{Lattice, Mesh};
use driftmesh::physics::{Burgers, Convection, Motion, Physics, UniformBurgers};
use std::time::Instant;

fn main() {
    println!("{:>6} {:>6} {:>12} {:>12} {:>24}", "nodes", "order", "ns, 1 core", "ns, 2", "2 threads, times faster");
    for n in [201, 801] {
        for order in [2, 4] {
            let mesh = Mesh::uniform(Lattice::bounded([n - 1; 2]).unwrap(), [0.0; 2], [1.0; 2]).unwrap();
            let physics = Burgers::new(1e-3, Convection::Conservative).unwrap();
            let mut physics = UniformBurgers::new(physics, order).unwrap();
            let u = physics.initial(0.25, &mesh);
            let motion = Motion { t: 0.25, dt: 2e4 / (n * n) as f64 * 0.5, old: &mesh, new: &mesh };
            // in turns, the fastest of several: the machine is shared
            let mut best = [f64::INFINITY; 2];
            for _ in 0..5 {
                for (threads, best) in [1, 2].into_iter().zip(&mut best) {
                    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                    let start = Instant::now();
                    let (_, work) = pool.install(|| physics.step(motion, &u).unwrap());
                    *best = best.min(start.elapsed().as_secs_f64() * 1e9 / (work.substeps * n * n) as f64);
                }
            }
            let [one, two] = best;
            println!("{:>6} {order:>6} {one:>12.2} {two:>12.2} {:>24.2}", format!("{n}²"), one / two);
        }
    }
}
