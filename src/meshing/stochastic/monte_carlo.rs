use super::super::sides::jump;
use super::lattice_walk::Samples;
use super::{Estimate, Estimates, Estimator, Problem};
use crate::error::{Error, Failure, Result};
use crate::geometry::Lattice;
use crate::numerics::difference::derivative;
use crate::parallel;
use crate::random::{Philox, normals, uniform};
use crate::work::Work;
use serde::{Deserialize, Serialize};
use statrs::function::erf::erfc_inv;

/// Diffusion paths in the continuous computational domain, as published
///
/// ```text
/// Φ ← Φ + b(Φ) Δs + √(2Δs) W,   Δs = Δt/(τM),   M times from Φ = ξ;   x(ξ) = E[xⁿ(Φ)]
/// ```
///
/// with b interpolated bilinearly and xⁿ bicubically. Near a bounded side, paths leave between two points with the
/// probability exp(−d₀d₁/Δs) of a Brownian bridge, d their distances from it; a path that left pays the position on the
/// side where and when it did, linear in time between old and new side. Whether a path leaves is drawn; with any of the
/// variance reductions it is weighed instead, that is each path pays the mean over what could have been drawn.
///
/// Its target is the time-continuous step, not the implicit Euler one that the subdomains solve: a bias of first order
/// in Δs remains, and the noise of N paths.
///
/// # Source
/// (3.1)–(3.3) of Bihlo, Haynes and Walsh (2015); Jansons and Lythe (2003) for the exit test.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MonteCarlo {
    /// N, for each point.
    pub paths: usize,
    /// M.
    pub substeps: usize,
    /// Every second path takes the increments of the one before with opposite sign.
    #[serde(default)]
    pub antithetic: bool,
    /// Increments from a scrambled Sobol sequence in the order of a Brownian bridge. The standard error reported is
    /// then that of independent paths, an upper bound.
    #[serde(default)]
    pub sobol: bool,
    /// Subtracts the martingale Σ ∇xⁿ(Φ)·√(2Δs) W, whose mean is zero.
    #[serde(default)]
    pub control_variate: bool,
    /// All points share their random numbers: errors of neighbours are alike and bend the mesh less.
    #[serde(default)]
    pub common: bool,
}

/// Paths that are computed side by side.
const LANES: usize = 8;
const MAX_PATHS: usize = 1 << 31;
const MAX_SOBOL_PATHS: usize = 1 << 16;
const MAX_SUBSTEPS: usize = 100_000;
/// Beyond this exponent a bridge does not leave: e⁻⁴⁰ = 4e-18.
const FAR: f64 = 40.0;

impl MonteCarlo {
    /// Independent paths, as published.
    pub fn new(paths: usize, substeps: usize) -> Self {
        Self { paths, substeps, antithetic: false, sobol: false, control_variate: false, common: false }
    }

    /// Refuses settings out of range.
    ///
    /// # Errors
    /// [`Error::Invalid`].
    pub fn check(&self) -> Result<()> {
        let most = if self.sobol { MAX_SOBOL_PATHS } else { MAX_PATHS };
        let dimensions = sobol_burley::NUM_DIMENSIONS as usize;
        let invalid = |key: &str, value: usize, rule: String| Err(Error::invalid(key, value, rule));
        if self.paths == 0 {
            return invalid("paths", 0, "without paths there is no estimate; set it to 1 or more".into());
        }
        if self.paths > most {
            return invalid("paths", self.paths, format!("must be at most {most}"));
        }
        if !(1..=MAX_SUBSTEPS).contains(&self.substeps) {
            return invalid("substeps", self.substeps, format!("must be between 1 and {MAX_SUBSTEPS}"));
        }
        if self.sobol && 2 * self.substeps > dimensions {
            return invalid("substeps", self.substeps, format!("must be at most {} with sobol", dimensions / 2));
        }
        if self.antithetic && !self.paths.is_multiple_of(2) {
            return invalid("paths", self.paths, "must be even with antithetic = true".into());
        }
        if self.antithetic && self.sobol {
            return Err(Error::invalid("antithetic", true, "cannot go with sobol = true; set one of them to false"));
        }
        Ok(())
    }
}

impl Estimator for MonteCarlo {
    fn estimate(&self, problem: &Problem<'_>, points: &[usize]) -> Result<Estimates, Failure> {
        let domain = Domain::new(problem, self);
        let bridge = Bridge::new(self.substeps);
        let found = parallel::map(points, |&k| self.point(problem, &domain, &bridge, k));
        let path_steps = found.iter().map(|(_, steps)| steps).sum();
        Ok(Estimates {
            points: found.into_iter().map(|(estimate, _)| estimate).collect(),
            guess: problem.new.to_vec(),
            work: Work { path_steps, ..Work::default() },
            sweeps: 0,
        })
    }
}

/// Increments of all steps along both axes, for paths side by side.
type Increments = Vec<[[f64; LANES]; 2]>;

impl MonteCarlo {
    /// The estimate at one node, and the number of path steps it took.
    fn point(&self, problem: &Problem<'_>, domain: &Domain, bridge: &Bridge, k: usize) -> (Estimate, usize) {
        let node = if self.common { u32::MAX } else { k as u32 };
        let base = problem.mesh.x()[k];
        let from = domain.lattice.node(k).map(|i| i as f64);
        let mut increments = vec![[[0.0; LANES]; 2]; self.substeps];
        let mut samples = Samples::new();
        let mut pair = [0.0; 2];
        let mut steps = 0;
        for first in (0..self.paths).step_by(LANES) {
            if self.sobol {
                let [[seed], ..] = problem.random.blocks([[0], [u32::MAX], [node], [problem.step]]);
                bridge.increments(seed, first as u32, &mut increments);
            } else {
                self.increments(problem.random, [first as u32, node, problem.step], &mut increments);
            }
            for lane in 0..LANES.min(self.paths - first) {
                let path = (first + lane) as u32;
                let exits = |block: u32| problem.random.blocks([[block], [path], [node], [problem.step]])[0][0];
                let (paid, taken) = domain.path(from, &increments, lane, exits);
                steps += taken;
                let sample = [0, 1].map(|c| paid[c] - base[c]);
                if !self.antithetic {
                    samples.add(sample);
                } else if lane % 2 == 0 {
                    pair = sample;
                } else {
                    samples.add([0, 1].map(|c| 0.5 * (pair[c] + sample[c])));
                }
            }
        }
        (samples.estimate(base), steps)
    }

    /// Independent standard normal increments of the paths from `first` on: each block of four words serves two steps.
    #[inline(always)]
    fn increments(&self, random: Philox, [first, node, step]: [u32; 3], out: &mut Increments) {
        let paths = std::array::from_fn(|l| {
            let path = first.wrapping_add(l as u32);
            if self.antithetic { path / 2 } else { path }
        });
        for (block, two) in out.chunks_mut(2).enumerate() {
            let [a, b, c, d] = random.blocks([[block as u32; LANES], paths, [node; LANES], [step; LANES]]);
            two[0] = normals(a, b);
            if let Some(second) = two.get_mut(1) {
                *second = normals(c, d);
            }
        }
        if self.antithetic {
            for w in out.iter_mut().flatten() {
                w.iter_mut().skip(1).step_by(2).for_each(|w| *w = -*w);
            }
        }
    }
}

/// What paths move in, in units of the lattice spacing.
struct Domain {
    lattice: Lattice<2>,
    /// b Δs at all nodes, periodic axes closed.
    drift: Vec<[f64; 2]>,
    /// √(2Δs).
    spread: [f64; 2],
    /// 1/Δs along each axis: for products of two distances.
    sharpness: [f64; 2],
    /// ∇_ξ of both coordinates, closed: x along ξ, x along η, y along ξ, y along η.
    slopes: Vec<[f64; 4]>,
    old: Surface,
    new: Surface,
    /// How far old and new side are apart in time, in substeps.
    substeps: f64,
    /// Subtract the martingale.
    control: bool,
    /// Weigh exits instead of drawing them.
    weigh: bool,
}

impl Domain {
    fn new(problem: &Problem<'_>, settings: &MonteCarlo) -> Self {
        let substeps = settings.substeps;
        let (mesh, lattice) = (problem.mesh, *problem.mesh.lattice());
        let ds = problem.dt / (problem.equation.relaxation * substeps as f64);
        let n = lattice.cells().map(|n| n as f64);
        let b = problem.equation.gradient.of_log(&lattice, problem.rho);
        let drift: Vec<[f64; 2]> = b.iter().map(|b| [b[0] * n[0] * ds, b[1] * n[1] * ds]).collect();
        let jump = jump(mesh);
        let [along_xi, along_eta] = [0, 1].map(|d| derivative(&lattice, mesh.x(), d, jump[d]));
        let slopes: Vec<[f64; 4]> = (along_xi.iter().zip(&along_eta))
            .map(|(a, b)| [a[0] / n[0], b[0] / n[1], a[1] / n[0], b[1] / n[1]])
            .collect();
        Self {
            lattice,
            drift: lattice.closed(&drift).into_owned(),
            spread: n.map(|n| n * (2.0 * ds).sqrt()),
            sharpness: n.map(|n| 1.0 / (ds * n * n)),
            slopes: lattice.closed(&slopes).into_owned(),
            old: Surface::new(&lattice, mesh.x(), jump),
            new: Surface::new(&lattice, problem.new, jump),
            substeps: substeps as f64,
            control: settings.control_variate,
            weigh: settings.antithetic || settings.sobol || settings.control_variate,
        }
    }

    /// What one path pays, and how many steps it took.
    #[inline(always)]
    fn path(
        &self,
        from: [f64; 2],
        increments: &Increments,
        lane: usize,
        exits: impl Fn(u32) -> u32,
    ) -> ([f64; 2], usize) {
        let (cells, periodic) = (self.lattice.cells(), self.lattice.periodic());
        let mut at = from;
        let mut martingale = [0.0; 2];
        let (mut inside, mut paid) = (1.0, [0.0; 2]);
        for (step, w) in increments.iter().enumerate() {
            // position in the lattice, turns around periodic axes taken off
            let place = [0, 1].map(|d| if periodic[d] { at[d].rem_euclid(cells[d] as f64) } else { at[d] });
            let (k, share) = self.cell(place);
            let drift = bilinear(&self.drift, cells[1] + 1, k, share);
            let noise = [0, 1].map(|d| self.spread[d] * w[d][lane]);
            if self.control {
                let slope = bilinear(&self.slopes, cells[1] + 1, k, share);
                (0..2).for_each(|c| martingale[c] += slope[2 * c] * noise[0] + slope[2 * c + 1] * noise[1]);
            }
            let next = [0, 1].map(|d| at[d] + drift[d] + noise[d]);
            for d in (0..2).filter(|&d| !periodic[d]) {
                let n = cells[d] as f64;
                for (end, (before, after)) in [(at[d], next[d]), (n - at[d], n - next[d])].into_iter().enumerate() {
                    let exponent = before * after * self.sharpness[d];
                    if exponent > FAR {
                        continue;
                    }
                    let mut leaves = if after <= 0.0 { 1.0 } else { (-exponent).exp() };
                    if !self.weigh && after > 0.0 {
                        // blocks beyond those of the increments
                        let word = exits(0x8000_0000 | (step as u32) << 2 | (d as u32) << 1 | end as u32);
                        leaves = if uniform(word) < leaves { 1.0 } else { 0.0 };
                    }
                    if leaves > 0.0 {
                        let part = before / (before + after.abs()).max(f64::MIN_POSITIVE);
                        let mut exit = [0, 1].map(|e| at[e] + part * (next[e] - at[e]));
                        exit[d] = if end == 0 { 0.0 } else { n };
                        if !periodic[1 - d] {
                            exit[1 - d] = exit[1 - d].clamp(0.0, cells[1 - d] as f64);
                        }
                        let elapsed = (step as f64 + part) / self.substeps;
                        let (old, new) = (self.old.at(&self.lattice, exit), self.new.at(&self.lattice, exit));
                        for c in 0..2 {
                            paid[c] += inside * leaves * (new[c] + elapsed * (old[c] - new[c]) - martingale[c]);
                        }
                        inside *= 1.0 - leaves;
                    }
                }
            }
            if inside <= 0.0 {
                return (paid, step + 1);
            }
            at = next;
        }
        let end = self.old.at(&self.lattice, at);
        ([0, 1].map(|c| paid[c] + inside * (end[c] - martingale[c])), increments.len())
    }

    /// The first node of the cell that holds a place, and where the place is in it.
    #[inline(always)]
    fn cell(&self, place: [f64; 2]) -> (usize, [f64; 2]) {
        let cells = self.lattice.cells();
        let [i, j] = [0, 1].map(|d| (place[d] as usize).min(cells[d] - 1));
        (i * (cells[1] + 1) + j, [place[0] - i as f64, place[1] - j as f64])
    }
}

/// Bilinear interpolation in the cell of node k of an array with rows of `width`.
#[inline(always)]
fn bilinear<const K: usize>(table: &[[f64; K]], width: usize, k: usize, [s, r]: [f64; 2]) -> [f64; K] {
    let (low, high) = (&table[k..k + 2], &table[k + width..k + width + 2]);
    std::array::from_fn(|c| {
        let below = low[0][c] + r * (low[1][c] - low[0][c]);
        let above = high[0][c] + r * (high[1][c] - high[0][c]);
        below + s * (above - below)
    })
}

/// Positions as a bicubic function of the lattice coordinates: the cubic through the two nodes on either side
///
/// Stored with one more line of nodes around: images on periodic axes, extrapolated ones beyond bounded sides.
struct Surface {
    values: Vec<[f64; 2]>,
    width: usize,
    jump: [[f64; 2]; 2],
}

impl Surface {
    fn new(lattice: &Lattice<2>, x: &[[f64; 2]], jump: [[f64; 2]; 2]) -> Self {
        let (nodes, periodic) = (lattice.nodes(), lattice.periodic());
        // lines −1 … cells + 1 along each axis
        let lines = lattice.cells().map(|n| n + 3);
        let width = lines[1];
        let mut values = vec![[0.0; 2]; lines[0] * width];
        let known = |d: usize, i: usize| periodic[d] || (1..=nodes[d]).contains(&i);
        for i in (0..lines[0]).filter(|&i| known(0, i)) {
            for j in (0..width).filter(|&j| known(1, j)) {
                let lifted = [i + nodes[0] - 1, j + nodes[1] - 1];
                let value = x[lattice.index([lifted[0] % nodes[0], lifted[1] % nodes[1]])];
                values[i * width + j] = [0, 1].map(|c| {
                    value[c] + (0..2).map(|d| ((lifted[d] / nodes[d]) as f64 - 1.0) * jump[d][c]).sum::<f64>()
                });
            }
        }
        let mut extrapolate = |out: usize, step: isize, lines: usize| {
            let at = |m: isize| values[out.wrapping_add_signed(m * step)];
            values[out] = std::array::from_fn(|c| match lines {
                // three nodes carry a parabola, four a cubic
                5 => 3.0 * at(1)[c] - 3.0 * at(2)[c] + at(3)[c],
                _ => 4.0 * at(1)[c] - 6.0 * at(2)[c] + 4.0 * at(3)[c] - at(4)[c],
            });
        };
        if !periodic[0] {
            for j in (0..width).filter(|&j| known(1, j)) {
                extrapolate(j, width as isize, lines[0]);
                extrapolate((lines[0] - 1) * width + j, -(width as isize), lines[0]);
            }
        }
        if !periodic[1] {
            for i in 0..lines[0] {
                extrapolate(i * width, 1, width);
                extrapolate((i + 1) * width - 1, -1, width);
            }
        }
        Self { values, width, jump }
    }

    #[inline(always)]
    fn at(&self, lattice: &Lattice<2>, at: [f64; 2]) -> [f64; 2] {
        let (cells, periodic) = (lattice.cells(), lattice.periodic());
        let turns = [0, 1].map(|d| if periodic[d] { (at[d] / cells[d] as f64).floor() } else { 0.0 });
        let place = [0, 1].map(|d| (at[d] - turns[d] * cells[d] as f64).max(0.0));
        let [i, j] = [0, 1].map(|d| (place[d] as usize).min(cells[d] - 1));
        let (p, q) = (cubic(place[0] - i as f64), cubic(place[1] - j as f64));
        let mut sum = [0, 1].map(|c| turns[0] * self.jump[0][c] + turns[1] * self.jump[1][c]);
        for (line, p) in p.into_iter().enumerate() {
            let four = &self.values[(i + line) * self.width + j..][..4];
            for c in 0..2 {
                sum[c] += p * (q[0] * four[0][c] + q[1] * four[1][c] + q[2] * four[2][c] + q[3] * four[3][c]);
            }
        }
        sum
    }
}

/// Weights of nodes −1, 0, 1, 2 in the cubic through them.
#[inline(always)]
fn cubic(s: f64) -> [f64; 4] {
    let (before, after, beyond) = (s + 1.0, s - 1.0, s - 2.0);
    [-s * after * beyond / 6.0, 0.5 * before * after * beyond, -0.5 * before * s * beyond, before * s * after / 6.0]
}

/// A path of M steps built from its end, then its middle, then the middles of the halves …, so that the first and best
/// dimensions of a sequence decide where the path goes.
struct Bridge {
    /// Places to be set, in order: which, from which two, and the weights of both and of the normal number.
    knots: Vec<Knot>,
}

struct Knot {
    at: usize,
    ends: [usize; 2],
    weights: [f64; 2],
    deviation: f64,
}

impl Bridge {
    fn new(steps: usize) -> Self {
        let mut knots = vec![Knot { at: steps, ends: [0, 0], weights: [0.0, 0.0], deviation: (steps as f64).sqrt() }];
        let mut gaps = std::collections::VecDeque::from([[0, steps]]);
        while let Some([a, b]) = gaps.pop_front() {
            let at = a.midpoint(b);
            if at == a {
                continue;
            }
            let (left, right, gap) = ((at - a) as f64, (b - at) as f64, (b - a) as f64);
            let weights = [right / gap, left / gap];
            knots.push(Knot { at, ends: [a, b], weights, deviation: (left * right / gap).sqrt() });
            gaps.extend([[a, at], [at, b]]);
        }
        Self { knots }
    }

    /// Increments of the paths from `first` on of a scrambled Sobol sequence.
    fn increments(&self, seed: u32, first: u32, out: &mut Increments) {
        let mut places = vec![0.0; self.knots.len() + 1];
        for lane in 0..LANES {
            for axis in 0..2 {
                for (number, knot) in self.knots.iter().enumerate() {
                    let index = (first + lane as u32) & 0xFFFF;
                    let point = sobol_burley::sample(index, (2 * number + axis) as u32, seed);
                    // the middle of the 2⁻²³ that a single-precision number stands for
                    let normal =
                        -std::f64::consts::SQRT_2 * erfc_inv(2.0 * (f64::from(point) + 0.5 / f64::from(1 << 23)));
                    let [a, b] = knot.ends.map(|end| places[end]);
                    places[knot.at] = knot.weights[0] * a + knot.weights[1] * b + knot.deviation * normal;
                }
                for (step, w) in out.iter_mut().enumerate() {
                    w[axis][lane] = places[step + 1] - places[step];
                }
                places[0] = 0.0;
            }
        }
    }
}
