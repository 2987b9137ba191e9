//! Multigrid: [`Multigrid`] goes through the levels, [`Level`](level::Level) relaxes on one of them, and
//! [`Halving`](halving::Halving) leads from one to the next.

mod halving;
mod level;

#[cfg(test)]
mod tests;

use super::LatticeMatrix;
use crate::geometry::Patch;
use halving::{Halving, add};
use level::Level;

/// A symmetric V-cycle of multigrid for symmetric M-matrices on a star: the inverse of M in [`Pcg`](super::Pcg)
///
/// A matrix is seen as a network: a mass W ≥ 0 at each node and a conductance a ≥ 0 on each edge,
///
/// ```text
/// xᵀ A x = Σ_i W_i x_i² + Σ_edges a (x_i − x_k)²,   rings being 0 or images
/// ```
///
/// Along an axis every second node is kept, and x is linear between them. In the network of the kept nodes, an edge has
/// half the mean of the conductances of the two edges that it replaces, and mass and edges on a node that is not kept
/// go half to each neighbour. This network is the Galerkin product where x varies along that axis alone, and has larger
/// energy elsewhere, so that the cycle has its spectrum in (0, 1] for any network. The number of nodes need not be
/// even: the last edge then keeps its length.
///
/// Only the axes along which the network couples most are halved at a time. Nodes are relaxed in two colours, which
/// damps what changes along those axes. A cycle costs a fixed number of operations for each node.
///
/// # Source
/// Trottenberg, Oosterlee, Schüller, *Multigrid*, Academic Press (2001), 5.1 (halving along single axes) and 2.5
/// (cycles).
#[derive(Debug, Clone)]
pub(super) struct Multigrid<const D: usize, const K: usize> {
    /// From the finest to the coarsest.
    levels: Vec<Level<D, K>>,
}

impl<const D: usize, const K: usize> Default for Multigrid<D, K> {
    fn default() -> Self {
        Self { levels: Vec::new() }
    }
}

/// Relaxation sweeps on the coarsest level, where no axis can be halved any more: these all but solve for the handful
/// of nodes that is left.
const SWEEPS_ON_THE_COARSEST: usize = 8;

impl<const D: usize, const K: usize> Multigrid<D, K> {
    /// Builds all levels below a symmetric star and reuses their memory. False where an entry of the diagonal is not
    /// positive.
    pub fn build<const S: usize>(&mut self, a: &LatticeMatrix<D, S>) -> bool {
        self.prepare(0, a.patch);
        self.levels[0].fill(a);
        // axes that remain to be halved before the next relaxation
        let mut axes = Vec::new();
        let mut l = 0;
        loop {
            let level = &mut self.levels[l];
            level.sweeps = usize::from(axes.is_empty());
            if axes.is_empty() {
                if !level.invert() {
                    return false;
                }
                axes = level.strong_axes();
            }
            level.halved = axes.pop().map(|axis| Halving::of(&level.patch, axis));
            let Some(halving) = level.halved else {
                if (0..D).all(|d| !Halving::possible(&level.patch, d)) {
                    level.sweeps = SWEEPS_ON_THE_COARSEST;
                }
                self.levels.truncate(l + 1);
                return true;
            };
            let patch = halving.patch(&level.patch);
            l += 1;
            self.prepare(l, patch);
            let (finer, coarser) = self.levels.split_at_mut(l);
            coarser[0].halve(&finer[l - 1], halving);
        }
    }

    /// Makes level l one of this patch. If it is already, it keeps its memory and those below it stay.
    fn prepare(&mut self, l: usize, patch: Patch<D>) {
        if self.levels.get(l).is_none_or(|level| level.patch != patch) {
            self.levels.truncate(l);
            self.levels.push(Level::of(patch));
        }
    }

    /// z = M⁻¹ r, where the ring of r is zero or holds images.
    pub fn cycle(&mut self, r: &[[f64; K]], z: &mut [[f64; K]]) {
        self.levels[0].r.copy_from_slice(r);
        for l in 0..self.levels.len() {
            let (finer, coarser) = self.levels.split_at_mut(l + 1);
            let fine = &mut finer[l];
            if fine.sweeps > 0 {
                fine.begin();
                (1..fine.sweeps).for_each(|_| [0, 1].into_iter().for_each(|colour| fine.relax(colour)));
            }
            if let (Some(halving), Some(coarse)) = (fine.halved, coarser.first_mut()) {
                if fine.sweeps > 0 {
                    fine.subtract();
                    halving.restrict(&fine.left, &mut coarse.r, add);
                } else {
                    fine.x.fill([0.0; K]);
                    fine.patch.wrap(&mut fine.r);
                    halving.restrict(&fine.r, &mut coarse.r, add);
                }
            }
        }
        for l in (0..self.levels.len()).rev() {
            let (finer, coarser) = self.levels.split_at_mut(l + 1);
            let fine = &mut finer[l];
            if let (Some(halving), Some(coarse)) = (fine.halved, coarser.first()) {
                halving.prolong(&coarse.x, &mut fine.x);
                fine.patch.wrap(&mut fine.x);
            }
            (0..fine.sweeps).for_each(|_| [1, 0].into_iter().for_each(|colour| fine.relax(colour)));
        }
        z.copy_from_slice(&self.levels[0].x);
    }
}
