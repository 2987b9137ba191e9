use super::{Followed, Gait, Mover};
use crate::error::Result;
use crate::geometry::Mesh;
use crate::meshing::{Form, Mmpde, Relaxation, Whole};

/// A mesh that was adapted to a density at the start.
#[derive(Debug, Clone)]
pub struct Start {
    /// The mesh.
    pub mesh: Mesh<2>,
    /// Whether it stands still.
    pub at_rest: bool,
}

const MOST_STEPS: usize = 500;
/// Motion in one step, as a share of the shortest edge, below which a mesh stands still.
const AT_REST: f64 = 4e-3;

/// The mesh that rests on a density, from a given mesh
///
/// Steps of a [`Mover`], each with the density at the nodes that the last one led to, until no node moves by more than a
/// small share of the shortest edge.
///
/// # Errors
/// What `followed` returns, which gives u and the density of a mesh. 
pub fn adapted(
    mesh: Mesh<2>,
    form: Form,
    mut followed: impl FnMut(&Mesh<2>) -> Result<(Vec<f64>, Vec<f64>)>,
) -> Result<Start> {
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
        (mesh, gait) = (moved, step.gait);
        if at_rest {
            return Ok(Start { mesh, at_rest });
        }
    }
    Ok(Start { mesh, at_rest: false })
}
