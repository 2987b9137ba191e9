//! Linear solves of Newton's method on the first of several pieces, counted as in table 8.1 of Gander and Haynes
//! (2012).

use super::chain::{Chain, Equations, largest};
use super::conditions::{End, pin};
use super::schwarz::Iteration;
use super::{Line, Method, pieces};
use crate::error::{Act, Failure, Remedy, Result};
use crate::numerics::linear::tridiagonal;

/// Newton's method has converged once no node moves by more than this, in the unit of x.
const STEP: f64 = 1e-12;
/// Steps after which Newton's method without damping is given up: where it converges it takes a few.
const MOST: usize = 100;

impl Line {
    /// Linear solves of the first piece alone, summed from the start up to each iteration.
    ///
    /// In each iteration Newton's method begins at the last iterate of the piece, of which only the end node is
    /// replaced by the neighbour's value. It takes whole steps and ends with one of 1e-12 or less. The iterates
    /// themselves are those of [`iterate`](Self::iterate); only their cost is counted in another way.
    ///
    /// # Errors
    /// As [`iterate`](Self::iterate); [`Failure::LineStalled`] where whole Newton steps do not converge.
    pub fn solves_of_first(
        &self,
        t: f64,
        ranges: &[[usize; 2]],
        method: Method,
        start: &[f64],
        iterations: usize,
    ) -> Result<Vec<usize>> {
        pieces::check("ranges", ranges, self.cells, method)?;
        self.check_mesh("start", start)?;
        let cumulative = self.cumulative(t)?;
        let iteration =
            Iteration { chain: self.chain(t, Some(&cumulative)), ranges, method, old: None, cells: self.cells };
        let mut pieces = iteration.cut(start);
        let (mut first, mut count, mut counts) = (pieces[0].clone(), 0, vec![0]);
        for _ in 0..iterations {
            let end = iteration.right_end(&pieces, 0)?;
            count += whole_steps(&iteration.chain, &mut first, [End::Value(start[0]), end])?;
            counts.push(count);
            pieces = iteration.next(&pieces)?.0;
        }
        Ok(counts)
    }
}

/// Newton's method without damping, on `x`; returns the number of linear solves.
fn whole_steps(chain: &Chain<'_>, x: &mut [f64], ends: [End; 2]) -> Result<usize, Failure> {
    let equations = Equations { chain, ends, step: None };
    pin(x, ends);
    let mut moves = f64::INFINITY;
    for solves in 1..=MOST {
        let (residual, rows) = equations.linearised(x)?;
        let change = tridiagonal(&rows, &residual);
        x.iter_mut().zip(&change).for_each(|(x, change)| *x -= change);
        moves = largest(change.into_iter());
        if moves <= STEP {
            return Ok(solves);
        }
        if !moves.is_finite() {
            break;
        }
    }
    let remedy = Remedy::any([Act::Say("begin nearer to the mesh: whole steps are counted, none is halved")]);
    Err(Failure::LineStalled { residual: moves, iterations: MOST, remedies: vec![remedy] })
}

#[cfg(test)]
mod tests {
    use crate::equidistribution::{Coarse, Line, LineDensity, Method, Sweep};

    /// The counts that are printed beside the nonlinear row of table 8.1, after 2, 4, 6, 8 and 10 iterations.
    #[test]
    fn table_8_1_is_counted_on_the_first_piece() {
        let line = Line::new(LineDensity::arclength("(1 - exp(20*x)) / (1 - exp(20))").unwrap(), 100);
        let method = Method::Classical { sweep: Sweep::Parallel, linearized: false, coarse: Coarse::None };
        let counts = line.solves_of_first(0.0, &[[0, 52], [48, 100]], method, &line.uniform(), 10).unwrap();
        assert_eq!([2, 4, 6, 8, 10].map(|n| counts[n]), [5, 10, 15, 21, 27]);
    }
}
