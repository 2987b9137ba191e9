use super::{Options, Table};
use driftmesh::Auto;
use driftmesh::Work;
use driftmesh::density::{Arclength, Strength};
use driftmesh::error::{Failure, Result};
use driftmesh::geometry::{Lattice, Mesh, compare};
use driftmesh::meshing::{
    Decomposition, Estimator, EstimatorKind, GridWalk, Interpolation, MeshGenerator, MeshOperator, Mmpde, MonteCarlo,
    Moved, Placement, Problem, ResidualWalk, Stochastic, Strip, Strips, Whole, move_sides,
};
use driftmesh::mover::Mover;
use driftmesh::numerics::linear::{Robust, Smoother};
use driftmesh::physics::{Burgers, Convection};
use driftmesh::simulation::{Coupling, Record, Safety, Schedule, Simulation};
use std::time::Instant;

/// One mesh step of Burgers' front with its exact solution on the whole lattice, for estimators to be measured on.
pub struct InterfaceStep {
    equation: Mmpde,
    mesh: Mesh<2>,
    rho: Vec<f64>,
    dt: f64,
    operator: MeshOperator<2>,
    /// New positions on the sides, old ones elsewhere.
    new: Vec<[f64; 2]>,
    exact: Vec<[f64; 2]>,
    decomposition: Decomposition,
    points: Vec<usize>,
}

/// What an estimator did on a step.
#[derive(Debug, Clone, Copy, Default)]
pub struct Measured {
    /// Root mean square over both coordinates of all interface points.
    pub error: f64,
    /// What the estimator itself says of it.
    pub standard_error: f64,
    /// Steps of walks for each point.
    pub evaluations: f64,
    /// Sweeps in strips.
    pub sweeps: usize,
    /// Exchanges between neighbours.
    pub exchanges: usize,
    /// Nodes that the subdomain with the most to read reads in one.
    pub read: usize,
    /// Unknowns of the coarse lattice, whose right-hand sides are gathered in one.
    pub gathered: usize,
    /// Walks for each point that another subdomain pays.
    pub handed_on: f64,
    /// Seconds for all points.
    pub seconds: f64,
}

impl InterfaceStep {
    /// The step after t = .75 of case A (ν = .005, strength 10, no smoothing, advective) with `cells` cells an axis.
    ///
    /// # Errors
    /// Where the run up to there fails.
    pub fn case_a(cells: usize) -> Result<Self> {
        let dt = 1e-3;
        let monitor = Arclength { strength: Strength::Relative(10.0), smoothing: 0 };
        let mut simulation = Simulation {
            physics: Box::new(Burgers::new(0.005, Convection::Advective)?),
            monitor: Box::new(monitor),
            mover: Mover::by(Box::new(Whole::default()), Mmpde::published()),
            coupling: Coupling::default(),
            safety: Safety::default(),
            schedule: Schedule::new(0.25, 0.75, dt, vec![0.75])?,
        };
        let mesh = Mesh::uniform(Lattice::bounded([cells, cells])?, [0.0; 2], [1.0; 2])?;
        let mut state = simulation.start(mesh)?;
        simulation.run(&mut state, &mut Record::default(), &mut [])?;
        Ok(Self::new(state.mesh, state.rho, Mmpde::published(), dt, [4, 4])?)
    }

    /// A step of any mesh.
    ///
    /// # Errors
    /// A [`Failure`] where the step cannot be solved.
    pub fn new(
        mesh: Mesh<2>,
        rho: Vec<f64>,
        equation: Mmpde,
        dt: f64,
        subdomains: [usize; 2],
    ) -> Result<Self, Failure> {
        let lattice = *mesh.lattice();
        let operator = equation.operator(&lattice, &rho, dt)?;
        let mut new = mesh.x().to_vec();
        move_sides(&equation, &mesh, &rho, dt, &mut new, &mut Robust::default())?;
        let exact = Whole::default().step(&equation, &mesh, &rho, dt)?.mesh.x().to_vec();
        let decomposition = Decomposition::new(&lattice, subdomains)
            .map_err(|_| Failure::Subdomains { subdomains, cells: lattice.cells() })?;
        let points = decomposition.points();
        Ok(Self { equation, mesh, rho, dt, operator, new, exact, decomposition, points })
    }

    /// The same mesh and density with another length of the step.
    ///
    /// # Errors
    /// As [`InterfaceStep::new`].
    pub fn with_step(&self, dt: f64) -> Result<Self, Failure> {
        Self::new(self.mesh.clone(), self.rho.clone(), self.equation, dt, [4, 4])
    }

    /// Δt/(τh²), the larger of both axes.
    pub fn stiffness(&self) -> f64 {
        let a = self.problem(0).stiffness();
        a[0].max(a[1])
    }

    /// Length of the shortest edge of the mesh.
    pub fn shortest_edge(&self) -> f64 {
        self.mesh.shortest_edge()
    }

    /// Number of interface points.
    pub fn points(&self) -> usize {
        self.points.len()
    }

    fn problem(&self, seed: u64) -> Problem<'_> {
        Problem::new(&self.equation, &self.operator, &self.mesh, &self.rho, self.dt, &self.new, seed, 0)
    }

    /// Root mean square distance of positions from the exact ones at the interface points, for one coordinate.
    fn error(&self, x: impl Fn(usize) -> [f64; 2]) -> f64 {
        let squares = self.points.iter().enumerate().map(|(p, &k)| {
            let (x, exact) = (x(p), self.exact[k]);
            (x[0] - exact[0]).powi(2) + (x[1] - exact[1]).powi(2)
        });
        (squares.sum::<f64>() / (2 * self.points.len()) as f64).sqrt()
    }

    /// Error of keeping the old mesh.
    pub fn do_nothing(&self) -> f64 {
        self.error(|p| self.mesh.x()[self.points[p]])
    }

    /// What an estimator does, averaged over seeds 1 … `seeds` (the errors as root mean squares).
    ///
    /// # Errors
    /// As [`Estimator::estimate`].
    pub fn measure(&self, estimator: &dyn Estimator, seeds: u64) -> Result<Measured, Failure> {
        let mut sum = Measured::default();
        let mut strips = Strips::new(&self.decomposition);
        for seed in 1..=seeds {
            let started = Instant::now();
            let found = estimator.estimate(&self.problem(seed), &self.points, &mut strips)?;
            sum.seconds += started.elapsed().as_secs_f64();
            sum.error += self.error(|p| found.points[p].x).powi(2);
            let squares = found.points.iter().flat_map(|e| e.standard_error).map(|s| s * s).sum::<f64>();
            sum.standard_error += squares / (2 * self.points.len()) as f64;
            sum.evaluations += found.work.path_steps as f64 / self.points.len() as f64;
            sum.sweeps = found.sweeps;
            (sum.exchanges, sum.read, sum.gathered) = match found.exchanges {
                0 => (0, 0, 0),
                exchanges => (exchanges, strips.read(), strips.gathered()),
            };
            sum.handed_on += found.handed_on as f64 / self.points.len() as f64;
        }
        let n = seeds as f64;
        Ok(Measured {
            error: (sum.error / n).sqrt(),
            standard_error: (sum.standard_error / n).sqrt(),
            evaluations: sum.evaluations / n,
            handed_on: sum.handed_on / n,
            seconds: sum.seconds / n,
            ..sum
        })
    }
}

/// What an independent implementation of this project measured: the range of ±10 % around it.
const fn about(low: f64, high: f64) -> Option<[f64; 2]> {
    Some([0.9 * low, 1.1 * high])
}

/// What an estimator says of its own error, if anything.
fn own(standard_error: f64) -> String {
    if standard_error.is_nan() { String::new() } else { format!("{standard_error:.1e}") }
}

/// How an error compares with one that was measured before.
fn verdict(error: f64, before: Option<[f64; 2]>) -> String {
    match before {
        Some([low, _]) if error < low => format!("{:.2} times smaller", low / 0.9 / error),
        Some([_, high]) if error > high => format!("{:.2} times larger", error / (high / 1.1)),
        Some(_) => "the same".into(),
        None => String::new(),
    }
}

/// Estimators with the errors that were measured before.
fn estimators(quick: bool) -> Vec<(&'static str, EstimatorKind, Option<[f64; 2]>)> {
    let paths = |paths, substeps| MonteCarlo::new(paths, substeps);
    let residual = |sweeps, walks| {
        EstimatorKind::ResidualWalk(ResidualWalk { sweeps: Auto::Value(sweeps), walks, smoother: Smoother::Jacobi })
    };
    let grid = |walks, increment| EstimatorKind::GridWalk(GridWalk { walks, increment });
    let (monte, strip) = (EstimatorKind::MonteCarlo, EstimatorKind::Strip);
    let mut all = vec![
        ("Monte Carlo N=10⁴ M=10, as published", monte(paths(10_000, 10)), about(4.2e-4, 4.5e-4)),
        ("Monte Carlo N=10³ M=10", monte(paths(1000, 10)), about(1.4e-3, 1.4e-3)),
        ("  antithetic, N=10⁴", monte(MonteCarlo { antithetic: true, ..paths(10_000, 10) }), about(6.7e-5, 6.7e-5)),
        (
            "  control variate, N=10⁴",
            monte(MonteCarlo { control_variate: true, ..paths(10_000, 10) }),
            about(5.5e-5, 5.5e-5),
        ),
        ("  common random numbers, N=10⁴", monte(MonteCarlo { common: true, ..paths(10_000, 10) }), None),
        ("  Sobol, N=1024 M=8", monte(MonteCarlo { sobol: true, ..paths(1024, 8) }), about(3.4e-5, 3.4e-5)),
        ("grid walk N=10", grid(10, false), about(1.4e-2, 1.4e-2)),
        ("grid walk N=100", grid(100, false), about(4.4e-3, 4.4e-3)),
        ("grid walk N=10⁴", grid(10_000, false), about(4.4e-4, 4.4e-4)),
        ("grid walk on the increment, N=10", grid(10, true), about(6.4e-5, 6.4e-5)),
        ("grid walk on the increment, N=100", grid(100, true), about(2e-5, 2e-5)),
        ("residual walk k=4 N=10, Jacobi", residual(4, 10), about(1.3e-5, 1.3e-5)),
        ("residual walk k=16 N=10, Jacobi", residual(16, 10), about(1.3e-6, 1.3e-6)),
        ("residual walk, the default", EstimatorKind::default(), None),
        ("strip of 4 cells, no coarse lattice", strip(Strip::plain(4)), None),
        ("strip of 8 cells, no coarse lattice", strip(Strip::plain(8)), about(2.7e-7, 2.7e-7)),
        ("strip, its default", strip(Strip::default()), None),
    ];
    if quick {
        all.retain(|(name, _, _)| !name.starts_with("  common"));
    }
    all
}

pub(super) fn run(options: Options) -> Result<Vec<Table>> {
    let step = InterfaceStep::case_a(40)?;
    let seeds = if options.quick { 2 } else { 10 };
    let title = format!(
        "One mesh step at 41², Δt = 1e-3, t = .75, 4×4: {} interface points, mean of {seeds} seeds",
        step.points()
    );
    let mut table = Table::new(
        title,
        &[
            "estimator",
            "evaluations a point",
            "sweeps",
            "error",
            "its own estimate",
            "against before",
            "nodes read",
            "gathered",
            "handed on a point",
            "µs a point",
            "times the default",
        ],
    );
    let default = step.measure(EstimatorKind::default().estimator(), 10)?;
    let us = |seconds: f64| seconds * 1e6 / step.points() as f64;
    table.row([
        "keep the old mesh (do nothing)",
        "0",
        "0",
        &format!("{:.1e}", step.do_nothing()),
        "",
        &verdict(step.do_nothing(), about(9.7e-5, 9.7e-5)),
        "0",
        "0",
        "0",
        "0",
        "0",
    ]);
    let mut published = default;
    let mut cheap = default;
    for (name, kind, before) in estimators(options.quick) {
        // what is quick is measured more often
        let found =
            step.measure(kind.estimator(), if matches!(kind, EstimatorKind::MonteCarlo(_)) { seeds } else { 10 })?;
        table.row([
            name.to_string(),
            format!("{:.0}", found.evaluations),
            found.sweeps.to_string(),
            format!("{:.1e}", found.error),
            own(found.standard_error),
            verdict(found.error, before),
            found.read.to_string(),
            found.gathered.to_string(),
            format!("{:.2}", found.handed_on),
            format!("{:.2}", us(found.seconds)),
            format!("{:.2}", found.seconds / default.seconds),
        ]);
        match name {
            "Monte Carlo N=10⁴ M=10, as published" => published = found,
            "residual walk k=4 N=10, Jacobi" => cheap = found,
            _ => {}
        }
    }
    table.note("error: root mean square over both coordinates of all points, against the discrete step on one domain");
    table.note("its own estimate: the standard error of the samples; it does not see the bias of Monte Carlo, and strips without walks have none");
    table.note("nodes read: by the subdomain with the most, from its neighbours, in the one exchange of a step; gathered: unknowns of a coarse lattice; handed on: walks that another subdomain pays");
    table.note("against before: against an independent implementation of this project, the same where within 10 %");
    table.note(format!(
        "residual walk k=4 N=10 against Monte Carlo N=10⁴ M=10, {} threads: {:.0} times cheaper at 1/{:.0} of the error",
        rayon::current_num_threads(),
        published.seconds / cheap.seconds,
        published.error / cheap.error
    ));
    Ok(vec![table, over_stiffness(options)?, coupled(options)?])
}

/// The default and the strip over a = Δt/(τh²).
fn over_stiffness(options: Options) -> Result<Table> {
    let mut table = Table::new(
        "The default residual walk (N = 10) and the strip over a = Δt/(τh²), from the mesh and density of case A at t = .75",
        &[
            "cells",
            "a",
            "jumps a walk",
            "do nothing",
            "error",
            "its own estimate",
            "µs a point",
            "strip: error",
            "of the shortest edge",
            "exchanges",
            "µs a point",
        ],
    );
    let sizes: &[usize] = if options.quick { &[40] } else { &[40, 80] };
    for &cells in sizes {
        let at = InterfaceStep::case_a(cells)?;
        for a in [0.5, 1.6, 5.0, 16.0, 50.0, 100.0] {
            let dt = a / (cells * cells) as f64;
            let step = at.with_step(dt)?;
            let walk = ResidualWalk::default();
            let seeds = if options.quick { 2 } else { 10 };
            let (found, strip) = (step.measure(&walk, seeds)?, step.measure(&Strip::default(), seeds)?);
            table.row([
                format!("{cells}²"),
                format!("{:.1}", step.stiffness()),
                format!("{:.0}", found.evaluations / walk.walks as f64),
                format!("{:.1e}", step.do_nothing()),
                format!("{:.1e}", found.error),
                own(found.standard_error),
                format!("{:.2}", found.seconds * 1e6 / step.points() as f64),
                format!("{:.1e}", strip.error),
                format!("{:.4} %", 100.0 * strip.error / step.shortest_edge()),
                strip.exchanges.to_string(),
                format!("{:.2}", strip.seconds * 1e6 / step.points() as f64),
            ]);
        }
    }
    table.note("a run says so where the standard error is above 5 % of the shortest edge, and ends with noisy-interface where it is above 100 %");
    table.note("where walks would take more than 64 jumps the default does none and is the strip");
    Ok(table)
}

/// The guess of an estimator taken as it is: relaxation, no walk.
struct SweepsAlone {
    walk: ResidualWalk,
    decomposition: Decomposition,
}

impl MeshGenerator for SweepsAlone {
    fn solve(&mut self, equation: &Mmpde, mesh: &Mesh<2>, rho: &[f64], dt: f64) -> Result<Moved, Failure> {
        let lattice = mesh.lattice();
        let operator = equation.operator(lattice, rho, dt)?;
        let mut x = mesh.x().to_vec();
        move_sides(equation, mesh, rho, dt, &mut x, &mut Robust::default())?;
        let problem = Problem::new(equation, &operator, mesh, rho, dt, &x, 0, 0);
        let guess = self.walk.estimate(&problem, &[], &mut Strips::new(&self.decomposition))?.guess;
        x.copy_from_slice(&guess);
        let zero = [[0.0; 2]; 2];
        for patch in self.decomposition.patches() {
            let solver = &mut Robust::<2>::default();
            let (inside, _) = operator.solve::<5, 2>(patch, mesh.x(), &guess, zero, solver, [1.0; 2])?;
            patch.scatter(lattice, &inside, &mut x, zero);
        }
        Ok(Moved { mesh: mesh.moved(x)?, work: Work::default(), interface: None })
    }
}

/// Many steps: how far the mesh of case B is from the single domain's at t = .75, with and without walks.
fn coupled(options: Options) -> Result<Table> {
    let mut table = Table::new(
        "500 coupled steps of case B to t = .75, 4×4: distance of the mesh from the single domain's",
        &["estimator", "mesh rms", "shortest edge"],
    );
    let lattice = Lattice::bounded([40, 40])?;
    let run = |generator: Box<dyn MeshGenerator>| -> Result<Mesh<2>> {
        let mut simulation = Simulation {
            physics: Box::new(Burgers::new(0.005, Convection::Conservative)?),
            monitor: Box::new(Arclength::default()),
            mover: Mover::by(generator, Mmpde::published()),
            coupling: Coupling::default(),
            safety: Safety::default(),
            schedule: Schedule::new(0.25, 0.75, 1e-3, vec![0.75])?,
        };
        let mut state = simulation.start(Mesh::uniform(lattice, [0.0; 2], [1.0; 2])?)?;
        simulation.run(&mut state, &mut Record::default(), &mut [])?;
        Ok(state.mesh)
    };
    let whole = run(Box::<Whole>::default())?;
    let jacobi = |walks| ResidualWalk { sweeps: Auto::Value(4), walks, smoother: Smoother::Jacobi };
    let walking = |walk: ResidualWalk| -> Box<dyn MeshGenerator> {
        Box::new(Stochastic::new([4, 4], 1, EstimatorKind::ResidualWalk(walk)))
    };
    let strip =
        |strip: Strip| -> Box<dyn MeshGenerator> { Box::new(Stochastic::new([4, 4], 1, EstimatorKind::Strip(strip))) };
    let sampled = |placement| -> Box<dyn MeshGenerator> {
        let mut generator = Stochastic::new([4, 4], 1, EstimatorKind::default());
        generator.interface = Some(Interpolation { sample: 9, placement });
        Box::new(generator)
    };
    let alone = |walk: ResidualWalk| -> Result<Box<dyn MeshGenerator>> {
        Ok(Box::new(SweepsAlone { walk, decomposition: Decomposition::new(&lattice, [4, 4])? }))
    };
    let mut rows = vec![
        ("k=4 by Jacobi, no walk", alone(jacobi(1))?),
        ("k=4 by Jacobi, N=1", walking(jacobi(1))),
        ("k=4 by Jacobi, N=10", walking(jacobi(10))),
        ("strip of 8 cells, no coarse lattice", strip(Strip::plain(8))),
        ("strip, its default", strip(Strip::default())),
        ("the default", walking(ResidualWalk::default())),
        ("the default on 9 nodes of each interface, by density", sampled(Placement::Density)),
        ("the default on 9 nodes of each interface, evenly", sampled(Placement::Uniform)),
    ];
    if options.quick {
        rows.remove(1);
    }
    for (label, generator) in rows {
        let cells = match run(generator) {
            Ok(mesh) => [format!("{:.1e}", compare(&mesh, &whole).mesh_rms), format!("{:.1e}", mesh.shortest_edge())],
            Err(error) => [error.to_string(), String::new()],
        };
        table.row([label.to_string()].into_iter().chain(cells));
    }
    table.note("few sweeps without walks leave errors that have a sign and add up from step to step; walks make each step's error independent of the last");
    Ok(table)
}
