use super::{Options, Rerun, Table};
use driftmesh::error::Result;
use driftmesh::output::{Curve, Figure};
use driftmesh::study::{Kind, MovingMesh, MovingRun, Source};

/// How a run came out.
#[derive(Debug, Clone, Copy)]
struct Outcome {
    cells: usize,
    /// None where it is extrapolated.
    run: Option<Run>,
    /// Seconds on one thread, without output.
    seconds: f64,
}

#[derive(Debug, Clone, Copy)]
struct Run {
    l_inf: f64,
    /// Time steps, or substeps of an explicit method.
    steps: usize,
}

/// What competes for the least time.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Method {
    Moving,
    Uniform { order: u8 },
}

/// What is asked of a run.
#[derive(Debug, Clone, Copy)]
struct Task {
    viscosity: f64,
    end: f64,
    /// l_inf at the end.
    target: f64,
}

/// Factor between the cells of one grid and the next in the search for the coarsest grid that meets an error.
const FINER: f64 = 1.025;
/// Where the first grid of the search meets the error already, its cells are divided by this until one does not.
const BACK: f64 = 1.1;
/// Number of grids after which the search is given up.
const MOST: usize = 40;
/// Viscosities ν of the fronts, from thick to thin.
const VISCOSITIES: [f64; 4] = [5e-3, 2e-3, 1e-3, 2e-4];
/// Uniform grids are timed down to this viscosity; times for thinner fronts are extrapolated, since a run would take
/// minutes.
const TIMED: f64 = 5e-4;
/// Number of runs on the grid that is found; the fastest counts.
const RUNS: usize = 5;
/// Seconds of a run above which two runs are enough: noise is a small share of them.
const LONG: f64 = 0.5;
const METHODS: [(&str, Method); 3] = [
    ("moving mesh, nothing set by hand", Method::Moving),
    ("uniform, order 2 and RK4", Method::Uniform { order: 2 }),
    ("uniform, order 4 and RK4", Method::Uniform { order: 4 }),
];

impl Method {
    /// The study: nothing is set by hand for the moving mesh but its cells.
    fn study(self, task: Task, cells: usize) -> Result<MovingMesh> {
        let Task { viscosity, end, .. } = task;
        let (time, mesh) = match self {
            Self::Moving => (String::new(), ""),
            Self::Uniform { order } => (
                format!("stepper = \"rk4\"\norder = {order}\nstep = 1.0\n"),
                "[mesh]\ngenerator = { kind = \"fixed\" }\n",
            ),
        };
        let text = format!(
            "[study]\nname = \"payoff\"\nkind = \"moving-mesh\"\n[grid]\ncells = [{cells}, {cells}]\n[pde]\n\
             kind = \"burgers\"\nviscosity = {viscosity:e}\n[time]\nstart = 0.25\nend = {end}\n{time}{mesh}",
        );
        MovingMesh::from_source(&Source::new("payoff", text))
    }

    /// Runs it once; none where the run fails.
    fn run(self, task: Task, cells: usize) -> Result<Option<(Run, f64)>> {
        let (MovingRun { record, .. }, failure) = self.study(task, cells)?.compute()?;
        let spent = record.seconds.parts;
        let seconds = spent.mesh + spent.pde + spent.monitor + spent.interface;
        let steps = record.work.steps.max(record.work.work.substeps);
        let l_inf = record.reports.last().and_then(|report| report.error).map(|error| error.linf);
        Ok(l_inf.filter(|_| failure.is_none()).map(|l_inf| (Run { l_inf, steps }, seconds)))
    }

    /// Cells with which the search begins, somewhat too few.
    fn first(self, task: Task) -> usize {
        let cells = match self {
            Self::Moving => 12.0 * (5e-3 / task.viscosity).powf(0.4),
            Self::Uniform { order: 2 } => 0.08 / (task.viscosity * task.target.sqrt()),
            Self::Uniform { .. } => 0.107 / (task.viscosity * task.target.powf(0.25)),
        };
        cells as usize
    }

    /// The coarsest grid of the search that meets the target, the fastest of several runs.
    fn search(self, task: Task) -> Result<Option<Outcome>> {
        let mut cells = self.first(task);
        let enough = |run: &Option<(Run, f64)>| run.as_ref().is_some_and(|(run, _)| run.l_inf <= task.target);
        while cells > 4 && enough(&self.run(task, cells)?) {
            cells = (cells as f64 / BACK) as usize;
        }
        for _ in 0..MOST {
            if let Some((run, mut seconds)) = self.run(task, cells)?.filter(|(run, _)| run.l_inf <= task.target) {
                for _ in 1..if seconds > LONG { 2 } else { RUNS } {
                    seconds = self.run(task, cells)?.map_or(seconds, |(_, again)| seconds.min(again));
                }
                return Ok(Some(Outcome { cells, run: Some(run), seconds }));
            }
            cells = (cells as f64 * FINER).ceil() as usize;
        }
        Ok(None)
    }
}

impl Outcome {
    /// The same resolution of a layer that is thinner by a factor: cells, and with them explicit steps, grow by it.
    fn extrapolated(self, thinner: f64) -> Self {
        let cells = (self.cells as f64 * thinner).round() as usize;
        Self { cells, run: None, seconds: self.seconds * thinner.powi(3) }
    }
}

pub(super) fn run(options: Options) -> Result<Rerun> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    match pool {
        Ok(pool) => pool.install(|| payoff(options)),
        Err(_) => payoff(options),
    }
}

const COLUMNS: [&str; 7] = ["ν", "method", "nodes", "steps", "l_inf", "seconds", "over the moving mesh"];

fn payoff(options: Options) -> Result<Rerun> {
    let mut table = Table::new("Burgers' oblique front, t = .25 to .75: seconds on one core to l_inf ≤ 1e-2", &COLUMNS);
    let mut curves = METHODS.map(|(name, _)| Curve { name: name.into(), ..Curve::default() });
    let mut last = [None; METHODS.len()];
    let few = if options.quick { 2 } else { VISCOSITIES.len() };
    for viscosity in VISCOSITIES.into_iter().take(few) {
        let task = Task { viscosity, end: 0.75, target: 1e-2 };
        let mut found = [None; METHODS.len()];
        for (m, (_, method)) in METHODS.into_iter().enumerate() {
            found[m] = match last[m] {
                Some((before, outcome)) if method != Method::Moving && viscosity < TIMED => {
                    Some(Outcome::extrapolated(outcome, before / viscosity))
                }
                _ => method.search(task)?,
            };
            last[m] = found[m].map(|outcome| (viscosity, outcome));
            if let Some(Outcome { run, seconds, .. }) = found[m] {
                let points = if run.is_some() { &mut curves[m].points } else { &mut curves[m].extrapolated };
                points.push([viscosity, seconds]);
            }
        }
        rows(&mut table, viscosity, &found);
    }
    notes(&mut table);
    let extrapolated = curves.iter().any(|curve| !curve.extrapolated.is_empty());
    if extrapolated {
        table.note(
            "extrapolated (≈): the cells of the row above over ν, as many more substeps, the same seconds a \
             cell and substep",
        );
    }
    if options.quick {
        table.note("quick: the two largest of four viscosities, and no run past the corners");
    }
    let mut tables = vec![table];
    if !options.quick {
        let mut table =
            Table::new("past the corners: t = .25 to 1.25, seconds on one core to l_inf ≤ 1.5e-2", &COLUMNS);
        let task = Task { viscosity: 1e-3, end: 1.25, target: 1.5e-2 };
        let mut found = [None; METHODS.len()];
        for (found, (_, method)) in found.iter_mut().zip(METHODS) {
            *found = method.search(task)?;
        }
        rows(&mut table, task.viscosity, &found);
        tables.push(table);
    }
    let figure = Figure {
        title: "Time to an error of 1e-2, Burgers' front".into(),
        labels: [
            if extrapolated { "viscosity ν (open marks: extrapolated)" } else { "viscosity ν" }.into(),
            "seconds on one core".into(),
        ],
        curves: curves.into(),
        ..Figure::default()
    };
    Ok(Rerun { tables, pictures: vec![("payoff".into(), figure.draw())] })
}

fn notes(table: &mut Table) {
    table.note(format!(
        "search: cells from a grid that is too coarse in steps of {FINER} to the first that meets the target; the \
         fastest of {RUNS} runs on it, of 2 above {LONG} s; time steps are chosen by the program; seconds of mesh, \
         pde and density, the start included, without output"
    ));
    table.note(
        "uniform: conservative central differences, stages in cache, vectors, the largest stable step, exact sides",
    );
}

/// A row for each method.
fn rows(table: &mut Table, viscosity: f64, found: &[Option<Outcome>; METHODS.len()]) {
    for ((name, _), outcome) in METHODS.into_iter().zip(found) {
        let dash = || "–".to_string();
        let cells = match outcome {
            Some(Outcome { cells, run, seconds }) => {
                let about = if run.is_some() { "" } else { "≈ " };
                let digits = if *seconds < 10.0 { 3 } else { 0 };
                [
                    format!("{about}{}²", cells + 1),
                    run.map_or_else(dash, |run| run.steps.to_string()),
                    run.map_or_else(dash, |run| format!("{:.1e}", run.l_inf)),
                    format!("{about}{seconds:.digits$}"),
                    found[0].map_or_else(dash, |moving| format!("{about}{:.1}", seconds / moving.seconds)),
                ]
            }
            None => [dash(), dash(), dash(), dash(), dash()],
        };
        table.row([format!("{viscosity:e}"), name.to_string()].into_iter().chain(cells));
    }
}
