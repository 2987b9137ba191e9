//! Conservation laws on the dual cells of a moving mesh.

mod line;
mod mass;
mod plane;

use super::{Motion, check_finite};
use crate::error::Failure;
use crate::geometry::{Cells, DualCells, Mesh, Patch, diagonal, dot, padded, strides};
use crate::numerics::larger;
use crate::numerics::linear::{BlockMatrix, LinearSolver, RobustTransport};
use crate::parallel;
use crate::work::Work;
use mass::{Excess, stretched};
use std::borrow::Cow;

/// A conservation law for B unknowns: u_t + ∇·F(u) = ∇·(D(u)∇u) + S(u, x, t)
///
/// Fluxes at a face are functions of what [`nodes`](Self::nodes) computes for its two nodes, and are differentiated by
/// the unknowns there.
pub(super) trait Law<const B: usize, const D: usize = 2>: Sync {
    /// What is computed once for each node: its values and those of formulas.
    type Node: Copy + Send + Sync;
    /// Newton's method has converged once, after at least one step, every residual is below this share of the size of
    /// its unknown. It is far below the error of a time step.
    const TOLERANCE: f64 = 1e-6;

    /// Names of the unknowns, for messages.
    fn names(&self) -> [&'static str; B];
    /// The data of the nodes at all places of padded vectors.
    fn nodes(&self, t: f64, x: &[[f64; D]], u: &[[f64; B]]) -> Vec<Self::Node>;
    /// Refuses node data that are not finite; the failure names the place.
    fn check(&self, _mesh: &Mesh<D>, _u: &[[f64; B]], _nodes: &[Self::Node]) -> Result<(), Failure> {
        Ok(())
    }
    /// F·N through a face with normal N.
    fn convection(&self, below: &Self::Node, above: &Self::Node, normal: [f64; D]) -> Crossing<B>;
    /// D at a face.
    fn diffusivity(&self, below: &Self::Node, above: &Self::Node) -> Crossing<B>;
    /// S at a node and its derivative; none for an equation without a source.
    fn source(&self, _node: &Self::Node) -> Option<([f64; B], Block<B>)> {
        None
    }
    /// The unknowns that are given on bounded sides; for the others the flux through the sides is zero.
    fn side(&self, t: f64, x: [f64; D]) -> [Option<f64>; B];
    /// The unknowns for which neighbours have a share in the mass of a node where cells grow ([`Excess`]); for the others
    /// it is A u alone. Diffusion must damp what overshoots by that.
    fn shares_mass(&self) -> [bool; B] {
        [true; B]
    }
    /// How it is stepped in time.
    fn stepper(&self) -> Stepper {
        Stepper::Trapezoid
    }
    /// The dual cells over which the law is integrated.
    fn cells(&self, mesh: &Mesh<D>) -> DualCells<D>
    where
        Mesh<D>: Cells<D>,
    {
        DualCells::new(mesh)
    }
}

/// How a law is stepped in time, implicitly and with the second order.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Stepper {
    /// Half of the change at the start and half of that at the end of a step: Crank and Nicolson's. What decays within a
    /// step swings about zero from step to step.
    #[default]
    Trapezoid,
    /// The trapezoid, then the second backward difference formula: what decays within a step is gone after it. Twice
    /// the cost of a step.
    TrBdf2,
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
/// nodes around its ends. On a line there is no t. What leaves a cell enters its neighbour, and a constant stays constant on any moving mesh.
/// That is the trapezoid in time ([`Stepper`]), solved by Newton's method with the exact Jacobian. Where neighbours have a share
/// in the mass ([`Law::shares_mass`]), A u and A S are M u and M S, and s (u_i + u_k)/2 is the mean of the product along
/// the edge, with (d_k − d_i)·N (u_k − u_i)/12 in addition.
#[derive(Debug, Clone)]
pub(super) struct FiniteVolumes<const B: usize, const D: usize = 2, Solver = RobustTransport<B>> {
    solver: Solver,
    /// The newest mesh with its dual cells, on which the next step starts.
    newest: Option<(Mesh<D>, DualCells<D>)>,
}

impl<const B: usize, const D: usize, Solver: Default> Default for FiniteVolumes<B, D, Solver> {
    fn default() -> Self {
        Self { solver: Solver::default(), newest: None }
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

impl<const B: usize> Face<B> {
    /// Nothing passes.
    const CLOSED: Self = Self {
        crossing: Crossing { value: [0.0; B], by_below: [[0.0; B]; B], by_above: [[0.0; B]; B] },
        tangent: [0.0; B],
    };
}

/// A node on a bounded side: its index, its place in padded vectors, and the values given there.
struct Side<const B: usize> {
    i: usize,
    k: usize,
    given: [Option<f64>; B],
}

/// One of the two meshes of a time step, with its half of the fluxes.
struct Half<'a, const D: usize> {
    dt: f64,
    t: f64,
    mesh: &'a Mesh<D>,
    cells: &'a DualCells<D>,
    /// Positions, padded.
    x: &'a [[f64; D]],
    swept: &'a [[f64; D]],
    /// (d_k − d_i)·N for each face; empty where neighbours have no share in the mass of any unknown.
    stretched: &'a [[f64; D]],
}

/// What lies around a face and around a dual cell, with S points in a stencil.
trait Around<const D: usize, const S: usize> {
    /// All faces, each stored with the node below it. Those on bounded sides have no flux.
    fn faces<const B: usize, L: Law<B, D>>(&self, law: &L, nodes: &[L::Node], u: &[[f64; B]]) -> Vec<[Face<B>; D]>;

    /// The sum of the fluxes out of the dual cell of a place, in this half of the step.
    fn leaving<const B: usize>(&self, faces: &[[Face<B>; D]], k: usize) -> [f64; B];

    /// Derivatives of u + (fluxes out)/area by the nodes around a place.
    fn row<const B: usize>(&self, faces: &[[Face<B>; D]], i: usize, k: usize) -> [Block<B>; S];

    /// Beyond a bounded side the values of the side are repeated, so that couplings to them belong to the nodes on the
    /// side.
    fn fold_sides<const B: usize>(beyond: [[bool; 2]; D], row: &mut [Block<B>; S]);

    /// Fills the ring: beyond bounded sides with the values on the side, on periodic axes with images.
    fn repeat_sides<const B: usize>(patch: &Patch<D>, u: &mut [[f64; B]]);
}

/// A mesh with what is measured of it, and the time at which nodes stand there.
struct Level<'a, const B: usize, const D: usize, const S: usize> {
    t: f64,
    mesh: &'a Mesh<D>,
    cells: DualCells<D>,
    /// Positions, padded.
    x: Vec<[f64; D]>,
    excess: Option<Excess<B, D, S>>,
}

impl<'a, const B: usize, const D: usize, const S: usize> Level<'a, B, D, S>
where
    Mesh<D>: Cells<D>,
    for<'b> Half<'b, D>: Around<D, S>,
{
    fn new<L: Law<B, D>>(law: &L, t: f64, mesh: &'a Mesh<D>, known: Option<DualCells<D>>) -> Self {
        let shares = law.shares_mass();
        Self {
            t,
            mesh,
            cells: known.unwrap_or_else(|| law.cells(mesh)),
            x: padded(mesh.lattice(), mesh.x(), diagonal(mesh.extent())),
            excess: shares.contains(&true).then(|| Excess::of(mesh, shares)),
        }
    }

    /// What faces sweep on the way to a later level, and how they are stretched by it.
    fn ways(&self, later: &Self) -> [Vec<[f64; D]>; 2] {
        let stretched = match self.excess {
            Some(_) => stretched([&self.cells, &later.cells], [&self.x, &later.x]),
            None => Vec::new(),
        };
        [self.cells.swept(&later.cells), stretched]
    }

    fn half<'b>(&'b self, dt: f64, [swept, stretched]: &'b [Vec<[f64; D]>; 2]) -> Half<'b, D> {
        Half { dt, t: self.t, mesh: self.mesh, cells: &self.cells, x: &self.x, swept, stretched }
    }

    /// M u for each node.
    fn mass(&self, u: &[[f64; B]]) -> Vec<[f64; B]> {
        let of = |(i, k): (usize, usize)| {
            let area = self.cells.areas()[i];
            let more = self.excess.as_ref().map_or([0.0; B], |excess| excess.product(i, k, |n| u[n]));
            std::array::from_fn(|c| area * u[k][c] + more[c])
        };
        self.cells.patch().places().enumerate().map(of).collect()
    }
}

/// γ, the share of a step that the trapezoid does: with it both stages have the same matrix.
const FIRST_STAGE: f64 = 2.0 - std::f64::consts::SQRT_2;

impl<const B: usize, const D: usize, Solver> FiniteVolumes<B, D, Solver> {
    /// The solution on the new mesh, with one value for each node and unknown.
    #[allow(private_bounds)] // what lies around a face is known here alone
    pub fn step<const S: usize, L: Law<B, D>>(
        &mut self,
        law: &L,
        motion: Motion<'_, D>,
        start: &[[f64; B]],
    ) -> Result<(Vec<[f64; B]>, Work), Failure>
    where
        Mesh<D>: Cells<D>,
        Solver: LinearSolver<D, S, B, Block<B>>,
        for<'a> Half<'a, D>: Around<D, S>,
    {
        let Motion { t, dt, old, new } = motion;
        let known = self.newest.take().filter(|(mesh, _)| mesh == old).map(|(_, cells)| cells);
        let (old, new) = (Level::new(law, t, old, known), Level::new(law, t + dt, new, None));
        let u = padded(old.mesh.lattice(), start, [[0.0; B]; D]);
        let (values, work) = match law.stepper() {
            Stepper::Trapezoid => self.trapezoid(law, [&old, &new], u.clone()),
            Stepper::TrBdf2 => self.tr_bdf2(law, [&old, &new], u),
        }?;
        self.newest = Some((new.mesh.clone(), new.cells));
        Ok((values, work))
    }

    /// ½ of the fluxes at both ends of a step.
    fn trapezoid<const S: usize, L: Law<B, D>>(
        &mut self,
        law: &L,
        [old, new]: [&Level<'_, B, D, S>; 2],
        u: Vec<[f64; B]>,
    ) -> Result<(Vec<[f64; B]>, Work), Failure>
    where
        Mesh<D>: Cells<D>,
        Solver: LinearSolver<D, S, B, Block<B>>,
        for<'a> Half<'a, D>: Around<D, S>,
    {
        let (dt, ways) = (new.t - old.t, old.ways(new));
        let known = old.half(dt, &ways).known(law, old.excess.as_ref(), &u)?;
        self.implicit(law, new, &new.half(dt, &ways), &known, u)
    }

    /// The trapezoid over the share γ of a step, then the second backward difference formula over the rest
    ///
    /// ```text
    /// M³u³ + (1−γ)/(2−γ) Δt (fluxes − A S)³ = a₂ M²u² − a₁ M¹u¹,   a₂ = 1/(γ(2−γ)),   a₁ = (1−γ)²/(γ(2−γ))
    /// ```
    ///
    /// It damps what decays fast in a step, however fast that is. Faces sweep s₁₃ − a₂ s₁₂ in the second stage, so that
    /// constants stay constant.
    ///
    /// # Source
    /// Bank et al., *Transient simulation of silicon devices and circuits* (1985); Hosea and Shampine, *Analysis and
    /// implementation of TR-BDF2* (1996).
    fn tr_bdf2<const S: usize, L: Law<B, D>>(
        &mut self,
        law: &L,
        [old, new]: [&Level<'_, B, D, S>; 2],
        u: Vec<[f64; B]>,
    ) -> Result<(Vec<[f64; B]>, Work), Failure>
    where
        Mesh<D>: Cells<D>,
        Solver: LinearSolver<D, S, B, Block<B>>,
        for<'a> Half<'a, D>: Around<D, S>,
    {
        let gamma = FIRST_STAGE;
        let (dt, lattice) = (new.t - old.t, old.mesh.lattice());
        let between = old.mesh.x().iter().zip(new.mesh.x());
        let between = between.map(|(a, b)| std::array::from_fn(|d| a[d] + gamma * (b[d] - a[d])));
        let mesh = old.mesh.moved(between.collect())?;
        let middle = Level::new(law, old.t + gamma * dt, &mesh, None);
        let (there, mut work) = self.trapezoid(law, [old, &middle], u.clone())?;
        let there = padded(lattice, &there, [[0.0; B]; D]);

        let scale = 1.0 / (gamma * (2.0 - gamma));
        let (later, earlier) = (scale, scale * (1.0 - gamma) * (1.0 - gamma));
        let mut known = middle.mass(&there);
        for (known, start) in known.iter_mut().zip(old.mass(&u)) {
            *known = std::array::from_fn(|c| later * known[c] - earlier * start[c]);
        }
        // half of these counts, as half of Δt does
        let [whole, first] = [old.ways(new), old.ways(&middle)];
        let mut ways = whole;
        for (way, first) in ways.iter_mut().flatten().zip(first.iter().flatten()) {
            (0..D).for_each(|d| way[d] = 2.0 * (way[d] - later * first[d]));
        }
        let half = new.half(2.0 * (1.0 - gamma) / (2.0 - gamma) * dt, &ways);
        let (values, cost) = self.implicit(law, new, &half, &known, there)?;
        work += cost;
        Ok((values, work))
    }

    /// The solution at the end of a stage from what is `known` of its beginning and a guess.
    fn implicit<const S: usize, L: Law<B, D>>(
        &mut self,
        law: &L,
        level: &Level<'_, B, D, S>,
        half: &Half<'_, D>,
        known: &[[f64; B]],
        mut u: Vec<[f64; B]>,
    ) -> Result<(Vec<[f64; B]>, Work), Failure>
    where
        Mesh<D>: Cells<D>,
        Solver: LinearSolver<D, S, B, Block<B>>,
        for<'a> Half<'a, D>: Around<D, S>,
    {
        // given values are set from the start
        let sides = sides(law, level.t, level.mesh);
        for side in &sides {
            for (u, given) in u[side.k].iter_mut().zip(side.given) {
                *u = given.unwrap_or(*u);
            }
        }
        let patch = level.cells.patch();
        <Half<'_, D> as Around<D, S>>::repeat_sides(patch, &mut u);
        let Solved { residual, work, stalled } =
            self.newton(law, half, level.excess.as_ref(), known, &sides, &mut u)?;
        let mut values: Vec<[f64; B]> = patch.places().map(|k| u[k]).collect();
        // an unknown that is given nowhere has no flux through the sides
        settle(&level.cells, &residual, &mut values, |c| sides.iter().all(|side| side.given[c].is_none()));
        // of values that are not finite, that is what is wrong
        check_finite(law.names(), level.mesh, &values)?;
        stalled.map_or(Ok((values, work)), Err)
    }

    /// Newton's method for the padded values `u` at the end of a time step, from what is `known` of its beginning.
    fn newton<const S: usize, L: Law<B, D>>(
        &mut self,
        law: &L,
        half: &Half<'_, D>,
        excess: Option<&Excess<B, D, S>>,
        known: &[[f64; B]],
        sides: &[Side<B>],
        u: &mut [[f64; B]],
    ) -> Result<Solved<B>, Failure>
    where
        Solver: LinearSolver<D, S, B, Block<B>>,
        for<'a> Half<'a, D>: Around<D, S>,
    {
        let patch = *half.cells.patch();
        let seen = inside(half.mesh, half.x);
        // unknowns may differ much in size, and one that is 0 takes the size of its first change
        let mut sizes = largest_of(u);
        let mut size = sizes.into_iter().fold(f64::MIN_POSITIVE, larger);
        let mut matrix = BlockMatrix::<D, S, B>::zero_blocks(patch);
        let mut residual = vec![[0.0; B]; patch.len()];
        let mut work = Work::default();
        // where the flux through a cell in a step is large, round-off alone leaves residuals above the tolerance
        let (mut round_off, tolerance) = (16.0 * f64::EPSILON, L::TOLERANCE);
        let mut at_first = f64::INFINITY;
        let stalled = loop {
            let nodes = law.nodes(half.t, &seen, u);
            law.check(half.mesh, u, &nodes)?;
            let faces = Around::<D, S>::faces(half, law, &nodes, u);
            half.residual(law, excess, (&nodes, &faces), known, u, &mut residual);
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
            half.matrix(law, excess, (&nodes, &faces), sides, &mut matrix);
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
            <Half<'_, D> as Around<D, S>>::repeat_sides(&patch, u);
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
fn sides<const B: usize, const D: usize, L: Law<B, D>>(law: &L, t: f64, mesh: &Mesh<D>) -> Vec<Side<B>> {
    let lattice = mesh.lattice();
    let strides = strides(lattice.nodes().map(|n| n + 2));
    let place = |i: usize| lattice.node(i).iter().zip(strides).map(|(i, s)| (i + 1) * s).sum();
    let side = |i: usize| Side { i, k: place(i), given: law.side(t, mesh.image(mesh.x()[i])) };
    lattice.sides().map(side).collect()
}

/// Positions in the box, where those beyond a periodic side are replaced by their images.
fn inside<'a, const D: usize>(mesh: &Mesh<D>, x: &'a [[f64; D]]) -> Cow<'a, [[f64; D]]> {
    match mesh.lattice().periodic().contains(&true) {
        false => Cow::Borrowed(x),
        true => Cow::Owned(x.iter().map(|x| mesh.image(*x)).collect()),
    }
}

/// For each unknown without a flux through the sides, adds the mean of the remaining residual to all values: sums are
/// then conserved to round-off, whatever the tolerance of Newton's method.
fn settle<const B: usize, const D: usize>(
    cells: &DualCells<D>,
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
type Seen<'a, N, const B: usize, const D: usize> = (&'a [N], &'a [[Face<B>; D]]);

impl<const D: usize> Half<'_, D> {
    /// What the beginning of a time step contributes to each dual cell: A (u + ½ Δt S) less half of what leaves it.
    fn known<const S: usize, const B: usize, L: Law<B, D>>(
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
    fn residual<const S: usize, const B: usize, L: Law<B, D>>(
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
    fn matrix<const S: usize, const B: usize, L: Law<B, D>>(
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
    fn source<const B: usize, L: Law<B, D>>(&self, law: &L, node: &L::Node) -> [f64; B] {
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

    /// The face between two places. `turned` is the part of t in d, and `change` u_b − u_a.
    #[inline(always)]
    #[allow(clippy::too_many_arguments)] // what a face is made of
    fn face<const B: usize, L: Law<B, D>>(
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
        let shares = law.shares_mass();
        let bent = self.stretched.get(i).map_or(0.0, |stretched| stretched[axis] / 24.0);
        let mut face = Face { crossing: passing, tangent: [0.0; B] };
        let Crossing { value, by_below, by_above } = &mut face.crossing;
        for c in 0..B {
            let slope = across * (u[k][c] - u[i][c]) + along * change(c);
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

    /// From one place to another.
    #[inline(always)]
    fn way(&self, i: usize, k: usize) -> [f64; D] {
        std::array::from_fn(|c| self.x[k][c] - self.x[i][c])
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
