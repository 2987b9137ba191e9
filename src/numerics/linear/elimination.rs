use super::{LatticeMatrix, LinearSolver, solved, solved_in, stalled, tridiagonal};
use crate::error::Failure;
use crate::work::Work;

/// Elimination along a line, for K values a node with a common matrix
///
/// Thomas' algorithm. On a line whose ends are one, the last node is eliminated last: what the other nodes make of its
/// value is solved for with the right-hand side.
///
/// # Source
/// Golub and Van Loan, *Matrix Computations*, 4.3.6 (2013).
#[derive(Debug, Clone, Default)]
pub struct Elimination {}

/// Largest number of solves with the factors, before the system counts as not solved: the first one, and refinements by
/// the residual.
const REFINED: usize = 3;

impl<const K: usize> LinearSolver<1, 3, K> for Elimination {
    fn solve(
        &mut self,
        a: &LatticeMatrix<1, 3>,
        b: &[[f64; K]],
        x: &mut [[f64; K]],
        tolerance: [f64; K],
    ) -> Result<Work, Failure> {
        let n = a.rows.len();
        // a star has its own coefficient first
        let rows: Vec<[f64; 3]> = a.rows.iter().map(|[own, below, above]| [*below, *own, *above]).collect();
        let ring = a.patch.wraps[0].then(|| Ring::of(&rows));
        let mut r = vec![[0.0; K]; x.len()];
        let mut sizes = a.residual(b, x, &mut r);
        for _ in 0..REFINED {
            if solved(sizes, tolerance) {
                break;
            }
            for c in 0..K {
                let right: Vec<f64> = r[1..=n].iter().map(|r| r[c]).collect();
                let e = match &ring {
                    None => tridiagonal(&rows, &right),
                    Some(ring) => ring.solved(&rows, &right),
                };
                x[1..].iter_mut().zip(&e).for_each(|(x, e)| x[c] += e);
                if ring.is_some() {
                    // images keep their distance from what they are images of
                    x[0][c] += e[n - 1];
                    x[n + 1][c] += e[0];
                }
            }
            sizes = a.residual(b, x, &mut r);
        }
        match solved(sizes, tolerance) {
            true => Ok(solved_in::<K, f64>(0)),
            false => Err(stalled(n * K, sizes, tolerance, 1)),
        }
    }
}

/// The last node of a line whose ends are one.
struct Ring {
    /// What the other nodes make of its value.
    border: Vec<f64>,
    /// The inverse of its pivot.
    inverse: f64,
}

impl Ring {
    fn of(rows: &[[f64; 3]]) -> Self {
        let n = rows.len() - 1;
        let [below, own, above] = rows[n];
        if n == 0 {
            return Self { border: Vec::new(), inverse: 1.0 / (below + own + above) };
        }
        let mut coupled = vec![0.0; n];
        coupled[0] = rows[0][0];
        coupled[n - 1] += rows[n - 1][2];
        let border = tridiagonal(&rows[..n], &coupled);
        let inverse = 1.0 / (own - above * border[0] - below * border[n - 1]);
        Self { border, inverse }
    }

    fn solved(&self, rows: &[[f64; 3]], right: &[f64]) -> Vec<f64> {
        let n = rows.len() - 1;
        let mut e = tridiagonal(&rows[..n], &right[..n]);
        let drawn = if n == 0 { 0.0 } else { rows[n][2] * e[0] + rows[n][0] * e[n - 1] };
        let last = (right[n] - drawn) * self.inverse;
        e.iter_mut().zip(&self.border).for_each(|(e, border)| *e -= border * last);
        e.push(last);
        e
    }
}

#[cfg(test)]
mod tests {
    use super::super::SparseLu;
    use super::*;
    use crate::geometry::Patch;

    /// The solution is that of sparse LU, for any number of nodes, whether the ends of the line are one or not.
    #[test]
    fn elimination_is_sparse_lu() {
        let entry = |k: usize| ((k * 2_654_435_761) % 1000) as f64 / 1000.0 - 0.5;
        for (n, wraps) in [(9, false), (9, true), (1, true), (2, true), (3, true), (1, false)] {
            let patch = Patch { origin: [0], size: [n], wraps: [wraps] };
            let rows = (0..n).map(|i| [3.0 + entry(3 * i), entry(3 * i + 1), entry(3 * i + 2)]).collect();
            let a = LatticeMatrix { patch, rows };
            let b: Vec<[f64; 2]> = (0..n).map(|i| [entry(7 * i), entry(11 * i)]).collect();
            let [mut ours, mut theirs] = [vec![[0.3; 2]; n + 2], vec![[0.3; 2]; n + 2]];
            [&mut ours, &mut theirs].into_iter().for_each(|x| a.patch.wrap(x));
            Elimination::default().solve(&a, &b, &mut ours, [1e-13; 2]).unwrap();
            SparseLu::default().solve(&a, &b, &mut theirs, [1e-13; 2]).unwrap();
            let pairs = ours.as_flattened().iter().zip(theirs.as_flattened());
            assert!(pairs.into_iter().all(|(a, b)| (a - b).abs() < 1e-12), "{n} nodes, wraps: {wraps}");
        }
    }
}
