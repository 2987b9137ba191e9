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
pub(super) struct Part {
    pub patch: Patch<2>,
    /// The nodes that it owns, with their places in its padded vectors.
    pub own: Vec<(usize, usize)>,
    pub matrix: LatticeMatrix<2, 5>,
    /// r at the unknowns.
    pub right: Vec<[f64; 2]>,
    solver: Robust<2>,
    /// c as a padded vector: given values on the ring; inside, first a guess and then the solution.
    pub correction: Vec<[f64; 2]>,
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

impl Part {
    pub fn new(lattice: &Lattice<2>, patch: Patch<2>, own: Vec<usize>) -> Self {
        let own = own.into_iter().filter_map(|k| Some((k, place(&patch, lattice, k, 0)?))).collect();
        let matrix = LatticeMatrix { patch, rows: Vec::new() };
        Self { patch, own, matrix, right: Vec::new(), solver: Robust::default(), correction: Vec::new(), rests: false }
    }

    /// Sets up the system of a step, for a residual at all nodes.
    pub fn prepare(&mut self, operator: &MeshOperator<2>, residual: &[[f64; 2]]) {
        self.matrix = operator.matrix(self.patch);
        self.right.clear();
        self.right.extend(self.patch.nodes(operator.lattice()).map(|k| residual[k]));
    }

    /// Takes ring and guess of c from nodal values.
    pub fn start(&mut self, lattice: &Lattice<2>, guess: &[[f64; 2]]) {
        self.correction = self.patch.gather(lattice, guess, [[0.0; 2]; 2]);
    }

    /// Computes the correction. `size` is the largest coordinate along each axis.
    pub fn correct(&mut self, local: Local, size: [f64; 2]) -> Result<Work, Failure> {
        let exact = exactness(&self.matrix, size);
        let nothing = |v: &[f64; 2]| (0..2).all(|c| v[c].abs() <= exact[c]);
        self.rests = self.right.iter().chain(&self.correction).all(nothing);
        if self.rests {
            // a mesh that is at rest up to round-off stays the same to the last bit
            self.correction.fill([0.0; 2]);
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

    /// Number of nodes that it reads from its neighbours: those of its patch and ring, corners included, that it does
    /// not own. Nodes on bounded sides are not counted, since every subdomain computes them.
    pub fn read(&self, lattice: &Lattice<2>) -> usize {
        let (nodes, periodic) = (lattice.nodes(), lattice.periodic());
        let along = |d: usize| {
            let ring = if self.patch.wraps[d] { 0 } else { 1 };
            // a period is added, so that the ring below the origin has no negative index
            let first = self.patch.origin[d] + nodes[d] - ring;
            let all = (first..first + self.patch.size[d] + 2 * ring).map(|i| i % nodes[d]);
            all.filter(|&i| periodic[d] || (i > 0 && i + 1 < nodes[d])).count().min(nodes[d])
        };
        along(0) * along(1) - self.own.len()
    }
}

/// For each right-hand side a share of its largest value, but at least `least`.
pub(super) fn share_of_largest(values: &[[f64; 2]], share: f64, least: [f64; 2]) -> [f64; 2] {
    let mut largest = [0.0; 2];
    values.iter().for_each(|v| (0..2).for_each(|c| largest[c] = larger(largest[c], v[c])));
    [0, 1].map(|c| (share * largest[c]).max(least[c]))
}

/// The place of a node in the padded vectors of a patch; none for a node that is no unknown, or among the `margin`
/// outermost ones.
pub(super) fn place(patch: &Patch<2>, lattice: &Lattice<2>, node: usize, margin: usize) -> Option<usize> {
    let (node, nodes, strides) = (lattice.node(node), lattice.nodes(), patch.padded_strides());
    let mut place = 0;
    for d in 0..2 {
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
pub(super) fn residual(
    operator: &MeshOperator<2>,
    old: &[[f64; 2]],
    x: &[[f64; 2]],
    jump: [[f64; 2]; 2],
) -> Vec<[f64; 2]> {
    let lattice = operator.lattice();
    let patch = Patch::whole(lattice);
    let (padded, strides, n) = (patch.gather(lattice, x, jump), patch.padded_strides(), lattice.nodes()[1]);
    let mut out = vec![[0.0; 2]; x.len()];
    parallel::for_each_row(&mut out, n, |i, row| {
        let Some(pencil) = i.checked_sub(patch.origin[0]).filter(|p| *p < patch.size[0]) else { return };
        let (start, first) = (patch.pencil(pencil), patch.origin[1]);
        for (j, r) in row[first..first + patch.size[1]].iter_mut().enumerate() {
            let (k, at) = (i * n + first + j, start + j);
            let (x, [[below, above], [left, right]]) = (padded[at], operator.weights()[k]);
            let [b, a, l, g] = [at - strides[0], at + strides[0], at - 1, at + 1].map(|at| padded[at]);
            for c in 0..2 {
                let across = below * (b[c] - x[c]) + above * (a[c] - x[c]);
                r[c] = old[k][c] - x[c] + across + left * (l[c] - x[c]) + right * (g[c] - x[c]);
            }
        }
    });
    out
}
