use super::{Entry, LatticeMatrix, LinearSolver, krylov::add, solved, solved_in, stalled};
use crate::error::Failure;
use crate::geometry::Patch;
use crate::work::Work;
use faer::linalg::solvers::Solve;
use faer::sparse::linalg::solvers::{Lu, SymbolicLu};
use faer::sparse::{SparseColMat, Triplet};

/// Sparse LU by faer: the reference of the tests, and the fallback where an iteration stalls
///
/// The symbolic factorisation is reused as long as the patch stays the same. It runs on one thread, so that its bits do
/// not depend on the number of threads.
#[derive(Clone, Default)]
pub struct SparseLu {
    symbolic: Option<(Vec<usize>, SymbolicLu<usize>)>,
}

impl std::fmt::Debug for SparseLu {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SparseLu").field("analysed", &self.symbolic.as_ref().map(|s| &s.0)).finish()
    }
}

impl SparseLu {
    fn factorise<const D: usize, const S: usize, const K: usize, E: Entry<K>>(
        &mut self,
        a: &LatticeMatrix<D, S, E>,
    ) -> Option<Lu<usize, f64>> {
        let matrix = assemble(a)?;
        let wraps = a.patch.wraps.iter().map(|&w| usize::from(w));
        let pattern: Vec<usize> = a.patch.size.into_iter().chain(wraps).chain([S, E::COUPLED]).collect();
        if self.symbolic.as_ref().is_none_or(|(known, _)| *known != pattern) {
            self.symbolic = Some((pattern, SymbolicLu::try_new(matrix.symbolic()).ok()?));
        }
        let (_, symbolic) = self.symbolic.as_ref()?;
        Lu::try_new_with_symbolic(symbolic.clone(), matrix.as_ref()).ok()
    }
}

/// The matrix of the unknowns alone. Entries for the ring are dropped, since corrections vanish there.
fn assemble<const D: usize, const S: usize, const K: usize, E: Entry<K>>(
    a: &LatticeMatrix<D, S, E>,
) -> Option<SparseColMat<usize, f64>> {
    let Patch { size, wraps, .. } = a.patch;
    let strides = crate::geometry::strides(size);
    let block = E::COUPLED;
    let mut entries = Vec::with_capacity(a.rows.len() * S * block * block);
    for (i, row) in a.rows.iter().enumerate() {
        'points: for (point, entry) in LatticeMatrix::<D, S, E>::POINTS.iter().zip(row) {
            let mut column = 0;
            for d in 0..D {
                let k = (i / strides[d] % size[d]) as isize + point[d];
                let n = size[d] as isize;
                if !wraps[d] && !(0..n).contains(&k) {
                    continue 'points;
                }
                column += k.rem_euclid(n) as usize * strides[d];
            }
            for (r, c) in (0..block).flat_map(|r| (0..block).map(move |c| (r, c))) {
                entries.push(Triplet::new(i * block + r, column * block + c, entry.coefficient(r, c)));
            }
        }
    }
    let n = a.rows.len() * block;
    SparseColMat::try_new_from_triplets(n, n, &entries).ok()
}

impl<const D: usize, const S: usize, const K: usize, E: Entry<K>> LinearSolver<D, S, K, E> for SparseLu {
    fn solve(
        &mut self,
        a: &LatticeMatrix<D, S, E>,
        b: &[[f64; K]],
        x: &mut [[f64; K]],
        tolerance: [f64; K],
    ) -> Result<Work, Failure> {
        let n = a.patch.pencil_len();
        let mut r = vec![[0.0; K]; a.patch.padded_len()];
        let mut sizes = a.residual(b, x, &mut r);
        if solved(sizes, tolerance) {
            return Ok(solved_in::<K, E>(0));
        }
        if let Some(lu) = self.factorise(a) {
            // the first pass solves, the others refine the solution by its residual
            for _pass in 0..3 {
                // the values of one system stand below each other, systems side by side
                let at = |i: usize, c: usize| (i * E::COUPLED + c % E::COUPLED, c / E::COUPLED);
                let mut unknowns = faer::Mat::<f64>::zeros(a.rows.len() * E::COUPLED, K / E::COUPLED);
                let places = || a.patch.pencils().flat_map(|start| start..start + n).enumerate();
                for (i, k) in places() {
                    (0..K).for_each(|c| unknowns[at(i, c)] = r[k][c]);
                }
                lu.solve_in_place(&mut unknowns);
                let mut correction = vec![[0.0; K]; a.patch.padded_len()];
                for (i, k) in places() {
                    correction[k] = std::array::from_fn(|c| unknowns[at(i, c)]);
                }
                a.patch.wrap(&mut correction);
                add(x, [1.0; K], &correction);
                let before = std::mem::replace(&mut sizes, a.residual(b, x, &mut r));
                if solved(sizes, tolerance) {
                    return Ok(solved_in::<K, E>(0));
                }
                if !sizes.iter().all(|size| size.is_finite()) {
                    sizes = before; // the matrix is singular
                    break;
                }
            }
        }
        Err(stalled(a.rows.len() * E::COUPLED, sizes, tolerance, 0))
    }
}
