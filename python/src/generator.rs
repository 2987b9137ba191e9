use crate::errors::plain;
use crate::mesh::{Given, nodal, nodes};
use crate::threads::compute;
use driftmesh::Failure;
use driftmesh::density::{Monitor, MonitorKind};
use driftmesh::geometry::{Mesh, check_unfolded};
use driftmesh::meshing::{Form, GeneratorKind, MeshGenerator, Mmpde, Moved};
use driftmesh::study::{MeshForm, MeshTable, Source};
use numpy::{PyArray3, PyReadonlyArray2};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use serde::{Deserialize, Serialize};
use std::sync::{Arc, Mutex, TryLockError};

/// The tables of a study that move a mesh.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Settings {
    monitor: MonitorKind,
    mesh: MeshTable,
}

/// What a step cost, and how well its subdomains fit together.
#[derive(Serialize)]
struct Told {
    work: driftmesh::Work,
    interface: Option<driftmesh::meshing::Interface>,
}

/// A mesh generator with its monitor and what it remembers from step to step.
#[pyclass(frozen, module = "driftmesh._driftmesh")]
pub struct Generator {
    equation: Mmpde,
    kind: GeneratorKind,
    parts: Arc<Mutex<Parts>>,
}

struct Parts {
    monitor: Box<dyn Monitor>,
    generator: Box<dyn MeshGenerator>,
}

#[pymethods]
impl Generator {
    #[new]
    fn new(py: Python<'_>, settings: &str) -> PyResult<Self> {
        let raise = |error| plain(py, error);
        let Settings { monitor, mesh } = Source::new("settings", settings).parse().map_err(raise)?;
        monitor.check().map_err(|error| raise(error.within("monitor")))?;
        let form = match mesh.form {
            MeshForm::Gradient => Form::Gradient(monitor.gradient()),
            MeshForm::Conservative => Form::Conservative,
        };
        let equation = Mmpde { relaxation: mesh.relaxation, form };
        equation.check().map_err(|error| raise(error.within("mesh")))?;
        let parts = Parts {
            monitor: monitor.into_monitor(&[]).map_err(raise)?,
            generator: mesh.generator.clone().into_generator(),
        };
        Ok(Self { equation, kind: mesh.generator, parts: Arc::new(Mutex::new(parts)) })
    }

    /// The nodes after a step, and what it cost as JSON.
    fn step<'py>(
        &self,
        py: Python<'py>,
        mesh: Given<'py>,
        u: PyReadonlyArray2<'py, f64>,
        dt: f64,
    ) -> PyResult<(Bound<'py, PyArray3<f64>>, String)> {
        let mesh = mesh.mesh(py)?;
        let u = nodal(&mesh, &u)?;
        self.kind.check(mesh.lattice()).map_err(|error| plain(py, error.within("mesh.generator")))?;
        let (parts, equation) = (self.parts.clone(), self.equation);
        let moved = compute(py, move || {
            let mut parts = parts.try_lock().map_err(|error| match error {
                TryLockError::WouldBlock => "this generator is still at work on another step; wait, or use two",
                TryLockError::Poisoned(_) => "this generator broke in an earlier step; make a new one",
            })?;
            let Parts { monitor, generator } = &mut *parts;
            Ok::<_, &str>(step(&mesh, &u, monitor.as_ref(), generator.as_mut(), &equation, dt))
        })?;
        let moved = moved.map_err(PyRuntimeError::new_err)?.map_err(|failure| plain(py, failure))?;
        let told = Told { work: moved.work, interface: moved.interface };
        let told = serde_json::to_string(&told).map_err(|error| PyRuntimeError::new_err(error.to_string()))?;
        Ok((nodes(py, &moved.mesh)?, told))
    }
}

fn step(
    mesh: &Mesh<2>,
    u: &[f64],
    monitor: &dyn Monitor,
    generator: &mut dyn MeshGenerator,
    equation: &Mmpde,
    dt: f64,
) -> Result<Moved, Failure> {
    check_unfolded(mesh)?;
    let rho = monitor.density(mesh, u, None)?;
    let moved = generator.step(equation, mesh, &rho, dt)?;
    check_unfolded(&moved.mesh)?;
    Ok(moved)
}
