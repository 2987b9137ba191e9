use super::krylov::add;
use super::{LatticeMatrix, larger, refill};
use crate::geometry::Patch;
use crate::parallel;

/// Alternating-direction iteration of Peaceman and Rachford
///
/// ```text
/// x ← x + (R + Y)⁻¹ 2R (R + X)⁻¹ (v − A x),   A = X + Y,   R = R_1, …, R_J
/// ```
///
/// X and Y are the parts of the star along each axis, with half of the identity each. Sweep j damps those modes best
/// for which X and Y are near R_j. The R_j divide the spectrum [λ, κλ] geometrically, with λ and κ row by row: the
/// number J of sweeps in a cycle grows like ln κ, and a sweep leaves a quarter to a third of the error. A sweep solves
/// the tridiagonal systems along all lines of the lattice, axis by axis; these are eliminated once for all cycles and
/// right-hand sides. In one dimension a single sweep is the inverse itself. Corners of a nine-point stencil and
/// couplings around periodic axes are left to the residual.
///
/// For one and two axes only: with three, the same product of factors amplifies some modes by 3, and the code does not
/// compile.
///
/// # Source
/// Wachspress, *The ADI Model Problem*, Springer (2013).
#[derive(Debug, Clone, Default)]
pub(super) struct Adi {
    /// For each sweep and axis, at each place of a padded vector.
    factors: Vec<Vec<Factor>>,
    sweeps: usize,
}

/// One row of an eliminated line: y_i = scale v_i − before y_{i−1}, then x_i = y_i − after x_{i+1}. Zero on the ring.
#[derive(Debug, Clone, Copy, Default)]
struct Factor {
    scale: f64,
    before: f64,
    after: f64,
}

/// Ratio of the ends of the part of the spectrum that one sweep damps: a cycle has ln κ / ln 4 sweeps, rounded up.
const RATIO: f64 = 4.0;
/// Largest number of sweeps in a cycle, which covers κ = 4¹⁰ = 1e6.
const MAX_SWEEPS: f64 = 10.0;

impl Adi {
    /// Eliminates all lines of a matrix, reusing the memory. False where a pivot is not positive.
    pub fn factorise<const D: usize, const S: usize>(&mut self, a: &LatticeMatrix<D, S>) -> bool {
        const { assert!(D <= 2, "alternating directions converge for one and two axes only") };
        let strides = a.patch.padded_strides();
        // The row sum, about 1, is divided equally between the axes: it is the lower end of the spectrum of X and Y.
        let parts = |row: &[f64; S]| {
            let share = row[..=2 * D].iter().sum::<f64>() / D as f64;
            let own: [f64; D] = std::array::from_fn(|d| share - (row[1 + 2 * d] + row[2 + 2 * d]));
            let lowest = share.max(0.1);
            (own, lowest, (2.0 * own.into_iter().fold(share, f64::max) - share).max(lowest))
        };
        let mut spread = 1.0;
        for (_, lowest, highest) in a.rows.iter().map(parts) {
            spread = larger(spread, highest / lowest);
        }
        self.sweeps = if D == 1 { 1 } else { (spread.ln() / RATIO.ln()).ceil().clamp(1.0, MAX_SWEEPS) as usize };
        self.factors.resize_with(self.sweeps * D, Vec::new);
        let mut sound = spread.is_finite();
        for (sweep, factors) in self.factors.chunks_exact_mut(D).enumerate() {
            factors.iter_mut().for_each(|factors| refill(factors, a.patch.padded_len(), Factor::default()));
            let part = spread.powf((sweep as f64 + 0.5) / self.sweeps as f64 - 0.5);
            for (row, k) in a.rows.iter().zip(a.patch.places()) {
                let (own, lowest, highest) = parts(row);
                let r = if D == 1 { 0.0 } else { (lowest * highest).sqrt() * part };
                for d in 0..D {
                    let (below, above) = (row[1 + 2 * d], row[2 + 2 * d]);
                    let pivot = own[d] + r - below * factors[d][k - strides[d]].after;
                    let (inverse, between) = (1.0 / pivot, if d == 0 { 1.0 } else { 2.0 * r });
                    sound &= pivot > 1e-8;
                    factors[d][k] =
                        Factor { scale: between * inverse, before: below * inverse, after: above * inverse };
                }
            }
        }
        sound
    }

    /// Sweeps of a cycle.
    pub fn sweeps(&self) -> usize {
        self.sweeps
    }

    /// Sets x to the result of one cycle for v from x = 0. The ring of x is then ready for a product with the matrix.
    pub fn cycle<const D: usize, const S: usize, const K: usize>(
        &self,
        a: &LatticeMatrix<D, S>,
        v: &[[f64; K]],
        x: &mut [[f64; K]],
        scratch: &mut [[f64; K]],
    ) {
        for (sweep, factors) in self.factors.chunks_exact(D).enumerate() {
            if sweep == 0 {
                x.copy_from_slice(v);
                solve(&a.patch, factors, x);
            } else {
                a.difference(v, x, scratch);
                solve(&a.patch, factors, scratch);
                add(x, [1.0; K], scratch);
            }
            a.patch.wrap(x);
        }
    }
}

/// Both factors of one sweep, on a padded vector whose ring is zero.
fn solve<const D: usize, const K: usize>(patch: &Patch<D>, factors: &[Vec<Factor>], v: &mut [[f64; K]]) {
    let strides = patch.padded_strides();
    for (axis, factors) in factors.iter().enumerate() {
        let (n, s) = (patch.size[axis], strides[axis]);
        if s == 1 {
            // each line depends on its own last value, so four are eliminated side by side
            let four = 4 * (n + 2);
            let (fours, rest) = v.split_at_mut(v.len() / four * four);
            let whole = fours.len();
            parallel::for_each_row(fours, four, |q, v| along::<4, K>(v, &factors[q * four..][..four], n));
            for (v, f) in rest.chunks_exact_mut(n + 2).zip(factors[whole..].chunks_exact(n + 2)) {
                along::<1, K>(v, f, n);
            }
        } else {
            let block = s * (n + 2);
            for (v, f) in v.chunks_exact_mut(block).zip(factors.chunks_exact(block)) {
                parallel::for_each_column_group(v, s, |first, rows| across(rows, f, s, first));
            }
        }
    }
}

/// L lines that are each contiguous in memory.
fn along<const L: usize, const K: usize>(v: &mut [[f64; K]], f: &[Factor], n: usize) {
    let len = n + 2;
    let (v, f) = (&mut v[..L * len], &f[..L * len]);
    let mut carry = [[0.0; K]; L];
    for i in 1..=n {
        for (l, carry) in carry.iter_mut().enumerate() {
            let (v, f) = (&mut v[l * len + i], f[l * len + i]);
            for c in 0..K {
                carry[c] = f.scale * v[c] - f.before * carry[c];
            }
            *v = *carry;
        }
    }
    carry = [[0.0; K]; L];
    for i in (1..=n).rev() {
        for (l, carry) in carry.iter_mut().enumerate() {
            let (v, f) = (&mut v[l * len + i], f[l * len + i]);
            for c in 0..K {
                carry[c] = v[c] - f.after * carry[c];
            }
            *v = *carry;
        }
    }
}

/// Lines across the rows of a plane, all columns of a group at once; factors lie `s` apart from row to row.
fn across<const K: usize>(rows: &mut [&mut [[f64; K]]], f: &[Factor], s: usize, first: usize) {
    let n = rows.len() - 2;
    for i in 1..=n {
        let (before, here) = rows.split_at_mut(i);
        for ((v, before), f) in here[0].iter_mut().zip(before[i - 1].iter()).zip(&f[i * s + first..]) {
            for c in 0..K {
                v[c] = f.scale * v[c] - f.before * before[c];
            }
        }
    }
    for i in (1..=n).rev() {
        let (here, after) = rows.split_at_mut(i + 1);
        for ((v, after), f) in here[i].iter_mut().zip(after[0].iter()).zip(&f[i * s + first..]) {
            for c in 0..K {
                v[c] -= f.after * after[c];
            }
        }
    }
}
