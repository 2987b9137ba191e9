//! `[monitor]` of a study: a density, what the mesh follows, and how the mesh equation differences it.

use super::{Arclength, CellSizes, Curvature, Given, Strength};
use crate::numerics::difference::Gradient;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A [`RootGradient`](super::RootGradient) as a study writes it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RootGradientTable {
    /// The unknown, or a formula of the unknowns, x, y and t, that the mesh follows; where nothing is said all
    /// unknowns, each in units of its range.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub of: Option<String>,
    /// How small and how large cells may be, as shares of an equal cell; without limits where nothing is said.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cells: Option<CellSizes>,
}

/// An [`Arclength`] as a study writes it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ArclengthTable {
    /// The unknown, or a formula of the unknowns, x, y and t, that the mesh follows; the first unknown where nothing is
    /// said.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub of: Option<String>,
    /// How α of the density √(1 + α |∇u|²) is chosen: relative to the steepest slope, or absolute.
    pub strength: Strength,
    /// Passes of the filter (1 2 1)/4 along each axis, which smooth the density.
    pub smoothing: usize,
    /// How the mesh equation differences the density ρ; it matters with `mesh.form = "gradient"` alone.
    pub gradient: Gradient,
    /// How small and how large cells may be, as shares of an equal cell; without limits where nothing is said.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cells: Option<CellSizes>,
}

impl Default for ArclengthTable {
    fn default() -> Self {
        let Arclength { strength, smoothing } = Arclength::default();
        Self { of: None, strength, smoothing, gradient: Gradient::Central, cells: None }
    }
}

impl ArclengthTable {
    /// The density.
    pub(super) fn density(&self) -> Arclength {
        Arclength { strength: self.strength, smoothing: self.smoothing }
    }
}

/// A [`Curvature`] as a study writes it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct CurvatureTable {
    /// The unknown, or a formula of the unknowns, x, y and t, that the mesh follows; the first unknown where nothing is
    /// said.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub of: Option<String>,
    /// How α of the density (1 + α |H|²)^p is chosen: relative to the mean curvature, or absolute.
    pub strength: Strength,
    /// Passes of the filter (1 2 1)/4 along each axis, which smooth the density.
    pub smoothing: usize,
    /// How the mesh equation differences the density ρ; it matters with `mesh.form = "gradient"` alone.
    pub gradient: Gradient,
    /// How small and how large cells may be, as shares of an equal cell; without limits where nothing is said.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cells: Option<CellSizes>,
}

impl Default for CurvatureTable {
    fn default() -> Self {
        let Curvature { strength, smoothing } = Curvature::default();
        Self { of: None, strength, smoothing, gradient: Gradient::Central, cells: None }
    }
}

impl CurvatureTable {
    /// The density.
    pub(super) fn density(&self) -> Curvature {
        Curvature { strength: self.strength, smoothing: self.smoothing }
    }
}

/// A [`Given`] as a study writes it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct GivenTable {
    /// The unknown, or a formula of the unknowns, x, y and t, that the mesh follows; the first unknown where nothing is
    /// said.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub of: Option<String>,
    /// Passes of the filter (1 2 1)/4 along each axis, which smooth the density.
    pub smoothing: usize,
    /// How the mesh equation differences the density ρ; it matters with `mesh.form = "gradient"` alone.
    pub gradient: Gradient,
    /// How small and how large cells may be, as shares of an equal cell; without limits where nothing is said.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cells: Option<CellSizes>,
}

impl GivenTable {
    /// The density.
    pub(super) fn density(&self) -> Given {
        Given { smoothing: self.smoothing }
    }
}
