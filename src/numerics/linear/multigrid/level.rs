use super::halving::{Halving, add};
use crate::geometry::Patch;
use crate::numerics::larger;
use crate::numerics::linear::LatticeMatrix;

/// Axes along which the network couples less than this share of what it does along the strongest one are not halved:
/// relaxation alone damps errors that change along those.
const WEAK: f64 = 0.25;
/// Relaxation alone is enough where at every node the edges make less than this share of the diagonal: a sweep then at
/// least halves the error.
const LOOSE: f64 = 0.5;

/// The network of one level, and the vectors of a cycle on it. Arrays are padded vectors of its patch.
#[derive(Debug, Clone)]
pub(super) struct Level<const D: usize, const K: usize> {
    pub patch: Patch<D>,
    /// The next level has every second node of this one; none on the coarsest.
    pub halved: Option<Halving>,
    /// Number of relaxation sweeps before and after the next level. Where two axes are halved in turn, there are none
    /// in between.
    pub sweeps: usize,
    mass: Vec<f64>,
    /// Along each axis the conductance of the edge to the neighbour below, also for the place beyond the last unknown.
    below: [Vec<f64>; D],
    /// 1/a_ii.
    inverse: Vec<f64>,
    /// The solution, its right-hand side, and the residual r − A x.
    pub x: Vec<[f64; K]>,
    pub r: Vec<[f64; K]>,
    pub left: Vec<[f64; K]>,
}

impl<const D: usize, const K: usize> Level<D, K> {
    pub fn of(patch: Patch<D>) -> Self {
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
    pub fn fill<const S: usize>(&mut self, a: &LatticeMatrix<D, S>) {
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

    /// The network of every second node of a finer one.
    pub fn halve(&mut self, finer: &Self, halving: Halving) {
        let add = |sum: &mut f64, share: f64, v: &f64| *sum += share * v;
        halving.restrict(&finer.mass, &mut self.mass, add);
        for d in 0..D {
            match d == halving.axis {
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
    pub fn invert(&mut self) -> bool {
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
    pub fn strong_axes(&self) -> Vec<usize> {
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
    pub fn begin(&mut self) {
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
    pub fn relax(&mut self, colour: usize) {
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
    pub fn subtract(&mut self) {
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
