use crate::error::{Failure, Result, Unfit};
use crate::geometry::{Cells, DualCells, Mesh, check_unfolded, diagonal, dot, length};
use crate::kept::{check_nodal, nodal};
use crate::meshing::{Relaxation, STEPS_TO_BEGIN_WITH};
use crate::numerics::difference::{Metrics, derivative, scaled_gradient};
use crate::numerics::sum;
use serde::{Deserialize, Serialize};

/// What a mover carries from step to step: how the mesh was going, and how fast it may follow
///
/// The density is frozen at the nodes over a step, so that a mesh that follows too fast overshoots, and turns back in
/// the next step. How slow is slow enough depends on how thin the layer is in cells, so the mover looks at itself: with
/// e = xⁿ⁺¹ − x* the correction of a step, and c the cosine between it and the one before,
///
/// ```text
/// c = Σ eⁿ·eⁿ⁻¹ / √(Σ |eⁿ|² Σ |eⁿ⁻¹|²),    c < −0.1:  τ ← 1.3 τ,  v ← √(1 + c) v;    c > 0.5:  τ ← max(0.97 τ, 15 Δt)
/// ```
///
/// Corrections within what the mesh equation is solved to, a hundredth of the shortest edge, change nothing.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Gait<const D: usize = 2> {
    #[serde(with = "nodal")]
    velocity: Vec<[f64; D]>,
    #[serde(with = "nodal")]
    correction: Vec<[f64; D]>,
    steps: f64,
    /// How much of the last steps turned back: a mean that forgets.
    unrest: f64,
    /// The density that moved the mesh last: a mean over steps.
    rho: Vec<f64>,
    /// The last step; none before the first.
    last: Option<Last<D>>,
}

/// A step of a mesh, for what the next one finds of its density.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Last<const D: usize> {
    took: f64,
    /// Where each node went.
    #[serde(with = "nodal")]
    way: Vec<[f64; D]>,
    /// What the mesh follows, at its start: the unknowns of each node after those of the one before.
    u: Vec<f64>,
}

/// Cosines below this are of a mesh that turns back.
const TURNS_BACK: f64 = -0.1;
/// Cosines above this are of a mesh that still has some way to go.
const GOES_ON: f64 = 0.5;
/// What τ is multiplied by, with each step that turns back and that goes on.
const SLOWER: f64 = 1.3;
const FASTER: f64 = 0.97;
/// The same with each step that goes where the last one went.
const MUCH_FASTER: f64 = 0.9;
const GOES_STRAIGHT_ON: f64 = 0.9;
/// The fewest and the most time steps in τ.
const STEPS: [f64; 2] = [15.0, 1e5];
/// Corrections below this share of the shortest edge are of the solver.
const SOLVED_TO: f64 = 1e-2;
/// A step so many times longer than the last one goes no farther at the velocity that was learnt.
const LONGER: f64 = 1.5;
/// Corrections below this share of the shortest edge do no harm.
const SEEN: f64 = 0.1;
/// Share of the earlier steps in the mean over the last ones.
const REMEMBERED: f64 = 0.8;
/// Share of the newest density in the one that moves the mesh.
const NEWEST: f64 = 0.7;
/// The farthest that u and the mesh have come apart in a step, as a share of the box: what differences can tell.
const FARTHEST: f64 = 0.25;
/// Share of the squared gradient, and of its determinant, below which it is of rounding.
const SINGULAR: f64 = 1e-3;
/// A mesh goes along with all unknowns where at most the first share of their changes is left then, and not at all from
/// the second on.
const LEFT: [f64; 2] = [0.5, 0.8];
/// Ranges below this share of the values are of rounding.
const ROUNDING: f64 = 1e-9;
/// Shares of the velocity that are tried: nodes that were made to run into each other stop.
const SHARES: [f64; 3] = [1.0, 0.5, 0.25];

impl<const D: usize> Gait<D> {
    /// Of a mesh that has stood still so far.
    pub fn at_rest(mesh: &Mesh<D>) -> Self {
        let still = vec![[0.0; D]; mesh.x().len()];
        let steps = STEPS_TO_BEGIN_WITH;
        Self { velocity: still.clone(), correction: still, steps, unrest: 0.0, rho: Vec::new(), last: None }
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
    pub(crate) fn mixed(&self, rho: &[f64], relaxation: Relaxation) -> Vec<f64> {
        if relaxation.prediction() == 0.0 || self.rho.len() != rho.len() {
            return rho.to_vec();
        }
        rho.iter().zip(&self.rho).map(|(newest, last)| NEWEST * newest + (1.0 - NEWEST) * last).collect()
    }

    /// After a step from where it was `predicted` to `mesh`, moved by `rho`, from where u was followed; `gain` is γ
    /// over this step, `share` how much of the velocity is kept, and `chooses` is true where τ is the mover's own.
    pub(super) fn after(
        &self,
        predicted: &Predicted<D>,
        mesh: &Mesh<D>,
        [rho, u]: [Vec<f64>; 2],
        [gain, share]: [f64; 2],
        dt: f64,
        chooses: bool,
    ) -> Self {
        let pairs = mesh.x().iter().zip(predicted.mesh.x());
        let correction: Vec<[f64; D]> = pairs.map(|(x, from)| std::array::from_fn(|d| x[d] - from[d])).collect();
        let mut velocity = predicted.velocity.clone();
        for (v, e) in velocity.iter_mut().zip(&correction) {
            (0..D).for_each(|d| v[d] = share * (v[d] + gain * e[d] / dt));
        }
        let mut steps = self.steps;
        let most = correction.iter().map(|e| length(*e)).fold(0.0, f64::max);
        let edge = mesh.shortest_edge();
        let c = if most > SOLVED_TO * edge { cosine(&correction, &self.correction) } else { 0.0 };
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
        Self { velocity, correction, steps, unrest, rho, last: Some(Last { took: dt, way, u }) }
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
                let [low, high] = u.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], u| [l.min(*u), h.max(*u)]);
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

    /// Refuses what is none of a mesh with so many nodes.
    ///
    /// # Errors
    /// [`Unfit::Damaged`].
    pub fn check(&self, nodes: usize) -> Result<(), Unfit> {
        check_nodal("velocity", &self.velocity, nodes)?;
        check_nodal("correction", &self.correction, nodes)?;
        if !self.rho.is_empty() {
            check_nodal("last density", self.rho.as_chunks::<1>().0, nodes)?;
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
        match self.rho.iter().all(|rho| *rho > 0.0)
            && [self.steps, 1.0 + self.unrest].iter().all(|v| v.is_finite() && *v > 0.0)
        {
            true => Ok(()),
            false => Err(Unfit::Damaged("its mesh cannot have gone so".into())),
        }
    }
}

/// Of an unknown at a node: its gradient per uniform cell, g, and what it would have changed by at a place at rest, as
/// f = d·∇u − δu.
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
    let (lattice, jump) = (mesh.lattice(), diagonal(mesh.extent()));
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
    /// Of the gait.
    steps: f64,
}

impl<const D: usize> Predicted<D> {
    /// Where a mesh is after `dt`; the same mesh where the gain is 0.
    pub(super) fn after(mesh: &Mesh<D>, gait: &Gait<D>, u: &[f64], gain: f64, dt: f64) -> Result<Self, Failure>
    where
        Mesh<D>: Cells<D>,
    {
        let mut going = gait.velocity.clone();
        // corrections are as large in short steps as in long ones: what was learnt from them says nothing of a much
        // longer one
        if let Some(last) = gait.last.as_ref().filter(|last| dt > LONGER * last.took) {
            going.iter_mut().flatten().for_each(|v| *v *= LONGER * last.took / dt);
        }
        if gain > 0.0 && mesh.lattice().periodic().contains(&true) {
            go_along(mesh, &mut going, gait.drift(mesh, u));
        }
        for share in SHARES.into_iter().filter(|_| gain > 0.0) {
            let velocity: Vec<[f64; D]> = going.iter().map(|v| v.map(|v| share * v)).collect();
            let moved = mesh.x().iter().zip(&velocity).map(|(x, v)| std::array::from_fn(|d| x[d] + dt * v[d]));
            let mesh = mesh.moved(moved.collect())?;
            if check_unfolded(&mesh).is_ok() {
                return Ok(Self { mesh, velocity, steps: gait.steps });
            }
        }
        Ok(Self { mesh: mesh.clone(), velocity: vec![[0.0; D]; gait.velocity.len()], steps: gait.steps })
    }

    /// τ where it is measured in time steps of `scale`.
    pub(super) fn tau(&self, relaxation: Relaxation, scale: f64) -> f64 {
        match relaxation {
            Relaxation::Auto => self.steps * scale,
            given => given.over(scale),
        }
    }
}
