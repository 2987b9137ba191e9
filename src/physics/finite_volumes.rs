//! Conservation laws on the dual cells of a moving mesh.

use super::{Motion, check_finite};
use crate::error::Failure;
use crate::geometry::{DualCells, Mesh, padded};
use crate::numerics::larger;
use crate::numerics::linear::{BlockMatrix, LinearSolver, RobustTransport};
use crate::parallel;
use crate::work::Work;
use std::borrow::Cow;

/// A conservation law for B unknowns: u_t + ∇·F(u) = ∇·(D(u)∇u) + S(u, x, t)
///
/// Fluxes at a face are functions of what [`nodes`](Self::nodes) computes for its two nodes, and are differentiated by
/// the unknowns there.
pub(super) trait Law<const B: usize>: Sync {
    /// What is computed once for each node: its values and those of formulas.
    type Node: Copy + Send + Sync;
    /// Newton's method has converged once, after at least one step, every residual is below this share of the size of
    /// its unknown. It is far below the error of a time step.
    const TOLERANCE: f64 = 1e-6;

    /// Names of the unknowns, for messages.
    fn names(&self) -> [&'static str; B];
    /// The data of the nodes at all places of padded vectors.
    fn nodes(&self, t: f64, x: &[[f64; 2]], u: &[[f64; B]]) -> Vec<Self::Node>;
    /// Refuses node data that are not finite; the failure names the place.
    fn check(&self, _mesh: &Mesh<2>, _u: &[[f64; B]], _nodes: &[Self::Node]) -> Result<(), Failure> {
        Ok(())
    }
    /// F·N through a face with normal N.
    fn convection(&self, below: &Self::Node, above: &Self::Node, normal: [f64; 2]) -> Crossing<B>;
    /// D at a face.
    fn diffusivity(&self, below: &Self::Node, above: &Self::Node) -> Crossing<B>;
    /// S at a node and its derivative; none for an equation without a source.
    fn source(&self, _node: &Self::Node) -> Option<([f64; B], Block<B>)> {
        None
    }
    /// The unknowns that are given on bounded sides; for the others the flux through the sides is zero.
    fn side(&self, t: f64, x: [f64; 2]) -> [Option<f64>; B];
}

/// Derivatives of B equations by B unknowns.
pub(super) type Block<const B: usize> = [[f64; B]; B];

/// A flux at a face for each equation, and its derivatives by the unknowns at the nodes below and above.
#[derive(Debug, Clone, Copy)]
pub(super) struct Crossing<const B: usize> {
    pub value: [f64; B],
    pub by_below: Block<B>,
    pub by_above: Block<B>,
}

/// Steps of a conservation law on a moving mesh
///
/// ```text
/// (A u)ⁿ⁺¹ − (A u)ⁿ + Σ ½ (g(uⁿ, meshⁿ) + g(uⁿ⁺¹, meshⁿ⁺¹)) = ½ Δt ((A S)ⁿ + (A S)ⁿ⁺¹)
/// g = Δt (F·N − D ∇u·N) − s (u_i + u_k)/2,   ∇u·N = (|N|² (u_k − u_i) − (d·t) (u_b − u_a)) / J
/// ```
///
/// where the sum is over the faces of a dual cell, N is the normal of a face and t the vector along it from a to b, d =
/// x_k − x_i, J = d·N, s is the area that the face sweeps between the meshes, and u_a and u_b are the means of the four
/// nodes around its ends. What leaves a cell enters its neighbour, and a constant stays constant on any moving mesh.
/// The scheme is Crank–Nicolson in time, solved by Newton's method with the exact Jacobian.
#[derive(Debug, Clone)]
pub(super) struct FiniteVolumes<const B: usize> {
    solver: RobustTransport<B>,
    /// The newest mesh with its dual cells, on which the next step starts.
    newest: Option<(Mesh<2>, DualCells)>,
}

impl<const B: usize> Default for FiniteVolumes<B> {
    fn default() -> Self {
        Self { solver: RobustTransport::default(), newest: None }
    }
}

/// Newton steps after which a time step is given up.
const MAX_NEWTON: usize = 20;
/// Newton's method is given up once residuals are larger than this multiple of those at its start.
const DIVERGED: f64 = 10.0;

/// One face in one half of a time step: g/2, its derivatives, and the weight of u_b − u_a in it.
#[derive(Debug, Clone, Copy)]
struct Face<const B: usize> {
    crossing: Crossing<B>,
    tangent: [f64; B],
}

/// A node on a bounded side: its index, its place in padded vectors, and the values given there.
struct Side<const B: usize> {
    i: usize,
    k: usize,
    given: [Option<f64>; B],
}

/// One of the two meshes of a time step, with its half of the fluxes.
struct Half<'a> {
    dt: f64,
    t: f64,
    mesh: &'a Mesh<2>,
    cells: &'a DualCells,
    /// Positions, padded.
    x: &'a [[f64; 2]],
    swept: &'a [[f64; 2]],
}

impl<const B: usize> FiniteVolumes<B> {
    /// The solution on the new mesh, with one value for each node and unknown.
    pub fn step<L: Law<B>>(
        &mut self,
        law: &L,
        motion: Motion<'_>,
        start: &[[f64; B]],
    ) -> Result<(Vec<[f64; B]>, Work), Failure> {
        let Motion { t, dt, old, new } = motion;
        let lattice = new.lattice();
        let old_cells = match self.newest.take() {
            Some((mesh, cells)) if mesh == *old => cells,
            _ => DualCells::new(old),
        };
        let cells = DualCells::new(new);
        let swept = old_cells.swept(&cells);
        let [width, height] = new.extent();
        let [x_old, x_new] = [old, new].map(|mesh| padded(lattice, mesh.x(), [[width, 0.0], [0.0, height]]));
        let mut u = padded(lattice, start, [[0.0; B]; 2]);
        let before = Half { dt, t, mesh: old, cells: &old_cells, x: &x_old, swept: &swept };
        let known = before.known(law, &u)?;

        // given values are set from the start
        let sides = sides(law, t + dt, new);
        for side in &sides {
            for (u, given) in u[side.k].iter_mut().zip(side.given) {
                *u = given.unwrap_or(*u);
            }
        }
        repeat_sides(cells.patch(), &mut u);
        let after = Half { dt, t: t + dt, mesh: new, cells: &cells, x: &x_new, swept: &swept };
        let Solved { residual, work, stalled } = self.newton(law, &after, &known, &sides, &mut u)?;

        let mut values = vec![[0.0; B]; cells.patch().len()];
        for (i, k) in cells.patch().places().enumerate() {
            values[i] = u[k];
        }
        // an unknown that is given nowhere has no flux through the sides
        settle(&cells, &residual, &mut values, |c| sides.iter().all(|side| side.given[c].is_none()));
        check_finite(law.names(), new, &values)?;
        self.newest = Some((new.clone(), cells));
        stalled.map_or(Ok((values, work)), Err)
    }

    /// Newton's method for the padded values `u` at the end of a time step, from what is `known` of its beginning.
    fn newton<L: Law<B>>(
        &mut self,
        law: &L,
        half: &Half<'_>,
        known: &[[f64; B]],
        sides: &[Side<B>],
        u: &mut [[f64; B]],
    ) -> Result<Solved<B>, Failure> {
        let patch = *half.cells.patch();
        let seen = inside(half.mesh, half.x);
        // unknowns may differ much in size, and one that is 0 takes the size of its first change
        let mut sizes = largest_of(u);
        let mut size = sizes.into_iter().fold(f64::MIN_POSITIVE, larger);
        let mut matrix = BlockMatrix::<2, 9, B>::zero_blocks(patch);
        let mut residual = vec![[0.0; B]; patch.len()];
        let mut work = Work::default();
        // where the flux through a cell in a step is large, round-off alone leaves residuals above the tolerance
        let (mut round_off, tolerance) = (16.0 * f64::EPSILON, L::TOLERANCE);
        let mut at_first = f64::INFINITY;
        let stalled = loop {
            let nodes = law.nodes(half.t, &seen, u);
            law.check(half.mesh, u, &nodes)?;
            let faces = half.faces(law, &nodes, u);
            half.residual(law, (&nodes, &faces), known, u, &mut residual);
            for side in sides {
                for (residual, given) in residual[side.i].iter_mut().zip(side.given) {
                    *residual = if given.is_some() { 0.0 } else { *residual };
                }
            }
            let largest = largest_of(&residual);
            let iterations = work.newton_iterations;
            if iterations == 0 {
                size = largest.into_iter().fold(size, larger);
                sizes = std::array::from_fn(|c| larger(sizes[c], largest[c]).max(f64::EPSILON * size));
            }
            let overall = (0..B).fold(0.0, |m, c| larger(m, largest[c] / sizes[c]));
            at_first = if iterations == 0 { overall } else { at_first };
            // at least one Newton step is done: small changes, if left out, would add up over many time steps
            let share = if iterations == 0 { 0.0 } else { tolerance };
            let wanted: [f64; B] = std::array::from_fn(|c| (share * sizes[c]).max(round_off * size));
            if (0..B).all(|c| largest[c] <= wanted[c]) {
                break None;
            }
            if iterations == MAX_NEWTON || overall > DIVERGED * at_first || !largest.iter().all(|r| r.is_finite()) {
                let over = |c: &usize| largest[*c] / wanted[*c];
                let c = (0..B).max_by(|a, b| over(a).total_cmp(&over(b))).unwrap_or(0);
                break Some(Failure::NewtonStalled { residual: largest[c], tolerance: wanted[c], iterations });
            }
            half.matrix(law, (&nodes, &faces), sides, &mut matrix);
            let stiffest = matrix.rows.iter().fold(0.0, |m, row| larger(m, row[0][0][0]));
            round_off = 16.0 * f64::EPSILON * stiffest;
            let mut correction = vec![[0.0; B]; patch.padded_len()];
            // Newton's method squares the residual, so that a much more accurate linear solve is wasted
            let share = overall.min(1.0);
            let enough = std::array::from_fn(|c| {
                let newton = (0.01 * largest[c] * share).max(0.1 * tolerance * sizes[c]);
                newton.min(1e-3 * largest[c]).max(0.1 * round_off * size)
            });
            work += self.solver.solve(&matrix, &residual, &mut correction, enough)?;
            work.newton_iterations += 1;
            for (u, correction) in u.as_flattened_mut().iter_mut().zip(correction.as_flattened()) {
                *u += correction;
            }
            repeat_sides(&patch, u);
        };
        Ok(Solved { residual, work, stalled })
    }
}

/// Where Newton's method ended.
struct Solved<const B: usize> {
    residual: Vec<[f64; B]>,
    work: Work,
    /// Why it did not converge, where it did not.
    stalled: Option<Failure>,
}

/// The largest absolute value of each unknown.
fn largest_of<const B: usize>(values: &[[f64; B]]) -> [f64; B] {
    std::array::from_fn(|c| values.iter().fold(0.0, |m, value| larger(m, value[c])))
}

/// The nodes on bounded sides, and the values given there at time t.
fn sides<const B: usize, L: Law<B>>(law: &L, t: f64, mesh: &Mesh<2>) -> Vec<Side<B>> {
    let m = mesh.lattice().nodes()[1];
    let side = |i: usize| Side { i, k: (i / m + 1) * (m + 2) + i % m + 1, given: law.side(t, mesh.image(mesh.x()[i])) };
    mesh.lattice().sides().map(side).collect()
}

/// Positions in the box, where those beyond a periodic side are replaced by their images.
fn inside<'a>(mesh: &Mesh<2>, x: &'a [[f64; 2]]) -> Cow<'a, [[f64; 2]]> {
    match mesh.lattice().periodic() {
        [false, false] => Cow::Borrowed(x),
        _ => Cow::Owned(x.iter().map(|x| mesh.image(*x)).collect()),
    }
}

/// For each unknown without a flux through the sides, adds the mean of the remaining residual to all values: sums are
/// then conserved to round-off, whatever the tolerance of Newton's method.
fn settle<const B: usize>(
    cells: &DualCells,
    residual: &[[f64; B]],
    values: &mut [[f64; B]],
    closed: impl Fn(usize) -> bool,
) {
    let area = crate::numerics::sum(cells.areas().iter().copied());
    for c in (0..B).filter(|&c| closed(c)) {
        let left = crate::numerics::sum(cells.areas().iter().zip(residual).map(|(area, r)| area * r[c])) / area;
        values.iter_mut().for_each(|value| value[c] += left);
    }
}

/// Nodes and faces of one half of a time step, as a law sees them.
type Seen<'a, N, const B: usize> = (&'a [N], &'a [[Face<B>; 2]]);

impl Half<'_> {
    /// What the beginning of a time step contributes to each dual cell: A (u + ½ Δt S) less half of what leaves it.
    fn known<const B: usize, L: Law<B>>(&self, law: &L, u: &[[f64; B]]) -> Result<Vec<[f64; B]>, Failure> {
        let nodes = law.nodes(self.t, &inside(self.mesh, self.x), u);
        law.check(self.mesh, u, &nodes)?;
        let faces = self.faces(law, &nodes, u);
        let mut known = vec![[0.0; B]; self.cells.patch().len()];
        self.for_each_node(&mut known, |known, i, k| {
            let (leaving, area) = (self.leaving(&faces, k), self.cells.areas()[i]);
            let source = self.source(law, &nodes[k]);
            *known = std::array::from_fn(|c| area * (u[k][c] + source[c]) - leaving[c]);
        });
        Ok(known)
    }

    /// The residual of the equations at the end of a time step, divided by the areas of the cells.
    fn residual<const B: usize, L: Law<B>>(
        &self,
        law: &L,
        (nodes, faces): Seen<'_, L::Node, B>,
        known: &[[f64; B]],
        u: &[[f64; B]],
        residual: &mut [[f64; B]],
    ) {
        self.for_each_node(residual, |residual, i, k| {
            let (leaving, area) = (self.leaving(faces, k), self.cells.areas()[i]);
            let source = self.source(law, &nodes[k]);
            *residual = std::array::from_fn(|c| (known[i][c] - leaving[c]) / area - (u[k][c] - source[c]));
        });
    }

    /// The derivative of −[`residual`](Self::residual) by u, and the identity for values that are given.
    fn matrix<const B: usize, L: Law<B>>(
        &self,
        law: &L,
        (nodes, faces): Seen<'_, L::Node, B>,
        sides: &[Side<B>],
        matrix: &mut BlockMatrix<2, 9, B>,
    ) {
        self.for_each_node(&mut matrix.rows, |row, i, k| {
            *row = self.row(faces, i, k);
            if let Some((_, derivative)) = law.source(&nodes[k]) {
                add(&mut row[0], -0.5 * self.dt, &derivative);
            }
        });
        for side in sides {
            let row = &mut matrix.rows[side.i];
            fold_sides(self.mesh.lattice().beyond(side.i), row);
            for c in (0..B).filter(|&c| side.given[c].is_some()) {
                row.iter_mut().for_each(|block| block[c] = [0.0; B]);
                row[0][c][c] = 1.0;
            }
        }
    }

    /// ½ Δt S at a node.
    fn source<const B: usize, L: Law<B>>(&self, law: &L, node: &L::Node) -> [f64; B] {
        law.source(node).map_or([0.0; B], |(s, _)| s.map(|s| 0.5 * self.dt * s))
    }

    /// Calls `each` with the entry of every node, its index and its place in padded vectors, in parallel by rows.
    fn for_each_node<T: Send>(&self, entries: &mut [T], each: impl Fn(&mut T, usize, usize) + Sync) {
        let patch = self.cells.patch();
        let n = patch.pencil_len();
        parallel::for_each_row(entries, n, |p, entries| {
            for (entry, (i, k)) in entries.iter_mut().zip((p * n..).zip(patch.pencil(p)..)) {
                each(entry, i, k);
            }
        });
    }

    /// All faces, each stored with the node below it. Those on bounded sides have no flux.
    fn faces<const B: usize, L: Law<B>>(&self, law: &L, nodes: &[L::Node], u: &[[f64; B]]) -> Vec<[Face<B>; 2]> {
        let patch = self.cells.patch();
        let ([n, m], wraps) = (patch.size, patch.wraps);
        let s = m + 2;
        let nothing = Crossing { value: [0.0; B], by_below: [[0.0; B]; B], by_above: [[0.0; B]; B] };
        let mut faces = vec![[Face { crossing: nothing, tangent: [0.0; B] }; 2]; u.len()];
        parallel::for_each_row(&mut faces, s, |p, row| {
            if p == 0 || p > n {
                return;
            }
            for (q, faces) in row.iter_mut().enumerate().take(m + 1).skip(1) {
                let k = p * s + q;
                if p < n || wraps[0] {
                    let ends = [k + 1, k + s + 1, k - 1, k + s - 1].map(|k| &u[k]);
                    faces[0] = self.face(law, nodes, u, k, k + s, 0, ends);
                }
                if q < m || wraps[1] {
                    let ends = [k - s, k - s + 1, k + s, k + s + 1].map(|k| &u[k]);
                    faces[1] = self.face(law, nodes, u, k, k + 1, 1, ends);
                }
            }
        });
        patch.wrap(&mut faces);
        faces
    }

    /// The face between two places; `ends` holds the nodes around its end b, then those around its end a.
    #[inline(always)]
    #[allow(clippy::too_many_arguments)] // what a face is made of
    fn face<const B: usize, L: Law<B>>(
        &self,
        law: &L,
        nodes: &[L::Node],
        u: &[[f64; B]],
        i: usize,
        k: usize,
        axis: usize,
        ends: [&[f64; B]; 4],
    ) -> Face<B> {
        let ([nx, ny], swept) = (self.cells.normals()[i][axis], self.swept[i][axis]);
        let d = [0, 1].map(|c| self.x[k][c] - self.x[i][c]);
        let half = 0.5 * self.dt;
        let scale = half / (d[0] * nx + d[1] * ny);
        let (across, along) = (scale * (nx * nx + ny * ny), 0.25 * scale * (d[0] * ny - d[1] * nx));
        let passing = law.convection(&nodes[i], &nodes[k], [nx, ny]);
        let spread = law.diffusivity(&nodes[i], &nodes[k]);
        let mut face = Face { crossing: passing, tangent: [0.0; B] };
        let Crossing { value, by_below, by_above } = &mut face.crossing;
        for c in 0..B {
            let slope = across * (u[k][c] - u[i][c]) + along * ((ends[0][c] + ends[1][c]) - (ends[2][c] + ends[3][c]));
            value[c] = half * value[c] - spread.value[c] * slope - 0.25 * swept * (u[i][c] + u[k][c]);
            for e in 0..B {
                by_below[c][e] = half * by_below[c][e] - spread.by_below[c][e] * slope;
                by_above[c][e] = half * by_above[c][e] - spread.by_above[c][e] * slope;
            }
            by_below[c][c] += spread.value[c] * across - 0.25 * swept;
            by_above[c][c] -= spread.value[c] * across + 0.25 * swept;
            face.tangent[c] = -spread.value[c] * along;
        }
        face
    }

    /// The sum of the fluxes out of the dual cell of a place, in this half of the step.
    #[inline(always)]
    fn leaving<const B: usize>(&self, faces: &[[Face<B>; 2]], k: usize) -> [f64; B] {
        let [right, left, top, bottom] = self.around(faces, k);
        std::array::from_fn(|c| {
            (right.crossing.value[c] - left.crossing.value[c]) + (top.crossing.value[c] - bottom.crossing.value[c])
        })
    }

    /// The faces of a dual cell: above and below along ξ, above and below along η.
    fn around<'f, const B: usize>(&self, faces: &'f [[Face<B>; 2]], k: usize) -> [&'f Face<B>; 4] {
        let s = self.cells.patch().size[1] + 2;
        [&faces[k][0], &faces[k - s][0], &faces[k][1], &faces[k - 1][1]]
    }

    /// Derivatives of u + (fluxes out)/area by the nine nodes around a place.
    #[inline(always)]
    fn row<const B: usize>(&self, faces: &[[Face<B>; 2]], i: usize, k: usize) -> [Block<B>; 9] {
        let [right, left, top, bottom] = self.around(faces, k);
        let share = 1.0 / self.cells.areas()[i];
        let mut row = [[[0.0; B]; B]; 9];
        for (face, sign, own, other) in
            [(right, share, true, 2), (left, -share, false, 1), (top, share, true, 4), (bottom, -share, false, 3)]
        {
            let Crossing { by_below, by_above, .. } = &face.crossing;
            let (mine, theirs) = if own { (by_below, by_above) } else { (by_above, by_below) };
            add(&mut row[0], sign, mine);
            add(&mut row[other], sign, theirs);
        }
        #[allow(clippy::needless_range_loop)] // c is an equation and an unknown
        for c in 0..B {
            row[0][c][c] += 1.0;
            // the ends b and a of the four faces, as points of the stencil
            for (weight, b, a) in [
                (share * right.tangent[c], [4, 8], [3, 7]),
                (-share * left.tangent[c], [6, 4], [5, 3]),
                (share * top.tangent[c], [1, 6], [2, 8]),
                (-share * bottom.tangent[c], [5, 1], [7, 2]),
            ] {
                b.into_iter().for_each(|point| row[point][c][c] += weight);
                a.into_iter().for_each(|point| row[point][c][c] -= weight);
            }
        }
        row
    }
}

/// Beyond a bounded side the values of the side are repeated, so that couplings to them belong to the nodes on the
/// side.
fn fold_sides<const B: usize>([[left, right], [below, above]]: [[bool; 2]; 2], row: &mut [Block<B>; 9]) {
    let mut fold = |from: usize, to: usize| {
        let block = std::mem::replace(&mut row[from], [[0.0; B]; B]);
        add(&mut row[to], 1.0, &block);
    };
    // the three points beyond each side, as (from, to)
    for (beyond, points) in [
        (left, [(1, 0), (5, 3), (6, 4)]),
        (right, [(2, 0), (7, 3), (8, 4)]),
        (below, [(3, 0), (5, 1), (7, 2)]),
        (above, [(4, 0), (6, 1), (8, 2)]),
    ] {
        if beyond {
            points.into_iter().for_each(|(from, to)| fold(from, to));
        }
    }
}

/// Fills the ring: beyond bounded sides with the values on the side, on periodic axes with images.
fn repeat_sides<const B: usize>(patch: &crate::geometry::Patch<2>, u: &mut [[f64; B]]) {
    let [n, m] = patch.size;
    let s = m + 2;
    patch.wrap(u);
    if !patch.wraps[1] {
        for p in 0..n + 2 {
            (u[p * s], u[p * s + m + 1]) = (u[p * s + 1], u[p * s + m]);
        }
    }
    if !patch.wraps[0] {
        u.copy_within(s..2 * s, 0);
        u.copy_within(n * s..(n + 1) * s, (n + 1) * s);
    }
}

#[inline(always)]
fn add<const B: usize>(sum: &mut Block<B>, scale: f64, block: &Block<B>) {
    for (sum, entry) in sum.as_flattened_mut().iter_mut().zip(block.as_flattened()) {
        *sum += scale * entry;
    }
}

#[cfg(test)]
pub(super) mod tests;
