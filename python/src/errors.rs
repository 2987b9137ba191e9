use driftmesh::{Error, Failure};
use pyo3::exceptions::{PyFileExistsError, PyOSError, PyValueError};
use pyo3::prelude::*;

/// An error of the library as the exception that a Python user expects, with the remedy below the message.
pub fn raised(py: Python<'_>, error: &Error, help: Option<String>) -> PyErr {
    let help = match error {
        Error::ForeignDirectory { .. } => Some("name another directory with `out`, or empty this one".into()),
        Error::Busy { .. } => Some("wait for it to end, or name another directory with `out`".into()),
        _ => help.map(|help| {
            let ours = [("--out", "`out`"), ("leave --resume out", "leave `resume` out")];
            ours.into_iter().fold(help, |help, (theirs, ours)| help.replace(theirs, ours))
        }),
    };
    let text = help.as_ref().map_or(error.to_string(), |help| format!("{error}\n  help: {help}"));
    match error.cause() {
        Error::Failed { failure, moment } => {
            let place = (moment.map(|m| m.t), moment.map(|m| m.step));
            numerical(py, failure, text, place).unwrap_or_else(|error| error)
        }
        Error::Study(_) | Error::Formula { .. } => mistake(py, text).unwrap_or_else(|error| error),
        Error::Invalid { .. } => PyValueError::new_err(text),
        Error::ForeignDirectory { .. } => PyFileExistsError::new_err(text),
        _ => PyOSError::new_err(text),
    }
}

/// `driftmesh.errors.MeshFolded` and its siblings, named after the failure.
fn numerical(
    py: Python<'_>,
    failure: &Failure,
    text: String,
    (t, step): (Option<f64>, Option<usize>),
) -> PyResult<PyErr> {
    let class: String = failure.name().split('-').map(capital).collect();
    let error = py.import("driftmesh.errors")?.getattr(class.as_str())?.call1((text,))?;
    error.setattr("t", t)?;
    error.setattr("step", step)?;
    Ok(PyErr::from_value(error))
}

fn mistake(py: Python<'_>, text: String) -> PyResult<PyErr> {
    Ok(PyErr::from_value(py.import("driftmesh.errors")?.getattr("StudyError")?.call1((text,))?))
}

fn capital(word: &str) -> String {
    let mut letters = word.chars();
    letters.next().map_or(String::new(), |first| first.to_uppercase().chain(letters).collect())
}

/// An error of the library without a study, with a remedy in the words of the arguments.
pub fn plain(py: Python<'_>, error: impl Into<Error>) -> PyErr {
    let error = error.into();
    let help = match &error {
        // what a study has in tables are arguments here
        Error::Failed { failure: failure @ Failure::NotConverged { .. }, .. } => {
            let tables = ["equidistribution.", "grid.", "schwarz.", "stop."];
            Some(tables.iter().fold(failure.help().to_string(), |help, table| help.replace(table, "")))
        }
        Error::Failed { failure, .. } => remedy(failure).map(String::from),
        _ => error.help(),
    };
    raised(py, &error, help)
}

/// The remedy where there is no study; nothing where the message says it all.
fn remedy(failure: &Failure) -> Option<&'static str> {
    Some(match failure {
        Failure::Folded { .. } => {
            "begin with a mesh without folded cells; where a step folded it, lower `dt` or raise the monitor's `smoothing`"
        }
        Failure::LinearStalled { .. } => {
            "lower `dt`, raise `relaxation`, or set the monitor's `gradient` to \"safe\" where the density is very steep"
        }
        Failure::SteepDensity { .. } => "set the monitor's `gradient` to \"safe\", or raise its `smoothing`",
        Failure::LongWalks { .. } => "raise `relaxation`, lower `dt` or the number of walks, or use Whole()",
        Failure::NoisyInterface { .. } => "raise the estimator's `walks` or `paths`, or use ResidualWalk()",
        Failure::SchwarzStalled { .. } => "raise `iterations` or `overlap` of Schwarz(…), or lower `dt`",
        Failure::LineDensity { .. } => "change the density so",
        Failure::LineStalled { .. } => "set `face_density` to \"exact\"",
        Failure::LineUnresolved { .. } => "give fewer cells, or the density a thicker layer",
        Failure::LineFolded { .. } => {
            "raise `iterations`, or give a tolerance in its place, which tells whether the iteration contracts"
        }
        Failure::DegenerateStencil { .. } => "make the cells around it less flat",
        Failure::NotABox { .. } => "move the mesh of the unit square instead, and map it to the domain",
        Failure::Subdomains { .. } => "give every axis between one subdomain and one a cell",
        _ => return None,
    })
}
