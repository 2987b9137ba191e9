//! What a start should make its user doubt.

use super::{Simulation, State};
use crate::density::{NOISE_WORTH_A_WARNING, noise};
use crate::geometry::{Field, Lattice, Mesh, node_areas};
use crate::numerics::{larger, sum};

/// Share of the content of an unknown whose loss is told.
const LOSS: f64 = 0.2;
/// Share of the range of an unknown by which its data go beyond the corners of a cell, which is told.
const HIDDEN: f64 = 0.25;
/// Content below this share of the largest value times the area of the box is of rounding.
const ROUNDING: f64 = 1e-9;
/// Cells of the reference for a cell of the mesh, along an axis, and the most of its nodes.
const FINER: usize = 8;
const MOST_NODES: usize = 1 << 20;

/// Warnings of a density that is noise at the cell scale, and of each unknown of which the mesh misses something at the
/// start.
pub(super) fn doubts(simulation: &Simulation, state: &State) -> Vec<String> {
    noisy(simulation, state).into_iter().chain(missed(simulation, state)).collect()
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

/// What the mesh misses of each unknown at the start: of its content, or of what is too small to matter for that.
fn missed(simulation: &Simulation, state: &State) -> Vec<String> {
    let nodes: usize = state.mesh.lattice().cells().iter().product();
    let Some(finer) = (2..=FINER).rev().step_by(2).find(|f| f * f * nodes <= MOST_NODES) else { return Vec::new() };
    let names = simulation.physics.unknowns();
    let lost = References::new(simulation, state, finer);
    let lost = names.iter().enumerate().map(|(c, name)| lost.as_ref()?.lost(state, c, name));
    let hidden = hidden(simulation, state, finer).into_iter().chain(std::iter::repeat(None));
    lost.zip(hidden).filter_map(|(lost, hidden)| lost.or(hidden)).collect()
}

/// The initial data on equal cells, a few times smaller than those of the mesh, and on cells twice as large.
struct References {
    finer: (Mesh<2>, Field),
    coarser: (Mesh<2>, Field),
}

impl References {
    fn new(simulation: &Simulation, state: &State, finer: usize) -> Option<Self> {
        let at = |finer| initial_on_equal_cells(simulation, state, finer);
        Some(Self { finer: at(finer)?, coarser: at(finer / 2)? })
    }

    /// The content of an unknown is ∫|u − m|, m its median over the domain. Where it on the finer cells and on the coarser
    /// ones differ as much as it and that of the mesh do, nothing is known.
    fn lost(&self, state: &State, c: usize, name: &str) -> Option<String> {
        let values: Vec<f64> = self.finer.1.component(c).collect();
        let size = values.iter().fold(0.0, |m, u| larger(m, *u)) * of_box(&state.mesh);
        let median = median(values);
        let content = |mesh: &Mesh<2>, u: &Field| {
            sum(node_areas(mesh).into_iter().zip(u.component(c)).map(|(area, u)| area * (u - median).abs()))
        };
        let [there, twice] = [&self.finer, &self.coarser].map(|(mesh, u)| content(mesh, u));
        let seen = content(&state.mesh, &state.u);
        let off = (there - seen).abs();
        (off > LOSS * there && there > ROUNDING * size && (there - twice).abs() < 0.5 * off).then(|| {
            format!(
                "`{name}`: the mesh at the start holds {} % of what its initial data hold (∫|{name} − m|, m its median): what \
                 lies between its nodes is {}; refine `grid.cells`, or let the mesh follow it by `monitor.of`",
                (1000.0 * seen / there).round() / 10.0,
                if seen < there { "missed" } else { "taken for more than it is" }
            )
        })
    }
}

/// What is small and lies between the nodes: a value within a cell that is far outside of those at its corners.
fn hidden(simulation: &Simulation, state: &State, finer: usize) -> Vec<Option<String>> {
    let mesh = &state.mesh;
    let cells = mesh.lattice().cells();
    let Ok(within) = mesh.resampled(cells.map(|n| finer * n)) else { return Vec::new() };
    let data = simulation.physics.initial(state.t, &within);
    let names = simulation.physics.unknowns();
    let told = names.iter().enumerate().map(|(c, name)| {
        let values: Vec<f64> = data.component(c).collect();
        let [low, high] = ends(values.iter().copied());
        let nodal: Vec<f64> = state.u.component(c).collect();
        let corners = mesh.lattice().closed(&nodal);
        let bounds = |k: usize| {
            let [i, j] = within.lattice().node(k).map(|i| i / finer);
            let [i, j] = [i.min(cells[0] - 1), j.min(cells[1] - 1)];
            let [lower, upper] = [i, i + 1].map(|i| i * (cells[1] + 1) + j);
            ends([lower, lower + 1, upper, upper + 1].map(|k| corners[k]).into_iter())
        };
        let beyond = |k: usize| {
            let [least, most] = bounds(k);
            (least - values[k]).max(values[k] - most)
        };
        let k = (0..values.len()).max_by(|a, b| beyond(*a).total_cmp(&beyond(*b)))?;
        (beyond(k) > HIDDEN * (high - low)).then(|| {
            let ([x, y], [least, most]) = (within.image(within.x()[k]), bounds(k));
            format!(
                "`{name}`: within a cell of the mesh at the start, at x = {x:.6}, y = {y:.6}, its initial data are {:.3e}, and \
                 {least:.3e} to {most:.3e} at its corners: too small for this mesh to see; refine `grid.cells`, or let the mesh \
                 follow it by `monitor.of`",
                values[k]
            )
        })
    });
    told.collect()
}

/// The least and the largest.
fn ends(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], u| [low.min(u), high.max(u)])
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
