use super::{Followed, Gait, Mover};
use crate::density::{Monitor, edges};
use crate::error::Result;
use crate::geometry::{Density, Mesh, check_unfolded};
use crate::meshing::{Form, Mmpde, Movable, Relaxation, Steps};
use crate::numerics::ends;
use std::iter::successors;

/// A mesh that was adapted to a density at the start.
#[derive(Debug, Clone)]
pub struct Start<const D: usize = 2> {
    /// The mesh.
    pub mesh: Mesh<D>,
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
    /// The mesh is as fine as it gets around a jump, which no mesh resolves.
    Jump,
    /// The mesh went on moving.
    Restless,
}

/// Largest number of mesh steps of an adapted start.
const MOST_STEPS: usize = 500;
/// A mesh with more cells than this along an axis starts from one with half as many.
const COARSE: usize = 100;
/// u jumps over an edge shorter than [`THIN`] if it changes there by more than this share of its range: a layer that
/// the mesh resolves changes by less over each of its edges, however thin it is.
const JUMP: f64 = 0.2;
/// Length of an edge, in equal cells, below which a large change of u over it is a jump.
const THIN: f64 = 1e-3;
/// At the end of all steps, u jumps over an edge shorter than [`THIN_AT_THE_END`] if it changes there by more than this
/// share of its range: the density does not draw ever more cells into a jump.
const JUMP_AT_THE_END: f64 = 0.4;
/// Length of an edge, in equal cells, below which a large change of u over it is a jump at the end of all steps.
const THIN_AT_THE_END: f64 = 0.1;
/// A mesh stands still where no node moves by more than this share of the shortest edge in a step.
const AT_REST: f64 = 4e-3;
/// Factor between one τ and the next, longer one that is tried until a mesh rests with it.
const LONGER: f64 = 1.25;
/// τ in time steps from which on the search for a τ with which the mesh rests is given up.
const LONGEST: f64 = 1e3;
/// Factor of the shortest τ with which the mesh rests in [`WATCHED`] steps, for the τ that a message recommends: with a
/// τ close to the limit it may turn back later.
const SURE: f64 = 1.5;
/// Number of steps in which a mesh that is moved with a τ is watched.
const WATCHED: usize = 200;

/// The mesh that rests on a density, from a given mesh
///
/// Steps of a [`Mover`], each with the density at the nodes that the last one led to, until no node moves by more than
/// a small share of the shortest edge, or until one edge, a thousandth of a uniform cell, still holds a fifth of all
/// that u changes: data that jump would draw all nodes together without end. A mesh that at the end of all steps has an
/// edge, a tenth of a uniform cell, that holds two fifths has found a jump, too.
///
/// # Errors
/// What `followed` returns, which gives u and the density of a mesh.
pub fn adapted<const D: usize>(
    mesh: Mesh<D>,
    form: Form,
    mut followed: impl FnMut(&Mesh<D>) -> Result<(Vec<f64>, Density)>,
) -> Result<Start<D>>
where
    Mesh<D>: Movable<D>,
{
    from_coarser(mesh, form, &mut |mesh| followed(mesh).map(|(u, rho)| (vec![u], rho)))
}

/// The mesh that rests on a density that is made of several u, of which the mesh follows the first; see [`adapted`].
pub(crate) fn adapted_to_all<const D: usize>(mesh: Mesh<D>, form: Form, followed: FollowedOn<'_, D>) -> Result<Start<D>>
where
    Mesh<D>: Movable<D>,
{
    from_coarser(mesh, form, followed)
}

/// Some u and ρ on a mesh.
pub(crate) type FollowedOn<'a, const D: usize> = &'a mut dyn FnMut(&Mesh<D>) -> Result<(Vec<Vec<f64>>, Density)>;

fn from_coarser<const D: usize>(mesh: Mesh<D>, form: Form, followed: FollowedOn<'_, D>) -> Result<Start<D>>
where
    Mesh<D>: Movable<D>,
{
    let cells = mesh.lattice().cells();
    let coarse = cells.map(|n| if n > COARSE { n.div_ceil(2) } else { n });
    if coarse == cells {
        return to_rest(mesh, form, followed);
    }
    let start = from_coarser(mesh.resampled(coarse)?, form, followed)?.mesh.resampled(cells)?;
    to_rest(if check_unfolded(&start).is_ok() { start } else { mesh }, form, followed)
}

/// Time steps in τ with which a mesh does not turn back from step to step on what `values` are on a mesh: the given τ
/// is made longer until it does not, and then half as long again. Nothing where no τ of less than 1000 steps will do.
///
/// The equation has the given τ, in time steps of length `dt`.
pub fn steps_to_rest<const D: usize>(
    mesh: &Mesh<D>,
    equation: Mmpde,
    dt: f64,
    monitor: &dyn Monitor<D>,
    values: impl Fn(&Mesh<D>) -> Vec<f64>,
) -> Option<f64>
where
    Mesh<D>: Movable<D>,
{
    let Mmpde { relaxation, form } = equation;
    let prediction = relaxation.prediction();
    let longer = successors(Some(relaxation.over(dt) / dt), |steps| Some(LONGER * steps));
    let rests = |&steps: &f64| {
        let equation = Mmpde { relaxation: Relaxation::Steps(Steps { steps, prediction }), form };
        let mut mover = Mover::by(Mesh::whole(0.1 * AT_REST), equation);
        let (mut on, mut gait) = (mesh.clone(), Gait::at_rest(mesh));
        (0..WATCHED).all(|_| {
            let u = values(&on);
            let step = monitor
                .density(&on, &u, None)
                .ok()
                .and_then(|rho| mover.step(&on, &gait, Followed { u: &u, rho: &rho }, 1.0).ok());
            step.is_some_and(|step| {
                (on, gait) = (step.moved.mesh, step.gait);
                !gait.is_restless()
            })
        })
    };
    longer.skip(1).take_while(|steps| *steps < LONGEST).find(rests).map(|steps| SURE * steps)
}

/// The mesh that rests on a density, from the given mesh alone; see [`adapted`].
fn to_rest<const D: usize>(mesh: Mesh<D>, form: Form, followed: FollowedOn<'_, D>) -> Result<Start<D>>
where
    Mesh<D>: Movable<D>,
{
    let equation = Mmpde { relaxation: Relaxation::Auto, form };
    let mut mover = Mover::by(Mesh::whole(0.1 * AT_REST), equation);
    let mut gait = Gait::at_rest(&mesh);
    let (mut mesh, mut holds_a_jump) = (mesh, false);
    for _ in 0..MOST_STEPS {
        let (u, rho) = followed(&mesh)?;
        let Ok(step) = mover.step(&mesh, &gait, Followed { u: &u[0], rho: &rho }, 1.0) else { break };
        let moved = step.moved.mesh;
        let farthest = moved.parameters().farthest(mesh.parameters());
        let at_rest = farthest <= AT_REST * moved.parameters().shortest_edge();
        let holds = |most: f64, thin: f64| u.iter().any(|u| holds(&mesh, u, most, thin));
        if holds(JUMP, THIN) {
            return Ok(Start { mesh, end: Ending::Jump, steps: gait.steps() });
        }
        holds_a_jump = holds(JUMP_AT_THE_END, THIN_AT_THE_END);
        (mesh, gait) = (moved, step.gait);
        if at_rest {
            let end = if holds_a_jump { Ending::Jump } else { Ending::AtRest };
            return Ok(Start { mesh, end, steps: gait.steps() });
        }
    }
    let end = if holds_a_jump { Ending::Jump } else { Ending::Restless };
    Ok(Start { mesh, end, steps: gait.steps() })
}

/// True where an edge shorter than `thin` uniform cells holds more than the share `most` of the range of u.
fn holds<const D: usize>(mesh: &Mesh<D>, u: &[f64], most: f64, thin: f64) -> bool {
    let [low, high] = ends(u.iter().copied());
    edges(mesh, u).any(|(length, change)| change > most * (high - low) && length < thin)
}
