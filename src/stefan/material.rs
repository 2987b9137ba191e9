use super::columns::{LOWER, UPPER};
use crate::error::{Error, Result};

/// What conducts and stores heat in both phases, and what melting takes
///
/// ```text
/// C_i ∂u_i/∂t = k_i Δu_i,      u = T_m on the front,      Λ V = k₀ ∂u₀/∂n − k₁ ∂u₁/∂n,      D_i = k_i / C_i
/// ```
///
/// V is the speed of the front along its normal n, which points up. Units are free as long as they belong together: k
/// in W/(m K), C in J/(m³ K) and Λ in J/m³ give metres and seconds.
///
/// # Example
/// ```
/// use driftmesh::stefan::Material;
/// // k = D and C = 1 with Λ = 1/L is the problem in terms of diffusivities and a mobility
/// let material = Material::diffusing([1.0, 2.0], 4.0)?;
/// assert_eq!((material.latent_heat, material.diffusivity(1)), (0.25, 2.0));
/// # Ok::<(), driftmesh::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Material {
    /// k of the lower and of the upper phase.
    pub conductivity: [f64; 2],
    /// C of the lower and of the upper phase: heat for each volume and degree.
    pub capacity: [f64; 2],
    /// Λ: heat for each volume that melts.
    pub latent_heat: f64,
    /// T_m, the temperature of the front.
    pub melting: f64,
}

impl Material {
    /// Refuses what is not positive, and a melting temperature that is not finite.
    ///
    /// # Errors
    /// [`Error::Invalid`] names the key.
    pub fn new(conductivity: [f64; 2], capacity: [f64; 2], latent_heat: f64, melting: f64) -> Result<Self> {
        positive("phase.lower.conductivity", conductivity[LOWER], "must be above 0")?;
        positive("phase.upper.conductivity", conductivity[UPPER], "must be above 0")?;
        positive("phase.lower.capacity", capacity[LOWER], "must be above 0: heat for each volume and degree")?;
        positive("phase.upper.capacity", capacity[UPPER], "must be above 0: heat for each volume and degree")?;
        positive("front.latent_heat", latent_heat, "must be above 0: heat for each volume that melts")?;
        if !melting.is_finite() {
            return Err(Error::invalid("front.melting", melting, "must be a finite number"));
        }
        Ok(Self { conductivity, capacity, latent_heat, melting })
    }

    /// k = D, C = 1, Λ = 1/L and T_m = 0.
    ///
    /// # Errors
    /// [`Error::Invalid`] unless diffusivities and mobility are positive.
    pub fn diffusing(diffusivity: [f64; 2], mobility: f64) -> Result<Self> {
        positive("phase.lower.diffusivity", diffusivity[LOWER], "must be above 0")?;
        positive("phase.upper.diffusivity", diffusivity[UPPER], "must be above 0")?;
        positive("front.mobility", mobility, "must be above 0: it is the inverse of the latent heat")?;
        Ok(Self { conductivity: diffusivity, capacity: [1.0; 2], latent_heat: 1.0 / mobility, melting: 0.0 })
    }

    /// D = k/C of a phase.
    pub fn diffusivity(&self, phase: usize) -> f64 {
        self.conductivity[phase] / self.capacity[phase]
    }
}

fn positive(key: &str, value: f64, rule: &str) -> Result<()> {
    match value > 0.0 && value.is_finite() {
        true => Ok(()),
        false => Err(Error::invalid(key, value, rule)),
    }
}
