//! Remedies in the keys of a study: those that it has and takes.

use crate::error::{Act, Door, Error, Failure, Setting, sentence};
use serde::Serialize;
use toml::{Table, Value};

/// Keys of a setting in studies of all kinds, the one that most have first; those of a generator without its table.
fn keys(setting: Setting) -> &'static [&'static str] {
    match setting {
        Setting::Smoothing => &["monitor.smoothing"],
        Setting::Strength => &["monitor.strength.relative", "monitor.strength.absolute"],
        Setting::Gradient => &["monitor.gradient"],
        Setting::Followed => &["monitor.of"],
        Setting::Relaxation => &["mesh.relaxation", "mesh.relaxation.steps", "time.relaxation"],
        Setting::TimeStep => &["time.step", "time.tolerance"],
        Setting::End => &["time.end", "time.duration"],
        Setting::Stepper => &["time.stepper"],
        Setting::Cells => &["grid.cells"],
        Setting::Periodic => &["domain.periodic"],
        Setting::Viscosity => &["pde.viscosity"],
        Setting::Flux => &["pde.flux"],
        Setting::Generator => &["generator"],
        Setting::Estimator => &["generator.estimator"],
        Setting::Samples => &["generator.estimator.walks", "generator.estimator.paths"],
        Setting::Substeps => &["generator.estimator.substeps"],
        Setting::Exchanges => &["generator.iterations"],
        Setting::Overlap => &["generator.overlap"],
        Setting::Density => &["density.value", "density.of"],
        Setting::FaceDensity => &["equidistribution.face_density"],
        Setting::Method => &["schwarz.method"],
        Setting::Linearized => &["schwarz.linearized"],
        Setting::Coarse => &["schwarz.coarse"],
        Setting::Sweep => &["schwarz.sweep"],
        Setting::Robin => &["schwarz.robin"],
        Setting::Integral => &["schwarz.integral"],
        Setting::Iterations => &["stop.iterations"],
        Setting::Tolerance => &["stop.tolerance"],
        Setting::Map => &["domain.map"],
        Setting::Distortion => &["domain.distort.perturb", "domain.distort.shear"],
        Setting::Grading => &["grid.grading", "grid.grading.power", "grid.grading.ratio"],
        Setting::Slopes => &["sides.neumann", "walls.sides"],
        Setting::Stepping => &["front.stepping"],
        Setting::Undercooled => &["front.undercooled"],
    }
}

/// The keys of a resolved study with their values.
struct Keys {
    table: Table,
    /// Whether the run of `[compare]` is meant.
    compared: bool,
}

impl Keys {
    fn at(&self, key: &str) -> Option<&Value> {
        let mut parts = key.split('.');
        let first = self.table.get(parts.next()?)?;
        parts.try_fold(first, |value, part| value.get(part))
    }

    fn is(&self, key: &str, text: &str) -> bool {
        self.at(key).and_then(Value::as_str) == Some(text)
    }

    /// The keys by which the study takes an act, all of them with the value that it has now.
    fn taking(&self, act: Act) -> Vec<String> {
        let Some(setting) = act.setting() else { return Vec::new() };
        let place = if self.compared { "compare" } else { "mesh" };
        let all = keys(setting).iter().map(|key| match key.starts_with("generator") {
            true => format!("{place}.{key}"),
            false => key.to_string(),
        });
        if !self.matters(setting) {
            return Vec::new();
        }
        all.filter(|key| self.takes(key, act)).collect()
    }

    /// Whether a setting changes anything in this study.
    fn matters(&self, setting: Setting) -> bool {
        let moving = self.is("study.kind", "moving-mesh");
        let follows = moving && !self.is("mesh.generator.kind", "fixed");
        let line = self.at("schwarz").is_some();
        // what the resolved study leaves out is classical
        let classical = line && !self.is("schwarz.method", "optimal") && !self.is("schwarz.method", "optimized");
        let coarse = self.at("schwarz.coarse").is_some() && !self.is("schwarz.coarse", "none");
        match setting {
            Setting::Smoothing | Setting::Strength | Setting::Followed => follows,
            Setting::Gradient => follows && self.is("mesh.form", "gradient"),
            Setting::Periodic => self.is("pde.kind", "shallow-water"),
            // exact solutions say by their kind whether a melt is undercooled
            Setting::Undercooled => self.at("exact").is_none(),
            Setting::Flux => self.is("pde.kind", "burgers") && self.is("pde.convection", "flux"),
            Setting::Linearized => classical,
            Setting::Coarse => classical && !self.is("schwarz.sweep", "alternating"),
            Setting::Sweep => classical && !coarse,
            Setting::Iterations | Setting::Tolerance => line,
            Setting::Method | Setting::Robin => self.is("schwarz.method", "optimized"),
            Setting::Cells => !self.is("study.kind", "poisson"),
            Setting::TimeStep => self.at("time").is_some(),
            _ => true,
        }
    }

    /// Whether a key takes an act: it has a value that the act changes, or may have one.
    fn takes(&self, key: &str, act: Act) -> bool {
        let now = self.at(key);
        let number = |value: &Value| matches!(value, Value::Integer(_) | Value::Float(_) | Value::Array(_));
        let automatic = now.is_none_or(|value| value.as_str() == Some("auto"));
        match (key, act) {
            // only the steps of a front may be chosen by the program wherever they are a number
            ("time.step", Act::Set(..)) => !automatic && self.is("study.kind", "stefan"),
            // a tolerance decides on the steps
            ("time.step", Act::Number(_)) => automatic && self.at("time.tolerance").is_none(),
            ("time.step", _) => now.is_some(),
            ("mesh.relaxation.steps" | "time.relaxation" | "time.tolerance", Act::Set(..)) => false,
            ("monitor.of", _) => true,
            ("stop.iterations", Act::Raise(_)) | ("stop.tolerance", Act::Change(..)) => true,
            (_, Act::Raise(_) | Act::Lower(_) | Act::Refine(_)) => now.is_some_and(number),
            ("schwarz.integral", Act::Set(_, values)) => now.is_some() && !values.iter().any(|value| holds(now, value)),
            (key, Act::Set(_, values)) if key.starts_with("schwarz.") => !values.iter().any(|value| holds(now, value)),
            (_, Act::Set(_, values)) => now.is_some() && !values.iter().any(|value| holds(now, value)),
            (_, Act::Number(_)) => false,
            ("grid.grading", Act::Change(..)) => now.is_some_and(|value| !value.is_table()),
            ("sides.neumann", Act::Change(..)) => now.and_then(Value::as_array).is_some_and(|sides| !sides.is_empty()),
            ("walls.sides", Act::Change(..)) => self.is(key, "neumann") && self.at("exact").is_some(),
            (_, Act::LeaveOut(_) | Act::Change(..) | Act::Say(_)) => now.is_some(),
        }
    }
}

/// Whether a value is what a study would write so; of tables their kind decides.
fn holds(now: Option<&Value>, text: &str) -> bool {
    match now {
        None => text == "false",
        Some(Value::Table(table)) => table.get("kind").is_some_and(|kind| text.contains(&format!("kind = {kind}"))),
        Some(value) => value.to_string() == text,
    }
}

impl Door for Keys {
    /// Keys with the value that each has now.
    fn name(&self, act: Act) -> Option<String> {
        let keys = self.taking(act);
        let named = keys.iter().map(|key| match self.at(key) {
            Some(Value::Table(_)) | None => key.clone(),
            Some(value) => format!("{key} (now {value})"),
        });
        (!keys.is_empty()).then(|| named.collect::<Vec<_>>().join(" or "))
    }
}

/// The remedy for an error in the keys of a study.
pub(super) fn remedy(study: &impl Serialize, error: &Error) -> Option<String> {
    match (error.cause(), Table::try_from(study)) {
        (Error::Failed { failure, .. }, Ok(table)) => {
            sentence(&failure.remedies(), &Keys { table, compared: matches!(error, Error::Compared(_)) })
        }
        _ => error.help(),
    }
}

/// What a study may change against a failure, each with the keys that take it.
pub(super) fn offers(study: &impl Serialize, failure: &Failure) -> Vec<(Act, Vec<String>)> {
    let Ok(table) = Table::try_from(study) else { return Vec::new() };
    let keys = Keys { table, compared: false };
    let acts = failure.remedies().into_iter().flat_map(|remedy| remedy.acts);
    acts.map(|act| (act, keys.taking(act))).filter(|(_, keys)| !keys.is_empty()).collect()
}

/// Every key that some study has.
struct Everywhere;

impl Door for Everywhere {
    fn name(&self, act: Act) -> Option<String> {
        let key = keys(act.setting()?)[0];
        Some(if key.starts_with("generator") { format!("mesh.{key}") } else { key.into() })
    }
}

/// Name, meaning and remedy of every failure, with the keys of studies of all kinds.
pub fn failures() -> Vec<[String; 3]> {
    let all = Failure::each().map(|failure| {
        let help = sentence(&failure.remedies(), &Everywhere).unwrap_or_default();
        [failure.name().into(), failure.meaning().into(), help]
    });
    all.collect()
}
