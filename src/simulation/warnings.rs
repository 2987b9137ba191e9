//! What a run says once while it goes on: meshes that cannot rest, interface values that are noisy.

use super::{NOISE_WORTH_A_WARNING, Record, Simulation, State};
use crate::geometry::Mesh;
use crate::meshing::{Movable, Relaxation};
use crate::mover;

/// More time steps in τ than any layer needs: what a mesh moves by then is little more than noise.
const HARDLY_FOLLOWS: f64 = 2e3;
const HASTY: &str = "`mesh.relaxation` is short";
const RESTLESS: &str = "the mesh hardly follows its density any more";
const NOISY: &str = "interface values are noisy";
const UNKNOWN: &str = "the standard error of interface values is not known";

impl<const D: usize> Simulation<D>
where
    Mesh<D>: Movable<D>,
{
    /// Says once in a run that the mesh turns back from step to step, and with which τ it would rest on this solution.
    pub(super) fn warn_of_unrest(&self, state: &State<D>, dt: f64, record: &mut Record) {
        let relaxation = self.mover.equation.relaxation;
        let hardly_follows = relaxation == Relaxation::Auto && state.gait.steps() > HARDLY_FOLLOWS;
        if !(hardly_follows || relaxation != Relaxation::Auto && state.gait.is_restless())
            || record.warnings.iter().any(|said| said.starts_with(RESTLESS) || said.starts_with(HASTY))
        {
            return;
        }
        let t = state.t;
        if hardly_follows {
            record.warnings.push(format!(
                "{RESTLESS}: at t = {t} τ is {:.0} time steps, since the density turns about from step to step; smooth \
                 it, or follow something that varies less, by monitor.of",
                state.gait.steps()
            ));
            return;
        }
        let steps = relaxation.over(dt) / dt;
        let found =
            self.monitor.followed(t, &state.mesh, &state.u).ok().and_then(|values| {
                mover::steps_to_rest(&state.mesh, self.mover.equation.form, &*self.monitor, &values)
            });
        let limit = match found {
            Some(limit) if limit > steps => {
                format!("on this solution it comes to rest with {limit:.0}, which \"auto\" finds by itself")
            }
            _ => "\"auto\" finds how many it takes".into(),
        };
        record.warnings.push(format!(
            "{HASTY}: at t = {t} it is {steps:.1} time steps, and the mesh turns back from step to step; {limit}"
        ));
    }

    /// Says once in a run that interface values are noisy, or that nobody knows.
    pub(super) fn warn_of_noise(&self, state: &State<D>, record: &mut Record) {
        let Some(interface) = record.interface.filter(|i| i.walks > 0) else { return };
        let (percent, limit) = (interface.noise.map(|noise| 100.0 * noise), 100.0 * NOISE_WORTH_A_WARNING);
        let warning = match percent {
            None => format!(
                "{UNKNOWN}: at t = {} it cannot be told from these samples; it takes two or more a point",
                state.t
            ),
            Some(percent) if percent > limit => format!(
                "{NOISY}: from t = {} on their standard error is {percent:.1} % of the shortest edge of the mesh or \
                 more (said above {limit} %); more walks or paths, or more sweeps, lower it",
                state.t
            ),
            Some(_) => return,
        };
        if !record.warnings.iter().any(|said| said.split(':').next() == warning.split(':').next()) {
            record.warnings.push(warning);
        }
    }
}
