//! Newton's method for the unknowns of a stage.

use super::Species;
use super::dual::Dual;
use super::equations::Stage;
use crate::error::{Failure, NodePlace};
use crate::numerics::larger;
use crate::numerics::linear::SparseSystem;
use crate::work::Work;

/// Newton's method has converged once a whole step of it changes concentrations by less than this share of the largest
/// one of the species, and fronts by less than this share of the line: the next step would be round-off.
const CONVERGED: f64 = 1e-9;
/// Steps after which a stage is given up. Three to five are usual.
const MOST_STEPS: usize = 30;
/// A phase keeps at least this share of its width in one step of Newton's method.
const LEFT: f64 = 0.5;
/// A phase counts as vanished where it is thinner than this share of the line.
const VANISHED: f64 = 1e-3;
/// Distance, in places, at which unknowns may be changed at once for the derivatives: an equation depends on its own
/// place and the two beside it.
const STRIDE: usize = 3;

impl Species {
    /// The unknowns that meet the equations of a stage, from a guess.
    pub(super) fn solve(&self, mut z: Vec<f64>, stage: &Stage, work: &mut Work) -> Result<Vec<f64>, Failure> {
        let mut system = SparseSystem::new(z.len());
        let mut change = f64::INFINITY;
        for _ in 0..MOST_STEPS {
            self.check(&z)?;
            let step = self.newton_step(&z, stage, &mut system)?;
            work.linear_solves += 1;
            work.newton_iterations += 1;
            let share = self.share(&z, &step);
            z.iter_mut().zip(&step).for_each(|(z, step)| *z += share * step);
            change = self.relative(&step, &z);
            if share == 1.0 && change <= CONVERGED {
                self.check(&z)?;
                return Ok(z);
            }
        }
        Err(Failure::NewtonStalled { residual: change, tolerance: CONVERGED, iterations: MOST_STEPS })
    }

    fn newton_step(&self, z: &[f64], stage: &Stage, system: &mut SparseSystem) -> Result<Vec<f64>, Failure> {
        let plain: Vec<Dual> = z.iter().map(|z| Dual::from(*z)).collect();
        let residual = self.residual(&plain, stage);
        if let Some(at) = residual.iter().position(|left| !left.value.is_finite()) {
            return Err(self.not_finite("the balance", at, residual[at].value, z));
        }
        let mut entries: Vec<(usize, usize, f64)> = Vec::new();
        for seeds in self.seeds() {
            let mut along = plain.clone();
            seeds.iter().for_each(|seed| along[*seed].slope = 1.0);
            let changed = self.residual(&along, stage);
            for (row, left) in changed.iter().enumerate() {
                entries.extend(self.column(row, &seeds).map(|column| (row, column, left.slope)));
            }
        }
        let mut size = vec![0.0; z.len()];
        entries.iter().for_each(|(row, _, a)| size[*row] = larger(size[*row], *a));
        let scale = |row: usize| if size[row] > 0.0 { 1.0 / size[row] } else { 1.0 };
        system.clear();
        entries.iter().for_each(|(row, column, a)| system.add(*row, *column, a * scale(*row)));
        let right: Vec<f64> = residual.iter().enumerate().map(|(row, left)| -left.value * scale(row)).collect();
        system.solve(&right)
    }

    /// Unknowns that may be changed at once, since no equation takes two of them: of every phase each resident at every
    /// third place, and each front.
    fn seeds(&self) -> Vec<Vec<usize>> {
        let phases = (0..self.cells.len()).flat_map(|phase| {
            let residents = 0..self.residents[phase].len();
            residents.flat_map(move |i| (0..STRIDE).map(move |first| (phase, i, first)))
        });
        let of = |(phase, i, first): (usize, usize, usize)| {
            (first..self.cells[phase] + 2).step_by(STRIDE).map(|place| self.at(phase, place, i)).collect()
        };
        phases.map(of).chain((0..self.laws.len()).map(|k| vec![self.front(k)])).collect()
    }

    /// The one of the seeds that an equation may take.
    fn column(&self, row: usize, seeds: &[usize]) -> Option<usize> {
        let first = *seeds.first()?;
        let fronts = self.front(0);
        let phase_of = |unknown: usize| (1..).find(|&p| unknown < self.before(p)).map_or(0, |p| p - 1);
        if first >= fronts {
            let k = first - fronts;
            let beside = if row < fronts { [phase_of(row), phase_of(row)] } else { [row - fronts, row - fronts + 1] };
            return beside.iter().any(|phase| *phase == k || *phase == k + 1).then_some(first);
        }
        let phase = phase_of(first);
        let (residents, last) = (self.residents[phase].len(), self.cells[phase] + 1);
        let place = match row {
            row if row >= fronts && row - fronts == phase => last,
            row if row >= fronts && row - fronts + 1 == phase => 0,
            row if row >= fronts => return None,
            row => match phase_of(row) {
                own if own == phase => (row - self.before(phase)) / residents,
                own if own == phase + 1 => last,
                own if own + 1 == phase => 0,
                _ => return None,
            },
        };
        let taken = place.saturating_sub(1)..=(place + 1).min(last);
        let resident = (first - self.before(phase)) % residents;
        taken.map(|place| self.at(phase, place, resident)).find(|unknown| seeds.binary_search(unknown).is_ok())
    }

    /// The share of a step of Newton's method after which every phase has enough of its width left.
    fn share(&self, z: &[f64], step: &[f64]) -> f64 {
        let (before, by) = (self.widths(z), self.widths_of(step, [0.0; 2]));
        let share = |(width, by): (&f64, &f64)| if *by < 0.0 { (LEFT - 1.0) * width / by } else { 1.0 };
        before.iter().zip(&by).map(share).fold(1.0, f64::min)
    }

    /// Widths of the phases.
    pub(super) fn widths(&self, z: &[f64]) -> Vec<f64> {
        self.widths_of(z, self.walls)
    }

    fn widths_of(&self, z: &[f64], [left, right]: [f64; 2]) -> Vec<f64> {
        let fronts = z[self.front(0)..].iter().copied();
        let ends: Vec<f64> = [left].into_iter().chain(fronts).chain([right]).collect();
        ends.windows(2).map(|pair| pair[1] - pair[0]).collect()
    }

    /// The largest entry of a change, of species as a share of their largest concentration, of fronts as one of the
    /// line.
    pub(super) fn relative(&self, change: &[f64], z: &[f64]) -> f64 {
        let mut sizes = vec![(0.0, f64::MIN_POSITIVE); self.names.species().len() + 1];
        for (k, (change, z)) in change.iter().zip(z).enumerate() {
            let (most, size) = &mut sizes[self.species_of(k).map_or(0, |species| species + 1)];
            *most = larger(*most, *change);
            *size = larger(*size, *z);
        }
        sizes[0].1 = self.walls[1] - self.walls[0];
        sizes.iter().map(|(most, size)| most / size).fold(0.0, larger)
    }

    /// The species of an unknown; none of the place of a front.
    fn species_of(&self, unknown: usize) -> Option<usize> {
        let phase = (0..self.cells.len()).find(|&p| unknown < self.before(p + 1))?;
        let residents = &self.residents[phase];
        Some(residents[(unknown - self.before(phase)) % residents.len()].species)
    }

    /// Refuses unknowns that are not finite, and phases that are thinner than a thousandth of the line.
    pub(super) fn check(&self, z: &[f64]) -> Result<(), Failure> {
        if let Some(at) = z.iter().position(|z| !z.is_finite()) {
            return Err(self.not_finite("the concentration", at, z[at], z));
        }
        let of = self.walls[1] - self.walls[0];
        match self.widths(z).into_iter().enumerate().find(|(_, width)| *width < VANISHED * of) {
            None => Ok(()),
            Some((phase, thickness)) => {
                let x = if phase == 0 { self.walls[0] } else { z[self.front(phase - 1)] };
                Err(Failure::VanishingPhase { phase: self.names.phases()[phase].clone(), x, thickness, of })
            }
        }
    }

    /// The failure of an unknown, or of its equation.
    fn not_finite(&self, what: &str, unknown: usize, value: f64, z: &[f64]) -> Failure {
        let Some(species) = self.species_of(unknown) else {
            let (k, x) = (unknown - self.front(0), z[unknown]);
            return Failure::Formula {
                what: format!("front.law of front {}", k + 1),
                value,
                at: at(k, x),
                given: vec![],
            };
        };
        let phase = (0..self.cells.len()).find(|&p| unknown < self.before(p + 1)).unwrap_or(0);
        let place = (unknown - self.before(phase)) / self.residents[phase].len();
        let duals: Vec<Dual> = z.iter().map(|z| Dual::from(*z)).collect();
        let x = self.cells_of(phase, &duals).x[place].value;
        let what = format!("{what} of {} in {}", self.names.species()[species], self.names.phases()[phase]);
        Failure::Formula { what, value, at: at(place, x), given: Vec::new() }
    }
}

fn at(node: usize, x: f64) -> NodePlace {
    NodePlace::new([node], [x])
}
