//! Steps in time, and the balance of every species.

use super::Species;
use super::dual::Dual;
use super::equations::Stage;
use crate::error::Result;
use crate::work::Work;
use serde::{Deserialize, Serialize};

/// d = 1 − 1/√2, the share of the step that is implicit in both stages.
const IMPLICIT: f64 = 1.0 - std::f64::consts::FRAC_1_SQRT_2;

/// The balance of a species since the start: content = start + inflow + produced − consumed.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Total {
    /// ∫σ x^m dx at the start.
    pub start: f64,
    /// ∫σ x^m dx now.
    pub content: f64,
    /// What has come in through the walls.
    pub inflow: f64,
    /// What sources have given.
    pub produced: f64,
    /// What has gone into fronts and not come out on their other side.
    pub consumed: f64,
}

impl Total {
    /// |content − start − inflow − produced + consumed| over the largest of these.
    pub fn imbalance(&self) -> f64 {
        let Self { start, content, inflow, produced, consumed } = *self;
        let size = [start, content, inflow, produced, consumed].into_iter().fold(0.0_f64, |m, part| m.max(part.abs()));
        let miss = (content - start - inflow - produced + consumed).abs();
        if miss == 0.0 { 0.0 } else { miss / size }
    }
}

/// Fronts and concentrations at a time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SpeciesState {
    /// Time.
    pub t: f64,
    /// Steps done.
    pub step: usize,
    /// Of every phase the concentrations at its left end, in its cells and at its right end, by place and resident;
    /// then the fronts.
    pub(super) z: Vec<f64>,
    /// The balance of each species.
    pub totals: Vec<Total>,
}

impl Species {
    /// The state at the start, with fronts at these places.
    ///
    /// # Errors
    /// [`Failure::VanishingPhase`](crate::Failure::VanishingPhase) where they are not between the walls from left to
    /// right; [`Failure::Formula`](crate::Failure::Formula) where a concentration is not finite.
    pub fn start(&self, t: f64, fronts: &[f64]) -> Result<SpeciesState> {
        let mut z = vec![0.0; self.unknowns()];
        z[self.front(0)..].copy_from_slice(fronts);
        let duals: Vec<Dual> = z.iter().map(|z| Dual::from(*z)).collect();
        for (phase, residents) in self.residents.iter().enumerate() {
            for (place, x) in self.cells_of(phase, &duals).x.into_iter().enumerate() {
                for (i, resident) in residents.iter().enumerate() {
                    z[self.at(phase, place, i)] = resident.initial.formula().eval(&[x.value]);
                }
            }
        }
        self.check(&z)?;
        let contents = self.contents(&z, t);
        let totals = contents.iter().map(|&content| Total { start: content, content, ..Total::default() }).collect();
        Ok(SpeciesState { t, step: 0, z, totals })
    }

    /// What a step to time `t` would come to, by two stages of the same implicit share, stiffly accurate
    ///
    /// ```text
    /// v¹ = vⁿ + d Δt v'(tⁿ + d Δt, v¹)      v* = vⁿ + (1/d − 1)(v¹ − vⁿ)      vⁿ⁺¹ = v* + d Δt v'(tⁿ⁺¹, vⁿ⁺¹)
    /// ```
    ///
    /// with d = 1 − 1/√2, where v are the amounts in the cells and the volumes up to the faces. Returns the state, the
    /// cost, and the estimated error: the larger one of the fronts', as a share of the line, and of the
    /// concentrations', as shares of the largest ones.
    ///
    /// # Errors
    /// [`Failure::NewtonStalled`](crate::Failure::NewtonStalled), [`LinearStalled`](crate::Failure::LinearStalled),
    /// [`VanishingPhase`](crate::Failure::VanishingPhase) or [`Formula`](crate::Failure::Formula).
    ///
    /// # Source
    /// Alexander, *Diagonally implicit Runge–Kutta methods for stiff ODEs*, SIAM J. Numer. Anal. 14 (1977).
    pub fn attempt(&self, state: &SpeciesState, t: f64) -> Result<(SpeciesState, Work, f64)> {
        let mut work = Work::default();
        let (from, whole) = (state.t, t - state.t);
        let dt = IMPLICIT * whole;
        let (amounts, within) = self.stored(&state.z, from);
        let first = Stage { t: from + dt, dt, amounts, within };
        let middle = self.solve(state.z.clone(), &first, &mut work)?;
        let (amounts, within) = self.stored(&middle, first.t);
        let ahead = |start: &f64, middle: &f64| start + (1.0 / IMPLICIT - 1.0) * (middle - start);
        let both = |start: &[f64], middle: &[f64]| start.iter().zip(middle).map(|(a, b)| ahead(a, b)).collect();
        let second = Stage {
            t,
            dt,
            amounts: both(&first.amounts, &amounts),
            within: first.within.iter().zip(&within).map(|(a, b)| both(a, b)).collect(),
        };
        let z = self.solve(middle.clone(), &second, &mut work)?;
        let mut totals = state.totals.clone();
        self.add_flows(&middle, &first, whole - dt, &mut totals);
        self.add_flows(&z, &second, dt, &mut totals);
        let contents = self.contents(&z, t);
        totals.iter_mut().zip(contents).for_each(|(total, content)| total.content = content);
        let error = self.error([&state.z, &middle, &z]);
        Ok((SpeciesState { t, step: state.step + 1, z, totals }, work, error))
    }

    /// By how much the end of a step differs from the straight line through its start and its middle, less what the
    /// method knows of that: an estimate of first order, and of what has a time derivative alone.
    fn error(&self, [start, middle, end]: [&[f64]; 3]) -> f64 {
        let miss = |k: usize| IMPLICIT * (end[k] - start[k] - (middle[k] - start[k]) / IMPLICIT);
        let mut change: Vec<f64> = (0..end.len()).map(miss).collect();
        for (phase, residents) in self.residents.iter().enumerate() {
            for (i, resident) in residents.iter().enumerate() {
                let last = self.cells[phase] + 1;
                let ends = if resident.storage.is(0.0) { 0..=last } else { 0..=0 };
                ends.chain([last]).for_each(|place| change[self.at(phase, place, i)] = 0.0);
            }
        }
        self.relative(&change, end)
    }

    /// Amounts in the cells, at the places of their concentrations, and ∫x^m dx up to the faces.
    fn stored(&self, z: &[f64], t: f64) -> (Vec<f64>, Vec<Vec<f64>>) {
        let duals: Vec<Dual> = z.iter().map(|z| Dual::from(*z)).collect();
        let (mut amounts, mut within) = (vec![0.0; z.len()], Vec::new());
        for phase in 0..self.cells.len() {
            let cells = self.cells_of(phase, &duals);
            for (i, held) in self.held(phase, &duals, &cells, t).iter().enumerate() {
                held.iter().enumerate().for_each(|(j, [amount, _])| amounts[self.at(phase, j + 1, i)] = amount.value);
            }
            within.push(cells.within.iter().map(|within| within.value).collect());
        }
        (amounts, within)
    }

    /// ∫σ x^m dx of each species.
    fn contents(&self, z: &[f64], t: f64) -> Vec<f64> {
        let (amounts, _) = self.stored(z, t);
        let mut contents = vec![0.0; self.names.species().len()];
        for (phase, residents) in self.residents.iter().enumerate() {
            for (i, resident) in residents.iter().enumerate() {
                let cells = (1..=self.cells[phase]).map(|j| amounts[self.at(phase, j, i)]);
                contents[resident.species] += cells.sum::<f64>();
            }
        }
        contents
    }

    /// Adds what comes in, is consumed and produced in a time `dt` at the rates of the end of a stage.
    fn add_flows(&self, z: &[f64], stage: &Stage, dt: f64, totals: &mut [Total]) {
        let duals: Vec<Dual> = z.iter().map(|z| Dual::from(*z)).collect();
        let last = self.cells.len() - 1;
        for (phase, residents) in self.residents.iter().enumerate() {
            let cells = self.cells_of(phase, &duals);
            let flows = self.flows(phase, &duals, &cells, stage);
            let held = self.held(phase, &duals, &cells, stage.t);
            for (i, resident) in residents.iter().enumerate() {
                let total = &mut totals[resident.species];
                let (left, right) = (dt * flows[i][0].value, dt * flows[i][held[i].len()].value);
                if phase == 0 {
                    total.inflow += left
                } else {
                    total.consumed -= left
                }
                if phase == last {
                    total.inflow -= right
                } else {
                    total.consumed += right
                }
                total.produced += dt * held[i].iter().map(|[_, source]| source.value).sum::<f64>();
            }
        }
    }

    /// Places of the fronts.
    pub fn fronts<'a>(&self, state: &'a SpeciesState) -> &'a [f64] {
        &state.z[self.front(0)..]
    }

    /// Velocities of the fronts by their laws.
    pub fn velocities(&self, state: &SpeciesState) -> Vec<f64> {
        let duals: Vec<Dual> = state.z.iter().map(|z| Dual::from(*z)).collect();
        (0..self.laws.len()).map(|k| self.velocity(k, &duals, state.t).value).collect()
    }

    /// Widths of the phases.
    pub fn widths_at(&self, state: &SpeciesState) -> Vec<f64> {
        self.widths(&state.z)
    }

    /// Places with the number of their phase, and concentrations there by species, 0 where a phase has none of it:
    /// the ends of each phase and the middles of its cells, so that every front occurs twice.
    pub fn profile(&self, state: &SpeciesState) -> (Vec<[f64; 1]>, Vec<usize>, Vec<Vec<f64>>) {
        let duals: Vec<Dual> = state.z.iter().map(|z| Dual::from(*z)).collect();
        let (mut x, mut phases) = (Vec::new(), Vec::new());
        let mut values = vec![Vec::new(); self.names.species().len()];
        for phase in 0..self.cells.len() {
            let places = self.cells_of(phase, &duals).x;
            phases.extend(std::iter::repeat_n(phase, places.len()));
            x.extend(places.iter().map(|x| [x.value]));
            for (species, values) in values.iter_mut().enumerate() {
                let resident = self.residents[phase].iter().position(|resident| resident.species == species);
                let at = |place: usize| resident.map_or(0.0, |i| state.z[self.at(phase, place, i)]);
                values.extend((0..places.len()).map(at));
            }
        }
        (x, phases, values)
    }

    /// The lowest diffusivity of a resident in its phase, behind its place.
    pub fn least_diffusivity(&self, state: &SpeciesState, phase: usize, resident: usize) -> [f64; 2] {
        let duals: Vec<Dual> = state.z.iter().map(|z| Dual::from(*z)).collect();
        let cells = self.cells_of(phase, &duals);
        let at = |place: usize| {
            let given = self.given(phase, place, &duals, (&cells, state.t));
            [cells.x[place].value, self.residents[phase][resident].diffusivity.at(&given).value]
        };
        let lower = |least: [f64; 2], next: [f64; 2]| if next[1] < least[1] || next[1].is_nan() { next } else { least };
        (1..self.cells[phase] + 2).map(at).fold(at(0), lower)
    }

    /// Whether a state may be one of this problem.
    pub fn knows(&self, state: &SpeciesState) -> bool {
        state.z.len() == self.unknowns()
            && state.totals.len() == self.names.species().len()
            && self.check(&state.z).is_ok()
    }
}
