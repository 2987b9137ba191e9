use super::super::Decomposition;
use super::super::overlap::{Local, Part, place, residual};
use super::super::sides::{jump, size};
use super::Problem;
use super::coarse::Coarse;
use crate::error::Failure;
use crate::geometry::Patch;
use crate::numerics::larger;
use crate::parallel;
use crate::work::Work;

/// Subdomains that see a strip of their neighbours, with the memory of their solvers
///
/// In one exchange every subdomain reads mesh and density in a strip of `width` nodes around it, corrects the mesh on
/// itself and the strip, each by itself, and keeps what it answers for. The influence of a node at distance d falls
/// like
///
/// ```text
/// e^(−θ d/h),   cosh θ = 1 + h²/(2 ℓ²),   ℓ = √(Δt/τ)
/// ```
///
/// for a density that does not vary, d/ℓ in the limit of small h; where it varies, times √(max ρ/min ρ) or so. What
/// reaches further, a coarse lattice brings first: the strips then need a few nodes only, whatever ℓ is.
#[derive(Debug, Clone)]
pub struct Strips {
    decomposition: Decomposition,
    reach: Reach,
    parts: Vec<Part>,
    /// For each node the number of the part that answers for it; beyond the last on bounded sides.
    owner: Vec<u32>,
    coarse: Option<Coarse>,
    /// The whole lattice, where a step cannot be told apart from one of it.
    whole: Option<Part>,
}

/// How far strips see, and what they start from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Reach {
    /// Nodes of the neighbours beyond each cut.
    pub width: usize,
    /// Cells to one of the coarse lattice; 1 for none, 0 where the lattice itself is solved whole.
    pub coarse: usize,
}

/// What an exchange started from, and what it found.
pub(super) struct Corrected {
    /// Positions before it, at all nodes.
    pub base: Vec<[f64; 2]>,
    /// Their residual xⁿ − M x.
    pub residual: Vec<[f64; 2]>,
    /// The correction of each node by the part that answers for it.
    pub correction: Vec<[f64; 2]>,
    pub exchanges: usize,
    pub work: Work,
    /// What may be left of the error at interface points, about.
    left: f64,
}

/// Influence of what lies beyond a strip without a coarse lattice: width follows from it.
pub(super) const BEYOND: f64 = 1e-3;
/// Widest strip that is taken without a coarse lattice; what that costs more than the lattice grows with the width.
const WIDE: usize = 10;
/// Width of a strip and ratio of the coarse lattice where ℓ asks for more.
const FEW: Reach = Reach { width: 8, coarse: 2 };
/// What a coarse lattice leaves of a correction where it cannot tell, and what is left by strips narrower than two
/// coarse cells, between which the guess is rough.
const LEFT_IN_DOUBT: f64 = 0.1;
/// Error that exchanges leave, as a share of the shortest edge of the mesh.
const LEFT: f64 = 1e-2;
/// Exchanges in a step: more gain nothing where these have not.
const MOST_EXCHANGES: usize = 100;

/// θ along each axis: what is one node further away matters e^−θ times as much.
pub(super) fn decay(problem: &Problem<'_>) -> [f64; 2] {
    problem.stiffness().map(|a| (1.0 + 0.5 / a).acosh())
}

impl Reach {
    /// Strips so wide that what lies beyond matters by [`BEYOND`] at most, or a few nodes and a coarse lattice.
    pub fn of(problem: &Problem<'_>, decomposition: &Decomposition) -> Self {
        let width = Self::alone(problem, decomposition);
        let lattice = decomposition.lattice();
        let time = problem.dt / problem.equation.relaxation.over(problem.dt);
        if lattice.periodic() == [true; 2] && time >= 1.0 {
            // nothing holds a mesh on periodic axes but where it was, which matters by 1/(1 + ℓ²) only: any rough error
            // shifts it, and neither strips nor coarse lattices see that
            return Self { width: 1, coarse: 0 };
        }
        if width > WIDE { FEW } else { Self { width, coarse: 1 } }
    }

    /// Nodes of a strip for which what lies beyond matters by [`BEYOND`] at most.
    pub fn alone(problem: &Problem<'_>, decomposition: &Decomposition) -> usize {
        let decay = decay(problem);
        let divided = (0..2).filter(|&d| decomposition.is_divided(d));
        // casts of floats saturate
        divided.map(|d| (-BEYOND.ln() / decay[d]).ceil() as usize).fold(1, usize::max)
    }
}

impl Strips {
    /// Strips around the cuts of a decomposition.
    pub fn new(decomposition: &Decomposition) -> Self {
        let reach = Reach { width: 0, coarse: 1 };
        let (decomposition, owner) = (decomposition.clone(), Vec::new());
        Self { decomposition, reach, parts: Vec::new(), owner, coarse: None, whole: None }
    }

    /// The subdomains.
    pub(super) fn decomposition(&self) -> &Decomposition {
        &self.decomposition
    }

    /// Nodes that the subdomain with the most to read reads from its neighbours in one exchange.
    pub fn read(&self) -> usize {
        let lattice = self.decomposition.lattice();
        self.parts.iter().map(|part| part.read(lattice)).max().unwrap_or(0)
    }

    /// Unknowns of the lattice that is solved whole, whose right-hand sides are gathered in an exchange; 0 where there
    /// is none.
    pub fn gathered(&self) -> usize {
        let whole = self.whole.as_ref().map_or(0, |whole| whole.patch.len());
        self.coarse.as_ref().map_or(whole, Coarse::len)
    }

    /// What depends on the lattice and the reach alone: kept from step to step.
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

    /// As many exchanges as are asked for; without a number one, and more only while the last correction says that more
    /// than a hundredth of the shortest edge may be left.
    pub(super) fn correct(
        &mut self,
        problem: &Problem<'_>,
        reach: Reach,
        local: Local,
        exchanges: Option<usize>,
    ) -> Result<Corrected, Failure> {
        self.prepare(reach);
        if let Some(coarse) = &mut self.coarse {
            coarse.prepare(problem)?;
        }
        let mesh = problem.mesh;
        let limit = LEFT * mesh.shortest_edge();
        let none = vec![[0.0; 2]; mesh.x().len()];
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
            found.residual = residual(problem.operator, mesh.x(), &found.base, jump(mesh));
            self.exchange(problem, local, &mut found)?;
            found.exchanges += 1;
            let change = found.correction.as_flattened().iter().fold(0.0, |m, &c| larger(m, c));
            if found.exchanges > 1 {
                // later exchanges gain less than the first: what is left is what they see worst
                found.left = change;
            }
            let done = match exchanges {
                Some(n) => found.exchanges >= n,
                None => {
                    // what is not finite has not shrunk either
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

    /// Influence of what lies beyond the strips, about.
    fn beyond(&self, problem: &Problem<'_>) -> f64 {
        let decay = decay(problem);
        let divided = (0..2).filter(|&d| self.decomposition.is_divided(d));
        divided.map(|d| (-decay[d] * self.reach.width as f64).exp()).fold(0.0, f64::max)
    }

    /// What the coarse lattice is off by, as a share of the largest correction, about: the extrapolation changed the
    /// share s, the term in H², and the next one goes with its square: ten times that was seen on case B from 81² to
    /// 321² nodes.
    fn left_by_coarse(&self, s: f64) -> f64 {
        let narrow = self.reach.width < 2 * self.reach.coarse;
        let doubtful = narrow || !self.coarse.as_ref().is_some_and(Coarse::knows_its_error);
        (30.0 * s * s).clamp(if doubtful { LEFT_IN_DOUBT } else { 0.0 }, 1.0)
    }

    fn exchange(&mut self, problem: &Problem<'_>, local: Local, found: &mut Corrected) -> Result<(), Failure> {
        let lattice = problem.mesh.lattice();
        let size = size(problem.mesh);
        let mut guess = vec![[0.0; 2]; lattice.len()];
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
        let corrected = parallel::map_mut(&mut self.parts, |part| {
            part.prepare(problem.operator, residual);
            part.start(lattice, &guess);
            part.correct(local, size)
        });
        for (part, corrected) in self.parts.iter().zip(corrected) {
            found.work += corrected?;
            part.own.iter().for_each(|&(node, place)| found.correction[node] = part.correction[place]);
        }
        let change = found.correction.as_flattened().iter().fold(0.0, |m, &c| larger(m, c));
        let share = changed.map_or(1.0, |share| self.left_by_coarse(share));
        found.left = if self.whole.is_some() { 0.0 } else { self.beyond(problem) * change * share };
        Ok(())
    }

    /// True where nothing moves but for round-off.
    pub(super) fn rest(&self) -> bool {
        self.parts.iter().all(|part| part.rests)
    }

    /// The part that answers for a node.
    pub(super) fn owner(&self, node: usize) -> Option<usize> {
        self.owner.get(node).map(|&part| part as usize).filter(|&part| part < self.parts.len())
    }

    /// The correction of a node as a part sees it: its own on itself and the nearer half of its strip, beyond which its
    /// strip does not see enough; none there.
    pub(super) fn seen(&self, part: usize, node: usize) -> Option<[f64; 2]> {
        let part = &self.parts[part];
        let margin = self.reach.width - 1 - self.reach.width / 2;
        part.correction.get(place(&part.patch, self.decomposition.lattice(), node, margin)?).copied()
    }
}

fn add(x: &mut [[f64; 2]], c: &[[f64; 2]]) {
    x.iter_mut().zip(c).for_each(|(x, c)| (0..2).for_each(|k| x[k] += c[k]));
}
