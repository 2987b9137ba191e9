use super::Source;
use crate::density::{ArclengthTable, GivenTable, MonitorKind};
use crate::error::{Error, Result};
use crate::geometry::{Lattice, Mesh};
use crate::meshing::{Form, GeneratorKind, Mmpde, Relaxation};
use crate::mover::{Ending, Mover};
use crate::output::{CheckpointsAt, FramesAt};
use crate::physics::{PdeKind, Physics, UniformBurgers, formula};
use crate::setting::{Auto, pair};
use crate::simulation::{Coupling, Observer, Record, Safety, Schedule, Simulation, State, timed};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A study of kind `moving-mesh`: a PDE on a mesh that follows its solution.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MovingMesh {
    /// `[study]`.
    pub study: Header,
    /// `[domain]`.
    #[serde(default)]
    pub domain: Domain,
    /// `[grid]`.
    pub grid: Grid,
    /// `[time]`.
    pub time: Time,
    /// `[pde]`.
    pub pde: PdeKind,
    /// `[monitor]`. Left out, it is `auto`; `given` where `pde.rho` prescribes the density; `arclength` where the mesh does
    /// not move, since no mesh follows it and it is the cheapest.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub monitor: Option<MonitorKind>,
    /// `[mesh]`.
    #[serde(default)]
    pub mesh: MeshTable,
    /// `[safety]`.
    #[serde(default)]
    pub safety: Safety,
    /// `[compare]`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub compare: Option<Compare>,
    /// `[output]`.
    #[serde(default)]
    pub output: Output,
}

/// `[compare]`: the same study with another generator, as a reference for the mesh.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Compare {
    /// How the mesh of the reference moves.
    pub generator: GeneratorKind,
}

/// `[study]`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Header {
    /// Letters, digits, `-`, `_` and `.`; names the run directory.
    pub name: String,
    /// What is studied.
    pub kind: StudyKind,
}

impl Header {
    /// Refuses a name that is none for a directory.
    ///
    /// # Errors
    /// [`Error::Invalid`].
    pub(super) fn check_name(&self) -> Result<()> {
        let name = &self.name;
        let plain = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
        if name.is_empty() || name.len() > 100 || name.starts_with('.') || !name.chars().all(plain) {
            let rule = "must be 1 to 100 of the characters a-z A-Z 0-9 - _ . and not begin with a dot";
            return Err(Error::invalid("study.name", format!("{name:?}"), rule));
        }
        Ok(())
    }
}

/// What a study is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum StudyKind {
    /// A PDE in two dimensions on a moving mesh.
    MovingMesh,
    /// Poisson's equation on a mesh of any shape.
    Poisson,
    /// Two phases and the front between them.
    Stefan,
    /// A mesh on a line, and the Schwarz methods for it.
    Equidistribution,
}

/// `[domain]`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Domain {
    /// Lower corner of the box.
    #[serde(deserialize_with = "pair")]
    pub lower: [f64; 2],
    /// Upper corner of the box.
    #[serde(deserialize_with = "pair")]
    pub upper: [f64; 2],
    /// Axes that wrap around.
    #[serde(deserialize_with = "pair")]
    pub periodic: [bool; 2],
}

impl Default for Domain {
    fn default() -> Self {
        Self { lower: [0.0; 2], upper: [1.0; 2], periodic: [false; 2] }
    }
}

/// `[grid]`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Grid {
    /// Cells along each axis.
    #[serde(deserialize_with = "pair")]
    pub cells: [usize; 2],
}

/// `[time]`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Time {
    /// Time of the initial state.
    pub start: f64,
    /// Time of the last state.
    pub end: f64,
    /// Longest step, or as the solution allows; steps are shortened evenly such that reports and end are met exactly. Where
    /// there is a tolerance, the first step too.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub step: Option<Auto<f64>>,
    /// Error that a step may make in time, as a share of the range of the solution: steps are as long as that allows.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tolerance: Option<f64>,
    /// Times at which `summary.json` reports; the end where none are given.
    #[serde(default)]
    pub report: Vec<f64>,
    /// How the equation is stepped; its own implicit scheme where nothing is said.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stepper: Option<Stepper>,
    /// Order in space of `stepper`, 2 or 4; 2 where nothing is said.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub order: Option<usize>,
}

/// A stepper other than the equation's own.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Stepper {
    /// Explicit, for Burgers' equation on a uniform mesh that stays; substeps of `time.step` are as long as is stable.
    Rk4,
}

/// `[mesh]`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MeshTable {
    /// τ of the mesh equation.
    pub relaxation: Relaxation,
    /// Form of the mesh equation.
    pub form: MeshForm,
    /// The mesh at the start; adapted where nothing is said, but uniform where the mesh does not move.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub start: Option<StartMesh>,
    /// How the mesh moves.
    pub generator: GeneratorKind,
    /// How mesh and physics alternate.
    pub coupling: Coupling,
}

impl Default for MeshTable {
    fn default() -> Self {
        Self {
            relaxation: Mmpde::default().relaxation,
            form: MeshForm::Conservative,
            start: None,
            generator: GeneratorKind::default(),
            coupling: Coupling::default(),
        }
    }
}

/// Form of the mesh equation.
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

/// `[output]`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Output {
    /// When frames are written; about twenty of them where nothing is said.
    pub frames: Option<FramesAt>,
    /// When a checkpoint is written, from which a run that ends early goes on; every minute where nothing is said. A study
    /// without time steps has none, and begins again.
    pub checkpoint: CheckpointsAt,
    /// Whether the frames become `animation.gif`.
    pub animation: bool,
    /// Whether the run ends with `report.html` and its plots.
    pub report: bool,
}

impl Default for Output {
    fn default() -> Self {
        Self { frames: None, checkpoint: CheckpointsAt::default(), animation: false, report: true }
    }
}

impl Output {
    /// Refuses settings out of range that do not depend on the rest of the study.
    ///
    /// # Errors
    /// [`Error::Invalid`].
    pub(super) fn check(&self) -> Result<()> {
        self.checkpoint.check().map_err(|error| error.within("output"))
    }
}

/// Memory that a run needs for each node: 2250 bytes measured at 600 × 600 cells with subdomains and a reference, and a
/// reserve.
const BYTES_PER_NODE: u128 = 2600;
const FRAMES_BY_DEFAULT: usize = 20;
/// Places along an axis at which formulas are looked at.
const SAMPLES: usize = 100;
/// A difference, as a share of the largest value, that is not of rounding.
const NOT_ROUNDING: f64 = 1e-9;

impl MovingMesh {
    /// Reads and checks a study, every default filled in.
    ///
    /// # Errors
    /// [`Error::Study`] at the place of the first mistake.
    pub fn from_source(source: &Source) -> Result<Self> {
        let mut study: Self = source.parse()?;
        study.resolve().map_err(|error| source.locate(error))?;
        Ok(study)
    }

    /// Checks all settings and fills in the defaults that depend on others.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the dotted key of the first setting out of range.
    pub fn resolve(&mut self) -> Result<()> {
        self.study.check_name()?;
        self.pde.check().map_err(|error| error.within("pde"))?;
        self.check_axes()?;
        self.check_stepper()?;
        self.check_tolerance()?;
        self.safety.check().map_err(|error| error.within("safety"))?;
        self.check_size()?;
        let lattice = *self.uniform_mesh()?.lattice();
        self.mesh.generator.check(&lattice).map_err(|error| error.within("generator").within("mesh"))?;
        if let Some(compare) = &self.compare {
            compare.generator.check(&lattice).map_err(|error| error.within("generator").within("compare"))?;
        }
        let prescribed_density = matches!(&self.pde, PdeKind::Prescribed(p) if p.rho.is_some());
        let stays = matches!(self.mesh.generator, GeneratorKind::Fixed(_));
        let monitor = self.monitor.get_or_insert_with(|| match prescribed_density {
            true => MonitorKind::GivenTable(GivenTable::default()),
            // no mesh follows it: the cheap one
            false if stays => MonitorKind::ArclengthTable(ArclengthTable::default()),
            false => MonitorKind::default(),
        });
        monitor.check().map_err(|error| error.within("monitor"))?;
        let unknowns = self.pde.clone().into_physics().map_err(|error| error.within("pde"))?.unknowns();
        monitor.clone().into_monitor(&unknowns).map_err(|error| error.within("monitor"))?;
        if prescribed_density && !matches!(monitor, MonitorKind::GivenTable(_)) {
            let rule = "pde.rho is the density itself; set it to \"given\", or leave [monitor] out";
            return Err(Error::invalid("monitor.kind", format!("\"{}\"", monitor.name()), rule));
        }
        self.mesh.start.get_or_insert(match self.mesh.generator {
            GeneratorKind::Fixed(_) => StartMesh::Uniform,
            _ => StartMesh::Adapted,
        });
        self.equation().check().map_err(|error| error.within("mesh"))?;
        self.mesh.coupling.check().map_err(|error| error.within("coupling").within("mesh"))?;
        if self.time.report.is_empty() {
            self.time.report = vec![self.time.end];
        }
        let Time { start, end, .. } = self.time;
        let frames_by_default = match self.schedule()?.steps() {
            Some(steps) => FramesAt::Every(steps.div_ceil(FRAMES_BY_DEFAULT)),
            None => {
                let part = |n: usize| start + (end - start) * n as f64 / FRAMES_BY_DEFAULT as f64;
                FramesAt::Times((1..FRAMES_BY_DEFAULT).map(part).collect())
            }
        };
        let frames = self.output.frames.get_or_insert(frames_by_default);
        frames.check([start, end]).map_err(|error| error.within("output"))?;
        self.output.check()
    }

    /// Refuses axes that the equation is not made for.
    fn check_axes(&self) -> Result<()> {
        let periodic = self.domain.periodic;
        let (wrong, rule) = match &self.pde {
            PdeKind::Burgers(burgers) if burgers.initial.is_none() => (
                periodic.contains(&true),
                "the front of pde.kind = \"burgers\" needs bounded axes; set it to [false, false], or give pde.initial",
            ),
            PdeKind::Burgers(burgers) => (
                periodic.contains(&false) == burgers.boundary.is_none(),
                match burgers.boundary {
                    None => {
                        "pde.initial needs pde.boundary beside it on bounded axes; add it, or make both axes periodic"
                    }
                    Some(_) => "pde.boundary has no side to stand on; leave it out, or make an axis bounded",
                },
            ),
            PdeKind::ShallowWater(_) => {
                (periodic.contains(&false), "pde.kind = \"shallow-water\" needs periodic axes; set it to [true, true]")
            }
            PdeKind::FormulaPde(pde) => return pde.check_sides(periodic).map_err(|error| error.within("pde")),
            PdeKind::Prescribed(_) => (false, ""),
        };
        if !wrong {
            return Ok(());
        }
        Err(Error::invalid("domain.periodic", format!("{periodic:?}"), rule))
    }

    /// Refuses a stepper that the rest of the study does not go with, and fills in its order.
    fn check_stepper(&mut self) -> Result<()> {
        if let (None, Some(order)) = (self.time.stepper, self.time.order) {
            return Err(Error::invalid(
                "time.order",
                order,
                "only stepper = \"rk4\" has one; add it, or leave this out",
            ));
        }
        if self.time.stepper.is_some() {
            self.time.order.get_or_insert(2);
            self.physics()?;
        }
        Ok(())
    }

    /// Refuses a tolerance that the rest of the study does not go with, and fills in the step where there is none.
    fn check_tolerance(&mut self) -> Result<()> {
        let Some(tolerance) = self.time.tolerance else {
            self.time.step.get_or_insert_default();
            return Ok(());
        };
        if self.time.step == Some(Auto::Auto) {
            let rule =
                "time.tolerance decides on the steps; leave one of both out, or give the longest step as a number";
            return Err(Error::invalid("time.step", "\"auto\"", rule));
        }
        let rule = match (&self.pde, self.time.stepper) {
            (_, Some(Stepper::Rk4)) => "stepper = \"rk4\" has steps of its own; leave one of both out",
            (PdeKind::Prescribed(_), _) => "pde.kind = \"prescribed\" has no error in time; leave it out",
            _ => return Ok(()),
        };
        Err(Error::invalid("time.tolerance", tolerance, rule))
    }

    /// The equation with its stepper.
    fn physics(&self) -> Result<Box<dyn Physics>> {
        let physics = self.pde.clone().into_physics().map_err(|error| error.within("pde"))?;
        if self.time.stepper.is_none() {
            return Ok(physics);
        }
        match (&self.pde, &self.mesh.generator) {
            (PdeKind::Burgers(burgers), GeneratorKind::Fixed(_)) => {
                let uniform = UniformBurgers::new(burgers.clone(), self.time.order.unwrap_or(2));
                Ok(Box::new(uniform.map_err(|error| error.within("time"))?))
            }
            _ => {
                let rule = "steps pde.kind = \"burgers\" on a mesh that stays; set mesh.generator to \
                            { kind = \"fixed\" }, or leave time.stepper out";
                Err(Error::invalid("time.stepper", "\"rk4\"", rule))
            }
        }
    }

    /// What is allowed but probably not meant: formulas that are not periodic on periodic axes, or that contradict each
    /// other on a side.
    ///
    /// # Errors
    /// As [`MovingMesh::resolve`].
    pub fn warnings(&self) -> Result<Vec<String>> {
        let mut warnings = Vec::new();
        let Domain { lower, upper, periodic } = self.domain;
        let samples =
            |d: usize| (0..=SAMPLES).map(move |k| lower[d] + (upper[d] - lower[d]) * k as f64 / SAMPLES as f64);
        for (key, text) in self.pde.formulas() {
            let f = formula(&key, text).map_err(|error| error.within("pde"))?;
            for d in (0..2).filter(|&d| periodic[d]) {
                let mut jump = 0.0_f64;
                let mut size = 0.0_f64;
                for (t, along) in
                    [self.time.start, self.time.end].iter().flat_map(|t| samples(1 - d).map(move |s| (t, s)))
                {
                    let at = |across: f64| {
                        let x = if d == 0 { [across, along] } else { [along, across] };
                        f.eval(&[x[0], x[1], *t])
                    };
                    jump = jump.max((at(lower[d]) - at(upper[d])).abs());
                    size = samples(d).fold(size, |size, across| size.max(at(across).abs()));
                }
                if jump > NOT_ROUNDING * size {
                    let axis = ["x", "y"][d];
                    warnings.push(format!(
                        "`pde.{key}` is not periodic along {axis}: from {axis} = {} to {axis} = {} it jumps by up to {jump:.1e}",
                        upper[d], lower[d]
                    ));
                }
            }
        }
        for [(at_start, initial), (on_sides, boundary)] in self.pde.starts_and_sides() {
            let [initial, boundary] = [formula(&at_start, initial)?, formula(&on_sides, boundary)?];
            let mut worst = (0.0_f64, [0.0; 2]);
            // of the data everywhere: what is far below that is rounding
            let inside = (0..100).map(|k| [0, 1].map(|d| [k % 10, k / 10][d] as f64 / 9.0));
            let inside = inside.map(|s| [0, 1].map(|d| lower[d] + s[d] * (upper[d] - lower[d])));
            let at = |[x, y]: [f64; 2]| initial.eval(&[x, y, self.time.start]).abs();
            let mut size = inside.map(at).filter(|u| u.is_finite()).fold(0.0_f64, f64::max);
            for d in (0..2).filter(|&d| !periodic[d]) {
                for (across, along) in [lower[d], upper[d]].iter().flat_map(|x| samples(1 - d).map(move |s| (*x, s))) {
                    let x = if d == 0 { [across, along] } else { [along, across] };
                    let [u, side] = [&initial, &boundary].map(|f| f.eval(&[x[0], x[1], self.time.start]));
                    size = size.max(u.abs()).max(side.abs());
                    if (u - side).abs() > worst.0 {
                        worst = ((u - side).abs(), x);
                    }
                }
            }
            if worst.0 > NOT_ROUNDING * size {
                let (gap, [x, y]) = worst;
                warnings.push(format!(
                    "`pde.{on_sides}` is not `pde.{at_start}` at the start: on the sides they differ by up to {gap:.1e}, at x = {x}, y = {y}"
                ));
            }
        }
        Ok(warnings)
    }

    /// Memory that the run needs, in bytes.
    pub fn memory(&self) -> u128 {
        self.grid.cells.iter().map(|&n| n as u128 + 1).product::<u128>() * BYTES_PER_NODE
    }

    fn check_size(&self) -> Result<()> {
        let lattice = Lattice::new(self.grid.cells, self.domain.periodic).map_err(|error| error.within("grid"))?;
        let nodes = lattice.nodes().into_iter().map(|n| n as u128).product();
        super::memory::check_memory(nodes, BYTES_PER_NODE, &self.grid.cells)
    }

    fn schedule(&self) -> Result<Schedule> {
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

    fn equation(&self) -> Mmpde {
        let form = match self.mesh.form {
            MeshForm::Gradient => Form::Gradient(self.monitor().gradient()),
            MeshForm::Conservative => Form::Conservative,
        };
        Mmpde { relaxation: self.mesh.relaxation, form }
    }

    /// The state that the run starts from; `record` gets the time that it took, and a warning where the mesh does not come
    /// to rest. Observers see the states in between.
    ///
    /// # Errors
    /// [`Error::Failed`] where there is none, or what an observer returned.
    pub fn start(
        &self,
        simulation: &Simulation,
        record: &mut Record,
        observers: &mut [&mut dyn Observer],
    ) -> Result<State> {
        record.timed(|record| {
            let mut mesh = self.uniform_mesh()?;
            if self.mesh.start == Some(StartMesh::Adapted) {
                let start = timed(&mut record.seconds.mesh, || simulation.adapted(mesh, observers))?;
                mesh = start.mesh;
                let why = match start.end {
                    Ending::AtRest => None,
                    Ending::Jump => Some("the initial solution jumps, and no mesh resolves a jump; it starts with a thousandth of a uniform cell there"),
                    Ending::Restless => Some("the mesh does not come to rest on the initial solution, which may be too thin for grid.cells or noisy; it starts where it was last"),
                };
                record.warnings.extend(why.map(|why| format!("`mesh.start`: {why}")));
            }
            let state = simulation.start(mesh)?;
            record.warnings.extend(simulation.doubts(&state));
            Ok(state)
        })
    }

    /// Equal cells.
    ///
    /// # Errors
    /// [`Error::Invalid`] where the grid or the domain makes no mesh.
    pub fn uniform_mesh(&self) -> Result<Mesh<2>> {
        let lattice = Lattice::new(self.grid.cells, self.domain.periodic).map_err(|error| error.within("grid"))?;
        Mesh::uniform(lattice, self.domain.lower, self.domain.upper).map_err(|error| error.within("domain"))
    }

    /// The simulation that this study describes.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the dotted key of a setting out of range.
    pub fn simulation(&self) -> Result<Simulation> {
        let physics = self.physics()?;
        let monitor = self.monitor().into_monitor(&physics.unknowns()).map_err(|error| error.within("monitor"))?;
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

    /// The remedy for an error in the keys of this study, with the value that each has now.
    pub fn remedy(&self, error: &Error) -> Option<String> {
        super::remedy::remedy(self, error)
    }

    /// The study as a file, every default filled in.
    pub fn to_toml(&self) -> String {
        toml::to_string(self).expect("a study is plain data")
    }
}
