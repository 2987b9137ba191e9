//! Explicit steps that carry unknowns with limited fluxes.

use super::reconstruction::{Places, speeds};
use super::{Around, Block, Half, Law, Limited, Side, inside, sides};
use crate::error::Failure;
use crate::geometry::{Cells, DualCells, Mesh, length, padded};
use crate::numerics::larger;
use crate::physics::Motion;

/// What is carried into and out of dual cells in a step, by fluxes and by the motion of the mesh, without new extrema
///
/// ```text
/// (A u)ⁿ⁺¹ − (A u)ⁿ = −Σ ½ (G(uⁿ) + G(u*)) + R,   (A u*) = (A u)ⁿ − Σ G(uⁿ) + R
/// G = Δt (F(u₋) + F(u₊))·N/2 − s (u₋ + u₊)/2 − a (u₊ − u₋)/2
/// ```
///
/// u₋ and u₊ are the values on both sides of a face that [`increments`] gives, N is the normal of the face, F is taken
/// at its middle, so that flows without divergence keep constants, s is the area that it sweeps, a the largest absolute
/// eigenvalue of Δt F′·N − s, and R what diffusion and sources bring. A time step is divided into explicit ones so
/// short that no node becomes a new extremum of itself and its neighbours by F(u) and by the motion, and second order
/// in time. Nodes move along straight lines; unknowns that are not limited change linearly at each.
///
/// # Source
/// van Leer, *Towards the ultimate conservative difference scheme V* (1979); Gottlieb, Shu and Tadmor, *Strong
/// stability-preserving high-order time discretization methods* (2001), for the method of Heun.
pub(super) struct Transport<'a, const B: usize, const D: usize, L> {
    law: &'a L,
    limited: Limited<B>,
    motion: Motion<'a, D>,
    /// All unknowns at both ends of the step, padded; of limited ones the end is not used.
    ends: [&'a [[f64; B]]; 2],
    /// What diffusion and sources bring to each node in the whole step; empty for nothing.
    brought: &'a [[f64; B]],
}

/// For some shares of a step what is carried into each dual cell up to there, and the number of explicit steps.
type Carried<const B: usize> = (Vec<Vec<[f64; B]>>, usize);

/// The mesh at a share of the step.
struct Stage<const B: usize, const D: usize> {
    share: f64,
    t: f64,
    mesh: Mesh<D>,
    cells: DualCells<D>,
    x: Vec<[f64; D]>,
    sides: Vec<Side<B>>,
}

/// What passes through faces, each stored with the node below it, and the largest Courant number.
struct Passing<const B: usize, const D: usize> {
    faces: Vec<[[f64; B]; D]>,
    /// Largest Courant number of a node: half of the sum of a over its faces, as a share of its dual cell.
    courant: f64,
    /// The largest a/|N|.
    fastest: f64,
}

/// Largest Courant number of an explicit sub-step: what leaves a cell brings in at most twice the difference to the
/// node behind, so that a third of the cell may leave.
const LARGEST_COURANT: f64 = 0.3;
/// Most explicit sub-steps of a time step; where more are needed the step fails.
const MOST_SUBSTEPS: f64 = 2e4;

impl<'a, const B: usize, const D: usize, L: Law<B, D>> Transport<'a, B, D, L>
where
    Mesh<D>: Cells<D>,
{
    pub fn new(law: &'a L, motion: Motion<'a, D>, ends: [&'a [[f64; B]]; 2], brought: &'a [[f64; B]]) -> Self {
        Self { law, limited: law.limited(), motion, ends, brought }
    }

    /// What is carried into each dual cell up to each of some shares of the step, which grow to 1; and the number of
    /// explicit steps.
    #[allow(private_bounds)] // what lies around a face is known to finite volumes alone
    pub fn carried<const S: usize>(&self, shares: &[f64]) -> Result<Carried<B>, Failure>
    where
        for<'b> Half<'b, D>: Around<D, S>,
    {
        let (mut stage, mut count) = (self.stage(0.0)?, 0);
        let first: Vec<f64> = stage.cells.areas().to_vec();
        let places: Vec<usize> = stage.cells.patch().places().collect();
        let mut u = self.ends[0].to_vec();
        let (mut next, speed) = self.longest(&stage, &u)?;
        let mut carried = Vec::new();
        for &share in shares {
            while stage.share < share {
                let left = share - stage.share;
                if left / next > MOST_SUBSTEPS {
                    return Err(Failure::ManySubsteps { substeps: left / next, speed });
                }
                let parts = (left / next).ceil().max(1.0);
                let to = if parts == 1.0 { share } else { stage.share + left / parts };
                let later = self.stage(to)?;
                let (values, courant) = self.substep::<S>(&stage, &later, &u)?;
                let part = to - stage.share;
                next = part * LARGEST_COURANT / courant.max(f64::MIN_POSITIVE);
                // with some room, since the fluxes of the first half decide
                if courant > 1.1 * LARGEST_COURANT {
                    continue;
                }
                (stage, u, count) = (later, values, count + 1);
            }
            let bring = |i: usize, c: usize| self.brought.get(i).map_or(0.0, |brought| share * brought[c]);
            let of = |(i, &k): (usize, &usize)| {
                std::array::from_fn(|c| {
                    let change = stage.cells.areas()[i] * u[k][c] - first[i] * self.ends[0][k][c];
                    if self.limited.unknowns[c] { change - bring(i, c) } else { 0.0 }
                })
            };
            carried.push(places.iter().enumerate().map(of).collect());
        }
        Ok((carried, count))
    }

    fn stage(&self, share: f64) -> Result<Stage<B, D>, Failure> {
        let Motion { t, dt, old, new } = self.motion;
        let mesh = match share {
            0.0 => old.clone(),
            1.0 => new.clone(),
            _ => old.between(new, share)?,
        };
        let (cells, t) = (self.law.cells(&mesh), t + share * dt);
        let x = padded(mesh.lattice(), mesh.x(), mesh.jump());
        let sides = sides(self.law, t, &mesh);
        Ok(Stage { share, t, mesh, cells, x, sides })
    }

    /// The longest explicit step, as a share of the whole, from what is known at its start; and the largest speed.
    fn longest(&self, start: &Stage<B, D>, u: &[[f64; B]]) -> Result<(f64, f64), Failure> {
        let end = self.stage(1.0)?;
        let way = Way::between(start, &end, self.motion.dt);
        let areas: Vec<f64> = start.cells.areas().iter().zip(end.cells.areas()).map(|(a, b)| a.min(*b)).collect();
        let Passing { courant, fastest, .. } = self.passing(start, &way, u, &areas)?;
        Ok((LARGEST_COURANT / courant.max(f64::MIN_POSITIVE), fastest / way.dt))
    }

    /// Heun's method from one stage to a later one: the values, and the courant number at the start.
    fn substep<const S: usize>(
        &self,
        from: &Stage<B, D>,
        to: &Stage<B, D>,
        u: &[[f64; B]],
    ) -> Result<(Vec<[f64; B]>, f64), Failure>
    where
        for<'b> Half<'b, D>: Around<D, S>,
    {
        let part = to.share - from.share;
        let way = Way::between(from, to, part * self.motion.dt);
        let areas: Vec<f64> = from.cells.areas().iter().zip(to.cells.areas()).map(|(a, b)| a.min(*b)).collect();
        let first = self.passing(from, &way, u, &areas)?;
        let there = self.updated::<S>([from, to], u, &[&first.faces]);
        if first.courant > 1.1 * LARGEST_COURANT {
            return Ok((there, first.courant));
        }
        let second = self.passing(to, &way, &there, &areas)?;
        Ok((self.updated::<S>([from, to], u, &[&first.faces, &second.faces]), first.courant))
    }

    /// The values at a later stage by the mean of some fluxes.
    fn updated<const S: usize>(
        &self,
        [from, to]: [&Stage<B, D>; 2],
        u: &[[f64; B]],
        passing: &[&Vec<[[f64; B]; D]>],
    ) -> Vec<[f64; B]>
    where
        for<'b> Half<'b, D>: Around<D, S>,
    {
        let patch = *to.cells.patch();
        let (strides, weight) = (patch.padded_strides(), 1.0 / passing.len() as f64);
        let mut values = u.to_vec();
        for (i, k) in patch.places().enumerate() {
            let leaving = |c: usize| {
                let of = |faces: &Vec<[[f64; B]; D]>| {
                    (0..D).map(|d| faces[k][d][c] - faces[k - strides[d]][d][c]).sum::<f64>()
                };
                weight * passing.iter().map(|faces| of(faces)).sum::<f64>()
            };
            for c in 0..B {
                values[k][c] = if self.limited.unknowns[c] {
                    let brought = self.brought.get(i).map_or(0.0, |brought| (to.share - from.share) * brought[c]);
                    (from.cells.areas()[i] * u[k][c] - leaving(c) + brought) / to.cells.areas()[i]
                } else {
                    self.ends[0][k][c] + to.share * (self.ends[1][k][c] - self.ends[0][k][c])
                };
            }
        }
        for side in &to.sides {
            for c in (0..B).filter(|&c| self.limited.unknowns[c]) {
                values[side.k][c] = side.given[c].unwrap_or(values[side.k][c]);
            }
        }
        <Half<'_, D> as Around<D, S>>::repeat_sides(&patch, &mut values);
        values
    }

    /// What passes through all faces on a way with the values at one of its ends.
    fn passing(
        &self,
        stage: &Stage<B, D>,
        way: &Way<D>,
        u: &[[f64; B]],
        areas: &[f64],
    ) -> Result<Passing<B, D>, Failure> {
        let patch = *stage.cells.patch();
        let strides = patch.padded_strides();
        let (lattice, wanted) = (stage.mesh.lattice(), self.limited.unknowns);
        let steps = Places { lattice, patch, x: &stage.x, sides: &stage.sides, wanted, marked: None }.increments(u);
        let mut faces = vec![[[0.0; B]; D]; u.len()];
        let mut speeds = vec![[0.0; D]; u.len()];
        let seen = inside(&stage.mesh, &stage.x);
        for (axis, stride) in strides.into_iter().enumerate() {
            let above = |k: usize| if patch.has_face(k, axis) { k + stride } else { k };
            let at = |side: usize, k: usize| -> [f64; B] {
                let (here, there) = (&u[k], &u[above(k)]);
                std::array::from_fn(|c| match (self.limited.unknowns[c], side) {
                    (true, 0) => here[c] + steps[k][axis][1][c],
                    (true, _) => there[c] - steps[above(k)][axis][0][c],
                    _ => 0.5 * (here[c] + there[c]),
                })
            };
            let middle = |k: usize| -> [f64; D] {
                match patch.has_face(k, axis) {
                    true => stage.mesh.image(stage.cells.middle(&stage.x, k, axis)),
                    false => seen[k],
                }
            };
            let x: Vec<[f64; D]> = (0..u.len()).map(middle).collect();
            let states = [0, 1].map(|side| (0..u.len()).map(|k| at(side, k)).collect::<Vec<[f64; B]>>());
            let nodes = [0, 1].map(|side| self.law.nodes(stage.t, &x, &states[side]));
            for side in 0..2 {
                self.law.check(&stage.mesh, &states[side], &nodes[side])?;
            }
            for k in (0..u.len()).filter(|&k| patch.has_face(k, axis)) {
                let through = (stage.cells.normals()[k][axis], way.swept[k][axis]);
                let sides = [0, 1].map(|side| (&nodes[side][k], &states[side][k]));
                (faces[k][axis], speeds[k][axis]) = self.flux(sides, through, way.dt);
            }
        }
        patch.wrap(&mut faces);
        patch.wrap(&mut speeds);
        let nodes = if self.law.open_sides().is_empty() { Vec::new() } else { self.law.nodes(stage.t, &seen, u) };
        self.open(stage, way, u, &nodes, &mut faces);
        let of_face = |k: usize, d: usize| speeds[k][d] / length(stage.cells.normals()[k][d]);
        let faces_of = patch.places().flat_map(|k| (0..D).map(move |d| (k, d))).filter(|&(k, d)| patch.has_face(k, d));
        let fastest = faces_of.map(|(k, d)| of_face(k, d)).fold(0.0, larger);
        let around = |k: usize| (0..D).map(|d| 0.5 * (speeds[k][d] + speeds[k - strides[d]][d])).sum::<f64>();
        let courant = patch.places().zip(areas).map(|(k, area)| around(k) / area).fold(0.0, larger);
        Ok(Passing { faces, courant, fastest })
    }

    /// G of the limited unknowns, and the largest a.
    fn flux(
        &self,
        [(below, left), (above, right)]: [(&L::Node, &[f64; B]); 2],
        (normal, swept): ([f64; D], f64),
        dt: f64,
    ) -> ([f64; B], f64) {
        let limited = self.limited.unknowns;
        let passing = self.law.convection(below, above, normal);
        // each is half of the flux of one node
        let shifted = |by: &Block<B>| -> Block<B> {
            std::array::from_fn(|c| std::array::from_fn(|e| 2.0 * dt * by[c][e] - if c == e { swept } else { 0.0 }))
        };
        let jacobians = [&passing.by_below, &passing.by_above].map(shifted);
        let speeds = speeds(&jacobians, limited);
        let flux = std::array::from_fn(|c| {
            if !limited[c] {
                return 0.0;
            }
            let carried = dt * passing.value[c] - 0.5 * swept * (left[c] + right[c]);
            carried - 0.5 * speeds[c] * (right[c] - left[c])
        });
        (flux, speeds.into_iter().fold(0.0, larger))
    }

    /// What leaves through open sides.
    fn open(&self, stage: &Stage<B, D>, way: &Way<D>, u: &[[f64; B]], nodes: &[L::Node], faces: &mut [[[f64; B]; D]]) {
        let (lattice, strides) = (stage.mesh.lattice(), stage.cells.patch().padded_strides());
        for &(axis, end) in self.law.open_sides() {
            let sign = if end == 0 { -1.0 } else { 1.0 };
            for i in lattice.side(axis, end) {
                let k: usize = lattice.node(i).iter().zip(strides).map(|(i, s)| (i + 1) * s).sum();
                // a face is stored with the node below it, which beyond a lower side is one of the ring
                let face = if end == 0 { k - strides[axis] } else { k };
                let normal = stage.cells.normals()[face][axis].map(|n| sign * n);
                let place = (stage.t, stage.mesh.x()[i]);
                let (leaving, _) = self.law.leaving((axis, end), place, (&nodes[k], &u[k]), normal);
                for c in (0..B).filter(|&c| self.limited.unknowns[c]) {
                    faces[face][axis][c] = way.dt * sign * leaving[c];
                }
            }
        }
    }
}

/// The way from one stage to another.
struct Way<const D: usize> {
    dt: f64,
    /// What faces sweep, padded.
    swept: Vec<[f64; D]>,
}

impl<const D: usize> Way<D>
where
    Mesh<D>: Cells<D>,
{
    fn between<const B: usize>(from: &Stage<B, D>, to: &Stage<B, D>, dt: f64) -> Self {
        Self { dt, swept: from.cells.swept(&to.cells) }
    }
}
