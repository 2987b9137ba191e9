use super::coarse::Cycle;
use super::krylov::{Krylov, MAX_PRODUCTS};
use super::{BlockMatrix, LinearSolver, solved, solved_in, stalled};
use crate::error::Failure;
use crate::work::Work;

/// BiCGSTAB preconditioned by a cycle of multigrid with incomplete elimination, for B coupled unknowns a node on the
/// nine points of two dimensions
///
/// For implicit steps of convection and diffusion, whose matrices are neither symmetric nor dominated by their star.
/// Couplings around periodic axes are left to the iteration on each level. The iterations counted are products with the
/// matrix. Where cells are so flat and sheared that coarse levels do harm, elimination alone takes over.
///
/// # Source
/// Trottenberg, Oosterlee, Schüller, *Multigrid*, Academic Press (2001), 7.8; van der Vorst, *Bi-CGSTAB* (1992).
#[derive(Debug, Clone, Default)]
pub struct TransportBicgstab<const B: usize> {
    cycle: Cycle<B>,
    krylov: Krylov<B>,
}

/// Largest number of products with the matrix in a solve with coarse levels, before elimination alone is tried. It
/// takes four to ten where levels are of use, on any lattice.
const PATIENCE: usize = 24;

impl<const B: usize> LinearSolver<2, 9, B, [[f64; B]; B]> for TransportBicgstab<B> {
    fn solve(
        &mut self,
        a: &BlockMatrix<2, 9, B>,
        b: &[[f64; B]],
        x: &mut [[f64; B]],
        tolerance: [f64; B],
    ) -> Result<Work, Failure> {
        let Self { cycle, krylov } = self;
        let (r, _) = krylov.prepare(a.patch.padded_len());
        let sizes = a.residual(b, x, r);
        if solved(sizes, tolerance) {
            return Ok(solved_in::<B, [[f64; B]; B]>(0));
        }
        if !sizes.iter().all(|size| size.is_finite()) || !cycle.build(a) {
            return Err(stalled(a.rows.len() * B, sizes, tolerance, 0));
        }
        let guess = x.to_vec();
        let most = if cycle.has_levels() { PATIENCE } else { MAX_PRODUCTS };
        let iterations = match krylov.solve(a, b, x, tolerance, (1, most), |v, x| cycle.solve(a, v, x)) {
            Ok(iterations) => iterations,
            Err(Failure::LinearStalled { iterations, .. }) if cycle.has_levels() => {
                x.copy_from_slice(&guess);
                krylov.prepare(a.patch.padded_len());
                let eliminate = |v: &[[f64; B]], x: &mut [[f64; B]]| cycle.eliminate(a, v, x);
                iterations + krylov.solve(a, b, x, tolerance, (1, MAX_PRODUCTS), eliminate)?
            }
            Err(other) => return Err(other),
        };
        Ok(solved_in::<B, [[f64; B]; B]>(iterations))
    }
}
