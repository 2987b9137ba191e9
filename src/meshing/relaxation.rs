use crate::error::{Error, Result};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The relaxation time τ of the mesh equation: how long the mesh takes to follow its density across the domain
///
/// # Example
/// ```
/// use driftmesh::meshing::Relaxation;
/// assert_eq!(Relaxation::Time(0.5).over(1e-3), 0.5);
/// assert_eq!(Relaxation::steps(25.0).over(1e-3), 0.025);
/// ```
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(from = "Written", into = "Written")]
pub enum Relaxation {
    /// Chosen from step to step by how the mesh moves, with a prediction: see [`Gait`](crate::mover::Gait).
    #[default]
    Auto,
    /// τ in units of time: how long the mesh takes to follow its density.
    Time(f64),
    /// τ in units of the time step.
    Steps(Steps),
}

/// A [`Relaxation`] as a study writes it.
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "expected \"auto\", a number, or a table such as { steps = 25 }")]
enum Written {
    /// Chosen from step to step by how the mesh moves.
    Auto(Word),
    /// τ in units of time: how long the mesh takes to follow its density.
    Time(f64),
    /// τ in units of the time step.
    Steps(Steps),
}

#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
enum Word {
    Auto,
}

impl From<Written> for Relaxation {
    fn from(written: Written) -> Self {
        match written {
            Written::Auto(Word::Auto) => Self::Auto,
            Written::Time(tau) => Self::Time(tau),
            Written::Steps(steps) => Self::Steps(steps),
        }
    }
}

impl From<Relaxation> for Written {
    fn from(relaxation: Relaxation) -> Self {
        match relaxation {
            Relaxation::Auto => Self::Auto(Word::Auto),
            Relaxation::Time(tau) => Self::Time(tau),
            Relaxation::Steps(steps) => Self::Steps(steps),
        }
    }
}

/// `{ steps = 40, prediction = 0.2 }`: τ in time steps, and a mesh that is predicted before it relaxes.
///
/// A mesh that only relaxes lags behind a moving density by what the density moves in τ. With a prediction every node
/// has a velocity v, which learns from the corrections made by the relaxation:
///
/// ```text
/// x* = xⁿ + Δt v,   xⁿ⁺¹ = the mesh equation's step from x*, with the density of xⁿ,   v ← v + γ (xⁿ⁺¹ − x*)/Δt
/// ```
///
/// This is an observer with gain γ. The lag behind a density that moves evenly vanishes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Steps {
    /// τ as a number of time steps, at least 2. How many are enough depends on how many cells resolve the thinnest
    /// layer.
    pub steps: f64,
    /// γ: the share of each correction that the velocity of a node learns, from 0 (no prediction) to ½. It needs a
    /// [`Mover`](crate::mover::Mover), as studies have; a generator used alone keeps no velocities, and refuses a γ
    /// above 0.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub prediction: f64,
}

fn is_zero(gain: &f64) -> bool {
    *gain == 0.0
}

/// τ in time steps at the first step of a mesh with τ = "auto".
pub const STEPS_TO_BEGIN_WITH: f64 = 40.0;
/// γ of a mesh with τ = "auto": the share of a correction that the velocity of a node learns in a step.
const PREDICTION_BY_ITSELF: f64 = 0.2;
/// Smallest τ/Δt that may be set: with less, a mesh folds on any thin layer.
const FEWEST_STEPS: f64 = 2.0;
/// Largest γ that may be set: with more, the mesh oscillates about the mesh that its density asks for.
const MOST_PREDICTION: f64 = 0.5;

impl From<f64> for Relaxation {
    fn from(tau: f64) -> Self {
        Self::Time(tau)
    }
}

impl Relaxation {
    /// τ in time steps, without a prediction.
    pub fn steps(steps: f64) -> Self {
        Self::Steps(Steps { steps, prediction: 0.0 })
    }

    /// γ of the prediction; 0 where there is none.
    pub fn prediction(self) -> f64 {
        match self {
            Self::Auto => PREDICTION_BY_ITSELF,
            Self::Time(_) => 0.0,
            Self::Steps(Steps { prediction, .. }) => prediction,
        }
    }

    /// τ for the time step `dt`; for [`Auto`](Self::Auto) that of the first step.
    pub fn over(self, dt: f64) -> f64 {
        match self {
            Self::Auto => STEPS_TO_BEGIN_WITH * dt,
            Self::Time(tau) => tau,
            Self::Steps(Steps { steps, .. }) => steps * dt,
        }
    }

    /// Refuses settings out of range.
    ///
    /// # Errors
    /// [`Error::Invalid`] unless τ is positive and finite, and at least two where it is given in time steps.
    pub fn check(self) -> Result<()> {
        match self {
            Self::Auto => Ok(()),
            Self::Time(tau) if tau.is_finite() && tau > 0.0 => Ok(()),
            Self::Time(tau) => Err(Error::invalid("relaxation", tau, "must be a finite number above 0")),
            Self::Steps(Steps { prediction, .. }) if !(0.0..=MOST_PREDICTION).contains(&prediction) => {
                Err(Error::invalid(
                    "relaxation.prediction",
                    prediction,
                    format!("must be between 0, for none, and {MOST_PREDICTION}"),
                ))
            }
            Self::Steps(Steps { steps, .. }) if steps.is_finite() && steps >= FEWEST_STEPS => Ok(()),
            Self::Steps(Steps { steps, .. }) => {
                let rule =
                    format!("must be at least {FEWEST_STEPS} steps; \"auto\" finds how many a mesh takes to rest");
                Err(Error::invalid("relaxation.steps", steps, rule))
            }
        }
    }
}
