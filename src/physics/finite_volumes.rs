//! Conservation laws on the dual cells of a moving mesh.

mod damping;
mod half;
mod line;
mod loads;
mod mass;
mod newton;
mod plane;
mod reconstruction;
mod repair;
mod steps;
mod transport;

use crate::error::Failure;
use crate::geometry::{Cells, DualCells, Mesh, Patch, strides};
use crate::numerics::linear::RobustTransport;
pub(super) use mass::BISTABLE;
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
    /// its unknown: far below the error of a time step.
    const TOLERANCE: f64 = 1e-6;
    /// Change of an unknown over a face, as a share of its range, from which its flux begins to be limited in wide
    /// cells ([`Damping`](damping::Damping)), and from which it is limited in full. `None`: in full for any change.
    const COUNTING: Option<[f64; 2]> = None;

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
    /// Whether D of some unknown is a function of place alone, which may be thinner than cells, or jump.
    fn has_layers(&self) -> bool {
        false
    }
    /// 1/⟨1/D⟩, the harmonic mean of D along each edge, given by its two ends; none for unknowns whose D does not
    /// depend on place alone.
    fn through_layers(&self, _t: f64, _mesh: &Mesh<D>, _edges: &[[[f64; D]; 2]]) -> Vec<[Option<f64>; B]> {
        Vec::new()
    }
    /// S at a node and its derivative; none for an equation without a source.
    fn source(&self, _node: &Self::Node) -> Option<([f64; B], Block<B>)> {
        None
    }
    /// Whether some source has a part that is a function of place and time alone, which is to be integrated over cells.
    fn has_loads(&self) -> bool {
        false
    }
    /// Source terms that depend on place and time only, at the places `x`. The unknowns `u` are the same at all these
    /// places, and so is what they add, which does not count; 0 for unknowns without such a source.
    fn loads(&self, _t: f64, _mesh: &Mesh<D>, _x: &[[f64; D]], _u: [f64; B]) -> Result<Vec<[f64; B]>, Failure> {
        Ok(Vec::new())
    }
    /// The unknowns that are given at a place on bounded sides, those at the lower or the upper ends of some axes; for
    /// the others there is a flux through the sides.
    fn side(&self, t: f64, x: [f64; D], beyond: [[bool; 2]; D]) -> [Option<f64>; B];
    /// The sides through which something flows that is not given there, as (axis, end).
    fn open_sides(&self) -> &[(usize, usize)] {
        &[]
    }
    /// What flows out of the domain at a node on an open side whose outward normal N is as long as the part of the side
    /// that belongs to the node, and its derivative by the unknowns there.
    fn leaving(
        &self,
        _side: (usize, usize),
        _place: (f64, [f64; D]),
        _node: (&Self::Node, &[f64; B]),
        _normal: [f64; D],
    ) -> ([f64; B], Block<B>) {
        ([0.0; B], [[0.0; B]; B])
    }
    /// Unknowns for which the mass matrix couples neighbours where cells grow ([`Excess`]); for the others it is
    /// lumped, A u alone. Diffusion must damp the overshoots of that coupling.
    fn shares_mass(&self) -> [bool; B] {
        [true; B]
    }
    /// Weight s of that coupling for each unknown in a step that starts at time t with nodal values `u`.
    fn weights(&self, _t: f64, _mesh: &Mesh<D>, _u: &[[f64; B]]) -> [f64; B] {
        self.shares_mass().map(|shares| if shares { 1.0 } else { 0.0 })
    }
    /// Between which values each unknown stays at each node at time t, in a step that starts with the padded `u` and
    /// ends with these values on `sides`; `x` are the places of padded vectors. Empty where no unknown has bounds.
    fn bounds(
        &self,
        _at: (f64, &[[f64; D]]),
        _mesh: &Mesh<D>,
        _u: &[[f64; B]],
        _sides: &[Side<B>],
    ) -> Result<Vec<[[f64; 2]; B]>, Failure> {
        Ok(Vec::new())
    }
    /// The unknowns whose diffusivity vanishes at some values of unknowns, so that nothing but an upwind flux keeps
    /// fronts from oscillating where the mesh sweeps over them.
    fn vanishing_diffusion(&self) -> [bool; B] {
        [false; B]
    }
    /// The values at which the diffusivity of an unknown vanishes and which it does not leave, as a lower and an upper
    /// end: a step that goes beyond takes what is too much from neighbours ([`repair`](repair::repair)). ±∞ for none.
    /// The arguments are those of [`bounds`](Self::bounds).
    fn empty(&self, _at: (f64, &[[f64; D]]), _u: &[[f64; B]], _sides: &[Side<B>]) -> [[f64; 2]; B] {
        [[f64::NEG_INFINITY, f64::INFINITY]; B]
    }
    /// Whether there are fluxes by gradients of unknowns.
    fn has_steep(&self) -> bool {
        false
    }
    /// The fluxes by gradients at faces along an axis, for one point in the middle of the face above each place of
    /// padded vectors.
    fn steep(&self, _at: (f64, &[Point<B, D>]), _mesh: &Mesh<D>) -> Result<Vec<Steep<B, D>>, Failure> {
        Ok(Vec::new())
    }
    /// Whether there are sources by gradients of unknowns.
    fn has_sloped(&self) -> bool {
        false
    }
    /// The sources by gradients at nodes, for one point at each place of padded vectors.
    fn sloped(&self, _at: (f64, &[Point<B, D>]), _mesh: &Mesh<D>) -> Result<Vec<Sloped<B, D>>, Failure> {
        Ok(Vec::new())
    }
    /// What is stored in place of u at all places of padded vectors; empty for u itself.
    fn stored(&self, _at: (f64, &[[f64; D]], &[[f64; B]]), _mesh: &Mesh<D>) -> Result<Vec<Stored<B>>, Failure> {
        Ok(Vec::new())
    }
    /// The unknowns whose equations have no time derivative: only the end of a step counts for these.
    fn algebraic(&self) -> [bool; B] {
        [false; B]
    }
    /// The unknowns that are carried by limited fluxes ([`Transport`](transport::Transport)).
    fn limited(&self) -> Limited<B> {
        Limited { unknowns: [false; B], implicit: true, coupled: false }
    }
    /// The unknowns whose fluxes are limited where cells are too wide for central ones ([`Damping`](damping::Damping)).
    fn damped(&self) -> [bool; B] {
        [false; B]
    }
    /// The unknowns whose flux is a function of themselves alone, and not of place.
    fn has_own_flux(&self) -> [bool; B] {
        [false; B]
    }
    /// How the law is stepped in time.
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
    /// Half of the change at the start and half of that at the end of a step: Crank and Nicolson's. What decays within
    /// a step swings about zero from step to step.
    #[default]
    Trapezoid,
    /// The trapezoid, then the second backward difference formula: what decays within a step is gone after it. Twice
    /// the cost of a step.
    TrBdf2,
}

/// Which unknowns are carried by limited fluxes, and what is left to the implicit step.
#[derive(Debug, Clone, Copy)]
pub(super) struct Limited<const B: usize> {
    pub unknowns: [bool; B],
    /// Whether anything else changes an unknown: there is one that is not limited, diffusion, or a source.
    pub implicit: bool,
    /// Whether the implicit part has an influence on limited unknowns in the same step: it changes one of them, or an
    /// unknown on which their fluxes depend.
    pub coupled: bool,
}

/// A place with the values of the unknowns there, and their gradients.
#[derive(Debug, Clone, Copy)]
pub(super) struct Point<const B: usize, const D: usize> {
    pub x: [f64; D],
    pub u: [f64; B],
    pub slopes: [[f64; D]; B],
}

/// A flux by gradients, and its derivatives by the unknowns and by their gradients.
#[derive(Debug, Clone, Copy)]
pub(super) struct Steep<const B: usize, const D: usize> {
    /// The flux of each equation along each axis.
    pub flux: [[f64; D]; B],
    pub by_value: [[[f64; D]; B]; B],
    /// Derivatives of the flux of each equation along each axis by the slope of each unknown along each axis.
    pub by_slope: [[[[f64; D]; D]; B]; B],
}

impl<const B: usize, const D: usize> Steep<B, D> {
    pub const NONE: Self =
        Self { flux: [[0.0; D]; B], by_value: [[[0.0; D]; B]; B], by_slope: [[[[0.0; D]; D]; B]; B] };
}

/// A source by gradients, and its derivatives by the unknowns and by their gradients.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sloped<const B: usize, const D: usize> {
    pub value: [f64; B],
    pub by_value: Block<B>,
    pub by_slope: [[[f64; D]; B]; B],
}

impl<const B: usize, const D: usize> Sloped<B, D> {
    pub const NONE: Self = Self { value: [0.0; B], by_value: [[0.0; B]; B], by_slope: [[[0.0; D]; B]; B] };
}

/// What is stored, the quantity whose integral an equation changes, and its derivatives by the unknowns.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stored<const B: usize> {
    pub value: [f64; B],
    pub by_value: Block<B>,
}

impl<const B: usize> Stored<B> {
    pub const NONE: Self = Self { value: [0.0; B], by_value: [[0.0; B]; B] };
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
/// nodes around its ends. On a line there is no t. What leaves a cell enters its neighbour, and a constant stays
/// constant on any moving mesh. That is the trapezoid in time ([`Stepper`]), solved by Newton's method with the exact
/// Jacobian. Where neighbours have a share in the mass ([`Law::shares_mass`]), A u and A S are M u and M S, and
/// s (u_i + u_k)/2 is the mean of the product along the edge, with (d_k − d_i)·N (u_k − u_i)/12 in addition. For
/// unknowns that are [`Limited`], F·N and s are in the explicit steps of [`Transport`](transport::Transport), and what
/// these bring to a dual cell is known here.
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

/// One face in one half of a time step: the flux g/2 with its derivatives, and its derivatives by u_b − u_a, of each
/// equation by each unknown.
#[derive(Debug, Clone, Copy)]
struct Face<const B: usize> {
    crossing: Crossing<B>,
    tangent: Block<B>,
    /// D of [`Damping`](damping::Damping): the factor of u_k − u_i of each unknown in its own g/2 by diffusion.
    diffusion: [f64; B],
}

impl<const B: usize> Face<B> {
    /// Nothing passes.
    const CLOSED: Self = Self {
        crossing: Crossing { value: [0.0; B], by_below: [[0.0; B]; B], by_above: [[0.0; B]; B] },
        tangent: [[0.0; B]; B],
        diffusion: [0.0; B],
    };
}

/// A node on a bounded side: its index, its place in padded vectors, and the values given there.
pub(super) struct Side<const B: usize> {
    i: usize,
    k: usize,
    pub given: [Option<f64>; B],
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

/// What a law makes of values at all places of padded vectors.
struct View<N, const B: usize, const D: usize> {
    nodes: Vec<N>,
    faces: Vec<[Face<B>; D]>,
    /// Sources by gradients; empty where there are none.
    sloped: Vec<Sloped<B, D>>,
    /// What is stored in place of u; empty where u itself is.
    stored: Vec<Stored<B>>,
}

impl<N, const B: usize, const D: usize> View<N, B, D> {
    /// What is stored at a place where the unknowns are u.
    #[inline(always)]
    fn stored(&self, k: usize, u: &[f64; B]) -> [f64; B] {
        self.stored.get(k).map_or(*u, |stored| stored.value)
    }
}

/// What the faces are made of: nodes, fluxes by gradients and diffusivities of place for each axis, and what is stored.
/// The last three may be empty.
struct Made<'a, N, const B: usize, const D: usize> {
    nodes: &'a [N],
    steep: &'a [Vec<Steep<B, D>>; D],
    layers: &'a [Vec<[Option<f64>; B]>; D],
    stored: &'a [Stored<B>],
}

/// What lies around a face and around a dual cell, with S points in a stencil.
trait Around<const D: usize, const S: usize> {
    /// All faces, each stored with the node below it. Those on bounded sides have no flux.
    fn faces<const B: usize, L: Law<B, D>>(
        &self,
        law: &L,
        made: &Made<'_, L::Node, B, D>,
        u: &[[f64; B]],
    ) -> Vec<[Face<B>; D]>;

    /// Four times u_b − u_a at the face above a place along an axis.
    fn change<const B: usize>(&self, u: &[[f64; B]], k: usize, axis: usize) -> [f64; B];

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

/// The nodes on bounded sides, and the values given there at time t.
fn sides<const B: usize, const D: usize, L: Law<B, D>>(law: &L, t: f64, mesh: &Mesh<D>) -> Vec<Side<B>> {
    let lattice = mesh.lattice();
    let strides = strides(lattice.nodes().map(|n| n + 2));
    let place = |i: usize| lattice.node(i).iter().zip(strides).map(|(i, s)| (i + 1) * s).sum();
    let side = |i: usize| Side { i, k: place(i), given: law.side(t, mesh.image(mesh.x()[i]), lattice.beyond(i)) };
    lattice.sides().map(side).collect()
}

/// Positions in the box, where those beyond a periodic side are replaced by their images.
fn inside<'a, const D: usize>(mesh: &Mesh<D>, x: &'a [[f64; D]]) -> Cow<'a, [[f64; D]]> {
    match mesh.lattice().periodic().contains(&true) {
        false => Cow::Borrowed(x),
        true => Cow::Owned(x.iter().map(|x| mesh.image(*x)).collect()),
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
