use super::{LatticeMatrix, LinearSolver, adi::Adi, larger, solved, stalled};
use crate::error::Failure;
use crate::parallel;

/// Alternating-direction cycles, and BiCGSTAB preconditioned by them where they are slow, for all right-hand sides at
/// once
///
/// A mesh equation takes a few cycles, whose sweeps grow with the logarithm of Δt/h² (`make bench` counts them). Corners,
/// strong convection and periodic axes call for the Krylov method. An iteration is a sweep.
///
/// # Source
/// Peaceman and Rachford (1955); van der Vorst, *Bi-CGSTAB: a fast and smoothly converging variant of Bi-CG* (1992).
#[derive(Debug, Clone, Default)]
pub struct Bicgstab<const K: usize> {
    adi: Adi,
    space: [Vec<[f64; K]>; 7],
}

const MAX_PRODUCTS: usize = 2000;
/// A cycle that leaves more than this of the residual calls for the Krylov method.
const SLOW: f64 = 0.1;

impl<const D: usize, const S: usize, const K: usize> LinearSolver<D, S, K> for Bicgstab<K> {
    fn solve(
        &mut self,
        a: &LatticeMatrix<D, S>,
        b: &[[f64; K]],
        x: &mut [[f64; K]],
        tolerance: [f64; K],
    ) -> Result<usize, Failure> {
        let Self { adi, space } = self;
        for v in space.iter_mut() {
            v.clear();
            v.resize(a.patch.padded_len(), [0.0; K]);
        }
        let [r, shadow, p, v, t, hat, scratch] = space;
        let mut sizes = a.residual(b, x, r);
        if solved(sizes, tolerance) {
            return Ok(0);
        }
        if !sizes.iter().all(|s| s.is_finite()) || !adi.factorise(a) {
            return Err(stalled(a.rows.len(), sizes, tolerance, 0));
        }
        let mut products = 0;
        // Where the star is all there is, the cycles alone converge.
        loop {
            products += adi.sweeps();
            adi.cycle(a, r, hat, scratch);
            add(x, [1.0; K], hat);
            let before = std::mem::replace(&mut sizes, a.residual(b, x, r));
            if solved(sizes, tolerance) {
                return Ok(products);
            }
            if !(0..K).all(|c| sizes[c] <= tolerance[c] || sizes[c] < SLOW * before[c]) {
                break;
            }
        }
        // The recursive residual drifts from the true one by round-off; a restart from the true one closes the gap.
        for _restart in 0..4 {
            shadow.copy_from_slice(r);
            p.copy_from_slice(r);
            let mut rho = dot(shadow, r);
            while !solved(sizes, tolerance) {
                products += 2 * adi.sweeps();
                let active = std::array::from_fn(|c| sizes[c] > tolerance[c]);
                adi.cycle(a, p, hat, scratch);
                a.multiply(hat, v);
                let alpha = divide(active, rho, dot(shadow, v));
                sizes = update(r, v, v, |c, r, v, _| r - alpha[c] * v);
                add(x, alpha, hat);
                if solved(sizes, tolerance) {
                    break;
                }
                adi.cycle(a, r, hat, scratch);
                a.multiply(hat, t);
                let omega = divide(active, dot(t, r), dot(t, t));
                add(x, omega, hat);
                sizes = update(r, t, t, |c, r, t, _| r - omega[c] * t);
                let rho_before = std::mem::replace(&mut rho, dot(shadow, r));
                let (gain, step) = (divide(active, rho, rho_before), divide(active, alpha, omega));
                update(p, r, v, |c, p, r, v| r + gain[c] * step[c] * (p - omega[c] * v));
                if products > MAX_PRODUCTS || !sizes.iter().all(|s| s.is_finite()) {
                    return Err(stalled(a.rows.len(), sizes, tolerance, products));
                }
            }
            sizes = a.residual(b, x, r);
            if solved(sizes, tolerance) {
                return Ok(products);
            }
        }
        Err(stalled(a.rows.len(), sizes, tolerance, products))
    }
}

/// x ← x + s v, ring included: the images of wrapping axes move along, other rings of `v` are zero.
fn add<const K: usize>(x: &mut [[f64; K]], s: [f64; K], v: &[[f64; K]]) {
    for (x, v) in x.iter_mut().zip(v) {
        (0..K).for_each(|c| x[c] += s[c] * v[c]);
    }
}

/// Quotients; zero for a right-hand side that is solved already, which then stands still.
fn divide<const K: usize>(active: [bool; K], a: [f64; K], b: [f64; K]) -> [f64; K] {
    std::array::from_fn(|c| if active[c] && b[c] != 0.0 { a[c] / b[c] } else { 0.0 })
}

/// v ← f(component, v, a, b), and the largest magnitudes of the result. Rings stay zero where all three are.
fn update<const K: usize>(
    v: &mut [[f64; K]],
    a: &[[f64; K]],
    b: &[[f64; K]],
    f: impl Fn(usize, f64, f64, f64) -> f64,
) -> [f64; K] {
    let mut sizes = [0.0; K];
    for ((v, a), b) in v.iter_mut().zip(a).zip(b) {
        for c in 0..K {
            v[c] = f(c, v[c], a[c], b[c]);
            sizes[c] = larger(sizes[c], v[c]);
        }
    }
    sizes
}

/// Scalar products in a fixed order; rings are zero and add nothing.
fn dot<const K: usize>(a: &[[f64; K]], b: &[[f64; K]]) -> [f64; K] {
    parallel::sum(a.len(), |range| {
        // four running sums hide the latency of the addition
        let mut sums = [[0.0; K]; 4];
        let ((a4, a1), (b4, b1)) = (a[range.clone()].as_chunks::<4>(), b[range].as_chunks::<4>());
        for (a, b) in a4.iter().zip(b4) {
            for (sum, (a, b)) in sums.iter_mut().zip(a.iter().zip(b)) {
                (0..K).for_each(|c| sum[c] += a[c] * b[c]);
            }
        }
        for (a, b) in a1.iter().zip(b1) {
            (0..K).for_each(|c| sums[0][c] += a[c] * b[c]);
        }
        std::array::from_fn(|c| (sums[0][c] + sums[1][c]) + (sums[2][c] + sums[3][c]))
    })
}
