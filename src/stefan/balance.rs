//! The balance of energy over a step.

use super::columns::{LOWER, UPPER};
use super::conduct::{Fields, present, velocity};
use super::energy::{Energy, Phase, total};
use super::solver::{Front, FrontState, Problem};

/// The state at an instant of a step, with its share of the step in an integral over time.
pub(super) struct Instant<'a> {
    pub t: f64,
    /// The share times the length of the step.
    pub dt: f64,
    pub fields: &'a Fields,
    /// Heights of the front a time `over` earlier, had it moved at the velocity of this instant.
    pub from: &'a [f64],
    pub over: f64,
}

impl Front {
    /// ∫C (u − T_m) and ∫C (u − T_m) Φ of both phases.
    fn contents(&self, fields: &Fields) -> [[f64; 2]; 2] {
        let (y, above) = (self.heights(&fields.h), self.above_melting(&fields.u));
        let mut contents = [[0.0; 2]; 2];
        present(fields.alone).for_each(|phase| contents[phase] = self.phase(phase, &y, &above).content());
        contents
    }

    fn above_melting(&self, u: &[Vec<f64>; 2]) -> [Vec<f64>; 2] {
        u.each_ref().map(|u| u.iter().map(|u| u - self.material.melting).collect())
    }

    fn phase<'a>(&'a self, phase: usize, y: &'a [Vec<f64>; 2], u: &'a [Vec<f64>; 2]) -> Phase<'a> {
        Phase {
            columns: &self.columns,
            phase,
            y: &y[phase],
            u: &u[phase],
            conductivity: self.material.conductivity[phase],
            capacity: self.material.capacity[phase],
        }
    }

    /// E.
    pub(super) fn content(&self, fields: &Fields) -> f64 {
        total(&self.columns, &fields.h, self.contents(fields).map(|content| content[0]), self.latent_heat())
    }

    /// The balance of energy after a step to (h, u) with these instants.
    pub(super) fn balance(
        &self,
        problem: &dyn Problem,
        state: &FrontState,
        end: &Fields,
        instants: &[Instant<'_>],
    ) -> Energy {
        let [before, after] = [&state.fields(), end].map(|fields| self.contents(fields));
        let mut energy = state.energy;
        energy.now = total(&self.columns, &end.h, after.map(|content| content[0]), self.latent_heat());
        let flux = [LOWER, UPPER].map(|wall| self.has_flux(problem, wall, state.t));
        match end.alone {
            // what flows through a wall with a given temperature is what is missing
            Some(phase) if flux != [true; 2] => {
                let change = after[phase][0] - before[phase][0];
                energy.inflow += change;
                energy.inflow_by_differences += change;
                return energy;
            }
            Some(_) => (),
            None => {
                let unseen = [LOWER, UPPER].map(|phase| after[phase][1] - before[phase][1]);
                energy.inflow += (0..2).filter(|&phase| !flux[phase]).map(|phase| unseen[phase]).sum::<f64>();
            }
        }
        for instant in instants {
            let [inflow, by_differences] = self.inflow(problem, instant);
            energy.inflow += instant.dt * inflow;
            energy.inflow_by_differences += instant.dt * by_differences;
        }
        energy
    }

    /// Flux in through walls and sides at an instant, but for d/dt ∫C (u − T_m) Φ of phases without a given flux; and
    /// the whole flux by differences.
    fn inflow(&self, problem: &dyn Problem, instant: &Instant<'_>) -> [f64; 2] {
        let (y, above) = (self.heights(&instant.fields.h), self.above_melting(&instant.fields.u));
        let from = self.heights(instant.from);
        let mut sums = [0.0; 2];
        for phase in present(instant.fields.alone) {
            let at = self.phase(phase, &y, &above);
            let given = self.given_flux(problem, phase, (phase, &instant.fields.u), instant.t);
            sums[0] += given.unwrap_or_else(|| at.flow(&velocity(&from[phase], &y[phase], instant.over)));
            sums[1] += given.unwrap_or_else(|| at.wall_flux());
            if instant.fields.alone.is_some() {
                let other = self.given_flux(problem, 1 - phase, (phase, &instant.fields.u), instant.t).unwrap_or(0.0);
                sums = sums.map(|sum| sum + other);
            }
            if !self.mirrored() {
                let [all, unseen] = at.side_fluxes();
                sums[0] += if given.is_some() { all } else { unseen };
                sums[1] += all;
            }
        }
        sums
    }

    /// ∫q ds over a wall that a phase reaches, where q is given.
    fn given_flux(
        &self,
        problem: &dyn Problem,
        wall: usize,
        (phase, u): (usize, &[Vec<f64>; 2]),
        t: f64,
    ) -> Option<f64> {
        let nodes = self.columns.rows(phase) + 1;
        let at = if wall == LOWER { 0 } else { nodes - 1 };
        let (x, y, last) = (self.columns.x(), self.columns.wall(wall), self.columns.x().len() - 1);
        let rise = super::front::tilt(&self.columns, y, self.mirrored());
        let flux = |i: usize| {
            let [flux, _] = problem.flux(wall, [x[i], y[i]], u[phase][i * nodes + at], t)?;
            let part = if i == 0 || i == last { 0.5 } else { 1.0 };
            Some(part * self.columns.spacing() * flux * rise[i].hypot(1.0))
        };
        (0..=last).map(flux).sum()
    }
}
