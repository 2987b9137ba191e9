//! Linear systems on a patch of the lattice.
//!
//! A [`LatticeMatrix`] couples every unknown of a [`Patch`] to its nearest neighbours. The trait [`LinearSolver`] has
//! these implementations: [`Bicgstab`] is the fast one, [`BlockBicgstab`] is for several unknowns at a node,
//! [`SparseLu`] is the reference and the last resort, and [`Fallback`] tries one solver after another.

mod adi;
mod bicgstab;
mod block;
mod block_line;
mod coarse;
mod elimination;
mod ilu;
mod krylov;
mod lu;
mod multigrid;
mod pcg;
mod relaxation;
mod sparse;
mod transport;
mod tridiagonal;

pub use bicgstab::Bicgstab;
pub use block::BlockBicgstab;
pub use block_line::BlockElimination;
pub use elimination::Elimination;
pub use lu::SparseLu;
pub use pcg::Pcg;
pub use relaxation::{Smoother, relax};
pub use sparse::SparseSystem;
pub use transport::TransportBicgstab;
pub use tridiagonal::tridiagonal;

use super::larger;
use crate::error::Failure;
use crate::geometry::Patch;
use crate::parallel;
use crate::work::Work;

/// A matrix whose rows couple a node of a patch to itself and its nearest neighbours
///
/// Each row holds S coefficients. The first 2D + 1 belong to the star: the node, then its neighbours below and above
/// along each axis in turn. In two dimensions S = 9 adds the corners (−,−), (−,+), (+,−), (+,+).
///
/// Rows are scaled such that the identity in `I − Δt A` has weight one; solvers rely on it.
///
/// An [`Entry`] is a number, or a block that couples the unknowns of a node ([`BlockMatrix`]).
#[derive(Debug, Clone)]
pub struct LatticeMatrix<const D: usize, const S: usize, E = f64> {
    /// The unknowns.
    pub patch: Patch<D>,
    /// One row an unknown, last axis fastest.
    pub rows: Vec<[E; S]>,
}

/// A matrix that couples B unknowns at a node. The rows of each block are the equations of the node.
pub type BlockMatrix<const D: usize, const S: usize, const B: usize> = LatticeMatrix<D, S, [[f64; B]; B]>;

/// The entry of a matrix for a pair of nodes, and how it acts on the K values at one of them
///
/// A number acts on each of the K values: they belong to K systems that share the matrix. A block mixes them: they are
/// the K unknowns of one system.
pub trait Entry<const K: usize>: Copy + Send + Sync {
    /// Number of the K values that belong to one system.
    const COUPLED: usize;

    /// Adds the product with the values of a node to `sum`.
    fn add_product(&self, x: &[f64; K], sum: &mut [f64; K]);

    /// The coefficient of unknown `column` in equation `row`, both below `COUPLED`.
    fn coefficient(&self, row: usize, column: usize) -> f64;
}

impl<const K: usize> Entry<K> for f64 {
    const COUPLED: usize = 1;

    fn add_product(&self, x: &[f64; K], sum: &mut [f64; K]) {
        (0..K).for_each(|c| sum[c] += self * x[c]);
    }

    fn coefficient(&self, _row: usize, _column: usize) -> f64 {
        *self
    }
}

impl<const K: usize> Entry<K> for [[f64; K]; K] {
    const COUPLED: usize = K;

    fn add_product(&self, x: &[f64; K], sum: &mut [f64; K]) {
        for (sum, row) in sum.iter_mut().zip(self) {
            (0..K).for_each(|c| *sum += row[c] * x[c]);
        }
    }

    fn coefficient(&self, row: usize, column: usize) -> f64 {
        self[row][column]
    }
}

impl<const D: usize, const S: usize> LatticeMatrix<D, S> {
    /// A matrix of zeros.
    pub fn zero(patch: Patch<D>) -> Self {
        Self { patch, rows: vec![[0.0; S]; patch.len()] }
    }
}

impl<const D: usize, const S: usize, const B: usize> BlockMatrix<D, S, B> {
    /// A matrix of zero blocks.
    pub fn zero_blocks(patch: Patch<D>) -> Self {
        Self { patch, rows: vec![[[[0.0; B]; B]; S]; patch.len()] }
    }
}

impl<const D: usize, const S: usize, E> LatticeMatrix<D, S, E> {
    /// Offsets of the S points of the stencil from the node, in units of nodes along each axis.
    pub const POINTS: [[isize; D]; S] = {
        assert!(S == 2 * D + 1 || (D == 2 && S == 9), "a star, or the nine points of two dimensions");
        let mut points = [[0; D]; S];
        let mut d = 0;
        while d < D {
            points[1 + 2 * d][d] = -1;
            points[2 + 2 * d][d] = 1;
            d += 1;
        }
        let mut corner = 2 * D + 1;
        while corner < S {
            let c = corner - (2 * D + 1);
            points[corner][0] = if c < 2 { -1 } else { 1 };
            points[corner][1] = if c.is_multiple_of(2) { -1 } else { 1 };
            corner += 1;
        }
        points
    };

    /// Offsets of the S points of the stencil in a padded vector.
    pub fn offsets(&self) -> [isize; S] {
        let strides = self.patch.padded_strides();
        Self::POINTS.map(|p| (0..D).map(|d| p[d] * strides[d] as isize).sum())
    }

    /// Sets the unknowns of `out` to `f(place in rows, place in a padded vector, A x)`.
    fn apply<const K: usize>(
        &self,
        x: &[[f64; K]],
        out: &mut [[f64; K]],
        f: impl Fn(usize, usize, [f64; K]) -> [f64; K] + Sync,
    ) where
        E: Entry<K>,
    {
        let offsets = self.offsets();
        let n = self.patch.pencil_len();
        parallel::for_each_row(out, n + 2, |q, out| {
            let Some(p) = self.patch.pencil_in_row(q) else { return };
            let rows = &self.rows[p * n..(p + 1) * n];
            let neighbours: [&[[f64; K]]; S] = offsets.map(|o| {
                let first = (q * (n + 2) + 1).wrapping_add_signed(o);
                &x[first..first + n]
            });
            for (j, (row, out)) in rows.iter().zip(&mut out[1..=n]).enumerate() {
                let mut sum = [0.0; K];
                for s in 0..S {
                    row[s].add_product(&neighbours[s][j], &mut sum);
                }
                *out = f(p * n + j, q * (n + 2) + 1 + j, sum);
            }
        });
    }

    /// `out` = A x on the unknowns of padded vectors.
    pub fn multiply<const K: usize>(&self, x: &[[f64; K]], out: &mut [[f64; K]])
    where
        E: Entry<K>,
    {
        self.apply(x, out, |_, _, ax| ax);
    }

    /// `out` = v − A x on the unknowns of padded vectors.
    fn difference<const K: usize>(&self, v: &[[f64; K]], x: &[[f64; K]], out: &mut [[f64; K]])
    where
        E: Entry<K>,
    {
        self.apply(x, out, |_, k, ax| std::array::from_fn(|c| v[k][c] - ax[c]));
    }

    /// `out` = b − A x on the unknowns of padded vectors; `b` has one value for each unknown, and the ring of `out` is
    /// zero. Returns the largest |b − A x| of each right-hand side, NaN where there is one.
    pub fn residual<const K: usize>(&self, b: &[[f64; K]], x: &[[f64; K]], out: &mut [[f64; K]]) -> [f64; K]
    where
        E: Entry<K>,
    {
        self.apply(x, out, |i, _, ax| std::array::from_fn(|c| b[i][c] - ax[c]));
        let mut sizes = [0.0; K];
        for r in out {
            (0..K).for_each(|c| sizes[c] = larger(sizes[c], r[c]));
        }
        sizes
    }
}

/// Sets a vector to so many copies of a value, in the memory that it has.
fn refill<T: Clone>(v: &mut Vec<T>, len: usize, value: T) {
    v.clear();
    v.resize(len, value);
}

/// True where every right-hand side has met its tolerance; false where one is NaN.
fn solved<const K: usize>(sizes: [f64; K], tolerance: [f64; K]) -> bool {
    sizes.iter().zip(tolerance).all(|(size, tolerance)| *size <= tolerance)
}

/// The failure of a solve, named by the right-hand side that is furthest from its tolerance.
fn stalled<const K: usize>(unknowns: usize, sizes: [f64; K], tolerance: [f64; K], iterations: usize) -> Failure {
    let miss = |c: &usize| sizes[*c] / tolerance[*c];
    let worst = (0..K).max_by(|a, b| miss(a).total_cmp(&miss(b))).unwrap_or(0);
    Failure::LinearStalled { unknowns, residual: sizes[worst], tolerance: tolerance[worst], iterations }
}

/// Solves A x = b for K right-hand sides that share one matrix, or for K unknowns a node where the entries are blocks
///
/// `b` has one value for each unknown. `x` is padded. On entry its ring holds the known values and its unknowns the
/// guess; on success its unknowns hold the solution, and images of wrapping axes have changed with it. The largest
/// residual of right-hand side or equation c, computed from the solution itself, is then at most `tolerance[c]`, in the
/// unit of b. Returns the work: the number of systems solved and the iterations of all of them together, 0 for a direct
/// method.
///
/// # Errors
/// [`Failure::LinearStalled`] with the residual reached; `x` then holds no solution.
pub trait LinearSolver<const D: usize, const S: usize, const K: usize, E = f64>: Send {
    /// See the trait.
    fn solve(
        &mut self,
        a: &LatticeMatrix<D, S, E>,
        b: &[[f64; K]],
        x: &mut [[f64; K]],
        tolerance: [f64; K],
    ) -> Result<Work, Failure>;
}

/// The work of a solve for K values at each node, with its number of iterations.
fn solved_in<const K: usize, E: Entry<K>>(linear_iterations: usize) -> Work {
    Work { linear_solves: K / E::COUPLED, linear_iterations, ..Work::default() }
}

/// One solver, and a second one for the systems on which the first fails. The work counts these, by their cause.
#[derive(Debug, Clone, Default)]
pub struct Fallback<First, Then>(First, Then);

/// The usual solver of this library: fast where it converges, direct elimination where it does not.
pub type Robust<const K: usize> = Fallback<Bicgstab<K>, SparseLu>;

/// [`Robust`] for B unknowns at a node that convection and diffusion couple to all nine points around it.
pub type RobustTransport<const B: usize> = Fallback<TransportBicgstab<B>, SparseLu>;

/// [`RobustTransport`] on a line.
pub type RobustLine = Fallback<BlockElimination, SparseLu>;

/// [`Robust`] for B coupled unknowns at a node.
pub type RobustBlock<const B: usize> = Fallback<BlockBicgstab<B>, SparseLu>;

impl<const D: usize, const S: usize, const K: usize, E, First, Then> LinearSolver<D, S, K, E> for Fallback<First, Then>
where
    First: LinearSolver<D, S, K, E>,
    Then: LinearSolver<D, S, K, E>,
{
    fn solve(
        &mut self,
        a: &LatticeMatrix<D, S, E>,
        b: &[[f64; K]],
        x: &mut [[f64; K]],
        tolerance: [f64; K],
    ) -> Result<Work, Failure> {
        let guess = x.to_vec();
        let gave_up = match self.0.solve(a, b, x, tolerance) {
            Ok(work) => return Ok(work),
            Err(failure) => failure,
        };
        x.copy_from_slice(&guess);
        let mut work = self.1.solve(a, b, x, tolerance)?;
        match gave_up {
            // a first solver that could begin has done at least one iteration
            Failure::LinearStalled { iterations: 0, .. } => work.direct_unstarted += work.linear_solves,
            Failure::LinearStalled { iterations, .. } => {
                work.direct_stalled += work.linear_solves;
                work.linear_iterations += iterations;
            }
            _ => work.direct_stalled += work.linear_solves,
        }
        Ok(work)
    }
}

#[cfg(test)]
mod tests;
