use super::{Entry, LatticeMatrix, larger, refill, solved, stalled};
use crate::error::Failure;
use crate::parallel;

/// BiCGSTAB and its vectors, for any matrix and preconditioner.
#[derive(Debug, Clone, Default)]
pub(super) struct Krylov<const K: usize> {
    space: [Vec<[f64; K]>; 6],
}

/// Iterations (products with the matrix, or sweeps of the preconditioner) after which a system counts as not solved.
pub(super) const MAX_PRODUCTS: usize = 2000;
/// Largest number of starts from the residual b − A x. The one that the iteration updates drifts from it by rounding,
/// which each start makes good.
const RESTARTS: usize = 4;

impl<const K: usize> Krylov<K> {
    /// Vectors of zeros; returns two for use before [`solve`](Self::solve).
    pub fn prepare(&mut self, padded_len: usize) -> (&mut [[f64; K]], &mut [[f64; K]]) {
        self.space.iter_mut().for_each(|v| refill(v, padded_len, [0.0; K]));
        let [r, .., hat] = &mut self.space;
        (r, hat)
    }

    /// Solves from the guess in `x`, after [`prepare`](Self::prepare). `precondition` sets its second argument with its
    /// ring, and counts as `cost` iterations, of which there may be about `most`.
    pub fn solve<const D: usize, const S: usize, E: Entry<K>>(
        &mut self,
        a: &LatticeMatrix<D, S, E>,
        b: &[[f64; K]],
        x: &mut [[f64; K]],
        tolerance: [f64; K],
        (cost, most): (usize, usize),
        mut precondition: impl FnMut(&[[f64; K]], &mut [[f64; K]]),
    ) -> Result<usize, Failure> {
        let [r, shadow, p, v, t, hat] = &mut self.space;
        let dot = |a: &[[f64; K]], b: &[[f64; K]]| join::<K, E>(dot(a, b));
        let mut products = 0;
        let mut sizes = a.residual(b, x, r);
        // the recursive residual drifts from the true one by round-off; a restart begins from the true one
        for _restart in 0..RESTARTS {
            if solved(sizes, tolerance) {
                return Ok(products);
            }
            shadow.copy_from_slice(r);
            p.copy_from_slice(r);
            let mut rho = dot(shadow, r);
            while !solved(sizes, tolerance) {
                products += 2 * cost;
                let active = std::array::from_fn(|c| E::COUPLED > 1 || sizes[c] > tolerance[c]);
                precondition(p, hat);
                a.multiply(hat, v);
                let alpha = divide(active, rho, dot(shadow, v));
                sizes = update(r, v, v, |c, r, v, _| r - alpha[c] * v);
                add(x, alpha, hat);
                if solved(sizes, tolerance) {
                    break;
                }
                precondition(r, hat);
                a.multiply(hat, t);
                let omega = divide(active, dot(t, r), dot(t, t));
                add(x, omega, hat);
                sizes = update(r, t, t, |c, r, t, _| r - omega[c] * t);
                let rho_before = std::mem::replace(&mut rho, dot(shadow, r));
                let (gain, step) = (divide(active, rho, rho_before), divide(active, alpha, omega));
                update(p, r, v, |c, p, r, v| r + gain[c] * step[c] * (p - omega[c] * v));
                if products > most || !sizes.iter().all(|s| s.is_finite()) {
                    return Err(stalled(a.rows.len() * E::COUPLED, sizes, tolerance, products));
                }
            }
            sizes = a.residual(b, x, r);
        }
        if solved(sizes, tolerance) {
            Ok(products)
        } else {
            Err(stalled(a.rows.len() * E::COUPLED, sizes, tolerance, products))
        }
    }
}

/// The scalar products of whole systems, from those of their components.
fn join<const K: usize, E: Entry<K>>(products: [f64; K]) -> [f64; K] {
    std::array::from_fn(|c| {
        let first = c - c % E::COUPLED;
        products[first + 1..first + E::COUPLED].iter().fold(products[first], |sum, p| sum + p)
    })
}

/// x ← x + s v with the ring: images of wrapping axes change too, elsewhere the ring of `v` is zero.
pub(super) fn add<const K: usize>(x: &mut [[f64; K]], s: [f64; K], v: &[[f64; K]]) {
    for (x, v) in x.iter_mut().zip(v) {
        (0..K).for_each(|c| x[c] += s[c] * v[c]);
    }
}

/// Quotients; 0 for a right-hand side that is already solved, whose vectors then no longer change.
pub(super) fn divide<const K: usize>(active: [bool; K], a: [f64; K], b: [f64; K]) -> [f64; K] {
    std::array::from_fn(|c| if active[c] && b[c] != 0.0 { a[c] / b[c] } else { 0.0 })
}

/// v ← f(component, v, a, b); returns the largest magnitudes of the result. Rings stay zero where all three are.
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

/// Scalar products, summed in a fixed order. Rings are zero and add nothing.
pub(super) fn dot<const K: usize>(a: &[[f64; K]], b: &[[f64; K]]) -> [f64; K] {
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
