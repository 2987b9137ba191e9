use super::LatticeMatrix;
use crate::geometry::Patch;

/// Alternating-direction factorisation of I + X + Y, as a preconditioner
///
/// ```text
/// A ≈ (I + X)(I + Y),   X and Y the parts of the star along each axis
/// ```
///
/// The product differs from A by XY, small while Δt/h² is moderate; each factor is a set of tridiagonal systems along
/// the lines of the lattice, eliminated once for many right-hand sides. In one dimension it is the exact inverse.
/// Couplings to corners and around periodic axes are left to the iteration.
#[derive(Debug, Default)]
pub(super) struct Adi {
    /// For each axis and place in a padded vector: multiplier of the value below, upper entry, and pivot⁻¹.
    axes: Vec<Vec<[f64; 3]>>,
}

impl Adi {
    /// Eliminates all lines of a matrix, reusing the memory. False where a pivot is not positive.
    pub fn factorise<const D: usize, const S: usize>(&mut self, a: &LatticeMatrix<D, S>) -> bool {
        let patch = &a.patch;
        let n = patch.pencil_len();
        let strides = patch.padded_strides();
        self.axes.resize_with(D, Vec::new);
        let mut sound = true;
        for (axis, factors) in self.axes.iter_mut().enumerate() {
            let s = strides[axis];
            factors.clear();
            factors.resize(patch.padded_len(), [0.0; 3]);
            for (p, start) in patch.pencils().enumerate() {
                for (j, row) in a.rows[p * n..(p + 1) * n].iter().enumerate() {
                    let k = start + j;
                    let (below, above) = (row[1 + 2 * axis], row[2 + 2 * axis]);
                    // The diagonal less the identity is shared such that each part sums to zero along its line,
                    // what is left over going to both alike.
                    let star: f64 = row[1..=2 * D].iter().sum();
                    let diagonal = 1.0 - (below + above) + (row[0] - 1.0 + star) / D as f64;
                    let [_, above_before, inverse_before] = factors[k - s];
                    let multiplier = below * inverse_before;
                    let pivot = diagonal - multiplier * above_before;
                    sound &= pivot > 1e-8;
                    factors[k] = [multiplier, above, 1.0 / pivot];
                }
            }
        }
        sound
    }

    /// v ← ((I + X)(I + Y))⁻¹ v on the unknowns of a padded vector whose ring is zero.
    pub fn solve<const D: usize, const K: usize>(&self, patch: &Patch<D>, v: &mut [[f64; K]]) {
        let strides = patch.padded_strides();
        for axis in 0..D {
            let (n, s) = (patch.size[axis], strides[axis]);
            let len = s * (n + 2);
            for (v, f) in v.chunks_exact_mut(len).zip(self.axes[axis].chunks_exact(len)) {
                if s == 1 { line(&mut v[1..=n], &f[1..=n]) } else { plane(v, f, n, s) }
            }
        }
    }
}

/// One line that is contiguous in memory.
fn line<const K: usize>(v: &mut [[f64; K]], f: &[[f64; 3]]) {
    let mut before = [0.0; K];
    for (v, [multiplier, _, _]) in v.iter_mut().zip(f) {
        for c in 0..K {
            v[c] -= multiplier * before[c];
        }
        before = *v;
    }
    let mut after = [0.0; K];
    for (v, [_, above, inverse]) in v.iter_mut().zip(f).rev() {
        for c in 0..K {
            v[c] = (v[c] - above * after[c]) * inverse;
        }
        after = *v;
    }
}

/// All lines of one plane at once, `s` apart in memory: the loop over lines is the inner one.
fn plane<const K: usize>(v: &mut [[f64; K]], f: &[[f64; 3]], n: usize, s: usize) {
    for i in 1..=n {
        let (before, here) = v[(i - 1) * s..(i + 1) * s].split_at_mut(s);
        for ((v, before), [multiplier, _, _]) in here.iter_mut().zip(before.iter()).zip(&f[i * s..(i + 1) * s]) {
            for c in 0..K {
                v[c] -= multiplier * before[c];
            }
        }
    }
    for i in (1..=n).rev() {
        let (here, after) = v[i * s..(i + 2) * s].split_at_mut(s);
        for ((v, after), [_, above, inverse]) in here.iter_mut().zip(after.iter()).zip(&f[i * s..(i + 1) * s]) {
            for c in 0..K {
                v[c] = (v[c] - above * after[c]) * inverse;
            }
        }
    }
}
