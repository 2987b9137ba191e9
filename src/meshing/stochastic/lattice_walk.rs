use super::super::mmpde::exactness;
use super::super::sides::{jump, size};
use super::{Estimate, Estimates, Estimator, Problem};
use crate::error::{Error, Failure, Result};
use crate::geometry::Patch;
use crate::numerics::linear::{LatticeMatrix, Smoother, relax};
use crate::parallel;
use crate::setting::Auto;
use crate::work::Work;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Random walks on the lattice, unbiased for the discrete step
///
/// A row of the mesh operator, divided by its diagonal, is a jump to each neighbour with a probability and a stop with
/// what is left:
///
/// ```text
/// jump to e with w_e / (1 + Σw),   stop with 1 / (1 + Σw);   x_i = E[xⁿ where the walk stops, xⁿ⁺¹ on a side]
/// ```
///
/// Neither a time step nor an interpolation is left to make an error, only the noise of N walks. It needs weights ≥ 0,
/// that is |b|h ≤ 2; `monitor.gradient = "safe"` always has them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GridWalk {
    /// N, for each point.
    pub walks: usize,
    /// Walks pay the motion over the step instead of the position: the residual walk without sweeps.
    #[serde(default)]
    pub increment: bool,
}

/// Random walks for what relaxation leaves
///
/// ```text
/// P = k sweeps on M x = xⁿ from xⁿ, with the new sides,   r = xⁿ − M P,   x_i = P_i + E[r where the walk stops]
/// ```
///
/// The walks are those of [`GridWalk`]. P is a control variate whose target is known exactly: the estimate stays
/// unbiased for any P, and its variance falls with the square of the residual.
///
/// `sweeps = "auto"` takes k = ⌈8√a⌉, a = Δt/(τh²) averaged over the axes and bounded by what the sides leave of the
/// slowest mode; as many as Chebyshev's sweeps need to shrink any error some hundred times. Where a is large, k more
/// follow until no residual, the most that a walk can pay, is above 1 % of the shortest edge of the mesh. Where walks
/// would take more than 1000 jumps, sweeps are cheaper: they follow to 10⁻⁶ of the edge and no walk is done; this bound
/// on the error is then given as its standard error.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ResidualWalk {
    /// k.
    pub sweeps: Auto<usize>,
    /// N, for each point.
    pub walks: usize,
    /// Weights of the sweeps.
    pub smoother: Smoother,
}

impl Default for ResidualWalk {
    fn default() -> Self {
        Self { sweeps: Auto::Auto, walks: 10, smoother: Smoother::Chebyshev }
    }
}

/// More than this of anything takes longer than anyone waits.
const MAX_WALKS: usize = 1 << 31;
const MAX_SWEEPS: usize = 1_000_000;
/// Jumps in one step beyond which walks are refused: hours.
const MAX_JUMPS: f64 = 1e11;
/// Jumps of a walk beyond which more sweeps are certainly cheaper.
const WORTH_WALKING: f64 = 1e3;
/// Largest residual, as a share of the shortest edge, that automatic sweeps leave to walks, and where there are none.
const LEFT_TO_WALKS: f64 = 1e-2;
const LEFT_ALONE: f64 = 1e-6;
/// Automatic sweeps, in units of ⌈8√a⌉, each of which gains two digits: some more than there are.
const MAX_ROUNDS: usize = 12;

fn check_walks(walks: usize) -> Result<()> {
    match walks {
        0 => Err(Error::invalid("walks", 0, "without walks there is no estimate; set it to 1 or more")),
        1..=MAX_WALKS => Ok(()),
        _ => Err(Error::invalid("walks", walks, format!("must be at most {MAX_WALKS}"))),
    }
}

impl GridWalk {
    /// Refuses settings out of range.
    ///
    /// # Errors
    /// [`Error::Invalid`].
    pub fn check(&self) -> Result<()> {
        check_walks(self.walks)
    }
}

impl ResidualWalk {
    /// Refuses settings out of range.
    ///
    /// # Errors
    /// [`Error::Invalid`].
    pub fn check(&self) -> Result<()> {
        match self.sweeps {
            Auto::Value(sweeps) if sweeps > MAX_SWEEPS => {
                Err(Error::invalid("sweeps", sweeps, format!("must be at most {MAX_SWEEPS}, or \"auto\"")))
            }
            _ => check_walks(self.walks),
        }
    }
}

/// ⌈8√a⌉ sweeps.
fn sweeps_for(lowest: f64) -> usize {
    (8.0 * (0.25 * (1.0 / lowest - 1.0)).sqrt()).ceil().clamp(4.0, MAX_SWEEPS as f64) as usize
}

/// Refuses walks that nobody lives to see stop.
fn check_jumps(problem: &Problem<'_>, walks: usize, points: usize) -> Result<(), Failure> {
    let jumps = mean_jumps(problem);
    if walks as f64 * points as f64 * jumps <= MAX_JUMPS {
        return Ok(());
    }
    let [a, b] = problem.stiffness();
    Err(Failure::LongWalks { stiffness: a.max(b), jumps, walks, points })
}

/// Lower end of the spectrum of the step, over its diagonal: the slowest mode has half a wave across a bounded axis.
fn lowest(problem: &Problem<'_>) -> f64 {
    let (lattice, a) = (problem.mesh.lattice(), problem.stiffness());
    let slowest: f64 = (0..2)
        .filter(|&d| !lattice.periodic()[d])
        .map(|d| 4.0 * a[d] * (0.5 * std::f64::consts::PI * lattice.spacing()[d]).sin().powi(2))
        .sum();
    (1.0 + slowest) / (1.0 + 2.0 * a[0] + 2.0 * a[1])
}

/// Jumps of a walk, about.
fn mean_jumps(problem: &Problem<'_>) -> f64 {
    1.0 / lowest(problem)
}

impl Estimator for GridWalk {
    fn estimate(&self, problem: &Problem<'_>, points: &[usize]) -> Result<Estimates, Failure> {
        if self.increment {
            return on_residual(problem, points, self.walks, Smoother::Jacobi, Auto::Value(0));
        }
        check_jumps(problem, self.walks, points.len())?;
        let table = Table::new(problem)?;
        let (estimates, path_steps) =
            table.walk(problem, points, self.walks, problem.new, jump(problem.mesh), |k| problem.mesh.x()[k]);
        Ok(Estimates {
            points: estimates,
            guess: problem.new.to_vec(),
            work: Work { path_steps, ..Work::default() },
            sweeps: 0,
        })
    }
}

impl Estimator for ResidualWalk {
    fn estimate(&self, problem: &Problem<'_>, points: &[usize]) -> Result<Estimates, Failure> {
        on_residual(problem, points, self.walks, self.smoother, self.sweeps)
    }
}

/// Sweeps, then walks that pay the residual.
fn on_residual(
    problem: &Problem<'_>,
    points: &[usize],
    walks: usize,
    smoother: Smoother,
    sweeps: Auto<usize>,
) -> Result<Estimates, Failure> {
    let (mesh, lattice) = (problem.mesh, problem.mesh.lattice());
    let (jump, patch) = (jump(mesh), Patch::whole(lattice));
    let table = Table::new(problem)?;
    let matrix: LatticeMatrix<2, 5> = problem.operator.matrix(patch);
    let right = problem.operator.right(patch, mesh.x(), jump);
    let mut x = patch.gather(lattice, problem.new, jump);
    let mut padded = vec![[0.0; 2]; x.len()];
    let mut sizes = matrix.residual(&right, &x, &mut padded);
    let exact = exactness(&matrix, size(mesh));
    let lowest = lowest(problem);
    let alone = sweeps == Auto::Auto && mean_jumps(problem) > WORTH_WALKING;
    let share = |share: f64| exact.map(|exact| exact.max(share * mesh.shortest_edge()));
    let (round, left) = match sweeps {
        Auto::Value(sweeps) => (sweeps, [f64::INFINITY; 2]),
        Auto::Auto => (sweeps_for(lowest), share(if alone { LEFT_ALONE } else { LEFT_TO_WALKS })),
    };
    let within = |sizes: [f64; 2], limits: [f64; 2]| sizes.iter().zip(limits).all(|(r, limit)| *r <= limit);
    let mut sweeps = 0;
    // a mesh that is at rest but for round-off stays, to the last bit
    if !within(sizes, exact) {
        for _ in 0..MAX_ROUNDS {
            relax(&matrix, &right, &mut x, smoother, round, lowest);
            sweeps += round;
            let before = std::mem::replace(&mut sizes, matrix.residual(&right, &x, &mut padded));
            // not `>=`: what is not finite has not shrunk either
            let shrunk = sizes[0].max(sizes[1]) < 0.5 * before[0].max(before[1]);
            if within(sizes, left) || !shrunk {
                break;
            }
        }
    }
    let mut guess = problem.new.to_vec();
    patch.scatter(lattice, &x, &mut guess, jump);
    if within(sizes, if alone { share(LEFT_TO_WALKS) } else { exact }) {
        // nothing is left to pay: rows that add up to one bound the error by the residual
        let points = points.iter().map(|&k| Estimate { x: guess[k], standard_error: sizes }).collect();
        return Ok(Estimates { points, guess, work: Work::default(), sweeps });
    }
    check_jumps(problem, walks, points.len())?;
    let mut residual = vec![[0.0; 2]; lattice.len()];
    if sizes.iter().all(|r| r.is_finite()) {
        patch.scatter(lattice, &padded, &mut residual, [[0.0; 2]; 2]);
    }
    let (mut estimates, path_steps) = table.walk(problem, points, walks, &residual, [[0.0; 2]; 2], |_| [0.0; 2]);
    for (estimate, &k) in estimates.iter_mut().zip(points) {
        estimate.x = [0, 1].map(|c| guess[k][c] + estimate.x[c]);
    }
    if estimates.iter().all(|estimate| estimate.standard_error == [0.0; 2]) {
        // no walk stopped where there is something to pay: that says nothing of what others would have paid
        estimates.iter_mut().for_each(|estimate| estimate.standard_error = [f64::NAN; 2]);
    }
    Ok(Estimates { points: estimates, guess, work: Work { path_steps, ..Work::default() }, sweeps })
}

/// Where a walk goes from each node.
struct Table {
    rows: Vec<Row>,
}

/// A random word below the first threshold goes to the first neighbour, below the second to the second …; beyond the
/// last the walk stops. Probabilities are rounded to 2⁻³².
#[derive(Clone, Copy)]
struct Row {
    thresholds: [u32; 4],
    neighbours: [u32; 4],
}

impl Table {
    fn new(problem: &Problem<'_>) -> Result<Self, Failure> {
        let lattice = problem.mesh.lattice();
        problem.operator.check_weights(problem.mesh)?;
        let (nodes, strides, periodic) = (lattice.nodes(), lattice.strides(), lattice.periodic());
        let places = (0..nodes[0]).flat_map(|i| (0..nodes[1]).map(move |j| [i, j]));
        let row = |(k, (node, weights)): (usize, ([usize; 2], &[[f64; 2]; 2]))| {
            let mut row = Row { thresholds: [0; 4], neighbours: [k as u32; 4] };
            if (0..2).any(|d| !periodic[d] && (node[d] == 0 || node[d] + 1 == nodes[d])) {
                return row; // a side: the walk ends here
            }
            let scale = 4_294_967_296.0 / (1.0 + weights.as_flattened().iter().sum::<f64>());
            let mut sum = 0.0;
            for d in 0..2 {
                // one step, or back along the whole axis
                let (step, back) = (strides[d], strides[d] * (nodes[d] - 1));
                let below = if node[d] == 0 { k + back } else { k - step };
                let above = if node[d] + 1 == nodes[d] { k - back } else { k + step };
                for (e, (to, weight)) in [below, above].into_iter().zip(weights[d]).enumerate() {
                    sum += weight;
                    row.neighbours[2 * d + e] = to as u32;
                    // casts of floats saturate
                    row.thresholds[2 * d + e] = (sum * scale + 0.5) as u32;
                }
            }
            row
        };
        Ok(Self { rows: places.zip(problem.operator.weights()).enumerate().map(row).collect() })
    }

    /// For each point the mean of `pay` − `base` of the point over where walks from there stop, plus `base`; `jump` is
    /// paid for turns around periodic axes. Also the number of jumps and stops.
    fn walk(
        &self,
        problem: &Problem<'_>,
        points: &[usize],
        walks: usize,
        pay: &[[f64; 2]],
        jump: [[f64; 2]; 2],
        base: impl Fn(usize) -> [f64; 2] + Sync + Send,
    ) -> (Vec<Estimate>, usize) {
        let one = |&point: &usize| {
            let base = base(point);
            let mut samples = Samples::new();
            let mut steps = 0;
            for path in 0..walks {
                let mut stream = problem.random.stream(problem.step, point as u32, path as u32);
                let mut k = point as u32;
                let mut turns = [0_i32; 2];
                loop {
                    steps += 1;
                    let (row, word) = (&self.rows[k as usize], stream.word());
                    let exit = row.thresholds.iter().map(|&t| usize::from(word >= t)).sum::<usize>();
                    if exit == 4 {
                        break;
                    }
                    let next = row.neighbours[exit];
                    // stepping up to a lower index, or down to a higher one, is a turn
                    turns[exit / 2] += i32::from(exit % 2 == 1 && next < k) - i32::from(exit % 2 == 0 && next > k);
                    k = next;
                }
                let paid = pay[k as usize];
                samples.add([0, 1].map(|c| paid[c] + f64::from(turns[c]) * jump[c][c] - base[c]));
            }
            (samples.estimate(base), steps)
        };
        let found = parallel::map(points, one);
        let steps = found.iter().map(|(_, steps)| steps).sum();
        (found.into_iter().map(|(estimate, _)| estimate).collect(), steps)
    }
}

/// Running sums of samples that are small.
#[derive(Debug, Clone, Copy)]
pub(super) struct Samples {
    count: f64,
    sums: [f64; 2],
    squares: [f64; 2],
}

impl Samples {
    pub fn new() -> Self {
        Self { count: 0.0, sums: [0.0; 2], squares: [0.0; 2] }
    }

    #[inline(always)]
    pub fn add(&mut self, sample: [f64; 2]) {
        self.count += 1.0;
        for (c, sample) in sample.into_iter().enumerate() {
            self.sums[c] += sample;
            self.squares[c] += sample * sample;
        }
    }

    /// Their mean, from a base.
    pub fn estimate(self, base: [f64; 2]) -> Estimate {
        let n = self.count;
        let mean = self.sums.map(|sum| sum / n);
        let variance = [0, 1].map(|c| ((self.squares[c] / n - mean[c] * mean[c]).max(0.0)) / (n - 1.0));
        Estimate {
            x: [0, 1].map(|c| base[c] + mean[c]),
            // one sample says nothing of its spread: 0/0
            standard_error: if n > 1.0 { variance.map(f64::sqrt) } else { [f64::NAN; 2] },
        }
    }
}
