//! The balance of energy over a step.

use super::columns::{LOWER, UPPER};
use super::conduct::{Fields, present, velocity};
use super::energy::{Energy, Phase, total};
use super::solver::{Front, FrontState, Problem, Side};

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
        let sensible = [LOWER, UPPER].map(|phase| after[phase][0] - before[phase][0]);
        let change = energy.now - state.energy.now;
        let latent = change - sensible[LOWER] - sensible[UPPER];
        let flux = [LOWER, UPPER].map(|wall| self.has_flux(problem, wall, state.t));
        // what flows through a wall with a given temperature, or in part through one, is what is missing
        let unknown = end.alone.is_some() && flux != [true; 2] || end.bare.iter().any(Option::is_some);
        let mut through = [[0.0; 2]; 2];
        if unknown {
            through[LOWER] = [change; 2];
        } else {
            if end.alone.is_none() {
                for phase in (0..2).filter(|&phase| !flux[phase]) {
                    through[phase][0] = after[phase][1] - before[phase][1];
                }
            }
            for instant in instants {
                let inflow = self.inflow(problem, instant);
                (0..4).for_each(|k| through[k / 2][k % 2] += instant.dt * inflow[k / 2][k % 2]);
            }
        }
        energy.inflow += through[LOWER][0] + through[UPPER][0];
        energy.inflow_by_differences += through[LOWER][1] + through[UPPER][1];
        let walls = through.map(|[inflow, _]| inflow);
        energy.moved += 0.5 * walls.iter().chain(&sensible).chain(&[latent]).map(|part| part.abs()).sum::<f64>();
        energy
    }

    /// Flux in through wall and sides of each phase at an instant, but for d/dt ∫C (u − T_m) Φ of phases without a
    /// given flux; and the whole flux by differences.
    fn inflow(&self, problem: &dyn Problem, instant: &Instant<'_>) -> [[f64; 2]; 2] {
        let (y, above) = (self.heights(&instant.fields.h), self.above_melting(&instant.fields.u));
        let from = self.heights(instant.from);
        let mut sums = [[0.0; 2]; 2];
        for phase in present(instant.fields.alone) {
            let at = self.phase(phase, &y, &above);
            let given = self.given_flux(problem, phase, (phase, &instant.fields.u), instant.t);
            sums[phase][0] = given.unwrap_or_else(|| at.flow(&velocity(&from[phase], &y[phase], instant.over)));
            sums[phase][1] = given.unwrap_or_else(|| at.wall_flux());
            if instant.fields.alone.is_some() {
                let other = self.given_flux(problem, 1 - phase, (phase, &instant.fields.u), instant.t).unwrap_or(0.0);
                sums[1 - phase] = [other; 2];
            }
            let mut through_sides = [0.0; 2];
            for side in 0..2 {
                let u = &instant.fields.u[phase];
                match self.sides[side] {
                    Side::Insulated => (),
                    Side::Given => at.add_side_flux(side, &mut through_sides),
                    Side::Flux => self.add_side_inflow(problem, (&at, side), (u, instant.t), &mut through_sides),
                }
            }
            let [all, unseen] = through_sides;
            sums[phase][0] += if given.is_some() { all } else { unseen };
            sums[phase][1] += all;
        }
        sums
    }

    /// Adds what flows into a phase through the left (0) or the right side (1): ∫q and ∫q (1 − Φ).
    fn add_side_inflow(
        &self,
        problem: &dyn Problem,
        (phase, side): (&Phase<'_>, usize),
        (u, t): (&[f64], f64),
        sums: &mut [f64; 2],
    ) {
        let nodes = self.columns.rows(phase.phase) + 1;
        let i = [0, self.columns.x().len() - 1][side];
        let flux = |k: usize| {
            let at = self.side_flux(problem, (phase.phase, side), [phase.y, u], (k, t));
            let [flux, _] = at.unwrap_or_default();
            [flux, flux * (1.0 - phase.test(k))]
        };
        for k in i * nodes..(i + 1) * nodes - 1 {
            let half = 0.5 * (phase.y[k + 1] - phase.y[k]);
            let [a, b] = [flux(k), flux(k + 1)];
            (0..2).for_each(|c| sums[c] += half * (a[c] + b[c]));
        }
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
