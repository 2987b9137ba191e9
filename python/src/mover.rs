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
pub struct Settings {
    pub monitor: MonitorKind,
    pub mesh: MeshTable,
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
    pub fn new(Settings { monitor, mesh, safety }: Settings) -> driftmesh::Result<Self> {
        monitor.check().map_err(|error| error.within("monitor"))?;
        safety.check().map_err(|error| error.within("safety"))?;
        let form = match mesh.form {
            MeshForm::Gradient => Form::Gradient(monitor.gradient()),
            MeshForm::Conservative => Form::Conservative,
        };
        let equation = Mmpde { relaxation: mesh.relaxation, form };
        equation.check().map_err(|error| error.within("mesh"))?;
        let care = Care { substeps: safety.substeps, smoothing: safety.smoothing };
        let (on_lines, divides) = match &mesh.generator {
            GeneratorKind::Whole(_) => (LineGeneratorKind::default(), false),
            GeneratorKind::Fixed(_) => (LineGeneratorKind::Fixed(Fixed {}), false),
            // refused before any step
            GeneratorKind::Stochastic(_) | GeneratorKind::Schwarz(_) => (LineGeneratorKind::default(), true),
        };
        let (in_plane, kind) = (mesh.generator.clone().into_generator(), mesh.generator);
        let line = Parts::new(monitor.clone(), on_lines.into_generator(), equation, care, move |_| match divides {
            true => Err(Error::invalid("method", "one with subdomains", "needs a mesh in the plane; use Whole()")),
            false => Ok(()),
        })?;
        let check = move |lattice: &Lattice<2>| kind.check(lattice).map_err(|error| error.within("mesh.generator"));
        Ok(Self { line, plane: Parts::new(monitor, in_plane, equation, care, check)? })
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
        check: impl Fn(&Lattice<D>) -> driftmesh::Result<()> + Send + 'static,
    ) -> driftmesh::Result<Self> {
        let mover = Mover { generator, equation, care };
        Ok(Self { monitor: monitor.into_monitor(&[])?, mover, check: Box::new(check), last: None })
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
