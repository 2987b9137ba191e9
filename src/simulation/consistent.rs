//! Unknowns without a time derivative at the start.

use super::{Simulation, State, coupling};
use crate::geometry::Mesh;
use crate::meshing::Movable;
use crate::physics::Motion;

/// Length of the steps that solve for initial values of unknowns without a time derivative, as a share of the run: in
/// so short a time the other unknowns change by less than the error of a run.
const MOMENT: f64 = 1e-6;
/// Number of these steps: Newton's method may end in each of them with a thousandth of the residual at its start.
const ROUNDS: usize = 3;

impl<const D: usize> Simulation<D>
where
    Mesh<D>: Movable<D>,
{
    /// Replaces the initial values of unknowns without a time derivative by those that the others make of them
    ///
    /// Such values are a guess that a user has to give. A first step that begins with what the guess makes of the other
    /// unknowns would carry its error on. Where the equations cannot be solved the guess stays.
    pub(super) fn make_consistent(&mut self, state: &mut State<D>) {
        let instantaneous = self.physics.instantaneous();
        if !instantaneous.contains(&true) {
            return;
        }
        let (count, dt) = (state.u.components(), MOMENT * self.schedule.span());
        let mut u = state.u.clone();
        for _ in 0..ROUNDS {
            let motion = Motion { t: state.t, dt, old: &state.mesh, new: &state.mesh };
            let Ok((found, _)) = self.physics.step(motion, &u) else { return };
            for (k, (value, found)) in u.values_mut().iter_mut().zip(found.values()).enumerate() {
                if instantaneous[k % count] {
                    *value = *found;
                }
            }
        }
        if let Ok(rho) = coupling::density(self.physics.as_ref(), self.monitor.as_ref(), state.t, &state.mesh, &u) {
            (state.u, state.rho) = (u, rho);
        }
    }
}
