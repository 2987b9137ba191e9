//! What keeps central fluxes from oscillating where cells are too wide for them.

use super::reconstruction::{Places, speeds};
use super::{Block, Crossing, Half, Law, View, sides};
use crate::geometry::{Patch, dot, length};
use crate::numerics::{ends, larger};
use crate::parallel;

/// Diffusion κ that is added at each face and for each unknown so that a central flux makes no new extremum; stored
/// with the node below the face
///
/// ```text
/// κ = w θ max(a/2 − D, 0),   −½ ≤ θ = 1 − 2 (u₋ − u_i)/(u_k − u_i) ≤ 1
/// ```
///
/// for the face between the nodes i and k. D (u_k − u_i) is what diffusion brings through the face in half a step. a is
/// the largest absolute eigenvalue of ½ Δt F′·N − ½ s at both nodes, with the normal N of the face and the area s that
/// it sweeps; where a flux is a function of its unknown alone, that of the secant between the nodes counts, too. A
/// central flux makes no extremum where a ≤ 2 D, that is, where the cell Péclet number a/D is at most 2.
///
/// a counts at most four times the largest ½ Δt F′·N of the flow itself along the axis, since what the mesh alone
/// sweeps over the solution is bounded elsewhere, however short the step is. For diffusion that
/// [vanishes](Law::vanishing_diffusion) all of a counts.
///
/// w, from 0 to 1, is that of [`wide`]. u₋ is the [limited](super::reconstruction::increments) value at the face on the
/// side from where the flow comes; it is what passes where D is 0. Where the flow comes from both sides the larger θ
/// counts.
pub(super) struct Damping<const B: usize, const D: usize>(Vec<[[Kappa; B]; D]>);

/// κ at a face for one unknown.
#[derive(Debug, Clone, Copy, Default)]
struct Kappa {
    value: f64,
    /// κ with θ = 1, of an upwind flux, or κ itself where that is larger or the flow crosses less than a cell in a
    /// step.
    upwind: f64,
}

/// How a flux with damping is differentiated by u.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Derivative {
    /// With κ as it is: exact where κ stays.
    Frozen,
    /// With the κ of an upwind flux in place of κ where the flow crosses more than a cell in a step: the matrix has no
    /// positive entry beside its diagonal there, and an iteration in which κ follows u converges. With κ itself it does
    /// not from two cells on. Known as defect correction.
    Upwind,
}

/// Largest a in the formula of [`Damping`], as a multiple of the largest ½ Δt F′·N of the flow along the axis: without
/// a limit a mesh that moves fast at the start would smear a solution at rest, however short the step is.
const SWEEPS: f64 = 4.0;
/// Smallest θ in the formula of [`Damping`]: a smaller one would remove more than half of the diffusion that upwind
/// fluxes have.
const LEAST: f64 = -0.5;

/// w, from 0 for cells that are fine enough for central fluxes to 1 for those in which they are limited in full: by the
/// cell Péclet number a/D, by the share of the range of u that the face holds, and by the shares from which that
/// [counts](Law::COUNTING).
fn wide(peclet: f64, share: f64, counting: Option<[f64; 2]>) -> f64 {
    let between = |[low, high]: [f64; 2], value: f64| ((value - low) / (high - low)).clamp(0.0, 1.0);
    let steep = if peclet > PECLET { between(STEEP, share) } else { 0.0 };
    let counts = counting.map_or(1.0, |shares| between(shares, share));
    steep.max(counts * between(WIDE, peclet))
}

/// Cell Péclet number above which a central flux may make extrema.
const PECLET: f64 = 2.0;
/// Change of u over a face, as a share of its range, from which its flux begins to be limited, and from which it is
/// limited in full, if the Péclet number is above [`PECLET`].
const STEEP: [f64; 2] = [0.2, 0.4];
/// Péclet numbers from which a flux begins to be limited, and from which it is limited in full, however little its face
/// holds.
const WIDE: [f64; 2] = [3.0, 9.0];
/// Differences of u below this share of its size are made of rounding.
const ROUNDING: f64 = 1e-9;

/// Speeds with which an unknown is carried through a face, in units of D of [`Damping`].
#[derive(Debug, Clone, Copy, Default)]
struct Speed {
    /// Speed through a face at rest, divided by the area of the face.
    flow: f64,
    /// Speed through the moving face.
    relative: f64,
}

/// How much a face lacks of the diffusion with which a central flux makes no extremum.
#[derive(Debug, Clone, Copy, Default)]
struct Lack {
    /// a of [`Damping`].
    a: f64,
    /// w (a/2 − D).
    excess: f64,
}

/// Where the flow through a face comes from.
struct Origin {
    /// Diffusion that the law's own flux has beside the mean of the fluxes of both nodes: where it is negative, the
    /// law's own flux steepens what passes.
    own: f64,
    /// Whether the flow comes from the node below, and from the node above.
    from: [bool; 2],
}

/// What the nodes on both sides of a face send through it.
struct Sent<const B: usize> {
    /// The fluxes, as if both nodes had the values of one.
    fluxes: [[f64; B]; 2],
    /// Derivatives of ½ Δt times the fluxes.
    still: [Block<B>; 2],
    /// Derivatives of ½ Δt times the fluxes relative to the moving nodes of the mesh.
    moving: [Block<B>; 2],
    /// Half of the area that the face sweeps.
    swept: f64,
}

impl<const D: usize> Half<'_, D> {
    /// The damping by values at all places.
    pub(super) fn damping<const B: usize, L: Law<B, D>>(
        &self,
        law: &L,
        view: &View<L::Node, B, D>,
        u: &[[f64; B]],
    ) -> Damping<B, D> {
        let (patch, wanted) = (*self.cells.patch(), law.damped());
        if !wanted.contains(&true) {
            return Damping::none();
        }
        let lacking = self.lacking(law, view, u);
        let lacks = |k: usize, axis: usize| lacking[k][axis].iter().any(|lack| lack.excess > 0.0);
        let strides = patch.padded_strides();
        let mut marked = vec![[false; D]; u.len()];
        for k in patch.places() {
            marked[k] = std::array::from_fn(|axis| lacks(k, axis) || lacks(k - strides[axis], axis));
        }
        patch.wrap(&mut marked);
        let (lattice, sides) = (self.mesh.lattice(), sides(law, self.t, self.mesh));
        let places = Places { lattice, patch, x: self.x, sides: &sides, wanted, marked: Some(&marked) };
        let steps = places.increments(u);
        let mut damping = vec![[[Kappa::default(); B]; D]; u.len()];
        self.for_each_face(&mut damping, |damping, k, axis| {
            if !lacks(k, axis) {
                return;
            }
            let above = k + strides[axis];
            let origins = self.origins(law, view, u, [k, above], axis);
            for (c, Lack { a, excess }) in lacking[k][axis].into_iter().enumerate() {
                let change = u[above][c] - u[k][c];
                if a > 0.0 && excess > 0.0 && change != 0.0 {
                    let towards = [steps[k][axis][1][c], steps[above][axis][0][c]];
                    let value = origins[c].damping(excess, a, towards.map(|step| step / change));
                    // the flow crosses 2 a/volume cells in a step
                    let volume = dot(self.way(k, above), self.cells.normals()[k][axis]);
                    let upwind = if 2.0 * a > volume { value.max(excess) } else { value };
                    damping[c] = Kappa { value, upwind };
                }
            }
        });
        patch.wrap(&mut damping);
        Damping(damping)
    }

    /// What all faces lack, for the unknowns that are damped.
    fn lacking<const B: usize, L: Law<B, D>>(
        &self,
        law: &L,
        view: &View<L::Node, B, D>,
        u: &[[f64; B]],
    ) -> Vec<[[Lack; B]; D]> {
        let (patch, wanted, vanishes) = (self.cells.patch(), law.damped(), law.vanishing_diffusion());
        let strides = patch.padded_strides();
        let mut speeds = vec![[[Speed::default(); B]; D]; u.len()];
        self.for_each_face(&mut speeds, |speeds, k, axis| {
            *speeds = self.speeds(law, view, u, [k, k + strides[axis]], axis);
        });
        let fastest = |axis: usize, c: usize| speeds.iter().fold(0.0, |m, speeds| larger(m, speeds[axis][c].flow));
        let fastest: [[f64; B]; D] = std::array::from_fn(|axis| {
            std::array::from_fn(|c| if vanishes[c] { f64::INFINITY } else { SWEEPS * fastest(axis, c) })
        });
        let ranges: [f64; B] = std::array::from_fn(|c| {
            let [low, high] = ends(u.iter().map(|u| u[c]));
            high - low
        });
        let mut lacking = vec![[[Lack::default(); B]; D]; u.len()];
        self.for_each_face(&mut lacking, |lacking, k, axis| {
            let area = length(self.cells.normals()[k][axis]);
            for c in (0..B).filter(|&c| wanted[c]) {
                let change = u[k + strides[axis]][c] - u[k][c];
                let a = speeds[k][axis][c].relative.min(fastest[axis][c] * area);
                let enough = view.faces[k][axis].diffusion[c];
                let w = wide(a / enough.max(0.0), change.abs() / ranges[c], L::COUNTING);
                lacking[c] = Lack { a, excess: (0.5 * a - enough) * w };
            }
        });
        patch.wrap(&mut lacking);
        lacking
    }

    /// Calls `each` with the entry of every face above a node, the place of the node and the axis, in parallel by rows.
    fn for_each_face<T: Send>(&self, entries: &mut [[T; D]], each: impl Fn(&mut T, usize, usize) + Sync) {
        let patch = self.cells.patch();
        let row = patch.pencil_len() + 2;
        parallel::for_each_row(entries, row, |q, entries| {
            if patch.pencil_in_row(q).is_none() {
                return;
            }
            for (k, entries) in (q * row..).zip(entries).skip(1).take(row - 2) {
                for (axis, entry) in entries.iter_mut().enumerate().filter(|&(axis, _)| patch.has_face(k, axis)) {
                    each(entry, k, axis);
                }
            }
        });
    }

    /// What the nodes i and k send through the face between them.
    #[inline(always)]
    fn sent<const B: usize, L: Law<B, D>>(
        &self,
        law: &L,
        view: &View<L::Node, B, D>,
        nodes: [usize; 2],
        axis: usize,
    ) -> Sent<B> {
        let [i, _] = nodes;
        let (normal, half, swept) = (self.cells.normals()[i][axis], 0.5 * self.dt, 0.5 * self.swept[i][axis]);
        let through = nodes.map(|at| law.convection(&view.nodes[at], &view.nodes[at], normal));
        let [still, moving] = [0.0, swept].map(|swept| {
            [0, 1].map(|end| -> Block<B> {
                let Crossing { by_below, by_above, .. } = &through[end];
                let stored = view.stored.get(nodes[end]).map(|stored| &stored.by_value);
                std::array::from_fn(|c| {
                    std::array::from_fn(|e| {
                        let of_u = if c == e { 1.0 } else { 0.0 };
                        half * (by_below[c][e] + by_above[c][e]) - swept * stored.map_or(of_u, |by| by[c][e])
                    })
                })
            })
        });
        Sent { fluxes: through.map(|crossing| crossing.value), still, moving, swept }
    }

    /// The slope of a difference of fluxes of an unknown between two values; 0 where these differ by rounding.
    #[inline(always)]
    fn slope(&self, [below, above]: [f64; 2], more: f64) -> f64 {
        let change = above - below;
        let counts = change.abs() > ROUNDING * (below.abs() + above.abs());
        if counts { 0.5 * self.dt * more / change } else { 0.0 }
    }

    /// The largest absolute eigenvalue that belongs to each unknown at a face.
    #[inline(always)]
    fn speeds<const B: usize, L: Law<B, D>>(
        &self,
        law: &L,
        view: &View<L::Node, B, D>,
        u: &[[f64; B]],
        [i, k]: [usize; 2],
        axis: usize,
    ) -> [Speed; B] {
        let (wanted, has_own_flux) = (law.damped(), law.has_own_flux());
        let sent = self.sent(law, view, [i, k], axis);
        let largest = [&sent.still, &sent.moving].map(|jacobians| speeds(jacobians, wanted));
        let area = length(self.cells.normals()[i][axis]);
        std::array::from_fn(|c| {
            let [flow, relative] = largest.map(|largest| largest[c]);
            if !has_own_flux[c] || !view.stored.is_empty() {
                return Speed { flow: flow / area, relative };
            }
            let secant = self.slope([u[i][c], u[k][c]], sent.fluxes[1][c] - sent.fluxes[0][c]);
            Speed { flow: larger(flow, secant) / area, relative: larger(relative, secant - sent.swept) }
        })
    }

    /// Where the flow of each unknown through a face comes from.
    fn origins<const B: usize, L: Law<B, D>>(
        &self,
        law: &L,
        view: &View<L::Node, B, D>,
        u: &[[f64; B]],
        [i, k]: [usize; 2],
        axis: usize,
    ) -> [Origin; B] {
        let has_own_flux = law.has_own_flux();
        let Sent { fluxes, moving, swept, .. } = self.sent(law, view, [i, k], axis);
        let passing = law.convection(&view.nodes[i], &view.nodes[k], self.cells.normals()[i][axis]);
        std::array::from_fn(|c| {
            let slope = |more: f64| self.slope([u[i][c], u[k][c]], more);
            let own = slope(0.5 * (fluxes[0][c] + fluxes[1][c]) - passing.value[c]);
            let carried: [f64; 2] = std::array::from_fn(|end| moving[end][c][c]);
            if !has_own_flux[c] || !view.stored.is_empty() {
                let alone = moving.iter().all(|j| (0..B).all(|e| e == c || (j[c][e] == 0.0 && j[e][c] == 0.0)));
                let comes = |sign: f64| !alone || carried.iter().any(|speed| sign * speed > 0.0);
                return Origin { own, from: [comes(1.0), comes(-1.0)] };
            }
            let relative = [carried[0], carried[1], slope(fluxes[1][c] - fluxes[0][c]) - swept];
            let from = [relative.iter().any(|speed| *speed > 0.0), relative.iter().any(|speed| *speed < 0.0)];
            Origin { own, from }
        })
    }
}

impl Origin {
    /// κ from w (a/2 − D), a, and (u₋ − u_i)/(u_k − u_i) and (u_k − u₊)/(u_k − u_i).
    fn damping(&self, excess: f64, a: f64, towards: [f64; 2]) -> f64 {
        let theta = |end: usize| if self.from[end] { 1.0 - 2.0 * towards[end] } else { LEAST };
        let steepening = (-self.own).max(0.0) * (2.0 * excess / a).min(1.0);
        steepening + excess * theta(0).max(theta(1)).clamp(LEAST, 1.0)
    }
}

impl<const B: usize, const D: usize> Damping<B, D> {
    pub fn none() -> Self {
        Self(Vec::new())
    }

    /// True where the flow crosses more than a cell in a step somewhere, so that κ of the first values leads astray.
    pub fn crosses_cells(&self) -> bool {
        self.0.as_flattened().as_flattened().iter().any(|kappa| kappa.upwind != kappa.value)
    }

    /// Each κ goes the share `share` of the way to that of `other`; from nothing all of it.
    pub fn go_towards(&mut self, other: Self, share: f64) {
        if self.0.is_empty() || share == 1.0 {
            *self = other;
            return;
        }
        for (kappa, other) in
            self.0.as_flattened_mut().as_flattened_mut().iter_mut().zip(other.0.as_flattened().as_flattened())
        {
            kappa.value += share * (other.value - kappa.value);
            kappa.upwind = kappa.upwind.max(other.upwind);
        }
    }

    /// Adds the diffusion to the fluxes of values at all places.
    pub fn add_to<N>(&self, view: &mut View<N, B, D>, patch: &Patch<D>, u: &[[f64; B]]) {
        let strides = patch.padded_strides();
        self.for_each(view, |crossing, (k, axis, c), kappa| {
            // behind the last node of all nothing is asked for
            if let Some(above) = u.get(k + strides[axis]) {
                crossing.value[c] -= kappa.value * (above[c] - u[k][c]);
            }
        });
    }

    /// Adds the derivative of the diffusion to those of the fluxes.
    pub fn add_derivative<N>(&self, view: &mut View<N, B, D>, derivative: Derivative) {
        self.for_each(view, |crossing, (_, _, c), kappa| {
            let kappa = if derivative == Derivative::Upwind { kappa.upwind } else { kappa.value };
            crossing.by_below[c][c] += kappa;
            crossing.by_above[c][c] -= kappa;
        });
    }

    /// Calls `f` with what crosses each face that has a κ, the place below it with its axis and unknown, and κ.
    fn for_each<N>(&self, view: &mut View<N, B, D>, mut f: impl FnMut(&mut Crossing<B>, (usize, usize, usize), Kappa)) {
        for (k, (faces, damping)) in view.faces.iter_mut().zip(&self.0).enumerate() {
            for (axis, (face, damping)) in faces.iter_mut().zip(damping).enumerate() {
                for (c, kappa) in
                    damping.iter().enumerate().filter(|(_, kappa)| kappa.value != 0.0 || kappa.upwind != 0.0)
                {
                    f(&mut face.crossing, (k, axis, c), *kappa);
                }
            }
        }
    }
}
