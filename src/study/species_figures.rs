//! Studies of kind `stefan` with `[species]`: what a run finds, and the rows of its table.

use super::fronts::Progress;
use crate::species::{Species, SpeciesState, Total};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The state at one of the times asked for.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct SpeciesReport {
    /// Time.
    pub t: f64,
    /// The fronts.
    pub front: FrontsReport,
    /// The balance of each species, by its name.
    pub species: BTreeMap<String, Balance>,
}

/// Fronts from left to right.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct FrontsReport {
    /// Their places.
    pub x: Vec<f64>,
    /// Their velocities to the right.
    pub velocity: Vec<f64>,
}

/// The balance of a species, with its gap.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub struct Balance {
    /// The parts: content = start + inflow + produced − consumed.
    #[serde(flatten)]
    pub total: Total,
    /// The gap between both sides, as a share of the largest part.
    pub imbalance: f64,
}

impl std::ops::Deref for Balance {
    type Target = Total;

    fn deref(&self) -> &Total {
        &self.total
    }
}

impl SpeciesReport {
    /// The report of a state.
    pub(super) fn of(problem: &Species, state: &SpeciesState) -> Self {
        let names = problem.names.species().iter().cloned();
        let totals = state.totals.iter().map(|&total| Balance { total, imbalance: total.imbalance() });
        Self {
            t: state.t,
            front: FrontsReport { x: problem.fronts(state).to_vec(), velocity: problem.velocities(state) },
            species: names.zip(totals).collect(),
        }
    }
}

/// Names of the columns of `history.csv`.
pub(super) fn heads(problem: &Species) -> Vec<String> {
    let fronts = problem.laws.len();
    let each = |what: &str| -> Vec<String> {
        (1..=fronts).map(|k| if fronts == 1 { what.into() } else { format!("{what}_{k}") }).collect()
    };
    let parts = ["content", "inflow", "produced", "consumed"];
    let totals = problem.names.species().iter().flat_map(|name| parts.map(|part| format!("{name}_{part}")));
    ["t".into(), "dt".into()]
        .into_iter()
        .chain(each("front"))
        .chain(each("velocity"))
        .chain(totals)
        .chain(["newton_iterations".into(), "seconds".into()])
        .collect()
}

/// A row of `history.csv`.
pub(super) fn row(report: &SpeciesReport, Progress { dt, newton_iterations, seconds }: Progress) -> Vec<f64> {
    let totals = report.species.values().flat_map(|of| [of.content, of.inflow, of.produced, of.consumed]);
    [report.t, dt]
        .into_iter()
        .chain(report.front.x.iter().copied())
        .chain(report.front.velocity.iter().copied())
        .chain(totals)
        .chain([newton_iterations as f64, seconds])
        .collect()
}
