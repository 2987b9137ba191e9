//! A remedy names only what the study that it is told to has, and the study takes what it says.

use driftmesh::error::{Act, Cause, NodePlace, Remedy, Setting};
use driftmesh::study::{Source, Study};
use driftmesh::{Error, Failure};
use std::collections::BTreeSet;
use std::path::Path;
use toml::{Table, Value};

/// Every failure, with every cause and every case that has remedies of its own.
fn failures() -> Vec<Failure> {
    let mut all: Vec<Failure> = Failure::each().collect();
    let causes = [Cause::BlowUp, Cause::Restless, Cause::Start, Cause::Stiff];
    all.extend(causes.map(|cause| Failure::VanishingStep { dt: 1e-9, cause }));
    let given = vec![("u".to_string(), 0.1)];
    let (what, value, at) = ("`pde.source.u`".into(), f64::NAN, NodePlace::new([0; 2], [0.0; 2]));
    all.push(Failure::Formula { what, value, at, given });
    // iterations on a line, which know their own remedies, have these
    let acts = [
        Act::Raise(Setting::Tolerance),
        Act::Raise(Setting::Iterations),
        Act::Set(Setting::Robin, &["\"auto\"", "\"lagged\""]),
        Act::Set(Setting::Linearized, &["false"]),
        Act::Set(Setting::Coarse, &["\"integral\""]),
        Act::Set(Setting::Method, &["\"optimal\""]),
        Act::LeaveOut(Setting::Robin),
        Act::Set(Setting::FaceDensity, &["\"exact\""]),
        Act::Set(Setting::Integral, &["\"exact\""]),
        Act::Refine(Setting::Cells),
        Act::Lower(Setting::TimeStep),
    ];
    let remedies = acts.map(|act| Remedy::any([act])).to_vec();
    all.push(Failure::LineStalled { residual: 1.0, iterations: 9, remedies });
    all
}

/// Every file of `studies/`, and what is not among them, each by assignments to a file.
fn studies() -> Vec<Told> {
    let directory = Path::new(env!("CARGO_MANIFEST_DIR")).join("studies");
    let names = std::fs::read_dir(&directory).unwrap().map(|entry| entry.unwrap().path());
    let mut files: Vec<_> = names.filter(|path| path.extension().is_some_and(|end| end == "toml")).collect();
    files.sort();
    let label = |path: &Path| path.file_stem().unwrap().to_string_lossy().into_owned();
    let mut all: Vec<Told> = files.iter().map(|path| Told::new(&label(path), &[])).collect();
    let stochastic = |estimator: &str| {
        format!("mesh.generator={{ kind = \"stochastic\", subdomains = [2, 2], estimator = {estimator} }}")
    };
    let variations: [(&str, &[&str]); 23] = [
        ("burgers", &["monitor={ kind = \"arclength\", strength = { absolute = 0.2 } }"]),
        ("burgers", &["monitor={ kind = \"arclength\" }", "mesh.form=\"gradient\"", "mesh.relaxation=1.0"]),
        ("burgers", &["monitor={ kind = \"given\" }", "mesh.form=\"gradient\"", "mesh.relaxation={ steps = 25 }"]),
        ("burgers", &["mesh.form=\"gradient\""]),
        ("burgers", &["time.tolerance=1e-3"]),
        ("burgers", &["time.tolerance=1e-3", "time.step=1e-3"]),
        ("burgers", &["time.step=1e-3"]),
        ("burgers", &["pde.convection=\"flux\"", "pde.flux=\"energy\""]),
        ("burgers", &["mesh.generator={ kind = \"fixed\" }"]),
        ("burgers", &["mesh.generator={ kind = \"schwarz\", subdomains = [2, 2] }"]),
        ("burgers", &[&stochastic("{ kind = \"residual-walk\" }")]),
        ("burgers", &[&stochastic("{ kind = \"residual-walk\", sweeps = 4 }")]),
        ("burgers", &[&stochastic("{ kind = \"grid-walk\", walks = 10 }")]),
        ("burgers", &[&stochastic("{ kind = \"monte-carlo\", paths = 10, substeps = 10 }")]),
        ("burgers", &[&stochastic("{ kind = \"strip\" }")]),
        ("schwarz-coarse", &["schwarz.coarse=\"none\""]),
        ("schwarz-not-converged", &["schwarz.linearized=false", "schwarz.sweep=\"alternating\""]),
        ("schwarz-robin", &["schwarz.robin=0.5"]),
        ("table-8-1-nonlinear", &["equidistribution.face_density=\"exact\""]),
        ("laplacian-model-problem", &["grid.grading={ toward = \"top\", power = 1.25 }"]),
        ("laplacian-model-problem", &["domain.distort={ shear = 0.1 }", "sides.neumann=[\"left\"]"]),
        ("stefan-slides", &["front.stepping=\"implicit\""]),
        ("stefan-slides", &["time.step=\"auto\""]),
    ];
    all.extend(variations.map(|(file, assignments)| Told::new(file, assignments)));
    let mut optimal = Told::new("schwarz-robin", &["schwarz.method=\"optimal\""]);
    optimal.strip("schwarz.robin");
    all.push(optimal);
    all
}

/// A study: a file and assignments to it.
#[derive(Clone)]
struct Told {
    text: String,
    assignments: Vec<String>,
}

impl Told {
    fn new(file: &str, assignments: &[&str]) -> Self {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("studies/{file}.toml"));
        let text = std::fs::read_to_string(path).unwrap();
        Self { text, assignments: assignments.iter().map(|text| text.to_string()).collect() }
    }

    /// The study after further assignments.
    fn with(&self, more: &[String]) -> driftmesh::Result<Study> {
        let mut source = Source::new("the study", self.text.clone());
        self.assignments.iter().chain(more).try_for_each(|assignment| source.set(assignment))?;
        Study::from_source(&source)
    }

    /// Takes a key out of the file.
    fn strip(&mut self, key: &str) {
        let (mut table, (place, name)) = (self.text.parse::<Table>().unwrap(), key.rsplit_once('.').unwrap());
        table.get_mut(place).and_then(Value::as_table_mut).and_then(|table| table.remove(name));
        self.text = table.to_string();
    }

    /// The same with every default filled in.
    fn resolved(&self) -> Self {
        Self { text: self.with(&[]).unwrap().to_toml(), assignments: Vec::new() }
    }
}

fn at<'a>(table: &'a Table, key: &str) -> Option<&'a Value> {
    let mut parts = key.split('.');
    let first = table.get(parts.next()?)?;
    parts.try_fold(first, |value, part| value.get(part))
}

/// A number, or each of several, times a factor; whole ones stay whole and above 0.
fn scaled(value: &Value, factor: f64) -> String {
    match value {
        Value::Integer(n) => ((*n as f64 * factor) as i64).max(1).to_string(),
        Value::Float(v) => format!("{:?}", if *v == 0.0 { 1.0 } else { v * factor }),
        Value::Array(all) => {
            format!("[{}]", all.iter().map(|value| scaled(value, factor)).collect::<Vec<_>>().join(", "))
        }
        _ => "1e-3".into(),
    }
}

/// Numbers of cells near a multiple of those that there are: subdomains of a line may fit some of them only.
fn cells(now: &Value, factor: f64) -> Vec<String> {
    let now: Vec<f64> = now.as_array().unwrap().iter().map(|n| n.as_integer().unwrap() as f64).collect();
    let some = |more: i64| format!("{:?}", now.iter().map(|n| (n * factor) as i64 + more).collect::<Vec<_>>());
    (0..66).map(some).collect()
}

/// Values that a key may have after an act; none where it is left out.
fn changes(act: Act, key: &str, now: &Table) -> Vec<String> {
    let value = at(now, key);
    match act {
        Act::Refine(Setting::Cells) => cells(value.unwrap(), 2.0),
        Act::Lower(Setting::Cells) => cells(value.unwrap(), 0.5),
        Act::Raise(_) | Act::Refine(_) => vec![value.map_or("20".into(), |value| scaled(value, 2.0))],
        Act::Lower(_) => vec![value.map_or("1e-3".into(), |value| scaled(value, 0.5))],
        Act::Set(_, values) => values.iter().map(|value| value.to_string()).collect(),
        Act::Number(_) => vec!["1e-3".into()],
        Act::LeaveOut(_) | Act::Say(_) => Vec::new(),
        Act::Change(_, setting) => vec![match (setting, key) {
            (Setting::Followed, _) => "\"exp(x)\"".into(),
            (Setting::End, "time.end") => {
                let start = at(now, "time.start").and_then(Value::as_float).unwrap_or(0.0);
                let end = at(now, key).and_then(|v| v.as_float().or(v.as_integer().map(|v| v as f64))).unwrap();
                format!("{:?}", 0.5 * (start + end))
            }
            (Setting::Density, "density.value") => "\"2 + x\"".into(),
            (Setting::Density, _) => "\"tanh(x)\"".into(),
            (Setting::Tolerance, _) => "1e-3".into(),
            (Setting::Map, _) => match at(now, "domain.closed").and_then(Value::as_array) {
                Some(closed) if closed.contains(&Value::Boolean(true)) => {
                    "{ x = \"(1 + r)*cos(2*pi*s)\", y = \"(1 + r)*sin(2*pi*s)\" }".into()
                }
                _ => "{ x = \"s\", y = \"r\" }".into(),
            },
            (Setting::Grading, "grid.grading.ratio") => "0.9".into(),
            (Setting::Slopes, "sides.neumann") => "[]".into(),
            (Setting::Slopes, _) => "\"exact\"".into(),
            (_, key) => scaled(value.expect(key), 0.75),
        }],
    }
}

/// Whether the study takes an act on a key: as it is written, or as it is resolved.
fn takes(told: &Told, act: Act, key: &str) -> Result<(), String> {
    let resolved = told.resolved();
    let now: Table = resolved.text.parse().unwrap();
    let mut refused = Vec::new();
    for mut told in [told.clone(), resolved] {
        let changed: Vec<_> = match act {
            Act::LeaveOut(_) => {
                told.strip(key);
                vec![told.with(&[])]
            }
            _ => {
                // the remedy says in the same breath that this one is left out
                if act.setting() == Some(Setting::Method) {
                    told.strip("schwarz.robin");
                }
                // reports that a shorter run does not reach are none of the remedy
                let shorter = act.setting() == Some(Setting::End) && at(&now, "time.report").is_some();
                let first = if shorter { vec!["time.report=[]".to_string()] } else { Vec::new() };
                let values = changes(act, key, &now);
                values
                    .iter()
                    .map(|value| told.with(&[first.clone(), vec![format!("{key}={value}")]].concat()))
                    .collect()
            }
        };
        // one number of cells may do, of values each
        let enough = if act.setting() == Some(Setting::Cells) { 1 } else { changed.len() };
        let accepted = changed.iter().filter(|changed| changed.is_ok()).count();
        match changed.into_iter().find_map(Result::err) {
            // of a melt too cold to be undercooled that is said by itself, with what helps
            Some(error) if error.to_string().contains("latent heat over capacity") => return Ok(()),
            Some(error) if accepted < enough => refused.push(error.to_string()),
            _ => return Ok(()),
        }
    }
    Err(refused.join("\n"))
}

/// Words of a text that are keys: `table.name`.
fn keys(text: &str) -> BTreeSet<String> {
    let words = text.split(|c: char| !(c.is_ascii_alphanumeric() || "._".contains(c)));
    let key = |word: &&str| word.contains('.') && word.starts_with(|c: char| c.is_ascii_lowercase());
    words.map(|word| word.trim_matches('.')).filter(key).map(String::from).collect()
}

/// Every key in the remedy of every failure is one that the study has and whose change it takes.
#[test]
fn every_key_in_a_remedy_is_taken() {
    let mut wrong = Vec::new();
    let (mut tried, mut silent) = (0, BTreeSet::new());
    for told in studies() {
        let study = told.with(&[]).unwrap_or_else(|error| panic!("{:?}: {error}", told.assignments));
        let label = format!("{} with {:?}", study.name(), told.assignments);
        let mut seen = Vec::new();
        for failure in failures() {
            let offers = study.offers(&failure);
            let offered: BTreeSet<String> = offers.iter().flat_map(|(_, keys)| keys.iter().cloned()).collect();
            let name = failure.name();
            let help = study.remedy(&Error::from(failure));
            let named = keys(help.as_deref().unwrap_or_default());
            assert_eq!(named, offered, "{label}, {name}: {help:?}");
            if help.is_none() {
                silent.insert(name);
            }
            for (act, keys) in offers {
                for key in keys {
                    if seen.contains(&(act, key.clone())) {
                        continue;
                    }
                    tried += 1;
                    if let Err(refused) = takes(&told, act, &key) {
                        wrong.push(format!("{label}: {act:?} of {key}: {refused}"));
                    }
                    seen.push((act, key));
                }
            }
        }
    }
    println!("{tried} changes tried; nothing to say in some study for {silent:?}");
    assert!(tried > 300, "{tried} changes");
    assert!(wrong.is_empty(), "{} of {tried}:\n{}", wrong.len(), wrong.join("\n"));
}

fn study(file: &str, assignments: &[&str]) -> Study {
    Told::new(file, assignments).with(&[]).unwrap()
}

fn folded() -> Failure {
    Failure::Folded { cell: vec![1, 2], jacobian: -0.1, x: vec![0.5; 2], noise: None }
}

/// A folded mesh is cured by what the monitor has: `auto` has nothing to set, and a mesh in conservative form no
/// gradient.
#[test]
fn a_folded_mesh_is_told_the_keys_of_its_monitor() {
    let said = |assignments: &[&str]| study("burgers", assignments).remedy(&folded().into()).unwrap();
    let auto = said(&["time.step=1e-3"]);
    assert_eq!(auto, "lower time.step (now 0.001)");
    let arclength = "monitor={ kind = \"arclength\" }";
    let set = said(&["time.step=1e-3", "mesh.relaxation=0.5", arclength]);
    let expected = "raise monitor.smoothing (now 2), lower monitor.strength.relative (now 30.0), \
                    lower time.step (now 0.001) or raise mesh.relaxation (now 0.5)";
    assert_eq!(set, expected);
    let gradient = said(&["time.step=1e-3", "mesh.form=\"gradient\"", arclength]);
    assert!(
        gradient.ends_with("; set monitor.gradient (now \"central\") to \"safe\" where the density is very steep"),
        "{gradient}"
    );
}

/// A front follows no density, and a mesh on a line has none of two dimensions.
#[test]
fn other_kinds_are_told_their_own_keys() {
    for file in ["stefan-slides", "stefan-planar", "laplacian-model-problem", "table-8-1-nonlinear"] {
        for failure in failures() {
            let help = study(file, &[]).remedy(&failure.into()).unwrap_or_default();
            assert!(!help.contains("monitor.") && !help.contains("mesh."), "{file}: {help}");
        }
    }
}

/// What failed in the run of `[compare]` is cured there.
#[test]
fn a_reference_is_told_its_own_generator() {
    let study = study("burgers", &["compare.generator={ kind = \"schwarz\", subdomains = [2, 2] }"]);
    let stalled = || Failure::SchwarzStalled { change: 1.0, tolerance: 1e-10, iterations: 5 };
    let own = study.remedy(&stalled().into()).unwrap();
    assert!(!own.contains("generator"), "{own}");
    let compared = study.remedy(&Error::Compared(Box::new(stalled().into()))).unwrap();
    let expected = "raise compare.generator.iterations (now 1000), raise compare.generator.overlap (now 2)";
    assert!(compared.starts_with(expected), "{compared}");
    assert!(compared.contains("compare.generator.overlap") && !compared.contains("mesh.generator"), "{compared}");
}
