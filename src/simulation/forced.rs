//! Sources, inflows and side values that come and go between the stages of a step.

use super::{Simulation, State};
use crate::geometry::Mesh;
use crate::meshing::Movable;
use crate::numerics::{ends, larger};
use crate::physics::Forcing;
use serde::{Deserialize, Serialize};

/// Number of moments of a run at which prescribed formulas are sampled.
const MOMENTS: f64 = 2048.0;
/// Smallest number of moments of a step at which prescribed formulas are sampled.
const A_STEP: f64 = 4.0;
/// Largest number of nodes at which prescribed formulas are sampled: half of them anywhere, half on sides.
const PLACES: usize = 128;
/// Largest amount of a source or an inflow that a step may miss between its stages, as a share of what it brings in the
/// whole run or of the range of its unknown, whichever is larger.
const MISSED: f64 = 1e-3;
/// Largest distance of a given side value from the straight lines between its values at the stages of a step, as a
/// share of its change in the run or of the range of its unknown, whichever is larger.
const BENDS: f64 = 0.05;
/// A side value may differ by more than [`BENDS`] allows if the integral of that difference over the step is below this
/// share of the length of the run times its change.
const FOR_LONG: f64 = 5e-5;
/// Places of the stages of TR-BDF2 within a step, as shares of it: γ = 2 − √2.
const STAGES: [f64; 3] = [0.0, 2.0 - std::f64::consts::SQRT_2, 1.0];
/// Weights of the stages of TR-BDF2 in what a step takes of a source.
const WEIGHTS: [f64; 3] =
    [0.25 * std::f64::consts::SQRT_2, 0.25 * std::f64::consts::SQRT_2, 1.0 - 0.5 * std::f64::consts::SQRT_2];
/// Indices of the three kinds of data that are sampled.
const SOURCE: usize = 0;
const INFLOW: usize = 1;
const VALUE: usize = 2;

/// Totals of what time-dependent formulas bring in a run: for each unknown, the largest values that the integrals of
/// its source and of its inflow reach at a place, and the largest change of its side values. Empty where no formula
/// takes time.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Forced {
    most: Vec<[f64; 3]>,
}

/// Something prescribed that happens between the stages of a step.
pub(crate) struct Hidden {
    pub what: &'static str,
    pub unknown: usize,
}

impl Forced {
    /// Looks ahead from the start of a run.
    pub fn of<const D: usize>(simulation: &Simulation<D>, start: &State<D>) -> Self
    where
        Mesh<D>: Movable<D>,
    {
        let looked = Looked::at(&start.mesh);
        let (begin, end) = (simulation.schedule.start(), simulation.schedule.end());
        let dt = (end - begin) / MOMENTS;
        let mut sums: Vec<[f64; 3]> = Vec::new();
        let mut first: Vec<Forcing> = Vec::new();
        let mut most = vec![[0.0; 3]; start.u.components()];
        for moment in 0..MOMENTS as usize {
            let forcing = looked.on_way(simulation, start, start, begin + (moment as f64 + 0.5) * dt);
            if forcing.is_empty() {
                return Self { most: Vec::new() };
            }
            if first.is_empty() {
                (sums, first) = (vec![[0.0; 3]; forcing.len()], forcing.clone());
            }
            for (k, (sum, now)) in sums.iter_mut().zip(&forcing).enumerate() {
                sum[SOURCE] += dt * now.source;
                sum[INFLOW] += dt * now.inflow;
                sum[VALUE] = now.value - first[k].value;
                let most = &mut most[k % start.u.components()];
                *most = std::array::from_fn(|q| larger(most[q], sum[q]));
            }
        }
        Self { most }
    }

    /// The size that each unknown may reach by what is prescribed.
    pub fn sizes<const D: usize>(&self, mesh: &Mesh<D>) -> impl Iterator<Item = f64> {
        let extent = mesh.extent().into_iter().fold(0.0, f64::max);
        self.most.iter().map(move |most| most[SOURCE].max(most[INFLOW] / extent).max(most[VALUE]))
    }

    /// The first thing prescribed along the ways of the nodes that the stages of a step do not see, if there is one.
    pub fn hidden<const D: usize>(
        &self,
        simulation: &Simulation<D>,
        before: &State<D>,
        after: &State<D>,
    ) -> Option<Hidden>
    where
        Mesh<D>: Movable<D>,
    {
        if self.most.is_empty() {
            return None;
        }
        let run = simulation.schedule.span();
        let missed = Missed::in_step(simulation, before, after, run);
        let unknowns = self.most.len();
        let extent = before.mesh.extent().into_iter().fold(0.0, f64::max);
        let range = |c: usize| {
            let [low, high] = ends(before.u.component(c).chain(after.u.component(c)));
            high - low
        };
        let ranges: Vec<f64> = (0..unknowns).map(range).collect();
        missed.into_iter().enumerate().find_map(|(k, missed)| {
            let c = k % unknowns;
            let [source, inflow, value] = self.most[c];
            let value = value.max(ranges[c]);
            let what = if missed.source.abs() > MISSED * source.max(ranges[c]) {
                "the source"
            } else if missed.inflow.abs() > MISSED * inflow.max(ranges[c] * extent) {
                "the inflow through a side"
            } else if missed.bend > BENDS * value && missed.bent > FOR_LONG * run * value {
                "the value on a side"
            } else {
                return None;
            };
            Some(Hidden { what, unknown: c })
        })
    }
}

/// What the stages of a step miss of what is prescribed for an unknown at a place.
#[derive(Debug, Clone, Copy, Default)]
struct Missed {
    /// Integral of the source over the step, less what the stages make of it.
    source: f64,
    /// Integral of the inflow over the step, less what the stages make of it.
    inflow: f64,
    /// Largest difference of a side value from the straight lines between the stages.
    bend: f64,
    /// Integral of that difference over the step.
    bent: f64,
}

impl Missed {
    /// What a step misses at all places that are looked at, for each unknown there.
    fn in_step<const D: usize>(simulation: &Simulation<D>, before: &State<D>, after: &State<D>, run: f64) -> Vec<Self>
    where
        Mesh<D>: Movable<D>,
    {
        let dt = after.t - before.t;
        let count = (MOMENTS * dt / run).ceil().clamp(A_STEP, MOMENTS);
        let looked = Looked::at(&after.mesh);
        let at = |share: f64| looked.on_way(simulation, before, after, before.t + share * dt);
        let stages = STAGES.map(at);
        let mut all = vec![Self::default(); stages[0].len()];
        for moment in 0..count as usize {
            let share = (moment as f64 + 0.5) / count;
            let later = usize::from(share > STAGES[1]);
            let between = (share - STAGES[later]) / (STAGES[later + 1] - STAGES[later]);
            for (k, (missed, now)) in all.iter_mut().zip(at(share)).enumerate() {
                let line = (1.0 - between) * stages[later][k].value + between * stages[later + 1][k].value;
                let bend = (now.value - line).abs();
                missed.source += dt * now.source / count;
                missed.inflow += dt * now.inflow / count;
                missed.bend = larger(missed.bend, bend);
                missed.bent += dt * bend / count;
            }
        }
        for (k, missed) in all.iter_mut().enumerate() {
            for (stage, weight) in stages.iter().zip(WEIGHTS) {
                missed.source -= dt * weight * stage[k].source;
                missed.inflow -= dt * weight * stage[k].inflow;
            }
        }
        all
    }
}

/// Some nodes of a lattice: all where there are few, and always some of each side.
struct Looked<const D: usize> {
    nodes: Vec<usize>,
    beyond: Vec<[[bool; 2]; D]>,
}

impl<const D: usize> Looked<D> {
    fn at(mesh: &Mesh<D>) -> Self {
        let lattice = mesh.lattice();
        let sides: Vec<usize> = lattice.sides().collect();
        let some = |nodes: Vec<usize>| {
            let stride = nodes.len().div_ceil(PLACES / 2).max(1);
            nodes.into_iter().step_by(stride).collect::<Vec<usize>>()
        };
        let mut nodes = some((0..lattice.len()).collect());
        nodes.extend(some(sides));
        let beyond = nodes.iter().map(|&k| lattice.beyond(k)).collect();
        Self { nodes, beyond }
    }

    /// What is prescribed at a time between two states where these nodes are by then, on straight ways.
    fn on_way(&self, simulation: &Simulation<D>, before: &State<D>, after: &State<D>, t: f64) -> Vec<Forcing>
    where
        Mesh<D>: Movable<D>,
    {
        let dt = after.t - before.t;
        let share = if dt > 0.0 { (t - before.t) / dt } else { 0.0 };
        let between = |a: f64, b: f64| a + share * (b - a);
        let place = |&k: &usize| {
            let [from, to] = [before, after].map(|state| state.mesh.x()[k]);
            before.mesh.image(std::array::from_fn(|d| between(from[d], to[d])))
        };
        let x: Vec<[f64; D]> = self.nodes.iter().map(place).collect();
        let count = before.u.components();
        let values = |&k: &usize| {
            (k * count..(k + 1) * count).map(|place| between(before.u.values()[place], after.u.values()[place]))
        };
        let u: Vec<f64> = self.nodes.iter().flat_map(values).collect();
        simulation.physics.forcing(t, &x, &self.beyond, &u)
    }
}
