//! Equidistribution studies from random choices, and what must hold of each.
#![allow(dead_code)] // each user takes some of them

#[path = "../tests/dice/mod.rs"]
pub mod dice;

use dice::Dice;
use driftmesh::study::{EquidistributionStudy, Kind};

/// The text of a study of the density `[density]`: averages, method, subdomains, tolerances and first mesh by the dice.
pub fn text(dice: &mut Dice, density: &str) -> String {
    let faces = dice.of(["exact", "trapezoid", "midpoint"]);
    let subdomains = dice.whole(1, 16).min(dice.whole(1, 64));
    let overlap = 2 * dice.whole(1, 3);
    let width = dice.whole(overlap + 2, overlap + 30);
    let cells = subdomains * width - (subdomains - 1) * overlap;
    let cuts: Vec<String> =
        (1..subdomains).map(|s| format!("{:?}", (s * cells / subdomains) as f64 / cells as f64)).collect();
    let classical = format!("subdomains = {subdomains}\noverlap_cells = {overlap}\n");
    let meeting = format!("cuts = [{}]\n", cuts.join(", "));
    let schwarz = match dice.whole(0, 7) {
        _ if subdomains == 1 => String::new(),
        0 => format!("[schwarz]\n{classical}"),
        1 => format!("[schwarz]\n{classical}linearized = true\n"),
        2 => format!("[schwarz]\n{classical}sweep = \"alternating\"\n"),
        3 => format!("[schwarz]\n{classical}coarse = \"galerkin\"\n"),
        4 => format!("[schwarz]\nmethod = \"optimal\"\n{meeting}"),
        5 => format!("[schwarz]\nmethod = \"optimized\"\n{meeting}"),
        6 => format!("[schwarz]\nmethod = \"optimized\"\nrobin = \"lagged\"\n{meeting}"),
        _ => format!("[schwarz]\nmethod = \"optimized\"\nrobin = {}\n{meeting}", dice.between(0.1, 100.0)),
    };
    let stop = match dice.whole(0, 2) {
        0 => format!("iterations = {}", dice.whole(1, 60)),
        1 => format!("iterations = 60\ntolerance = {:e}", dice.between(1e-12, 1e-3)),
        _ => format!("iterations = 60\ntolerance = {:e}\nmeasure = \"increment\"", dice.between(1e-12, 1e-3)),
    };
    let start = dice.of(["\"uniform\"", "\"equidistributed\"", "{ formula = \"xi^1.3\" }", "{ formula = \"xi^0.2\" }"]);
    format!(
        "[study]\nname = \"line\"\nkind = \"equidistribution\"\n[grid]\ncells = [{cells}]\n[density]\n{density}\n\
         [equidistribution]\nface_density = \"{faces}\"\n{schwarz}[stop]\n{stop}\n[start]\nmesh = {start}\n"
    )
}

/// How a study ends: "completed" with its nodes in order, or the name of a failure; anything else is a mistake.
///
/// # Errors
/// What is wrong.
pub fn ending(study: &EquidistributionStudy) -> Result<&'static str, String> {
    match study.compute() {
        Ok((run, None)) if !run.evolution.mesh().is_sorted_by(|a, b| a < b) => Err("completed out of order".into()),
        Ok((_, None)) => Ok("completed"),
        Ok((_, Some(driftmesh::Error::Failed { failure, .. }))) | Err(driftmesh::Error::Failed { failure, .. }) => {
            Ok(failure.name())
        }
        Ok((_, Some(other))) | Err(other) => Err(format!("ended without a name: {other}")),
    }
}
