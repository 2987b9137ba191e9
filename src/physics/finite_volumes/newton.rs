//! Newton's method for the implicit part of a step.

use super::damping::{Damping, Derivative};
use super::{Around, Block, Excess, FiniteVolumes, Half, Law, Side};
use crate::error::Failure;
use crate::geometry::{Cells, Mesh, Patch};
use crate::numerics::larger;
use crate::numerics::linear::{BlockMatrix, LinearSolver};
use crate::work::Work;

/// Number of Newton steps after which a time step is given up.
const MAX_NEWTON: usize = 30;
/// Largest number of halvings of a correction that leads to where a formula has no value, such as a root below 0.
const RETREATS: usize = 8;
/// Number of Newton steps after which the damping κ follows the newest values no longer, so that the iteration
/// converges. With κ from the values at the start of the time step alone the step would be of first order.
const FOLLOWED: usize = 1;
/// As [`FOLLOWED`] where the flow crosses more than a cell in a time step: with a smaller number no solution would
/// become steady there.
const FOLLOWED_ACROSS_CELLS: usize = 10;
/// The damping κ is frozen sooner once residuals are below this share of those at the start: changes of κ are then
/// small beside the change of the solution in the step.
const FOLLOWED_TO: f64 = 1e-3;
/// From this number of Newton steps on κ goes only half of the way to what the newest values give: a κ that has not
/// settled by then, as at a shock within a cell, swings between two states, and half-way it comes to rest between them.
const HALFWAY: usize = 3;
/// Newton's method is given up once residuals are larger than this multiple of those at its start.
const DIVERGED: f64 = 10.0;
/// Residuals below this number of roundings of the largest terms are made of rounding.
const ROUNDINGS: f64 = 16.0;

/// Where Newton's method ended.
pub(super) struct Solved<const B: usize> {
    /// Residuals that are left, node by node.
    pub residual: Vec<[f64; B]>,
    pub work: Work,
    /// Why the method did not converge, where it did not.
    pub stalled: Option<Failure>,
}

impl<const B: usize, const D: usize, Solver> FiniteVolumes<B, D, Solver> {
    /// Newton's method for the padded values `u` at the end of a time step, from what is `known` of its beginning
    ///
    /// With bounds it solves min(−R, u − lower) = 0, and likewise above, with the residual R: within its bounds a value
    /// satisfies the equation, and at a bound the equation holds but for what keeps the value there. The derivative is
    /// that of the smaller term, so that the method finds in a few steps which values lie on their bounds.
    ///
    /// # Source
    /// Hintermüller, Ito and Kunisch, *The primal-dual active set strategy as a semismooth Newton method* (2002).
    pub(super) fn newton<const S: usize, L: Law<B, D>>(
        &mut self,
        law: &L,
        half: &Half<'_, D>,
        excess: Option<&Excess<B, D, S>>,
        known: &[[f64; B]],
        (sides, bounds): (&[Side<B>], &[[[f64; 2]; B]]),
        u: &mut [[f64; B]],
    ) -> Result<Solved<B>, Failure>
    where
        Solver: LinearSolver<D, S, B, Block<B>>,
        for<'a> Half<'a, D>: Around<D, S>,
        Mesh<D>: Cells<D>,
    {
        let patch = *half.cells.patch();
        let mut scale = Scale::of(u);
        let mut matrix = BlockMatrix::<D, S, B>::zero_blocks(patch);
        let mut residual = vec![[0.0; B]; patch.len()];
        let (mut work, mut damping, mut followed) = (Work::default(), Damping::none(), true);
        let loads = half.loads(law, u)?;
        let (mut correction, mut retreats) = (Vec::new(), 0);
        let stalled = loop {
            let mut view = match half.view::<S, B, L>(law, u) {
                Err(Failure::Formula { .. }) if !correction.is_empty() && retreats < RETREATS => {
                    go_back_half(&mut correction, u);
                    retreats += 1;
                    continue;
                }
                view => view?,
            };
            retreats = 0;
            if followed {
                let share = if work.newton_iterations < HALFWAY { 1.0 } else { 0.5 };
                damping.go_towards(half.damping(law, &view, u), share);
            }
            damping.add_to(&mut view, &patch, u);
            half.residual(law, excess, &view, [known, &loads], u, &mut residual);
            leave_given(sides, &mut residual);
            let bound = hold(bounds, u, patch, &mut residual);
            let (largest, iterations) = (largest_of(&residual), work.newton_iterations);
            let wanted = scale.wanted(iterations, largest, L::TOLERANCE);
            if (0..B).all(|c| largest[c] <= wanted[c]) {
                break None;
            }
            if iterations == MAX_NEWTON || scale.diverges(largest) {
                break Some(stalled_at(largest, wanted, iterations));
            }
            let settled = iterations > 0 && scale.overall(largest) <= FOLLOWED_TO * scale.at_first;
            let most = if damping.crosses_cells() { FOLLOWED_ACROSS_CELLS } else { FOLLOWED };
            followed &= !settled && iterations < most;
            damping.add_derivative(&mut view, if followed { Derivative::Upwind } else { Derivative::Frozen });
            half.matrix(law, excess, &view, sides, &mut matrix);
            fix(bound, &mut matrix);
            scale.stiffest = matrix.rows.iter().fold(0.0, |m, row| larger(m, row[0][0][0]));
            let enough = scale.enough(largest, L::TOLERANCE);
            correction = vec![[0.0; B]; patch.padded_len()];
            work += self.solve(&matrix, &mut residual, (largest, enough), &mut correction)?;
            <Half<'_, D> as Around<D, S>>::repeat_sides(&patch, &mut correction);
            for (u, correction) in u.as_flattened_mut().iter_mut().zip(correction.as_flattened()) {
                *u += correction;
            }
        };
        Ok(Solved { residual, work, stalled })
    }

    /// The correction for a residual, which is brought to the size of 1 where its squares are beyond the range of
    /// numbers.
    fn solve<const S: usize>(
        &mut self,
        matrix: &BlockMatrix<D, S, B>,
        residual: &mut [[f64; B]],
        (largest, enough): ([f64; B], [f64; B]),
        correction: &mut [[f64; B]],
    ) -> Result<Work, Failure>
    where
        Solver: LinearSolver<D, S, B, Block<B>>,
    {
        let factor = of_size_one(largest);
        residual.as_flattened_mut().iter_mut().for_each(|value| *value *= factor);
        let mut work = self.solver.solve(matrix, residual, correction, enough.map(|enough| enough * factor))?;
        work.newton_iterations += 1;
        correction.as_flattened_mut().iter_mut().for_each(|value| *value /= factor);
        Ok(work)
    }
}

/// Sets the residuals of given values to 0: they need not be solved for.
fn leave_given<const B: usize>(sides: &[Side<B>], residual: &mut [[f64; B]]) {
    for side in sides {
        for (residual, given) in residual[side.i].iter_mut().zip(side.given) {
            *residual = if given.is_some() { 0.0 } else { *residual };
        }
    }
}

/// Replaces the rows of values that lie on their bounds by those of the identity.
fn fix<const D: usize, const S: usize, const B: usize>(bound: Vec<(usize, usize)>, matrix: &mut BlockMatrix<D, S, B>) {
    for (i, c) in bound {
        matrix.rows[i].iter_mut().for_each(|block| block[c] = [0.0; B]);
        matrix.rows[i][0][c][c] = 1.0;
    }
}

/// The failure of an iteration, with the residual of the unknown that is farthest from its tolerance.
fn stalled_at<const B: usize>(largest: [f64; B], wanted: [f64; B], iterations: usize) -> Failure {
    let over = |c: &usize| largest[*c] / wanted[*c];
    let c = (0..B).max_by(|a, b| over(a).total_cmp(&over(b))).unwrap_or(0);
    Failure::NewtonStalled { residual: largest[c], tolerance: wanted[c], iterations }
}

/// Takes back half of a correction that was added to values, and halves it.
fn go_back_half<const B: usize>(correction: &mut [[f64; B]], u: &mut [[f64; B]]) {
    for (u, correction) in u.as_flattened_mut().iter_mut().zip(correction.as_flattened_mut()) {
        *correction *= 0.5;
        *u -= *correction;
    }
}

/// For values at a bound replaces the residual by the distance to the bound; returns their (node, unknown).
fn hold<const B: usize, const D: usize>(
    bounds: &[[[f64; 2]; B]],
    u: &[[f64; B]],
    patch: Patch<D>,
    residual: &mut [[f64; B]],
) -> Vec<(usize, usize)> {
    let mut held = Vec::new();
    for ((i, k), bounds) in patch.places().enumerate().zip(bounds) {
        for c in 0..B {
            let ([lower, upper], to) = (bounds[c], u[k][c] + residual[i][c]);
            if to < lower || to > upper {
                residual[i][c] = to.clamp(lower, upper) - u[k][c];
                held.push((i, c));
            }
        }
    }
    held
}

/// Sizes of unknowns and residuals, which decide when an iteration ends.
struct Scale<const B: usize> {
    /// Size of each unknown: unknowns may differ much in size, and one that is 0 takes the size of its first change.
    sizes: [f64; B],
    /// The largest of these sizes.
    size: f64,
    /// The largest residual at the start, in units of `sizes`.
    at_first: f64,
    /// Unknowns that are 0 and have no residual at the start, such as what a reaction makes of others.
    blank: [bool; B],
    /// The largest coefficient of the matrix: where the flux through a cell in a step is large, round-off alone leaves
    /// residuals above the tolerance.
    stiffest: f64,
}

impl<const B: usize> Scale<B> {
    fn of(u: &[[f64; B]]) -> Self {
        let sizes = largest_of(u);
        let size = sizes.into_iter().fold(f64::MIN_POSITIVE, larger);
        Self { sizes, size, at_first: f64::INFINITY, blank: [false; B], stiffest: 1.0 }
    }

    fn overall(&self, largest: [f64; B]) -> f64 {
        (0..B).fold(0.0, |m, c| larger(m, largest[c] / self.sizes[c]))
    }

    fn rounding(&self) -> f64 {
        ROUNDINGS * f64::EPSILON * self.stiffest
    }

    /// Residual of each unknown at which the iteration ends; none is below the smallest normal number, beneath which
    /// products lose all digits. At least one iteration is done: small changes, if left out, would add up over many
    /// time steps.
    fn wanted(&mut self, iterations: usize, largest: [f64; B], tolerance: f64) -> [f64; B] {
        if iterations == 0 {
            self.size = largest.into_iter().fold(self.size, larger);
            let floor = f64::EPSILON * self.size;
            self.sizes = std::array::from_fn(|c| larger(self.sizes[c], largest[c]).max(floor));
            self.blank = self.sizes.map(|size| size <= floor);
            self.at_first = self.overall(largest);
        }
        for c in (0..B).filter(|&c| iterations > 0 && largest[c].is_finite()) {
            // its first change gives it a size
            if std::mem::take(&mut self.blank[c]) {
                self.sizes[c] = self.sizes[c].max(largest[c]);
            }
        }
        let share = if iterations == 0 { 0.0 } else { tolerance };
        std::array::from_fn(|c| (share * self.sizes[c]).max(self.rounding() * self.size).max(f64::MIN_POSITIVE))
    }

    fn diverges(&self, largest: [f64; B]) -> bool {
        self.overall(largest) > DIVERGED * self.at_first || !largest.iter().all(|r| r.is_finite())
    }

    /// What a linear solve may leave: Newton's method squares the residual, so that a much more accurate solve is
    /// wasted.
    fn enough(&self, largest: [f64; B], tolerance: f64) -> [f64; B] {
        let share = self.overall(largest).min(1.0);
        std::array::from_fn(|c| {
            let newton = (0.01 * largest[c] * share).max(0.1 * tolerance * self.sizes[c]);
            newton.min(1e-3 * largest[c]).max(0.1 * self.rounding() * self.size).max(0.1 * f64::MIN_POSITIVE)
        })
    }
}

/// The power of two that brings residuals to the size of 1 whose squares are beyond the range of numbers; 1 for others.
fn of_size_one<const B: usize>(largest: [f64; B]) -> f64 {
    let largest = largest.into_iter().fold(0.0, larger);
    let squares = 1e-140..1e140;
    if largest > 0.0 && largest.is_finite() && !squares.contains(&largest) {
        2.0_f64.powi(-(largest.log2().round() as i32).clamp(-1000, 1000))
    } else {
        1.0
    }
}

/// The largest absolute value of each unknown.
fn largest_of<const B: usize>(values: &[[f64; B]]) -> [f64; B] {
    std::array::from_fn(|c| values.iter().fold(0.0, |m, value| larger(m, value[c])))
}
