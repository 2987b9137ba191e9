//! Names of the files in the directory of a run. A run that replaces another removes files of these names alone.

/// What every run says of itself, as JSON.
pub const SUMMARY: &str = "summary.json";
/// The study, every default filled in.
pub const STUDY: &str = "study.toml";
/// Table of the steps or iterates.
pub const HISTORY: &str = "history.csv";
/// Table of the heights of a front at its columns, a row a step.
pub const FRONTS: &str = "front.csv";
/// Arrays of the last state.
pub const ARRAYS: &str = "final.npz";
/// The last mesh of two dimensions for ParaView.
pub const GRID: &str = "final.vts";
/// The page with everything.
pub const REPORT: &str = "report.html";
/// The frames as a moving picture.
pub const ANIMATION: &str = "animation.gif";
/// The folder of the frames, and the file that puts them in time.
pub const FRAMES: [&str; 2] = ["frames", "run.pvd"];
/// The folder of the frames of the run that this one is compared with, and the file that puts them in time.
pub const COMPARED: [&str; 2] = ["compare", "compare.pvd"];
/// The newest checkpoint of a run that is not at its end and the one before, written in turns.
pub const CHECKPOINTS: [&str; 2] = ["checkpoint.0", "checkpoint.1"];
/// The checkpoint after the last step, from which a run goes on to a later end.
pub const LAST_CHECKPOINT: &str = "final.state";

/// The last mesh, or the nodes of a line over time.
pub const MESH: &str = "mesh";
/// The density of a line.
pub const DENSITY: &str = "density";
/// A Schwarz iteration on a line.
pub const CONVERGENCE: &str = "convergence";
/// The front over time.
pub const FRONT: &str = "front";
/// Pictures: those above, and the plots of a report.
pub const PICTURES: [&str; 12] = [
    MESH,
    DENSITY,
    CONVERGENCE,
    FRONT,
    "contraction",
    "energy",
    "error",
    "front-error",
    "front-position",
    "quality",
    "steps",
    "temperature",
];
/// Every picture is there in each of these formats, by which the names of its files end.
pub const PICTURE_FORMATS: [&str; 2] = ["svg", "png"];

/// Tables and frames, which a run adds to as it goes on.
pub(super) const GROWING: [&str; 4] = [HISTORY, FRONTS, FRAMES[0], FRAMES[1]];

/// All files that a run may write, beside its frames; the checkpoints of a run that is not at its end come last.
pub(super) fn files() -> impl Iterator<Item = String> + Clone {
    let ended = [LAST_CHECKPOINT, SUMMARY, STUDY, HISTORY, FRONTS, ARRAYS, GRID, REPORT, ANIMATION];
    let plain = ended.into_iter().chain([FRAMES[1], COMPARED[1]]).map(String::from);
    let pictures = PICTURES.into_iter().flat_map(|name| PICTURE_FORMATS.map(|format| format!("{name}.{format}")));
    plain.chain(pictures).chain(CHECKPOINTS.map(String::from))
}
