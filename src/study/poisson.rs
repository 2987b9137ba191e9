use super::ending::end;
use super::mapped::{Grading, MappedDomain, Side, mistaken, parse};
use super::{Header, Output};
use crate::error::{Error, Failure, Result};
use crate::formula::{Formula, Program};
use crate::geometry::{Field, Mesh, node_areas};
use crate::laplacian::{Laplacian, Poisson, Polynomials, Scaling, Stencils, outward, unchecked};
use crate::mover::Gait;
use crate::numerics::{larger, sum};
use crate::output::{Failed, Frames, FramesAt, Parallel, Picture, RunDirectory, draw, final_arrays};
use crate::report;
use crate::setting::pair;
use crate::simulation::State;
use crate::stopwatch::Stopwatch;
use crate::study::Source;
use crate::work::Work;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::time::Instant;

/// A study of kind `poisson`: Δu = f on a structured mesh of any shape.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PoissonStudy {
    /// `[study]`.
    pub study: Header,
    /// `[domain]`.
    pub domain: MappedDomain,
    /// `[grid]`.
    pub grid: GradedGrid,
    /// `[exact]`: gives whatever `[equation]` does not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub exact: Option<ExactSolution>,
    /// `[equation]`.
    #[serde(default)]
    pub equation: Equation,
    /// `[sides]`.
    #[serde(default)]
    pub sides: Sides,
    /// `[laplacian]`.
    #[serde(default)]
    pub laplacian: LaplacianTable,
    /// `[solver]`.
    #[serde(default)]
    pub solver: SolverTable,
    /// `[output]`.
    #[serde(default)]
    pub output: Output,
}

/// `[grid]`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GradedGrid {
    /// Cells along s and r.
    #[serde(deserialize_with = "pair")]
    pub cells: [usize; 2],
    /// Smaller cells toward a side.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub grading: Option<Grading>,
}

/// `[exact]`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ExactSolution {
    /// The solution, a formula of x and y.
    pub u: String,
}

/// `[equation]`: formulas of x and y.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Equation {
    /// f of Δu = f.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub source: Option<String>,
    /// u on the sides.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub boundary: Option<String>,
    /// n·∇u on Neumann sides, n outward.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub flux: Option<String>,
}

/// `[sides]`.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Sides {
    /// Sides where the normal derivative is given instead of the value.
    pub neumann: Vec<Side>,
}

/// `[solver]`.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SolverTable {
    /// How the system is solved.
    pub kind: SolverKind,
}

/// How the system is solved.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum SolverKind {
    /// Sparse LU.
    #[default]
    Lu,
    /// BiCGSTAB with incomplete factors, for nine-point stencils and values on all sides.
    Krylov,
}

/// `[laplacian]`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct LaplacianTable {
    /// One of [`Laplacian::KINDS`].
    pub kind: String,
    /// Of kind `published`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub polynomials: Option<Polynomials>,
    /// Of kind `published`.
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

/// `summary.json` of a study of kind `poisson`.
#[derive(Debug, Clone, Serialize)]
pub struct PoissonSummary {
    /// Version of this format.
    pub schema: u32,
    /// Name of the study.
    pub study: String,
    /// `poisson`.
    pub kind: String,
    /// Version of the program.
    pub version: String,
    /// `completed` or `failed`.
    pub status: String,
    /// What failed, if something did.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub failure: Option<Failed>,
    /// Where the time went.
    pub seconds: PoissonSeconds,
    /// What the run had at its disposal.
    pub parallel: Parallel,
    /// What it cost.
    pub work: Work,
    /// Where the exact solution is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<PoissonError>,
    /// Of the discrete Laplacian.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stencil: Option<StencilReport>,
    /// What the user should know although nothing failed.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
}

/// Seconds by part.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub struct PoissonSeconds {
    /// By the clock.
    pub wall: f64,
    /// Of all threads.
    pub cpu: f64,
    /// Computing stencils.
    pub stencils: f64,
    /// Solving the system.
    pub solve: f64,
    /// Writing.
    pub output: f64,
}

/// Error against the exact solution, a node's area being a quarter of its cells'.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PoissonError {
    /// Largest over the nodes.
    pub linf: f64,
    /// √(Σ e²·area / Σ area).
    pub l2: f64,
    /// √(Σ e²·area): the norm of the integral, which grows with the domain.
    pub l2_integral: f64,
}

/// What is known of the stencils.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct StencilReport {
    /// Stencils a second, on all threads.
    pub points_per_second: f64,
    /// Share of rows without a negative weight on a neighbour.
    pub nonnegative_fraction: f64,
    /// The highest degree that they differentiate exactly on this mesh.
    pub exact_degree: Option<usize>,
}

/// The outcome of a study of kind `poisson`.
#[derive(Debug, Clone)]
pub struct Solved {
    /// The mesh.
    pub mesh: Mesh<2>,
    /// The solution at its nodes.
    pub u: Vec<f64>,
    /// The exact solution there.
    pub exact: Option<Vec<f64>>,
    /// The discrete Laplacian.
    pub stencils: Stencils,
    /// Against the exact solution.
    pub error: Option<PoissonError>,
    /// Of the solver: without iterations where it is direct.
    pub work: Work,
    seconds: PoissonSeconds,
}

/// Formulas of x and y.
const VARIABLES: [&str; 2] = ["x", "y"];
/// Memory for each node: rows, the sparse matrix and its factors.
const BYTES_PER_NODE: u128 = 6000;
/// Meshes below this many nodes are timed several times.
const SMALL: usize = 100_000;
const SMALL_PASSES: usize = 5;

impl PoissonStudy {
    /// Reads and checks a study, every default filled in.
    ///
    /// # Errors
    /// [`Error::Study`] at the place of the first mistake.
    pub fn from_source(source: &Source) -> Result<Self> {
        let study: Self = source.parse()?;
        study.check().map_err(|error| source.locate(error))?;
        Ok(study)
    }

    /// Refuses settings out of range.
    ///
    /// # Errors
    /// [`Error::Invalid`] or [`Error::Formula`] with the dotted key.
    pub fn check(&self) -> Result<()> {
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
        super::memory::check_memory(
            self.grid.cells.iter().map(|&n| n as u128 + 1).product(),
            BYTES_PER_NODE,
            &self.grid.cells,
        )?;
        self.mesh().map(|_| ())
    }

    /// The mesh.
    ///
    /// # Errors
    /// As [`MappedDomain::mesh`].
    pub fn mesh(&self) -> Result<Mesh<2>> {
        self.domain.mesh(self.grid.cells, self.grid.grading)
    }

    /// Memory that the run needs, in bytes.
    pub fn memory(&self) -> u128 {
        self.grid.cells.iter().map(|&n| n as u128 + 1).product::<u128>() * BYTES_PER_NODE
    }

    /// The remedy for an error in the keys of this study, with the value that each has now.
    pub fn remedy(&self, error: &Error) -> Option<String> {
        super::remedy::remedy(self, error)
    }

    /// The study as a file, every default filled in.
    pub fn to_toml(&self) -> String {
        toml::to_string(self).expect("a study is plain data")
    }

    fn neumann(&self) -> [[bool; 2]; 2] {
        let mut neumann = [[false; 2]; 2];
        for side in &self.sides.neumann {
            let (axis, upper) = side.place();
            neumann[axis][usize::from(upper)] = true;
        }
        neumann
    }

    /// u, its gradient and its Laplacian where they are known, then what `[equation]` gives.
    fn data(&self) -> Result<Data> {
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

    /// Solves it.
    ///
    /// # Errors
    /// As [`PoissonStudy::check`]; [`Error::Failed`] where a formula has no value, a stencil is degenerate or the system
    /// is singular.
    pub fn solve(&self) -> Result<Solved> {
        let mesh = self.mesh()?;
        let data = self.data()?;
        let mut seconds = PoissonSeconds::default();
        let laplacian = self.laplacian.laplacian()?;
        let clock = Instant::now();
        let mut stencils = unchecked(&mesh, laplacian)?;
        seconds.stencils = clock.elapsed().as_secs_f64();
        // on a small mesh one pass tells the time of waking threads up
        for _ in 0..SMALL_PASSES.min(SMALL / mesh.x().len()) {
            let clock = Instant::now();
            stencils = unchecked(&mesh, laplacian)?;
            seconds.stencils = seconds.stencils.min(clock.elapsed().as_secs_f64());
        }

        // formulas need a value only where it counts
        let lattice = mesh.lattice();
        let problem = Poisson { source: &[], side: &[], neumann: self.neumann() };
        let mut counts = vec![false; lattice.len()];
        for k in 0..stencils.patch().len() {
            stencils.row(k).into_iter().flatten().for_each(|(index, _, source)| counts[index] |= source != 0.0);
        }
        let flows: Vec<bool> = (0..lattice.len()).map(|k| problem.neumann_side(lattice, k).is_some()).collect();
        let given: Vec<bool> = (0..lattice.len()).map(|k| lattice.on_side(k) && !flows[k]).collect();
        let known = match &data.exact {
            Some(program) => {
                let slopes: Vec<bool> = flows.iter().map(|flows| *flows && data.flux.is_none()).collect();
                let sources: Vec<bool> = counts.iter().map(|counts| *counts && data.source.is_none()).collect();
                let everywhere = vec![true; lattice.len()];
                let needed = [&everywhere, &slopes, &slopes, &sources, &sources];
                Some(values(&mesh, "exact.u or a derivative of it", program, needed)?)
            }
            None => None,
        };
        let source = match &data.source {
            Some(program) => values(&mesh, "equation.source", program, [&counts])?.into_iter().map(|[f]| f).collect(),
            None => known.iter().flatten().map(|[_, _, _, xx, yy]| xx + yy).collect::<Vec<f64>>(),
        };
        let mut side = match &data.boundary {
            Some(program) => values(&mesh, "equation.boundary", program, [&given])?.into_iter().map(|[u]| u).collect(),
            None => known.iter().flatten().map(|v| v[0]).collect::<Vec<f64>>(),
        };
        let flux = data.flux.as_ref().map(|program| values(&mesh, "equation.flux", program, [&flows])).transpose()?;
        for index in lattice.sides() {
            if let Some(at) = problem.neumann_side(lattice, index) {
                let n = outward(&mesh, index, at);
                side[index] = match (&flux, &known) {
                    (Some(flux), _) => flux[index][0],
                    (None, known) => {
                        known.as_ref().map_or(0.0, |known| n[0] * known[index][1] + n[1] * known[index][2])
                    }
                };
            }
        }
        let clock = Instant::now();
        let problem = Poisson { source: &source, side: &side, ..problem };
        let (u, work) = match self.solver.kind {
            SolverKind::Lu => (problem.solve(&mesh, &stencils)?, Work { linear_solves: 1, ..Work::default() }),
            SolverKind::Krylov => problem.iterate(&mesh, &stencils)?,
        };
        seconds.solve = clock.elapsed().as_secs_f64();
        if let Some(k) = u.iter().position(|u| !u.is_finite()) {
            return Err(Failure::NonFinite {
                what: "the solution",
                value: u[k],
                node: lattice.node(k),
                x: mesh.x()[k],
            }
            .into());
        }
        let exact: Option<Vec<f64>> = known.map(|known| known.iter().map(|v| v[0]).collect());
        let error = exact.as_ref().map(|exact| {
            let areas = node_areas(&mesh);
            let off = || u.iter().zip(exact).map(|(u, e)| u - e);
            let linf = off().fold(0.0, larger);
            // squares of what is large are not finite
            let unit = if linf > 0.0 { linf } else { 1.0 };
            let squares = sum(off().zip(&areas).map(|(e, area)| (e / unit).powi(2) * area));
            let area = sum(areas.iter().copied());
            PoissonError { linf, l2: unit * (squares / area).sqrt(), l2_integral: unit * squares.sqrt() }
        });
        Ok(Solved { mesh, u, exact, stencils, error, work, seconds })
    }

    /// Runs the study into a directory.
    ///
    /// # Errors
    /// As [`PoissonStudy::solve`], and what hinders writing. `summary.json` tells of a failure of the computation too.
    pub fn run(&self, directory: &Path) -> Result<PoissonSummary> {
        self.check()?;
        let clock = Stopwatch::start();
        let directory = RunDirectory::claim(directory)?;
        let mut summary = PoissonSummary {
            schema: 1,
            study: self.study.name.clone(),
            kind: "poisson".into(),
            version: env!("CARGO_PKG_VERSION").into(),
            status: "running".into(),
            failure: None,
            seconds: PoissonSeconds::default(),
            parallel: Parallel { ranks: 1, threads: rayon::current_num_threads() },
            work: Work { linear_solves: 1, ..Work::default() },
            error: None,
            stencil: None,
            warnings: Vec::new(),
        };
        directory.write_summary(&summary)?;
        directory.write("study.toml", self.to_toml().as_bytes())?;
        let failure = match self.solve() {
            Err(failure) => Some(failure),
            Ok(solved) => {
                summary.seconds = solved.seconds;
                summary.error = solved.error;
                summary.work = solved.work;
                summary.stencil = Some(solved.report());
                summary.warnings = solved.warnings();
                let output = Instant::now();
                let kept = keep(self, &directory, &solved);
                summary.seconds.output += output.elapsed().as_secs_f64();
                kept.err()
            }
        };
        let note = |summary: &mut PoissonSummary, failure: Option<&Error>, output: f64| {
            summary.status = if failure.is_none() { "completed" } else { "failed" }.into();
            summary.failure = failure.map(|error| Failed::of(error, self.remedy(error)));
            summary.seconds.output += output;
            [summary.seconds.wall, summary.seconds.cpu] = clock.elapsed();
        };
        let computed = failure.is_none();
        let failure = end(&directory, &mut summary, failure, note, |status| match computed {
            true => report::finish(directory.path(), self.output.report, self.output.animation, status),
            false => Ok(()),
        });
        failure.map_or(Ok(summary), Err)
    }
}

impl Solved {
    /// The solution as a state: its mesh, u and the error where it is known, with their names.
    fn state(&self) -> (Vec<String>, State) {
        let mut names = vec!["u".to_string()];
        let mut fields = vec![self.u.clone()];
        if let Some(exact) = &self.exact {
            names.push("error".into());
            fields.push(self.u.iter().zip(exact).map(|(u, e)| u - e).collect());
        }
        let rho = vec![1.0; self.u.len()];
        let gait = Gait::at_rest(&self.mesh);
        (
            names,
            State {
                t: 0.0,
                step: 0,
                mesh: self.mesh.clone(),
                u: Field::joined(&fields).expect("u and its error have one value a node each"),
                rho,
                gait,
                own_change: 0.0,
            },
        )
    }

    /// The mesh over the solution.
    pub fn picture(&self, title: &str) -> Picture {
        draw(title, "u", &self.state().1, &[])
    }

    /// What is known of the stencils.
    pub fn report(&self) -> StencilReport {
        StencilReport {
            points_per_second: self.stencils.patch().len() as f64 / self.seconds.stencils,
            nonnegative_fraction: self.stencils.nonnegative_fraction(),
            exact_degree: self.stencils.exact_degree(&self.mesh),
        }
    }

    /// Stencils that come near to none, and kinds that are not exact for quadratics.
    pub fn warnings(&self) -> Vec<String> {
        let mut warnings = Vec::new();
        if self.work.direct_solves() > 0 {
            let why = if self.work.direct_unstarted > 0 { "could not begin" } else { "did not converge" };
            warnings.push(format!(
                "the iteration of solver.kind = \"krylov\" {why}, and the direct solver took its place; set it to \"lu\""
            ));
        }
        let near = self.stencils.near_degenerate();
        if let Some(worst) = near.iter().max_by(|a, b| a.condition.total_cmp(&b.condition)) {
            let ([i, j], [x, y]) = (worst.node, worst.x);
            warnings.push(format!(
                "{} stencils are near-degenerate, worst at node ({i}, {j}), x = {x:.4}, y = {y:.4}: condition number {:.1e}; \
                 make the cells around it less flat",
                near.len(),
                worst.condition
            ));
        }
        warnings
    }
}

struct Data {
    exact: Option<Program<2, 5>>,
    source: Option<Program<2, 1>>,
    boundary: Option<Program<2, 1>>,
    flux: Option<Program<2, 1>>,
}

/// Formulas at every node, 0 where they have no value and need none.
fn values<const K: usize>(
    mesh: &Mesh<2>,
    what: &str,
    program: &Program<2, K>,
    needed: [&Vec<bool>; K],
) -> Result<Vec<[f64; K]>, Failure> {
    let mut out = vec![[0.0; K]; mesh.x().len()];
    program.eval_each(mesh.x(), &[], &mut out);
    for (k, values) in out.iter_mut().enumerate() {
        for (value, needed) in values.iter_mut().zip(needed) {
            if !value.is_finite() && !needed[k] {
                *value = 0.0;
            }
        }
    }
    match out.iter().position(|v| !v.iter().all(|v| v.is_finite())) {
        None => Ok(out),
        Some(k) => {
            let value = out[k].into_iter().find(|v| !v.is_finite()).unwrap_or(f64::NAN);
            let (node, x) = (mesh.lattice().node(k), mesh.x()[k]);
            Err(Failure::Formula { what: what.into(), value, node, x, given: Vec::new() })
        }
    }
}

/// Writes the solution: as a frame, as arrays, as a picture.
fn keep(study: &PoissonStudy, directory: &RunDirectory, solved: &Solved) -> Result<()> {
    let (names, state) = solved.state();
    Frames::create(directory.path(), FramesAt::Every(1), [1, 1])?.write(&names, &state)?;
    directory.write("final.npz", &final_arrays(&names, &state))?;
    let title = format!("{}, {}", study.study.name, study.laplacian.kind);
    let picture = solved.picture(&title);
    picture.write(directory.path(), "mesh")
}
