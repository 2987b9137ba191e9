//! Incomplete elimination on the nine points of two dimensions.

use super::block::invert;
use super::{BlockMatrix, refill};

/// ILU(0), line by line of the lattice, for B coupled unknowns a node; couplings around periodic axes are left out
///
/// # Source
/// Saad, *Iterative Methods for Sparse Linear Systems*, 2nd ed. (2003), section 10.3.
#[derive(Debug, Clone, Default)]
pub(super) struct Ilu<const B: usize> {
    /// At each place of a padded vector: the inverse of the pivot, then the entries of both factors, the upper ones
    /// divided by the pivot. Zero on the ring.
    rows: Vec<[[[f64; B]; B]; 9]>,
}

/// The points below a node in the order of elimination, and those above it. The neighbour along the line comes last:
/// its value is the newest, and the computation would wait for it.
const BELOW: [usize; 4] = [5, 1, 6, 3];
const ABOVE: [usize; 4] = [7, 2, 8, 4];

/// For a point below and a point above that one: the point of the row to which both steps together lead, if it is in
/// the stencil.
const MEETS: [[Option<usize>; 4]; 4] = {
    let points = BlockMatrix::<2, 9, 1>::POINTS;
    let mut meets = [[None; 4]; 4];
    let mut l = 0;
    while l < 4 {
        let mut u = 0;
        while u < 4 {
            let (below, above) = (points[BELOW[l]], points[ABOVE[u]]);
            let mut s = 0;
            while s < 9 {
                if points[s][0] == below[0] + above[0] && points[s][1] == below[1] + above[1] {
                    meets[l][u] = Some(s);
                }
                s += 1;
            }
            u += 1;
        }
        l += 1;
    }
    meets
};

impl<const B: usize> Ilu<B> {
    /// Factorises; false where a pivot has no inverse.
    pub fn factorise(&mut self, a: &BlockMatrix<2, 9, B>) -> bool {
        let factors = &mut self.rows;
        refill(factors, a.patch.padded_len(), [[[0.0; B]; B]; 9]);
        let offsets = a.offsets();
        let mut sound = true;
        for (row, k) in a.rows.iter().zip(a.patch.places()) {
            let mut row = *row;
            for (l, &below) in BELOW.iter().enumerate() {
                let other = &factors[k.wrapping_add_signed(offsets[below])];
                let factor = row[below];
                row[below] = product(&factor, &other[0]);
                for (u, &above) in ABOVE.iter().enumerate() {
                    if let Some(s) = MEETS[l][u] {
                        let filled = product(&factor, &other[above]);
                        for (entry, filled) in row[s].as_flattened_mut().iter_mut().zip(filled.as_flattened()) {
                            *entry -= filled;
                        }
                    }
                }
            }
            row[0] = invert(row[0]);
            for above in ABOVE {
                row[above] = product(&row[0], &row[above]);
            }
            sound &= row[0].as_flattened().iter().all(|v| v.is_finite());
            factors[k] = row;
        }
        sound
    }

    /// Sets x to (L U)⁻¹ v, with its ring ready for a product with the matrix.
    pub fn solve(&self, a: &BlockMatrix<2, 9, B>, v: &[[f64; B]], x: &mut [[f64; B]]) {
        let factors = &self.rows;
        let (offsets, n) = (a.offsets(), a.patch.pencil_len());
        // images of periodic axes are not solved for: they start as zero
        x.fill([0.0; B]);
        for start in a.patch.pencils() {
            for k in start..start + n {
                let mut sum = v[k];
                for below in BELOW {
                    subtract(&factors[k][below], &x[k.wrapping_add_signed(offsets[below])], &mut sum);
                }
                x[k] = sum;
            }
        }
        for p in (0..a.patch.pencil_count()).rev() {
            let start = a.patch.pencil(p);
            for k in (start..start + n).rev() {
                let mut sum: [f64; B] = std::array::from_fn(|r| (0..B).map(|c| factors[k][0][r][c] * x[k][c]).sum());
                for above in ABOVE {
                    subtract(&factors[k][above], &x[k.wrapping_add_signed(offsets[above])], &mut sum);
                }
                x[k] = sum;
            }
        }
        a.patch.wrap(x);
    }
}

#[inline(always)]
fn product<const B: usize>(a: &[[f64; B]; B], b: &[[f64; B]; B]) -> [[f64; B]; B] {
    std::array::from_fn(|r| std::array::from_fn(|c| (0..B).map(|i| a[r][i] * b[i][c]).sum()))
}

#[inline(always)]
fn subtract<const B: usize>(a: &[[f64; B]; B], x: &[f64; B], sum: &mut [f64; B]) {
    for (sum, row) in sum.iter_mut().zip(a) {
        (0..B).for_each(|c| *sum -= row[c] * x[c]);
    }
}
