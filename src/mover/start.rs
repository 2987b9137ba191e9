use super::{Followed, Gait, Mover};
use crate::density::Monitor;
use crate::error::Result;
use crate::geometry::{Mesh, check_unfolded, interpolate};
use crate::meshing::{Form, Mmpde, Relaxation, Whole};

/// A mesh that was adapted to a density at the start.
#[derive(Debug, Clone)]
pub struct Start {
    /// The mesh.
    pub mesh: Mesh<2>,
    /// Whether it stands still.
    pub end: Ending,
    /// τ over the time step in the end: with fewer it would not have come to rest, or would have taken longer.
    pub steps: f64,
}

/// How an adapted start ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ending {
    /// The mesh stands still.
    AtRest,
    /// It is as fine as it gets around a jump, which no mesh resolves.
    Jump,
    /// It went on moving.
    Restless,
}

const MOST_STEPS: usize = 500;
/// A mesh with more cells along an axis starts from one with half as many.
const COARSE: usize = 100;
/// What changes by more than this share of its range over an edge shorter than this many uniform cells jumps there: a
/// layer that the mesh resolves changes by less over each of its edges, however thin it is.
const JUMP: f64 = 0.2;
const THIN: f64 = 1e-3;
/// Motion in one step, as a share of the shortest edge, below which a mesh stands still.
const AT_REST: f64 = 4e-3;

/// The mesh that rests on a density, from a given mesh
///
/// Steps of a [`Mover`], each with the density at the nodes that the last one led to, until no node moves by more than
/// a small share of the shortest edge, or until one edge, a thousandth of a uniform cell, still holds a fifth of all
/// that u changes: data that jump would draw all nodes together without end.
///
/// # Errors
/// What `followed` returns, which gives u and the density of a mesh.
pub fn adapted(
    mesh: Mesh<2>,
    form: Form,
    mut followed: impl FnMut(&Mesh<2>) -> Result<(Vec<f64>, Vec<f64>)>,
) -> Result<Start> {
    from_coarser(mesh, form, &mut followed)
}

/// u and ρ on a mesh.
pub(crate) type FollowedOn<'a> = &'a mut dyn FnMut(&Mesh<2>) -> Result<(Vec<f64>, Vec<f64>)>;

fn from_coarser(mesh: Mesh<2>, form: Form, followed: FollowedOn<'_>) -> Result<Start> {
    let cells = mesh.lattice().cells();
    let coarse = cells.map(|n| if n > COARSE { n.div_ceil(2) } else { n });
    if coarse == cells {
        return to_rest(mesh, form, followed);
    }
    let start = from_coarser(mesh.resampled(coarse)?, form, followed)?.mesh.resampled(cells)?;
    to_rest(if check_unfolded(&start).is_ok() { start } else { mesh }, form, followed)
}

/// The fewest time steps in τ with which a mesh rests on `values`, given at the nodes of `mesh` and carried by
/// interpolation, as far as [`adapted`] can tell from equal cells; nothing where it does not come to rest.
pub fn steps_to_rest(mesh: &Mesh<2>, form: Form, monitor: &dyn Monitor, values: &[f64]) -> Option<f64> {
    let uniform = Mesh::uniform(*mesh.lattice(), mesh.lower(), mesh.upper()).ok()?;
    let start = to_rest(uniform, form, &mut |on| {
        let u = interpolate(mesh, values, on);
        let rho = monitor.density(on, &u, None)?;
        Ok((u, rho))
    });
    start.ok().filter(|start| start.end == Ending::AtRest).map(|start| start.steps)
}

/// The same, on this mesh alone.
fn to_rest(mesh: Mesh<2>, form: Form, followed: FollowedOn<'_>) -> Result<Start> {
    let equation = Mmpde { relaxation: Relaxation::Auto, form };
    let mut mover = Mover::by(Box::new(Whole::to(0.1 * AT_REST)), equation);
    let mut gait = Gait::at_rest(&mesh);
    let mut mesh = mesh;
    for _ in 0..MOST_STEPS {
        let (u, rho) = followed(&mesh)?;
        let Ok(step) = mover.step(&mesh, &gait, Followed { u: &u, rho: &rho }, 1.0) else { break };
        let moved = step.moved.mesh;
        let farthest = moved.farthest(&mesh);
        let at_rest = farthest <= AT_REST * moved.shortest_edge();
        let jumps = jumps(&mesh, &u);
        if jumps {
            return Ok(Start { mesh, end: Ending::Jump, steps: gait.steps() });
        }
        (mesh, gait) = (moved, step.gait);
        if at_rest {
            return Ok(Start { mesh, end: Ending::AtRest, steps: gait.steps() });
        }
    }
    Ok(Start { mesh, end: Ending::Restless, steps: gait.steps() })
}

/// True where an edge that is much shorter than a uniform cell holds a fifth of the range of u.
fn jumps(mesh: &Mesh<2>, u: &[f64]) -> bool {
    let lattice = mesh.lattice();
    let (x, u, cells) = (mesh.closed(), lattice.closed(u), lattice.cells());
    let size = mesh.extent().iter().zip(cells).map(|(extent, n)| extent / n as f64).collect::<Vec<_>>();
    let [low, high] = u.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], u| [l.min(*u), h.max(*u)]);
    let strides = [cells[1] + 1, 1];
    (0..2).any(|d| {
        let rows = (0..x.len()).filter(|k| if d == 0 { k / strides[0] < cells[0] } else { k % strides[0] < cells[1] });
        rows.map(|k| (k, k + strides[d])).any(|(a, b)| {
            let way = (0..2).map(|c| ((x[b][c] - x[a][c]) / size[c]).powi(2)).sum::<f64>().sqrt();
            (u[b] - u[a]).abs() > JUMP * (high - low) && way < THIN
        })
    })
}
