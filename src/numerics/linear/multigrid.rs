use super::LatticeMatrix;
use crate::geometry::Patch;
use crate::numerics::larger;

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

/// The network of one level, and the vectors of a cycle on it. Arrays are padded vectors of its patch.
#[derive(Debug, Clone)]
struct Level<const D: usize, const K: usize> {
    patch: Patch<D>,
    /// The axis along which the next level has half as many nodes; none on the coarsest.
    halved: Option<usize>,
    /// Number of relaxation sweeps before and after the next level. Where two axes are halved in turn, there are none
    /// in between.
    sweeps: usize,
    mass: Vec<f64>,
    /// Along each axis the conductance of the edge to the neighbour below, also for the place beyond the last unknown.
    below: [Vec<f64>; D],
    /// 1/a_ii.
    inverse: Vec<f64>,
    x: Vec<[f64; K]>,
    r: Vec<[f64; K]>,
    left: Vec<[f64; K]>,
}

/// Axes that couple less than this share of the strongest one are not halved: relaxation alone damps errors that change
/// along those.
const WEAK: f64 = 0.25;
/// Relaxation alone is enough where at every node the edges make less than this share of the diagonal.
const LOOSE: f64 = 0.5;
/// Sweeps on the coarsest level, where no axis can be halved any more: a handful of nodes, which these all but solve.
const SWEEPS_ON_THE_COARSEST: usize = 8;

impl<const D: usize, const K: usize> Multigrid<D, K> {
    /// Builds all levels below a symmetric star and reuses their memory. False where an entry of the diagonal is not
    /// positive.
    pub fn build<const S: usize>(&mut self, a: &LatticeMatrix<D, S>) -> bool {
        if self.levels.first().is_none_or(|finest| finest.patch != a.patch) {
            self.levels = vec![Level::of(a.patch)];
        }
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
            level.halved = axes.pop();
            let Some(axis) = level.halved else {
                if (0..D).all(|d| !Halving::possible(&level.patch, d)) {
                    level.sweeps = SWEEPS_ON_THE_COARSEST;
                }
                self.levels.truncate(l + 1);
                return true;
            };
            let patch = Halving::of(&level.patch, axis).patch(&level.patch);
            l += 1;
            if self.levels.get(l).is_none_or(|next| next.patch != patch) {
                self.levels.truncate(l);
                self.levels.push(Level::of(patch));
            }
            let (finer, coarser) = self.levels.split_at_mut(l);
            coarser[0].halve(&finer[l - 1], axis);
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
            if let (Some(axis), Some(coarse)) = (fine.halved, coarser.first_mut()) {
                let halving = Halving::of(&fine.patch, axis);
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
            if let (Some(axis), Some(coarse)) = (fine.halved, coarser.first()) {
                Halving::of(&fine.patch, axis).prolong(&coarse.x, &mut fine.x);
                fine.patch.wrap(&mut fine.x);
            }
            (0..fine.sweeps).for_each(|_| [1, 0].into_iter().for_each(|colour| fine.relax(colour)));
        }
        z.copy_from_slice(&self.levels[0].x);
    }
}

fn add<const K: usize>(sum: &mut [f64; K], share: f64, v: &[f64; K]) {
    (0..K).for_each(|c| sum[c] += share * v[c]);
}

impl<const D: usize, const K: usize> Level<D, K> {
    fn of(patch: Patch<D>) -> Self {
        let (numbers, vectors) = (vec![0.0; patch.padded_len()], vec![[0.0; K]; patch.padded_len()]);
        Self {
            patch,
            halved: None,
            sweeps: 0,
            mass: numbers.clone(),
            below: std::array::from_fn(|_| numbers.clone()),
            inverse: numbers,
            x: vectors.clone(),
            r: vectors.clone(),
            left: vectors,
        }
    }

    /// The network of a symmetric star.
    fn fill<const S: usize>(&mut self, a: &LatticeMatrix<D, S>) {
        let strides = self.patch.padded_strides();
        for (row, k) in a.rows.iter().zip(self.patch.places()) {
            self.mass[k] = row.iter().sum::<f64>().max(0.0);
            for d in 0..D {
                self.below[d][k] = -row[1 + 2 * d];
                self.below[d][k + strides[d]] = -row[2 + 2 * d];
            }
        }
        self.close();
    }

    /// The network of every second node of a finer one, along an axis.
    fn halve(&mut self, finer: &Self, axis: usize) {
        let halving = Halving::of(&finer.patch, axis);
        let add = |sum: &mut f64, share: f64, v: &f64| *sum += share * v;
        halving.restrict(&finer.mass, &mut self.mass, add);
        for d in 0..D {
            match d == axis {
                true => halving.join(&finer.below[d], &mut self.below[d]),
                false => halving.restrict(&finer.below[d], &mut self.below[d], add),
            }
        }
        self.close();
    }

    /// Copies the images of a network. On an axis of one node, which is its own neighbour, there is no edge.
    fn close(&mut self) {
        for d in 0..D {
            if self.patch.wraps[d] && self.patch.size[d] == 1 {
                self.below[d].fill(0.0);
            }
            self.patch.wrap(&mut self.below[d]);
        }
        self.patch.wrap(&mut self.mass);
    }

    /// Computes the inverse of the diagonal; false where an entry is not positive.
    fn invert(&mut self) -> bool {
        let strides = self.patch.padded_strides();
        let mut sound = true;
        for k in self.patch.places() {
            let edges: f64 = (0..D).map(|d| self.below[d][k] + self.below[d][k + strides[d]]).sum();
            let diagonal = self.mass[k] + edges;
            sound &= diagonal > 0.0 && diagonal.is_finite();
            self.inverse[k] = 1.0 / diagonal;
        }
        sound
    }

    /// The axes to be halved: those along which the network couples most and that can be halved; none where relaxation
    /// is enough.
    fn strong_axes(&self) -> Vec<usize> {
        let loose = |k: usize| 1.0 - self.mass[k] * self.inverse[k];
        let loosest = self.patch.places().map(loose).fold(0.0, larger);
        let coupling = |d: usize| self.patch.places().map(|k| self.below[d][k]).sum::<f64>();
        let axes: Vec<(usize, f64)> =
            (0..D).filter(|d| Halving::possible(&self.patch, *d)).map(|d| (d, coupling(d))).collect();
        let strongest = axes.iter().fold(0.0, |m, (_, c)| larger(m, *c));
        let strong = axes.into_iter().filter(|(_, c)| loosest > LOOSE && *c >= WEAK * strongest);
        strong.map(|(d, _)| d).collect()
    }

    /// The first sweep from x = 0: nodes of the first colour take a division only, those of the second are relaxed
    /// after them.
    fn begin(&mut self) {
        let n = self.patch.pencil_len();
        if self.has_odd_period() {
            self.x.fill([0.0; K]);
        }
        let Self { patch, inverse, x, r, .. } = self;
        for (p, start) in patch.pencils().enumerate() {
            for k in (start + parity(patch, p)..start + n).step_by(2) {
                x[k] = r[k].map(|v| v * inverse[k]);
            }
        }
        patch.wrap(x);
        self.relax(1);
    }

    /// Solves for the nodes of one colour, given those of the other: x_i = (r_i + Σ a x_k)/a_ii.
    fn relax(&mut self, colour: usize) {
        let n = self.patch.pencil_len();
        let Self { patch, below, inverse, x, r, .. } = self;
        for (p, start) in patch.pencils().enumerate() {
            let (before, here, after) = around(x, start, n);
            let (r, inverse) = (&r[start..start + n], &inverse[start..start + n]);
            let row = Row::new(patch, below, start, before, after);
            for j in ((colour + parity(patch, p)) % 2..n).step_by(2) {
                let drawn = row.drawn(j, here);
                here[j + 1] = std::array::from_fn(|c| (r[j][c] + drawn[c]) * inverse[j]);
            }
        }
        patch.wrap(x);
    }

    /// True where neighbours may have the same colour, around an axis with an odd number of nodes. They then use each
    /// other's old values.
    fn has_odd_period(&self) -> bool {
        (0..D).any(|d| self.patch.wraps[d] && self.patch.size[d] % 2 == 1)
    }

    /// The residual r − A x after a sweep. It is zero at nodes of the second colour, which were relaxed last.
    fn subtract(&mut self) {
        let n = self.patch.pencil_len();
        let odd = self.has_odd_period();
        let Self { patch, below, inverse, x, r, left, .. } = self;
        for (p, start) in patch.pencils().enumerate() {
            let (before, here, after) = around(x, start, n);
            let (r, inverse, left) = (&r[start..start + n], &inverse[start..start + n], &mut left[start..start + n]);
            let row = Row::new(patch, below, start, before, after);
            let first = parity(patch, p);
            for j in 0..n {
                left[j] = match j % 2 == first || odd {
                    true => {
                        let drawn = row.drawn(j, here);
                        std::array::from_fn(|c| r[j][c] + drawn[c] - here[j + 1][c] / inverse[j])
                    }
                    false => [0.0; K],
                };
            }
        }
        patch.wrap(left);
    }
}

/// A vector in three parts: what lies before the pencil of n unknowns that begins at `start`, the pencil with its ends,
/// and what lies after it.
fn around<T>(x: &mut [T], start: usize, n: usize) -> (&[T], &mut [T], &[T]) {
    let (before, rest) = x.split_at_mut(start - 1);
    let (here, after) = rest.split_at_mut(n + 2);
    (before, here, after)
}

/// A pencil of values, and the edges that lead there.
type Neighbours<'a, const K: usize> = (&'a [[f64; K]], &'a [f64]);

/// The neighbours of a pencil, and the edges to them.
struct Row<'a, const D: usize, const K: usize> {
    /// For each axis but the last: the pencils below and above, and the edges to them.
    across: [[Neighbours<'a, K>; 2]; D],
    /// Edges between its nodes.
    along: &'a [f64],
}

impl<'a, const D: usize, const K: usize> Row<'a, D, K> {
    fn new(
        patch: &Patch<D>,
        below: &'a [Vec<f64>; D],
        start: usize,
        before: &'a [[f64; K]],
        after: &'a [[f64; K]],
    ) -> Self {
        let (n, strides) = (patch.pencil_len(), patch.padded_strides());
        let across = std::array::from_fn(|d| match d + 1 == D {
            true => [(&before[..0], &below[d][..0]); 2],
            false => {
                let s = strides[d];
                let above = &after[start + s - (start + n + 1)..][..n];
                [(&before[start - s..][..n], &below[d][start..][..n]), (above, &below[d][start + s..][..n])]
            }
        });
        Self { across, along: &below[D - 1][start..][..n + 1] }
    }

    /// Σ a x_k over the neighbours k of node j of the pencil `here`.
    fn drawn(&self, j: usize, here: &[[f64; K]]) -> [f64; K] {
        let mut sum = [0.0; K];
        for (x, edges) in self.across[..D - 1].as_flattened() {
            add(&mut sum, edges[j], &x[j]);
        }
        add(&mut sum, self.along[j], &here[j]);
        add(&mut sum, self.along[j + 1], &here[j + 2]);
        sum
    }
}

/// Parity of the sum of the places of the p-th pencil along its axes.
fn parity<const D: usize>(patch: &Patch<D>, p: usize) -> usize {
    let mut rest = p;
    let mut sum = 0;
    for d in (0..D - 1).rev() {
        sum += rest % patch.size[d];
        rest /= patch.size[d];
    }
    sum % 2
}

/// Every second node along an axis: kept node I is node 2I, or the last one of a periodic axis of an odd number
#[derive(Debug, Clone, Copy)]
struct Halving {
    axis: usize,
    wraps: bool,
    /// Number of unknowns along the axis before and after halving.
    size: [usize; 2],
    /// Number of padded lines along the axes before this one, and distance in memory between neighbours along this
    /// axis.
    outer: usize,
    inner: usize,
}

impl Halving {
    /// Whether there are nodes to leave out: at least two on a periodic axis, three between sides.
    fn possible<const D: usize>(patch: &Patch<D>, axis: usize) -> bool {
        patch.size[axis] > if patch.wraps[axis] { 1 } else { 2 }
    }

    fn of<const D: usize>(patch: &Patch<D>, axis: usize) -> Self {
        let (n, wraps) = (patch.size[axis], patch.wraps[axis]);
        let outer = patch.size[..axis].iter().map(|n| n + 2).product();
        let inner = patch.padded_strides()[axis];
        Self { axis, wraps, size: [n, if wraps { n.div_ceil(2) } else { n / 2 }], outer, inner }
    }

    fn patch<const D: usize>(&self, fine: &Patch<D>) -> Patch<D> {
        let mut size = fine.size;
        size[self.axis] = self.size[1];
        Patch { origin: [0; D], size, wraps: fine.wraps }
    }

    /// The place on the fine level of the I-th place on the coarse one, rings included.
    fn kept(&self, i: usize) -> usize {
        (2 * i).min(self.size[0] + usize::from(!self.wraps))
    }

    /// Whether a node was left out between the I-th place and the one below.
    fn skips(&self, i: usize) -> bool {
        self.kept(i) == self.kept(i - 1) + 2
    }

    /// The range of the i-th line across the axis, in the o-th block of an array with `n` unknowns along the axis.
    fn line(&self, o: usize, i: usize, n: usize) -> std::ops::Range<usize> {
        let start = (o * (n + 2) + i) * self.inner;
        start..start + self.inner
    }

    /// Adds to each kept node its own fine value and half of that on each neighbour that was left out.
    fn restrict<T: Copy>(&self, fine: &[T], coarse: &mut [T], add: impl Fn(&mut T, f64, &T)) {
        let [n, m] = self.size;
        for (o, i) in (0..self.outer).flat_map(|o| (1..=m).map(move |i| (o, i))) {
            let kept = self.kept(i);
            let to = &mut coarse[self.line(o, i, m)];
            to.copy_from_slice(&fine[self.line(o, kept, n)]);
            // above the last node of a periodic axis lies the first one
            let above = if self.wraps && i == m { 1 } else { i + 1 };
            for (from, shares) in [(kept - 1, self.skips(i)), (kept + 1, self.skips(above))] {
                if shares {
                    to.iter_mut().zip(&fine[self.line(o, from, n)]).for_each(|(to, from)| add(to, 0.5, from));
                }
            }
        }
    }

    /// The edges along the axis: two edges in a row become one with half of their mean conductance.
    fn join(&self, fine: &[f64], coarse: &mut [f64]) {
        let [n, m] = self.size;
        for (o, i) in (0..self.outer).flat_map(|o| (1..=m + usize::from(!self.wraps)).map(move |i| (o, i))) {
            let kept = self.kept(i);
            let to = &mut coarse[self.line(o, i, m)];
            to.copy_from_slice(&fine[self.line(o, kept, n)]);
            if self.skips(i) {
                to.iter_mut().zip(&fine[self.line(o, kept - 1, n)]).for_each(|(to, from)| *to = 0.25 * (*to + from));
            }
        }
    }

    /// Interpolates linearly: adds to each kept node its coarse value, and to nodes in between the mean of both
    /// neighbours.
    fn prolong<const K: usize>(&self, coarse: &[[f64; K]], fine: &mut [[f64; K]]) {
        let [n, m] = self.size;
        for (o, i) in (0..self.outer).flat_map(|o| (1..=m + 1).map(move |i| (o, i))) {
            let kept = self.kept(i);
            let (below, here) = (&coarse[self.line(o, i - 1, m)], &coarse[self.line(o, i, m)]);
            if i <= m {
                fine[self.line(o, kept, n)].iter_mut().zip(here).for_each(|(to, from)| add(to, 1.0, from));
            }
            if self.skips(i) {
                let to = &mut fine[self.line(o, kept - 1, n)];
                for (to, (below, here)) in to.iter_mut().zip(below.iter().zip(here)) {
                    (0..K).for_each(|c| to[c] += 0.5 * (below[c] + here[c]));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::Pcg;
    use super::*;
    use proptest::prelude::*;

    /// (1 + a) on a lattice of given couplings along both axes, scaled by a field of any contrast.
    fn sample(
        size: [usize; 2],
        wraps: [bool; 2],
        a: [f64; 2],
        cell: impl Fn([usize; 2]) -> f64,
    ) -> LatticeMatrix<2, 5> {
        let patch = Patch { origin: [1, 1], size, wraps };
        let mut matrix = LatticeMatrix::<2, 5>::zero(patch);
        let at = |i: usize, j: usize| cell([i % size[0], j % size[1]]);
        for (k, row) in matrix.rows.iter_mut().enumerate() {
            let (i, j) = (k / size[1], k % size[1]);
            let below = |i: usize, n: usize, wraps: bool| {
                if i > 0 {
                    i - 1
                } else if wraps {
                    n - 1
                } else {
                    0
                }
            };
            let (here, down, left) = (at(i, j), at(below(i, size[0], wraps[0]), j), at(i, below(j, size[1], wraps[1])));
            let (up, right) = (at(i + 1, j), at(i, j + 1));
            let mean = |x: f64, y: f64| 0.5 * (x + y);
            *row = [
                0.0,
                -a[0] * mean(here, down),
                -a[0] * mean(here, if i + 1 < size[0] || wraps[0] { up } else { here }),
                -a[1] * mean(here, left),
                -a[1] * mean(here, if j + 1 < size[1] || wraps[1] { right } else { here }),
            ];
            row[0] = here - row[1..].iter().sum::<f64>();
        }
        matrix
    }

    fn iterations(a: &LatticeMatrix<2, 5>, exactness: f64) -> usize {
        let n = a.rows.len();
        let b: Vec<[f64; 2]> = (0..n).map(|k| [(0.37 * k as f64).sin(), (0.11 * k as f64).cos()]).collect();
        let mut x = vec![[0.0; 2]; a.patch.padded_len()];
        let weights: Vec<f64> = a.rows.iter().map(|row| row[0]).collect();
        let largest = a.rows.iter().fold(f64::INFINITY, |m, row| m.min(row[0]));
        Pcg::default().solve(a, &weights, &b, &mut x, [exactness / largest; 2]).unwrap()
    }

    proptest! {
        /// The cycle is symmetric, and its spectrum lies in (0, 1]: v·Mv > 0, and Mv never overshoots, in any network.
        #[test]
        fn the_cycle_is_an_inner_product(
            n in 1_usize..20,
            m in 1_usize..20,
            wx: bool,
            wy: bool,
            log_a in -3.0..6.0_f64,
            skew in -3.0..3.0_f64,
            seed: u64,
        ) {
            let cell = |[i, j]: [usize; 2]| {
                let mixed = (seed ^ (i * 1009 + j) as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15);
                10_f64.powf(6.0 * (mixed >> 11) as f64 / (1_u64 << 53) as f64)
            };
            let a = sample([n, m], [wx, wy], [10_f64.powf(log_a), 10_f64.powf(log_a + skew)], cell);
            let mut multigrid = Multigrid::<2, 2>::default();
            prop_assert!(multigrid.build(&a));
            let len = a.patch.padded_len();
            let mut r = vec![[0.0; 2]; len];
            for k in a.patch.places() {
                r[k] = [(0.7 * (k as f64 + seed as f64 % 97.0)).sin(), (1.3 * k as f64).cos()];
            }
            let mut z = vec![[0.0; 2]; len];
            // nothing is left of an earlier cycle
            multigrid.cycle(&vec![[1.0, -2.0]; len], &mut z);
            multigrid.cycle(&r, &mut z);
            a.patch.wrap(&mut z);
            let product = |u: usize, v: usize| -> f64 { a.patch.places().map(|k| r[k][u] * z[k][v]).sum() };
            prop_assert!((product(0, 1) - product(1, 0)).abs() <= 1e-9 * (product(0, 0) * product(1, 1)).sqrt());
            let mut az = vec![[0.0; 2]; len];
            a.multiply(&z, &mut az);
            for c in 0..2 {
                let energy: f64 = a.patch.places().map(|k| z[k][c] * az[k][c]).sum();
                let norm = product(c, c);
                prop_assert!(norm > 0.0 && energy <= (1.0 + 1e-9) * norm, "{energy} {norm}");
            }
        }
    }

    /// At most a third more iterations on 64 times as many nodes, bounded and periodic, of odd and even numbers, with
    /// any ratio of couplings, where the coefficient is smooth.
    #[test]
    fn iterations_do_not_grow_with_the_lattice() {
        for (wraps, ratio) in
            [([false; 2], 1.0), ([true; 2], 1.0), ([true, false], 1.0), ([false; 2], 100.0), ([true; 2], 1e-3)]
        {
            let counts = [31, 64, 127, 250].map(|n| {
                let wave = |[i, j]: [usize; 2]| {
                    (4.0 * ((0.2 * i as f64 * 31.0 / n as f64).sin() * (0.3 * j as f64 * 31.0 / n as f64).cos())).exp()
                };
                let a = 1e2 * (n * n) as f64;
                iterations(&sample([n, n + 1], wraps, [a, ratio * a], wave), 1e-8)
            });
            assert!(3 * counts[3] <= 4 * counts[0] && counts[3] <= 20, "{wraps:?} {ratio} {counts:?}");
        }
    }
}
