//! Studies of kind `stefan`: what a run finds, and the tables that it leaves.

use crate::error::{Result, Unfit};
use crate::geometry::Quality;
use crate::kept::Kept;
use crate::output::{Figures, Rows};
use crate::simulation::WorkTotal;
use crate::stefan::{Front, FrontState, PhaseEvent, Problem};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// What `summary.json` says of a front.
#[derive(Debug, Clone, Default, Serialize)]
pub struct FrontSummary {
    /// Steps and their cost.
    pub work: WorkTotal,
    /// One entry for each time of `time.report` that was reached.
    pub reports: Vec<FrontReport>,
    /// Phases that have appeared or vanished.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub phases: Vec<PhaseEvent>,
}

/// Seconds of a front, by part.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
pub struct FrontParts {
    /// Moving the front and solving the heat equation.
    pub pde: f64,
}

impl Figures for FrontSummary {
    type Parts = FrontParts;
}

/// The state at one of the times asked for.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub struct FrontReport {
    /// Time.
    pub t: f64,
    /// Position of the front.
    pub front: FrontFigures,
    /// Error of the temperature, where an exact solution is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<FrontError>,
    /// |ΔE − ∫F dt| over the heat that was moved, with fluxes by weighted residual; none before any was.
    pub energy_imbalance: Option<f64>,
    /// |ΔE − ∫F dt| over the heat that was moved, with fluxes by differences over three rows.
    pub energy_imbalance_by_differences: Option<f64>,
    /// The longest stable explicit step, as estimated; none where the front is at rest.
    pub step_limit: Option<f64>,
}

/// Position of the front.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub struct FrontFigures {
    /// Mean height of the front over the width of the box.
    pub mean: f64,
    /// Lowest and highest point of the front.
    pub range: [f64; 2],
    /// The share of its way by which the front is in doubt: by gradients over four rows in place of three, in an
    /// undercooled melt by the balance of energy, too; none before it has moved.
    pub doubt: Option<f64>,
    /// The share of the columns at which one phase reaches the wall of the other one.
    #[serde(default, skip_serializing_if = "none_of_it")]
    pub bare: f64,
    /// Largest error of its height, where an exact solution is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error_linf: Option<f64>,
}

#[allow(clippy::trivially_copy_pass_by_ref)] // as serde asks
fn none_of_it(share: &f64) -> bool {
    *share == 0.0
}

/// Error of the temperature.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub struct FrontError {
    /// Largest error at a node.
    pub linf: f64,
}

impl FrontReport {
    /// The report of a state.
    pub(super) fn of(front: &Front, given: &dyn Problem, state: &FrontState) -> Self {
        let (h, last) = (&state.front, state.front.len() - 1);
        let inner: f64 = h[1..last].iter().sum();
        let errors = front.errors(given, state);
        let limit = front.limit(state);
        Self {
            t: state.t,
            front: FrontFigures {
                mean: (inner + 0.5 * (h[0] + h[last])) / last as f64,
                range: [
                    h.iter().copied().fold(f64::INFINITY, f64::min),
                    h.iter().copied().fold(f64::NEG_INFINITY, f64::max),
                ],
                doubt: front.doubt(state),
                bare: state.bare.iter().flatten().count() as f64 / h.len() as f64,
                error_linf: errors.map(|[front, _]| front),
            },
            error: errors.map(|[_, linf]| FrontError { linf }),
            energy_imbalance: state.energy.imbalance(),
            energy_imbalance_by_differences: state.energy.imbalance_by_differences(),
            step_limit: limit.is_finite().then_some(limit),
        }
    }
}

/// A row of `history.csv`.
#[derive(Serialize)]
pub(super) struct Row {
    t: f64,
    dt: f64,
    front_mean: f64,
    front_min: f64,
    front_max: f64,
    /// Lowest and highest temperature, and the means of those of the walls.
    temperature_min: f64,
    temperature_max: f64,
    bottom_temperature: f64,
    top_temperature: f64,
    front_error_linf: Option<f64>,
    error_linf: Option<f64>,
    energy_imbalance: Option<f64>,
    energy_imbalance_by_differences: Option<f64>,
    step_limit: Option<f64>,
    min_scaled_jacobian: f64,
    q_max: f64,
    q_mean: f64,
    newton_iterations: usize,
    seconds: f64,
}

impl Row {
    /// Of a state with this report, on a mesh of this quality.
    pub fn of(
        report: &FrontReport,
        temperatures: [f64; 4],
        dt: f64,
        quality: Quality,
        (newton_iterations, seconds): (usize, f64),
    ) -> Self {
        let [temperature_min, temperature_max, bottom_temperature, top_temperature] = temperatures;
        Self {
            temperature_min,
            temperature_max,
            bottom_temperature,
            top_temperature,
            t: report.t,
            dt,
            front_mean: report.front.mean,
            front_min: report.front.range[0],
            front_max: report.front.range[1],
            front_error_linf: report.front.error_linf,
            error_linf: report.error.map(|error| error.linf),
            energy_imbalance: report.energy_imbalance,
            energy_imbalance_by_differences: report.energy_imbalance_by_differences,
            step_limit: report.step_limit,
            min_scaled_jacobian: quality.min_scaled_jacobian,
            q_max: quality.q_max,
            q_mean: quality.q_mean,
            newton_iterations,
            seconds,
        }
    }
}

/// `history.csv` and `front.csv`.
pub(super) struct Tables {
    history: Rows,
    fronts: Rows,
}

impl Tables {
    const NAMES: [&str; 2] = ["history.csv", "front.csv"];

    pub fn create(directory: &Path, x: &[f64]) -> Result<Self> {
        let [history, fronts] = Self::NAMES.map(|name| Rows::create(&directory.join(name)));
        let mut tables = Self { history: history?, fronts: fronts? };
        let heads = ["t".to_string()].into_iter().chain(x.iter().map(|x| format!("x={x}")));
        tables.fronts.add(heads.collect::<Vec<_>>())?;
        Ok(tables)
    }

    /// Goes on behind the rows that a checkpoint knows of.
    pub fn resume(directory: &Path, kept: &Kept) -> Result<Self, Unfit> {
        let [history, fronts] = Self::NAMES.map(|name| Rows::reopen(&directory.join(name), kept.get(name)?));
        Ok(Self { history: history?, fronts: fronts? })
    }

    /// Every front so far, behind its time.
    pub fn fronts(directory: &Path) -> Result<Vec<Vec<f64>>, Unfit> {
        let file = Self::NAMES[1];
        let beside = |reason: String| Unfit::Beside { file: file.into(), reason };
        let mut rows = csv::Reader::from_path(directory.join(file)).map_err(|error| beside(error.to_string()))?;
        let row = |row: csv::Result<csv::StringRecord>| -> Result<Vec<f64>, Unfit> {
            let row = row.map_err(|error| beside(error.to_string()))?;
            let number = |entry: &str| entry.parse().map_err(|_| beside(format!("{entry:?} is no number")));
            row.iter().map(number).collect()
        };
        rows.records().map(row).collect()
    }

    pub fn keep(&mut self, kept: &mut Kept) -> Result<()> {
        for (name, table) in Self::NAMES.into_iter().zip([&mut self.history, &mut self.fronts]) {
            kept.put(name, &table.sync()?);
        }
        Ok(())
    }

    pub fn write(&mut self, row: Row, front: &[f64]) -> Result<()> {
        let heights = [row.t].into_iter().chain(front.iter().copied()).map(|value| value.to_string());
        self.fronts.add(heights.collect::<Vec<_>>())?;
        self.history.add(row)?;
        self.history.flush().and(self.fronts.flush())
    }
}
