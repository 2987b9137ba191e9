//! Burgers' equation with central fluxes, as formulas and as it is built in: seconds of steps on a moving mesh.

use driftmesh::geometry::{Field, Lattice, Mesh};
use driftmesh::physics::{Burgers, BurgersFlux, Convection, FormulaPde, Motion, Physics};
use std::time::Instant;

const VISCOSITY: f64 = 0.005;
const STEPS: usize = 20;
const DT: f64 = 1e-3;

fn main() {
    let front = format!("1/(1 + exp((x + y - t)/{}))", 2.0 * VISCOSITY);
    let pde: FormulaPde = toml::from_str(&format!(
        r#"
        unknowns = ["u"]
        flux = {{ u = ["0.5*u^2", "0.5*u^2"] }}
        diffusivity = {{ u = {VISCOSITY} }}
        initial = {{ u = "{front}" }}
        boundary = {{ u = "{front}" }}
        "#
    ))
    .unwrap();
    let mut builtin = Burgers::new(VISCOSITY, Convection::Flux).unwrap();
    builtin.flux = BurgersFlux::Central;
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    for n in [40, 120] {
        let square = Mesh::uniform(Lattice::bounded([n, n]).unwrap(), [0.0; 2], [1.0; 2]).unwrap();
        let meshes: Vec<Mesh<2>> = (0..=STEPS)
            .map(|step| {
                let t = 3.0 * DT * step as f64;
                let bent = |x: f64, y: f64| x + 0.1 * (std::f64::consts::TAU * x).sin() * (5.0 * y + t).cos();
                square.moved(square.x().iter().map(|&[x, y]| [bent(x, y), bent(y, x)]).collect()).unwrap()
            })
            .collect();
        let mut kinds: [(&str, Box<dyn Physics>); 2] =
            [("built in", Box::new(builtin.clone())), ("formulas", pde.clone().into_physics().unwrap())];
        let mut best = [f64::INFINITY; 2];
        let mut newton = [0; 2];
        // in turns, so that a change of the clock's rate meets both
        for _ in 0..10 {
            for (k, (_, physics)) in kinds.iter_mut().enumerate() {
                let mut u: Field = physics.initial(0.5, &meshes[0]);
                newton[k] = 0;
                let start = Instant::now();
                for step in 0..STEPS {
                    let (old, new) = (&meshes[step], &meshes[step + 1]);
                    let motion = Motion { t: 0.5 + DT * step as f64, dt: DT, old, new };
                    let (next, work) = one.install(|| physics.step(motion, &u)).unwrap();
                    u = next;
                    newton[k] += work.newton_iterations;
                }
                best[k] = best[k].min(start.elapsed().as_secs_f64() / STEPS as f64);
            }
        }
        for ((name, _), (time, newton)) in kinds.iter().zip(best.iter().zip(newton)) {
            println!(
                "{n:>4} cells  {name:<10}{:8.3} ms a step, {newton} Newton iterations, {:.2} of that built in",
                1e3 * time,
                time / best[0]
            );
        }
    }
}
