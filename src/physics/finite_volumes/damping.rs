//! What keeps central fluxes from oscillating where cells are too wide for them.

use super::reconstruction::{Places, speeds};
use super::{Block, Crossing, Half, Law, View, sides};
use crate::geometry::{Patch, length};
use crate::numerics::{ends, larger};
use crate::parallel;

/// By how much diffusion through faces is raised, each stored with the node below it, for each unknown
///
/// ```text
/// κ = w θ max(a/2 − D, 0),   −½ ≤ θ = 1 − 2 (u₋ − u_i)/(u_k − u_i) ≤ 1
/// ```
///
/// D (u_k − u_i) is what diffusion brings through a face in half a step, and a the largest absolute eigenvalue of
/// ½ Δt F′·N − ½ s at both nodes and, where a flux is a function of its unknown alone, of the secant between them: a
/// central flux creates no extremum where a ≤ 2 D, which is to say where the cell Péclet number is at most 2. It is at
/// most four times the largest ½ Δt F′·N along the axis: what the mesh alone would sweep over the solution is bounded
/// elsewhere, however short the step is; but for diffusion that [vanishes](Law::vanishing_diffusion) all of it counts. w is that of [`wide`]. u₋ is the limited value at the face on the side of i,
/// from where the flow comes ([`increments`](super::reconstruction::increments)), which passes where D is 0. Where the
/// flow comes from both sides, the larger of both θ counts.
pub(super) struct Damping<const B: usize, const D: usize>(Vec<[[f64; B]; D]>);

/// The mesh may sweep over the solution so many times as fast as this flows.
const SWEEPS: f64 = 4.0;
/// The least θ: less would take away more than half of the diffusion that upwind fluxes have.
const LEAST: f64 = -0.5;

/// How far a cell is too wide for a central flux, from 0 to 1, by its Péclet number a/D, the share of the range of u
/// that its face holds, and the shares that [count](Law::COUNTING).
fn wide(peclet: f64, share: f64, counting: Option<[f64; 2]>) -> f64 {
    let between = |[low, high]: [f64; 2], value: f64| ((value - low) / (high - low)).clamp(0.0, 1.0);
    let steep = if peclet > PECLET { between(STEEP, share) } else { 0.0 };
    let counts = counting.map_or(1.0, |shares| between(shares, share));
    steep.max(counts * between(WIDE, peclet))
}

/// Cell Péclet number above which a central flux may create extrema.
const PECLET: f64 = 2.0;
/// Shares of the range on a face where fluxes begin to be limited and are, if its Péclet number is above that.
const STEEP: [f64; 2] = [0.2, 0.4];
/// Péclet numbers where fluxes begin to be limited and are, however little the face holds.
const WIDE: [f64; 2] = [3.0, 9.0];
/// Differences of u below this share of its size are rounding.
const ROUNDING: f64 = 1e-9;

/// How fast an unknown is carried through a face, in units of [`Damping`].
#[derive(Debug, Clone, Copy, Default)]
struct Speed {
    /// Seen from a face that stays, by the area of the face.
    flow: f64,
    /// Seen from the face.
    relative: f64,
    /// What u_k − u_i counts in g/2 by the law's own flux less the mean of the fluxes of both nodes: where it is
    /// negative, the flux of the law steepens what passes.
    own: f64,
    /// Whether anything comes from below, and from above.
    from: [bool; 2],
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
        let (strides, row) = (patch.padded_strides(), patch.pencil_len() + 2);
        let mut speeds = vec![[[Speed::default(); B]; D]; u.len()];
        parallel::for_each_row(&mut speeds, row, |q, speeds| {
            if patch.pencil_in_row(q).is_none() {
                return;
            }
            for (k, speeds) in (q * row..).zip(speeds).skip(1).take(row - 2) {
                for (axis, stride) in strides.into_iter().enumerate().filter(|&(axis, _)| patch.has_face(k, axis)) {
                    speeds[axis] = self.speeds(law, view, u, [k, k + stride], axis);
                }
            }
        });
        let fastest = |axis: usize, c: usize| speeds.iter().fold(0.0, |m, speeds| larger(m, speeds[axis][c].flow));
        let vanishes = law.vanishing_diffusion();
        let fastest: [[f64; B]; D] = std::array::from_fn(|axis| {
            std::array::from_fn(|c| if vanishes[c] { f64::INFINITY } else { SWEEPS * fastest(axis, c) })
        });
        let ranges: [f64; B] = std::array::from_fn(|c| {
            let [low, high] = ends(u.iter().map(|u| u[c]));
            high - low
        });
        let excess = |k: usize, axis: usize, c: usize, change: f64| {
            let most = fastest[axis][c] * length(self.cells.normals()[k][axis]);
            let (a, enough) = (speeds[k][axis][c].relative.min(most), view.faces[k][axis].diffusion[c]);
            ((0.5 * a - enough) * wide(a / enough.max(0.0), change.abs() / ranges[c], L::COUNTING), a)
        };
        let (lattice, sides) = (self.mesh.lattice(), sides(law, self.t, self.mesh));
        let steps = Places { lattice, patch, x: self.x, sides: &sides, wanted }.increments(u);
        let mut damping = vec![[[0.0; B]; D]; u.len()];
        parallel::for_each_row(&mut damping, row, |q, damping| {
            if patch.pencil_in_row(q).is_none() {
                return;
            }
            for (k, damping) in (q * row..).zip(damping).skip(1).take(row - 2) {
                for (axis, stride) in strides.into_iter().enumerate().filter(|&(axis, _)| patch.has_face(k, axis)) {
                    for c in (0..B).filter(|&c| wanted[c]) {
                        let change = u[k + stride][c] - u[k][c];
                        let (excess, a) = excess(k, axis, c, change);
                        if a > 0.0 && excess > 0.0 && change != 0.0 {
                            let towards = [steps[k][axis][1][c], steps[k + stride][axis][0][c]];
                            damping[axis][c] = speeds[k][axis][c].damping(excess, a, towards.map(|step| step / change));
                        }
                    }
                }
            }
        });
        patch.wrap(&mut damping);
        Damping(damping)
    }

    /// The largest absolute eigenvalue that belongs to each unknown at a face.
    fn speeds<const B: usize, L: Law<B, D>>(
        &self,
        law: &L,
        view: &View<L::Node, B, D>,
        u: &[[f64; B]],
        [i, k]: [usize; 2],
        axis: usize,
    ) -> [Speed; B] {
        let (normal, half, swept) = (self.cells.normals()[i][axis], 0.5 * self.dt, 0.5 * self.swept[i][axis]);
        let (wanted, has_own_flux, area) = (law.damped(), law.has_own_flux(), length(normal));
        let through = [i, k].map(|at| law.convection(&view.nodes[at], &view.nodes[at], normal));
        // relative to nodes that stay, and to those of the mesh
        let [still, moving] = [0.0, swept].map(|swept| {
            [0, 1].map(|end| -> Block<B> {
                let Crossing { by_below, by_above, .. } = &through[end];
                let stored = view.stored.get([i, k][end]).map(|stored| &stored.by_value);
                std::array::from_fn(|c| {
                    std::array::from_fn(|e| {
                        let of_u = if c == e { 1.0 } else { 0.0 };
                        half * (by_below[c][e] + by_above[c][e]) - swept * stored.map_or(of_u, |by| by[c][e])
                    })
                })
            })
        });
        let largest = [&still, &moving].map(|jacobians| speeds(jacobians, wanted));
        let passing = law.convection(&view.nodes[i], &view.nodes[k], normal);
        std::array::from_fn(|c| {
            let change = u[k][c] - u[i][c];
            let counts = change.abs() > ROUNDING * (u[i][c].abs() + u[k][c].abs());
            let slope = |more: f64| if counts { half * more / change } else { 0.0 };
            let own = slope(0.5 * (through[0].value[c] + through[1].value[c]) - passing.value[c]);
            if !has_own_flux[c] || !view.stored.is_empty() {
                let carried: [f64; 2] = std::array::from_fn(|end| moving[end][c][c]);
                let alone = moving.iter().all(|j| (0..B).all(|e| e == c || (j[c][e] == 0.0 && j[e][c] == 0.0)));
                let comes = |sign: f64| !alone || carried.iter().any(|speed| sign * speed > 0.0);
                let from = [comes(1.0), comes(-1.0)];
                return Speed { flow: largest[0][c] / area, relative: largest[1][c], own, from };
            }
            let secant = slope(through[1].value[c] - through[0].value[c]);
            let relative = [moving[0][c][c], moving[1][c][c], secant - swept];
            let from = [relative.iter().any(|speed| *speed > 0.0), relative.iter().any(|speed| *speed < 0.0)];
            Speed {
                flow: larger(largest[0][c], secant) / area,
                relative: larger(largest[1][c], secant - swept),
                own,
                from,
            }
        })
    }
}

impl Speed {
    /// κ, from a/2 − D, a, and (u₋ − u_i)/(u_k − u_i) and (u_k − u₊)/(u_k − u_i).
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

    /// Adds what it takes away from fluxes with values at all places.
    pub fn add_to<N>(&self, view: &mut View<N, B, D>, patch: &Patch<D>, u: &[[f64; B]]) {
        let strides = patch.padded_strides();
        for (k, (faces, damping)) in view.faces.iter_mut().zip(&self.0).enumerate() {
            // behind the last node of all nothing is asked for
            for (axis, stride) in strides.into_iter().enumerate().filter(|(_, stride)| k + stride < u.len()) {
                let Crossing { value, by_below, by_above } = &mut faces[axis].crossing;
                for (c, damping) in damping[axis].iter().enumerate().filter(|(_, damping)| **damping != 0.0) {
                    value[c] -= damping * (u[k + stride][c] - u[k][c]);
                    by_below[c][c] += damping;
                    by_above[c][c] -= damping;
                }
            }
        }
    }
}
