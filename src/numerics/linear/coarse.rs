//! Coarse levels for implicit steps of convection and diffusion in two dimensions.

use super::ilu::Ilu;
use super::{BlockMatrix, refill};
use crate::geometry::Patch;
use crate::numerics::larger;

/// A W-cycle of multigrid for matrices like I − Δt A: an approximate inverse that, unlike incomplete elimination alone,
/// carries what diffuses through many cells in a step
///
/// Along both axes every second node is kept, and values are linear between them; on a bounded side the last node is
/// kept, too. The coarse matrix is the Galerkin product R A P with the interpolation P and means R over the nodes
/// around, so that the identity keeps its weight of one and nine points remain nine. A cycle restricts the residual,
/// corrects by the coarse solution, and smooths by [`Ilu`] once, which is robust where cells are flat. Unknowns whose
/// rows are those of the identity, such as values given on sides, are not corrected.
///
/// Levels end where elimination alone is as good: where no coefficient of a node by itself is above [`LOOSE`], or where
/// there are [few](FEWEST) nodes along both axes. A matrix that is so from the start has no coarse level. Each coarse
/// level is gone through twice: where convection outweighs diffusion on wide cells, once leaves too much.
///
/// # Source
/// Trottenberg, Oosterlee, Schüller, *Multigrid*, Academic Press (2001), 2.4, 2.8.4 and 7.5.
#[derive(Debug, Clone, Default)]
pub(super) struct Cycle<const B: usize> {
    finest: Smoother<B>,
    /// From fine to coarse; of these the first `count` are those of the matrix.
    coarse: Vec<Level<B>>,
    count: usize,
}

/// Elimination alone is enough where no diagonal coefficient of a row is larger than this: a step then couples a node
/// to few others.
const LOOSE: f64 = 4.0;
/// Elimination alone takes fewer seconds on fewer nodes than this, although it takes more products: coarse levels gain
/// nothing up to 200² nodes, for Burgers' equation with ν of 2e-4 and 5e-3 and for heat, and cost up to twice the time.
const FEW: usize = 40_000;
/// An axis with fewer nodes than this is not halved.
const FEWEST: usize = 8;

/// The factors of a level, and what it takes to improve values there.
#[derive(Debug, Clone, Default)]
struct Smoother<const B: usize> {
    ilu: Ilu<B>,
    left: Vec<[f64; B]>,
    step: Vec<[f64; B]>,
}

/// A coarse level.
#[derive(Debug, Clone)]
struct Level<const B: usize> {
    halving: Halving,
    matrix: BlockMatrix<2, 9, B>,
    smoother: Smoother<B>,
    /// For each unknown at each node of the finer level: 0 for those that are not corrected, else 1.
    free: Vec<[f64; B]>,
    /// The right-hand side, what is left of it, the solution, and what a cycle adds to it, padded.
    r: Vec<[f64; B]>,
    left: Vec<[f64; B]>,
    x: Vec<[f64; B]>,
    more: Vec<[f64; B]>,
}

impl<const B: usize> Cycle<B> {
    /// Builds all levels below a matrix; false if the elimination of the matrix itself has no pivot. Coarse levels end
    /// before one without pivots.
    pub fn build(&mut self, a: &BlockMatrix<2, 9, B>) -> bool {
        if !self.finest.build(a) {
            return false;
        }
        self.count = 0;
        if a.rows.len() < FEW {
            return true;
        }
        loop {
            let (done, rest) = self.coarse.split_at_mut(self.count);
            let finer = done.last().map_or(a, |level| &level.matrix);
            let own = finer.rows.iter().flat_map(|row| (0..B).map(|c| row[0][c][c].abs()));
            if own.fold(0.0, larger) <= LOOSE || !Halving::possible(&finer.patch) {
                break;
            }
            if rest.first().is_none_or(|level| level.halving.fine != finer.patch) {
                let level = Level::of(&finer.patch);
                self.coarse.truncate(self.count);
                self.coarse.push(level);
            }
            let (done, rest) = self.coarse.split_at_mut(self.count);
            if !rest[0].build(done.last().map_or(a, |level| &level.matrix)) {
                break;
            }
            self.count += 1;
        }
        true
    }

    /// Whether the matrix has a coarse level.
    pub fn has_levels(&self) -> bool {
        self.count > 0
    }

    /// Solves approximately by incomplete elimination alone, without coarse levels.
    pub fn eliminate(&self, a: &BlockMatrix<2, 9, B>, v: &[[f64; B]], x: &mut [[f64; B]]) {
        self.finest.ilu.solve(a, v, x);
    }

    /// Sets x to about A⁻¹ v, with its ring ready for a product with the matrix.
    pub fn solve(&mut self, a: &BlockMatrix<2, 9, B>, v: &[[f64; B]], x: &mut [[f64; B]]) {
        cycle(a, &mut self.finest, &mut self.coarse[..self.count], v, x);
    }
}

/// Sets x to about A⁻¹ v by the levels below.
fn cycle<const B: usize>(
    a: &BlockMatrix<2, 9, B>,
    smoother: &mut Smoother<B>,
    coarse: &mut [Level<B>],
    v: &[[f64; B]],
    x: &mut [[f64; B]],
) {
    let Some((next, rest)) = coarse.split_first_mut() else {
        smoother.ilu.solve(a, v, x);
        return;
    };
    let Level { halving, matrix, smoother: below, free, r, left, x: small, more } = next;
    halving.restrict(free, v, r);
    cycle(matrix, below, rest, r, small);
    if !rest.is_empty() {
        matrix.difference(r, small, left);
        cycle(matrix, below, rest, left, more);
        add(small, more);
    }
    halving.prolong(free, small, x);
    a.patch.wrap(x);
    a.difference(v, x, &mut smoother.left);
    smoother.ilu.solve(a, &smoother.left, &mut smoother.step);
    add(x, &smoother.step);
}

fn add<const B: usize>(x: &mut [[f64; B]], more: &[[f64; B]]) {
    x.as_flattened_mut().iter_mut().zip(more.as_flattened()).for_each(|(x, more)| *x += more);
}

impl<const B: usize> Smoother<B> {
    fn build(&mut self, a: &BlockMatrix<2, 9, B>) -> bool {
        refill(&mut self.left, a.patch.padded_len(), [0.0; B]);
        refill(&mut self.step, a.patch.padded_len(), [0.0; B]);
        self.ilu.factorise(a)
    }
}

impl<const B: usize> Level<B> {
    fn of(fine: &Patch<2>) -> Self {
        let halving = Halving::of(*fine);
        let matrix = BlockMatrix::zero_blocks(halving.coarse);
        let zeros = vec![[0.0; B]; halving.coarse.padded_len()];
        let [r, left, x, more] = [(); 4].map(|()| zeros.clone());
        Self { halving, matrix, smoother: Smoother::default(), free: Vec::new(), r, left, x, more }
    }

    fn build(&mut self, finer: &BlockMatrix<2, 9, B>) -> bool {
        self.free.clear();
        self.free.extend(finer.rows.iter().map(free));
        self.halving.product(finer, &self.free, &mut self.matrix);
        self.smoother.build(&self.matrix)
    }
}

/// 0 for each unknown of a row that is one of the identity, else 1.
fn free<const B: usize>(row: &[[[f64; B]; B]; 9]) -> [f64; B] {
    std::array::from_fn(|c| {
        let is_own = |s: usize, e: usize| s == 0 && e == c;
        let entries = || (0..9).flat_map(|s| (0..B).map(move |e| (s, e)));
        let is_identity = row[0][c][c] == 1.0 && entries().all(|(s, e)| is_own(s, e) || row[s][c][e] == 0.0);
        if is_identity { 0.0 } else { 1.0 }
    })
}

/// How a coarse lattice lies in a fine one.
#[derive(Debug, Clone)]
struct Halving {
    fine: Patch<2>,
    coarse: Patch<2>,
    /// For each fine node along each axis: the kept nodes from which it is interpolated.
    from: [Vec<[Share; 2]>; 2],
    /// The kept nodes to which it belongs; the shares of all fine nodes in a kept one add up to 1.
    to: [Vec<[Share; 2]>; 2],
    /// For each fine node along each axis, and the neighbour below, itself and the neighbour above: where the
    /// coefficient between these goes.
    ways: [Vec<[Vec<Way>; 3]>; 2],
}

/// A kept node, and a share.
type Share = (usize, f64);

/// A share of a coefficient in the row of a kept node.
#[derive(Debug, Clone)]
struct Way {
    kept: usize,
    /// 0 for the coefficient of the kept node below, 1 for its own, 2 for that of the kept node above.
    step: usize,
    share: f64,
}

/// The point of the stencil to which steps along both axes lead.
const POINT: [[usize; 3]; 3] = [[5, 1, 6], [3, 0, 4], [7, 2, 8]];

impl Halving {
    /// Whether an axis has enough nodes.
    fn possible(fine: &Patch<2>) -> bool {
        fine.size.iter().any(|n| *n >= FEWEST)
    }

    fn of(fine: Patch<2>) -> Self {
        let halved = fine.size.map(|n| n >= FEWEST);
        let size = std::array::from_fn(|d| match (halved[d], fine.wraps[d]) {
            (false, _) => fine.size[d],
            (true, true) => fine.size[d].div_ceil(2),
            (true, false) => fine.size[d] / 2 + 1,
        });
        let from: [Vec<[Share; 2]>; 2] = std::array::from_fn(|d| {
            let (n, m) = (fine.size[d], size[d]);
            let is_kept = |i: usize| i.is_multiple_of(2) || (!fine.wraps[d] && i + 1 == n);
            let shares = |i: usize| match (halved[d], is_kept(i)) {
                (false, _) => [(i, 1.0), (i, 0.0)],
                (true, true) => [(i.div_ceil(2), 1.0), (i.div_ceil(2), 0.0)],
                (true, false) => [(i / 2, 0.5), ((i / 2 + 1) % m, 0.5)],
            };
            (0..n).map(shares).collect()
        });
        let to: [Vec<[Share; 2]>; 2] = std::array::from_fn(|d| {
            let mut sums = vec![0.0; size[d]];
            from[d].as_flattened().iter().for_each(|&(kept, share)| sums[kept] += share);
            from[d].iter().map(|shares| shares.map(|(kept, share)| (kept, share / sums[kept]))).collect()
        });
        let ways = std::array::from_fn(|d| ways(&to[d], &from[d], fine.wraps[d]));
        Self { fine, coarse: Patch { origin: [0; 2], size, wraps: fine.wraps }, from, to, ways }
    }

    /// Means over the nodes around each kept one.
    fn restrict<const B: usize>(&self, free: &[[f64; B]], v: &[[f64; B]], coarse: &mut [[f64; B]]) {
        coarse.fill([0.0; B]);
        let n = self.fine.pencil_len();
        for (i, start) in self.fine.pencils().enumerate() {
            let (v, free) = (&v[start..start + n], &free[i * n..(i + 1) * n]);
            for &(a, first) in self.to[0][i].iter().filter(|(_, share)| *share > 0.0) {
                let line = &mut coarse[self.coarse.pencil(a)..][..self.coarse.pencil_len()];
                for ((v, free), to) in v.iter().zip(free).zip(&self.to[1]) {
                    for &(b, second) in to {
                        (0..B).for_each(|c| line[b][c] += first * second * free[c] * v[c]);
                    }
                }
            }
        }
    }

    /// Interpolates to all nodes that are corrected.
    fn prolong<const B: usize>(&self, free: &[[f64; B]], coarse: &[[f64; B]], x: &mut [[f64; B]]) {
        x.fill([0.0; B]);
        let n = self.fine.pencil_len();
        for (i, start) in self.fine.pencils().enumerate() {
            let (x, free) = (&mut x[start..start + n], &free[i * n..(i + 1) * n]);
            for &(a, first) in self.from[0][i].iter().filter(|(_, share)| *share > 0.0) {
                let line = &coarse[self.coarse.pencil(a)..][..self.coarse.pencil_len()];
                for ((x, free), from) in x.iter_mut().zip(free).zip(&self.from[1]) {
                    for &(b, second) in from {
                        (0..B).for_each(|c| x[c] += first * second * free[c] * line[b][c]);
                    }
                }
            }
        }
    }

    /// R A P; where a kept unknown is not corrected, the row of the identity.
    fn product<const B: usize>(&self, a: &BlockMatrix<2, 9, B>, free: &[[f64; B]], coarse: &mut BlockMatrix<2, 9, B>) {
        coarse.rows.fill([[[0.0; B]; B]; 9]);
        let ([m, n], width) = (self.fine.size, self.coarse.size[1]);
        // the node a step away, around the axis where it wraps
        let next = |i: usize, step: isize, n: usize| (i + n).wrapping_add_signed(step) % n;
        for (i, first) in self.ways[0].iter().enumerate() {
            for (j, second) in self.ways[1].iter().enumerate() {
                let row = i * n + j;
                for (block, [di, dj]) in a.rows[row].iter().zip(BlockMatrix::<2, 9, B>::POINTS) {
                    let (first, second) = (&first[(di + 1) as usize], &second[(dj + 1) as usize]);
                    if first.is_empty() || second.is_empty() {
                        continue;
                    }
                    let (own, other) = (&free[row], &free[next(i, di, m) * n + next(j, dj, n)]);
                    let block: [[f64; B]; B] =
                        std::array::from_fn(|c| std::array::from_fn(|e| own[c] * other[e] * block[c][e]));
                    for first in first {
                        let rows = &mut coarse.rows[first.kept * width..][..width];
                        for second in second {
                            let share = first.share * second.share;
                            let entry = &mut rows[second.kept][POINT[first.step][second.step]];
                            for (entry, block) in entry.as_flattened_mut().iter_mut().zip(block.as_flattened()) {
                                *entry += share * block;
                            }
                        }
                    }
                }
            }
        }
        let kept = |d: usize| (0..self.fine.size[d]).filter(move |&i| self.from[d][i][0].1 == 1.0);
        let kept = kept(0).flat_map(|i| kept(1).map(move |j| i * n + j));
        for (row, fine) in coarse.rows.iter_mut().zip(kept) {
            for c in (0..B).filter(|&c| free[fine][c] == 0.0) {
                row.iter_mut().for_each(|block| block[c] = [0.0; B]);
                row[0][c][c] = 1.0;
            }
        }
    }
}

/// Where the coefficients between fine nodes and their neighbours along an axis go; nowhere beyond a bounded side.
fn ways(to: &[[Share; 2]], from: &[[Share; 2]], wraps: bool) -> Vec<[Vec<Way>; 3]> {
    let n = to.len();
    let step = |kept: usize, other: usize| match other as isize - kept as isize {
        step @ -1..=1 => (step + 1) as usize,
        // around the axis
        step if step < 0 => 2,
        _ => 0,
    };
    let of = |i: usize, step_of: usize| -> Vec<Way> {
        let other = match (i + step_of, wraps) {
            (place, true) => (place + n - 1) % n,
            (place, false) if (1..=n).contains(&place) => place - 1,
            _ => return Vec::new(),
        };
        let pairs = to[i].iter().flat_map(|to| from[other].iter().map(move |from| (to, from)));
        let way = |(to, from): (&Share, &Share)| Way { kept: to.0, step: step(to.0, from.0), share: to.1 * from.1 };
        pairs.map(way).filter(|way| way.share > 0.0).collect()
    };
    (0..n).map(|i| std::array::from_fn(|step| of(i, step))).collect()
}
