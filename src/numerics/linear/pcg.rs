use super::{LatticeMatrix, krylov::add, krylov::dot, krylov::divide, larger, solved, stalled};
use crate::error::Failure;

/// Conjugate gradients for symmetric M-matrices on a star, preconditioned by modified incomplete elimination
///
/// ```text
/// M = (L + E) E⁻¹ (E + Lᵀ),   e_i = a_ii − Σ_k a_ik (a_ik + Σ_j a_kj) / e_k,   k below i, j ≠ i above k
/// ```
///
/// that is MIC(0), lines of the lattice one after the other: what elimination would fill in is added to the diagonal, so
/// that smooth errors are met at once. Couplings around periodic axes are left to the iteration. An iteration is a
/// product with the matrix; all right-hand sides go together.
///
/// # Source
/// Gustafsson, *A class of first order factorization methods*, BIT 18 (1978).
#[derive(Debug, Clone, Default)]
pub struct Pcg<const K: usize> {
    /// 1/e at each place of a padded vector, 0 on the ring.
    pivots: Vec<f64>,
    space: [Vec<[f64; K]>; 4],
}

const MAX_ITERATIONS: usize = 1000;

impl<const K: usize> Pcg<K> {
    /// Solves A x = b for K right-hand sides
    ///
    /// `x` is padded: its ring holds the known values, its unknowns the guess and then the solution. The residual of
    /// each unknown, over its `weights`, is at most `tolerance[c]` in the end. Returns the number of iterations.
    ///
    /// # Errors
    /// [`Failure::LinearStalled`] where it is not reached, or the matrix is not positive definite.
    pub fn solve<const D: usize, const S: usize>(
        &mut self,
        a: &LatticeMatrix<D, S>,
        weights: &[f64],
        b: &[[f64; K]],
        x: &mut [[f64; K]],
        tolerance: [f64; K],
    ) -> Result<usize, Failure> {
        let Self { pivots, space } = self;
        for v in space.iter_mut() {
            v.clear();
            v.resize(a.patch.padded_len(), [0.0; K]);
        }
        let [r, z, p, q] = space;
        a.residual(b, x, r);
        let unknowns = a.rows.len();
        let size = |r: &[[f64; K]]| {
            let mut sizes = [0.0; K];
            for (k, weight) in a.patch.places().zip(weights) {
                (0..K).for_each(|c| sizes[c] = larger(sizes[c], r[k][c] / weight));
            }
            sizes
        };
        let mut sizes = size(r);
        if solved(sizes, tolerance) {
            return Ok(0);
        }
        if !eliminate(a, pivots) {
            return Err(stalled(unknowns, sizes, tolerance, 0));
        }
        let mut before = [1.0; K];
        for iteration in 1..=MAX_ITERATIONS {
            precondition(a, pivots, r, z);
            let now = dot(r, z);
            let active = std::array::from_fn(|c| sizes[c] > tolerance[c]);
            let gain = if iteration == 1 { [0.0; K] } else { divide(active, now, before) };
            before = now;
            for (p, z) in p.iter_mut().zip(z.iter()) {
                (0..K).for_each(|c| p[c] = z[c] + gain[c] * p[c]);
            }
            a.patch.wrap(p);
            a.multiply(p, q);
            let step = divide(active, now, dot(p, q));
            add(x, step, p);
            add(r, step.map(|s| -s), q);
            sizes = size(r);
            if solved(sizes, tolerance) {
                return Ok(iteration);
            }
            if !sizes.iter().chain(&step).all(|v| v.is_finite()) {
                return Err(stalled(unknowns, sizes, tolerance, iteration));
            }
        }
        Err(stalled(unknowns, sizes, tolerance, MAX_ITERATIONS))
    }
}

/// The pivots of the incomplete elimination, inverted. False where one is not positive.
fn eliminate<const D: usize, const S: usize>(a: &LatticeMatrix<D, S>, pivots: &mut Vec<f64>) -> bool {
    pivots.clear();
    pivots.resize(a.patch.padded_len(), 0.0);
    let strides = a.patch.padded_strides();
    // what each row sends to its neighbours above, kept until they are reached
    let mut above = vec![[0.0; D]; a.patch.padded_len()];
    let mut sound = true;
    for (row, k) in a.rows.iter().zip(a.patch.places()) {
        let mut pivot = row[0];
        for d in 0..D {
            let (below, from) = (row[1 + 2 * d], k - strides[d]);
            let filled: f64 = (0..D).filter(|&e| e != d).map(|e| above[from][e]).sum();
            pivot -= below * (below + filled) * pivots[from];
        }
        sound &= pivot > 0.0;
        pivots[k] = 1.0 / pivot;
        above[k] = std::array::from_fn(|d| row[2 + 2 * d]);
    }
    sound
}

/// z = M⁻¹ r, the ring of z zero.
fn precondition<const D: usize, const S: usize, const K: usize>(
    a: &LatticeMatrix<D, S>,
    pivots: &[f64],
    r: &[[f64; K]],
    z: &mut [[f64; K]],
) {
    let (strides, n) = (a.patch.padded_strides(), a.patch.pencil_len());
    for (p, start) in a.patch.pencils().enumerate() {
        for (row, k) in a.rows[p * n..(p + 1) * n].iter().zip(start..) {
            let mut sum = r[k];
            for d in 0..D {
                (0..K).for_each(|c| sum[c] -= row[1 + 2 * d] * z[k - strides[d]][c]);
            }
            z[k] = sum.map(|s| s * pivots[k]);
        }
    }
    for p in (0..a.patch.pencil_count()).rev() {
        let start = a.patch.pencil(p);
        for (row, k) in a.rows[p * n..(p + 1) * n].iter().zip(start..start + n).rev() {
            let mut sum = [0.0; K];
            for d in 0..D {
                (0..K).for_each(|c| sum[c] += row[2 + 2 * d] * z[k + strides[d]][c]);
            }
            (0..K).for_each(|c| z[k][c] -= sum[c] * pivots[k]);
        }
    }
}
