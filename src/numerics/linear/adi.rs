use super::LatticeMatrix;
use crate::geometry::Patch;

/// Alternating-direction preconditioner of Peaceman and Rachford
///
/// ```text
/// A = X + Y ≈ (R + X)(2R)⁻¹(R + Y),   R = diag √(λ_min λ_max)
/// ```
///
/// X and Y are the parts of the star along each axis with half of the identity each, and R balances the ends of their
/// spectra row by row: the condition of the product grows like √(Δt/h²), not like Δt/h² as it would with R = I. Each
/// factor is a set of tridiagonal systems along the lines of the lattice, eliminated once for many right-hand sides.
/// In one dimension it is the inverse itself. Corners and couplings around periodic axes are left to the iteration.
#[derive(Debug, Clone, Default)]
pub(super) struct Adi {
    /// For each axis, at each place of a padded vector.
    axes: Vec<Vec<Factor>>,
}

/// One row of an eliminated line: y_i = scale v_i − before y_{i−1}, then x_i = y_i − after x_{i+1}. Zero on the ring.
#[derive(Debug, Clone, Copy, Default)]
struct Factor {
    scale: f64,
    before: f64,
    after: f64,
}

impl Adi {
    /// Eliminates all lines of a matrix, reusing the memory. False where a pivot is not positive.
    pub fn factorise<const D: usize, const S: usize>(&mut self, a: &LatticeMatrix<D, S>) -> bool {
        let strides = a.patch.padded_strides();
        self.axes.resize_with(D, Vec::new);
        for factors in &mut self.axes {
            factors.clear();
            factors.resize(a.patch.padded_len(), Factor::default());
        }
        let mut sound = true;
        for (row, k) in a.rows.iter().zip(a.patch.places()) {
            // what a row sums to, about 1, is shared between the axes
            let share = row[..=2 * D].iter().sum::<f64>() / D as f64;
            let own: [f64; D] = std::array::from_fn(|d| share - (row[1 + 2 * d] + row[2 + 2 * d]));
            let largest = own.into_iter().fold(share, f64::max);
            let balance = if D == 1 { 0.0 } else { (share.max(0.1) * (2.0 * largest - share)).sqrt() };
            for d in 0..D {
                let (below, above) = (row[1 + 2 * d], row[2 + 2 * d]);
                let pivot = own[d] + balance - below * self.axes[d][k - strides[d]].after;
                let between = if d == 0 { 1.0 } else { 2.0 * balance };
                sound &= pivot > 1e-8;
                self.axes[d][k] = Factor { scale: between / pivot, before: below / pivot, after: above / pivot };
            }
        }
        sound
    }

    /// Applies the inverse to the unknowns of a padded vector whose ring is zero.
    pub fn solve<const D: usize, const K: usize>(&self, patch: &Patch<D>, v: &mut [[f64; K]]) {
        let strides = patch.padded_strides();
        for axis in 0..D {
            let (n, s) = (patch.size[axis], strides[axis]);
            if s == 1 {
                // each line waits for itself, so several go side by side
                let together = 4 * (n + 2);
                let (mut v, mut f) = (v.chunks_exact_mut(together), self.axes[axis].chunks_exact(together));
                (&mut v).zip(&mut f).for_each(|(v, f)| lines::<4, K>(v, f, n));
                let rest = (v.into_remainder().chunks_exact_mut(n + 2)).zip(f.remainder().chunks_exact(n + 2));
                rest.for_each(|(v, f)| lines::<1, K>(v, f, n));
            } else {
                let block = s * (n + 2);
                for (v, f) in v.chunks_exact_mut(block).zip(self.axes[axis].chunks_exact(block)) {
                    plane(v, f, n, s);
                }
            }
        }
    }
}

/// L lines that are each contiguous in memory.
fn lines<const L: usize, const K: usize>(v: &mut [[f64; K]], f: &[Factor], n: usize) {
    let (v, f) = (&mut v[..L * (n + 2)], &f[..L * (n + 2)]);
    let mut carry = [[0.0; K]; L];
    for i in 1..=n {
        for (l, carry) in carry.iter_mut().enumerate() {
            let k = l * (n + 2) + i;
            *carry = std::array::from_fn(|c| f[k].scale * v[k][c] - f[k].before * carry[c]);
            v[k] = *carry;
        }
    }
    carry = [[0.0; K]; L];
    for i in (1..=n).rev() {
        for (l, carry) in carry.iter_mut().enumerate() {
            let k = l * (n + 2) + i;
            *carry = std::array::from_fn(|c| v[k][c] - f[k].after * carry[c]);
            v[k] = *carry;
        }
    }
}

/// All lines of one plane, `s` apart in memory, with the loop over lines the inner one.
fn plane<const K: usize>(v: &mut [[f64; K]], f: &[Factor], n: usize, s: usize) {
    for i in 1..=n {
        let (before, here) = v[(i - 1) * s..(i + 1) * s].split_at_mut(s);
        for ((v, before), f) in here.iter_mut().zip(before.iter()).zip(&f[i * s..(i + 1) * s]) {
            *v = std::array::from_fn(|c| f.scale * v[c] - f.before * before[c]);
        }
    }
    for i in (1..=n).rev() {
        let (here, after) = v[i * s..(i + 2) * s].split_at_mut(s);
        for ((v, after), f) in here.iter_mut().zip(after.iter()).zip(&f[i * s..(i + 1) * s]) {
            *v = std::array::from_fn(|c| v[c] - f.after * after[c]);
        }
    }
}
