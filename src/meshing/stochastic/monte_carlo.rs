use super::lattice_walk::Samples;
use super::paths::{Domain, LANES, Lanes};
use super::segment::Segment;
use super::{Estimate, Estimates, Estimator, Problem, Strips};
use crate::error::{Error, Failure, Result};
use crate::meshing::Decomposition;
use crate::random::normals;
use crate::ranks::Ranks;
use crate::work::Work;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Paths of the stochastic differential equation in the continuous computational domain, as published
///
/// ```text
/// Φ ← Φ + b(Φ) Δs + √(2Δs) W,   Δs = Δt/(τM),   M times from Φ = ξ;   x(ξ) = E[xⁿ(Φ)]
/// ```
///
/// with b interpolated bilinearly and xⁿ bicubically. Near a bounded side a path leaves between two points with the
/// probability exp(−d₀d₁/Δs) of a Brownian bridge, where d₀ and d₁ are their distances from the side. It then takes the
/// position on the side where and when it left, linear in time between the old and the new side. Whether a path leaves
/// is drawn at random. With any variance reduction it is weighted instead: each path takes the mean over what could
/// have been drawn.
///
/// Paths approximate the step with exact integration in time, whereas the subdomains solve an implicit Euler step. A
/// bias of first order in Δs remains, besides the noise of N paths.
///
/// # Source
/// (3.1)–(3.3) of Bihlo, Haynes and Walsh (2015); Jansons and Lythe (2003) for the exit test.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MonteCarlo {
    /// Number N of paths that start at each interface point.
    pub paths: usize,
    /// Number M of Euler–Maruyama steps of a path within a time step.
    pub substeps: usize,
    /// Whether every second path takes the increments of the one before with the opposite sign, which cancels errors
    /// that are odd in them.
    #[serde(default)]
    pub antithetic: bool,
    /// Whether paths take their increments from a Sobol sequence, in the order of a Brownian bridge. The paths are
    /// divided into up to four independent scramblings of it; the spread of their means gives the standard error.
    #[serde(default)]
    pub sobol: bool,
    /// Subtracts from each path the sum Σ ∇xⁿ(Φ)·√(2Δs) W over its steps, with xⁿ the old mesh, Φ the place of the path
    /// in ξ, Δs the step and W the normal increment. Its mean is zero, and it varies with the position that the path
    /// finds, so that the difference has less variance.
    #[serde(default)]
    pub control_variate: bool,
    /// Whether all interface points use the same random numbers: neighbouring nodes then have similar errors, which
    /// bend the mesh less.
    #[serde(default)]
    pub common: bool,
}

/// Largest number of paths that start at a point: more than any run could afford.
const MAX_PATHS: usize = 1 << 31;
/// Largest number of paths that start at a point and take their increments from a Sobol sequence.
const MAX_SOBOL_PATHS: usize = 1 << 16;
/// Largest number of substeps of a path in a time step.
const MAX_SUBSTEPS: usize = 100_000;
/// Number of independent scramblings of the Sobol sequence.
const SCRAMBLINGS: usize = 4;
/// Blocks of random words with this bit in their number decide whether a path leaves the domain; those without give its
/// increments.
const EXITS: u32 = 1 << 31;

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
    fn check(&self, _decomposition: &Decomposition) -> Result<()> {
        self.check()
    }

    fn estimate(&self, problem: &Problem<'_>, points: &[usize], _strips: &mut Strips) -> Result<Estimates, Failure> {
        let domain = Domain::new(problem, self);
        self.sampled(problem, points, |from, increments, count, words| domain.walk(from, increments, count, words))
    }
}

impl Estimator<1, 3> for MonteCarlo {
    fn check(&self, _decomposition: &Decomposition<1>) -> Result<()> {
        self.check()
    }

    fn estimate(
        &self,
        problem: &Problem<'_, 1>,
        points: &[usize],
        _strips: &mut Strips<1, 3>,
    ) -> Result<Estimates<1>, Failure> {
        let domain = Segment::new(problem, self);
        self.sampled(problem, points, |from, increments, count, words| domain.walk(from, increments, count, words))
    }
}

/// Random words of a step and side that decide the exits of paths.
type Words<'a> = &'a dyn Fn(u32) -> [[u32; LANES]; 4];

impl MonteCarlo {
    /// Estimates from walks of [`LANES`] paths at once: `walk` gives the sums that they collect and the steps that they
    /// take.
    fn sampled<const D: usize>(
        &self,
        problem: &Problem<'_, D>,
        points: &[usize],
        walk: impl Fn([f64; D], &[[Lanes; 2]], usize, Words<'_>) -> ([Lanes; D], usize) + Sync,
    ) -> Result<Estimates<D>, Failure> {
        let bridge = Bridge::new(self.substeps);
        let ranks = Ranks::here();
        let owner = |p: usize| ranks.owner(p, points.len());
        let found = ranks.map(points, owner, |&k| self.point(problem, &walk, &bridge, k));
        let path_steps = found.iter().map(|(_, steps)| steps).sum();
        let estimates = found.into_iter().map(|(estimate, _)| estimate).collect();
        let work = Work { path_steps, ..Work::default() };
        Ok(Estimates { work, ..Estimates::sampled(estimates, problem.new.to_vec(), self.paths) })
    }

    /// The estimate at one node, and the number of path steps that it took.
    #[inline(always)]
    fn point<const D: usize>(
        &self,
        problem: &Problem<'_, D>,
        walk: &impl Fn([f64; D], &[[Lanes; 2]], usize, Words<'_>) -> ([Lanes; D], usize),
        bridge: &Bridge,
        k: usize,
    ) -> (Estimate<D>, usize) {
        let node = if self.common { u32::MAX } else { k as u32 };
        let base = problem.mesh.x()[k];
        let from = problem.mesh.lattice().node(k).map(|i| i as f64);
        let words = |block: u32, paths: [u32; LANES]| {
            problem.random.blocks([[block; LANES], paths, [node; LANES], [problem.step; LANES]])
        };
        let mut increments = vec![[[0.0; LANES]; 2]; self.substeps];
        let chunks = self.paths.div_ceil(LANES);
        let groups = if self.sobol { SCRAMBLINGS.min(chunks) } else { 1 };
        let mut samples = vec![Samples::<D>::new(); groups];
        let mut steps = 0;
        for first in (0..self.paths).step_by(LANES) {
            let paths = std::array::from_fn(|l| first as u32 + l as u32);
            let group = first / LANES * groups / chunks;
            if self.sobol {
                let [[seed, ..], ..] = words(0, [u32::MAX - group as u32; LANES]);
                bridge.increments(seed, paths, &mut increments);
            } else {
                self.increments(words, paths, &mut increments);
            }
            let count = LANES.min(self.paths - first);
            let (paid, taken) = walk(from, &increments, count, &|exit| words(EXITS | exit, paths));
            steps += taken;
            let mut sample: [Lanes; D] = std::array::from_fn(|c| paid[c].map(|x| x - base[c]));
            let mut size = 1;
            if self.antithetic {
                size = 2;
                for c in &mut sample {
                    (0..count).step_by(2).for_each(|l| c[l] = 0.5 * (c[l] + c[l + 1]));
                }
            }
            (0..count).step_by(size).for_each(|l| samples[group].add(std::array::from_fn(|c| sample[c][l])));
        }
        let estimate = match samples.as_slice() {
            [all] => all.estimate(base),
            groups => {
                let mut means = Samples::<D>::new();
                groups.iter().for_each(|group| means.add(group.estimate([0.0; D]).x));
                means.estimate(base)
            }
        };
        (estimate, steps)
    }

    /// Independent standard normal increments. Each block of four random words gives those of two steps.
    #[inline(always)]
    fn increments(
        &self,
        words: impl Fn(u32, [u32; LANES]) -> [[u32; LANES]; 4],
        mut paths: [u32; LANES],
        out: &mut [[Lanes; 2]],
    ) {
        if self.antithetic {
            paths = paths.map(|path| path / 2);
        }
        for (block, two) in out.chunks_mut(2).enumerate() {
            let [a, b, c, d] = words(block as u32, paths);
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

/// The order in which a path of M steps is built: its end, its middle, the middles of the halves, and so on. The first
/// dimensions of a Sobol sequence, which are its best, then decide the large-scale shape of the path.
struct Bridge {
    /// Points of the path in that order: its index, the two points it lies between, and the weights of both and of the
    /// normal number.
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

    /// Increments of paths from a scrambled Sobol sequence.
    #[inline(always)]
    fn increments(&self, seed: u32, paths: [u32; LANES], out: &mut [[Lanes; 2]]) {
        let mut places = vec![[[0.0; LANES]; 2]; self.knots.len() + 1];
        for (number, knot) in self.knots.iter().enumerate() {
            // a number in single precision stands for an interval of 2⁻²³ above it, of which the middle is taken
            let [a, b] = [0, 1].map(|axis| {
                paths.map(|path| {
                    let point = sobol_burley::sample(path & 0xFFFF, 2 * number as u32 + axis, seed);
                    ((point * 8_388_608.0) as u32) << 9 | 1 << 8
                })
            });
            let normal = normals(a, b);
            let ends = knot.ends.map(|end| places[end]);
            for axis in 0..2 {
                for l in 0..LANES {
                    places[knot.at][axis][l] = knot.weights[0] * ends[0][axis][l]
                        + knot.weights[1] * ends[1][axis][l]
                        + knot.deviation * normal[axis][l];
                }
            }
        }
        for (w, ends) in out.iter_mut().zip(places.windows(2)) {
            *w = [0, 1].map(|axis| std::array::from_fn(|l| ends[1][axis][l] - ends[0][axis][l]));
        }
    }
}
