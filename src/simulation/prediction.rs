use super::State;
use crate::error::Failure;
use crate::geometry::{Mesh, check_unfolded};

/// The mesh as it would go on by itself, from which the mesh equation then starts: see
/// [`Steps`](crate::meshing::Steps).
#[derive(Debug, Clone)]
pub(super) struct Predicted {
    pub mesh: Mesh<2>,
    velocity: Vec<[f64; 2]>,
}

/// Shares of the velocity that are tried: nodes that were made to run into each other stop.
const SHARES: [f64; 3] = [1.0, 0.5, 0.25];

impl Predicted {
    /// Where the mesh of a state is after `dt`; the same mesh where the gain is 0.
    pub fn after(state: &State, gain: f64, dt: f64) -> Result<Self, Failure> {
        for share in SHARES.into_iter().filter(|_| gain > 0.0) {
            let velocity: Vec<[f64; 2]> = state.velocity.iter().map(|v| v.map(|v| share * v)).collect();
            let moved = state.mesh.x().iter().zip(&velocity).map(|(x, v)| [0, 1].map(|d| x[d] + dt * v[d]));
            let mesh = state.mesh.moved(moved.collect())?;
            if check_unfolded(&mesh).is_ok() {
                return Ok(Self { mesh, velocity });
            }
        }
        Ok(Self { mesh: state.mesh.clone(), velocity: vec![[0.0; 2]; state.velocity.len()] })
    }

    /// The velocity that has learned from where the mesh went.
    pub fn corrected(self, mesh: &Mesh<2>, gain: f64, dt: f64) -> Vec<[f64; 2]> {
        let mut velocity = self.velocity;
        for (v, (x, predicted)) in velocity.iter_mut().zip(mesh.x().iter().zip(self.mesh.x())) {
            (0..2).for_each(|d| v[d] += gain * (x[d] - predicted[d]) / dt);
        }
        velocity
    }
}

/// Share of the newest density in the one that moves the mesh.
const NEWEST: f64 = 0.7;

/// Mixes the density that moved the mesh last into the newest: the mesh equation knows only the density before a step,
/// and on the flanks of thin layers mesh and density would otherwise take turns from step to step.
pub(super) fn blend(last: &[f64], newest: &mut [f64]) {
    for (newest, last) in newest.iter_mut().zip(last) {
        *newest = NEWEST * *newest + (1.0 - NEWEST) * last;
    }
}
