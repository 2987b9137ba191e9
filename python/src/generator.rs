use crate::errors::plain;
use crate::mesh::{Given, nodal, nodes};
use crate::threads::compute;
use driftmesh::Failure;
use driftmesh::density::{Monitor, MonitorKind, NOISE_WORTH_A_WARNING, noise};
use driftmesh::geometry::{Mesh, check_unfolded};
use driftmesh::meshing::{Form, GeneratorKind, Mmpde, Relaxation};
use driftmesh::mover::{Followed, Gait, Mover, Step, steps_to_rest};
use driftmesh::study::{MeshForm, MeshTable, Source};
use numpy::{PyArray3, PyReadonlyArray2};
use pyo3::exceptions::{PyRuntimeError, PyRuntimeWarning};
use pyo3::prelude::*;
use serde::{Deserialize, Serialize};
use std::ffi::CString;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, TryLockError};

/// The tables of a study that move a mesh.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Settings {
    monitor: MonitorKind,
    mesh: MeshTable,
}

/// What a step cost, how well its subdomains fit together, and how the mesh was moved.
#[derive(Serialize)]
struct Told {
    work: driftmesh::Work,
    interface: Option<driftmesh::meshing::Interface>,
    /// τ in time steps, where the mover chooses it.
    #[serde(skip_serializing_if = "Option::is_none")]
    relaxation_steps: Option<f64>,
    /// Tries that failed.
    retries: Retries,
}

#[derive(Serialize)]
struct Retries {
    substeps: usize,
    smoothed: usize,
}

/// A mover with its monitor and what it remembers from step to step.
#[pyclass(frozen, module = "driftmesh._driftmesh")]
pub struct Generator {
    kind: GeneratorKind,
    chooses: bool,
    /// Whether noise was warned of, and a mesh that does not rest.
    warned: [AtomicBool; 2],
    parts: Arc<Mutex<Parts>>,
}

struct Parts {
    monitor: Box<dyn Monitor>,
    mover: Mover,
    /// The mesh that the last step led to, and how it was going: forgotten where the next step starts from another
    /// mesh.
    last: Option<(Mesh<2>, Gait)>,
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
            mover: Mover::by(mesh.generator.clone().into_generator(), equation),
            last: None,
        };
        let chooses = equation.relaxation == Relaxation::Auto;
        Ok(Self { kind: mesh.generator, chooses, warned: Default::default(), parts: Arc::new(Mutex::new(parts)) })
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
        let share = noise(mesh.lattice(), &u);
        if share > NOISE_WORTH_A_WARNING && !self.warned[0].swap(true, Ordering::Relaxed) {
            let text = format!(
                "noisy-density: {:.0} % of u goes up and down from node to node, so that the mesh follows noise of the \
                 size of its cells; smooth u, or use more cells",
                100.0 * share
            );
            PyErr::warn(py, &py.get_type::<PyRuntimeWarning>(), &CString::new(text)?, 2)?;
        }
        let (parts, followed) = (self.parts.clone(), u.clone());
        let step = compute(py, move || {
            let mut parts = parts.try_lock().map_err(|error| match error {
                TryLockError::WouldBlock => "this generator is still at work on another step; wait, or use two",
                TryLockError::Poisoned(_) => "this generator broke in an earlier step; make a new one",
            })?;
            Ok::<_, &str>(parts.step(&mesh, &followed, dt))
        })?;
        let Step { moved, gait, retries } =
            step.map_err(PyRuntimeError::new_err)?.map_err(|failure| plain(py, failure))?;
        if !self.chooses && gait.is_restless() && !self.warned[1].swap(true, Ordering::Relaxed) {
            PyErr::warn(
                py,
                &py.get_type::<PyRuntimeWarning>(),
                &CString::new(self.hasty(py, &moved.mesh, u, dt)?)?,
                2,
            )?;
        }
        let told = Told {
            work: moved.work,
            interface: moved.interface,
            relaxation_steps: self.chooses.then(|| gait.steps()),
            retries: Retries { substeps: retries.substeps, smoothed: retries.smoothed },
        };
        let told = serde_json::to_string(&told).map_err(|error| PyRuntimeError::new_err(error.to_string()))?;
        Ok((nodes(py, &moved.mesh)?, told))
    }
}

impl Generator {
    /// What to say of a mesh that turns back from step to step, with the τ that would let it rest on u.
    fn hasty(&self, py: Python<'_>, mesh: &Mesh<2>, u: Vec<f64>, dt: f64) -> PyResult<String> {
        let (parts, mesh) = (self.parts.clone(), mesh.clone());
        let limit = compute(py, move || {
            let parts = parts.try_lock().ok()?;
            steps_to_rest(&mesh, parts.mover.equation.form, &*parts.monitor, &u)
        })?;
        let limit = limit.map_or("\"auto\" finds how many steps it takes to rest".into(), |steps| {
            format!(
                "on this u it comes to rest with {:.3e}, {steps:.0} steps, which \"auto\" finds by itself",
                steps * dt
            )
        });
        Ok(format!("`relaxation` is short: the mesh turns back from step to step; {limit}"))
    }
}

impl Parts {
    fn step(&mut self, mesh: &Mesh<2>, u: &[f64], dt: f64) -> Result<Step, Failure> {
        check_unfolded(mesh)?;
        let gait = match self.last.take() {
            Some((last, gait)) if last == *mesh => gait,
            _ => Gait::at_rest(mesh),
        };
        let rho = self.monitor.density(mesh, u, None)?;
        let step = self.mover.step(mesh, &gait, Followed { u, rho: &rho }, dt);
        // a step that failed may be tried again with other values
        self.last = Some(match &step {
            Ok(step) => (step.moved.mesh.clone(), step.gait.clone()),
            Err(_) => (mesh.clone(), gait),
        });
        step
    }
}
