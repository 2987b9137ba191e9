use super::krylov::{Krylov, MAX_PRODUCTS};
use super::{BlockMatrix, LinearSolver, refill, solved, solved_in, stalled};
use crate::error::Failure;
use crate::parallel;
use crate::work::Work;

/// BiCGSTAB preconditioned by the inverted blocks of the diagonal, for B coupled unknowns a node
///
/// For implicit steps in which a wave crosses few cells, so that these blocks dominate. The iterations counted are
/// products with the matrix.
///
/// # Source
/// van der Vorst, *Bi-CGSTAB: a fast and smoothly converging variant of Bi-CG* (1992).
#[derive(Debug, Clone, Default)]
pub struct BlockBicgstab<const B: usize> {
    inverses: Vec<[[f64; B]; B]>,
    krylov: Krylov<B>,
}

impl<const D: usize, const S: usize, const B: usize> LinearSolver<D, S, B, [[f64; B]; B]> for BlockBicgstab<B> {
    fn solve(
        &mut self,
        a: &BlockMatrix<D, S, B>,
        b: &[[f64; B]],
        x: &mut [[f64; B]],
        tolerance: [f64; B],
    ) -> Result<Work, Failure> {
        let Self { inverses, krylov } = self;
        let (r, _) = krylov.prepare(a.patch.padded_len());
        let sizes = a.residual(b, x, r);
        if solved(sizes, tolerance) {
            return Ok(solved_in::<B, [[f64; B]; B]>(0));
        }
        let n = a.patch.pencil_len();
        refill(inverses, a.rows.len(), [[0.0; B]; B]);
        parallel::for_each_row(inverses, n, |p, inverses| {
            for (inverse, row) in inverses.iter_mut().zip(&a.rows[p * n..]) {
                *inverse = invert(row[0]);
            }
        });
        if !sizes.iter().chain(inverses.as_flattened().as_flattened()).all(|v| v.is_finite()) {
            return Err(stalled(a.rows.len() * B, sizes, tolerance, 0));
        }
        let iterations = krylov.solve(a, b, x, tolerance, (1, MAX_PRODUCTS), |v, x| {
            parallel::for_each_row(x, n + 2, |q, x| {
                let Some(p) = a.patch.pencil_in_row(q) else { return };
                let inner = v[q * (n + 2) + 1..].iter().zip(&inverses[p * n..]);
                for (x, (v, inverse)) in x[1..=n].iter_mut().zip(inner) {
                    *x = inverse.map(|row| (0..B).map(|c| row[c] * v[c]).sum());
                }
            });
            a.patch.wrap(x);
        })?;
        Ok(solved_in::<B, [[f64; B]; B]>(iterations))
    }
}

/// The inverse by Gauss–Jordan elimination with row pivots; its entries are not finite where there is none.
pub(super) fn invert<const B: usize>(mut a: [[f64; B]; B]) -> [[f64; B]; B] {
    let mut inverse: [[f64; B]; B] = std::array::from_fn(|r| std::array::from_fn(|c| f64::from(u8::from(r == c))));
    for k in 0..B {
        let pivot = (k..B).max_by(|&p, &q| a[p][k].abs().total_cmp(&a[q][k].abs())).unwrap_or(k);
        a.swap(k, pivot);
        inverse.swap(k, pivot);
        let scale = 1.0 / a[k][k];
        (a[k], inverse[k]) = (a[k].map(|v| v * scale), inverse[k].map(|v| v * scale));
        for r in (0..B).filter(|&r| r != k) {
            let factor = a[r][k];
            for c in 0..B {
                a[r][c] -= factor * a[k][c];
                inverse[r][c] -= factor * inverse[k][c];
            }
        }
    }
    inverse
}

#[cfg(test)]
mod tests {
    use super::invert;

    /// [[0, 2], [4, 2]] needs a pivot and has the inverse [[−1/4, 1/4], [1/2, 0]]; a singular block has none.
    #[test]
    fn blocks_are_inverted_with_pivots() {
        assert_eq!(invert([[0.0, 2.0], [4.0, 2.0]]), [[-0.25, 0.25], [0.5, 0.0]]);
        assert!(invert([[1.0, 2.0], [2.0, 4.0]]).as_flattened().iter().any(|v| !v.is_finite()));
    }
}
