//! Overlapping subdomains, each of which corrects the mesh by itself.

use super::MeshOperator;
use super::mmpde::exactness;
use crate::error::Failure;
use crate::geometry::{Lattice, Patch};
use crate::numerics::larger;
use crate::numerics::linear::{LatticeMatrix, LinearSolver, Robust, Smoother, relax};
use crate::parallel;
use crate::work::Work;

/// A subdomain extended into its neighbours
///
/// It solves M c = r for a correction c of the mesh, which is given on the ring around it. Corrections are zero on the
/// sides of the domain, and the same at both ends of a periodic axis.
#[derive(Debug, Clone)]
pub(super) struct Part<const D: usize, const S: usize> {
    pub patch: Patch<D>,
    /// The nodes that it owns, with their places in its padded vectors.
    pub own: Vec<(usize, usize)>,
    pub matrix: LatticeMatrix<D, S>,
    /// r at the unknowns.
    pub right: Vec<[f64; D]>,
    solver: Robust<D>,
    /// c as a padded vector: given values on the ring; inside, first a guess and then the solution.
    pub correction: Vec<[f64; D]>,
    /// Whether r was zero up to round-off, so that nothing was corrected.
    pub rests: bool,
}

/// How a part computes its correction.
#[derive(Debug, Clone, Copy)]
pub(super) enum Local {
    /// By a solve, until the residual is this share of its largest value, or round-off.
    Solve { share: f64 },
    /// By relaxation sweeps, with the lower end of the spectrum for their weights.
    Sweeps { smoother: Smoother, sweeps: usize, lowest: f64 },
}

impl<const D: usize, const S: usize> Part<D, S> {
    pub fn new(lattice: &Lattice<D>, patch: Patch<D>, own: Vec<usize>) -> Self {
        let own = own.into_iter().filter_map(|k| Some((k, place(&patch, lattice, k, 0)?))).collect();
        let matrix = LatticeMatrix { patch, rows: Vec::new() };
        Self { patch, own, matrix, right: Vec::new(), solver: Robust::default(), correction: Vec::new(), rests: false }
    }

    /// Sets up the system of a step, for a residual at all nodes.
    pub fn prepare(&mut self, operator: &MeshOperator<D>, residual: &[[f64; D]]) {
        self.matrix = operator.matrix(self.patch);
        self.right.clear();
        self.right.extend(self.patch.nodes(operator.lattice()).map(|k| residual[k]));
    }

    /// Takes ring and guess of c from nodal values.
    pub fn start(&mut self, lattice: &Lattice<D>, guess: &[[f64; D]]) {
        self.correction = self.patch.gather(lattice, guess, [[0.0; D]; D]);
    }

    /// Computes the correction. `size` is the largest coordinate along each axis.
    pub fn correct(&mut self, local: Local, size: [f64; D]) -> Result<Work, Failure> {
        let exact = exactness(&self.matrix, size);
        let nothing = |v: &[f64; D]| (0..D).all(|c| v[c].abs() <= exact[c]);
        self.rests = self.right.iter().chain(&self.correction).all(nothing);
        if self.rests {
            // a mesh that is at rest up to round-off stays the same to the last bit
            self.correction.fill([0.0; D]);
            return Ok(Work::default());
        }
        match local {
            Local::Solve { share } => {
                let tolerance = share_of_largest(&self.right, share, exact);
                self.solver.solve(&self.matrix, &self.right, &mut self.correction, tolerance)
            }
            Local::Sweeps { smoother, sweeps, lowest } => {
                relax(&self.matrix, &self.right, &mut self.correction, smoother, sweeps, lowest);
                Ok(Work::default())
            }
        }
    }

    /// The correction at the nodes that it owns.
    pub fn own_correction(&self) -> Vec<[f64; D]> {
        self.own.iter().map(|&(_, place)| self.correction[place]).collect()
    }

    /// Number of nodes that it reads from its neighbours: those of its patch and ring, corners included, that it does
    /// not own. Nodes on bounded sides are not counted, since every subdomain computes them.
    pub fn read(&self, lattice: &Lattice<D>) -> usize {
        let (nodes, periodic) = (lattice.nodes(), lattice.periodic());
        let along = |d: usize| {
            let ring = if self.patch.wraps[d] { 0 } else { 1 };
            // a period is added, so that the ring below the origin has no negative index
            let first = self.patch.origin[d] + nodes[d] - ring;
            let all = (first..first + self.patch.size[d] + 2 * ring).map(|i| i % nodes[d]);
            all.filter(|&i| periodic[d] || (i > 0 && i + 1 < nodes[d])).count().min(nodes[d])
        };
        (0..D).map(along).product::<usize>() - self.own.len()
    }
}

/// For each right-hand side a share of its largest value, but at least `least`.
pub(super) fn share_of_largest<const K: usize>(values: &[[f64; K]], share: f64, least: [f64; K]) -> [f64; K] {
    let mut largest = [0.0; K];
    values.iter().for_each(|v| (0..K).for_each(|c| largest[c] = larger(largest[c], v[c])));
    std::array::from_fn(|c| (share * largest[c]).max(least[c]))
}

/// The place of a node in the padded vectors of a patch; none for a node that is no unknown, or among the `margin`
/// outermost ones.
pub(super) fn place<const D: usize>(
    patch: &Patch<D>,
    lattice: &Lattice<D>,
    node: usize,
    margin: usize,
) -> Option<usize> {
    let (node, nodes, strides) = (lattice.node(node), lattice.nodes(), patch.padded_strides());
    let mut place = 0;
    for d in 0..D {
        let margin = if patch.wraps[d] { 0 } else { margin };
        let at = (node[d] + nodes[d] - patch.origin[d]) % nodes[d];
        if at < margin || at + margin >= patch.size[d] {
            return None;
        }
        place += (at + 1) * strides[d];
    }
    Some(place)
}

/// The residual xⁿ − M x at every node, as xⁿ_i − x_i + Σ w_e (x_e − x_i), and zero on bounded sides. `jump[d]` is
/// added on wrapping around axis d.
pub(super) fn residual<const D: usize>(
    operator: &MeshOperator<D>,
    old: &[[f64; D]],
    x: &[[f64; D]],
    jump: [[f64; D]; D],
) -> Vec<[f64; D]> {
    let lattice = operator.lattice();
    let patch = Patch::whole(lattice);
    let (padded, strides, n) = (patch.gather(lattice, x, jump), patch.padded_strides(), lattice.nodes()[D - 1]);
    let mut out = vec![[0.0; D]; x.len()];
    parallel::for_each_row(&mut out, n, |i, row| {
        let Some(pencil) = pencil_of_row(&patch, lattice, i) else { return };
        let (start, first) = (patch.pencil(pencil), patch.origin[D - 1]);
        for (j, r) in row[first..first + patch.size[D - 1]].iter_mut().enumerate() {
            let (k, at) = (i * n + first + j, start + j);
            let (x, weights) = (padded[at], operator.weights()[k]);
            for c in 0..D {
                let drawn = |d: usize| {
                    let ([below, above], s) = (weights[d], strides[d]);
                    [below * (padded[at - s][c] - x[c]), above * (padded[at + s][c] - x[c])]
                };
                let across = (0..D - 1).map(drawn).fold(old[k][c] - x[c], |sum, [below, above]| sum + (below + above));
                let [below, above] = drawn(D - 1);
                r[c] = across + below + above;
            }
        }
    });
    out
}

/// The pencil of a patch that lies in a row of nodes along the last axis; none in rows without unknowns.
fn pencil_of_row<const D: usize>(patch: &Patch<D>, lattice: &Lattice<D>, row: usize) -> Option<usize> {
    let (nodes, mut rest, mut pencil, mut stride) = (lattice.nodes(), row, 0, 1);
    for d in (0..D - 1).rev() {
        let at = (rest % nodes[d]).checked_sub(patch.origin[d]).filter(|at| *at < patch.size[d])?;
        pencil += at * stride;
        stride *= patch.size[d];
        rest /= nodes[d];
    }
    Some(pencil)
}
