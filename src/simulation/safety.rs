//! What is done where a step fails: the mesh in smaller steps, a smoother density, a shorter step.

use super::coupling::{Advanced, Stretch, attempt};
use super::{Record, Simulation, State, pace};
use crate::error::{Error, Failure, Result};
use crate::geometry::Mesh;
use crate::meshing::Movable;
use crate::mover::Care;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `[safety]`: in which ways, and how often, a step that fails is tried again
///
/// Where the mesh of a step folds, or its equation cannot be solved, the mesh goes to the new time in 2, 4, …
/// `substeps` parts, with ρ carried along. Where that does not help, ρ is smoothed by 2, 4, … `smoothing` further
/// passes before it moves the mesh. Where that does not help either, or the equation on the mesh fails, the time step
/// is halved, `halvings` times at most; a step of a fixed length is then done in parts that meet its end exactly. When
/// all tries have failed the run ends with the failure of the step. With `mesh.relaxation = "auto"` a step in which the
/// solution changes at the nodes by more than three hundredths of its range is done in such parts, too: there the mesh
/// has fallen behind. τ is a multiple of each part then.
///
/// # Example
/// ```
/// use driftmesh::simulation::Safety;
/// assert_eq!(Safety::default(), Safety { substeps: 8, smoothing: 8, halvings: 6 });
/// assert_eq!(Safety::OFF, Safety { substeps: 1, smoothing: 0, halvings: 0 });
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Safety {
    /// Largest number of parts into which a step of the mesh is divided where it fails, from 1, for none, to 64.
    pub substeps: usize,
    /// Largest number of further smoothing passes over the density ρ where a step of the mesh fails, from 0, for none,
    /// to 1000.
    pub smoothing: usize,
    /// How often a time step that fails is halved at most, from 0, for never, to 30.
    pub halvings: usize,
}

/// Steps that were tried again, by what was tried.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Retries {
    /// Steps tried again with the mesh in more parts.
    pub substeps: usize,
    /// Steps tried again with a smoother density.
    pub smoothed: usize,
    /// Steps tried again with a shorter time step.
    pub shortened: usize,
}

/// Largest number of parts of a step of the mesh: with more it costs more than shorter time steps do.
const MOST_SUBSTEPS: usize = 64;
/// Largest number of further passes of the filter over ρ: a density is constant to the eye after fewer.
const MOST_SMOOTHING: usize = 1000;
/// Largest number of halvings of a time step: 2⁻³⁰ of it makes no progress.
const MOST_HALVINGS: usize = 30;

impl Default for Safety {
    fn default() -> Self {
        Self { substeps: 8, smoothing: 8, halvings: 6 }
    }
}

impl Safety {
    /// Nothing is tried again: the first failure ends a run.
    pub const OFF: Self = Self { substeps: 1, smoothing: 0, halvings: 0 };

    /// Refuses settings out of range.
    ///
    /// # Errors
    /// [`Error::Invalid`].
    pub fn check(&self) -> Result<()> {
        for (key, value, range) in [
            ("substeps", self.substeps, 1..=MOST_SUBSTEPS),
            ("smoothing", self.smoothing, 0..=MOST_SMOOTHING),
            ("halvings", self.halvings, 0..=MOST_HALVINGS),
        ] {
            if !range.contains(&value) {
                let rule = format!("must be between {} and {}", range.start(), range.end());
                return Err(Error::invalid(key, value, rule));
            }
        }
        Ok(())
    }

    /// How far a step of the mesh is tried again.
    pub(super) fn care(self) -> Care {
        Care { substeps: self.substeps, smoothing: self.smoothing }
    }
}

/// One step in 2^`parts` parts, or in as many as it takes; with the halvings that it took.
///
/// # Errors
/// The failure of the last part that was tried.
pub(super) fn divided<const D: usize>(
    simulation: &mut Simulation<D>,
    state: &State<D>,
    stretch: Stretch,
    [parts, done]: [usize; 2],
    record: &mut Record,
) -> Result<(Advanced<D>, usize), Failure>
where
    Mesh<D>: Movable<D>,
{
    if parts == 0 {
        match attempt(simulation, state, stretch, record) {
            Ok(advanced) if done == simulation.safety.halvings || !pace::rushed(simulation, state, &advanced.state) => {
                return Ok((advanced, 0));
            }
            Err(failure) if done == simulation.safety.halvings || !failure.is_curable() => return Err(failure),
            _ => {
                record.work.rejected_steps += 1;
                record.safety.shortened += 1;
            }
        }
    }
    let half = 0.5 * stretch.dt;
    let scale = 0.5 * stretch.scale;
    let to_middle = Stretch { t: state.t + half, dt: half, scale, ..stretch };
    let (first, took) = divided(simulation, state, to_middle, [parts.saturating_sub(1), done + 1], record)?;
    let to_end = Stretch { dt: half, scale, ..stretch };
    let (mut second, takes) = divided(simulation, &first.state, to_end, [took, done + 1], record)?;
    second.work += first.work;
    second.state.step = state.step + 1;
    Ok((second, 1 + took.max(takes)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nonsense_is_refused_by_name() {
        for (safety, named) in [
            (Safety { substeps: 0, ..Safety::default() }, "substeps"),
            (Safety { smoothing: 1001, ..Safety::default() }, "smoothing"),
            (Safety { halvings: 31, ..Safety::default() }, "halvings"),
        ] {
            assert!(matches!(safety.check(), Err(Error::Invalid { key, .. }) if key == named));
        }
        assert!(Safety::OFF.check().is_ok() && Safety::default().check().is_ok());
    }
}
