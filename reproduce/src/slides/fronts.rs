//! Moving fronts: the slides' problem, and exact solutions.

use crate::{Options, Rerun, Table};
use driftmesh::error::{Error, Result};
use driftmesh::output::{Curve, Figure, Picture, draw};
use driftmesh::study::{FrontRun, Kind, Running, Source, StefanStudy};

const BOX: &str = "[domain]\nx = [-1.0, 1.0]\nbottom = \"0\"\ntop = \"2 + cos(x)/2\"\n";

/// A run with its failure, if it had one.
type Ran = (FrontRun, Option<Error>);

fn compute(rest: &str) -> Result<Ran> {
    let text = format!("[study]\nname = \"reproduced\"\nkind = \"stefan\"\n{BOX}{rest}");
    StefanStudy::from_source(&Source::new("reproduced", text))?.compute()
}

/// The slides' problem up to a time, with settings of its front and its Laplacian.
fn problem(across: usize, rows: usize, front: &str, end: f64) -> Result<Ran> {
    let report = if end > 0.17 { "0.07, 0.17, 0.85" } else { "" };
    let report = if report.is_empty() { format!("{end:?}") } else { report.into() };
    compute(&format!(
        "front = \"1 + cos(x)/4\"\n[grid]\ncells = [{across}, {rows}, {rows}]\n\
         [phase.lower]\ninitial = \"1 + cos(x)/4 - y\"\nboundary = \"1 + (t+1)*cos(x)/4\"\n\
         [phase.upper]\ninitial = \"1 + cos(x)/4 - y\"\nboundary = \"-1 + (t/4-1)*cos(x)/4\"\n\
         [front]\nmobility = 1.0\n{}{front}[time]\nend = {end:?}\nstep = 0.01\nreport = [{report}]\n",
        if front.contains("stepping") { "" } else { EXPLICIT }
    ))
}

/// The slides move the front before the temperatures.
const EXPLICIT: &str = "stepping = \"explicit\"\n";

/// What the slides have: segments that shift along their normals, temperatures interpolated, their weights, no filter.
const LITERAL: &str =
    "method = \"segments\"\ntransfer = \"interpolate\"\nfilter = \"none\"\n[laplacian]\nkind = \"published\"\n";
const SOUND: &str = "the slides print pictures of this problem and no number. “sound” where the front is symmetric \
     to 1e-9, its fourth difference at the walls below 1e-4, and the gap of the energy balance 1 % or less at every \
     time; else what is not";

pub fn slides(options: Options) -> Result<Rerun> {
    let mut pictures = Vec::new();
    let mut table = Table::new(
        "The slides' front between ice and water, to t = .85",
        &[
            "columns × rows",
            "settings",
            "h(0)",
            "h(±1)",
            "asymmetry",
            "4th difference at the walls",
            "energy at .07",
            ".17",
            ".85",
            "3-point at .85",
            "verdict",
        ],
    )
    .ruled(SOUND);
    let settings = [
        ("segments, interpolate, no filter, published weights (literal as far as given)", LITERAL),
        ("(1,6,1)/8, as recommended", ""),
        ("(1,2,1)/4", "filter = [1, 2, 1]\n"),
        ("segments", "method = \"segments\"\n"),
        ("interpolate", "transfer = \"interpolate\"\n"),
        ("segments, interpolate", "method = \"segments\"\ntransfer = \"interpolate\"\n"),
        ("implicit", "stepping = \"implicit\"\n"),
    ];
    let grids: &[[usize; 2]] = if options.quick { &[[40, 20]] } else { &[[20, 10], [40, 20]] };
    for &[across, rows] in grids {
        for (name, front) in settings {
            let ran = problem(across, rows, front, 0.85)?;
            table.row(front_row(format!("{} × {}", across + 1, rows + 1), name, &ran));
            if front.is_empty() && across == 40 {
                pictures.push(("stefan-slides".into(), drawn(&ran.0, "The slides' front")?));
                pictures.push(("stefan-slides-front".into(), ran.0.picture("The slides' front")));
            }
        }
    }
    // the states that the slides show: after 7 and 17 steps
    for (steps, end) in [(7, 0.07), (17, 0.17)] {
        for (name, title, front) in [("literal", "literal as far as given", LITERAL), ("ours", "(1,6,1)/8", "")] {
            let (run, _) = problem(40, 20, front, end)?;
            let state = drawn(&run, &format!("The slides' front, {title}, after {steps} steps"))?;
            pictures.push((format!("stefan-slides-{steps}-steps-{name}"), state));
        }
    }
    notes(&mut table);
    if options.quick {
        table.note("quick: the finer of two grids only");
    }
    Ok(Rerun { tables: vec![table], pictures })
}

fn notes(table: &mut Table) {
    table.note(
        "energy: |ΔE − ∫F dt| over the heat that was moved, with fluxes through the walls by weighted residual, then \
         by three rows",
    );
    table.note("the published initial temperature contradicts the no-flux sides: the front bends up there at first");
    table.note(
        "the slides give neither D₀, D₁ and L_H, here 1, nor the step δ, here .01, nor the grid, here so many \
         columns and so many rows in each phase, nor a time but 7 and 17 steps: t = .85 is ours",
    );
}

/// The mesh over the temperature at the end of a run.
fn drawn(run: &FrontRun, title: &str) -> Result<Picture> {
    let scene = run.scene()?;
    Ok(draw(&format!("{title}, {}", run.caption(&scene)), &scene))
}

fn front_row(size: String, name: &str, (run, failure): &Ran) -> Vec<String> {
    let (h, n) = (&run.course.state.front, run.course.state.front.len() - 1);
    let reports = &run.course.reports;
    if let Some(failure) = failure {
        let why = match failure {
            Error::Failed { failure, moment } => {
                format!("{}{}", failure.name(), moment.map_or(String::new(), |m| format!(" in step {}", m.step)))
            }
            other => other.to_string(),
        };
        let dash = std::iter::repeat_n("–".to_string(), 8);
        return [size, name.into()].into_iter().chain(dash).chain([why]).collect();
    }
    let asymmetry = (0..=n).map(|i| (h[i] - h[n - i]).abs()).fold(0.0, f64::max);
    let fourth = (h[0] - 4.0 * h[1] + 6.0 * h[2] - 4.0 * h[3] + h[4]).abs();
    let percent = |value: Option<f64>| value.map_or("–".into(), |value| format!("{:.2} %", 100.0 * value));
    let gaps: Vec<Option<f64>> = reports.iter().map(|report| report.energy_imbalance).collect();
    let uneven = gaps.iter().flatten().any(|gap| *gap > 0.01);
    let faults = [(asymmetry > 1e-9, "not symmetric"), (fourth >= 1e-4, "zig-zag at the walls"), (uneven, "energy")];
    let faults: Vec<&str> = faults.into_iter().filter(|(is, _)| *is).map(|(_, what)| what).collect();
    let gap = |k: usize| percent(gaps.get(k).copied().flatten());
    vec![
        size,
        name.into(),
        format!("{:.5}", h[n / 2]),
        format!("{:.5}", h[0]),
        format!("{asymmetry:.0e}"),
        format!("{fourth:.1e}"),
        gap(0),
        gap(1),
        gap(2),
        percent(reports.last().and_then(|report| report.energy_imbalance_by_differences)),
        if faults.is_empty() { "sound".into() } else { faults.join(", ") },
    ]
}

/// A case with an exact solution: its name, what `[exact]` says, and what the walls need.
type Case = (&'static str, &'static str, &'static str);

const CASES: [Case; 3] = [
    ("planar", "kind = \"planar\"\nwall = 1.0\nfar = -0.5\nstart_front = 0.7\n", ""),
    (
        "tilted by 20°",
        "kind = \"planar\"\nwall = 1.0\nfar = -0.5\nstart_front = 0.7\ntilt = 20.0\n",
        "[walls]\nsides = \"exact\"\n",
    ),
    (
        "line source",
        "kind = \"line-source\"\nstrength = 8.0\nfar = -0.3\nstart_radius = 1.5\ncentre = [0.0, -0.5]\n",
        "[walls]\nsides = \"exact\"\n",
    ),
];
const SETTINGS: [(&str, &str); 8] = [
    ("graph, ale", ""),
    ("(1,2,1)/4", "filter = [1, 2, 1]\n"),
    ("implicit", "stepping = \"implicit\"\n"),
    ("segments", "method = \"segments\"\n"),
    (INTERPOLATE, "transfer = \"interpolate\"\n"),
    ("harmonic", "[laplacian]\nkind = \"harmonic\"\n"),
    ("published, printed", "[laplacian]\nkind = \"published\"\n"),
    ("published, harmonic", "[laplacian]\nkind = \"published\"\npolynomials = \"harmonic\"\n"),
];
const INTERPOLATE: &str = "interpolate";

pub fn exact(options: Options) -> Result<Rerun> {
    let (mut pictures, mut curves) = (Vec::new(), [Vec::new(), Vec::new()]);
    let mut table = Table::new(
        "Largest error of the front against exact solutions, t₀ to t₀ + .1",
        &["case", "settings", "11 × 9", "21 × 17", "order", "41 × 33", "order", "temperature, last", "verdict"],
    )
    .ruled(
        "“second order” where every halving of the cells lowers the error of the front by order 1.7 or more; the \
         slides have no exact solution",
    );
    for case in CASES {
        for (name, more) in SETTINGS {
            // 41 columns take seconds: in the quick form only where they decide
            let decides = case.0 == "line source" && (more.is_empty() || more.contains("laplacian"));
            let sizes = if options.quick && !decides { 2 } else { 3 };
            let found = refined(case, more, sizes, &mut pictures)?;
            if more.is_empty() || name == INTERPOLATE {
                curves[usize::from(name == INTERPOLATE)].push(found.curve(case.0));
            }
            table.row(found.row(case.0, name));
        }
    }
    table.note("steps of .01, .0025 and .000625: a quarter where the cells are halved");
    table.note(
        "41 columns decide for the line source: stencils that are not exact for quadratics pass at 21 and are \
         lost there, or have a temperature far off",
    );
    if options.quick {
        table
            .note("quick: 41 columns only for the line source, with the first settings and the kinds of the Laplacian");
    }
    let [first, second] = curves;
    pictures.push(("stefan-exact".into(), errors("graph, ale", first)));
    pictures.push(("stefan-exact-interpolate".into(), errors("temperatures interpolated", second)));
    Ok(Rerun { tables: vec![table], pictures })
}

fn errors(settings: &str, curves: Vec<Curve>) -> Picture {
    // the last mark does not lie on the frame
    let lowest = curves.iter().flat_map(|curve| &curve.points).map(|p| p[1]).fold(f64::INFINITY, f64::min);
    Figure {
        title: format!("Largest error of the front after .1: {settings}"),
        labels: ["cells across".into(), "error".into()],
        curves,
        room: vec![[10.0, lowest / 1.3]],
        ..Figure::default()
    }
    .draw()
}

/// What a case with settings comes to as the grid is refined.
struct Refined {
    /// Largest errors of the front; none where the run was lost.
    errors: Vec<Option<f64>>,
    /// Of the temperature on the last grid.
    temperature: f64,
    failure: Option<Error>,
}

fn refined(
    (case, exact, walls): Case,
    more: &str,
    sizes: usize,
    pictures: &mut Vec<(String, Picture)>,
) -> Result<Refined> {
    let mut found = Refined { errors: Vec::new(), temperature: f64::NAN, failure: None };
    for n in [1, 2, 4].into_iter().take(sizes) {
        let text = format!(
            "[grid]\ncells = [{}, {}, {}]\n[front]\n{}{more}{walls}[exact]\n{exact}[time]\nduration = 0.1\nstep = {}\n",
            10 * n,
            8 * n,
            8 * n,
            if more.contains("stepping") { "" } else { EXPLICIT },
            0.01 / (n * n) as f64
        );
        let (run, failure) = compute(&text)?;
        let report = run.course.reports.first().copied();
        found.errors.push(report.and_then(|report| report.front.error_linf));
        found.temperature = report.and_then(|report| report.error).map_or(f64::NAN, |error| error.linf);
        if n == 2 && more.is_empty() {
            let name = format!("stefan-exact-{}", case.split(' ').next().unwrap_or(case));
            let title = format!("Exact solution, {case}");
            let at = format!("{title}, t = {:.3}", run.course.state.t);
            pictures.push((name.clone(), draw(&at, &run.scene()?)));
            pictures.push((format!("{name}-front"), run.picture(&title)));
        }
        found.failure = found.failure.or(failure);
    }
    Ok(found)
}

impl Refined {
    fn at(&self, k: usize) -> Option<f64> {
        self.errors.get(k).copied().flatten()
    }

    /// From one grid to the next.
    fn order(&self, k: usize) -> Option<f64> {
        self.at(k).zip(self.at(k + 1)).map(|(a, b)| (a / b).log2())
    }

    fn curve(&self, case: &str) -> Curve {
        let cells = [1, 2, 4].into_iter().map(|n| 10.0 * f64::from(n));
        let points = cells.zip(&self.errors).filter_map(|(n, error)| error.map(|error| [n, error])).collect();
        Curve { name: case.into(), points, ..Curve::default() }
    }

    fn row(&self, case: &str, name: &str) -> [String; 9] {
        let shown = |k: usize| match (self.errors.get(k), self.at(k)) {
            (None, _) => "".to_string(),
            (_, None) => "lost".into(),
            (_, Some(error)) => format!("{error:.2e}"),
        };
        let order = |k: usize| self.order(k).map_or("".into(), |order| format!("{order:.2}"));
        let second = (0..self.errors.len() - 1).all(|k| self.order(k).is_some_and(|order| order >= 1.7));
        let verdict = match &self.failure {
            Some(Error::Failed { failure, .. }) => failure.name(),
            _ if second => "second order",
            _ => "not second order",
        };
        [
            case.to_string(),
            name.into(),
            shown(0),
            shown(1),
            order(0),
            shown(2),
            order(1),
            if self.temperature.is_finite() { format!("{:.1e}", self.temperature) } else { "–".into() },
            verdict.into(),
        ]
    }
}
