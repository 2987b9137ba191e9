use super::{Estimate, Estimates, Estimator, Problem, Strips};
use crate::error::{Error, Failure, Result};
use crate::meshing::Decomposition;
use crate::ranks::Ranks;
use crate::work::Work;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Random walks on the lattice, which estimate the discrete step without bias
///
/// A row of the mesh operator, divided by its diagonal, gives the probability of a jump to each neighbour; with the
/// rest the walk stops:
///
/// ```text
/// jump to e with w_e / (1 + Σw),   stop with 1 / (1 + Σw);   x_i = E[xⁿ where the walk stops, xⁿ⁺¹ on a side]
/// ```
///
/// There is no error of a time step or an interpolation, only the noise of N walks. The weights must be ≥ 0, that is
/// |b|h ≤ 2, which `monitor.gradient = "safe"` ensures.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GridWalk {
    /// Number N of walks that start at each interface point.
    pub walks: usize,
    /// Estimates the motion over the step instead of the position: a walk collects the residual of the old mesh where
    /// it stops.
    #[serde(default)]
    pub increment: bool,
}

/// Largest number of walks that start at a point: more than any run could afford.
const MAX_WALKS: usize = 1 << 31;
/// Jumps of all walks in one step beyond which they are refused: they would take hours.
const MAX_JUMPS: f64 = 1e11;
pub(super) fn check_walks(walks: usize) -> Result<()> {
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

/// Refuses walks that would take hours.
fn check_jumps<const D: usize>(problem: &Problem<'_, D>, walks: usize, points: usize) -> Result<(), Failure> {
    let jumps = mean_jumps(problem);
    if walks as f64 * points as f64 * jumps <= MAX_JUMPS {
        return Ok(());
    }
    let stiffness = problem.stiffness().into_iter().fold(0.0, f64::max);
    Err(Failure::LongWalks { stiffness, jumps, walks, points })
}

/// Lower end of the spectrum of the step's matrix, divided by its diagonal. The slowest mode has half a wave across a
/// bounded axis.
pub(super) fn lowest<const D: usize>(problem: &Problem<'_, D>) -> f64 {
    let (lattice, a) = (problem.mesh.lattice(), problem.stiffness());
    let slowest: f64 = (0..D)
        .filter(|&d| !lattice.periodic()[d])
        .map(|d| 4.0 * a[d] * (0.5 * std::f64::consts::PI * lattice.spacing()[d]).sin().powi(2))
        .sum();
    (1.0 + slowest) / a.iter().fold(1.0, |sum, a| sum + 2.0 * a)
}

/// Approximate mean number of jumps of a walk.
pub(super) fn mean_jumps<const D: usize>(problem: &Problem<'_, D>) -> f64 {
    1.0 / lowest(problem)
}

impl<const D: usize, const S: usize> Estimator<D, S> for GridWalk {
    fn check(&self, _decomposition: &Decomposition<D>) -> Result<()> {
        self.check()
    }

    fn estimate(
        &self,
        problem: &Problem<'_, D>,
        points: &[usize],
        _strips: &mut Strips<D, S>,
    ) -> Result<Estimates<D>, Failure> {
        let (mesh, jump) = (problem.mesh, problem.mesh.jump());
        let walks = Walks::new(problem, self.walks, points.len())?;
        let paid = |p: usize, Stop { node, turns }: Stop<D>| -> [f64; D] {
            if self.increment {
                return motion(problem, node, jump);
            }
            std::array::from_fn(|c| problem.new[node][c] + f64::from(turns[c]) * jump[c][c] - mesh.x()[points[p]][c])
        };
        let ranks = Ranks::here();
        let owner = |p: usize| ranks.owner(p, points.len());
        let Means { mut estimates, path_steps, .. } =
            walks.mean(points, self.walks, owner, |p, stop| (paid(p, stop), false));
        for (estimate, &k) in estimates.iter_mut().zip(points) {
            estimate.x = std::array::from_fn(|c| mesh.x()[k][c] + estimate.x[c]);
        }
        if self.increment {
            forget_certainty(&mut estimates);
        }
        let work = Work { path_steps, ..Work::default() };
        Ok(Estimates { work, ..Estimates::sampled(estimates, problem.new.to_vec(), self.walks) })
    }
}

/// The residual xⁿ − M x at a node, for the old mesh between the new sides; zero on them.
fn motion<const D: usize>(problem: &Problem<'_, D>, node: usize, jump: [[f64; D]; D]) -> [f64; D] {
    let mut sum = [0.0; D];
    for_each_neighbour(problem, node, |neighbour, turns, weight| {
        for c in 0..D {
            sum[c] += weight * (problem.new[neighbour][c] + turns[c] * jump[c][c] - problem.new[node][c]);
        }
    });
    sum
}

/// Calls `f(neighbour, turns around periodic axes on the way, weight)` for the neighbours of a node. For a node on a
/// bounded side it does nothing.
pub(super) fn for_each_neighbour<const D: usize>(
    problem: &Problem<'_, D>,
    node: usize,
    mut f: impl FnMut(usize, [f64; D], f64),
) {
    let lattice = problem.mesh.lattice();
    if lattice.on_side(node) {
        return;
    }
    let (at, nodes, strides) = (lattice.node(node), lattice.nodes(), lattice.strides());
    for d in 0..D {
        let (step, back) = (strides[d], strides[d] * (nodes[d] - 1));
        let [below, above] = problem.operator.weights()[node][d];
        let turn = |turn: f64| std::array::from_fn(|e| if d == e { turn } else { 0.0 });
        let down = if at[d] == 0 { (node + back, turn(-1.0)) } else { (node - step, turn(0.0)) };
        let up = if at[d] + 1 == nodes[d] { (node - back, turn(1.0)) } else { (node + step, turn(0.0)) };
        f(down.0, down.1, below);
        f(up.0, up.1, above);
    }
}

/// Removes the standard error of 0 where no walk met a residual: others might have.
pub(super) fn forget_certainty<const D: usize>(estimates: &mut [Estimate<D>]) {
    if estimates.iter().all(|estimate| estimate.standard_error == [0.0; D]) {
        estimates.iter_mut().for_each(|estimate| estimate.standard_error = [f64::NAN; D]);
    }
}

/// Random walks on the lattice of a problem.
pub(super) struct Walks<'a, const D: usize> {
    problem: &'a Problem<'a, D>,
    nodes: [usize; D],
    strides: [usize; D],
    periodic: [bool; D],
}

/// Means over the walks from all points.
pub(super) struct Means<const D: usize> {
    pub estimates: Vec<Estimate<D>>,
    /// Jumps and stops of all walks.
    pub path_steps: usize,
    /// Walks whose value came from another subdomain.
    pub handed_on: usize,
}

/// The node at which a walk stopped.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stop<const D: usize> {
    pub node: usize,
    /// Turns around each periodic axis on the way there.
    pub turns: [i32; D],
}

impl<'a, const D: usize> Walks<'a, D> {
    /// # Errors
    /// [`Failure::SteepDensity`] where the weights are no probabilities; [`Failure::LongWalks`] where `walks` walks
    /// from each of `points` points would take too long.
    pub fn new(problem: &'a Problem<'a, D>, walks: usize, points: usize) -> Result<Self, Failure> {
        check_jumps(problem, walks, points)?;
        problem.operator.check_weights(problem.mesh)?;
        let lattice = problem.mesh.lattice();
        Ok(Self { problem, nodes: lattice.nodes(), strides: lattice.strides(), periodic: lattice.periodic() })
    }

    /// For each point the mean over its walks of `pay(number of the point, stop)`, which says, too, whether the walk
    /// was handed on. The rank `owner(number of the point)` does its walks.
    pub fn mean(
        &self,
        points: &[usize],
        walks: usize,
        owner: impl Fn(usize) -> usize,
        pay: impl Fn(usize, Stop<D>) -> ([f64; D], bool) + Sync + Send,
    ) -> Means<D> {
        let numbers: Vec<usize> = (0..points.len()).collect();
        let found = Ranks::here().map(&numbers, owner, |&p| {
            let mut samples = Samples::new();
            let (mut steps, mut handed_on) = (0, 0);
            for path in 0..walks {
                let stop = self.walk(points[p], path, &mut steps);
                let (paid, away) = pay(p, stop);
                samples.add(paid);
                handed_on += usize::from(away);
            }
            (samples.estimate([0.0; D]), steps, handed_on)
        });
        let mut means = Means { estimates: Vec::with_capacity(found.len()), path_steps: 0, handed_on: 0 };
        for (estimate, steps, handed_on) in found {
            means.estimates.push(estimate);
            means.path_steps += steps;
            means.handed_on += handed_on;
        }
        means
    }

    /// One walk. A random word of 32 bits selects a neighbour, or a stop, by the cumulated weights.
    fn walk(&self, start: usize, path: usize, steps: &mut usize) -> Stop<D> {
        /// 2⁻³², which takes a random word of 32 bits to a number in [0, 1).
        const SCALE: f64 = 1.0 / 4_294_967_296.0;
        let Self { problem, nodes, strides, periodic } = self;
        let mut stream = problem.random.stream(problem.step, start as u32, path as u32);
        let mut at = problem.mesh.lattice().node(start);
        let mut turns = [0; D];
        loop {
            *steps += 1;
            let node = (0..D).map(|d| at[d] * strides[d]).sum::<usize>();
            let word = stream.word();
            if (0..D).any(|d| !periodic[d] && (at[d] == 0 || at[d] + 1 == nodes[d])) {
                return Stop { node, turns };
            }
            let mut sum = 0.0;
            let sums = problem.operator.weights()[node].map(|pair| {
                pair.map(|weight| {
                    sum += weight;
                    sum
                })
            });
            let place = f64::from(word) * SCALE * (1.0 + sum);
            let exit = sums.iter().flatten().map(|&sum| usize::from(place >= sum)).sum::<usize>();
            if exit == 2 * D {
                return Stop { node, turns };
            }
            let (d, up) = (exit / 2, exit % 2 == 1);
            if up {
                at[d] += 1;
                if at[d] == nodes[d] {
                    (at[d], turns[d]) = (0, turns[d] + 1);
                }
            } else if at[d] == 0 {
                (at[d], turns[d]) = (nodes[d] - 1, turns[d] - 1);
            } else {
                at[d] -= 1;
            }
        }
    }
}

/// Running sums of small samples, for mean and variance.
#[derive(Debug, Clone, Copy)]
pub(super) struct Samples<const D: usize> {
    count: f64,
    sums: [f64; D],
    squares: [f64; D],
}

impl<const D: usize> Samples<D> {
    pub fn new() -> Self {
        Self { count: 0.0, sums: [0.0; D], squares: [0.0; D] }
    }

    #[inline(always)]
    pub fn add(&mut self, sample: [f64; D]) {
        self.count += 1.0;
        for (c, sample) in sample.into_iter().enumerate() {
            self.sums[c] += sample;
            self.squares[c] += sample * sample;
        }
    }

    /// Their mean, added to a base, with its standard error.
    pub fn estimate(self, base: [f64; D]) -> Estimate<D> {
        let n = self.count;
        let mean = self.sums.map(|sum| sum / n);
        let variance: [f64; D] =
            std::array::from_fn(|c| ((self.squares[c] / n - mean[c] * mean[c]).max(0.0)) / (n - 1.0));
        Estimate {
            x: std::array::from_fn(|c| base[c] + mean[c]),
            // a single sample has no spread: NaN
            standard_error: if n > 1.0 { variance.map(f64::sqrt) } else { [f64::NAN; D] },
        }
    }
}
