//! Newton's method for the nodes of a piece of a line, damped so that nodes keep their order.

use super::FaceDensity;
use super::chain::{Equations, largest};
use super::conditions::{End, pin};
use super::cumulative::Cumulative;
use crate::error::{Act, Failure, Remedy, Setting};
use crate::numerics::linear::tridiagonal;
use std::ops::Range;

/// Largest number of Newton steps for a piece whose end nodes are given.
const MOST_STEPS: usize = 200;
/// Largest number of Newton steps for a piece with conditions on the flux. Many of these have no discrete solution near
/// an iterate and never converge; of 2000 random lines as many converged with this number as with [`MOST_STEPS`].
const MOST_FREE_STEPS: usize = 50;
/// Halvings of a Newton step along straight lines before it is given up: 2⁻⁴⁰ of a step changes next to nothing.
const HALVINGS: i32 = 40;
/// Halvings that are tried before nodes may pass through each other, which iterates with conditions on the flux do.
const FEW_HALVINGS: i32 = 8;
/// A Newton step that moves no node by more than this share of the largest coordinate is the last or one of the last:
/// it is taken even if it does not lower the residual, which may be of rounding by then.
const NEAR: f64 = 1e-9;
/// Moving a node by this share of the largest coordinate is rounding: a few units in the last place.
const ROUNDING: f64 = 4.0 * f64::EPSILON;
/// While Newton's method converges quadratically each step is a small share of the one before; from this share on
/// rounding makes the steps.
const NO_LONGER_SHRINKING: f64 = 0.25;

/// Along which path a share of a Newton step is taken: by x, or by ∫M up to the node, in which the steady problem is
/// linear.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Way {
    Straight,
    Curved,
}

/// The steps to try in turn: the whole Newton step, halved ones along ∫M, and halved ones along x, all with nodes in
/// order. Where conditions on the flux allow it (`free`), the same follow with nodes in any order.
fn ways(free: bool) -> impl Iterator<Item = (bool, Way, f64)> {
    let halved = |ordered: bool, way: Way, halvings: Range<i32>| halvings.map(move |n| (ordered, way, 0.5_f64.powi(n)));
    let tries = if free { FEW_HALVINGS } else { HALVINGS };
    halved(true, Way::Straight, 0..1)
        .chain(halved(true, Way::Curved, 0..tries / 2))
        .chain(halved(true, Way::Straight, 1..tries))
        .chain(halved(false, Way::Curved, 0..if free { tries } else { 0 }))
        .chain(halved(false, Way::Straight, 0..if free { HALVINGS } else { 0 }))
}

/// Nodes with their residuals, and the derivatives of these: below, own, above.
struct Iterate {
    x: Vec<f64>,
    residual: Vec<f64>,
    rows: Vec<[f64; 3]>,
}

/// The nodes after a share of a Newton step along ∫M: each moves to where ∫M has changed by share × change × M(x).
fn along(cumulative: &Cumulative, x: &[f64], change: &[f64], share: f64) -> Vec<f64> {
    let moved = |(x, change): (&f64, &f64)| {
        let [g, m] = cumulative.at(*x);
        cumulative.place(g - share * change * m)
    };
    x.iter().zip(change).map(moved).collect()
}

impl Equations<'_> {
    /// The nodes of a piece, and the number of linear solves that they took. Where M is averaged exactly the nodes
    /// follow from inverting ∫M, without any. Else Newton's method starts from a guess and, if that stalls, from the
    /// nodes that exact averages have.
    ///
    /// # Errors
    /// [`Failure::LineDensity`], [`Failure::LineStalled`].
    pub fn solve(&self, guess: &[f64]) -> Result<(Vec<f64>, usize), Failure> {
        if self.chain.face == FaceDensity::Exact
            && self.step.is_none()
            && let Some(nodes) = self.chain.even(guess, self.ends)
        {
            return Ok((nodes, 0));
        }
        match self.newton(guess) {
            Err(stalled @ Failure::LineStalled { .. }) => match self.chain.even(guess, self.ends) {
                Some(near) if near.is_sorted_by(|a, b| a < b) => self.newton(&near).map_err(|_| stalled),
                _ => Err(stalled),
            },
            other => other,
        }
    }

    /// The remedies to offer where Newton's method stalls.
    fn unstalling(&self) -> Remedy {
        let exact = Act::Set(Setting::FaceDensity, &["\"exact\""]);
        let finer = [Act::Lower(Setting::TimeStep), Act::Refine(Setting::Cells)];
        match (self.chain.face, self.step.is_some()) {
            (FaceDensity::Exact, true) => Remedy::any(finer),
            (FaceDensity::Exact, false) => {
                Remedy::any([Act::Set(Setting::Integral, &["\"exact\""]), Act::Refine(Setting::Cells)])
            }
            (_, true) => Remedy::any([exact, finer[0], finer[1]]),
            (_, false) => Remedy::any([exact])
                .with(": a density that jumps or peaks within a cell has no mesh by trapezoids or midpoints"),
        }
    }

    /// Newton's method from a guess; returns the nodes and the number of linear solves.
    ///
    /// # Errors
    /// As [`solve`](Self::solve).
    pub fn newton(&self, guess: &[f64]) -> Result<(Vec<f64>, usize), Failure> {
        let x = stretched(guess, self.ends);
        let size = largest_of(&x).max(f64::MIN_POSITIVE);
        let stalled = |at: &Iterate, iterations: usize| Failure::LineStalled {
            residual: norm(&at.residual),
            iterations,
            remedies: vec![self.unstalling()],
        };
        let mut at = self.at(x)?;
        let mut last = f64::INFINITY;
        let most = if self.is_free() { MOST_FREE_STEPS } else { MOST_STEPS };
        for solves in 1..=most {
            let change = tridiagonal(&at.rows, &at.residual);
            let moves = largest_of(&change);
            let Some((next, share)) = self.damped(&at, &change, size)? else { return Err(stalled(&at, solves)) };
            at = next;
            if share == 1.0 && moves <= NEAR * size && (moves >= NO_LONGER_SHRINKING * last || moves <= ROUNDING * size)
            {
                return Ok((at.x, solves));
            }
            last = moves;
        }
        Err(stalled(&at, most))
    }

    fn at(&self, x: Vec<f64>) -> Result<Iterate, Failure> {
        let (residual, rows) = self.linearised(&x)?;
        Ok(Iterate { x, residual, rows })
    }

    /// The nodes after a share of a Newton step; none along ∫M where that is not known.
    fn moved(&self, x: &[f64], change: &[f64], way: Way, share: f64) -> Option<Vec<f64>> {
        let mut moved = match way {
            Way::Straight => x.iter().zip(change).map(|(x, change)| x - share * change).collect(),
            Way::Curved => along(self.chain.cumulative?, x, change, share),
        };
        pin(&mut moved, self.ends);
        Some(moved)
    }

    /// Whether there are conditions on the flux: an iterate may then run backwards, and nodes may pass through each
    /// other on the way there.
    fn is_free(&self) -> bool {
        self.ends.iter().any(|end| matches!(end, End::Flux { .. }))
    }

    fn is_ordered(&self, x: &[f64]) -> bool {
        x.windows(2).all(|x| x[1] > x[0]) || self.is_free() && x.windows(2).all(|x| x[1] < x[0])
    }

    /// The next iterate, and the share of the Newton step that leads there: the first of the steps to try that lowers
    /// the residual, or any where the iterate is near the solution. None where no step does. `size` is the largest
    /// coordinate.
    fn damped(&self, from: &Iterate, change: &[f64], size: f64) -> Result<Option<(Iterate, f64)>, Failure> {
        let near = largest_of(change) <= NEAR * size;
        // a residual that moving each node by its last bits would change as much
        let rounding = ROUNDING * size * from.rows.iter().fold(0.0, |m: f64, row| m.max(row[1].abs()));
        let enough = norm(&from.residual).max(rounding);
        for (ordered, way, share) in ways(self.is_free()) {
            let Some(x) = self.moved(&from.x, change, way, share) else { continue };
            if ordered && !self.is_ordered(&x) {
                continue;
            }
            let next = match self.at(x) {
                // a step beyond the end of the line, where the rest of it is empty
                Err(Failure::LineStalled { .. }) => continue,
                other => other?,
            };
            if norm(&next.residual) < enough || near {
                return Ok(Some((next, share)));
            }
        }
        Ok(None)
    }
}

/// The guess with the end nodes that are given: the whole piece is stretched linearly, which keeps the order of nodes.
fn stretched(guess: &[f64], ends: [End<'_>; 2]) -> Vec<f64> {
    let n = guess.len() - 1;
    let (first, last) = (guess[0], guess[n]);
    let mut own = [first, last];
    pin(&mut own, ends);
    let [left, right] = own;
    let mut x: Vec<f64> = guess.iter().map(|x| left + (x - first) / (last - first) * (right - left)).collect();
    (x[0], x[n]) = (left, right);
    x
}

fn norm(residual: &[f64]) -> f64 {
    largest(residual.iter().copied())
}

/// The largest magnitude, NaN left out.
fn largest_of(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |m: f64, value| m.max(value.abs()))
}
