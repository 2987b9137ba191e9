use super::interface_step::{InterfaceStep, Measured};
use super::{Options, Table};
use driftmesh::Auto;
use driftmesh::Work;
use driftmesh::density::Arclength;
use driftmesh::error::{Failure, Result};
use driftmesh::geometry::{Density, Lattice, Mesh, compare};
use driftmesh::meshing::{
    Decomposition, Estimator, EstimatorKind, GridWalk, Interpolation, MeshGenerator, Mmpde, MonteCarlo, Moved,
    Placement, Problem, ResidualWalk, Stochastic, Strip, Strips, Whole, move_sides,
};
use driftmesh::mover::Mover;
use driftmesh::numerics::linear::{Robust, Smoother};
use driftmesh::physics::{Burgers, Convection};
use driftmesh::simulation::{Coupling, Record, Safety, Schedule, Simulation};

/// What an estimator says of its own error, if anything.
fn own(standard_error: f64) -> String {
    if standard_error.is_nan() { String::new() } else { format!("{standard_error:.1e}") }
}

/// Estimators with their names.
fn estimators(quick: bool) -> Vec<(&'static str, EstimatorKind)> {
    let paths = |paths, substeps| MonteCarlo::new(paths, substeps);
    let residual = |sweeps, walks| {
        EstimatorKind::ResidualWalk(ResidualWalk { sweeps: Auto::Value(sweeps), walks, smoother: Smoother::Jacobi })
    };
    let grid = |walks, increment| EstimatorKind::GridWalk(GridWalk { walks, increment });
    let (monte, strip) = (EstimatorKind::MonteCarlo, EstimatorKind::Strip);
    let mut all = vec![
        ("Monte Carlo N=10⁴ M=10, as published", monte(paths(10_000, 10))),
        ("Monte Carlo N=10³ M=10", monte(paths(1000, 10))),
        ("  antithetic, N=10⁴", monte(MonteCarlo { antithetic: true, ..paths(10_000, 10) })),
        ("  control variate, N=10⁴", monte(MonteCarlo { control_variate: true, ..paths(10_000, 10) })),
        ("  common random numbers, N=10⁴", monte(MonteCarlo { common: true, ..paths(10_000, 10) })),
        ("  Sobol, N=1024 M=8", monte(MonteCarlo { sobol: true, ..paths(1024, 8) })),
        ("grid walk N=10", grid(10, false)),
        ("grid walk N=100", grid(100, false)),
        ("grid walk N=10⁴", grid(10_000, false)),
        ("grid walk on the increment, N=10", grid(10, true)),
        ("grid walk on the increment, N=100", grid(100, true)),
        ("residual walk k=4 N=10, Jacobi", residual(4, 10)),
        ("residual walk k=16 N=10, Jacobi", residual(16, 10)),
        ("residual walk, the default", EstimatorKind::default()),
        ("strip of 4 cells, no coarse lattice", strip(Strip::plain(4))),
        ("strip of 8 cells, no coarse lattice", strip(Strip::plain(8))),
        ("strip, its default", strip(Strip::default())),
    ];
    if quick {
        all.retain(|(name, _)| !name.starts_with("  common"));
    }
    all
}

pub(super) fn run(options: Options) -> Result<Vec<Table>> {
    let step = InterfaceStep::case_a(40)?;
    let seeds = if options.quick { 2 } else { 10 };
    let title = format!(
        "One mesh step at 41², Δt = 1e-3, t = .75, 4×4: {} interface points, mean of ten seeds{}",
        step.points(),
        if options.quick { ", of two for Monte Carlo" } else { "" }
    );
    let mut table = Table::new(
        title,
        &[
            "estimator",
            "evaluations a point",
            "sweeps",
            "error",
            "its own estimate",
            "nodes read",
            "gathered",
            "handed on a point",
            "µs a point",
            "times the default",
        ],
    );
    let default = step.measure(EstimatorKind::default().estimator(), 10)?;
    let us = |seconds: f64| seconds * 1e6 / step.points() as f64;
    let nothing = format!("{:.1e}", step.do_nothing());
    table.row(["keep the old mesh (do nothing)", "0", "0", &nothing, "", "0", "0", "0", "0", "0"]);
    let mut published = default;
    let mut cheap = default;
    for (name, kind) in estimators(options.quick) {
        // what is quick is measured more often
        let found =
            step.measure(kind.estimator(), if matches!(kind, EstimatorKind::MonteCarlo(_)) { seeds } else { 10 })?;
        table.row([
            name.to_string(),
            format!("{:.0}", found.evaluations),
            found.sweeps.to_string(),
            format!("{:.1e}", found.error),
            own(found.standard_error),
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
    notes(&mut table, &published, &cheap, options);
    Ok(vec![table, over_stiffness(options)?, coupled(options)?])
}

fn notes(table: &mut Table, published: &Measured, cheap: &Measured, options: Options) {
    table.note("error: root mean square over both coordinates of all points, against the discrete step on one domain");
    table.note(
        "its own estimate: the standard error of the samples; it does not see the bias of Monte Carlo, and \
         strips without walks have none",
    );
    table.note(
        "nodes read: by the subdomain with the most, from its neighbours, in the one exchange of a step; \
         gathered: unknowns of a coarse lattice; handed on: walks that another subdomain pays",
    );
    table.note(format!(
        "residual walk k=4 N=10 against Monte Carlo N=10⁴ M=10, {} threads: {:.0} times cheaper at 1/{:.0} of the \
         error",
        rayon::current_num_threads(),
        published.seconds / cheap.seconds,
        published.error / cheap.error
    ));
    if options.quick {
        table.note("quick: two seeds for Monte Carlo, and no common random numbers");
    }
}

/// The default and the strip over a = Δt/(τh²).
fn over_stiffness(options: Options) -> Result<Table> {
    let mut table = Table::new(
        "The default residual walk (N = 10) and the strip over a = Δt/(τh²), from the mesh and density of case A at \
         t = .75",
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
    table.note(
        "a run says so where the standard error is above 5 % of the shortest edge, and ends with \
         noisy-interface where it is above 100 %",
    );
    table.note("where walks would take more than 64 jumps the default does none and is the strip");
    if options.quick {
        table.note("quick: one of two lattices, two seeds in place of ten");
    }
    Ok(table)
}

/// The guess of an estimator taken as it is: relaxation, no walk.
struct SweepsAlone {
    walk: ResidualWalk,
    decomposition: Decomposition,
}

impl MeshGenerator for SweepsAlone {
    fn solve(&mut self, equation: &Mmpde, mesh: &Mesh<2>, rho: &Density, dt: f64) -> Result<Moved, Failure> {
        let lattice = mesh.lattice();
        let operator = equation.operator(lattice, rho, dt)?;
        let mut x = mesh.x().to_vec();
        move_sides(equation, mesh, rho, dt, &mut x, &mut Robust::default())?;
        let problem = Problem::new(equation, &operator, mesh, rho, dt, &x, 0, 0);
        let guess = self.walk.estimate(&problem, &[], &mut Strips::<2, 5>::new(&self.decomposition))?.guess;
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

/// The mesh of case B at t = .75.
fn case_b(lattice: Lattice<2>, generator: Box<dyn MeshGenerator>) -> Result<Mesh<2>> {
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
}

/// Many steps: how far the mesh of case B is from the single domain's at t = .75, with and without walks.
fn coupled(options: Options) -> Result<Table> {
    let mut table = Table::new(
        "500 coupled steps of case B to t = .75, 4×4: distance of the mesh from the single domain's",
        &["estimator", "mesh rms", "shortest edge"],
    );
    let lattice = Lattice::bounded([40, 40])?;
    let whole = case_b(lattice, Box::<Whole>::default())?;
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
        let cells = match case_b(lattice, generator) {
            Ok(mesh) => [format!("{:.1e}", compare(&mesh, &whole).mesh_rms), format!("{:.1e}", mesh.shortest_edge())],
            Err(error) => [error.to_string(), String::new()],
        };
        table.row([label.to_string()].into_iter().chain(cells));
    }
    table.note(
        "few sweeps without walks leave errors that have a sign and add up from step to step; walks make each \
         step's error independent of the last",
    );
    if options.quick {
        table.note("quick: no row of one walk a point");
    }
    Ok(table)
}
