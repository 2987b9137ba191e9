//! What one of the two ends of a step contributes to the equations of a step.

use super::{Around, Block, Crossing, Excess, Face, Half, Law, Side, add, inside};
use crate::error::Failure;
use crate::geometry::dot;
use crate::numerics::linear::BlockMatrix;
use crate::parallel;

/// Nodes and faces of one half of a time step, as a law sees them.
type Seen<'a, N, const B: usize, const D: usize> = (&'a [N], &'a [[Face<B>; D]]);

impl<const D: usize> Half<'_, D> {
    /// What the beginning of a time step contributes to each dual cell: A (u + ½ Δt S) less half of what leaves it.
    pub(super) fn known<const S: usize, const B: usize, L: Law<B, D>>(
        &self,
        law: &L,
        excess: Option<&Excess<B, D, S>>,
        u: &[[f64; B]],
    ) -> Result<Vec<[f64; B]>, Failure>
    where
        Self: Around<D, S>,
    {
        let nodes = law.nodes(self.t, &inside(self.mesh, self.x), u);
        law.check(self.mesh, u, &nodes)?;
        let faces = Around::<D, S>::faces(self, law, &nodes, u);
        let mut known = vec![[0.0; B]; self.cells.patch().len()];
        self.for_each_node(&mut known, |known, i, k| {
            let (leaving, area) = (Around::<D, S>::leaving(self, &faces, k), self.cells.areas()[i]);
            let source = self.source(law, &nodes[k]);
            *known = std::array::from_fn(|c| area * (u[k][c] + source[c]) - leaving[c]);
            if let Some(excess) = excess {
                let more = excess.product(i, k, |n| {
                    let source = self.source(law, &nodes[n]);
                    std::array::from_fn(|c| u[n][c] + source[c])
                });
                (0..B).for_each(|c| known[c] += more[c]);
            }
        });
        Ok(known)
    }

    /// The residual of the equations at the end of a time step, divided by the areas of the cells.
    pub(super) fn residual<const S: usize, const B: usize, L: Law<B, D>>(
        &self,
        law: &L,
        excess: Option<&Excess<B, D, S>>,
        (nodes, faces): Seen<'_, L::Node, B, D>,
        known: &[[f64; B]],
        u: &[[f64; B]],
        residual: &mut [[f64; B]],
    ) where
        Self: Around<D, S>,
    {
        self.for_each_node(residual, |residual, i, k| {
            let (leaving, area) = (Around::<D, S>::leaving(self, faces, k), self.cells.areas()[i]);
            let source = self.source(law, &nodes[k]);
            *residual = std::array::from_fn(|c| (known[i][c] - leaving[c]) / area - (u[k][c] - source[c]));
            if let Some(excess) = excess {
                let more = excess.product(i, k, |n| {
                    let source = self.source(law, &nodes[n]);
                    std::array::from_fn(|c| u[n][c] - source[c])
                });
                (0..B).for_each(|c| residual[c] -= more[c] / area);
            }
        });
    }

    /// The derivative of −[`residual`](Self::residual) by u, and the identity for values that are given.
    pub(super) fn matrix<const S: usize, const B: usize, L: Law<B, D>>(
        &self,
        law: &L,
        excess: Option<&Excess<B, D, S>>,
        (nodes, faces): Seen<'_, L::Node, B, D>,
        sides: &[Side<B>],
        matrix: &mut BlockMatrix<D, S, B>,
    ) where
        Self: Around<D, S>,
    {
        self.for_each_node(&mut matrix.rows, |row, i, k| {
            *row = Around::<D, S>::row(self, faces, i, k);
            if let Some((_, derivative)) = law.source(&nodes[k]) {
                add(&mut row[0], -0.5 * self.dt, &derivative);
            }
            if let Some(excess) = excess {
                excess.add_to_row(row, (i, k), (law, nodes), [self.cells.areas()[i], self.dt]);
            }
        });
        for side in sides {
            let row = &mut matrix.rows[side.i];
            <Self as Around<D, S>>::fold_sides(self.mesh.lattice().beyond(side.i), row);
            for c in (0..B).filter(|&c| side.given[c].is_some()) {
                row.iter_mut().for_each(|block| block[c] = [0.0; B]);
                row[0][c][c] = 1.0;
            }
        }
    }

    /// ½ Δt S at a node.
    pub(super) fn source<const B: usize, L: Law<B, D>>(&self, law: &L, node: &L::Node) -> [f64; B] {
        law.source(node).map_or([0.0; B], |(s, _)| s.map(|s| 0.5 * self.dt * s))
    }

    /// Calls `each` with the entry of every node, its index and its place in padded vectors, in parallel by rows.
    pub(super) fn for_each_node<T: Send>(&self, entries: &mut [T], each: impl Fn(&mut T, usize, usize) + Sync) {
        let patch = self.cells.patch();
        let n = patch.pencil_len();
        parallel::for_each_row(entries, n, |p, entries| {
            for (entry, (i, k)) in entries.iter_mut().zip((p * n..).zip(patch.pencil(p)..)) {
                each(entry, i, k);
            }
        });
    }

    /// The face between two places. `turned` is the part of t in d, and `change` u_b − u_a.
    #[inline(always)]
    #[allow(clippy::too_many_arguments)] // what a face is made of
    pub(super) fn face<const B: usize, L: Law<B, D>>(
        &self,
        law: &L,
        nodes: &[L::Node],
        u: &[[f64; B]],
        [i, k]: [usize; 2],
        axis: usize,
        turned: f64,
        change: impl Fn(usize) -> f64,
    ) -> Face<B> {
        let (normal, swept) = (self.cells.normals()[i][axis], self.swept[i][axis]);
        let half = 0.5 * self.dt;
        let scale = half / dot(self.way(i, k), normal);
        let (across, along) = (scale * dot(normal, normal), 0.25 * scale * turned);
        let passing = law.convection(&nodes[i], &nodes[k], normal);
        let spread = law.diffusivity(&nodes[i], &nodes[k]);
        let (shares, limited) = (law.shares_mass(), law.limited().unknowns);
        let bent = self.stretched.get(i).map_or(0.0, |stretched| stretched[axis] / 24.0);
        let mut face = Face { crossing: passing, tangent: [0.0; B] };
        let Crossing { value, by_below, by_above } = &mut face.crossing;
        for c in 0..B {
            let slope = across * (u[k][c] - u[i][c]) + along * change(c);
            // what carries a limited unknown is done elsewhere
            let (half, swept) = if limited[c] { (0.0, 0.0) } else { (half, swept) };
            value[c] = half * value[c] - spread.value[c] * slope - 0.25 * swept * (u[i][c] + u[k][c]);
            let bent = if shares[c] { bent } else { 0.0 };
            value[c] -= bent * (u[k][c] - u[i][c]);
            for e in 0..B {
                by_below[c][e] = half * by_below[c][e] - spread.by_below[c][e] * slope;
                by_above[c][e] = half * by_above[c][e] - spread.by_above[c][e] * slope;
            }
            by_below[c][c] += spread.value[c] * across - 0.25 * swept + bent;
            by_above[c][c] -= spread.value[c] * across + 0.25 * swept + bent;
            face.tangent[c] = -spread.value[c] * along;
        }
        face
    }

    /// Opens the faces on the sides through which something flows.
    pub(super) fn open<const B: usize, L: Law<B, D>>(
        &self,
        law: &L,
        nodes: &[L::Node],
        u: &[[f64; B]],
        faces: &mut [[Face<B>; D]],
    ) {
        let (lattice, patch) = (self.mesh.lattice(), self.cells.patch());
        let (strides, limited) = (patch.padded_strides(), law.limited().unknowns);
        for &(axis, end) in law.open_sides() {
            for i in lattice.side(axis, end) {
                let k: usize = lattice.node(i).iter().zip(strides).map(|(i, s)| (i + 1) * s).sum();
                // a face is stored with the node below it, which beyond a lower side is one of the ring
                let face = if end == 0 { k - strides[axis] } else { k };
                let sign = if end == 0 { -1.0 } else { 1.0 };
                let normal = self.cells.normals()[face][axis].map(|n| sign * n);
                let place = (self.t, self.mesh.x()[i]);
                let (leaving, by) = law.leaving((axis, end), place, (&nodes[k], &u[k]), normal);
                let share = |c: usize| if limited[c] { 0.0 } else { 0.5 * self.dt * sign };
                let crossing = &mut faces[face][axis].crossing;
                crossing.value = std::array::from_fn(|c| share(c) * leaving[c]);
                let by: Block<B> = std::array::from_fn(|c| by[c].map(|slope| share(c) * slope));
                *(if end == 0 { &mut crossing.by_above } else { &mut crossing.by_below }) = by;
            }
        }
    }

    /// From one place to another.
    #[inline(always)]
    pub(super) fn way(&self, i: usize, k: usize) -> [f64; D] {
        std::array::from_fn(|c| self.x[k][c] - self.x[i][c])
    }
}
