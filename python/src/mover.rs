//! What moves meshes of lines and of the plane by the same settings.

use driftmesh::density::{Monitor, MonitorKind};
use driftmesh::geometry::{Lattice, Mesh, check_unfolded};
use driftmesh::meshing::{Fixed, Form, GeneratorKind, LineGeneratorKind, MeshGenerator, Mmpde, Movable};
use driftmesh::mover::{Care, Followed, Gait, Mover, Step};
use driftmesh::simulation::Safety;
use driftmesh::study::{MeshForm, MeshTable};
use driftmesh::{Error, Failure};
use serde::Deserialize;
use std::sync::TryLockError;

/// The tables of a study that move a mesh.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
#[serde(bound = "G: Default + Deserialize<'de>")]
pub struct Settings<G: Default = GeneratorKind> {
    pub monitor: MonitorKind,
    pub mesh: MeshTable<G>,
    #[serde(default)]
    pub safety: Safety,
}

/// The same settings for lines and for the plane.
pub struct Movers {
    pub line: Parts<1>,
    pub plane: Parts<2>,
}

/// Refuses settings that do not fit a lattice.
type Check<const D: usize> = Box<dyn Fn(&Lattice<D>) -> driftmesh::Result<()> + Send>;

/// A mover in D dimensions.
pub struct Parts<const D: usize> {
    pub monitor: Box<dyn Monitor<D>>,
    pub mover: Mover<D>,
    pub check: Check<D>,
    /// The mesh that the last step led to, of a domain that is no box in the unit square, and how it was going:
    /// forgotten where the next step starts from another mesh.
    pub last: Option<(Mesh<D>, Gait<D>)>,
}

impl AsMut<Parts<1>> for Movers {
    fn as_mut(&mut self) -> &mut Parts<1> {
        &mut self.line
    }
}

impl AsMut<Parts<2>> for Movers {
    fn as_mut(&mut self) -> &mut Parts<2> {
        &mut self.plane
    }
}

impl Movers {
    /// Movers whose subdomains, if there are any, are those of the plane.
    pub fn of_plane(settings: Settings) -> driftmesh::Result<Self> {
        let kind = settings.mesh.generator.clone();
        let (on_lines, divides) = match &kind {
            GeneratorKind::Whole(_) => (LineGeneratorKind::default(), false),
            GeneratorKind::Fixed(_) => (LineGeneratorKind::Fixed(Fixed {}), false),
            // refused before any step
            GeneratorKind::Stochastic(_) | GeneratorKind::Schwarz(_) => (LineGeneratorKind::default(), true),
        };
        let rule = "a mesh of a line needs one number of subdomains, such as subdomains=4";
        let refused = move |_: &Lattice<1>| match divides {
            true => Err(Error::invalid("method", "one with subdomains along two axes", rule)),
            false => Ok(()),
        };
        let check = move |lattice: &Lattice<2>| kind.check(lattice).map_err(|error| error.within("mesh.generator"));
        let in_plane = settings.mesh.generator.clone().into_generator();
        Self::new(&settings, (on_lines.into_generator(), Box::new(refused)), (in_plane, Box::new(check)))
    }

    /// Movers with subdomains of a line.
    pub fn of_lines(settings: Settings<LineGeneratorKind>) -> driftmesh::Result<Self> {
        let kind = settings.mesh.generator.clone();
        let rule = "a mesh in the plane needs a number of subdomains for each axis, such as subdomains=(4, 4)";
        let refused =
            move |_: &Lattice<2>| Err(Error::invalid("method", "one with subdomains along a single axis", rule));
        let check = move |lattice: &Lattice<1>| kind.check(lattice).map_err(|error| error.within("mesh.generator"));
        let on_lines = settings.mesh.generator.clone().into_generator();
        let unused = GeneratorKind::default().into_generator();
        Self::new(&settings, (on_lines, Box::new(check)), (unused, Box::new(refused)))
    }

    fn new<G: Default>(
        Settings { monitor, mesh, safety }: &Settings<G>,
        (on_lines, check_line): (Box<dyn MeshGenerator<1>>, Check<1>),
        (in_plane, check_plane): (Box<dyn MeshGenerator<2>>, Check<2>),
    ) -> driftmesh::Result<Self> {
        monitor.check().map_err(|error| error.within("monitor"))?;
        safety.check().map_err(|error| error.within("safety"))?;
        let form = match mesh.form {
            MeshForm::Gradient => Form::Gradient(monitor.gradient()),
            MeshForm::Conservative => Form::Conservative,
        };
        let equation = Mmpde { relaxation: mesh.relaxation, form };
        equation.check().map_err(|error| error.within("mesh"))?;
        let care = Care { substeps: safety.substeps, smoothing: safety.smoothing };
        Ok(Self {
            line: Parts::new(monitor.clone(), on_lines, equation, care, check_line)?,
            plane: Parts::new(monitor.clone(), in_plane, equation, care, check_plane)?,
        })
    }
}

impl<const D: usize> Parts<D>
where
    Mesh<D>: Movable<D>,
{
    fn new(
        monitor: MonitorKind,
        generator: Box<dyn MeshGenerator<D>>,
        equation: Mmpde,
        care: Care,
        check: Check<D>,
    ) -> driftmesh::Result<Self> {
        let mover = Mover { generator, equation, care };
        Ok(Self { monitor: monitor.into_monitor(&[])?, mover, check, last: None })
    }

    pub fn step(&mut self, mesh: &Mesh<D>, u: &[f64], dt: f64) -> Result<Step<D>, Failure> {
        check_unfolded(mesh)?;
        let gait = match self.last.take() {
            Some((last, gait)) if last == *mesh.parameters() => gait,
            _ => Gait::at_rest(mesh),
        };
        let rho = self.monitor.density(mesh, u, None)?;
        let step = self.mover.step(mesh, &gait, Followed { u, rho: &rho }, dt);
        // a step that failed may be tried again with other values
        self.last = Some(match &step {
            Ok(step) => (step.moved.mesh.parameters().clone(), step.gait.clone()),
            Err(_) => (mesh.parameters().clone(), gait),
        });
        step
    }
}

/// What to say of a generator that cannot be used.
pub fn busy<T>(error: TryLockError<T>) -> &'static str {
    match error {
        TryLockError::WouldBlock => "this generator is still at work on another step; wait, or use two",
        TryLockError::Poisoned(_) => "this generator broke in an earlier step; make a new one",
    }
}
