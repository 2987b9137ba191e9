//! Studies of kind `equidistribution`: what they say.

use super::common::{Header, Output};
use super::data::DataTables;
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
    /// Name and kind of the study.
    pub study: Header,
    /// Tables of values from files, which every formula may call as functions by their names.
    #[serde(default, skip_serializing_if = "DataTables::is_empty")]
    pub data: DataTables,
    /// The ends of the line; 0 and 1 where nothing is said.
    #[serde(default)]
    pub domain: LineDomain,
    /// The number of cells of the line.
    pub grid: LineGrid,
    /// The density M > 0 of the mesh: every cell gets the same ∫M dx.
    pub density: LineDensityKind,
    /// How the equidistribution of the density M is discretised.
    #[serde(default)]
    pub equidistribution: Discretization,
    /// Schwarz's method: how the line is divided into subdomains and what they exchange; one solve on the whole line
    /// where it is left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub schwarz: Option<SchwarzTable>,
    /// The mesh from which the iteration begins.
    #[serde(default)]
    pub start: Start,
    /// When the iteration between subdomains ends.
    #[serde(default)]
    pub stop: StopTable,
    /// Times of a mesh that moves by x_t = (1/τ)(M x_ξ)_ξ; where it is left out the mesh is steady.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time: Option<LineTime>,
    /// What a run leaves behind in its directory.
    #[serde(default)]
    pub output: Output,
}

/// `[domain]`: the ends of the line.
#[derive(Debug, Clone, Copy, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct LineDomain {
    /// The left end of the line.
    #[serde(deserialize_with = "fixed")]
    pub lower: [f64; 1],
    /// The right end of the line.
    #[serde(deserialize_with = "fixed")]
    pub upper: [f64; 1],
}

impl Default for LineDomain {
    fn default() -> Self {
        Self { lower: [0.0], upper: [1.0] }
    }
}

/// `[grid]`: the number of cells of the line.
#[derive(Debug, Clone, Copy, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LineGrid {
    /// Number of cells of the line, of equal width in ξ.
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
    /// The density M > 0, a formula of x and t; cells get equal ∫M dx.
    pub value: String,
}

/// `[density]` of kind `arclength`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LineArclength {
    /// The function u, a formula of x and t, whose arc length √(1 + u_x²) is the density.
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

/// `[equidistribution]`: how the equidistribution of the density M is discretised.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Discretization {
    /// How the density M is averaged over a cell: by the trapezoidal rule, by the midpoint rule, or exactly by its
    /// integral.
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
    /// What neighbouring subdomains exchange: the positions of their end nodes (classical), the flux of the rest of the
    /// line (optimal), or Robin conditions (optimized).
    pub method: MethodName,
    /// Order in which subdomains are solved: all at once (parallel), or from left to right (alternating). Only with the
    /// method classical.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sweep: Option<Sweep>,
    /// Takes the density M from the previous iterate, so that a subdomain costs one linear solve. Only with the method
    /// classical; false where nothing is said.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub linearized: Option<bool>,
    /// A correction of all subdomains at once after each iteration: "integral" corrects ∫M, "galerkin" the nodes x; or
    /// "none". Only with the method classical.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub coarse: Option<Coarse>,
    /// Parameter p > 0 of the Robin conditions F ± p x, with the flux F = M x_ξ: a number, "auto" or "lagged". Only
    /// with the method optimized.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub robin: Option<Robin>,
    /// How ∫M over the rest of the line is computed, exactly or by trapezoids. Only with the method optimal.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub integral: Option<Integral>,
    /// Divides the line into two subdomains, `[0, β]` and `[α, 1]` in ξ, given as `[α, β]`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub overlap: Option<Interval>,
    /// Divides the line into any number of overlapping subdomains, given as intervals of ξ from left to right.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub intervals: Option<Vec<Interval>>,
    /// Divides the line into two subdomains that meet at this ξ.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cut: Option<f64>,
    /// Divides the line into subdomains that meet at these values of ξ.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cuts: Option<Vec<f64>>,
    /// Divides the line into this number of subdomains of equal width in ξ.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub subdomains: Option<usize>,
    /// Number of cells that neighbouring subdomains of equal width share; 0, so that they meet, where nothing is said.
    /// Only with `subdomains`.
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
    /// Positions of the end nodes of subdomains that overlap.
    #[default]
    Classical,
    /// The flux of the rest of the line, at cuts where subdomains meet.
    Optimal,
    /// F ± p x at cuts where subdomains meet, with the flux F = M x_ξ.
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

/// How ∫M over the rest of the line on either side of a cut is computed.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Integral {
    /// To round-off.
    #[default]
    Exact,
    /// By the trapezoidal rule with this number of panels.
    Trapezoid(usize),
}

/// `[start]`: the mesh from which the iteration begins.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Start {
    /// The mesh from which the iteration begins: "uniform", "equidistributed" or a formula. Where nothing is said it is
    /// equidistributed if the mesh moves in time, else uniform.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mesh: Option<FirstMesh>,
}

/// The mesh from which the iteration begins.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum FirstMesh {
    /// Equal cells.
    Uniform,
    /// The discrete solution on the whole line, at the first time.
    Equidistributed,
    /// A formula of xi that rises from 0 at xi = 0 to 1 at xi = 1: the place of a node as a share of the line.
    Formula(String),
}

/// `[stop]`: when the iteration between subdomains ends.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct StopTable {
    /// Number of iterations; the most, where a tolerance is given. 500 where nothing is said.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub iterations: Option<usize>,
    /// The iterations end once `measure` is at most this share of the length of the line. 1e-10 where neither this nor
    /// `iterations` is given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tolerance: Option<f64>,
    /// What `tolerance` is compared with: "error", the largest distance of a node from its place in the mesh of the
    /// whole line, or "increment", the largest change of a node in an iteration.
    pub measure: Measure,
}

/// `[time]`: x_t = (1/τ)(M x_ξ)_ξ by backward Euler.
#[derive(Debug, Clone, Copy, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LineTime {
    /// Time of the first mesh.
    pub start: f64,
    /// Time of the last mesh.
    pub end: f64,
    /// Longest time step; the run is divided into equal steps.
    pub step: f64,
    /// Relaxation time τ > 0 in x_t = (1/τ)(M x_ξ)_ξ: how long the mesh takes to follow its density.
    pub relaxation: f64,
}
