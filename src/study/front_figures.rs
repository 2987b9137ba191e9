//! Studies of kind `stefan`: what a run finds, and the rows of its tables.

use super::fronts::Progress;
use crate::geometry::Quality;
use crate::output::Figures;
use crate::simulation::WorkTotal;
use crate::stefan::{Front, FrontState, PhaseEvent, Problem};
use serde::{Deserialize, Serialize};

/// What `summary.json` says of fronts, with reports of type `R`.
#[derive(Debug, Clone, Serialize)]
pub struct FrontSummary<R = FrontReport> {
    /// Steps and their cost.
    pub work: WorkTotal,
    /// One entry for each time of `time.report` that was reached.
    pub reports: Vec<R>,
    /// Phases that have appeared or vanished.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub phases: Vec<PhaseEvent>,
}

/// Seconds of fronts, by part.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
pub struct FrontParts {
    /// Moving the fronts and solving the equations between them.
    pub pde: f64,
}

impl<R> Default for FrontSummary<R> {
    fn default() -> Self {
        Self { work: WorkTotal::default(), reports: Vec::new(), phases: Vec::new() }
    }
}

impl<R: Clone + Serialize> Figures for FrontSummary<R> {
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
        quality: Quality,
        Progress { dt, newton_iterations, seconds }: Progress,
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
