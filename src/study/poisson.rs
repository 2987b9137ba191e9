//! Studies of kind `poisson`: what they say.

use super::common::{Header, Output, StudyKind};
use super::data::DataTables;
use super::kind::{Kind, common_tables};
use super::mapped::{Grading, MappedDomain, Side};
use super::poisson_run::PoissonRun;
use crate::error::{Error, Result};
use crate::geometry::Mesh;
use crate::laplacian::{Laplacian, Polynomials, Scaling};
use crate::output::FramesAt;
use crate::physics::Conditions;
use crate::setting::{Text, pair, text};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A study of kind `poisson`: ∇·(D ∇u) = f on a structured mesh of any shape.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PoissonStudy {
    /// Name and kind of the study.
    pub study: Header,
    /// Tables of values from files, which every formula may call as functions by their names.
    #[serde(default, skip_serializing_if = "DataTables::is_empty")]
    pub data: DataTables,
    /// The shape of the domain, and how its mesh is distorted.
    pub domain: MappedDomain,
    /// The number of cells, and a side toward which they get smaller.
    pub grid: GradedGrid,
    /// The exact solution, against which errors are reported; it gives whatever `[equation]` does not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub exact: Option<ExactSolution>,
    /// The right-hand side and the diffusivity of ∇·(D ∇u) = f, and what holds on the sides.
    #[serde(default)]
    pub equation: Equation,
    /// The sides on which the normal derivative is given.
    #[serde(default)]
    pub sides: Sides,
    /// The discrete Laplacian, whose weights follow from the positions of the neighbours of a node; where nothing is
    /// said "optimised", and "mapped" with a diffusivity.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub laplacian: Option<LaplacianTable>,
    /// How the linear system is solved.
    #[serde(default)]
    pub solver: SolverTable,
    /// What a run leaves behind in its directory.
    #[serde(default)]
    pub output: Output,
}

/// `[grid]`: the number of cells, and a side toward which they get smaller.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GradedGrid {
    /// Number of cells along s and along r, the coordinates of the unit square.
    #[serde(deserialize_with = "pair")]
    pub cells: [usize; 2],
    /// Makes cells smaller toward a side; equal cells of the unit square where nothing is said.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub grading: Option<Grading>,
}

/// `[exact]`: the exact solution.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ExactSolution {
    /// The exact solution, a formula of x and y; it gives the values on the sides, the right-hand side and the error.
    pub u: String,
}

/// `[equation]`: formulas of x and y.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Equation {
    /// Right-hand side f of ∇·(D ∇u) = f, a formula of x and y; that of `exact.u` where nothing is said.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub source: Option<String>,
    /// D > 0, a formula of x and y; 1 where nothing is said.
    #[serde(skip_serializing_if = "Option::is_none", deserialize_with = "text")]
    #[schemars(with = "Option<Text>")]
    pub diffusivity: Option<String>,
    /// What holds on the sides: u, a formula of x and y; `"no-flux"`; or `{ flux = "…" }`, what flows into the domain,
    /// D n·∇u with n outward, a formula of x, y and u that is linear in u. One for all sides, or a table of them by
    /// side: `left`, `right`, `bottom`, `top`. u = `exact.u` where nothing is said.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub boundary: Option<Conditions>,
    /// D n·∇u, n outward, on the sides of `sides.neumann`, a formula of x, y and u; that of `exact.u` where nothing is
    /// said.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub flux: Option<String>,
    /// The mean of u over the domain, where fluxes that do not depend on u are given on all sides: the equation then
    /// leaves a constant in u open. Where nothing is said that of `exact.u` if it is given, else 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mean: Option<f64>,
}

/// `[sides]`: the sides on which the normal derivative is given.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Sides {
    /// Sides on which the flux is given instead of u: any of left, right, bottom and top. Conditions of other kinds are
    /// given side by side in `equation.boundary`.
    pub neumann: Vec<Side>,
}

/// `[solver]`: how the linear system is solved.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SolverTable {
    /// How the linear system is solved: by sparse LU ("lu"), or by BiCGSTAB with incomplete factors ("krylov", for
    /// nine-point stencils and values on all sides).
    pub kind: SolverKind,
}

/// How the linear system is solved.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum SolverKind {
    /// Sparse LU.
    #[default]
    Lu,
    /// BiCGSTAB with incomplete factors, for nine-point stencils and values on all sides.
    Krylov,
}

/// `[laplacian]`: the discrete Laplacian.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct LaplacianTable {
    /// How the weights of a node are found: "optimised", "harmonic", "compact25", "published" or "mapped".
    pub kind: String,
    /// Which polynomials the published kind fits: "printed", as its source has them, or "harmonic", with the misprints
    /// corrected. Only with the kind published.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub polynomials: Option<Polynomials>,
    /// Unit of length of the polynomials that the published kind fits: "none", that of the coordinates, "global", the
    /// spacing of the lattice, or "local", the distance to the farthest neighbour along an axis. Only with the kind
    /// published.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scaling: Option<Scaling>,
}

impl Default for LaplacianTable {
    fn default() -> Self {
        Self { kind: Laplacian::default().name().into(), polynomials: None, scaling: None }
    }
}

impl LaplacianTable {
    /// The kind.
    ///
    /// # Errors
    /// As [`Laplacian::named`], with keys below `laplacian`.
    pub fn laplacian(&self) -> Result<Laplacian> {
        Laplacian::named(&self.kind, self.polynomials, self.scaling).map_err(|error| error.within("laplacian"))
    }
}

/// Bytes of memory that a run needs for each node: rows, the sparse matrix and its factors.
const BYTES_PER_NODE: u128 = 6000;

impl Kind for PoissonStudy {
    type Run = PoissonRun;

    const KIND: StudyKind = StudyKind::Poisson;

    common_tables!();

    fn resolve(&mut self) -> Result<()> {
        self.output.check()?;
        if let Some(FramesAt::Every(0)) = self.output.frames {
            return Err(Error::invalid("output.frames.every", 0, "must be 1 or more"));
        }
        self.study.check_name()?;
        let kind = if self.equation.diffusivity.is_some() { Laplacian::Mapped } else { Laplacian::default() };
        self.laplacian.get_or_insert_with(|| LaplacianTable { kind: kind.name().into(), ..LaplacianTable::default() });
        let laplacian = self.laplacian()?;
        let data = self.data()?;
        let neumann = data.fluxes();
        if laplacian == Laplacian::Compact25 && self.grid.cells.iter().any(|&cells| cells < 4) {
            let rule =
                "needs at least 4 cells along each axis; raise them, or take another laplacian.kind than \"compact25\"";
            return Err(Error::invalid("grid.cells", format!("{:?}", self.grid.cells), rule));
        }
        let iterates = laplacian != Laplacian::Compact25 && neumann == [[false; 2]; 2];
        if self.solver.kind == SolverKind::Krylov && !iterates {
            let rule = "takes nine-point stencils with values on all sides; set it to \"lu\"";
            return Err(Error::invalid("solver.kind", "\"krylov\"", rule));
        }
        if laplacian == Laplacian::Compact25 && self.equation.diffusivity.is_some() {
            let rule = "has 25 points, which take no diffusivity; take \"mapped\" or another kind of nine points";
            return Err(Error::invalid("laplacian.kind", "\"compact25\"", rule));
        }
        if let Some(mean) = self.equation.mean.filter(|mean| !mean.is_finite()) {
            return Err(Error::invalid("equation.mean", mean, "must be a finite number"));
        }
        super::memory::check_memory(self.nodes(), BYTES_PER_NODE, &self.grid.cells)?;
        self.mesh()?;
        self.check_balance(&data)
    }

    fn memory(&self) -> u128 {
        self.nodes() * BYTES_PER_NODE
    }

    fn has_steps(&self) -> bool {
        false
    }

    fn begin(&self) -> Result<PoissonRun> {
        Ok(PoissonRun { study: self.clone(), solved: None })
    }
}

impl PoissonStudy {
    /// The mesh.
    ///
    /// # Errors
    /// As [`MappedDomain::mesh`].
    pub fn mesh(&self) -> Result<Mesh<2>> {
        self.data.known(|| self.domain.mesh(self.grid.cells, self.grid.grading))
    }

    /// The kind of Laplacian.
    pub(super) fn laplacian(&self) -> Result<Laplacian> {
        self.laplacian.as_ref().map_or(Ok(Laplacian::default()), LaplacianTable::laplacian)
    }

    fn nodes(&self) -> u128 {
        self.grid.cells.iter().map(|&n| n as u128 + 1).product()
    }
}
