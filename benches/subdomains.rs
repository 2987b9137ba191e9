//! The mesh step of one core by 8 × 8 subdomains over one solve of the whole: Burgers' front of case B in its density,
//! at t = 0.3. Times in one row are taken turn by turn; the errors are root mean squares over all nodes.
//!
//!     cargo bench -p driftmesh --bench subdomains

use driftmesh::density::{Arclength, Monitor};
use driftmesh::geometry::{Density, Lattice, Mesh, compare};
use driftmesh::meshing::{
    EstimatorKind, MeshGenerator, Mmpde, Moved, ResidualWalk, Schwarz, Stochastic, Strip, Transmission, Whole,
};
use std::time::Instant;

const DT: f64 = 1e-3;
const STEPS: usize = 50;

/// The mesh that follows the exact solution, and its density.
fn developed(n: usize) -> driftmesh::Result<(Mesh<2>, Density)> {
    let density = |mesh: &Mesh<2>, step: usize| {
        let t = 0.25 + step as f64 * DT;
        let u: Vec<f64> = mesh.x().iter().map(|[x, y]| 1.0 / (1.0 + ((x + y - t) / 0.01).exp())).collect();
        Arclength::default().density(mesh, &u, None)
    };
    let mut mesh = Mesh::uniform(Lattice::bounded([n, n])?, [0.0; 2], [1.0; 2])?;
    let mut whole = Whole::default();
    for step in 0..STEPS {
        mesh = whole.step(&Mmpde::published(), &mesh, &density(&mesh, step)?, DT)?.mesh;
    }
    let rho = density(&mesh, STEPS)?;
    Ok((mesh, rho))
}

fn main() -> driftmesh::Result<()> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool");
    pool.install(|| {
        println!("| nodes | by | ms | over the whole | distance from it | over that of the old mesh |");
        println!("| ---: | :--- | ---: | ---: | ---: | ---: |");
        for n in [40, 80, 160, 320, 640] {
            rows(n)?;
        }
        Ok(())
    })
}

fn rows(n: usize) -> driftmesh::Result<()> {
    let (mesh, rho) = developed(n)?;
    let s = if n < 320 { 4 } else { 8 };
    let stochastic =
        |estimator: EstimatorKind| -> Box<dyn MeshGenerator> { Box::new(Stochastic::new([s, s], 1, estimator)) };
    let schwarz = |method: Transmission| -> Box<dyn MeshGenerator> {
        let mut schwarz = Schwarz::new([s, s], 4);
        (schwarz.method, schwarz.tolerance) = (method, Some(1e-7));
        Box::new(schwarz)
    };
    let mut generators: Vec<(&str, Box<dyn MeshGenerator>)> = vec![
        ("one solve", Box::<Whole>::default()),
        ("strips", stochastic(EstimatorKind::Strip(Strip::default()))),
        ("the default", stochastic(EstimatorKind::ResidualWalk(ResidualWalk::default()))),
        ("Schwarz to 1e-7, classical", schwarz(Transmission::Classical)),
        ("Schwarz to 1e-7, optimised", schwarz(Transmission::Optimized)),
    ];
    let mut best = vec![f64::INFINITY; generators.len()];
    let mut found: Vec<Option<Moved>> = vec![None; generators.len()];
    for _ in 0..(2000 / n).clamp(3, 20) {
        for ((best, found), (_, generator)) in best.iter_mut().zip(&mut found).zip(&mut generators) {
            let started = Instant::now();
            let moved = generator.step(&Mmpde::published(), &mesh, &rho, DT)?;
            *best = best.min(started.elapsed().as_secs_f64());
            *found = Some(moved);
        }
    }
    let whole = found[0].as_ref().expect("at least three turns").mesh.clone();
    let still = compare(&mesh, &whole).mesh_rms;
    for (((name, _), best_one), moved) in generators.iter().zip(&best).zip(found) {
        let moved = moved.expect("at least three turns");
        let exchanges = moved.interface.map_or(0, |interface| interface.exchanges);
        let distance = compare(&moved.mesh, &whole).mesh_rms;
        println!(
            "| {}² | {name}, {exchanges} exchanges | {:.2} | {:.2} | {distance:.1e} | {:.1e} |",
            n + 1,
            1e3 * best_one,
            best_one / best[0],
            distance / still,
        );
    }
    Ok(())
}
