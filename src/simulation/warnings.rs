//! What a run says once while it goes on: meshes that cannot rest, interface values that are noisy.

use super::doubts::named;
use super::forced::Hidden;
use super::{INTERFACE_NOISE_WORTH_A_WARNING, Record, Simulation, State};
use crate::error::{Cause, Error, Failure};
use crate::geometry::{Mesh, interpolate};
use crate::meshing::{Movable, Relaxation};
use crate::mover;
use crate::numerics::ends;

/// τ in time steps above which a run warns that the mesh hardly moves any more.
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
/// An unknown of a run whose steps became too short blows up if it has grown to more than this multiple of its largest
/// value in all data.
const GROWN: f64 = 2.0;
const MISSED: &str = "the mesh has not come to a layer of it";
/// Share of the range of an unknown within one cell, and length of that cell over the shortest, from which on the mesh
/// misses a layer: around a jump, which no mesh resolves, it has its shortest cells.
const MOST_IN_A_CELL: f64 = 0.4;
const ELSEWHERE: f64 = 3.0;
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
            self.warn_of_missed_layers(state, record);
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
        // what is given is known on any mesh; what was computed is carried there
        let given = self.physics.is_given();
        let on_state = self.monitor.followed(t, &state.mesh, &state.u);
        let found = on_state.ok().and_then(|on_state| {
            let carried = |on: &Mesh<D>| interpolate(&state.mesh, &on_state, on);
            let known = |on: &Mesh<D>| self.monitor.followed(t, on, &self.physics.initial(t, on)).ok();
            let values = |on: &Mesh<D>| known(on).filter(|_| given).unwrap_or_else(|| carried(on));
            mover::steps_to_rest(&state.mesh, self.mover.equation, dt, &*self.monitor, values)
        });
        let limit = match found {
            Some(limit) => {
                format!(
                    "with the solution of that time the mesh rests at {limit:.0} steps; \"auto\" finds it by itself"
                )
            }
            None => "\"auto\" finds how many the mesh takes to rest".into(),
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

    /// Says once of each unknown on a line that the moving mesh has its thinnest cells elsewhere than where most of it
    /// changes.
    fn warn_of_missed_layers(&self, state: &State<D>, record: &mut Record) {
        if D != 1 || !self.mover.generator.moves() {
            return;
        }
        let State { t, mesh, u, .. } = state;
        let lengths: Vec<f64> = mesh.x().windows(2).map(|x| x[1][0] - x[0][0]).collect();
        let shortest = lengths.iter().copied().fold(f64::INFINITY, f64::min);
        for (c, name) in self.physics.unknowns().iter().enumerate() {
            let values: Vec<f64> = u.component(c).collect();
            let [low, high] = ends(values.iter().copied());
            let step = |k: usize| (values[k + 1] - values[k]).abs() / (high - low);
            let Some(k) = (0..lengths.len()).max_by(|a, b| step(*a).total_cmp(&step(*b))) else { continue };
            let said = format!("`{name}`: {MISSED}");
            if !(step(k) > MOST_IN_A_CELL && lengths[k] > ELSEWHERE * shortest)
                || high - low <= OF_ROUNDING * high.abs().max(low.abs())
                || record.warnings.iter().any(|warning| warning.starts_with(&said))
            {
                continue;
            }
            record.warnings.push(format!(
                "{said}: at t = {t}, {}, {:.0} % of its range lie within one cell, {:.1} times as wide as the thinnest \
                 of the mesh; refine `grid.cells`, or let the mesh follow it by `monitor.of`",
                named(mesh.image(mesh.x()[k])),
                100.0 * step(k),
                lengths[k] / shortest,
            ));
        }
    }

    /// Says that an unknown grows beyond all bounds, of a run that ended because no step could follow.
    pub(super) fn warn_of_blow_up(&self, error: &Error, state: &State<D>, record: &mut Record) {
        let Error::Failed { failure: Failure::VanishingStep { dt, cause: Cause::BlowUp }, .. } = error else { return };
        let keeps = self.physics.keeps_range();
        let names = self.physics.unknowns();
        let grown = |c: usize| {
            let (k, size) = state.u.component(c).map(f64::abs).enumerate().max_by(|a, b| a.1.total_cmp(&b.1))?;
            let before = record.data[c].iter().fold(0.0, |most: f64, data| most.max(data.abs()));
            Some((c, k, size, before)).filter(|_| size > GROWN * before)
        };
        let all = (0..names.len()).filter(|c| !keeps.get(*c).copied().unwrap_or(false)).filter_map(grown);
        let Some((c, k, size, before)) = all.max_by(|a, b| a.2.total_cmp(&b.2)) else { return };
        let at = named(state.mesh.image(state.mesh.x()[k]));
        record.warnings.push(format!(
            "blow-up: `{}` grows beyond all bounds at t = {}, {at}: it has grown from {before:.4} to {size:.4e} there, \
             and time steps that follow it have shrunk to {dt:.1e}; the time of the blow-up is as exact as the steps \
             and cells before it: compare with a run with more `grid.cells`, and with `time.tolerance` = 1e-5",
            names[c], state.t
        ));
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
                "{UNKNOWN}: at t = {} there are too few samples of each point to tell it; take two walks \
                 or paths or more",
                state.t
            ),
            Some(percent) if percent > limit => format!(
                "{NOISY}: from t = {} on their standard error is {percent:.1} % of the shortest edge of the mesh or \
                 more (a run warns above {limit} %); more walks or paths, or more sweeps, lower it",
                state.t
            ),
            Some(_) => return,
        };
        if !record.warnings.iter().any(|said| said.split(':').next() == warning.split(':').next()) {
            record.warnings.push(warning);
        }
    }
}
