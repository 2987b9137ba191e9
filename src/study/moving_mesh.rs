//! Studies of kind `moving-mesh`: what they say, and what they describe.

use super::common::{Header, Output};
use super::data::DataTables;
use super::dimension::{GeneratorTable, PdeTable, Studied};
use super::mapped::{Ends, Mapping};
use crate::density::MonitorKind;
use crate::error::Result;
use crate::geometry::{Lattice, Mesh};
use crate::meshing::{Form, GeneratorKind, Mmpde, Relaxation};
use crate::mover::{Ending, Mover};
use crate::output::FramesAt;
use crate::physics::{Coordinates, Physics};
use crate::setting::{Auto, Axes};
use crate::simulation::{Coupling, Observer, Record, Safety, Schedule, Simulation, State, timed};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A study of kind `moving-mesh`: a PDE on a mesh that follows its solution.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, bound = "")]
#[schemars(rename = "MovingMesh")]
pub struct MovingStudy<const D: usize>
where
    Mesh<D>: Studied<D>,
{
    /// Name and kind of the study.
    pub study: Header,
    /// Tables of values from files, which every formula may call as functions by their names.
    #[serde(default, skip_serializing_if = "DataTables::is_empty")]
    pub data: DataTables,
    /// The box in which the equation is solved, its periodic axes, and the coordinate along a line.
    #[serde(default)]
    pub domain: Domain<D>,
    /// The number of cells along each axis.
    pub grid: Grid<D>,
    /// Start, end, steps and report times of the run.
    pub time: Time,
    /// The equation that is solved on the mesh.
    pub pde: Pde<D>,
    /// `[monitor]`. Left out, it is `auto`; `given` where `pde.rho` prescribes the density; `arclength` where the mesh
    /// does not move, since no mesh follows it and it is the cheapest.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub monitor: Option<MonitorKind>,
    /// How the mesh follows its density.
    #[serde(default)]
    pub mesh: MeshTable<Generator<D>>,
    /// In which ways, and how often, a step that fails is tried again.
    #[serde(default)]
    pub safety: Safety,
    /// A second run of the study with another mesh generator, as a reference for the meshes of the first.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub compare: Option<Compare<Generator<D>>>,
    /// What a run leaves behind in its directory.
    #[serde(default)]
    pub output: Output,
}

/// A moving mesh in two dimensions.
pub type MovingMesh = MovingStudy<2>;
/// A moving mesh in one dimension.
pub type MovingLine = MovingStudy<1>;

/// `[pde]` in D dimensions.
type Pde<const D: usize> = <Mesh<D> as Studied<D>>::Pde;
/// `mesh.generator` in D dimensions.
type Generator<const D: usize> = <Mesh<D> as Studied<D>>::Generator;

/// `[compare]`: the same study with another generator, as a reference for the mesh.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Compare<G = GeneratorKind> {
    /// How the mesh of the reference moves.
    pub generator: G,
}

/// `[domain]`: the box in which the equation is solved, or the image of the unit square.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Domain")]
pub struct Domain<const D: usize = 2> {
    /// Lower corner of the box.
    #[serde(default = "origin::<D>")]
    pub lower: Axes<f64, D>,
    /// Upper corner of the box.
    #[serde(default = "ones::<D>")]
    pub upper: Axes<f64, D>,
    /// Which axes are periodic, so that their ends are the same place.
    #[serde(default = "bounded::<D>")]
    pub periodic: Axes<bool, D>,
    /// The domain as the image of the unit square: x and y as formulas of its coordinates s and r. The first axis of
    /// the mesh is along s if s, r is a right-handed pair in the image (r lies counter-clockwise of s), else along r.
    /// With `closed`, the closed axis is along the one of s and r at whose two ends the map has the same curve.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub map: Option<Mapping>,
    /// Which axes are closed, so that their ends are the same curve, as in a ring.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub closed: Option<Axes<bool, D>>,
    /// x at the left and at the right side of a domain between the curves `bottom` and `top`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub x: Option<Ends>,
    /// Lower curve of the domain, a formula of x.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bottom: Option<String>,
    /// Upper curve of the domain, a formula of x.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub top: Option<String>,
    /// File with a structured mesh, of which the domain has the shape.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mesh: Option<String>,
    /// The coordinate along a line: with `cylindrical` and `spherical` it is the distance r from an axis or a point, 0
    /// or more, and volumes have the weight r or r². In one dimension only; `cartesian` where nothing is said.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub coordinates: Option<Coordinates>,
}

impl<const D: usize> Default for Domain<D> {
    fn default() -> Self {
        Self {
            lower: origin(),
            upper: ones(),
            periodic: bounded(),
            map: None,
            closed: None,
            x: None,
            bottom: None,
            top: None,
            mesh: None,
            coordinates: None,
        }
    }
}

fn origin<const D: usize>() -> Axes<f64, D> {
    Axes([0.0; D])
}

fn ones<const D: usize>() -> Axes<f64, D> {
    Axes([1.0; D])
}

fn bounded<const D: usize>() -> Axes<bool, D> {
    Axes([false; D])
}

/// `[grid]`: the number of cells along each axis.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Grid")]
pub struct Grid<const D: usize = 2> {
    /// Number of cells along each axis.
    pub cells: Axes<usize, D>,
}

/// `[time]`: start, end, steps and report times of the run.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Time {
    /// Time of the initial state.
    pub start: f64,
    /// Time of the last state.
    pub end: f64,
    /// Longest time step, or "auto" for steps that the solution decides, the default. Steps are shortened evenly so
    /// that report times and the end are met exactly. With a tolerance this is the first step as well.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub step: Option<Auto<f64>>,
    /// Error that a step may make in time, as a share of the range of the solution: steps are as long as that allows.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tolerance: Option<f64>,
    /// Times at which `summary.json` reports; the end where none are given.
    #[serde(default)]
    pub report: Vec<f64>,
    /// How the equation is stepped. Where nothing is said, formulas with diffusion or a source by `tr-bdf2`, all else
    /// by the trapezoid.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stepper: Option<Stepper>,
    /// Order in space of the stepper `rk4`, 2 or 4; 2 where nothing is said.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub order: Option<usize>,
}

/// How the equation is stepped in time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Stepper {
    /// Implicit, half of the change at the start and half of that at the end of a step. What decays within a step
    /// swings about zero from step to step.
    Trapezoid,
    /// Implicit, the trapezoid and then the second backward difference formula: what decays within a step is gone after
    /// it. For formulas.
    TrBdf2,
    /// Explicit, for Burgers' equation on a uniform mesh that stays; substeps of `time.step` are as long as is stable.
    Rk4,
}

/// `[mesh]`: how the mesh follows its density.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MeshTable<G: Default = GeneratorKind> {
    /// How long the mesh takes to follow its density: "auto", a time τ, or `{ steps = n }` for n time steps.
    pub relaxation: Relaxation,
    /// How the mesh equation is discretised: "conservative", by fluxes, or "gradient", as published.
    pub form: MeshForm,
    /// The mesh at the start: "adapted" to the initial solution, or "uniform". Where nothing is said it is adapted if
    /// the mesh moves.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub start: Option<StartMesh>,
    /// How the mesh equation is solved: on the whole domain, by subdomains, or not at all for a mesh that stays.
    pub generator: G,
    /// How mesh and solution alternate within a time step.
    pub coupling: Coupling,
}

impl<G: Default> Default for MeshTable<G> {
    fn default() -> Self {
        Self {
            relaxation: Mmpde::default().relaxation,
            form: MeshForm::Conservative,
            start: None,
            generator: G::default(),
            coupling: Coupling::default(),
        }
    }
}

/// How the mesh equation is discretised.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum MeshForm {
    /// As published: x_t = (1/τ)(∇ρ/ρ·∇x + ∇²x), with `monitor.gradient`.
    Gradient,
    /// ρ x_t = (1/τ) ∇·(ρ∇x), symmetric and stable for any ρ.
    Conservative,
}

/// The mesh at the start.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum StartMesh {
    /// Equal cells.
    Uniform,
    /// Moved to the density of the initial solution, until it rests there.
    Adapted,
}

impl<const D: usize> MovingStudy<D>
where
    Mesh<D>: Studied<D>,
{
    /// The equation with its stepper.
    pub(super) fn physics(&self) -> Result<Box<dyn Physics<D>>> {
        self.pde.physics(&self.domain, &self.time, self.mesh.generator.stays())
    }

    pub(super) fn schedule(&self) -> Result<Schedule> {
        let Time { start, end, step, tolerance, report, .. } = &self.time;
        match (*step, *tolerance) {
            (Some(Auto::Value(longest)), Some(tolerance)) => {
                Schedule::tolerant(*start, *end, tolerance, Some(longest), report.clone())
            }
            (_, Some(tolerance)) => Schedule::tolerant(*start, *end, tolerance, None, report.clone()),
            (Some(Auto::Value(step)), None) => Schedule::new(*start, *end, step, report.clone()),
            (None | Some(Auto::Auto), None) => Schedule::automatic(*start, *end, report.clone()),
        }
        .map_err(|error| error.within("time"))
    }

    pub(super) fn monitor(&self) -> MonitorKind {
        self.monitor.clone().unwrap_or_default()
    }

    pub(super) fn equation(&self) -> Mmpde {
        let form = match self.mesh.form {
            MeshForm::Gradient => Form::Gradient(self.monitor().gradient()),
            MeshForm::Conservative => Form::Conservative,
        };
        Mmpde { relaxation: self.mesh.relaxation, form }
    }

    /// The state that the run starts from; `record` gets the time that it took, and a warning where the mesh does not
    /// come to rest. Observers see the states in between.
    ///
    /// # Errors
    /// [`Error::Failed`](crate::Error::Failed) where there is none, or what an observer returned.
    pub fn start(
        &self,
        simulation: &Simulation<D>,
        record: &mut Record,
        observers: &mut [&mut dyn Observer],
    ) -> Result<State<D>> {
        record.timed(|record| {
            let mut mesh = self.uniform_mesh()?;
            if self.mesh.start == Some(StartMesh::Adapted) {
                let start = timed(&mut record.seconds.parts.mesh, || simulation.adapted_from(mesh, observers))?;
                mesh = start.mesh;
                let why = match start.end {
                    Ending::AtRest => None,
                    Ending::Jump => Some(
                        "the initial solution changes by much of its range within one of the thinnest cells \
                         that this mesh comes to: it jumps there, which no mesh resolves, or takes more \
                         `grid.cells`",
                    ),
                    Ending::Restless => Some(
                        "the mesh does not come to rest on the initial solution, which may be \
                         too thin for grid.cells or noisy; it starts where it was last",
                    ),
                };
                record.warnings.extend(why.map(|why| format!("`mesh.start`: {why}")));
            }
            let state = simulation.started(mesh)?;
            record.warnings.extend(simulation.doubts(&state));
            Ok(state)
        })
    }

    /// Equal cells, or their image by the map of the domain.
    ///
    /// # Errors
    /// [`Error::Invalid`](crate::Error::Invalid) where the grid or the domain makes no mesh.
    pub fn uniform_mesh(&self) -> Result<Mesh<D>> {
        let lattice = Lattice::new(*self.grid.cells, self.domain.wraps()).map_err(|error| error.within("grid"))?;
        self.data.known(|| Mesh::in_domain(&self.domain, lattice))
    }

    /// The simulation that this study describes.
    ///
    /// # Errors
    /// [`Error::Invalid`](crate::Error::Invalid) with the dotted key of a setting out of range.
    pub fn simulation(&self) -> Result<Simulation<D>> {
        let (physics, monitor) = self.data.known(|| {
            let physics = self.physics()?;
            let monitor = self.monitor().into_monitor(&physics.unknowns());
            Ok::<_, crate::Error>((physics, monitor.map_err(|error| error.within("monitor"))?))
        })?;
        Ok(Simulation {
            physics,
            monitor,
            mover: Mover::by(self.mesh.generator.clone().into_generator(), self.equation()),
            coupling: self.mesh.coupling,
            safety: self.safety,
            schedule: self.schedule()?,
        })
    }

    /// The study with the generator of `[compare]`, if there is one.
    pub(super) fn reference(&self) -> Option<Self> {
        let compare = self.compare.clone()?;
        let mut reference = self.clone();
        reference.mesh.generator = compare.generator;
        Some(reference)
    }

    /// When frames are written.
    pub(super) fn frames(&self) -> FramesAt {
        self.output.frames.clone().unwrap_or(FramesAt::Every(1))
    }
}
