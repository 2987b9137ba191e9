use super::files::RunFiles;
use super::tables::{self, Part, Table};
use super::viewer::Viewer;
use crate::output::names;
use base64::{Engine, engine::general_purpose::STANDARD};
use minijinja::Environment;
use serde::Serialize;
use serde_json::Value;

/// Files of `assets/report` that make up the page.
const TEMPLATE: &str = include_str!("../../assets/report/page.html");
const STYLE: &str =
    concat!(include_str!("../../assets/report/style.css"), include_str!("../../assets/report/viewer.css"));
const SCRIPT: &str = concat!(
    include_str!("../../assets/report/parts.js"),
    include_str!("../../assets/report/paint.js"),
    include_str!("../../assets/report/stage.js"),
    include_str!("../../assets/report/viewer.js"),
    include_str!("../../assets/report/mesh.js"),
    include_str!("../../assets/report/line.js"),
    include_str!("../../assets/report/start.js"),
);
/// Pictures above this are left to the directory.
const LARGE: u64 = 1 << 20;

#[derive(Serialize)]
struct Page<'a> {
    study: &'a str,
    kind: &'a str,
    version: &'a str,
    status: &'a str,
    said: String,
    /// What failed.
    failure: Option<&'a str>,
    /// What may cure it.
    help: Option<&'a str>,
    /// How to go on with a run that ended early.
    resume: Option<&'static str>,
    warnings: Vec<&'a str>,
    notes: &'a [String],
    viewer: Option<ViewerOnPage<'a>>,
    tables: Vec<Table>,
    wall: Option<String>,
    parts: Vec<Part>,
    plots: Vec<Plot>,
    pictures: Vec<Shown>,
    text: &'a str,
    style: &'a str,
    script: &'a str,
}

#[derive(Serialize)]
struct ViewerOnPage<'a> {
    data: &'a str,
    line: bool,
    moves: bool,
    clock: &'static str,
    thinned: Option<&'a str>,
}

/// A plot, as it stands on the page.
#[derive(Serialize)]
pub struct Plot {
    pub title: String,
    pub svg: String,
}

/// A picture of the directory.
#[derive(Serialize)]
struct Shown {
    title: &'static str,
    source: String,
    /// Whether it has a colour map, whose light and dark mean something.
    mapped: bool,
}

/// The page, everything in it.
pub fn render(run: &RunFiles, plots: Vec<Plot>, viewer: Option<&Viewer>) -> String {
    let (wall, parts) = tables::seconds(&run.summary);
    let failed = run.summary.values().find(|value| value.get("message").is_some());
    let told = |key: &str| failed.and_then(|failed| failed.get(key)?.as_str());
    let warnings = run.summary.get("warnings").and_then(Value::as_array);
    let status = match run.word("status") {
        "running" if !run.busy => "killed",
        other => other,
    };
    let compared = failed.is_some_and(|failed| failed.get("compared").is_some());
    let page = Page {
        study: run.word("study"),
        kind: run.word("kind"),
        version: run.word("version"),
        status,
        said: match status {
            "completed" => "The run is complete.".into(),
            _ if compared => "The run itself is complete; the one that it is compared with is not.".into(),
            "failed" => "The run failed; everything up to the last good state is here.".into(),
            "not-converged" => "The iteration did not converge.".into(),
            "interrupted" => "The run was interrupted; everything up to the last good state is here.".into(),
            "running" => "The run still goes on. This is what it left so far.".into(),
            "killed" => "The run was killed, or the machine stopped, before its end. This is what it left.".into(),
            other => format!("Status: {other}."),
        },
        failure: told("message"),
        help: told("help"),
        resume: ["interrupted", "killed"].contains(&status).then_some(match run.resumable {
            true => "The same command with --resume goes on.",
            false => "There is no checkpoint to go on from: the same command begins anew.",
        }),
        warnings: warnings.into_iter().flatten().filter_map(Value::as_str).collect(),
        notes: &run.notes,
        viewer: viewer.map(|v| ViewerOnPage {
            data: &v.data,
            line: v.line,
            moves: v.moves,
            clock: v.clock,
            thinned: v.thinned.as_deref(),
        }),
        tables: tables::of(&run.summary),
        wall,
        parts,
        plots,
        pictures: pictures(run, viewer.is_some()),
        text: &run.study_text,
        style: STYLE,
        script: SCRIPT,
    };
    let environment = Environment::new();
    environment
        .render_named_str("page.html", TEMPLATE, minijinja::value::Serde(&page))
        .expect("the template fits the page")
}

/// Pictures that the run drew itself; the mesh only where no viewer shows it.
fn pictures(run: &RunFiles, viewed: bool) -> Vec<Shown> {
    // that of a line shows the paths of its nodes
    let line = run.word("kind") == "equidistribution";
    let candidates = [
        (names::MESH, if line { "The nodes" } else { "The mesh" }, line || !viewed),
        (names::DENSITY, "The density", true),
        (names::CONVERGENCE, "Convergence", true),
        (names::FRONT, "The front over time", true),
    ];
    let formats = [("svg", "image/svg+xml"), ("png", "image/png")];
    let picture = |(name, title, wanted): (&str, &'static str, bool)| {
        formats.iter().filter(|_| wanted).find_map(|(format, mime)| {
            let path = run.directory.join(format!("{name}.{format}"));
            let small = std::fs::metadata(&path).is_ok_and(|file| file.len() <= LARGE);
            let bytes = small.then(|| std::fs::read(&path).ok()).flatten()?;
            Some(Shown {
                title,
                mapped: !line && [names::MESH, names::FRONT].contains(&name),
                source: format!("data:{mime};base64,{}", STANDARD.encode(bytes)),
            })
        })
    };
    candidates.into_iter().filter_map(picture).collect()
}
