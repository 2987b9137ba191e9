use super::super::Decomposition;
use super::super::overlap::{Local, Part, place, residual};
use super::super::sides::size;
use super::Problem;
use super::coarse::Coarse;
use crate::error::Failure;
use crate::geometry::Patch;
use crate::numerics::larger;
use crate::ranks::Ranks;
use crate::work::Work;

/// Subdomains extended by a strip of their neighbours, with the memory of their solvers
///
/// In one exchange every subdomain reads mesh and density in a strip of `width` nodes around it, solves for a
/// correction of the mesh on itself and the strip, and keeps the nodes that it owns. For a constant density the
/// influence of a node at distance d falls like
///
/// ```text
/// e^(−θ d/h),   cosh θ = 1 + h²/(2 ℓ²),   ℓ = √(Δt/τ)
/// ```
///
/// which is e^(−d/ℓ) in the limit of small h. For another density a factor of about √(max ρ/min ρ) comes in. What has a
/// longer range is computed first on a coarse lattice, so that strips need only a few nodes for any ℓ.
#[derive(Debug, Clone)]
pub struct Strips<const D: usize = 2, const S: usize = 5> {
    decomposition: Decomposition<D>,
    reach: Reach,
    parts: Vec<Part<D, S>>,
    /// For each node the number of the part that owns it; a number larger than any part on bounded sides.
    owner: Vec<u32>,
    coarse: Option<Coarse<D, S>>,
    /// The whole lattice as one part, for long steps on periodic axes, where neither strips nor coarse lattices hold
    /// the mesh.
    whole: Option<Part<D, S>>,
}

/// The width of strips, and what they start from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Reach {
    /// Nodes beyond each cut.
    pub width: usize,
    /// Cells along each axis that make one cell of the coarse lattice; 1 for no coarse lattice, 0 where the lattice
    /// itself is solved whole.
    pub coarse: usize,
}

/// The state before an exchange, and its result.
pub(super) struct Corrected<const D: usize> {
    /// Positions of all nodes before the exchange.
    pub base: Vec<[f64; D]>,
    /// The residual xⁿ − M x of these positions.
    pub residual: Vec<[f64; D]>,
    /// The correction of each node, by the part that owns it.
    pub correction: Vec<[f64; D]>,
    pub exchanges: usize,
    pub work: Work,
    /// Estimate of the error that is left at interface points.
    left: f64,
}

/// Without a coarse lattice strips are so wide that nodes beyond them have at most this influence.
pub(super) const BEYOND: f64 = 1e-3;
/// Widest strip without a coarse lattice. With a wider one the extra unknowns cost more than the lattice.
const WIDE: usize = 10;
/// Width of strips with a coarse lattice, and its ratio.
const FEW: Reach = Reach { width: 8, coarse: 2 };
/// Share of a correction that a coarse lattice is assumed to miss where its error cannot be estimated, and where strips
/// are narrower than two coarse cells, between which the interpolation is rough.
const LEFT_IN_DOUBT: f64 = 0.1;
/// Exchanges are repeated while more than this may be left, as a share of the shortest edge of the mesh.
const LEFT: f64 = 1e-2;
/// Largest number of exchanges in a step, unless a number is set: if these have not been enough, more are of no use.
const MOST_EXCHANGES: usize = 100;

/// θ along each axis: the influence of a node falls by e^−θ with every node of distance.
pub(super) fn decay<const D: usize>(problem: &Problem<'_, D>) -> [f64; D] {
    problem.stiffness().map(|a| (1.0 + 0.5 / a).acosh())
}

impl Reach {
    /// Strips so wide that nodes beyond have at most the influence [`BEYOND`], or else narrow ones and a coarse
    /// lattice.
    pub fn of<const D: usize>(problem: &Problem<'_, D>, decomposition: &Decomposition<D>) -> Self {
        let width = Self::alone(problem, decomposition);
        let lattice = decomposition.lattice();
        let time = problem.dt / problem.equation.relaxation.over(problem.dt);
        if lattice.periodic() == [true; D] && time >= 1.0 {
            // On periodic axes a mesh is held only by the term in xⁿ, of relative size 1/(1 + ℓ²). Any error that
            // varies slowly shifts it, and neither strips nor coarse lattices see such an error.
            return Self { width: 1, coarse: 0 };
        }
        if width > WIDE { FEW } else { Self { width, coarse: 1 } }
    }

    /// Width of a strip beyond which nodes have at most the influence [`BEYOND`].
    pub fn alone<const D: usize>(problem: &Problem<'_, D>, decomposition: &Decomposition<D>) -> usize {
        let decay = decay(problem);
        let divided = (0..D).filter(|&d| decomposition.is_divided(d));
        // casts of large floats saturate
        divided.map(|d| (-BEYOND.ln() / decay[d]).ceil() as usize).fold(1, usize::max)
    }
}

impl<const D: usize, const S: usize> Strips<D, S> {
    /// Strips around the cuts of a decomposition.
    pub fn new(decomposition: &Decomposition<D>) -> Self {
        let reach = Reach { width: 0, coarse: 1 };
        let (decomposition, owner) = (decomposition.clone(), Vec::new());
        Self { decomposition, reach, parts: Vec::new(), owner, coarse: None, whole: None }
    }

    /// The division into subdomains.
    pub(super) fn decomposition(&self) -> &Decomposition<D> {
        &self.decomposition
    }

    /// Nodes that a subdomain reads from its neighbours in one exchange; the largest number over the subdomains.
    pub fn read(&self) -> usize {
        let lattice = self.decomposition.lattice();
        self.parts.iter().map(|part| part.read(lattice)).max().unwrap_or(0)
    }

    /// Unknowns of the lattice whose right-hand sides are gathered in each exchange, the coarse one or the whole; 0
    /// without one.
    pub fn gathered(&self) -> usize {
        let whole = self.whole.as_ref().map_or(0, |whole| whole.patch.len());
        self.coarse.as_ref().map_or(whole, Coarse::len)
    }

    /// Makes what depends on the lattice and the reach alone, for this and later steps.
    fn prepare(&mut self, reach: Reach) {
        if self.reach == reach && !self.parts.is_empty() {
            return;
        }
        let lattice = *self.decomposition.lattice();
        let extended = self.decomposition.extended([reach.width; 2]);
        self.parts = extended.into_iter().map(|(patch, own)| Part::new(&lattice, patch, own)).collect();
        self.owner = vec![u32::MAX; lattice.len()];
        for (number, part) in self.parts.iter().enumerate() {
            part.own.iter().for_each(|&(node, _)| self.owner[node] = number as u32);
        }
        self.coarse = (reach.coarse > 1).then(|| Coarse::new(&lattice, reach.coarse)).flatten();
        let all = || (0..lattice.len()).filter(|&k| !lattice.on_side(k)).collect();
        self.whole = (reach.coarse == 0).then(|| Part::new(&lattice, Patch::whole(&lattice), all()));
        self.reach = reach;
    }

    /// Does the given number of exchanges. Without a number it does one, and further ones while the last correction
    /// suggests that more than a hundredth of the shortest edge may be left.
    pub(super) fn correct(
        &mut self,
        problem: &Problem<'_, D>,
        reach: Reach,
        local: Local,
        exchanges: Option<usize>,
    ) -> Result<Corrected<D>, Failure> {
        self.prepare(reach);
        if let Some(coarse) = &mut self.coarse {
            coarse.prepare(problem)?;
        }
        let mesh = problem.mesh;
        let limit = LEFT * mesh.shortest_edge();
        let none = vec![[0.0; D]; mesh.x().len()];
        let mut found = Corrected {
            base: problem.new.to_vec(),
            residual: none.clone(),
            correction: none,
            exchanges: 0,
            work: Work::default(),
            left: 0.0,
        };
        let mut before = f64::INFINITY;
        loop {
            add(&mut found.base, &found.correction);
            found.residual = residual(problem.operator, mesh.x(), &found.base, mesh.jump());
            self.exchange(problem, local, &mut found)?;
            found.exchanges += 1;
            let change = found.correction.as_flattened().iter().fold(0.0, |m, &c| larger(m, c));
            if found.exchanges > 1 {
                // later exchanges gain less than the first, so the last change itself is the estimate of what is left
                found.left = change;
            }
            let done = match exchanges {
                Some(n) => found.exchanges >= n,
                None => {
                    // NaN counts as not shrinking
                    let shrinks = change < before;
                    found.left <= limit || !shrinks || found.exchanges == MOST_EXCHANGES
                }
            };
            if done {
                return Ok(found);
            }
            before = change;
        }
    }

    /// Estimate of the influence of nodes beyond the strips.
    fn beyond(&self, problem: &Problem<'_, D>) -> f64 {
        let decay = decay(problem);
        let divided = (0..D).filter(|&d| self.decomposition.is_divided(d));
        divided.map(|d| (-decay[d] * self.reach.width as f64).exp()).fold(0.0, f64::max)
    }

    /// Estimate of the coarse lattice's error, as a share of the largest correction. The extrapolation removes the term
    /// in H², which changed the correction by a share s, and the next term is of the size of s². On case B, from 81² to
    /// 321² nodes, the error was 10 s²; a factor of 30 keeps a margin.
    fn left_by_coarse(&self, s: f64) -> f64 {
        let narrow = self.reach.width < 2 * self.reach.coarse;
        let doubtful = narrow || !self.coarse.as_ref().is_some_and(Coarse::knows_its_error);
        (30.0 * s * s).clamp(if doubtful { LEFT_IN_DOUBT } else { 0.0 }, 1.0)
    }

    fn exchange(&mut self, problem: &Problem<'_, D>, local: Local, found: &mut Corrected<D>) -> Result<(), Failure> {
        let lattice = problem.mesh.lattice();
        let size = size(problem.mesh);
        let mut guess = vec![[0.0; D]; lattice.len()];
        let mut changed = None;
        if let Some(coarse) = &mut self.coarse {
            let (smooth, share, cost) = coarse.correction(&found.residual, size)?;
            found.work += cost;
            (guess, changed) = (smooth, Some(share));
        } else if let Some(whole) = &mut self.whole {
            whole.prepare(problem.operator, &found.residual);
            whole.start(lattice, &guess);
            found.work += whole.correct(local, size)?;
            whole.own.iter().for_each(|&(node, place)| guess[node] = whole.correction[place]);
        }
        let residual = &found.residual;
        let corrected = Ranks::here().map_mut(&mut self.parts, |part| {
            part.prepare(problem.operator, residual);
            part.start(lattice, &guess);
            let work = part.correct(local, size)?;
            Ok((work, part.rests, part.own_correction()))
        });
        for (part, corrected) in self.parts.iter_mut().zip(corrected) {
            let (work, rests, correction) = corrected?;
            found.work += work;
            part.rests = rests;
            part.own.iter().zip(correction).for_each(|(&(node, _), c)| found.correction[node] = c);
        }
        let change = found.correction.as_flattened().iter().fold(0.0, |m, &c| larger(m, c));
        let share = changed.map_or(1.0, |share| self.left_by_coarse(share));
        found.left = if self.whole.is_some() { 0.0 } else { self.beyond(problem) * change * share };
        Ok(())
    }

    /// Whether all parts are at rest up to round-off.
    pub(super) fn rest(&self) -> bool {
        self.parts.iter().all(|part| part.rests)
    }

    /// The rank that owns a part.
    pub(super) fn rank(&self, part: usize) -> usize {
        Ranks::here().owner(part, self.parts.len())
    }

    /// The part that owns a node.
    pub(super) fn owner(&self, node: usize) -> Option<usize> {
        self.owner.get(node).map(|&part| part as usize).filter(|&part| part < self.parts.len())
    }

    /// The correction of a node as a part of this rank computed it; none outside the part and the nearer half of its
    /// strip, beyond which the strip sees too little.
    pub(super) fn seen(&self, part: usize, node: usize) -> Option<[f64; D]> {
        let part = &self.parts[part];
        let margin = self.reach.width - 1 - self.reach.width / 2;
        part.correction.get(place(&part.patch, self.decomposition.lattice(), node, margin)?).copied()
    }
}

fn add<const D: usize>(x: &mut [[f64; D]], c: &[[f64; D]]) {
    x.iter_mut().zip(c).for_each(|(x, c)| (0..D).for_each(|k| x[k] += c[k]));
}
