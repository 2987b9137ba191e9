//! One mesh step of Burgers' front, for estimators of interface values to be measured on.

use driftmesh::density::{Arclength, Strength};
use driftmesh::error::{Failure, Result};
use driftmesh::geometry::{Density, Lattice, Mesh};
use driftmesh::meshing::{
    Decomposition, Estimator, MeshGenerator, MeshOperator, Mmpde, Problem, Strips, Whole, move_sides,
};
use driftmesh::mover::Mover;
use driftmesh::numerics::linear::Robust;
use driftmesh::physics::{Burgers, Convection};
use driftmesh::simulation::{Coupling, Record, Safety, Schedule, Simulation};
use std::time::Instant;

/// One mesh step of Burgers' front with its exact solution on the whole lattice, for estimators to be measured on.
pub struct InterfaceStep {
    equation: Mmpde,
    mesh: Mesh<2>,
    rho: Density,
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
    pub fn new(mesh: Mesh<2>, rho: Density, equation: Mmpde, dt: f64, subdomains: [usize; 2]) -> Result<Self, Failure> {
        let lattice = *mesh.lattice();
        let operator = equation.operator(&lattice, &rho, dt)?;
        let mut new = mesh.x().to_vec();
        move_sides(&equation, &mesh, &rho, dt, &mut new, &mut Robust::default())?;
        let exact = Whole::default().step(&equation, &mesh, &rho, dt)?.mesh.x().to_vec();
        let decomposition = Decomposition::new(&lattice, subdomains)
            .map_err(|_| Failure::Subdomains { subdomains: subdomains.into(), cells: lattice.cells().into() })?;
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
