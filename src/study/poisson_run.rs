//! Studies of kind `poisson`: how they are solved, and what is found.

use super::kind::{Running, SpentBy};
use super::poisson::{PoissonStudy, SolverKind};
use super::poisson_sides::{Given, finite};
use super::runner::Stage;
use crate::error::{Failure, Result, Unfit};
use crate::formula::Program;
use crate::geometry::{Mesh, check_finite, node_areas};
use crate::kept::Kept;
use crate::laplacian::{Laplacian, Poisson, Stencils, diffusion, unchecked};
use crate::numerics::{larger, sum};
use crate::output::{Ended, Failed, Figures, Summary};
use crate::simulation::Scene;
use crate::work::Work;
use serde::Serialize;
use std::path::Path;
use std::time::Instant;

/// What `summary.json` says of Poisson's equation.
#[derive(Debug, Clone, Serialize)]
pub struct PoissonFigures {
    /// What it cost.
    pub work: Work,
    /// Error of the solution, where an exact one is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<PoissonError>,
    /// Properties of the discrete Laplacian.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stencil: Option<StencilReport>,
}

/// Seconds of Poisson's equation, by part.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub struct PoissonParts {
    /// Computing stencils.
    pub stencils: f64,
    /// Solving the system.
    pub solve: f64,
}

impl Default for PoissonFigures {
    /// One system is to be solved.
    fn default() -> Self {
        Self { work: Work { linear_solves: 1, ..Work::default() }, error: None, stencil: None }
    }
}

impl Figures for PoissonFigures {
    type Parts = PoissonParts;

    const ENDED: fn(Failed) -> Ended = Ended::Failure;
}

/// Error against the exact solution, a node's area being a quarter of its cells'.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PoissonError {
    /// Largest error at a node.
    pub linf: f64,
    /// √(Σ e²·area / Σ area).
    pub l2: f64,
    /// √(Σ e²·area): the norm of the integral, which grows with the domain.
    pub l2_integral: f64,
}

/// Properties of the stencils of the discrete Laplacian.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct StencilReport {
    /// Stencils a second, on all threads.
    pub points_per_second: f64,
    /// Share of rows without a negative weight on a neighbour.
    pub nonnegative_fraction: f64,
    /// The highest degree that they differentiate exactly on this mesh.
    pub exact_degree: Option<usize>,
}

/// A solution of Poisson's equation, with what is known of it.
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
    seconds: PoissonParts,
}

/// Nodes times passes: the stencils of small meshes are computed several times, and the shortest time is reported.
const SMALL: usize = 100_000;
/// Largest number of passes after the first one.
const SMALL_PASSES: usize = 5;

impl PoissonStudy {
    /// Solves it.
    ///
    /// # Errors
    /// As [`Kind::resolve`](super::Kind::resolve); [`Error::Failed`](crate::Error::Failed) where a formula has no
    /// value, a stencil is degenerate or the system is singular.
    pub fn solve(&self) -> Result<Solved> {
        self.data.known(|| self.solve_known())
    }

    fn solve_known(&self) -> Result<Solved> {
        let mesh = self.mesh()?;
        let data = self.data()?;
        let (stencils, spent) = timed(&mesh, self.laplacian()?)?;
        let mut seconds = PoissonParts { stencils: spent, ..PoissonParts::default() };
        let weighted = match &data.diffusivity {
            Some(d) => Some(diffusion(&mesh, &stencils, |x| d.eval(x, &[])[0])?),
            None => None,
        };
        let mut counts = vec![false; mesh.x().len()];
        for k in 0..stencils.patch().len() {
            stencils.row(k).into_iter().flatten().for_each(|(index, _, source)| counts[index] |= source != 0.0);
        }
        let given = Given::at(&mesh, &data, &counts)?;
        let exact = data.exact.as_ref().map(|exact| values(&mesh, exact)).transpose()?;
        let clock = Instant::now();
        let problem = Poisson {
            source: &given.source,
            side: &given.side,
            robin: &given.robin,
            diffusivity: &given.diffusivity,
            mean: self.equation.mean.unwrap_or_else(|| exact.as_ref().map_or(0.0, |exact| mean(&mesh, exact))),
            neumann: data.fluxes(),
        };
        let solved = weighted.as_ref().unwrap_or(&stencils);
        let (u, work) = match self.solver.kind {
            SolverKind::Lu => (problem.solve(&mesh, solved)?, Work { linear_solves: 1, ..Work::default() }),
            SolverKind::Krylov => problem.iterate(&mesh, solved)?,
        };
        seconds.solve = clock.elapsed().as_secs_f64();
        check_finite(["the solution"], &mesh, u.as_chunks().0)?;
        let error = exact.as_ref().map(|exact| PoissonError::of(&mesh, &u, exact));
        Ok(Solved { mesh, u, exact, stencils, error, work, seconds })
    }
}

/// The mean of nodal values over the domain.
fn mean(mesh: &Mesh<2>, u: &[f64]) -> f64 {
    let areas = node_areas(mesh);
    sum(areas.iter().zip(u).map(|(area, u)| area * u)) / sum(areas.iter().copied())
}

/// Stencils, and the seconds that they take.
fn timed(mesh: &Mesh<2>, laplacian: Laplacian) -> Result<(Stencils, f64)> {
    let pass = || -> Result<(Stencils, f64)> {
        let clock = Instant::now();
        Ok((unchecked(mesh, laplacian)?, clock.elapsed().as_secs_f64()))
    };
    let mut found = pass()?;
    // on a small mesh one pass tells the time of waking threads up
    for _ in 0..SMALL_PASSES.min(SMALL / mesh.x().len()) {
        let (stencils, seconds) = pass()?;
        found = (stencils, seconds.min(found.1));
    }
    Ok(found)
}

impl PoissonError {
    fn of(mesh: &Mesh<2>, u: &[f64], exact: &[f64]) -> Self {
        let areas = node_areas(mesh);
        let off = || u.iter().zip(exact).map(|(u, e)| u - e);
        let linf = off().fold(0.0, larger);
        // squares of what is large are not finite
        let unit = if linf > 0.0 { linf } else { 1.0 };
        let squares = sum(off().zip(&areas).map(|(e, area)| (e / unit).powi(2) * area));
        let area = sum(areas.iter().copied());
        Self { linf, l2: unit * (squares / area).sqrt(), l2_integral: unit * squares.sqrt() }
    }
}

impl Solved {
    /// The mesh with u, and with its error where that is known.
    pub fn scene(&self) -> Scene {
        let mut nodal = vec![("u".to_string(), self.u.clone())];
        let off = |exact: &Vec<f64>| self.u.iter().zip(exact).map(|(u, e)| u - e).collect();
        nodal.extend(self.exact.iter().map(|exact| ("error".into(), off(exact))));
        Scene::of_mesh(0.0, 0, &self.mesh, nodal)
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
                "the iteration of solver.kind = \"krylov\" {why}, and the direct solver took its place; set it to \
                 \"lu\""
            ));
        }
        let near = self.stencils.near_degenerate();
        if let Some(worst) = near.iter().max_by(|a, b| a.condition.total_cmp(&b.condition)) {
            let ([i, j], [x, y]) = (worst.node, worst.x);
            warnings.push(format!(
                "{} stencils are near-degenerate, worst at node ({i}, {j}), x = {x:.4}, y = {y:.4}: condition number \
                 {:.1e}; \
                 make the cells around it less flat",
                near.len(),
                worst.condition
            ));
        }
        warnings
    }
}

/// Poisson's equation, before and after it is solved.
pub struct PoissonRun {
    pub(super) study: PoissonStudy,
    /// The solution; none before.
    pub solved: Option<Solved>,
}

impl Running for PoissonRun {
    type Figures = PoissonFigures;
    type Checkpoint = ();

    fn go(&mut self, _stage: &mut Stage<'_>) -> Result<()> {
        self.solved = Some(self.study.solve()?);
        Ok(())
    }

    fn resume(&mut self, (): (), _directory: Option<&Path>) -> Result<(SpentBy<Self>, Kept), Unfit> {
        Err(Unfit::Foreign)
    }

    fn scenes(&self) -> Result<Vec<Scene>> {
        Ok(self.solved.iter().map(Solved::scene).collect())
    }

    fn caption(&self, _scene: &Scene) -> String {
        self.study.laplacian.as_ref().map_or_else(String::new, |laplacian| laplacian.kind.clone())
    }

    fn tell(&self, summary: &mut Summary<PoissonFigures>) {
        if let Some(solved) = &self.solved {
            let (work, error, stencil) = (solved.work, solved.error, Some(solved.report()));
            summary.figures = PoissonFigures { work, error, stencil };
            (summary.seconds.parts, summary.warnings) = (solved.seconds, solved.warnings());
        }
    }

    /// Nothing is doubtful before it is solved.
    fn warn(&mut self, _warnings: Vec<String>) {}
}

/// The exact solution at every node.
fn values(mesh: &Mesh<2>, exact: &Program<2, 5>) -> Result<Vec<f64>, Failure> {
    let mut out = vec![[0.0; 5]; mesh.x().len()];
    exact.eval_each(mesh.x(), &[], &mut out);
    let u: Vec<f64> = out.into_iter().map(|[u, ..]| u).collect();
    (0..u.len()).try_for_each(|k| finite(mesh, k, "exact.u", u[k]))?;
    Ok(u)
}
