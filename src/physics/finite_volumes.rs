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
        // formulas hold in the box, so that nodes beyond a periodic side are seen at their images
        let [seen_old, seen_new] = [(old, &x_old), (new, &x_new)].map(|(mesh, x)| inside(mesh, x));
        let patch = *cells.patch();
        let n = patch.pencil_len();
        let places = |p: usize| (p * n..(p + 1) * n).zip(patch.pencil(p)..);

        let mut u = padded(lattice, start, [[0.0; B]; 2]);
        let mut known = vec![[0.0; B]; patch.len()];
        {
            let half = Half { dt, t, cells: &old_cells, x: &x_old, swept: &swept };
            let nodes = law.nodes(t, &seen_old, &u);
            law.check(old, &u, &nodes)?;
            let faces = half.faces(law, &nodes, &u);
            parallel::for_each_row(&mut known, n, |p, known| {
                for (known, (i, k)) in known.iter_mut().zip(places(p)) {
                    let (leaving, area) = (half.leaving(&faces, k), half.cells.areas()[i]);
                    let source = law.source(&nodes[k]).map_or([0.0; B], |(s, _)| s.map(|s| 0.5 * dt * s));
                    *known = std::array::from_fn(|c| area * (u[k][c] + source[c]) - leaving[c]);
                }
            });
        }

        // given values are set from the start
        let s = patch.padded_strides()[0];
        let sides: Vec<Side<B>> = lattice
            .sides()
            .map(|i| Side { i, k: (i / n + 1) * s + i % n + 1, given: law.side(t + dt, new.image(new.x()[i])) })
            .collect();
        for side in &sides {
            for (u, given) in u[side.k].iter_mut().zip(side.given) {
                *u = given.unwrap_or(*u);
            }
        }
        repeat_sides(&patch, &mut u);

        // unknowns may differ much in size, and one that is 0 takes the size of its first change
        let largest_of = |values: &[[f64; B]]| -> [f64; B] {
            std::array::from_fn(|c| values.iter().fold(0.0, |m, value| larger(m, value[c])))
        };
        let mut sizes = largest_of(&u);
        let mut size = sizes.into_iter().fold(f64::MIN_POSITIVE, larger);
        let half = Half { dt, t: t + dt, cells: &cells, x: &x_new, swept: &swept };
        let mut matrix = BlockMatrix::<2, 9, B>::zero_blocks(patch);
        let mut residual = vec![[0.0; B]; patch.len()];
        let mut work = Work::default();
        // where the flux through a cell in a step is large, round-off alone leaves residuals above the tolerance
        let (mut round_off, tolerance) = (16.0 * f64::EPSILON, L::TOLERANCE);
        let mut at_first = f64::INFINITY;
        let stalled = loop {
            let nodes = law.nodes(half.t, &seen_new, &u);
            law.check(new, &u, &nodes)?;
            let faces = half.faces(law, &nodes, &u);
            parallel::for_each_row(&mut residual, n, |p, residual| {
                for (residual, (i, k)) in residual.iter_mut().zip(places(p)) {
                    let (leaving, area) = (half.leaving(&faces, k), half.cells.areas()[i]);
                    let source = law.source(&nodes[k]).map_or([0.0; B], |(s, _)| s.map(|s| 0.5 * dt * s));
                    *residual = std::array::from_fn(|c| (known[i][c] - leaving[c]) / area - (u[k][c] - source[c]));
                }
            });
            for side in &sides {
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
            parallel::for_each_row(&mut matrix.rows, n, |p, rows| {
                for (row, (i, k)) in rows.iter_mut().zip(places(p)) {
                    *row = half.row(&faces, i, k);
                    if let Some((_, derivative)) = law.source(&nodes[k]) {
                        add(&mut row[0], -0.5 * dt, &derivative);
                    }
                }
            });
            for side in &sides {
                let row = &mut matrix.rows[side.i];
                fold_sides(lattice.beyond(side.i), row);
                for c in (0..B).filter(|&c| side.given[c].is_some()) {
                    row.iter_mut().for_each(|block| block[c] = [0.0; B]);
                    row[0][c][c] = 1.0;
                }
            }
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
            repeat_sides(&patch, &mut u);
        };
        let mut values = vec![[0.0; B]; patch.len()];
        for (i, k) in patch.places().enumerate() {
            values[i] = u[k];
        }
        // an unknown that is given nowhere has no flux through the sides
        settle(&cells, &residual, &mut values, |c| sides.iter().all(|side| side.given[c].is_none()));
        check_finite(law.names(), new, &values)?;
        self.newest = Some((new.clone(), cells));
        stalled.map_or(Ok((values, work)), Err)
    }
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

impl Half<'_> {
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
pub(super) mod tests {
    use super::*;
    use crate::geometry::Lattice;
    use crate::physics::{Burgers, BurgersFlux, Convection, Physics};

    /// A mesh of the unit square with every node up to 0.3 cells away from its uniform place, side nodes on their
    /// sides.
    fn random(cells: [usize; 2], periodic: [bool; 2], seed: u64) -> Mesh<2> {
        let mesh = Mesh::uniform(Lattice::new(cells, periodic).unwrap(), [0.0; 2], [1.0; 2]).unwrap();
        let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
        let x = (mesh.x().iter().enumerate()).map(|(k, x)| {
            let sides = mesh.lattice().beyond(k);
            std::array::from_fn(|d| {
                state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                let shift = 0.6 * ((state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5) / cells[d] as f64;
                x[d] + if sides[d].contains(&true) { 0.0 } else { shift }
            })
        });
        mesh.moved(x.collect()).unwrap()
    }

    fn burgers(flux: BurgersFlux, initial: &str, boundary: Option<&str>) -> Burgers {
        let mut burgers = Burgers::new(0.01, Convection::Flux).unwrap().from(initial, boundary).unwrap();
        burgers.flux = flux;
        burgers
    }

    const FLUXES: [BurgersFlux; 3] = [BurgersFlux::Product, BurgersFlux::Energy, BurgersFlux::Central];
    const WAVE: &str = "1.5 + sin(2*pi*x)*cos(2*pi*y)";

    /// Without viscosity, on a random mesh at rest, Σ A ln u changes only by round-off with the product flux, and Σ A
    /// u² with the energy-conserving one; neither does with the other.
    #[test]
    fn each_flux_keeps_its_own_invariant() {
        let mesh = random([13, 17], [true, true], 5);
        let (cells, dt) = (DualCells::new(&mesh), 1.0);
        let x = padded(mesh.lattice(), mesh.x(), [[1.0, 0.0], [0.0, 1.0]]);
        let swept = cells.swept(&cells);
        let rates = |flux: BurgersFlux| -> [f64; 2] {
            let mut law = burgers(flux, WAVE, None);
            law.viscosity = 0.0;
            let u = law.initial(0.0, &mesh);
            let u = padded(mesh.lattice(), u.values().as_chunks::<1>().0, [[0.0]; 2]);
            let half = Half { dt, t: 0.0, cells: &cells, x: &x, swept: &swept };
            let faces = half.faces(&law, &Law::nodes(&law, 0.0, &x, &u), &u);
            let sum = |f: fn(f64) -> f64| cells.patch().places().map(|k| half.leaving(&faces, k)[0] * f(u[k][0])).sum();
            [sum(|u| 1.0 / u), sum(|u| u)]
        };
        let [[log, not_square], [not_log, square]] = [BurgersFlux::Product, BurgersFlux::Energy].map(rates);
        assert!(log.abs() < 1e-14 && square.abs() < 1e-14, "{log:e}, {square:e}");
        assert!(not_square.abs() > 1e-6 && not_log.abs() > 1e-6, "{not_square:e}, {not_log:e}");
    }

    /// On meshes that jump about at random, a constant stays constant, and ∫u changes only by round-off.
    #[test]
    fn random_motion_keeps_constants_and_sums() {
        for (flux, periodic) in
            FLUXES.into_iter().flat_map(|flux| [[true, true], [false, true], [false, false]].map(|p| (flux, p)))
        {
            let all = periodic == [true, true];
            for initial in ["0.7", WAVE] {
                let mut physics = burgers(flux, initial, (!all).then_some(initial));
                let mut mesh = random([9, 12], periodic, 1);
                let mut u = physics.initial(0.0, &mesh);
                let sum = physics.conserved(&mesh, &u);
                for step in 2..8 {
                    let new = random([9, 12], periodic, step);
                    let motion = Motion { t: 0.0, dt: 1e-3, old: &mesh, new: &new };
                    u = physics.step(motion, &u).unwrap().0;
                    mesh = new;
                }
                if initial == "0.7" {
                    let off = u.values().iter().fold(0.0_f64, |m, u| m.max((u - 0.7).abs()));
                    assert!(off < 1e-14, "{flux:?} on {periodic:?}: off by {off:e}");
                }
                let drift = (physics.conserved(&mesh, &u) - sum) / sum;
                assert!(!all || drift.abs() < 1e-14, "{flux:?}: drift {drift:e}");
            }
        }
    }

    /// The order in ε of what a Newton step leaves out
    ///
    /// ```text
    /// max |R(u + ε v) − R(u) − ε J v| = O(ε^order)
    /// ```
    ///
    /// R being the residual at the end of a step, J the matrix of [`FiniteVolumes::step`] and v random: 2 where J is
    /// the derivative, and Newton's method converges quadratically; 1 where an entry of it is wrong.
    pub(in crate::physics) fn order_of_newton<const B: usize, L: Law<B>>(
        law: &L,
        motion: Motion<'_>,
        u: &[[f64; B]],
    ) -> f64 {
        let Motion { t, dt, old, new } = motion;
        let (lattice, [width, height]) = (new.lattice(), new.extent());
        let cells = DualCells::new(new);
        let (patch, swept) = (*cells.patch(), DualCells::new(old).swept(&cells));
        let x = padded(lattice, new.x(), [[width, 0.0], [0.0, height]]);
        let seen = inside(new, &x);
        let half = Half { dt, t: t + dt, cells: &cells, x: &x, swept: &swept };
        let residual = |u: &[[f64; B]]| -> Vec<[f64; B]> {
            let nodes = law.nodes(half.t, &seen, u);
            let faces = half.faces(law, &nodes, u);
            let at = |(i, k): (usize, usize)| {
                let (leaving, area) = (half.leaving(&faces, k), cells.areas()[i]);
                let source = law.source(&nodes[k]).map_or([0.0; B], |(s, _)| s.map(|s| 0.5 * dt * s));
                std::array::from_fn(|c| leaving[c] / area + u[k][c] - source[c])
            };
            patch.places().enumerate().map(at).collect()
        };
        let mut u = padded(lattice, u, [[0.0; B]; 2]);
        repeat_sides(&patch, &mut u);
        let mut state = 7_u64;
        let mut direction = u.clone();
        for value in direction.as_flattened_mut() {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            *value = (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0;
        }
        repeat_sides(&patch, &mut direction);

        let nodes = law.nodes(half.t, &seen, &u);
        let faces = half.faces(law, &nodes, &u);
        let mut matrix = BlockMatrix::<2, 9, B>::zero_blocks(patch);
        for (row, (i, k)) in matrix.rows.iter_mut().zip(patch.places().enumerate()) {
            *row = half.row(&faces, i, k);
            if let Some((_, derivative)) = law.source(&nodes[k]) {
                add(&mut row[0], -0.5 * dt, &derivative);
            }
        }
        lattice.sides().for_each(|i| fold_sides(lattice.beyond(i), &mut matrix.rows[i]));
        let mut product = vec![[0.0; B]; patch.padded_len()];
        matrix.multiply(&direction, &mut product);

        let start = residual(&u);
        let left = |epsilon: f64| {
            let ahead = u.iter().zip(&direction).map(|(u, v)| std::array::from_fn(|c| u[c] + epsilon * v[c]));
            let ahead = residual(&ahead.collect::<Vec<[f64; B]>>());
            let all = patch.places().enumerate().flat_map(|(i, k)| {
                let (start, ahead, product) = (start[i], ahead[i], product[k]);
                (0..B).map(move |c| ahead[c] - start[c] - epsilon * product[c])
            });
            all.fold(0.0, larger)
        };
        (left(4e-3) / left(1e-3)).log(4.0)
    }

    /// With every flux the matrix of Newton's method is the derivative of the residual, on a moving mesh with bounded
    /// and periodic sides: what a step leaves out falls with the square of its length.
    #[test]
    fn newton_converges_quadratically() {
        for (flux, periodic) in FLUXES.into_iter().flat_map(|flux| [[false, true], [true, false]].map(|p| (flux, p))) {
            let [old, new] = [3, 4].map(|seed| random([8, 9], periodic, seed));
            let physics = burgers(flux, WAVE, Some(WAVE));
            let u = physics.initial(0.0, &old);
            let motion = Motion { t: 0.0, dt: 2e-2, old: &old, new: &new };
            let order = order_of_newton(&physics, motion, u.values().as_chunks::<1>().0);
            assert!((order - 2.0).abs() < 0.1, "{flux:?} on {periodic:?}: order {order:.3}");
        }
    }
}
