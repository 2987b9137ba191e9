use super::block::invert;
use super::{BlockMatrix, LinearSolver, solved, solved_in, stalled};
use crate::error::Failure;
use crate::work::Work;

/// Elimination of blocks along a line, for B coupled unknowns a node
///
/// Thomas' algorithm with blocks in place of numbers. On a line whose ends are one, the last node is eliminated last:
/// what the other nodes make of its values is solved for with the right-hand side.
///
/// # Source
/// Golub and Van Loan, *Matrix Computations*, 4.5.1 and 4.5.5 (2013).
#[derive(Debug, Clone, Default)]
pub struct BlockElimination {}

/// Largest number of solves with the factors, before the system counts as not solved: the first one, and refinements by
/// the residual.
const REFINED: usize = 3;

type Block<const B: usize> = [[f64; B]; B];

impl<const B: usize> LinearSolver<1, 3, B, Block<B>> for BlockElimination {
    fn solve(
        &mut self,
        a: &BlockMatrix<1, 3, B>,
        b: &[[f64; B]],
        x: &mut [[f64; B]],
        tolerance: [f64; B],
    ) -> Result<Work, Failure> {
        let mut r = vec![[0.0; B]; a.patch.padded_len()];
        let mut sizes = a.residual(b, x, &mut r);
        let Factors { factors, border, last } = Factors::of(a);
        for _ in 0..REFINED {
            if solved(sizes, tolerance) {
                break;
            }
            let right = &r[1..=a.rows.len()];
            let mut e = factors.solved(&right[..factors.pivots.len()]);
            if let Some(last) = &last {
                let n = e.len();
                let own = less(less(right[n], product(&a.rows[n][2], e[0])), product(&a.rows[n][1], e[n - 1]));
                let end = product(last, own);
                e.iter_mut().zip(&border).for_each(|(e, border)| *e = less(*e, product(border, end)));
                e.push(end);
            }
            for (x, e) in x[1..].iter_mut().zip(&e) {
                (0..B).for_each(|c| x[c] += e[c]);
            }
            a.patch.wrap(x);
            sizes = a.residual(b, x, &mut r);
        }
        match solved(sizes, tolerance) {
            true => Ok(solved_in::<B, Block<B>>(0)),
            false => Err(stalled(a.rows.len() * B, sizes, tolerance, 1)),
        }
    }
}

/// The matrix without its last node where the ends are one, eliminated.
struct Factors<const B: usize> {
    factors: Eliminated<B>,
    /// What the other nodes make of the values of the last one.
    border: Vec<Block<B>>,
    /// The inverse of the last pivot, where the ends are one.
    last: Option<Block<B>>,
}

impl<const B: usize> Factors<B> {
    fn of(a: &BlockMatrix<1, 3, B>) -> Self {
        if !a.patch.wraps[0] {
            return Self { factors: Eliminated::of(&a.rows), border: Vec::new(), last: None };
        }
        let n = a.rows.len() - 1;
        let factors = Eliminated::of(&a.rows[..n]);
        let mut coupled = vec![[[0.0; B]; B]; n];
        coupled[0] = a.rows[0][1];
        coupled[n - 1] = plus(coupled[n - 1], a.rows[n - 1][2]);
        let columns: [Vec<[f64; B]>; B] = std::array::from_fn(|c| {
            factors.solved(&coupled.iter().map(|block| block.map(|row| row[c])).collect::<Vec<_>>())
        });
        let border: Vec<Block<B>> =
            (0..n).map(|i| std::array::from_fn(|r| std::array::from_fn(|c| columns[c][i][r]))).collect();
        let [own, below, above] = a.rows[n];
        let pivot = minus(minus(own, times(&above, &border[0])), times(&below, &border[n - 1]));
        Self { factors, border, last: Some(invert(pivot)) }
    }
}

/// A block tridiagonal matrix, eliminated from its first row on.
struct Eliminated<const B: usize> {
    /// The blocks below the diagonal, those above it over their pivots, and the inverses of the pivots.
    below: Vec<Block<B>>,
    above: Vec<Block<B>>,
    pivots: Vec<Block<B>>,
}

impl<const B: usize> Eliminated<B> {
    fn of(rows: &[[Block<B>; 3]]) -> Self {
        let (mut above, mut pivots) = (Vec::<Block<B>>::with_capacity(rows.len()), Vec::with_capacity(rows.len()));
        for [own, below, next] in rows {
            let own = above.last().map_or(*own, |last| minus(*own, times(below, last)));
            let pivot = invert(own);
            above.push(times(&pivot, next));
            pivots.push(pivot);
        }
        Self { below: rows.iter().map(|row| row[1]).collect(), above, pivots }
    }

    fn solved(&self, right: &[[f64; B]]) -> Vec<[f64; B]> {
        let mut x: Vec<[f64; B]> = Vec::with_capacity(right.len());
        for ((right, pivot), below) in right.iter().zip(&self.pivots).zip(&self.below) {
            let right = x.last().map_or(*right, |last| less(*right, product(below, *last)));
            x.push(product(pivot, right));
        }
        for i in (0..x.len() - 1).rev() {
            x[i] = less(x[i], product(&self.above[i], x[i + 1]));
        }
        x
    }
}

fn product<const B: usize>(block: &Block<B>, x: [f64; B]) -> [f64; B] {
    block.map(|row| row.iter().zip(x).map(|(a, x)| a * x).sum())
}

fn times<const B: usize>(a: &Block<B>, b: &Block<B>) -> Block<B> {
    a.map(|row| std::array::from_fn(|c| row.iter().zip(b).map(|(a, b)| a * b[c]).sum()))
}

fn less<const B: usize>(a: [f64; B], b: [f64; B]) -> [f64; B] {
    std::array::from_fn(|c| a[c] - b[c])
}

fn minus<const B: usize>(a: Block<B>, b: Block<B>) -> Block<B> {
    std::array::from_fn(|r| less(a[r], b[r]))
}

fn plus<const B: usize>(a: Block<B>, b: Block<B>) -> Block<B> {
    std::array::from_fn(|r| std::array::from_fn(|c| a[r][c] + b[r][c]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Patch;
    use crate::numerics::linear::SparseLu;

    /// Random systems of two unknowns a node, with both kinds of ends, have the solution that sparse LU finds.
    #[test]
    fn elimination_solves_what_sparse_lu_solves() {
        let mut state = 7_u64;
        let mut random = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        for (n, wraps) in [(9, false), (9, true), (2, true), (3, true)] {
            let patch = Patch { origin: [0], size: [n], wraps: [wraps] };
            let mut a = BlockMatrix::<1, 3, 2>::zero_blocks(patch);
            for row in &mut a.rows {
                row.as_flattened_mut().as_flattened_mut().iter_mut().for_each(|entry| *entry = random());
                (0..2).for_each(|c| row[0][c][c] += 3.0);
            }
            let b: Vec<[f64; 2]> = (0..n).map(|_| [random(), random()]).collect();
            let [mut ours, mut theirs] = [vec![[0.0; 2]; n + 2], vec![[0.0; 2]; n + 2]];
            BlockElimination::default().solve(&a, &b, &mut ours, [1e-12; 2]).unwrap();
            SparseLu::default().solve(&a, &b, &mut theirs, [1e-12; 2]).unwrap();
            let pairs = ours.as_flattened().iter().zip(theirs.as_flattened());
            assert!(pairs.into_iter().all(|(a, b)| (a - b).abs() < 1e-11), "{n} nodes, wraps: {wraps}");
        }
    }
}
