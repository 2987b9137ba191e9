use super::krylov::{Krylov, MAX_PRODUCTS, add};
use super::{LatticeMatrix, LinearSolver, adi::Adi, refill, solved, solved_in, stalled};
use crate::error::Failure;
use crate::work::Work;

/// Alternating-direction cycles, and BiCGSTAB preconditioned by them where they are slow, for all right-hand sides at
/// once
///
/// A mesh equation takes a few cycles, whose number of sweeps grows with the logarithm of Δt/h² (`make bench` counts
/// them). Corners, strong convection and periodic axes need the Krylov method. The iterations counted are sweeps.
///
/// For lattices of one and two axes; alternating directions of three diverge, and do not compile:
///
/// ```compile_fail
/// use driftmesh::{geometry::Patch, numerics::linear::{Bicgstab, LatticeMatrix, LinearSolver}};
/// let matrix = LatticeMatrix::<3, 7>::zero(Patch { origin: [1; 3], size: [2; 3], wraps: [false; 3] });
/// let _ = Bicgstab::<1>::default().solve(&matrix, &[[1.0]; 8], &mut [[0.0]; 64], [1e-9]);
/// ```
///
/// The same lines for two axes do:
///
/// ```
/// use driftmesh::{geometry::Patch, numerics::linear::{Bicgstab, LatticeMatrix, LinearSolver}};
/// let matrix = LatticeMatrix::<2, 5>::zero(Patch { origin: [1; 2], size: [2; 2], wraps: [false; 2] });
/// let _ = Bicgstab::<1>::default().solve(&matrix, &[[1.0]; 4], &mut [[0.0]; 16], [1e-9]);
/// ```
///
/// # Source
/// Peaceman and Rachford (1955); van der Vorst, *Bi-CGSTAB: a fast and smoothly converging variant of Bi-CG* (1992).
#[derive(Debug, Clone, Default)]
pub struct Bicgstab<const K: usize> {
    adi: Adi,
    krylov: Krylov<K>,
    scratch: Vec<[f64; K]>,
}

/// BiCGSTAB takes over once a cycle leaves more than this share of the residual.
const SLOW: f64 = 0.1;

impl<const D: usize, const S: usize, const K: usize> LinearSolver<D, S, K> for Bicgstab<K> {
    fn solve(
        &mut self,
        a: &LatticeMatrix<D, S>,
        b: &[[f64; K]],
        x: &mut [[f64; K]],
        tolerance: [f64; K],
    ) -> Result<Work, Failure> {
        let Self { adi, krylov, scratch } = self;
        refill(scratch, a.patch.padded_len(), [0.0; K]);
        let (r, hat) = krylov.prepare(a.patch.padded_len());
        let mut sizes = a.residual(b, x, r);
        if solved(sizes, tolerance) {
            return Ok(solved_in::<K, f64>(0));
        }
        if !sizes.iter().all(|s| s.is_finite()) || !adi.factorise(a) {
            return Err(stalled(a.rows.len(), sizes, tolerance, 0));
        }
        let mut products = 0;
        // for a bounded star without convection the cycles alone converge
        loop {
            products += adi.sweeps();
            adi.cycle(a, r, hat, scratch);
            add(x, [1.0; K], hat);
            let before = std::mem::replace(&mut sizes, a.residual(b, x, r));
            if solved(sizes, tolerance) {
                return Ok(solved_in::<K, f64>(products));
            }
            if !(0..K).all(|c| sizes[c] <= tolerance[c] || sizes[c] < SLOW * before[c]) {
                break;
            }
        }
        let iterations =
            krylov.solve(a, b, x, tolerance, (adi.sweeps(), MAX_PRODUCTS), |v, x| adi.cycle(a, v, x, scratch))?;
        Ok(solved_in::<K, f64>(products + iterations))
    }
}
