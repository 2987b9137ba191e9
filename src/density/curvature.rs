use super::{Density, Monitor, Strength, check_smoothing, smooth};
use crate::error::{Failure, Result};
use crate::geometry::{Cells, Mesh, check_finite, check_length};
use crate::numerics::difference::Metrics;
use crate::numerics::{larger, sum};

/// Density by the curvature of the solution, which spreads the error of its linear interpolation evenly
///
/// ```text
/// ρ = (1 + α |H|²)^p,   p = 1/(D + 4),   |H|² = Σ_ij (∂²u/∂x_i ∂x_j)²
/// ```
///
/// followed by `smoothing` passes of the filter [`smooth`]. α ≥ 0 comes from `strength` and has the unit (x²/u)². With
/// `Relative(s)` it is s / ⟨|H|^2p⟩^(1/p), ⟨·⟩ being the mean over the domain: s = 1 gives about half of the nodes to
/// where u is curved, whatever the units and however thin its layers. α = 0, and u whose second differences are
/// rounding, give ρ = 1 and a uniform mesh.
///
/// Along an axis cells have the width 1/ρ, and the L² error of linear interpolation on N cells of width h, which is
/// (∫ h⁴ |H|² dx)^½, is smallest for given ∫ h^(−D) dx where h^(D + 4) |H|² is constant: that is p. As a density of
/// *volume*, in which the source writes it, ρ^D has the exponent D/(D + 4): 1/5 on a line, 1/3 in the plane.
///
/// Second derivatives are central differences in ξ of such differences, one-sided ones of second order at the sides.
///
/// # Example
/// ```
/// use driftmesh::{density::{Curvature, Monitor, Strength}, geometry::{Lattice, Mesh}};
/// let mesh = Mesh::uniform(Lattice::bounded([8])?, [0.0], [1.0])?;
/// let parabola: Vec<f64> = mesh.x().iter().map(|x| 4.0 * x[0] * x[0]).collect();
/// // u'' = 8 with α = 1/2 has ρ = (1 + 64/2)^(1/5) = 33^(1/5)
/// let rho = Curvature { strength: Strength::Absolute(0.5), smoothing: 2 }.density(&mesh, &parabola, None)?;
/// assert!(rho.largest().iter().all(|r| (r - 33_f64.powf(0.2)).abs() < 1e-12));
/// # Ok::<(), driftmesh::Error>(())
/// ```
///
/// # Source
/// Huang and Russell, *Adaptive Moving Mesh Methods*, Springer (2011), chapters 2 and 5.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Curvature {
    /// How α is chosen.
    pub strength: Strength,
    /// Passes of the filter (1 2 1)/4 along each axis.
    pub smoothing: usize,
}

/// Second differences of u over a cell that are below this share of its size are rounding: that of u itself is 1e-16,
/// and differences of differences on a mesh that is not even lose a few digits more.
const ROUNDING: f64 = 1e-12;

impl Default for Curvature {
    fn default() -> Self {
        Self { strength: Strength::Relative(1.0), smoothing: 2 }
    }
}

impl Curvature {
    /// Refuses settings out of range.
    ///
    /// # Errors
    /// [`Error::Invalid`](crate::Error::Invalid) where the strength is negative or not finite, or the smoothing beyond
    /// all reason.
    pub fn check(&self) -> Result<()> {
        self.strength.check()?;
        check_smoothing(self.smoothing)
    }

    /// α from |H|² at the nodes.
    fn alpha<const D: usize>(&self, areas: &[f64], curved2: &[f64]) -> f64 {
        let power = power::<D>();
        match self.strength {
            Strength::Absolute(alpha) => alpha,
            Strength::Relative(strength) => {
                let mean = sum(areas.iter().zip(curved2).map(|(area, h)| area * h.powf(power)));
                strength / (mean / sum(areas.iter().copied())).powf(1.0 / power)
            }
        }
    }
}

/// The exponent 1/(D + 4) of 1 + α |H|².
fn power<const D: usize>() -> f64 {
    1.0 / (D as f64 + 4.0)
}

impl<const D: usize> Monitor<D> for Curvature
where
    Mesh<D>: Cells<D>,
{
    fn density(&self, mesh: &Mesh<D>, u: &[f64], gradient: Option<&[[f64; D]]>) -> Result<Density, Failure> {
        self.check().map_err(Failure::refusing)?;
        check_length(mesh.lattice(), "what the mesh follows", u.len())?;
        if let Some(exact) = gradient {
            check_length(mesh.lattice(), "the gradient of what the mesh follows", exact.len())?;
        }
        let curved2 = squared(mesh, u, gradient);
        let areas = mesh.node_volumes();
        // over the width of a cell; u that is not finite has to be told of, so that NaN counts as curved
        let size = u.iter().map(|u| u.abs()).fold(0.0, larger);
        let bends = curved2.iter().zip(&areas).map(|(h, area)| h.sqrt() * area.powf(2.0 / D as f64));
        if bends.fold(0.0, larger) <= ROUNDING * size {
            return Ok(vec![1.0; u.len()].into());
        }
        let alpha = self.alpha::<D>(&areas, &curved2);
        let mut rho: Vec<f64> = curved2.into_iter().map(|h| (1.0 + alpha * h).powf(power::<D>())).collect();
        smooth(mesh.lattice(), &mut rho, self.smoothing)?;
        check_finite(["the mesh density"], mesh, rho.as_chunks().0)?;
        Ok(rho.into())
    }
}

/// |H|² at the nodes, H being the symmetric part of the gradient of the gradient.
fn squared<const D: usize>(mesh: &Mesh<D>, u: &[f64], gradient: Option<&[[f64; D]]>) -> Vec<f64> {
    let metrics = Metrics::new(mesh);
    let slopes = gradient.map_or_else(|| metrics.gradient(u), <[[f64; D]]>::to_vec);
    let second: [Vec<[f64; D]>; D] = std::array::from_fn(|c| {
        let slope: Vec<f64> = slopes.iter().map(|slope| slope[c]).collect();
        metrics.gradient(&slope)
    });
    let entry = |k: usize, i: usize, j: usize| 0.5 * (second[i][k][j] + second[j][k][i]);
    let at = |k: usize| (0..D).flat_map(|i| (0..D).map(move |j| (i, j))).map(|(i, j)| entry(k, i, j).powi(2)).sum();
    (0..u.len()).map(at).collect()
}
