//! What a whole step costs a node, from small lattices to large ones: density, mesh, Burgers' equation, quality and
//! error.
//!
//!     cargo bench -p driftmesh --bench whole_step
//!
//! One thread, automatic relaxation, steps of a given length; the adapted start stands beside. First the front is as
//! many cells wide on each lattice and steps shrink with it, then front and steps stay the same.

use driftmesh::simulation::Record;
use driftmesh::study::{Kind, MovingMesh, Source};

const STEPS: usize = 8;

fn main() -> driftmesh::Result<()> {
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool");
    for (name, viscosity) in [("ν = 0.2/n", None), ("ν = 5e-3", Some(5e-3))] {
        println!("\n{name}, Δt = 2 ν\n");
        println!(
            "| cells | ns a node and step | over that at 64² | mesh | pde | density | start, µs a node | \
             Newton | products |"
        );
        println!("| ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |");
        let mut first = None;
        for n in [64, 128, 256, 512, 1024] {
            let viscosity = viscosity.unwrap_or(0.2 / n as f64);
            one.install(|| row(n, viscosity, &mut first))?;
        }
    }
    Ok(())
}

fn row(n: usize, viscosity: f64, first: &mut Option<f64>) -> driftmesh::Result<()> {
    let (step, start) = (2.0 * viscosity, 0.5);
    let end = start + STEPS as f64 * step;
    let text = format!(
        "[study]\nname = \"step\"\nkind = \"moving-mesh\"\n[grid]\ncells = [{n}, {n}]\n[time]\nstart = {start}\n\
         end = {end}\nstep = {step}\n[pde]\nkind = \"burgers\"\nviscosity = {viscosity}\n"
    );
    let study = MovingMesh::from_source(&Source::new("whole_step.toml", text))?;
    let mut simulation = study.simulation()?;
    let mut record = Record::default();
    let mut state = study.start(&simulation, &mut record, &mut [])?;
    let begun = record.seconds;
    simulation.run(&mut state, &mut record, &mut [])?;
    let nodes = state.mesh.x().len() as f64;
    let of = |seconds: f64| 1e9 * seconds / (nodes * record.work.steps as f64);
    let a_step = |count: usize| count as f64 / record.work.steps as f64;
    let spent = record.seconds;
    let node = of(spent.wall - begun.wall);
    println!(
        "| {n}² | {node:.0} | {:.2} | {:.0} | {:.0} | {:.0} | {:.0} | {:.1} | {:.1} |",
        node / *first.get_or_insert(node),
        of(spent.parts.mesh - begun.parts.mesh),
        of(spent.parts.pde - begun.parts.pde),
        of(spent.parts.monitor - begun.parts.monitor),
        1e6 * begun.wall / nodes,
        a_step(record.work.work.newton_iterations),
        a_step(record.work.work.linear_iterations),
    );
    Ok(())
}
