use crate::error::{Failure, Result, Unfit};
use crate::geometry::{Cells, Density, DualCells, Mesh, check_unfolded, dot, length};
use crate::kept::{check_nodal, nodal};
use crate::meshing::{Relaxation, STEPS_TO_BEGIN_WITH};
use crate::numerics::difference::{Metrics, derivative, scaled_gradient};
use crate::numerics::{ends, larger, sum};
use serde::{Deserialize, Serialize};

/// What a mover carries from step to step: how the mesh was going, and how fast it may follow
///
/// The density is frozen at the nodes over a step, so that a mesh that follows too fast overshoots, and turns back in
/// the next step. How slow is slow enough depends on how thin the layer is in cells, so the mover looks at itself: with
/// e = xⁿ⁺¹ − x* the correction of a step, and c the cosine between it and the one before,
///
/// ```text
/// c = Σ eⁿ·eⁿ⁻¹ / √(Σ |eⁿ|² Σ |eⁿ⁻¹|²)
///
/// c < −0.1:  τ ← min(1.3 τ, 10⁵ Δt),  v ← √(1 + c) v
/// c > 0.5:   τ ← max(0.97 τ, 15 Δt)
/// c > 0.9:   τ ← max(0.9 τ, 15 Δt)
/// ```
///
/// where τ is the mover's to choose ([`Relaxation::Auto`]); a τ that is given stays, and v with it. Corrections below a
/// hundredth of the shortest edge, the error that the mesh equation is solved to, change nothing. In a domain with a
/// chart nodes go in the unit box: velocities and corrections are those of their parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Gait<const D: usize = 2> {
    #[serde(with = "nodal")]
    velocity: Vec<[f64; D]>,
    #[serde(with = "nodal")]
    correction: Vec<[f64; D]>,
    steps: f64,
    /// Share of the recent steps in which the mesh turned back: a running mean with the weight [`REMEMBERED`] on the
    /// past.
    unrest: f64,
    /// The density that moved the mesh last, a mean over steps; none before the first.
    rho: Option<Density>,
    /// The last step; none before the first.
    last: Option<Last<D>>,
}

/// The last step of a mesh, from which the next one finds how the solution moves.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Last<const D: usize> {
    /// Length of the last mesh step in time.
    took: f64,
    /// Displacement of each node in the last mesh step.
    #[serde(with = "nodal")]
    way: Vec<[f64; D]>,
    /// What the mesh follows at the start of the last mesh step: all unknowns of a node, node by node.
    u: Vec<f64>,
}

/// A mesh turns back where the cosine between its last two corrections is below this.
const TURNS_BACK: f64 = -0.1;
/// A mesh goes on where the cosine between its last two corrections is above this.
const GOES_ON: f64 = 0.5;
/// τ is multiplied by this where a step turns back.
const SLOWER: f64 = 1.3;
/// τ is multiplied by this where a step goes on.
const FASTER: f64 = 0.97;
/// τ is multiplied by this where a step goes straight on.
const MUCH_FASTER: f64 = 0.9;
/// A mesh goes straight on where the cosine between its last two corrections is above this.
const GOES_STRAIGHT_ON: f64 = 0.9;
/// Smallest and largest number of time steps in a τ that the mover chooses.
const STEPS: [f64; 2] = [15.0, 1e5];
/// Corrections below this share of the shortest edge are the error of the mesh equation's solver: they change nothing,
/// and have no direction that the next one could go on in or turn back from.
const SOLVED_TO: f64 = 1e-2;
/// In a step that is longer than this multiple of the last one, nodes go no farther at the learnt velocity than in a
/// step of this multiple. A step after one that was done in halves is twice as long as these.
const LONGER: f64 = 2.5;
/// Corrections below this share of the shortest edge are too small to do harm, and do not count as turning back.
const SEEN: f64 = 0.1;
/// Weight of the past in the running mean of how often the mesh turned back.
const REMEMBERED: f64 = 0.8;
/// Weight of the newest density in the one that moves the mesh; the rest is that of the last step.
const NEWEST: f64 = 0.7;
/// Largest distance by which the shift of the solution and the mean way of the nodes may differ in a step, as a share
/// of the box: differences tell of no larger shift.
const FARTHEST: f64 = 0.25;
/// An axis tells nothing of a shift along it if its part of the squared gradients of the unknowns is below this share
/// of the whole; both axes together do not if the determinant is below this share.
const SINGULAR: f64 = 1e-3;
/// The mesh goes along with the solution where the shift leaves at most the first share of the change of each unknown,
/// and not at all where it leaves the second share or more.
const LEFT: [f64; 2] = [0.5, 0.8];
/// An unknown whose range is below this share of its largest value is constant but for rounding.
const ROUNDING: f64 = 1e-9;
/// Shares of the learnt velocity that are tried in turn until no cell folds.
const SHARES: [f64; 3] = [1.0, 0.5, 0.25];

impl<const D: usize> Gait<D> {
    /// The gait of a mesh that has stood still so far.
    pub fn at_rest(mesh: &Mesh<D>) -> Self {
        let still = vec![[0.0; D]; mesh.x().len()];
        let steps = STEPS_TO_BEGIN_WITH;
        Self { velocity: still.clone(), correction: still, steps, unrest: 0.0, rho: None, last: None }
    }

    /// Velocity with which each node is predicted to go on.
    pub fn velocity(&self) -> &[[f64; D]] {
        &self.velocity
    }

    /// From the predicted mesh of the last step to the one that it led to, node by node; zeros before the first.
    pub fn correction(&self) -> &[[f64; D]] {
        &self.correction
    }

    /// τ in time steps, where the mover chooses it.
    pub fn steps(&self) -> f64 {
        self.steps
    }

    /// True where most of the last steps turned back by more than the mesh equation is solved to.
    pub fn is_restless(&self) -> bool {
        self.unrest > 0.5
    }

    /// The density that is to move the mesh: where it is predicted, mixed with the one that moved it last. On the
    /// flanks of thin layers mesh and density would otherwise take turns from step to step.
    pub(crate) fn mixed(&self, rho: &Density, relaxation: Relaxation) -> Density {
        let last = self.rho.as_ref().filter(|last| last.largest().len() == rho.largest().len());
        match last.filter(|_| relaxation.prediction() != 0.0) {
            Some(last) => rho.mixed(NEWEST, last),
            None => rho.clone(),
        }
    }

    /// What is known after a step from the `predicted` mesh to `mesh`, which was moved by the density `rho`; `u` is
    /// what the mesh followed at the start, `gain` is γ over this step, `share` how much of the velocity is kept, and
    /// `chooses` is true where τ is chosen by the mover.
    pub(super) fn after(
        &self,
        predicted: &Predicted<D>,
        mesh: &Mesh<D>,
        (rho, u): (Density, Vec<f64>),
        [gain, share]: [f64; 2],
        dt: f64,
        chooses: bool,
    ) -> Self {
        let mesh = mesh.parameters();
        let pairs = mesh.x().iter().zip(predicted.mesh.parameters().x());
        let correction: Vec<[f64; D]> = pairs.map(|(x, from)| std::array::from_fn(|d| x[d] - from[d])).collect();
        let mut velocity = predicted.velocity.clone();
        for (v, e) in velocity.iter_mut().zip(&correction) {
            (0..D).for_each(|d| v[d] = share * (v[d] + gain * e[d] / dt));
        }
        let mut steps = self.steps;
        let [most, before] = [&correction, &self.correction].map(|e| e.iter().map(|e| length(*e)).fold(0.0, larger));
        let edge = mesh.shortest_edge();
        let c = if most.min(before) > SOLVED_TO * edge { cosine(&correction, &self.correction) } else { 0.0 };
        let turned = c < TURNS_BACK && most > SEEN * edge;
        let unrest = REMEMBERED * self.unrest + if turned { 1.0 - REMEMBERED } else { 0.0 };
        if chooses {
            if c < TURNS_BACK {
                steps = (SLOWER * steps).min(STEPS[1]);
                let left = (1.0 + c).max(0.0).sqrt();
                velocity.iter_mut().flatten().for_each(|v| *v *= left);
            } else if c > GOES_ON {
                let faster = if c > GOES_STRAIGHT_ON { MUCH_FASTER } else { FASTER };
                steps = (faster * steps).max(STEPS[0]);
            }
        }
        let ways = predicted.velocity.iter().zip(&correction);
        let way = ways.map(|(v, e)| std::array::from_fn(|d| dt * v[d] + e[d])).collect();
        Self { velocity, correction, steps, unrest, rho: Some(rho), last: Some(Last { took: dt, way, u }) }
    }

    /// The velocity with which u, what the mesh follows, moves as a whole along periodic axes, 0 along others
    ///
    /// Where u is carried along at c, what a node finds changes by δu = (d − c Δt)·∇u over a step in which it goes by
    /// d: c is the best fit to the last step. Nothing else decides on a rigid shift of a periodic mesh, which leaves
    /// any density as equidistributed as it was. Unknowns that do not go along would be swept over: as much of c counts
    /// as leaves each of them less change than there is at a place at rest.
    fn drift(&self, mesh: &Mesh<D>, u: &[f64]) -> [f64; D]
    where
        Mesh<D>: Cells<D>,
    {
        let periodic = mesh.lattice().periodic();
        let Some(Last { took, way, u: before }) = self.last.as_ref().filter(|last| last.u.len() == u.len()) else {
            return [0.0; D];
        };
        let (nodes, cells) = (mesh.x().len(), DualCells::new(mesh));
        let metrics = Metrics::new(mesh);
        // lengths in uniform cells, unknowns in units of their ranges
        let extent = mesh.extent();
        let h: [f64; D] = std::array::from_fn(|d| extent[d] / mesh.lattice().cells()[d] as f64);
        let unknowns: Vec<Vec<Seen<D>>> = (0..u.len() / nodes)
            .filter_map(|c| {
                let of = |values: &[f64]| values.iter().skip(c).step_by(u.len() / nodes).copied().collect::<Vec<f64>>();
                let (u, before) = (of(u), of(before));
                let [low, high] = ends(u.iter().copied());
                let range = (high - low > ROUNDING * low.abs().max(high.abs())).then_some(high - low)?;
                let middle: Vec<f64> = u.iter().zip(&before).map(|(a, b)| 0.5 * (a + b) / range).collect();
                let found = |k: usize, g: [f64; D]| dot(way[k], g) - (u[k] - before[k]) / range;
                let gradient = metrics.gradient(&middle);
                let seen = |(k, g): (usize, [f64; D])| (std::array::from_fn(|d| g[d] * h[d]), found(k, g));
                Some(gradient.into_iter().enumerate().map(seen).collect())
            })
            .collect();
        // normal equations of Σ A (g·s − (d·g − δu))²
        let (mut matrix, mut right) = ([[0.0; D]; D], [0.0; D]);
        for unknown in &unknowns {
            for ((own, found), area) in unknown.iter().zip(cells.areas()) {
                for d in 0..D {
                    right[d] += area * own[d] * found;
                    (0..D).for_each(|e| matrix[d][e] += area * own[d] * own[e]);
                }
            }
        }
        let shift = shift(matrix, right, periodic);
        let kept = unknowns.iter().map(|unknown| along(unknown, shift, cells.areas())).fold(1.0, f64::min);
        std::array::from_fn(|d| {
            let mean = sum(way.iter().map(|way| way[d])) / way.len() as f64;
            match periodic[d] {
                true => (kept * shift[d] * h[d]).clamp(mean - FARTHEST * extent[d], mean + FARTHEST * extent[d]) / took,
                false => 0.0,
            }
        })
    }

    /// Refuses the gait of a mesh over another lattice.
    ///
    /// # Errors
    /// [`Unfit::Damaged`].
    pub fn check(&self, mesh: &Mesh<D>) -> Result<(), Unfit> {
        let nodes = mesh.lattice().len();
        check_nodal("velocity", &self.velocity, nodes)?;
        check_nodal("correction", &self.correction, nodes)?;
        if let Some(rho) = &self.rho {
            rho.check(mesh).map_err(|failure| Unfit::Damaged(failure.to_string()))?;
        }
        if let Some(Last { took, way, u }) = &self.last {
            check_nodal("last way", way, nodes)?;
            if u.is_empty() || u.len() % nodes != 0 || u.iter().any(|u| !u.is_finite()) {
                return Err(Unfit::Damaged(format!("its solution before has {} values for {nodes} nodes", u.len())));
            }
            if !(took.is_finite() && *took > 0.0) {
                return Err(Unfit::Damaged(format!("its last mesh step is {took} long")));
            }
        }
        match [self.steps, 1.0 + self.unrest].iter().all(|v| v.is_finite() && *v > 0.0) {
            true => Ok(()),
            false => Err(Unfit::Damaged("its mesh cannot have gone so".into())),
        }
    }
}

/// At a node, for an unknown: its gradient per uniform cell, g, and the change d·∇u − δu that it would have had at a
/// place at rest.
type Seen<const D: usize> = ([f64; D], f64);

/// How far an unknown goes along with a shift s: 1 where what is left of its change, √(Σ A (g·s − f)²), is small beside
/// that at a place at rest, √(Σ A f²), with the areas A of all nodes, and 0 where it is not.
fn along<const D: usize>(unknown: &[Seen<D>], shift: [f64; D], areas: &[f64]) -> f64 {
    let of = |left: &dyn Fn(&Seen<D>) -> f64| {
        sum(unknown.iter().zip(areas).map(|(node, area)| area * left(node).powi(2))).sqrt()
    };
    let (riding, resting) = (of(&|(g, found)| dot(*g, shift) - found), of(&|(_, found)| *found));
    if riding == 0.0 {
        return 1.0;
    }
    ((LEFT[1] - riding / resting) / (LEFT[1] - LEFT[0])).clamp(0.0, 1.0)
}

/// The solution of the normal equations of a shift along the periodic axes; 0 along axes that tell nothing of it.
fn shift<const D: usize>(mut matrix: [[f64; D]; D], mut right: [f64; D], periodic: [bool; D]) -> [f64; D] {
    let trace = (1..D).fold(matrix[0][0], |sum, d| sum + matrix[d][d]);
    // u that hardly changes along an axis tells nothing of a shift there
    let told: [bool; D] = std::array::from_fn(|d| periodic[d] && matrix[d][d] > SINGULAR * trace);
    for d in (0..D).filter(|&d| !told[d]) {
        (right[d], matrix[d]) = (0.0, std::array::from_fn(|e| if e == d { 1.0 } else { 0.0 }));
        (0..D).filter(|&e| e != d).for_each(|e| matrix[e][d] = 0.0);
    }
    let (scaled, determinant) = scaled_gradient(matrix, right);
    let axes = told.into_iter().filter(|told| *told).count();
    // nor does u that hardly changes along a line, but across it
    let singular = axes > 1 && determinant <= SINGULAR * trace.powi(axes as i32);
    std::array::from_fn(|d| match singular {
        true => right[d] / trace,
        false => scaled[d] / determinant,
    })
}

/// The cosine between two fields of vectors; 0 where one of them is zero.
fn cosine<const D: usize>(a: &[[f64; D]], b: &[[f64; D]]) -> f64 {
    let product = |a: &[[f64; D]], b: &[[f64; D]]| sum(a.iter().zip(b).map(|(a, b)| dot(*a, *b)));
    // lengths may be of any unit
    let norm = |a: &[[f64; D]]| product(a, a).sqrt();
    let size = norm(a) * norm(b);
    if size > 0.0 { product(a, b) / size } else { 0.0 }
}

/// On periodic axes the velocity of the mesh as a whole is that of what it follows, `drift`
///
/// The nodes of a periodic mesh may run through what they follow for ever, v = x_ξ δ, and stay equidistributed: nothing
/// brings them back, and a prediction that learns from them would make them run ever faster. The part of v − drift
/// along x_ξ, by its mean over the nodes, is taken out.
fn go_along<const D: usize>(mesh: &Mesh<D>, velocity: &mut [[f64; D]], drift: [f64; D]) {
    let (lattice, jump) = (mesh.lattice(), mesh.jump());
    for d in (0..D).filter(|&d| lattice.periodic()[d]) {
        let along = derivative(lattice, mesh.x(), d, jump[d]);
        let pairs = velocity.iter().zip(&along);
        let shares = pairs.map(|(v, a)| dot(std::array::from_fn(|d| v[d] - drift[d]), *a) / dot(*a, *a));
        let mean = sum(shares) / velocity.len() as f64;
        velocity.iter_mut().zip(&along).for_each(|(v, a)| (0..D).for_each(|d| v[d] -= mean * a[d]));
    }
}

/// The mesh as it would go on by itself, from which the mesh equation then starts.
#[derive(Debug, Clone)]
pub(crate) struct Predicted<const D: usize> {
    pub mesh: Mesh<D>,
    velocity: Vec<[f64; D]>,
    /// τ in time steps, as in the gait.
    steps: f64,
}

impl<const D: usize> Predicted<D> {
    /// Where a mesh is after `dt`; the same mesh where the gain is 0.
    pub(super) fn after(mesh: &Mesh<D>, gait: &Gait<D>, u: &[f64], gain: f64, dt: f64) -> Result<Self, Failure>
    where
        Mesh<D>: Cells<D>,
    {
        let (mut going, places) = (gait.velocity.clone(), mesh.parameters());
        // corrections are as large in short steps as in long ones: what was learnt from them says nothing of a much
        // longer one
        if let Some(last) = gait.last.as_ref().filter(|last| dt > LONGER * last.took) {
            going.iter_mut().flatten().for_each(|v| *v *= LONGER * last.took / dt);
        }
        if gain > 0.0 && mesh.lattice().periodic().contains(&true) {
            go_along(places, &mut going, gait.drift(places, u));
        }
        for share in SHARES.into_iter().filter(|_| gain > 0.0) {
            let velocity: Vec<[f64; D]> = going.iter().map(|v| v.map(|v| share * v)).collect();
            let moved = places.x().iter().zip(&velocity).map(|(x, v)| std::array::from_fn(|d| x[d] + dt * v[d]));
            let mesh = mesh.placed(moved.collect())?;
            if check_unfolded(&mesh).is_ok() {
                return Ok(Self { mesh, velocity, steps: gait.steps });
            }
        }
        Ok(Self { mesh: mesh.clone(), velocity: vec![[0.0; D]; gait.velocity.len()], steps: gait.steps })
    }

    /// τ in units of time, where `scale` is the time step of which it may be a multiple.
    pub(super) fn tau(&self, relaxation: Relaxation, scale: f64) -> f64 {
        match relaxation {
            Relaxation::Auto => self.steps * scale,
            given => given.over(scale),
        }
    }
}
