//! Studies of kind `stefan`: what a problem with fronts is to the one time loop of all of them.

use crate::error::{Moment, Result, Unfit};
use crate::output::{Picture, Rows, RunDirectory};
use crate::simulation::Scene;
use crate::stefan::Attempt;
use serde::{Serialize, de::DeserializeOwned};
use std::path::Path;

/// Smallest and largest ratio of an automatic step to the one before it.
const GROWTH: [f64; 2] = [0.2, 2.0];
/// The share of the longest step within the tolerance, as estimated, at which the next step aims.
const AIM: f64 = 0.9;
/// How often an automatic step with too large an error is shortened before it is taken as it is.
const REJECTIONS: usize = 12;

/// What decides how long automatic steps are
///
/// ```text
/// Δt ← Δt · 0.9 (ε / error)^(1/p), at least a fifth of Δt and at most twice Δt
/// ```
///
/// p is the order of the estimated error in Δt. A step with an error above ε is tried again with the new Δt.
#[derive(Debug, Clone, Copy)]
pub struct Controller {
    /// ε, the estimated error of a step.
    pub tolerance: f64,
    /// The p-th root.
    pub root: fn(f64) -> f64,
    /// How often a step that fails is halved before the run fails.
    pub halvings: i32,
}

impl Controller {
    /// Whether a step of length `dt` with this error will do, or has been `rejected` too often not to; sets the length
    /// of the next one.
    pub(super) fn judge(&self, dt: f64, error: f64, rejected: usize, next: &mut Option<f64>) -> bool {
        let [shorter, longer] = GROWTH;
        let good = error <= self.tolerance || rejected == REJECTIONS;
        // a step that ends at a report may be shorter than it could be
        let before = next.filter(|before| good && dt < *before).unwrap_or(0.0);
        *next = Some((dt * (AIM * (self.root)(self.tolerance / error)).clamp(shorter, longer)).max(before));
        good
    }
}

/// A problem with moving fronts, as its time loop sees it.
pub trait Fronts: Sized {
    /// Fronts and what lies between them at one time.
    type State: Clone + Serialize + DeserializeOwned;

    /// What `summary.json` says of a state.
    type Report: Clone + Serialize + DeserializeOwned;

    /// What decides how long automatic steps are.
    const CONTROLLER: Controller;

    /// Names of the tables that grow with the run.
    const TABLES: &'static [&'static str];

    /// About how many fronts, evenly over the run, the picture over time shows; all where there is no number.
    const PICTURED: Option<usize>;

    /// Time of a state, and the number of steps that led to it.
    fn moment(state: &Self::State) -> Moment;

    /// Time of a report.
    fn reported(report: &Self::Report) -> f64;

    /// Places of the fronts: x of each, or the height of one at each column.
    fn places<'a>(&self, state: &'a Self::State) -> &'a [f64];

    /// Refuses what cannot be a state of the problem.
    ///
    /// # Errors
    /// [`Unfit::Damaged`].
    fn check(&self, state: &Self::State) -> Result<(), Unfit>;

    /// What a step to time `t` would come to.
    ///
    /// # Errors
    /// [`Error::Failed`](crate::Error::Failed), for which an automatic step is halved.
    fn attempt(&mut self, state: &Self::State, t: f64) -> Result<Attempt<Self::State>>;

    /// Length of the next automatic step in a run of length `span`. The controller has `chosen` one, except before the
    /// first step that has an estimated error; so many `halvings` of a step that failed came before.
    fn step_length(&self, state: &Self::State, chosen: Option<f64>, halvings: i32, span: f64) -> f64;

    /// Writes what the tables have above their first row.
    ///
    /// # Errors
    /// [`Error::Unwritable`](crate::Error::Unwritable).
    fn write_heads(&self, tables: &mut [Rows]) -> Result<()>;

    /// What is shown of a state; adds a row to each table.
    ///
    /// # Errors
    /// [`Error::Unwritable`](crate::Error::Unwritable); [`Error::Failed`](crate::Error::Failed) where there is no mesh.
    fn view<'a>(
        &'a self,
        state: &'a Self::State,
        progress: Progress,
        tables: &mut [Rows],
    ) -> Result<View<'a, Self::Report>>;

    /// The state as what can be drawn and written.
    ///
    /// # Errors
    /// [`Error::Failed`](crate::Error::Failed) where there is no mesh.
    fn scene(&self, state: &Self::State) -> Result<Scene>;

    /// Fronts over time, each with its time.
    fn picture(&self, title: &str, fronts: &[(f64, Vec<f64>)]) -> Picture;

    /// Writes arrays that the runner does not write.
    ///
    /// # Errors
    /// [`Error::Unwritable`](crate::Error::Unwritable).
    fn leave(&self, _state: &Self::State, _directory: &RunDirectory) -> Result<()> {
        Ok(())
    }

    /// All fronts up to now with their times, from the tables of a run whose picture shows only some.
    ///
    /// # Errors
    /// [`Unfit`] where the table is not there.
    fn written(&self, _directory: &Path) -> Result<Vec<(f64, Vec<f64>)>, Unfit> {
        Ok(Vec::new())
    }

    /// Why the last state may be wrong although nothing failed.
    fn doubt(&self, _state: &Self::State) -> Option<String> {
        None
    }
}

/// What a row of a table says beside the state.
#[derive(Debug, Clone, Copy)]
pub struct Progress {
    /// Length of the step that led to the state.
    pub dt: f64,
    /// Iterations of Newton's method since the start.
    pub newton_iterations: usize,
    /// Seconds since the start.
    pub seconds: f64,
}

/// What is shown of a state.
pub struct View<'a, R> {
    /// Its report.
    pub report: R,
    /// The smallest scaled Jacobian of a cell, or the width of the thinnest phase.
    pub smallest: f64,
    /// Positions of the nodes, where they are those of a mesh.
    pub nodes: Vec<[f64; 2]>,
    /// What can be drawn and written of it.
    pub scene: Box<dyn Fn() -> Scene + 'a>,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By cube roots: an error of 8 ε asks for .9/2 of the step, one of ε/1000 for 9 of them, of which two are granted.
    #[test]
    fn the_next_step_aims_at_the_tolerance() {
        let controller = Controller { tolerance: 1e-6, root: f64::cbrt, halvings: 6 };
        let judged = |error: f64, rejected: usize, before: Option<f64>| {
            let mut next = before;
            (controller.judge(0.1, error, rejected, &mut next), next.unwrap())
        };
        for (error, rejected, before, good, next) in [
            (8e-6, 0, None, false, 0.045),
            (1e-9, 0, None, true, 0.2),
            (1.0, 0, None, false, 0.02),
            // taken as it is at last
            (8e-6, REJECTIONS, None, true, 0.045),
            // cut short by a report, where whole steps were longer
            (1e-6, 0, Some(0.7), true, 0.7),
            (8e-6, 0, Some(0.7), false, 0.045),
        ] {
            let found = judged(error, rejected, before);
            assert!(found.0 == good && (found.1 - next).abs() < 1e-12, "{error:e} {rejected} {before:?}: {found:?}");
        }
    }
}
