use crate::errors::plain;
use crate::memory::Memory;
use crate::mesh::{Array, Given, array, in_dimensions, nodal, nodes};
use crate::mover::{Movers, Parts, Settings, busy};
use crate::threads::{BRIEFLY, Ended, Threads, calls, compute, interruptible};
use driftmesh::Error;
use driftmesh::density::{NOISE_WORTH_A_WARNING, noise};
use driftmesh::geometry::{Mesh, check_unfolded, interpolate};
use driftmesh::meshing::{LineGeneratorKind, Movable, Relaxation};
use driftmesh::mover::{self, Ending, Step, steps_to_rest};
use driftmesh::study::Source;
use numpy::PyReadonlyArrayDyn;
use pyo3::exceptions::{PyRuntimeError, PyRuntimeWarning};
use pyo3::prelude::*;
use serde::Serialize;
use std::borrow::Cow;
use std::ffi::CString;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

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
    chooses: bool,
    threads: Threads,
    /// Whether noise was warned of, and a mesh that does not rest.
    warned: [AtomicBool; 2],
    movers: Arc<Mutex<Movers>>,
}

#[pymethods]
impl Generator {
    #[new]
    #[pyo3(signature = (settings, threads, lines))]
    fn new(py: Python<'_>, settings: &str, threads: Threads, lines: bool) -> PyResult<Self> {
        let source = Source::new("settings", settings);
        let made = if lines {
            source.parse().and_then(|settings: Settings<LineGeneratorKind>| {
                Ok((settings.mesh.relaxation, Movers::of_lines(settings)?))
            })
        } else {
            let of_plane = |settings: Settings| Ok((settings.mesh.relaxation, Movers::of_plane(settings)?));
            source.parse().and_then(of_plane)
        };
        let (relaxation, movers) = made.map_err(|error| plain(py, error))?;
        let chooses = relaxation == Relaxation::Auto;
        Ok(Self { chooses, threads, warned: Default::default(), movers: Arc::new(Mutex::new(movers)) })
    }

    /// The nodes after a step, and what it cost as JSON.
    fn step<'py>(
        &self,
        py: Python<'py>,
        mesh: Given<'py>,
        u: PyReadonlyArrayDyn<'py, f64>,
        dt: f64,
    ) -> PyResult<(Array<'py>, String)> {
        match mesh.dimensions() {
            1 => self.stepped::<1>(py, &mesh, &u, dt),
            _ => self.stepped::<2>(py, &mesh, &u, dt),
        }
    }

    /// The density of u on a mesh.
    fn density<'py>(&self, py: Python<'py>, mesh: Given<'py>, u: PyReadonlyArrayDyn<'py, f64>) -> PyResult<Array<'py>> {
        fn of<'py, const D: usize>(
            generator: &Generator,
            py: Python<'py>,
            mesh: &Given<'py>,
            u: &PyReadonlyArrayDyn<'py, f64>,
        ) -> PyResult<Array<'py>>
        where
            Movers: AsMut<Parts<D>>,
            Mesh<D>: Movable<D>,
        {
            let mesh = mesh.mesh::<D>(py)?;
            let u = nodal(mesh.lattice(), u)?;
            let lattice = *mesh.lattice();
            let rho = generator.at_work(py, move |parts: &mut Parts<D>| {
                check_unfolded(&mesh)?;
                parts.monitor.density(&mesh, &u, None)
            })?;
            array(py, &lattice, rho.map_err(|failure| plain(py, failure))?.largest())
        }
        in_dimensions!(mesh, of(self, py, &mesh, &u))
    }

    /// The nodes at rest on what `follow` gives at the nodes of a mesh, and how that ended: `rest`, `jump` or
    /// `restless`.
    fn adapt<'py>(&self, py: Python<'py>, mesh: Given<'py>, follow: Py<PyAny>) -> PyResult<(Array<'py>, &'static str)> {
        match mesh.dimensions() {
            1 => self.adapted::<1>(py, &mesh, follow),
            _ => self.adapted::<2>(py, &mesh, follow),
        }
    }

    /// What it remembers from step to step.
    fn memory<'py>(&self, py: Python<'py>) -> PyResult<Cow<'py, [u8]>> {
        let warned = self.warned.each_ref().map(|warned| warned.load(Ordering::Relaxed));
        let movers = self.movers.try_lock().map_err(busy).map_err(PyRuntimeError::new_err)?;
        let bytes = Memory::of(&movers, warned).encoded();
        drop(movers);
        Ok(Cow::Owned(bytes.map_err(|error| plain(py, error))?))
    }

    /// Goes on with what another one remembered.
    fn remember(&self, py: Python<'_>, memory: &[u8]) -> PyResult<()> {
        let mut movers = self.movers.try_lock().map_err(busy).map_err(PyRuntimeError::new_err)?;
        let warned = Memory::decoded(memory).and_then(|memory| memory.restore(&mut movers));
        let warned = warned.map_err(|error| plain(py, error))?;
        self.warned.iter().zip(warned).for_each(|(own, warned)| own.store(warned, Ordering::Relaxed));
        Ok(())
    }
}

impl Generator {
    /// Computes with the mover of a dimension.
    fn at_work<T: Send + 'static, const D: usize>(
        &self,
        py: Python<'_>,
        f: impl FnOnce(&mut Parts<D>) -> T + Send + 'static,
    ) -> PyResult<T>
    where
        Movers: AsMut<Parts<D>>,
    {
        let movers = self.movers.clone();
        let done = compute(py, self.threads, move || {
            let mut movers = movers.try_lock().map_err(busy)?;
            Ok::<_, &str>(f(movers.as_mut()))
        })?;
        done.map_err(PyRuntimeError::new_err)
    }

    fn stepped<'py, const D: usize>(
        &self,
        py: Python<'py>,
        mesh: &Given<'py>,
        u: &PyReadonlyArrayDyn<'py, f64>,
        dt: f64,
    ) -> PyResult<(Array<'py>, String)>
    where
        Movers: AsMut<Parts<D>>,
        Mesh<D>: Movable<D>,
    {
        let mesh = mesh.mesh::<D>(py)?;
        let u = nodal(mesh.lattice(), u)?;
        let share = noise(mesh.lattice(), &u);
        if share > NOISE_WORTH_A_WARNING && !self.warned[0].swap(true, Ordering::Relaxed) {
            warn(
                py,
                format!(
                    "noisy-density: {:.0} % of u goes up and down from node to node, so that the mesh follows noise \
                     of the size of its cells; smooth u, or use more cells",
                    100.0 * share
                ),
            )?;
        }
        let followed = u.clone();
        let step = self.at_work(py, move |parts: &mut Parts<D>| {
            (parts.check)(mesh.lattice())?;
            parts.step(&mesh, &followed, dt).map_err(Error::from)
        })?;
        let Step { moved, gait, retries } = step.map_err(|error| plain(py, error))?;
        if !self.chooses && gait.is_restless() && !self.warned[1].swap(true, Ordering::Relaxed) {
            warn(py, self.hasty(py, moved.mesh.clone(), u, dt)?)?;
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

    fn adapted<'py, const D: usize>(
        &self,
        py: Python<'py>,
        mesh: &Given<'py>,
        follow: Py<PyAny>,
    ) -> PyResult<(Array<'py>, &'static str)>
    where
        Movers: AsMut<Parts<D>>,
        Mesh<D>: Movable<D>,
    {
        let mesh = mesh.mesh::<D>(py)?;
        let (movers, follow, calls) = (self.movers.clone(), Arc::new(follow), calls());
        let caller = calls.0.clone();
        let adapt = move || {
            let mut movers = movers.try_lock().map_err(busy)?;
            let Parts { monitor, mover, .. } = movers.as_mut();
            let start = check_unfolded(&mesh).map_err(Error::from).and_then(|()| {
                mover::adapted(mesh, mover.equation.form, |mesh| {
                    let (follow, on) = (follow.clone(), mesh.clone());
                    let called = caller.call(move |py| {
                        let values = follow.call1(py, (nodes(py, &on)?,))?;
                        nodal(on.lattice(), &values.extract::<PyReadonlyArrayDyn<'_, f64>>(py)?)
                    });
                    // what the function raised is what its caller hears of
                    let u = called.ok_or_else(|| Error::invalid("u0", "a function", "must return its values"))?;
                    let rho = monitor.density(mesh, &u, None)?;
                    Ok((u, rho))
                })
            });
            Ok::<_, &str>(start)
        };
        let start = match interruptible(py, self.threads, calls, adapt, || BRIEFLY, |_| Ok(()))? {
            Ended::Itself(start) => start.map_err(PyRuntimeError::new_err)?.map_err(|error| plain(py, error))?,
            Ended::Stopped(error, _) => return Err(error),
        };
        let end = match start.end {
            Ending::AtRest => "rest",
            Ending::Jump => "jump",
            Ending::Restless => "restless",
        };
        Ok((nodes(py, &start.mesh)?, end))
    }

    /// What to say of a mesh that turns back from step to step, with the τ that would let it rest on u.
    fn hasty<const D: usize>(&self, py: Python<'_>, mesh: Mesh<D>, u: Vec<f64>, dt: f64) -> PyResult<String>
    where
        Movers: AsMut<Parts<D>>,
        Mesh<D>: Movable<D>,
    {
        let limit = self.at_work(py, move |parts: &mut Parts<D>| {
            let values = |on: &Mesh<D>| interpolate(&mesh, &u, on);
            steps_to_rest(&mesh, parts.mover.equation, dt, &*parts.monitor, values)
        })?;
        let limit = limit.map_or("\"auto\" finds how many steps it takes to rest".into(), |steps| {
            format!(
                "on this u the mesh rests with τ = {:.3e}, {steps:.0} steps of `dt`; \"auto\" finds it by itself",
                steps * dt
            )
        });
        Ok(format!("`relaxation` is short: the mesh turns back from step to step; {limit}"))
    }
}

/// Warns whoever called the package.
fn warn(py: Python<'_>, text: String) -> PyResult<()> {
    PyErr::warn(py, &py.get_type::<PyRuntimeWarning>(), &CString::new(text)?, 2)
}
