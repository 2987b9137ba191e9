//! What the reports in `summary.json` say of the integrals of unknowns.

use driftmesh::study::{Begin, Source, Study};
use serde_json::Value;

/// Runs a study of formulas with periodic axes, and returns `conserved` of its last report.
fn conserved(pde: &str, settings: &[&str]) -> Value {
    let text = format!(
        r#"
[study]
name = "integrals"
kind = "moving-mesh"
[domain]
periodic = [true, true]
[grid]
cells = [12, 8]
[time]
start = 0.0
end = 0.2
step = 0.01
[mesh]
generator = {{ kind = "fixed" }}
[output]
report = false
[pde]
{pde}
"#
    );
    let mut source = Source::new("a study", text);
    settings.iter().for_each(|setting| source.set(setting).unwrap());
    let out = tempfile::tempdir().unwrap();
    let study = Study::from_source(&source).unwrap_or_else(|error| panic!("{error}"));
    assert!(study.run(out.path(), Begin::Anew, &mut []).unwrap().is_none());
    let summary: Value = serde_json::from_slice(&std::fs::read(out.path().join("summary.json")).unwrap()).unwrap();
    summary["reports"].as_array().unwrap().last().unwrap()["conserved"].clone()
}

#[track_caller]
fn assert_close(found: &Value, expected: f64, within: f64) {
    let found = found.as_f64().unwrap();
    assert!((found - expected).abs() < within, "{found:e} is not {expected:e}");
}

/// u_t = 1 with ∫u = 2 at the start grows to 2.2, a tenth more; v is carried along, and keeps its 3. The first unknown
/// is told as ever, and again by its name.
#[test]
fn every_unknown_is_told_by_name() {
    let pde = r#"
kind = "formula"
unknowns = ["u", "v"]
flux = { u = ["0", "0"], v = ["v", "0"] }
source = { u = "1", v = "0" }
initial = { u = "2", v = "3 + sin(2*pi*x)" }
"#;
    let found = conserved(pde, &[]);
    let keys: Vec<&String> = found.as_object().unwrap().keys().collect();
    assert_eq!(keys, ["mass", "drift", "u", "v"]);
    for of in [&found, &found["u"]] {
        assert_close(&of["mass"], 2.2, 1e-12);
        assert_close(&of["drift"], 0.1, 1e-12);
    }
    assert_close(&found["v"]["mass"], 3.0, 1e-12);
    assert_close(&found["v"]["drift"], 0.0, 1e-13);
}

/// sin 2πx has the integral 0 but for rounding, and decays to nothing by diffusion: what the integral changes by is
/// rounding, and no share of that. The names of the two figures are taken, and unknowns of these names stand aside.
#[test]
fn drift_is_no_share_of_rounding_and_names_do_not_collide() {
    let pde = r#"
kind = "formula"
unknowns = ["mass", "drift"]
flux = { mass = ["0", "0"], drift = ["0", "0"] }
diffusivity = { mass = "2", drift = "2" }
initial = { mass = "5 + cos(2*pi*x)", drift = "sin(2*pi*x)*(1 + 0.3*cos(2*pi*y))" }
"#;
    let found = conserved(pde, &["time.end=1.0", "time.step=0.02"]);
    let keys: Vec<&String> = found.as_object().unwrap().keys().collect();
    assert_eq!(keys, ["mass", "drift", "unknown mass", "unknown drift"]);
    assert_close(&found["mass"], 5.0, 1e-10);
    assert_close(&found["unknown mass"]["mass"], 5.0, 1e-10);
    assert_close(&found["unknown drift"]["drift"], 0.0, 1e-12);
}

/// The water that collapses keeps its depth, and its momentum, which begins with nothing.
#[test]
fn water_is_told_by_its_momentum() {
    let found = conserved("kind = \"shallow-water\"", &["time.end=0.05"]);
    let keys: Vec<&String> = found.as_object().unwrap().keys().collect();
    assert_eq!(keys, ["mass", "drift", "h", "u", "v"]);
    assert_eq!(found["h"]["mass"], found["mass"]);
    for axis in ["u", "v"] {
        assert_eq!(found[axis]["drift"], found[axis]["mass"]);
        assert_close(&found[axis]["drift"], 0.0, 1e-12);
    }
}
