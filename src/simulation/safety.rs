use crate::error::{Error, Result};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `[safety]`: what is tried before a run ends, where the mesh folds or a solve fails
///
/// No folded mesh is ever accepted. A mesh step that folds, or that cannot be solved, is repeated from the same mesh: in 2, 4, 8 …
/// sub-steps, ρ carried along, so that the mesh follows ρ(x) rather than ρ(ξ); then so, with 2, 4, 8 … more passes of the
/// filter over ρ. Where that does not help, or the physics fails, the time step is done in halves, these in halves, and
/// so on. Automatic steps are shortened instead as far as they can be.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Safety {
    /// How often the number of mesh sub-steps may double.
    pub substeps: u32,
    /// How often the further passes of the filter may double, from one.
    pub smoothing: u32,
    /// How often a time step may be halved.
    pub halvings: u32,
}

impl Default for Safety {
    fn default() -> Self {
        Self { substeps: 3, smoothing: 3, halvings: 4 }
    }
}

/// Most of each.
const MOST: u32 = 12;

impl Safety {
    /// The first failure ends the run.
    pub const NONE: Self = Self { substeps: 0, smoothing: 0, halvings: 0 };

    /// Refuses settings out of range.
    ///
    /// # Errors
    /// [`Error::Invalid`] above 12: that is thousands of parts.
    pub fn check(&self) -> Result<()> {
        for (key, value) in [("substeps", self.substeps), ("smoothing", self.smoothing), ("halvings", self.halvings)] {
            if value > MOST {
                return Err(Error::invalid(key, value, format!("must be at most {MOST}: each doubles the work")));
            }
        }
        Ok(())
    }

    /// Mesh sub-steps and further passes of the filter, attempt by attempt.
    pub(super) fn attempts(self) -> impl Iterator<Item = [usize; 2]> {
        let divided = (0..=self.substeps).map(|n| [1 << n, 0]);
        divided.chain((1..=self.smoothing).map(move |n| [1 << self.substeps, 1 << n]))
    }
}

/// What `[safety]` had to do.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Rescues {
    /// Mesh steps that were done in sub-steps.
    pub substeps: usize,
    /// Those among them that took a smoother density.
    pub smoothed: usize,
    /// Time steps that were done in halves, halves of halves included.
    pub halved: usize,
}

impl Rescues {
    /// What to tell the user, if anything.
    pub(super) fn told(&self) -> Option<String> {
        let Self { substeps, smoothed, halved } = self;
        (substeps + halved > 0).then(|| {
            format!(
                "{SAFETY}: the mesh would have folded, or a step failed: {substeps} mesh steps were done in sub-steps, {smoothed} of \
                 them with a smoother density, and {halved} time steps in halves; a shorter time.step, more monitor.smoothing or a \
                 longer mesh.relaxation need less of it"
            )
        })
    }
}

/// Begins the warning.
pub(super) const SAFETY: &str = "`[safety]`";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn attempts_grow() {
        let all = |safety: Safety| safety.attempts().collect::<Vec<_>>();
        assert_eq!(all(Safety::NONE), [[1, 0]]);
        assert_eq!(all(Safety { substeps: 2, smoothing: 2, halvings: 0 }), [[1, 0], [2, 0], [4, 0], [4, 2], [4, 4]]);
        assert!(Safety { halvings: 13, ..Safety::default() }.check().is_err());
    }
}
