use driftmesh::error::{Act, Door, Setting, sentence};
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
        Error::Failed { failure, .. } => remedy(failure),
        _ => error.help(),
    };
    raised(py, &error, help)
}

/// The remedy where there is no study; nothing where the message says it all.
fn remedy(failure: &Failure) -> Option<String> {
    let said_already = matches!(
        failure,
        Failure::NonFinite { .. }
            | Failure::Formula { .. }
            | Failure::NotPositive { .. }
            | Failure::OutOfRange { .. }
            | Failure::WrongLength { .. }
    );
    let help = sentence(&failure.remedies(), &Arguments).filter(|_| !said_already)?;
    Some(match failure {
        Failure::Folded { .. } => format!("begin with a mesh without folded cells; where a step folded it, {help}"),
        _ => help,
    })
}

/// Settings as arguments of functions and classes.
struct Arguments;

impl Door for Arguments {
    fn name(&self, act: Act) -> Option<String> {
        let name = match act.setting()? {
            Setting::Smoothing => "the monitor's `smoothing`",
            Setting::Strength => "its `relative` or `absolute`",
            Setting::Gradient => "the monitor's `gradient`",
            Setting::Relaxation => "`relaxation`",
            Setting::TimeStep => "`dt`",
            Setting::Cells => "`cells`",
            Setting::Generator if act == Act::Set(Setting::Generator, &[WHOLE]) => "`method`",
            Setting::Estimator => "the `estimator`",
            Setting::Samples => "the `walks` or `paths` of the estimator",
            Setting::Substeps => "the `substeps` of the estimator",
            Setting::Exchanges => "the `iterations` of Schwarz(…)",
            Setting::Overlap => "the `overlap` of Schwarz(…)",
            Setting::Density => "the density",
            Setting::FaceDensity => "`face_density`",
            Setting::Method => "`method`",
            Setting::Linearized => "`linearized`",
            Setting::Coarse => "`coarse`",
            Setting::Sweep => "`sweep`",
            Setting::Robin => "`robin`",
            Setting::Integral => "`integral`",
            Setting::Iterations => "`iterations`",
            Setting::Tolerance => "`tolerance`",
            _ => return None,
        };
        Some(name.into())
    }

    fn value(&self, setting: Setting, value: &'static str) -> String {
        match (setting, value) {
            (Setting::Generator, WHOLE) => "Whole()",
            (Setting::Estimator, _) => "ResidualWalk()",
            (_, "false") => "False",
            (_, value) => value,
        }
        .into()
    }
}

/// The generator that solves the whole domain, as a study writes it and remedies name it.
const WHOLE: &str = "{ kind = \"whole\" }";
