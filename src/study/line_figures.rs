//! Studies of kind `equidistribution`: what a run finds.

use super::EquidistributionStudy;
use super::line_files::thinned;
use super::line_run::Evolution;
use crate::equidistribution::{FaceDensity, History, Iterate, Line};
use crate::error::Result;
use crate::output::{Ended, Failed, Figures};
use serde::{Deserialize, Serialize};

/// What `summary.json` says of a line.
#[derive(Debug, Clone, Default, Serialize)]
pub struct LineFigures {
    /// What it cost.
    pub work: LineWork,
    /// Quality of the last mesh.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quality: Option<LineQuality>,
    /// The start and every iterate; in time those of the last step.
    pub iterations: Vec<NumberedIterate>,
    /// Contraction in two iterations; in time that of the last step.
    pub rate: Rate,
    /// Whether the tolerance was met, in time in every step; null where none is asked for.
    pub converged: Option<bool>,
    /// Number of the first iterate that meets the tolerance.
    pub iterations_to_tolerance: Option<usize>,
    /// Numbers of iterations in a time step, where the mesh moves in time.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub iterations_per_step: Option<PerStep>,
    /// The last mesh, glued from the subdomains.
    pub mesh: Vec<f64>,
}

/// Seconds of a line, by part.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
pub struct LineParts {
    /// Solving, the single-domain solution for comparison included.
    pub mesh: f64,
}

impl Figures for LineFigures {
    type Parts = LineParts;

    const ENDED: fn(Failed) -> Ended = Ended::Failure;
}

/// What a run cost.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub struct LineWork {
    /// Time steps.
    pub steps: usize,
    /// Linear solves of the subdomains, or of the whole line where there are none.
    pub linear_solves: usize,
}

/// Quality of a mesh.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct LineQuality {
    /// max/mean of ∫M over the cells, by trapezoids.
    pub equidistribution: f64,
    /// Shortest cell over the mean one.
    pub shortest_cell: f64,
    /// Largest distance from the continuous mesh, of up to a thousand nodes; not in time.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error_linf: Option<f64>,
}

/// An iterate.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub struct NumberedIterate {
    /// Its number; the start is 0.
    pub n: usize,
    /// Largest distance from the discrete single-domain mesh, over the subdomains.
    pub error_linf: f64,
    /// Largest change since the iterate before; none of the start.
    pub increment: Option<f64>,
    /// Largest error of linear interpolation on the glued mesh.
    pub interpolation_error: Option<f64>,
    /// 2 max |u_i − u_{i−1}| on the glued mesh.
    pub largest_jump: Option<f64>,
    /// Linear solves up to this iterate.
    pub linear_solves: usize,
}

/// Contraction of the error.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Rate {
    /// Contraction that the iterates show.
    pub observed: Option<f64>,
    /// Contraction that theory predicts.
    pub predicted: Option<f64>,
    /// Largest contraction that theory allows.
    pub bound: Option<f64>,
    /// Number of iterations over which the error contracts by these factors.
    pub stride: usize,
}

impl Default for Rate {
    fn default() -> Self {
        Self { observed: None, predicted: None, bound: None, stride: 2 }
    }
}

/// Iterations in a time step.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct PerStep {
    /// Mean number of iterations over the steps.
    pub mean: f64,
    /// Smallest number of iterations in a step.
    pub min: usize,
    /// Largest number of iterations in a step.
    pub max: usize,
}

/// A step in `history.csv`.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
pub struct StepRow {
    /// Time.
    pub t: f64,
    /// Iterations, of Newton's method where there are no subdomains.
    pub iterations: usize,
    /// Error of the last against the discrete single-domain mesh, where there are subdomains.
    pub error_linf: Option<f64>,
    /// Contraction in two iterations.
    pub observed_rate: Option<f64>,
    /// Largest contraction in two iterations that theory allows.
    pub bound: Option<f64>,
    /// max/mean of ∫M over the cells.
    pub equidistribution: f64,
    /// Shortest cell over the mean one.
    pub shortest_cell: f64,
}

/// Largest number of nodes that are compared with the continuous mesh.
const COMPARED: usize = 1000;
/// Number of cells of a line up to which M is integrated over each cell to round-off; in more, and so smaller, cells
/// the trapezoidal rule is as good.
const EXACTLY: usize = 100_000;
/// Number of places at which the density is evaluated to find layers between the nodes.
const PLACES: usize = 20_000;
/// A difference between ∫M over the cells and ∫M, as a share of it, that tells of a layer which the cells miss.
const NOTICEABLE: f64 = 0.2;

impl LineFigures {
    /// Takes in what was computed, as far as it can be told: the density may turn out to have no value between the
    /// nodes. Returns a warning where the cells do not see a part of the density.
    pub(super) fn tell(
        &mut self,
        study: &EquidistributionStudy,
        line: &Line,
        evolution: &Evolution,
    ) -> Result<Option<String>> {
        self.work = LineWork { steps: evolution.done, linear_solves: evolution.linear_solves };
        self.mesh = evolution.mesh().to_vec();
        let t = evolution.steps.last().map_or_else(|| *evolution.times.last().unwrap_or(&0.0), |step| step.t);
        let tolerance = study.until().tolerance;
        if let Some(history) = &evolution.last {
            self.tell_iterations(study, evolution, history, tolerance);
        }
        self.quality = Some(LineQuality::of(line, t, &self.mesh, study.time.is_none())?);
        // averages for which there is no mesh see another density than there is
        if evolution.warnings.is_empty() { unseen(line, t, &self.mesh) } else { Ok(None) }
    }

    fn tell_iterations(
        &mut self,
        study: &EquidistributionStudy,
        evolution: &Evolution,
        history: &History,
        tolerance: Option<f64>,
    ) {
        self.iterations = history.iterates.iter().enumerate().map(|(n, it)| NumberedIterate::new(n, it)).collect();
        let prediction = history.prediction;
        self.rate =
            Rate { observed: history.observed, predicted: prediction.predicted, bound: prediction.bound, ..self.rate };
        self.converged = tolerance.map(|_| history.converged);
        self.iterations_to_tolerance = tolerance.filter(|_| history.converged).map(|_| history.count());
        if study.time.is_some() {
            let counts = || evolution.steps.iter().map(|step| step.iterations);
            self.iterations_per_step = Some(PerStep {
                mean: counts().sum::<usize>() as f64 / evolution.steps.len() as f64,
                min: counts().min().unwrap_or(0),
                max: counts().max().unwrap_or(0),
            });
        }
    }
}

impl NumberedIterate {
    pub(super) fn new(n: usize, iterate: &Iterate) -> Self {
        let Iterate { error, increment, largest_jump, interpolation_error, linear_solves } = *iterate;
        let increment = (n > 0).then_some(increment);
        Self { n, error_linf: error, increment, interpolation_error, largest_jump, linear_solves }
    }
}

impl LineQuality {
    fn of(line: &Line, t: f64, mesh: &[f64], steady: bool) -> Result<Self> {
        // exact integrals, unless there are so many cells that each is as good as its trapezoid
        let face = if line.cells <= EXACTLY { FaceDensity::Exact } else { FaceDensity::Trapezoid };
        let shares = Line { face, ..line.clone() }.shares(t, mesh)?;
        let mean = shares.iter().sum::<f64>() / line.cells as f64;
        let compared = |cells: usize| -> Result<f64> {
            let nodes: Vec<usize> = thinned(cells + 1, COMPARED).collect();
            let xi: Vec<f64> = nodes.iter().map(|&i| i as f64 / cells as f64).collect();
            let exact = line.exact(t, &xi)?;
            Ok(nodes.iter().zip(exact).map(|(&i, exact)| (mesh[i] - exact).abs()).fold(0.0, f64::max))
        };
        Ok(Self {
            equidistribution: shares.iter().copied().fold(0.0, f64::max) / mean,
            shortest_cell: shortest(line, mesh),
            error_linf: steady.then(|| compared(line.cells)).transpose()?,
        })
    }
}

/// Says so where the cells see another density than there is: a layer between two nodes is none to them.
fn unseen(line: &Line, t: f64, mesh: &[f64]) -> Result<Option<String>> {
    let [a, b] = line.ends;
    let seen: f64 = line.shares(t, mesh)?.iter().sum();
    let mut places: Vec<f64> = (0..=PLACES).map(|k| a + (b - a) * k as f64 / PLACES as f64).collect();
    places.extend(thinned(mesh.len(), PLACES).map(|i| mesh[i]));
    places.sort_by(f64::total_cmp);
    let m = line.density.at_each(t, &places)?;
    let there: f64 = match line.density.followed(t, &places) {
        // chords are no longer than the arc, and no layer is too thin for them
        Some(u) => (1..u.len()).map(|i| (places[i] - places[i - 1]).hypot(u[i] - u[i - 1])).sum(),
        None => (1..m.len()).map(|i| 0.5 * (m[i - 1][0] + m[i][0]) * (places[i] - places[i - 1])).sum(),
    };
    Ok(((seen - there).abs() > NOTICEABLE * there).then(|| {
        format!(
            "the cells see another density than there is: ∫M is {seen:.3} over them and {there:.3} in truth; name the \
             place of its layer in equidistribution.points, or refine grid.cells"
        )
    }))
}

impl StepRow {
    pub(super) fn new(line: &Line, t: f64, mesh: &[f64], iterations: usize) -> Result<Self> {
        let shares = line.shares(t, mesh)?;
        let largest = shares.iter().copied().fold(0.0, f64::max);
        let equidistribution = largest * line.cells as f64 / shares.iter().sum::<f64>();
        let shortest_cell = shortest(line, mesh);
        Ok(Self { t, iterations, error_linf: None, observed_rate: None, bound: None, equidistribution, shortest_cell })
    }
}

/// The shortest cell over the mean one.
pub(super) fn shortest(line: &Line, mesh: &[f64]) -> f64 {
    let shortest = mesh.windows(2).map(|x| x[1] - x[0]).fold(f64::INFINITY, f64::min);
    shortest * line.cells as f64 / (line.ends[1] - line.ends[0])
}
