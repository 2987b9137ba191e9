use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};

/// τ of the mesh equation: how long the mesh takes to follow its density across the domain
///
/// # Example
/// ```
/// use driftmesh::meshing::Relaxation;
/// assert_eq!(Relaxation::Time(0.5).over(1e-3), 0.5);
/// assert_eq!(Relaxation::Steps(25.0).over(1e-3), 0.025);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(untagged, expecting = "expected a number, or a table such as { steps = 25 }")]
pub enum Relaxation {
    /// In units of time.
    Time(f64),
    /// In units of the time step.
    #[serde(with = "steps")]
    Steps(f64),
}

/// Fewer steps than this and the mesh, whose density stands still during a step, overshoots from one to the next.
pub const STEPS_WORTH_A_WARNING: f64 = 15.0;
/// With fewer steps than this it folds on any thin layer.
const FEWEST_STEPS: f64 = 2.0;

/// `{ steps = 25 }`.
mod steps {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    #[derive(Serialize, Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Table {
        steps: f64,
    }

    pub fn serialize<S: Serializer>(steps: &f64, serializer: S) -> Result<S::Ok, S::Error> {
        Table { steps: *steps }.serialize(serializer)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
        Table::deserialize(deserializer).map(|table| table.steps)
    }
}

impl From<f64> for Relaxation {
    fn from(tau: f64) -> Self {
        Self::Time(tau)
    }
}

impl Relaxation {
    /// τ where the time step is `dt`.
    pub fn over(self, dt: f64) -> f64 {
        match self {
            Self::Time(tau) => tau,
            Self::Steps(steps) => steps * dt,
        }
    }

    /// The same τ in units of time, for a time step of `dt`.
    pub fn at(self, dt: f64) -> Self {
        Self::Time(self.over(dt))
    }

    /// Refuses settings out of range.
    ///
    /// # Errors
    /// [`Error::Invalid`] unless τ is positive and finite, and no less than two steps where it is given in steps.
    pub fn check(self) -> Result<()> {
        match self {
            Self::Time(tau) if tau.is_finite() && tau > 0.0 => Ok(()),
            Self::Time(tau) => Err(Error::invalid("relaxation", tau, "must be a finite number above 0")),
            Self::Steps(steps) if steps.is_finite() && steps >= FEWEST_STEPS => Ok(()),
            Self::Steps(steps) => {
                let rule = format!(
                    "must be at least {FEWEST_STEPS} steps, and {STEPS_WORTH_A_WARNING} or more for a mesh that does not overshoot"
                );
                Err(Error::invalid("relaxation.steps", steps, rule))
            }
        }
    }
}
