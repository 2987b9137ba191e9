use crate::errors::{plain, raised};
use crate::threads::{BRIEFLY, Ended, interruptible};
use driftmesh::equidistribution::{History, Iterate, Line, LineDensity};
use driftmesh::study::{Discretization, SchwarzTable, Source, StopTable, check_memory};
use driftmesh::{Error, Failure};
use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use serde::Deserialize;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// A density as the package hands it over.
#[derive(FromPyObject)]
pub enum Density {
    /// `("formula" or "arclength", text)`.
    Text(String, String),
    /// Places and M there.
    Samples(Vec<f64>, Vec<f64>),
    /// M of an array of places.
    Function(Py<PyAny>),
}

/// What a density by a Python function shares with the thread that waits for it.
#[derive(Clone, Default)]
struct Shared {
    /// The first exception that it raised.
    raised: Arc<Mutex<Option<PyErr>>>,
    stop: Arc<AtomicBool>,
}

/// Memory for each cell, about.
const BYTES_PER_CELL: u128 = 1000;
/// Distance over which the slope of a function is differenced, as a share of the line: Newton's method needs no better.
const APART: f64 = 1e-6;

impl Shared {
    fn density(&self, density: Density, [a, b]: [f64; 2]) -> driftmesh::Result<LineDensity> {
        let function = match density {
            Density::Text(kind, text) if kind == "arclength" => return LineDensity::arclength(&text),
            Density::Text(_, text) => return LineDensity::formula(&text),
            Density::Samples(x, m) => return LineDensity::sampled(x, m),
            Density::Function(function) => function,
        };
        let (shared, apart) = (self.clone(), APART * (b - a));
        Ok(LineDensity::function(move |_, x| {
            let n = x.len();
            // a function need not be defined beyond the line
            let below = |x: f64| if x >= a { (x - apart).max(a) } else { x - apart };
            let above = |x: f64| if x <= b { (x + apart).min(b) } else { x + apart };
            let lower = x.iter().map(|x| below(*x));
            let places: Vec<f64> = x.iter().copied().chain(lower).chain(x.iter().map(|x| above(*x))).collect();
            let m = shared.values(&function, &places);
            (0..n).map(|k| [m[k], (m[2 * n + k] - m[n + k]) / (places[2 * n + k] - places[n + k])]).collect()
        }))
    }

    /// M at some places; no numbers where the function raised.
    fn values(&self, function: &Py<PyAny>, places: &[f64]) -> Vec<f64> {
        let none = || vec![f64::NAN; places.len()];
        if self.raised().is_some() || self.stop.load(Ordering::Relaxed) {
            return none();
        }
        let called = Python::attach(|py| {
            let values = function.call1(py, (PyArray1::from_slice(py, places),))?;
            Ok(values.extract::<PyReadonlyArray1<'_, f64>>(py)?.as_array().to_vec())
        });
        called.unwrap_or_else(|error: PyErr| {
            self.raised().get_or_insert(error);
            none()
        })
    }

    fn raised(&self) -> MutexGuard<'_, Option<PyErr>> {
        self.raised.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Computes with a density, interruptible; what its function raised comes before what followed from it.
    fn compute<T: Send + 'static>(
        &self,
        py: Python<'_>,
        f: impl FnOnce() -> driftmesh::Result<T> + Send + 'static,
    ) -> PyResult<T> {
        let stop = || {
            self.stop.store(true, Ordering::Relaxed);
            BRIEFLY
        };
        let ended = interruptible(py, f, stop, |_| Ok(()))?;
        if let Some(error) = self.raised().take() {
            return Err(error);
        }
        match ended {
            Ended::Itself(result) => result.map_err(|error| match &error {
                Error::Failed { failure: Failure::LineStalled { .. }, .. } => {
                    raised(py, &error, Some("set face_density to \"exact\": rough densities need it".into()))
                }
                _ => plain(py, error),
            }),
            Ended::Stopped(error, _) => Err(error),
        }
    }
}

/// The tables of a study that divide a line.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Settings {
    #[serde(default)]
    equidistribution: Discretization,
    schwarz: Option<SchwarzTable>,
    #[serde(default)]
    stop: StopTable,
}

fn problem(
    shared: &Shared,
    density: Density,
    cells: usize,
    ends: [f64; 2],
    settings: &str,
) -> driftmesh::Result<(Line, Settings)> {
    let mut settings: Settings = Source::new("settings", settings).parse()?;
    settings.stop.resolve()?;
    check_memory(cells as u128 + 1, BYTES_PER_CELL, &[cells])?;
    let density = shared.density(density, ends)?;
    Ok((Line { density, face: settings.equidistribution.face_density, cells, ends }, settings))
}

/// The discrete mesh of the whole line.
#[pyfunction]
pub fn equidistribute<'py>(
    py: Python<'py>,
    density: Density,
    cells: usize,
    ends: [f64; 2],
    settings: &str,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let shared = Shared::default();
    let (line, _) = problem(&shared, density, cells, ends, settings).map_err(|error| plain(py, error))?;
    let mesh = shared.compute(py, move || Ok(line.solve(0.0, &line.uniform(), None)?.0))?;
    Ok(mesh.into_pyarray(py))
}

/// Five columns of a history, mesh, reference; observed, predicted and bound of the contraction; why it did not converge.
type Iterated<'py> = ([Bound<'py, PyArray1<f64>>; 5], [Bound<'py, PyArray1<f64>>; 2], [Option<f64>; 3], Option<PyErr>);

/// A Schwarz iteration on a line.
#[pyfunction]
#[pyo3(signature = (density, cells, ends, settings, start))]
pub fn schwarz<'py>(
    py: Python<'py>,
    density: Density,
    cells: usize,
    ends: [f64; 2],
    settings: &str,
    start: Option<Vec<f64>>,
) -> PyResult<Iterated<'py>> {
    let shared = Shared::default();
    let raise = |error: Error| plain(py, error);
    let (line, Settings { schwarz, stop, .. }) = problem(&shared, density, cells, ends, settings).map_err(raise)?;
    let mut schwarz = schwarz.unwrap_or_default();
    let ranges = schwarz.resolve(false).and_then(|()| schwarz.ranges(cells)).map_err(raise)?;
    let (method, until) = (schwarz.method(), stop.until());
    let history = shared.compute(py, move || {
        let start = start.unwrap_or_else(|| line.uniform());
        line.iterate(0.0, &ranges, method, &start, None, until)
    })?;
    let missed: Option<Failure> = history.missed(method, until);
    let History { iterates, mesh, reference, observed, prediction, .. } = history;
    let column = |of: fn(&Iterate) -> f64| iterates.iter().map(of).collect::<Vec<f64>>().into_pyarray(py);
    let columns = [
        column(|it| it.error),
        column(|it| it.increment),
        column(|it| it.largest_jump.unwrap_or(f64::NAN)),
        column(|it| it.interpolation_error.unwrap_or(f64::NAN)),
        column(|it| it.linear_solves as f64),
    ];
    Ok((
        columns,
        [mesh.into_pyarray(py), reference.into_pyarray(py)],
        [observed, prediction.predicted, prediction.bound],
        missed.map(|failure| plain(py, failure)),
    ))
}
