//! Studies of kind `stefan` with `[species]`: what a run finds, and the table that it leaves.

use super::front_figures::FrontParts;
use crate::error::{Result, Unfit};
use crate::kept::Kept;
use crate::output::{Figures, Rows};
use crate::simulation::WorkTotal;
use crate::species::{Species, SpeciesState, Total};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// What `summary.json` says of fronts between species.
#[derive(Debug, Clone, Default, Serialize)]
pub struct SpeciesSummary {
    /// Steps and their cost.
    pub work: WorkTotal,
    /// One entry for each time of `time.report` that was reached.
    pub reports: Vec<SpeciesReport>,
}

impl Figures for SpeciesSummary {
    type Parts = FrontParts;
}

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

/// `history.csv`.
pub(super) struct Table(Rows);

impl Table {
    const NAME: &'static str = "history.csv";

    pub fn create(directory: &Path, problem: &Species) -> Result<Self> {
        let mut rows = Rows::create(&directory.join(Self::NAME))?;
        let fronts = problem.laws.len();
        let each = |what: &str| -> Vec<String> {
            (1..=fronts).map(|k| if fronts == 1 { what.into() } else { format!("{what}_{k}") }).collect()
        };
        let parts = ["content", "inflow", "produced", "consumed"];
        let totals = problem.names.species().iter().flat_map(|name| parts.map(|part| format!("{name}_{part}")));
        let heads: Vec<String> = ["t".into(), "dt".into()]
            .into_iter()
            .chain(each("front"))
            .chain(each("velocity"))
            .chain(totals)
            .chain(["newton_iterations".into(), "seconds".into()])
            .collect();
        rows.add(heads)?;
        Ok(Self(rows))
    }

    /// Goes on behind the rows that a checkpoint knows of.
    pub fn resume(directory: &Path, kept: &Kept) -> Result<Self, Unfit> {
        Ok(Self(Rows::reopen(&directory.join(Self::NAME), kept.get(Self::NAME)?)?))
    }

    pub fn keep(&mut self, kept: &mut Kept) -> Result<()> {
        kept.put(Self::NAME, &self.0.sync()?);
        Ok(())
    }

    pub fn write(&mut self, report: &SpeciesReport, dt: f64, (newton, seconds): (usize, f64)) -> Result<()> {
        let totals = report.species.values().flat_map(|of| [of.content, of.inflow, of.produced, of.consumed]);
        let row: Vec<f64> = [report.t, dt]
            .into_iter()
            .chain(report.front.x.iter().copied())
            .chain(report.front.velocity.iter().copied())
            .chain(totals)
            .chain([newton as f64, seconds])
            .collect();
        self.0.add(row)?;
        self.0.flush()
    }
}
