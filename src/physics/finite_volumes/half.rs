//! What one of the two ends of a step contributes to the equations of a step.

use super::{Around, Block, Crossing, Excess, Face, Half, Law, Made, Point, Side, Sloped, Steep, View, add, inside};
use crate::error::Failure;
use crate::geometry::{Cells, Mesh, dot};
use crate::numerics::difference::scaled_gradient;
use crate::numerics::linear::BlockMatrix;
use crate::parallel;

impl<const D: usize> Half<'_, D> {
    /// The fluxes, sources and stored quantities of a law for values at all places.
    ///
    /// # Errors
    /// Values that the law refuses.
    pub(super) fn view<const S: usize, const B: usize, L: Law<B, D>>(
        &self,
        law: &L,
        u: &[[f64; B]],
    ) -> Result<View<L::Node, B, D>, Failure>
    where
        Self: Around<D, S>,
    {
        let x = inside(self.mesh, self.x);
        let nodes = law.nodes(self.t, &x, u);
        law.check(self.mesh, u, &nodes)?;
        let stored = law.stored((self.t, &x, u), self.mesh)?;
        let steep = self.steep::<S, B, L>(law, &x, u)?;
        let sloped = match law.has_sloped() {
            false => Vec::new(),
            true => {
                let place = |k: usize| Point { x: x[k], u: u[k], slopes: self.slopes(k, u) };
                let points: Vec<Point<B, D>> = (0..u.len()).map(place).collect();
                law.sloped((self.t, &points), self.mesh)?
            }
        };
        let layers = self.layers(law);
        let made = Made { nodes: &nodes, steep: &steep, layers: &layers, stored: &stored };
        let faces = Around::<D, S>::faces(self, law, &made, u);
        Ok(View { nodes, faces, sloped, stored })
    }

    /// The fluxes by gradients of the faces above all places along each axis; empty where there are none.
    fn steep<const S: usize, const B: usize, L: Law<B, D>>(
        &self,
        law: &L,
        x: &[[f64; D]],
        u: &[[f64; B]],
    ) -> Result<[Vec<Steep<B, D>>; D], Failure>
    where
        Self: Around<D, S>,
    {
        let mut all = [const { Vec::new() }; D];
        if !law.has_steep() {
            return Ok(all);
        }
        let patch = self.cells.patch();
        let strides = patch.padded_strides();
        for (axis, steep) in all.iter_mut().enumerate() {
            let place = |k: usize| {
                if !patch.has_face(k, axis) {
                    return Point { x: x[k], u: u[k], slopes: [[0.0; D]; B] };
                }
                let above = k + strides[axis];
                let ([across, along], change) = (self.duals(k, above, axis), self.change(u, k, axis));
                let slope = |c: usize| -> [f64; D] {
                    let (difference, turn) = (u[above][c] - u[k][c], 0.25 * change[c]);
                    std::array::from_fn(|d| across[d] * difference + along[d] * turn)
                };
                Point {
                    x: self.mesh.image(self.cells.middle(self.x, k, axis)),
                    u: std::array::from_fn(|c| 0.5 * (u[k][c] + u[above][c])),
                    slopes: std::array::from_fn(slope),
                }
            };
            let points: Vec<Point<B, D>> = (0..u.len()).map(place).collect();
            *steep = law.steep((self.t, &points), self.mesh)?;
        }
        Ok(all)
    }

    /// D of the faces above all places along each axis, where it is a function of place; empty where none is.
    fn layers<const B: usize, L: Law<B, D>>(&self, law: &L) -> [Vec<[Option<f64>; B]>; D] {
        let mut all = [const { Vec::new() }; D];
        if law.has_layers() {
            let patch = self.cells.patch();
            for (axis, (layers, s)) in all.iter_mut().zip(patch.padded_strides()).enumerate() {
                let edge = |k: usize| [self.x[k], self.x[if patch.has_face(k, axis) { k + s } else { k }]];
                let edges: Vec<[[f64; D]; 2]> = (0..self.x.len()).map(edge).collect();
                *layers = law.through_layers(self.t, self.mesh, &edges);
            }
        }
        all
    }

    /// The vectors by which ∇u at a face is u_k − u_i times the first and u_b − u_a times the second.
    #[inline(always)]
    fn duals(&self, i: usize, k: usize, axis: usize) -> [[f64; D]; 2] {
        let (d, normal) = (self.way(i, k), self.cells.normals()[i][axis]);
        // along a line, through faces of any area
        if D == 1 {
            return [[1.0 / d[0]; D], [0.0; D]];
        }
        let jacobian = dot(d, normal);
        [normal.map(|n| n / jacobian), std::array::from_fn(|c| if c == 0 { -d[D - 1] } else { d[0] } / jacobian)]
    }

    /// The vectors by which ∇u at a place is the sum over the axes of vector times the difference between the nodes
    /// above and below; beyond bounded sides the node itself counts. Exact for linear u.
    fn slope_weights(&self, k: usize) -> [[f64; D]; D] {
        let strides = self.cells.patch().padded_strides();
        let ways = strides.map(|s| self.way(k - s, k + s));
        let column = |d: usize| {
            let (scaled, determinant) = scaled_gradient(ways, std::array::from_fn(|e| f64::from(u8::from(e == d))));
            scaled.map(|value| value / determinant)
        };
        std::array::from_fn(column)
    }

    /// ∇u of all unknowns at a place; 0 in the ring.
    fn slopes<const B: usize>(&self, k: usize, u: &[[f64; B]]) -> [[f64; D]; B] {
        let patch = self.cells.patch();
        if !patch.is_unknown(k) {
            return [[0.0; D]; B];
        }
        let (strides, weights) = (patch.padded_strides(), self.slope_weights(k));
        std::array::from_fn(|c| {
            std::array::from_fn(|j| (0..D).map(|d| weights[d][j] * (u[k + strides[d]][c] - u[k - strides[d]][c])).sum())
        })
    }

    /// What the beginning of a time step contributes to each dual cell: A (u + ½ Δt S) less half of what leaves it.
    pub(super) fn known<const S: usize, const B: usize, L: Law<B, D>>(
        &self,
        law: &L,
        excess: Option<&Excess<B, D, S>>,
        u: &[[f64; B]],
    ) -> Result<Vec<[f64; B]>, Failure>
    where
        Self: Around<D, S>,
        Mesh<D>: Cells<D>,
    {
        let loads = self.loads(law, u)?;
        let mut view = self.view::<S, B, L>(law, u)?;
        self.damping(law, &view, u).add_to(&mut view, self.cells.patch(), u);
        let algebraic = law.algebraic();
        let mut known = vec![[0.0; B]; self.cells.patch().len()];
        self.for_each_node(&mut known, |known, i, k| {
            let (leaving, area) = (Around::<D, S>::leaving(self, &view.faces, k), self.cells.areas()[i]);
            let (source, stored) = (self.sources(law, &view, k), view.stored(k, &u[k]));
            *known = std::array::from_fn(|c| area * (stored[c] + source[c]) - leaving[c]);
            if let Some(excess) = excess {
                let more = excess.product(i, k, |n| {
                    let source = self.source(law, &view.nodes[n]);
                    std::array::from_fn(|c| u[n][c] + source[c])
                });
                (0..B).for_each(|c| known[c] += more[c]);
            }
            if let Some(load) = loads.get(i) {
                (0..B).for_each(|c| known[c] += load[c]);
            }
            (0..B).filter(|&c| algebraic[c]).for_each(|c| known[c] = 0.0);
        });
        Ok(known)
    }

    /// The residual of the equations at the end of a time step, divided by the areas of the cells.
    pub(super) fn residual<const S: usize, const B: usize, L: Law<B, D>>(
        &self,
        law: &L,
        excess: Option<&Excess<B, D, S>>,
        view: &View<L::Node, B, D>,
        [known, loads]: [&[[f64; B]]; 2],
        u: &[[f64; B]],
        residual: &mut [[f64; B]],
    ) where
        Self: Around<D, S>,
    {
        self.for_each_node(residual, |residual, i, k| {
            let (leaving, area) = (Around::<D, S>::leaving(self, &view.faces, k), self.cells.areas()[i]);
            let (source, stored) = (self.sources(law, view, k), view.stored(k, &u[k]));
            *residual = std::array::from_fn(|c| (known[i][c] - leaving[c]) / area - (stored[c] - source[c]));
            if let Some(excess) = excess {
                let more = excess.product(i, k, |n| {
                    let source = self.source(law, &view.nodes[n]);
                    std::array::from_fn(|c| u[n][c] - source[c])
                });
                (0..B).for_each(|c| residual[c] -= more[c] / area);
            }
            if let Some(load) = loads.get(i) {
                (0..B).for_each(|c| residual[c] += load[c] / area);
            }
        });
    }

    /// The derivative of −[`residual`](Self::residual) by u, and the identity for values that are given.
    pub(super) fn matrix<const S: usize, const B: usize, L: Law<B, D>>(
        &self,
        law: &L,
        excess: Option<&Excess<B, D, S>>,
        view: &View<L::Node, B, D>,
        sides: &[Side<B>],
        matrix: &mut BlockMatrix<D, S, B>,
    ) where
        Self: Around<D, S>,
    {
        self.for_each_node(&mut matrix.rows, |row, i, k| {
            *row = Around::<D, S>::row(self, &view.faces, i, k);
            if let Some((_, derivative)) = law.source(&view.nodes[k]) {
                add(&mut row[0], -0.5 * self.dt, &derivative);
            }
            if let Some(sloped) = view.sloped.get(k) {
                self.add_sloped::<S, B>(row, k, sloped);
            }
            if let Some(stored) = view.stored.get(k) {
                (0..B).for_each(|c| row[0][c][c] -= 1.0);
                add(&mut row[0], 1.0, &stored.by_value);
            }
            if let Some(excess) = excess {
                excess.add_to_row(row, (i, k), (law, &view.nodes), [self.cells.areas()[i], self.dt]);
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

    /// Adds the derivatives of −½ Δt S by the nodes around a place, for a source by gradients.
    fn add_sloped<const S: usize, const B: usize>(&self, row: &mut [Block<B>; S], k: usize, sloped: &Sloped<B, D>) {
        add(&mut row[0], -0.5 * self.dt, &sloped.by_value);
        let weights = self.slope_weights(k);
        for (d, weights) in weights.iter().enumerate() {
            let by: Block<B> = std::array::from_fn(|c| sloped.by_slope[c].map(|by| dot(by, *weights)));
            // in a stencil the nodes below and above along axis d are the points 2d + 1 and 2d + 2
            add(&mut row[2 * d + 2], -0.5 * self.dt, &by);
            add(&mut row[2 * d + 1], 0.5 * self.dt, &by);
        }
    }

    /// ½ Δt of all sources at a place.
    fn sources<const B: usize, L: Law<B, D>>(&self, law: &L, view: &View<L::Node, B, D>, k: usize) -> [f64; B] {
        let source = self.source(law, &view.nodes[k]);
        match view.sloped.get(k) {
            None => source,
            Some(sloped) => std::array::from_fn(|c| source[c] + 0.5 * self.dt * sloped.value[c]),
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
        made: &Made<'_, L::Node, B, D>,
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
        let passing = law.convection(&made.nodes[i], &made.nodes[k], normal);
        let mut spread = law.diffusivity(&made.nodes[i], &made.nodes[k]);
        if let Some(layers) = made.layers[axis].get(i) {
            // of place alone, so that their derivatives are 0
            for (value, layer) in spread.value.iter_mut().zip(layers) {
                *value = layer.unwrap_or(*value);
            }
        }
        let (shares, limited) = (law.shares_mass(), law.limited().unknowns);
        let bent = self.stretched.get(i).map_or(0.0, |stretched| stretched[axis] / 24.0);
        let mut face = Face { crossing: passing, tangent: [[0.0; B]; B], diffusion: [0.0; B] };
        let Crossing { value, by_below, by_above } = &mut face.crossing;
        for c in 0..B {
            let slope = across * (u[k][c] - u[i][c]) + along * change(c);
            // what carries a limited unknown is done elsewhere
            let (half, swept) = if limited[c] { (0.0, 0.0) } else { (half, swept) };
            let stored = |k: usize| made.stored.get(k).map_or(u[k][c], |stored| stored.value[c]);
            value[c] = half * value[c] - spread.value[c] * slope - 0.25 * swept * (stored(i) + stored(k));
            let bent = if shares[c] { bent } else { 0.0 };
            value[c] -= bent * (u[k][c] - u[i][c]);
            for e in 0..B {
                by_below[c][e] = half * by_below[c][e] - spread.by_below[c][e] * slope;
                by_above[c][e] = half * by_above[c][e] - spread.by_above[c][e] * slope;
            }
            face.diffusion[c] = spread.value[c] * across + bent;
            by_below[c][c] += face.diffusion[c];
            by_above[c][c] -= face.diffusion[c];
            for (by, at) in [(&mut *by_below, i), (&mut *by_above, k)] {
                match made.stored.get(at) {
                    None => by[c][c] -= 0.25 * swept,
                    Some(stored) => (0..B).for_each(|e| by[c][e] -= 0.25 * swept * stored.by_value[c][e]),
                }
            }
            face.tangent[c][c] = -spread.value[c] * along;
        }
        if let Some(steep) = made.steep[axis].get(i) {
            self.add_steep([i, k], axis, steep, &mut face);
        }
        face
    }

    /// Adds ½ Δt of a flux by gradients to a face.
    fn add_steep<const B: usize>(&self, [i, k]: [usize; 2], axis: usize, steep: &Steep<B, D>, face: &mut Face<B>) {
        let (half, normal) = (0.5 * self.dt, self.cells.normals()[i][axis]);
        let [across, along] = self.duals(i, k, axis);
        let Crossing { value, by_below, by_above } = &mut face.crossing;
        for c in 0..B {
            value[c] += half * dot(steep.flux[c], normal);
            for e in 0..B {
                let by_value = 0.5 * half * dot(steep.by_value[c][e], normal);
                let by_slope: [f64; D] = steep.by_slope[c][e].map(|by| half * dot(by, normal));
                if c == e {
                    face.diffusion[c] -= dot(by_slope, across);
                }
                by_below[c][e] += by_value - dot(by_slope, across);
                by_above[c][e] += by_value + dot(by_slope, across);
                face.tangent[c][e] += 0.25 * dot(by_slope, along);
            }
        }
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

    /// The vector from one place to another.
    #[inline(always)]
    pub(super) fn way(&self, i: usize, k: usize) -> [f64; D] {
        std::array::from_fn(|c| self.x[k][c] - self.x[i][c])
    }
}
