//! Studies of kind `poisson`: what they say.

use super::common::{Header, Output, StudyKind};
use super::kind::Kind;
use super::mapped::{Grading, MappedDomain, Side, mistaken, parse};
use super::poisson_run::PoissonRun;
use crate::error::{Error, Result};
use crate::formula::{Formula, Program};
use crate::geometry::Mesh;
use crate::laplacian::{Laplacian, Polynomials, Scaling};
use crate::output::FramesAt;
use crate::setting::pair;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A study of kind `poisson`: Δu = f on a structured mesh of any shape.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PoissonStudy {
    /// Name and kind of the study.
    pub study: Header,
    /// The shape of the domain, and how its mesh is distorted.
    pub domain: MappedDomain,
    /// The number of cells, and a side toward which they get smaller.
    pub grid: GradedGrid,
    /// The exact solution, against which errors are reported; it gives whatever `[equation]` does not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub exact: Option<ExactSolution>,
    /// The right-hand side of Δu = f, and what holds on the sides.
    #[serde(default)]
    pub equation: Equation,
    /// The sides on which the normal derivative is given.
    #[serde(default)]
    pub sides: Sides,
    /// The discrete Laplacian, whose weights follow from the positions of the neighbours of a node.
    #[serde(default)]
    pub laplacian: LaplacianTable,
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
    /// Right-hand side f of Δu = f, a formula of x and y; the Laplacian of `exact.u` where nothing is said.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub source: Option<String>,
    /// u on the sides, a formula of x and y; `exact.u` where nothing is said.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub boundary: Option<String>,
    /// The outward normal derivative n·∇u on the sides of `sides.neumann`, a formula of x and y; that of `exact.u`
    /// where nothing is said.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub flux: Option<String>,
}

/// `[sides]`: the sides on which the normal derivative is given.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Sides {
    /// Sides on which the normal derivative of u is given instead of its value: any of left, right, bottom and top, but
    /// not all.
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

/// Formulas of x and y.
const VARIABLES: [&str; 2] = ["x", "y"];
/// Bytes of memory that a run needs for each node: rows, the sparse matrix and its factors.
const BYTES_PER_NODE: u128 = 6000;

impl Kind for PoissonStudy {
    type Run = PoissonRun;

    const KIND: StudyKind = StudyKind::Poisson;

    fn common(&self) -> (&Header, &Output) {
        (&self.study, &self.output)
    }

    fn resolve(&mut self) -> Result<()> {
        self.output.check()?;
        if let Some(FramesAt::Every(0)) = self.output.frames {
            return Err(Error::invalid("output.frames.every", 0, "must be 1 or more"));
        }
        self.study.check_name()?;
        let laplacian = self.laplacian.laplacian()?;
        self.data()?;
        let neumann = self.neumann();
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
        if neumann == [[true; 2]; 2] {
            let rule = "the solution is then known up to a constant only; leave one side out";
            return Err(Error::invalid("sides.neumann", "all four sides", rule));
        }
        super::memory::check_memory(self.nodes(), BYTES_PER_NODE, &self.grid.cells)?;
        self.mesh().map(|_| ())
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
        self.domain.mesh(self.grid.cells, self.grid.grading)
    }

    fn nodes(&self) -> u128 {
        self.grid.cells.iter().map(|&n| n as u128 + 1).product()
    }

    pub(super) fn neumann(&self) -> [[bool; 2]; 2] {
        let mut neumann = [[false; 2]; 2];
        for side in &self.sides.neumann {
            let (axis, upper) = side.place();
            neumann[axis][usize::from(upper)] = true;
        }
        neumann
    }

    /// u, its gradient and its Laplacian where they are known, then what `[equation]` gives.
    pub(super) fn data(&self) -> Result<Data> {
        let exact = match &self.exact {
            None => None,
            Some(ExactSolution { u: text }) => {
                let u = parse("exact.u", text, &VARIABLES)?;
                let slope = |f: &Formula, d| f.derivative(d).map_err(|mistake| mistaken("exact.u", text, mistake));
                let [x, y] = [slope(&u, 0)?, slope(&u, 1)?];
                Some(Program::new([&u, &x, &y, &slope(&x, 0)?, &slope(&y, 1)?]))
            }
        };
        let given = |key: &str, text: &Option<String>, needed: bool| match text {
            Some(text) => Ok(Some(Program::new([&parse(&format!("equation.{key}"), text, &VARIABLES)?]))),
            None if exact.is_some() || !needed => Ok(None),
            None => {
                Err(Error::invalid(format!("equation.{key}"), "not given", "add it, or the exact solution: exact.u"))
            }
        };
        Ok(Data {
            source: given("source", &self.equation.source, true)?,
            boundary: given("boundary", &self.equation.boundary, true)?,
            flux: given("flux", &self.equation.flux, !self.sides.neumann.is_empty())?,
            exact,
        })
    }
}

/// The formulas of a study, compiled.
pub(super) struct Data {
    /// u, u_x, u_y, u_xx and u_yy.
    pub exact: Option<Program<2, 5>>,
    pub source: Option<Program<2, 1>>,
    pub boundary: Option<Program<2, 1>>,
    pub flux: Option<Program<2, 1>>,
}
