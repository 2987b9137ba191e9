//! What must hold for any bytes: no panic, no endless work, and what is accepted means the same when it is written out.
//!
//!     RUSTC_BOOTSTRAP=1 cargo fuzz run study -- -max_total_time=600
//!
//! `tests/corpora.rs` replays the corpora through the same functions.
#![allow(dead_code)] // each user takes one of them

#[path = "line.rs"]
pub mod line;

use driftmesh::formula::{Formula, Program};
use driftmesh::study::{EquidistributionStudy, Kind, Source, Study};

/// A formula, its derivatives, and both ways to evaluate them.
pub fn formula(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    let names = ["x", "y", "t"];
    let formula = match Formula::parse(text, &names) {
        Ok(formula) => formula,
        Err(mistake) => {
            assert!(text.get(mistake.at.clone()).is_some(), "{:?} is no part of {text:?}", mistake.at);
            assert!(!mistake.message.is_empty());
            return;
        }
    };
    let Ok(slope) = formula.derivative(0) else { return };
    let program = Program::<2, 2>::new([&formula, &slope]);
    for point in [[0.0, 0.0], [0.3, -2.0], [1e9, 1e-9], [f64::NAN, f64::INFINITY]] {
        let [value, derivative] = program.eval(point, &[0.5]);
        let [x, y] = point;
        assert_eq!(value.to_bits(), formula.eval(&[x, y, 0.5]).to_bits(), "{text} at {point:?}");
        assert_eq!(derivative.to_bits(), slope.eval(&[x, y, 0.5]).to_bits(), "{slope} at {point:?}");
    }
}

/// A study file: refused at a place, or accepted and then the same when it is read again.
pub fn study(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    let Ok(study) = Study::from_source(&Source::new("fuzz.toml", text)) else { return };
    let resolved = study.to_toml();
    let again = Study::from_source(&Source::new("resolved.toml", resolved.as_str()));
    let again = again.unwrap_or_else(|error| panic!("{error}\nin {resolved}"));
    assert_eq!(again.to_toml(), resolved);
}

/// A line whose settings follow from the first eight bytes, and whose density or u is the formula of the others: it is
/// refused, completes with its nodes in order or ends by name.
pub fn equidistribution(data: &[u8]) {
    let Some((choices, text)) = data.split_first_chunk() else { return };
    let Some(text) = std::str::from_utf8(text).ok().filter(|text| Formula::parse(text, &["x"]).is_ok()) else { return };
    let mut dice = line::dice::Dice(u64::from_le_bytes(*choices));
    let density = match dice.whole(0, 1) {
        0 => format!("kind = \"formula\"\nvalue = {text:?}"),
        _ => format!("kind = \"arclength\"\nof = {text:?}"),
    };
    let text = line::text(&mut dice, &density);
    let Ok(study) = EquidistributionStudy::from_source(&Source::new("line.toml", text.as_str())) else { return };
    line::ending(&study).unwrap_or_else(|mistake| panic!("{mistake}\n{text}"));
}

/// A checkpoint behind its checksum: refused, or of a step of the run.
pub fn checkpoint(data: &[u8]) {
    for (name, text) in [("moving", MOVING), ("front", FRONT)] {
        let study = Study::from_source(&Source::new(name, text)).expect("the study is valid");
        if let Ok(step) = study.decode(data) {
            assert!(step <= 1000, "step {step}");
        }
    }
}

/// The studies of the corpus: `driftmesh run` leaves a checkpoint of them when it is interrupted; its first 55 bytes
/// go.
const MOVING: &str = include_str!("studies/moving.toml");
const FRONT: &str = include_str!("studies/front.toml");
