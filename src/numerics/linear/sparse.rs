use crate::error::Failure;
use faer::linalg::solvers::Solve;
use faer::sparse::linalg::solvers::{Lu, SymbolicLu};
use faer::sparse::{SparseColMat, Triplet};

/// Largest number of solves with the factors: the first one, and refinements by the residual.
const PASSES: usize = 4;

/// A square sparse system of any pattern, solved by faer's sparse LU with refinement
///
/// For rows that are no stencil of a patch: one-sided differences on sides, windows that are shifted near walls. Runs
/// on one thread.
///
/// # Example
/// ```
/// use driftmesh::numerics::linear::SparseSystem;
/// let mut system = SparseSystem::new(2);
/// [(0, 0, 2.0), (0, 1, 1.0), (1, 0, 1.0), (1, 1, 3.0)].map(|(row, column, a)| system.add(row, column, a));
/// assert_eq!(system.solve(&[4.0, 7.0])?, [1.0, 2.0]);
/// # Ok::<(), driftmesh::Failure>(())
/// ```
#[derive(Clone, Default)]
pub struct SparseSystem {
    unknowns: usize,
    entries: Vec<(usize, usize, f64)>,
    analysed: Option<(Pattern, SymbolicLu<usize>)>,
}

/// (row, column) of all entries.
type Pattern = Vec<(usize, usize)>;

impl std::fmt::Debug for SparseSystem {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SparseSystem").field("unknowns", &self.unknowns).field("entries", &self.entries).finish()
    }
}

impl SparseSystem {
    /// A system of zeros.
    pub fn new(unknowns: usize) -> Self {
        Self { unknowns, ..Self::default() }
    }

    /// Sets all entries to zero for another matrix; the analysis is reused if that has the same pattern.
    pub fn clear(&mut self) {
        self.entries.clear();
    }

    /// Adds to an entry of the matrix.
    pub fn add(&mut self, row: usize, column: usize, a: f64) {
        self.entries.push((row, column, a));
    }

    /// The solution of A x = b. In every row the residual is at most 1e-13 of |A||x| + |b|.
    ///
    /// # Errors
    /// [`Failure::LinearStalled`] where this bound is not met: the matrix is singular, or nearly so.
    pub fn solve(&mut self, b: &[f64]) -> Result<Vec<f64>, Failure> {
        /// Largest residual of a row, as a share of the sum of the absolute values of its terms: some round-offs.
        const TOLERANCE: f64 = 1e-13;
        let n = self.unknowns;
        let mut x = vec![0.0; n];
        let mut r = b.to_vec();
        let mut miss = f64::INFINITY;
        if let Some(lu) = self.factorise() {
            for _pass in 0..PASSES {
                let mut correction = faer::Mat::<f64>::from_fn(n, 1, |i, _| r[i]);
                lu.solve_in_place(&mut correction);
                (0..n).for_each(|i| x[i] += correction[(i, 0)]);
                let mut size: Vec<f64> = b.iter().map(|b| b.abs()).collect();
                r.copy_from_slice(b);
                for &(row, column, a) in &self.entries {
                    r[row] -= a * x[column];
                    size[row] += (a * x[column]).abs();
                }
                let worst = (0..n).map(|i| if r[i] == 0.0 { 0.0 } else { r[i] / size[i] });
                miss = worst.fold(0.0, crate::numerics::larger);
                if miss <= TOLERANCE {
                    return Ok(x);
                }
                if !miss.is_finite() {
                    break;
                }
            }
        }
        Err(Failure::LinearStalled { unknowns: n, residual: miss, tolerance: TOLERANCE, iterations: 0 })
    }

    fn factorise(&mut self) -> Option<Lu<usize, f64>> {
        let entries: Vec<Triplet<usize, usize, f64>> =
            self.entries.iter().map(|&(row, column, a)| Triplet::new(row, column, a)).collect();
        let matrix = SparseColMat::try_new_from_triplets(self.unknowns, self.unknowns, &entries).ok()?;
        let pattern = self.entries.iter().map(|&(row, column, _)| (row, column));
        if self.analysed.as_ref().is_none_or(|(known, _)| !known.iter().copied().eq(pattern.clone())) {
            self.analysed = Some((pattern.collect(), SymbolicLu::try_new(matrix.symbolic()).ok()?));
        }
        let (_, symbolic) = self.analysed.as_ref()?;
        Lu::try_new_with_symbolic(symbolic.clone(), matrix.as_ref()).ok()
    }
}
