use crate::errors::plain;
use crate::threads::{BRIEFLY, Caller, Calls, Ended, calls, interruptible};
use driftmesh::equidistribution::{History, Iterate, Line, LineDensity, Settled, check_ends};
use driftmesh::study::{Discretization, SchwarzTable, Source, StopTable, check_memory};
use driftmesh::{Error, Failure};
use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1};
use pyo3::exceptions::PyRuntimeWarning;
use pyo3::prelude::*;
use serde::Deserialize;
use std::ffi::CString;
use std::sync::Arc;

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

/// Bytes of memory for each cell, as for a study of a line: measured at a million cells, with a reserve.
const BYTES_PER_CELL: u128 = 1000;

fn line_density(density: Density, ends: [f64; 2], caller: &Caller) -> driftmesh::Result<LineDensity> {
    let function = match density {
        Density::Text(kind, text) if kind == "arclength" => return LineDensity::arclength(&text),
        Density::Text(_, text) => return LineDensity::formula(&text),
        Density::Samples(x, m) => return LineDensity::sampled(x, m),
        Density::Function(function) => Arc::new(function),
    };
    let caller = caller.clone();
    Ok(LineDensity::on_line(ends, move |_, x| values(&caller, &function, x).unwrap_or_else(|| vec![f64::NAN; x.len()])))
}

/// M at some places; nothing where the function raised.
fn values(caller: &Caller, function: &Arc<Py<PyAny>>, places: &[f64]) -> Option<Vec<f64>> {
    let (function, places) = (function.clone(), places.to_vec());
    caller.call(move |py| {
        let values = function.call1(py, (places.into_pyarray(py),))?;
        Ok(values.extract::<PyReadonlyArray1<'_, f64>>(py)?.as_array().to_vec())
    })
}

/// Computes with a density, interruptible; what its function raised comes before what followed from it.
fn compute<T: Send + 'static>(
    py: Python<'_>,
    calls: (Caller, Calls),
    f: impl FnOnce() -> driftmesh::Result<T> + Send + 'static,
) -> PyResult<T> {
    match interruptible(py, None, calls, f, || BRIEFLY, |_| Ok(()))? {
        Ended::Itself(result) => result.map_err(|error| plain(py, error)),
        Ended::Stopped(error, _) => Err(error),
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
    caller: &Caller,
    density: Density,
    cells: usize,
    ends: [f64; 2],
    settings: &str,
) -> driftmesh::Result<(Line, Settings)> {
    let mut settings: Settings = Source::new("settings", settings).parse()?;
    settings.stop.resolve()?;
    settings.equidistribution.check(ends).map_err(|error| error.within("equidistribution"))?;
    check_memory(cells as u128 + 1, BYTES_PER_CELL, &[cells])?;
    check_ends("domain", ends)?;
    let density =
        line_density(density, ends, caller)?.with_spikes(settings.equidistribution.points.clone()).within(ends);
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
    let calls = calls();
    let (line, _) = problem(&calls.0, density, cells, ends, settings).map_err(|error| plain(py, error))?;
    let Settled { mesh, stalled, .. } = compute(py, calls, move || Ok(line.settled(0.0)?))?;
    if let Some(failure) = stalled {
        let text = format!("`face_density`: {failure}; the nodes are those of \"exact\"");
        PyErr::warn(py, &py.get_type::<PyRuntimeWarning>(), &CString::new(text)?, 2)?;
    }
    Ok(mesh.into_pyarray(py))
}

/// Five columns of a history, mesh, reference; observed, predicted and bound of the contraction; why it did not
/// converge.
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
    let calls = calls();
    let raise = |error: Error| plain(py, error);
    let (line, Settings { schwarz, stop, .. }) = problem(&calls.0, density, cells, ends, settings).map_err(raise)?;
    let mut schwarz = schwarz.unwrap_or_default();
    let ranges = schwarz.resolve(false).and_then(|()| schwarz.ranges(cells)).map_err(raise)?;
    let (method, until) = (schwarz.method(), stop.until());
    let history = compute(py, calls, move || {
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
