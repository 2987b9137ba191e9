use super::{Density, Monitor, check_smoothing, smooth};
use crate::error::{Error, Failure, Result};
use crate::geometry::{Mesh, check_finite, check_length};
use crate::numerics::difference::Metrics;
use crate::numerics::larger;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Arc-length density
///
/// ```text
/// ρ = √(1 + α |∇u|²)
/// ```
///
/// followed by `smoothing` passes of the filter [`smooth`]. α ≥ 0 comes from `strength` and has the unit (x/u)²; α = 0
/// gives ρ = 1 and a uniform mesh. ∇u is taken on the current mesh, by central differences in ξ and one-sided ones of
/// second order at the sides.
///
/// # Example
/// ```
/// use driftmesh::{density::{Arclength, Monitor, Strength}, geometry::{Lattice, Mesh}};
/// let mesh = Mesh::uniform(Lattice::bounded([4, 4])?, [0.0, 0.0], [1.0, 1.0])?;
/// let ramp: Vec<f64> = mesh.x().iter().map(|x| 2.0 * x[0]).collect();
/// // a ramp of slope 2 with α = 2 has ρ = √(1 + 2·2²) = 3
/// let rho = Arclength { strength: Strength::Absolute(2.0), smoothing: 2 }.density(&mesh, &ramp, None)?;
/// assert!(rho.largest().iter().all(|r| (r - 3.0).abs() < 1e-14));
/// # Ok::<(), driftmesh::Error>(())
/// ```
///
/// # Source
/// Huang and Russell, *Adaptive Moving Mesh Methods*, Springer (2011).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Arclength {
    /// How α is chosen.
    pub strength: Strength,
    /// Passes of the filter (1 2 1)/4 along each axis.
    pub smoothing: usize,
}

/// How α of a density is chosen: of √(1 + α |∇u|²), or of (1 + α |H|²)^p by the second derivatives H.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Strength {
    /// A number without unit: α is this over the largest |∇u|² at a node, or over a mean of |H|².
    Relative(f64),
    /// α itself, in the unit of (x/u)², of second derivatives (x²/u)².
    Absolute(f64),
}

impl Strength {
    /// Refuses a number out of range.
    pub(super) fn check(self) -> Result<()> {
        let (key, value) = match self {
            Self::Relative(value) => ("strength.relative", value),
            Self::Absolute(value) => ("strength.absolute", value),
        };
        match value.is_finite() && value >= 0.0 {
            true => Ok(()),
            false => Err(Error::invalid(key, value, "must be a finite number, 0 or more")),
        }
    }
}

impl Default for Arclength {
    fn default() -> Self {
        Self { strength: Strength::Relative(30.0), smoothing: 2 }
    }
}

impl Arclength {
    /// Refuses settings out of range.
    ///
    /// # Errors
    /// [`Error::Invalid`] where the strength is negative or not finite, or the smoothing beyond all reason.
    pub fn check(&self) -> Result<()> {
        self.strength.check()?;
        check_smoothing(self.smoothing)
    }
}

impl<const D: usize> Monitor<D> for Arclength {
    fn density(&self, mesh: &Mesh<D>, u: &[f64], gradient: Option<&[[f64; D]]>) -> Result<Density, Failure> {
        self.check().map_err(Failure::refusing)?;
        check_length(mesh.lattice(), "what the mesh follows", u.len())?;
        let differenced: Vec<[f64; D]>;
        let gradient = match gradient {
            Some(exact) => {
                check_length(mesh.lattice(), "the gradient of what the mesh follows", exact.len())?;
                exact
            }
            None => {
                differenced = Metrics::new(mesh).gradient(u);
                &differenced
            }
        };
        let slope2: Vec<f64> = gradient.iter().map(|g| g.iter().map(|g| g * g).sum()).collect();
        let alpha = match self.strength {
            Strength::Absolute(alpha) => alpha,
            Strength::Relative(strength) => {
                let steepest = slope2.iter().copied().fold(0.0, larger);
                if steepest > 0.0 { strength / steepest } else { 0.0 }
            }
        };
        let mut rho: Vec<f64> = slope2.into_iter().map(|s| (1.0 + alpha * s).sqrt()).collect();
        smooth(mesh.lattice(), &mut rho, self.smoothing)?;
        check_finite(["the mesh density"], mesh, rho.as_chunks().0)?;
        Ok(rho.into())
    }
}
