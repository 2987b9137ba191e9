//! What a start should make its user doubt.

use super::{Simulation, State};
use crate::density::{NOISE_WORTH_A_WARNING, noise};
use crate::geometry::{Cells, Field, Lattice, Mesh, node_areas};
use crate::numerics::{ends, larger, sum};

/// Share of the content of the initial data of an unknown that the first mesh may miss without a warning.
const LOSS: f64 = 0.2;
/// Largest amount by which initial data within a cell may exceed those at the nodes around it without a warning, as a
/// share of the range of the unknown.
const HIDDEN: f64 = 0.25;
/// A content below this share of the largest value times the area of the box is made of rounding.
const ROUNDING: f64 = 1e-9;
/// Largest number of parts into which a cell is divided along each axis to see the initial data between the nodes.
const FINER: usize = 8;
/// Largest number of places at which the initial data are evaluated to see them between the nodes.
const MOST_NODES: usize = 1 << 20;

/// Warnings of a density that is noise at the cell scale, and of each unknown of which the mesh misses something at the
/// start.
pub(super) fn doubts<const D: usize>(simulation: &Simulation<D>, state: &State<D>) -> Vec<String>
where
    Mesh<D>: Cells<D>,
{
    noisy(simulation, state).into_iter().chain(missed(simulation, state)).collect()
}

fn noisy<const D: usize>(simulation: &Simulation<D>, state: &State<D>) -> Option<String> {
    if !simulation.mover.generator.moves() {
        return None;
    }
    let followed = simulation.monitor.followed(state.t, &state.mesh, &state.u).ok()?;
    let share = noise(state.mesh.lattice(), &followed);
    (share > NOISE_WORTH_A_WARNING).then(|| {
        format!(
            "noisy-density: {:.0} % of what the mesh follows goes up and down from node to node, so that it follows \
             noise of the size of its cells; smooth it, name something smoother in `monitor.of`, or refine \
             `grid.cells`",
            100.0 * share
        )
    })
}

/// What the mesh misses of each unknown at the start: a share of its content, or, where that is seen, something too
/// small to matter for it.
fn missed<const D: usize>(simulation: &Simulation<D>, state: &State<D>) -> Vec<String>
where
    Mesh<D>: Cells<D>,
{
    let nodes: usize = state.mesh.lattice().cells().iter().product();
    let Some(finer) = (2..=FINER).rev().step_by(2).find(|f: &usize| f.pow(D as u32) * nodes <= MOST_NODES) else {
        return Vec::new();
    };
    let names = simulation.physics.unknowns();
    let [equal, coarser] = [finer, finer / 2].map(|finer| initial_on_equal_cells(simulation, state, finer));
    let references = equal.as_ref().zip(coarser.as_ref()).map(|(finer, coarser)| References { finer, coarser });
    let lost = names.iter().enumerate().map(|(c, name)| references.as_ref()?.lost(simulation, state, c, name));
    let hidden = hidden(simulation, state, finer, equal.as_ref()).into_iter().chain(std::iter::repeat(None));
    lost.zip(hidden).filter_map(|(lost, hidden)| lost.or(hidden)).collect()
}

/// The initial data on equal cells, a few times smaller than those of the mesh, and on cells twice as large.
struct References<'a, const D: usize> {
    finer: &'a (Mesh<D>, Field),
    coarser: &'a (Mesh<D>, Field),
}

impl<const D: usize> References<'_, D>
where
    Mesh<D>: Cells<D>,
{
    /// Says that the mesh misses a share of an unknown's content ∫|u − m|, with m the median of u over the domain.
    /// Nothing is said where the content on the coarser cells differs from that on the finer ones by half as much as
    /// that on the mesh does, or more: no reference is known then.
    fn lost(&self, simulation: &Simulation<D>, state: &State<D>, c: usize, name: &str) -> Option<String> {
        let nodal: Vec<f64> = state.u.component(c).collect();
        let values: Vec<f64> = self.finer.1.component(c).collect();
        let size = values.iter().fold(0.0, |m, u| larger(m, *u)) * state.mesh.volume();
        let median = median(values);
        let content = |mesh: &Mesh<D>, u: &Field| {
            sum(node_areas(mesh).into_iter().zip(u.component(c)).map(|(area, u)| area * (u - median).abs()))
        };
        let [there, twice] = [self.finer, self.coarser].map(|(mesh, u)| content(mesh, u));
        let seen = content(&state.mesh, &state.u);
        let off = (there - seen).abs();
        (off > LOSS * there && there > ROUNDING * size && (there - twice).abs() < 0.5 * off).then(|| {
            format!(
                "`{name}`: the mesh at the start holds {} % of what its initial data hold (∫|{name} − m|, m its \
                 median): what lies between its nodes is {}; {}",
                (1000.0 * seen / there).round() / 10.0,
                if seen < there { "missed" } else { "taken for more than it is" },
                remedy(simulation, state, &nodal)
            )
        })
    }
}

/// Something small between the nodes: a value within a cell that is far outside of those at the nodes around it. It is
/// looked for within every cell, and on equal cells, since a blob may be smaller than what divides a wide cell.
fn hidden<const D: usize>(
    simulation: &Simulation<D>,
    state: &State<D>,
    finer: usize,
    equal: Option<&(Mesh<D>, Field)>,
) -> Vec<Option<String>>
where
    Mesh<D>: Cells<D>,
{
    let (mesh, lattice) = (&state.mesh, state.mesh.lattice());
    let cells = lattice.cells();
    let Ok(within) = mesh.resampled(cells.map(|n| finer * n)) else { return Vec::new() };
    let own = |k: usize| {
        let node = within.lattice().node(k);
        std::array::from_fn(|d| (node[d] / finer).min(cells[d] - 1))
    };
    let data = simulation.physics.initial(state.t, &within);
    let mut looked = vec![(&data, &within, (0..within.x().len()).map(own).collect())];
    if let Some((equal, data)) = equal {
        looked.push((data, equal, mesh.parameters().holding(equal.parameters().x().iter().copied())));
    }
    let names = simulation.physics.unknowns();
    let told = names.iter().enumerate().map(|(c, name)| {
        let nodal: Vec<f64> = state.u.component(c).collect();
        let [low, high] = ends(looked[0].0.component(c).chain(nodal.iter().copied()));
        let all = looked.iter().map(|(data, places, cells)| worst(lattice, &nodal, data, c, cells, places));
        let (off, x, value, [least, most]) = all.max_by(|a, b| a.0.total_cmp(&b.0))?;
        (off > HIDDEN * (high - low)).then(|| {
            format!(
                "`{name}`: between the nodes of the mesh at the start, at {}, its initial data are {value:.3e}, and \
                 {least:.3e} to {most:.3e} at the nodes around: the mesh does not see that; {}",
                named(mesh.image(x)),
                remedy(simulation, state, &nodal)
            )
        })
    });
    told.collect()
}

/// The value of some data that is farthest beyond those at the nodes around its cell: by how much, where, and what both
/// are.
fn worst<const D: usize>(
    lattice: &Lattice<D>,
    nodal: &[f64],
    data: &Field,
    c: usize,
    cells: &[[usize; D]],
    places: &Mesh<D>,
) -> (f64, [f64; D], f64, [f64; 2]) {
    let mut worst = (f64::NEG_INFINITY, [0.0; D], 0.0, [0.0; 2]);
    // places of one cell follow each other
    let mut last = None;
    for ((value, &cell), &x) in data.component(c).zip(cells).zip(places.x()) {
        let around @ [least, most] = match last {
            Some((same, around)) if same == cell => around,
            _ => around(lattice, nodal, cell),
        };
        last = Some((cell, around));
        let off = (least - value).max(value - most);
        if off > worst.0 {
            worst = (off, x, value, around);
        }
    }
    worst
}

/// The least and the largest value at the corners of a cell and the nodes next to them.
fn around<const D: usize>(lattice: &Lattice<D>, nodal: &[f64], cell: [usize; D]) -> [f64; 2] {
    let (nodes, periodic) = (lattice.nodes(), lattice.periodic());
    let place = |d: usize, step: usize| match periodic[d] {
        true => (cell[d] + nodes[d] + step - 1) % nodes[d],
        false => (cell[d] + step).saturating_sub(1).min(nodes[d] - 1),
    };
    let all = (0..4_usize.pow(D as u32)).map(|k| std::array::from_fn(|d| place(d, k >> (2 * (D - 1 - d)) & 3)));
    ends(all.map(|node| nodal[lattice.index(node)]))
}

/// A place in words: "x = 1.000000, y = 2.000000".
pub(super) fn named<const D: usize>(x: [f64; D]) -> String {
    let words = ["x", "y", "z"].iter().zip(x).map(|(axis, x)| format!("{axis} = {x:.6}"));
    words.collect::<Vec<_>>().join(", ")
}

/// What makes a mesh see an unknown at the start.
fn remedy<const D: usize>(simulation: &Simulation<D>, state: &State<D>, nodal: &[f64]) -> &'static str {
    let followed = simulation.monitor.followed(state.t, &state.mesh, &state.u);
    match followed.is_ok_and(|followed| followed == nodal) {
        true => "refine `grid.cells`, or make it wider",
        false => "refine `grid.cells`, or let the mesh follow it by `monitor.of`",
    }
}

fn initial_on_equal_cells<const D: usize>(
    simulation: &Simulation<D>,
    state: &State<D>,
    finer: usize,
) -> Option<(Mesh<D>, Field)> {
    let of = &state.mesh;
    let lattice = Lattice::new(of.lattice().cells().map(|n| finer * n), of.lattice().periodic()).ok()?;
    let mesh = of.even(lattice).ok()?;
    let u = simulation.physics.initial(state.t, &mesh);
    u.values().iter().all(|u| u.is_finite()).then_some((mesh, u))
}

fn median(mut values: Vec<f64>) -> f64 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}
