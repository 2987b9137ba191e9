//! What a run says once while it goes on: meshes that cannot rest, interface values that are noisy.

use super::doubts::named;
use super::forced::Hidden;
use super::{INTERFACE_NOISE_WORTH_A_WARNING, Record, Simulation, State};
use crate::geometry::Mesh;
use crate::meshing::{Movable, Relaxation};
use crate::mover;
use crate::numerics::ends;

/// τ above this many time steps is warned of: the mesh then hardly moves.
const HARDLY_FOLLOWS: f64 = 2e3;
const HASTY: &str = "`mesh.relaxation` is short";
const RESTLESS: &str = "the mesh hardly follows its density any more";
const NOISY: &str = "interface values are noisy";
/// How far an unknown may leave the range of its data, as a share of that range, before a run warns of it.
const BEYOND: f64 = 0.05;
/// Excesses below this share of the size of an unknown are left by rounding and by Newton's method.
const OF_ROUNDING: f64 = 1e-7;
const LEAVES: &str = "leaves the range of its data";
const WIDE: &str = "changes within cells that are too wide for central fluxes";
const PASSED: &str = "changes within a step";
const UNKNOWN: &str = "the standard error of interface values is not known";

impl<const D: usize> Simulation<D>
where
    Mesh<D>: Movable<D>,
{
    /// Says once what a step of length `dt` that led to a state gives reason to.
    pub(super) fn warn(&self, state: &State<D>, dt: f64, record: &mut Record) {
        self.warn_of_noise(state, record);
        self.warn_of_unrest(state, dt, record);
        self.warn_of_range(state, record);
        self.warn_of_growth(state, record);
        if self.schedule.reports_at(state.t) {
            self.warn_of_wide_cells(state, record);
        }
    }

    /// Says once in a run that the mesh turns back from step to step, and with which τ it would rest on this solution.
    fn warn_of_unrest(&self, state: &State<D>, dt: f64, record: &mut Record) {
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

    /// Says once of each unknown that it leaves the range of its data where the equation keeps it: where cells are too
    /// wide for central fluxes.
    fn warn_of_range(&self, state: &State<D>, record: &mut Record) {
        let keeps = self.physics.keeps_range();
        if !keeps.contains(&true) {
            return;
        }
        let (mesh, lattice) = (&state.mesh, state.mesh.lattice());
        for k in lattice.sides() {
            let values = self.physics.side_values(state.t, mesh.image(mesh.x()[k]), lattice.beyond(k));
            for (data, value) in record.data.iter_mut().zip(values) {
                *data = ends(data.iter().copied().chain(value));
            }
        }
        for (c, name) in self.physics.unknowns().iter().enumerate().filter(|(c, _)| keeps[*c]) {
            let [low, high] = record.data[c];
            let off = |u: f64| (low - u).max(u - high);
            let worst = state.u.component(c).enumerate().max_by(|a, b| off(a.1).total_cmp(&off(b.1)));
            let rounding = OF_ROUNDING * f64::max(low.abs(), high.abs());
            let Some((k, u)) = worst.filter(|(_, u)| off(*u) > rounding + BEYOND * (high - low)) else { continue };
            let said = format!("`{name}` {LEAVES}");
            if !record.warnings.iter().any(|warning| warning.starts_with(&said)) {
                record.warnings.push(format!(
                    "{said}, {low:.4} to {high:.4}, which the equation keeps: it is {u:.4} at t = {}, {}; a layer \
                     there is thinner than the cells; refine `grid.cells`, raise `pde.diffusivity`, or give an \
                     equation by formulas `pde.scheme` = \"limited\"",
                    state.t,
                    named(mesh.image(mesh.x()[k]))
                ));
            }
        }
    }

    /// Says once in a run that a front is thinner than cells that are too wide for its flux.
    fn warn_of_wide_cells(&self, state: &State<D>, record: &mut Record) {
        if record.warnings.iter().any(|said| said.contains(WIDE)) {
            return;
        }
        let State { t, mesh, u, .. } = state;
        let Some((c, k, peclet)) = self.physics.unresolved_flux(*t, mesh, u) else { return };
        let name = &self.physics.unknowns()[c];
        record.warnings.push(format!(
            "`{name}` {WIDE}: at t = {t}, {}, the flux outweighs diffusion {peclet:.0} times over a cell, and a front \
             there may be at the wrong place; set `pde.scheme` = \"limited\", refine `grid.cells`, or raise \
             `pde.diffusivity`",
            named(mesh.image(mesh.x()[k]))
        ));
    }

    /// Says once in a run that steps of given length pass over something that is prescribed in time.
    pub(super) fn warn_of_hidden(&self, hidden: Hidden, t: f64, dt: f64, record: &mut Record) {
        if record.warnings.iter().any(|said| said.contains(PASSED)) {
            return;
        }
        let name = &self.physics.unknowns()[hidden.unknown];
        let what = hidden.what;
        record.warnings.push(format!(
            "{what} of `{name}` {PASSED}: between t = {t} and {} it comes and goes, or jumps, at times that no stage \
             of the step sees; lower `time.step`, or leave it out so that steps follow it",
            t + dt
        ));
    }

    /// Says once in a run that interface values are noisy, or that nobody knows.
    fn warn_of_noise(&self, state: &State<D>, record: &mut Record) {
        let Some(interface) = record.interface.filter(|i| i.walks > 0) else { return };
        let (percent, limit) = (interface.noise.map(|noise| 100.0 * noise), 100.0 * INTERFACE_NOISE_WORTH_A_WARNING);
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
