use super::{Options, Table};
use crate::error::Result;
use crate::study::{MovingMesh, Source, compute};

/// How a run came out.
#[derive(Debug, Clone, Copy)]
struct Outcome {
    cells: usize,
    l_inf: f64,
    /// Seconds on one thread, without output.
    seconds: f64,
}

/// What competes for the least time.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Method {
    Moving,
    Uniform { order: u8 },
}

/// Error at t = .75 that a run must meet.
const TARGET: f64 = 1e-2;
/// Grids grow by this factor in the search.
const FINER: f64 = 1.06;
const VISCOSITIES: [f64; 4] = [5e-3, 2e-3, 1e-3, 2e-4];

impl Method {
    /// The study: nothing is set by hand for the moving mesh but its cells.
    fn study(self, viscosity: f64, cells: usize) -> Result<MovingMesh> {
        let rest = match self {
            Self::Moving => String::new(),
            Self::Uniform { order } => {
                format!(
                    "[time]\nstepper = \"rk4\"\norder = {order}\nstep = 1.0\n[mesh]\ngenerator = {{ kind = \"fixed\" }}\n"
                )
            }
        };
        let time = if rest.contains("[time]") { "" } else { "[time]\n" };
        let text = format!(
            "[study]\nname = \"payoff\"\nkind = \"moving-mesh\"\n[grid]\ncells = [{cells}, {cells}]\n[pde]\nkind = \"burgers\"\n\
             viscosity = {viscosity:e}\n{rest}{time}",
        );
        let text = text.replacen("[time]\n", "[time]\nstart = 0.25\nend = 0.75\n", 1);
        MovingMesh::from_source(&Source::new("payoff", text))
    }

    /// Runs it once; none where the run fails.
    fn run(self, viscosity: f64, cells: usize) -> Result<Option<Outcome>> {
        let (record, failure) = compute(&self.study(viscosity, cells)?)?;
        let seconds = record.seconds.mesh + record.seconds.pde + record.seconds.monitor + record.seconds.interface;
        let l_inf = record.reports.last().and_then(|report| report.error).map(|error| error.linf);
        Ok(l_inf.filter(|_| failure.is_none()).map(|l_inf| Outcome { cells, l_inf, seconds }))
    }

    /// Cells with which the search begins, somewhat too few.
    fn first(self, viscosity: f64) -> usize {
        let cells = match self {
            Self::Moving => 17.0 * (5e-3 / viscosity).powf(0.3),
            Self::Uniform { order: 2 } => 0.78 / viscosity,
            Self::Uniform { .. } => 0.31 / viscosity,
        };
        cells as usize
    }

    /// The coarsest grid of the search that meets the target, the faster of two runs.
    fn search(self, viscosity: f64) -> Result<Option<Outcome>> {
        let mut cells = self.first(viscosity);
        for _ in 0..12 {
            if let Some(found) = self.run(viscosity, cells)?.filter(|outcome| outcome.l_inf <= TARGET) {
                let again = self.run(viscosity, cells)?.map_or(found.seconds, |outcome| outcome.seconds);
                return Ok(Some(Outcome { seconds: found.seconds.min(again), ..found }));
            }
            cells = (cells as f64 * FINER).ceil() as usize;
        }
        Ok(None)
    }
}

pub(super) fn run(options: Options) -> Result<Vec<Table>> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    match pool {
        Ok(pool) => pool.install(|| payoff(options)),
        Err(_) => payoff(options),
    }
}

fn payoff(options: Options) -> Result<Vec<Table>> {
    let mut table = Table::new(
        "Burgers' oblique front, t = .25 to .75: seconds on one core to l_inf ≤ 1e-2",
        &["ν", "method", "nodes", "l_inf", "seconds", "over the moving mesh"],
    );
    for viscosity in VISCOSITIES.into_iter().filter(|&viscosity| !options.quick || viscosity > 5e-4) {
        let moving = Method::Moving.search(viscosity)?;
        // second order at ν = 2e-4 would take a quarter of an hour and says nothing new
        let second = if viscosity > 5e-4 { Method::Uniform { order: 2 }.search(viscosity)? } else { None };
        let fourth = Method::Uniform { order: 4 }.search(viscosity)?;
        for (name, outcome) in [
            ("moving mesh, nothing set by hand", moving),
            ("uniform, order 2 and RK4", second),
            ("uniform, order 4 and RK4", fourth),
        ] {
            let cells = match outcome {
                Some(Outcome { cells, l_inf, seconds }) => [
                    format!("{}²", cells + 1),
                    format!("{l_inf:.1e}"),
                    format!("{seconds:.3}"),
                    moving.map_or("–".into(), |moving| format!("{:.1}", seconds / moving.seconds)),
                ],
                None => ["–".into(), "–".into(), "–".into(), "–".into()],
            };
            table.row([format!("{viscosity:e}"), name.to_string()].into_iter().chain(cells));
        }
    }
    table.note(format!(
        "search: from a grid that is too coarse in steps of {FINER} to the first that meets the target; the faster of two runs \
         on it; seconds of mesh, pde and density, without output"
    ));
    table.note(
        "uniform: conservative central differences, stages in cache, vectors, the largest stable step, exact sides",
    );
    table.note("not measured here: a fourth-order grid on a narrow band, which has to know where the front is, would be cheaper than the whole one");
    Ok(vec![table])
}
