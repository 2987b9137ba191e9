//! Studies of kind `equidistribution`: what they say.

use super::common::{Header, Output};
use crate::equidistribution::{Coarse, FaceDensity, LineDensity, Measure, Robin, Sweep};
use crate::error::{Error, Result};
use crate::kind::kinds;
use crate::setting::{fixed, pair};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A study of kind `equidistribution`: a mesh on a line, and the Schwarz methods for it.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EquidistributionStudy {
    /// `[study]`.
    pub study: Header,
    /// `[domain]`.
    #[serde(default)]
    pub domain: LineDomain,
    /// `[grid]`.
    pub grid: LineGrid,
    /// `[density]`.
    pub density: LineDensityKind,
    /// `[equidistribution]`.
    #[serde(default)]
    pub equidistribution: Discretization,
    /// `[schwarz]`; one solve on the whole line where it is left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub schwarz: Option<SchwarzTable>,
    /// `[start]`.
    #[serde(default)]
    pub start: Start,
    /// `[stop]`.
    #[serde(default)]
    pub stop: StopTable,
    /// `[time]`: the mesh moves.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time: Option<LineTime>,
    /// `[output]`.
    #[serde(default)]
    pub output: Output,
}

/// `[domain]`: the ends of the line.
#[derive(Debug, Clone, Copy, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct LineDomain {
    /// Where it begins.
    #[serde(deserialize_with = "fixed")]
    pub lower: [f64; 1],
    /// Where it ends.
    #[serde(deserialize_with = "fixed")]
    pub upper: [f64; 1],
}

impl Default for LineDomain {
    fn default() -> Self {
        Self { lower: [0.0], upper: [1.0] }
    }
}

/// `[grid]`.
#[derive(Debug, Clone, Copy, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LineGrid {
    /// Cells of the line.
    #[serde(deserialize_with = "fixed")]
    pub cells: [usize; 1],
}

kinds! {
    /// The density of a line, as a study names it.
    LineDensityKind {
        "formula" = LineFormula: "M itself, a formula of x and t",
        "arclength" = LineArclength: "√(1 + u_x²) for u, a formula of x and t",
    }
}

/// `[density]` of kind `formula`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LineFormula {
    /// M.
    pub value: String,
}

/// `[density]` of kind `arclength`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LineArclength {
    /// u.
    pub of: String,
}

impl LineDensityKind {
    /// The density itself.
    ///
    /// # Errors
    /// [`Error::Formula`].
    pub fn density(&self) -> Result<LineDensity> {
        match self {
            Self::LineFormula(LineFormula { value }) => LineDensity::formula(value),
            Self::LineArclength(LineArclength { of }) => LineDensity::arclength(of),
        }
    }

    pub(super) fn setting(&self) -> (&'static str, &str) {
        match self {
            Self::LineFormula(LineFormula { value }) => ("density.value", value),
            Self::LineArclength(LineArclength { of }) => ("density.of", of),
        }
    }
}

/// `[equidistribution]`.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Discretization {
    /// Mean of M over a cell.
    pub face_density: FaceDensity,
    /// Places where M may have spikes that are too thin to be found among a few thousand equal parts of the line.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub points: Vec<f64>,
}

impl Discretization {
    /// Refuses points that are not on the line.
    ///
    /// # Errors
    /// [`Error::Invalid`].
    pub fn check(&self, [a, b]: [f64; 2]) -> Result<()> {
        match self.points.iter().find(|x| !(a..=b).contains(x)) {
            None => Ok(()),
            Some(x) => Err(Error::invalid("points", x, format!("must lie on the line, from {a} to {b}"))),
        }
    }
}

/// `[schwarz]`: a method with its options, and one way to divide the line.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SchwarzTable {
    /// What is exchanged.
    pub method: MethodName,
    /// In which order; classical.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sweep: Option<Sweep>,
    /// M of the last iterate; classical.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub linearized: Option<bool>,
    /// Between sweeps; classical.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub coarse: Option<Coarse>,
    /// p; optimized.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub robin: Option<Robin>,
    /// Of S₁ and S₂; optimal.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub integral: Option<Integral>,
    /// Two subdomains, \[0, β\] and \[α, 1\], as \[α, β\].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub overlap: Option<Interval>,
    /// Any that overlap.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub intervals: Option<Vec<Interval>>,
    /// Two that meet.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cut: Option<f64>,
    /// Any that meet.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cuts: Option<Vec<f64>>,
    /// So many of equal width.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub subdomains: Option<usize>,
    /// What these overlap by.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub overlap_cells: Option<usize>,
}

/// Two places in ξ.
#[derive(Debug, Clone, Copy, Serialize, Deserialize, JsonSchema)]
pub struct Interval(#[serde(deserialize_with = "pair")] pub [f64; 2]);

/// What subdomains exchange.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum MethodName {
    /// Values.
    #[default]
    Classical,
    /// The flux of the rest of the domain.
    Optimal,
    /// F ± p x.
    Optimized,
}

impl MethodName {
    /// Name and description of every method.
    pub const KINDS: &[(&str, &str)] = &[
        ("classical", "overlapping subdomains with each other's values at their ends"),
        ("optimal", "the flux of the rest of the domain at cuts: with exact faces as many iterations as subdomains"),
        ("optimized", "F ± p x at cuts, with p given, \"auto\" or \"lagged\""),
    ];
}

/// How S₁ and S₂ are integrated.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Integral {
    /// To round-off.
    #[default]
    Exact,
    /// By so many panels.
    Trapezoid(usize),
}

/// `[start]`.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Start {
    /// The first mesh; equidistributed where the mesh moves, else uniform.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mesh: Option<FirstMesh>,
}

/// The first mesh.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum FirstMesh {
    /// Equal cells.
    Uniform,
    /// The discrete solution on the whole line, at the first time.
    Equidistributed,
    /// A formula of xi from 0 to 1, between the ends of the line.
    Formula(String),
}

/// `[stop]`.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct StopTable {
    /// So many; at most so many where there is a tolerance.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub iterations: Option<usize>,
    /// Of what is measured.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tolerance: Option<f64>,
    /// What is measured.
    pub measure: Measure,
}

/// `[time]`: x_t = (1/τ)(M x_ξ)_ξ by backward Euler.
#[derive(Debug, Clone, Copy, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LineTime {
    /// Time of the first mesh.
    pub start: f64,
    /// Time of the last.
    pub end: f64,
    /// Longest step; steps are equal.
    pub step: f64,
    /// τ.
    pub relaxation: f64,
}
