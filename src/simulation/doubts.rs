//! What a start should make its user doubt.

use super::{Simulation, State};
use crate::density::{NOISE_WORTH_A_WARNING, noise};
use crate::geometry::{Field, Lattice, Mesh, node_areas};
use crate::numerics::{larger, sum};

/// Share of the content of an unknown whose loss is told.
const LOSS: f64 = 0.2;
/// Content below this share of the largest value times the area of the box is of rounding.
const ROUNDING: f64 = 1e-9;
/// Cells of the reference for a cell of the mesh, along an axis, and the most of its nodes.
const FINER: usize = 8;
const MOST_NODES: usize = 1 << 20;

/// Warnings of a density that is noise at the cell scale, and of each unknown of which the mesh misses something at the
/// start.
pub(super) fn doubts(simulation: &Simulation, state: &State) -> Vec<String> {
    noisy(simulation, state).into_iter().chain(lost(simulation, state)).collect()
}

fn noisy(simulation: &Simulation, state: &State) -> Option<String> {
    if !simulation.mover.generator.moves() {
        return None;
    }
    let followed = simulation.monitor.followed(state.t, &state.mesh, &state.u).ok()?;
    let share = noise(state.mesh.lattice(), &followed);
    (share > NOISE_WORTH_A_WARNING).then(|| {
        format!(
            "noisy-density: {:.0} % of what the mesh follows goes up and down from node to node, so that it follows noise of \
             the size of its cells; smooth it, name something smoother in `monitor.of`, or refine `grid.cells`",
            100.0 * share
        )
    })
}

/// The content of an unknown is ∫|u − m|, m its median over the domain. The reference is on equal cells, a few times smaller
/// than those of the mesh; where it and the same on cells twice as large differ as much as it and the mesh do, nothing is
/// known.
fn lost(simulation: &Simulation, state: &State) -> Vec<String> {
    let cells = state.mesh.lattice().cells();
    let nodes: usize = cells.iter().product();
    let finer = (2..=FINER).rev().step_by(2).find(|f| f * f * nodes <= MOST_NODES);
    let Some(finer) = finer else { return Vec::new() };
    let Some(reference) = initial_on_equal_cells(simulation, state, finer) else { return Vec::new() };
    let Some(coarser) = initial_on_equal_cells(simulation, state, finer / 2) else { return Vec::new() };
    let names = simulation.physics.unknowns();
    let missing = names.iter().enumerate().filter_map(|(c, name)| {
        let values: Vec<f64> = reference.1.component(c).collect();
        let size = values.iter().fold(0.0, |m, u| larger(m, *u)) * of_box(&state.mesh);
        let median = median(values);
        let content = |(mesh, u): (&Mesh<2>, &Field)| {
            let parts = node_areas(mesh).into_iter().zip(u.component(c)).map(|(area, u)| area * (u - median).abs());
            sum(parts)
        };
        let [there, twice, seen] =
            [(&reference.0, &reference.1), (&coarser.0, &coarser.1), (&state.mesh, &state.u)].map(content);
        let off = (there - seen).abs();
        (off > LOSS * there && there > ROUNDING * size && (there - twice).abs() < 0.5 * off).then(|| {
            format!(
                "`{name}`: the mesh at the start holds {} % of what its initial data hold (∫|{name} − m|, m its median): what \
                 lies between its nodes is {}; refine `grid.cells`, or let the mesh follow it by `monitor.of`",
                (1000.0 * seen / there).round() / 10.0,
                if seen < there { "missed" } else { "taken for more than it is" }
            )
        })
    });
    missing.collect()
}

fn initial_on_equal_cells(simulation: &Simulation, state: &State, finer: usize) -> Option<(Mesh<2>, Field)> {
    let of = &state.mesh;
    let lattice = Lattice::new(of.lattice().cells().map(|n| finer * n), of.lattice().periodic()).ok()?;
    let mesh = Mesh::uniform(lattice, of.lower(), of.upper()).ok()?;
    let u = simulation.physics.initial(state.t, &mesh);
    u.values().iter().all(|u| u.is_finite()).then_some((mesh, u))
}

fn of_box(mesh: &Mesh<2>) -> f64 {
    mesh.extent().iter().product()
}

fn median(mut values: Vec<f64>) -> f64 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}
