use super::{MAX_SMOOTHING, Monitor, smooth};
use crate::error::{Error, Failure, Result};
use crate::geometry::Mesh;
use crate::numerics::difference::Gradient;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The first unknown, or what is followed in its place, is the density itself: a prescribed ρ, or a depth of water
///
/// It must be positive everywhere; `smoothing` passes of the filter [`smooth`] follow.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Given {
    /// The unknown, or a formula of the unknowns, x, y and t, that the mesh follows; the first unknown where nothing is
    /// said.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub of: Option<String>,
    /// Passes of the (1 2 1)⊗(1 2 1)/16 filter.
    pub smoothing: usize,
    /// How the mesh equation differences ρ.
    pub gradient: Gradient,
}

impl Given {
    /// Refuses settings out of range.
    ///
    /// # Errors
    /// [`Error::Invalid`] where the smoothing is beyond all reason.
    pub fn check(&self) -> Result<()> {
        if self.smoothing > MAX_SMOOTHING {
            return Err(Error::invalid("smoothing", self.smoothing, format!("must be at most {MAX_SMOOTHING} passes")));
        }
        Ok(())
    }
}

impl Monitor for Given {
    fn density(&self, mesh: &Mesh<2>, u: &[f64], _gradient: Option<&[[f64; 2]]>) -> Result<Vec<f64>, Failure> {
        if let Some(k) = u.iter().position(|rho| !(rho.is_finite() && *rho > 0.0)) {
            let (what, value, node, x) = ("the mesh density", u[k], mesh.lattice().node(k), mesh.x()[k]);
            return Err(match value.is_finite() {
                true => Failure::NotPositive { what, value, node, x },
                false => Failure::NonFinite { what, value, node, x },
            });
        }
        let mut rho = u.to_vec();
        smooth(mesh.lattice(), &mut rho, self.smoothing);
        Ok(rho)
    }
}
