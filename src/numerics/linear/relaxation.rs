use super::LatticeMatrix;
use crate::parallel;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The weights of successive relaxation sweeps.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Smoother {
    /// Damped Jacobi, x ← x + .9 D⁻¹(b − A x). k sweeps damp errors that vary over less than about √k nodes.
    Jacobi,
    /// Jacobi with Chebyshev's weights for a given part of the spectrum. k sweeps damp errors that vary over less than
    /// about k nodes.
    #[default]
    Chebyshev,
}

/// Damping factor of Jacobi's method. With 1 the highest frequencies, whose eigenvalue is near 2, would not be damped.
const DAMPING: f64 = 0.9;

/// A number of relaxation sweeps on A x = b, all right-hand sides at once
///
/// ```text
/// d ← p d + q D⁻¹ (b − A x),   x ← x + d,   D the diagonal of A
/// ```
///
/// with p = 0 and q = .9 for Jacobi; for Chebyshev the weights that damp the part [`lowest`, 2] of the spectrum of D⁻¹A
/// evenly, which needs no scalar product. Rows that sum to 1 with off-diagonal entries ≤ 0 have their spectrum in
/// [1/D, 2). `x` is padded like a solver's; its ring stays, images of wrapping axes move along.
///
/// # Source
/// Saad, *Iterative Methods for Sparse Linear Systems*, 2nd ed. (2003), algorithm 12.1.
pub fn relax<const D: usize, const S: usize, const K: usize>(
    a: &LatticeMatrix<D, S>,
    b: &[[f64; K]],
    x: &mut [[f64; K]],
    smoother: Smoother,
    sweeps: usize,
    lowest: f64,
) {
    let (middle, half) = (0.5 * (2.0 + lowest), 0.5 * (2.0 - lowest));
    let (mut d, mut r) = (vec![[0.0; K]; x.len()], vec![[0.0; K]; x.len()]);
    let mut weight = half / middle;
    let n = a.patch.pencil_len();
    for sweep in 0..sweeps {
        let (p, q) = match smoother {
            Smoother::Jacobi => (0.0, DAMPING),
            Smoother::Chebyshev if sweep == 0 => (0.0, 1.0 / middle),
            Smoother::Chebyshev => {
                let before = weight;
                weight = 1.0 / (2.0 * middle / half - before);
                (weight * before, 2.0 * weight / half)
            }
        };
        a.residual(b, x, &mut r);
        parallel::for_each_row(&mut d, n + 2, |row, d| {
            let Some(pencil) = a.patch.pencil_in_row(row) else { return };
            let (rows, r) = (&a.rows[pencil * n..(pencil + 1) * n], &r[row * (n + 2) + 1..][..n]);
            for ((d, r), entries) in d[1..=n].iter_mut().zip(r).zip(rows) {
                let scale = q / entries[0];
                (0..K).for_each(|c| d[c] = p * d[c] + scale * r[c]);
            }
        });
        a.patch.wrap(&mut d);
        for (x, d) in x.iter_mut().zip(&d) {
            (0..K).for_each(|c| x[c] += d[c]);
        }
    }
}
