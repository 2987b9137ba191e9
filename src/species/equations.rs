//! The equations of an implicit stage, with their derivatives along one direction.

use super::dual::Dual;
use super::{EndCondition, Species};

/// What a stage v = v* + τ v'(t, v) begins with.
pub(super) struct Stage {
    pub t: f64,
    /// τ.
    pub dt: f64,
    /// Amounts in the cells, at the places of their concentrations among the unknowns; 0 elsewhere.
    pub amounts: Vec<f64>,
    /// ∫x^m dx up to each face of each phase.
    pub within: Vec<Vec<f64>>,
}

/// The cells of a phase: all of one width.
pub(super) struct Cells {
    pub width: Dual,
    /// Places of the left end, the middles of the cells and the right end.
    pub x: Vec<Dual>,
    /// x^m and ∫x^m dx at the faces.
    pub area: Vec<Dual>,
    pub within: Vec<Dual>,
}

/// A resident at the left or the right end of its phase.
#[derive(Clone, Copy)]
struct AtEnd {
    value: Dual,
    /// −D ∂c/∂x.
    flux: Dual,
}

impl Species {
    /// The cells of a phase.
    pub(super) fn cells_of(&self, phase: usize, z: &[Dual]) -> Cells {
        let (n, m) = (self.cells[phase], self.power());
        let end = |k: usize| match k {
            0 => Dual::from(self.walls[0]),
            k if k == self.cells.len() => Dual::from(self.walls[1]),
            k => z[self.front(k - 1)],
        };
        let (left, right) = (end(phase), end(phase + 1));
        let width = 1.0 / n as f64 * (right - left);
        let along = |share: f64| (1.0 - share) * left + share * right;
        let faces: Vec<Dual> = (0..=n).map(|f| along(f as f64 / n as f64)).collect();
        let middles = (0..n).map(|j| along((j as f64 + 0.5) / n as f64));
        Cells {
            width,
            x: [left].into_iter().chain(middles).chain([right]).collect(),
            area: faces.iter().map(|x| x.powi(m)).collect(),
            within: faces.iter().map(|x| 1.0 / f64::from(m + 1) * x.powi(m + 1)).collect(),
        }
    }

    /// Concentrations at a place of a phase, x and t: what its formulas take.
    pub(super) fn given(&self, phase: usize, place: usize, z: &[Dual], (cells, t): (&Cells, f64)) -> Vec<Dual> {
        let here = self.at(phase, place, 0);
        let values = z[here..here + self.residents[phase].len()].iter().copied();
        values.chain([cells.x[place], Dual::from(t)]).collect()
    }

    fn at_end(&self, (phase, end): (usize, usize), z: &[Dual], (cells, t): (&Cells, f64)) -> Vec<AtEnd> {
        let n = self.cells[phase];
        let (place, next) = if end == 0 { (0, 1) } else { (n + 1, n) };
        let given = self.given(phase, place, z, (cells, t));
        let outward = if end == 0 { -1.0 } else { 1.0 };
        let resident = |(i, resident): (usize, &super::Resident)| {
            let value = z[self.at(phase, place, i)];
            let slope = 2.0 * outward * (value - z[self.at(phase, next, i)]) / cells.width;
            AtEnd { value, flux: -(resident.diffusivity.at(&given) * slope) }
        };
        self.residents[phase].iter().enumerate().map(resident).collect()
    }

    /// What the law of a front takes: [`Names::at_front`](super::Names::at_front).
    fn at_front(&self, k: usize, z: &[Dual], (all, t): (&[Cells], f64)) -> Vec<Dual> {
        let left = self.at_end((k, 1), z, (&all[k], t));
        let right = self.at_end((k + 1, 0), z, (&all[k + 1], t));
        let pairs = left.into_iter().chain(right).flat_map(|at| [at.value, at.flux]);
        pairs.chain([z[self.front(k)], Dual::from(t)]).collect()
    }

    /// Velocity of a front by its law.
    pub(super) fn velocity(&self, k: usize, z: &[Dual], t: f64) -> Dual {
        let all: Vec<Cells> = (0..self.cells.len()).map(|phase| self.cells_of(phase, z)).collect();
        self.laws[k].at(&self.at_front(k, z, (&all, t)))
    }

    /// Amounts that pass the faces of a phase to the right for each time, by resident: conducted, and swept over by
    /// faces that move.
    pub(super) fn flows(&self, phase: usize, z: &[Dual], cells: &Cells, stage: &Stage) -> Vec<Vec<Dual>> {
        let n = self.cells[phase];
        let given: Vec<Vec<Dual>> = (0..n + 2).map(|j| self.given(phase, j, z, (cells, stage.t))).collect();
        let swept = |f: usize| 1.0 / stage.dt * (cells.within[f] - Dual::from(stage.within[phase][f]));
        let residents = self.residents[phase].iter().enumerate().map(|(i, resident)| {
            let [stored, conducted] = [&resident.storage, &resident.diffusivity]
                .map(|rate| given.iter().map(|given| rate.at(given)).collect::<Vec<Dual>>());
            let flow = |f: usize| {
                let between = |values: &[Dual]| match f {
                    0 => values[0],
                    f if f == n => values[n + 1],
                    f => 0.5 * (values[f] + values[f + 1]),
                };
                let apart = if f == 0 || f == n { 0.5 * cells.width } else { cells.width };
                let rise = z[self.at(phase, f + 1, i)] - z[self.at(phase, f, i)];
                -(cells.area[f] * between(&conducted) * rise / apart) - between(&stored) * swept(f)
            };
            (0..=n).map(flow).collect()
        });
        residents.collect()
    }

    /// Amounts in the cells of a phase, and what its sources give for each time, by resident and cell.
    pub(super) fn held(&self, phase: usize, z: &[Dual], cells: &Cells, t: f64) -> Vec<Vec<[Dual; 2]>> {
        let residents = self.residents[phase].iter().map(|resident| {
            let cell = |j: usize| {
                let given = self.given(phase, j, z, (cells, t));
                let volume = cells.within[j] - cells.within[j - 1];
                [&resident.storage, &resident.source].map(|rate| volume * rate.at(&given))
            };
            (1..=self.cells[phase]).map(cell).collect()
        });
        residents.collect()
    }

    /// What is left of the equations of a stage for the unknowns z, in the order of these.
    pub(super) fn residual(&self, z: &[Dual], stage: &Stage) -> Vec<Dual> {
        let all: Vec<Cells> = (0..self.cells.len()).map(|phase| self.cells_of(phase, z)).collect();
        let mut left = vec![Dual::default(); z.len()];
        for (phase, cells) in all.iter().enumerate() {
            let flows = self.flows(phase, z, cells, stage);
            let held = self.held(phase, z, cells, stage.t);
            for (i, (flows, held)) in flows.iter().zip(&held).enumerate() {
                for (j, [amount, source]) in held.iter().enumerate() {
                    let at = self.at(phase, j + 1, i);
                    let gain = flows[j] - flows[j + 1] + *source;
                    left[at] = *amount - Dual::from(stage.amounts[at]) - stage.dt * gain;
                }
                for end in 0..2 {
                    let (place, flow) = if end == 0 { (0, flows[0]) } else { (held.len() + 1, -flows[held.len()]) };
                    left[self.at(phase, place, i)] = self.end((phase, end, i), z, (&all, stage), flow);
                }
            }
        }
        for k in 0..self.laws.len() {
            let law = self.laws[k].at(&self.at_front(k, z, (&all, stage.t)));
            let (area, within) = (all[k + 1].area[0], all[k + 1].within[0]);
            left[self.front(k)] = within - Dual::from(stage.within[k + 1][0]) - stage.dt * (area * law);
        }
        left
    }

    /// What is left of the condition of a resident at an end of its phase, where `flow` enters for each time.
    fn end(
        &self,
        (phase, end, i): (usize, usize, usize),
        z: &[Dual],
        (all, stage): (&[Cells], &Stage),
        flow: Dual,
    ) -> Dual {
        let (n, cells) = (self.cells[phase], &all[phase]);
        let (place, next, face) = if end == 0 { (0, 1, 0) } else { (n + 1, n, n) };
        let value = z[self.at(phase, place, i)];
        let level = value - z[self.at(phase, next, i)];
        let given = || {
            let inside = self.given(phase, place, z, (cells, stage.t));
            let Some(k) = (phase + end).checked_sub(1).filter(|k| *k < self.laws.len()) else { return inside };
            let moved = 1.0 / stage.dt * (cells.within[face] - Dual::from(stage.within[phase][face]));
            let own = inside[..self.residents[phase].len()].iter().copied();
            own.chain(self.at_front(k, z, (all, stage.t))).chain([moved / cells.area[face]]).collect()
        };
        match &self.residents[phase][i].ends[end] {
            EndCondition::Value(rate) => value - rate.at(&given()),
            EndCondition::Flux(rate) if cells.area[face].value > 0.0 => flow - cells.area[face] * rate.at(&given()),
            // nothing flows through the centre
            EndCondition::Flux(_) | EndCondition::Outflow => level,
        }
    }
}
