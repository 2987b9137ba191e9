//! Schwarz's iteration on a line, from its start to its end.

use super::chain::largest;
use super::history::observed;
use super::schwarz::{Iteration, Pieces};
use super::{Before, History, Iterate, Line, Measure, Method, Prediction, Stop, pieces};
use crate::error::Result;
use crate::parallel;

/// Errors below this share of the length of the line are left out of the observed contraction: rounding falsifies it.
const ROUNDING: f64 = 1e-11;
/// Equal parts into which each cell is divided to estimate its interpolation error.
const FEW_PARTS: usize = 4;
/// Equal parts of a cell whose estimate is within a tenth of the largest one, to find the error itself.
const PARTS: usize = 64;
/// Largest number of cells that are divided into these finer parts, which bounds the work where all cells err alike.
const MOST_CELLS: usize = 1000;
/// Cells whose places are evaluated in one call of the density.
const CELLS_AT_ONCE: usize = 4096;
/// Largest number of glued meshes that are stored.
const MOST_MESHES: usize = 100;
/// Largest number of nodes in all glued meshes that are stored: 8 MB.
const MOST_NODES: usize = 1 << 20;

impl Line {
    /// Schwarz's iteration between pieces of the line, from a start, at time t.
    ///
    /// `ranges` holds the first and last node of each piece, from left to right. Neighbours overlap for the classical
    /// method, and share one node for the others. An iteration that does not converge is no error: see
    /// [`History::converged`].
    ///
    /// # Errors
    /// [`Error::Invalid`](crate::Error::Invalid) for ranges that do not fit the method ([`pieces::check`]) or a start
    /// that is no mesh; [`Error::Failed`](crate::Error::Failed) with
    /// [`Failure::LineDensity`](crate::Failure::LineDensity) or [`Failure::LineStalled`](crate::Failure::LineStalled).
    pub fn iterate(
        &self,
        t: f64,
        ranges: &[[usize; 2]],
        method: Method,
        start: &[f64],
        before: Before<'_>,
        stop: Stop,
    ) -> Result<History> {
        pieces::check("ranges", ranges, self.cells, method)?;
        self.check_start("start", start, before)?;
        let cumulative = self.cumulative(t)?;
        let reference = self.solved(t, &cumulative, start, before)?.0;
        let chain = self.chain(t, Some(&cumulative));
        let iteration = Iteration { chain, ranges, method, old: before, cells: self.cells };
        let exact = iteration.cut(&reference);
        let mut pieces = iteration.cut(start);
        let (mut path, mut first) = (Path::default(), Vec::new());
        let mut tell = |pieces: &Pieces, increment: f64, solves: usize| {
            let glued = iteration.glue(pieces);
            let iterate = self.measured(t, pieces, &exact, &glued, increment, solves);
            path.take(glued);
            first.push(distance(&pieces[..1], &exact[..1]));
            iterate
        };
        let mut iterates = vec![tell(&pieces, 0.0, 0)];
        let length = self.ends[1] - self.ends[0];
        let met = |iterate: &Iterate, n: usize| {
            let known = n > 0 || stop.measure == Measure::Error;
            known && stop.tolerance.is_some_and(|tolerance| stop.measure.of(iterate) <= tolerance * length)
        };
        let mut converged = met(&iterates[0], 0);
        let mut solves = 0;
        while !converged && iterates.len() <= stop.iterations {
            let (next, cost) = iteration.next(&pieces)?;
            solves += cost;
            let increment = distance(&next, &pieces);
            pieces = next;
            let iterate = tell(&pieces, increment, solves);
            iterates.push(iterate);
            converged = met(&iterate, iterates.len() - 1);
        }
        let observed = observed(&iterates, ROUNDING * length);
        let prediction = Prediction::of(self, t, ranges, method, &reference, before.map(|b| b.1))?;
        let converged = converged || stop.tolerance.is_none();
        let (path, mesh) = (path.meshes, iteration.glue(&pieces));
        Ok(History { iterates, mesh, path, first, reference, observed, prediction, converged })
    }

    /// The figures of an iterate: its pieces beside those of the `exact` mesh, and the mesh `glued` from them.
    fn measured(
        &self,
        t: f64,
        pieces: &Pieces,
        exact: &Pieces,
        glued: &[f64],
        increment: f64,
        linear_solves: usize,
    ) -> Iterate {
        let error = distance(pieces, exact);
        let mut jumps = Vec::with_capacity(pieces.len());
        for piece in pieces {
            let u = self.density.followed(t, piece);
            jumps.extend(u.map(|u| u.windows(2).map(|u| 2.0 * (u[1] - u[0]).abs()).fold(0.0, f64::max)));
        }
        let largest_jump = jumps.into_iter().reduce(f64::max);
        let interpolation_error = self.interpolation_error(t, glued);
        Iterate { error, increment, largest_jump, interpolation_error, linear_solves }
    }

    /// The largest error of the piecewise linear interpolant of u on a mesh; none unless M is the arc length of u. The
    /// error in every cell is estimated at a few places, and the worst cells are then searched closely.
    pub fn interpolation_error(&self, t: f64, mesh: &[f64]) -> Option<f64> {
        // the largest error in each cell, measured where it is divided into equal parts
        let errors = |cells: &[[f64; 2]], parts: usize| -> Option<Vec<f64>> {
            let place = |x: &[f64; 2], k: usize| x[0] + k as f64 / parts as f64 * (x[1] - x[0]);
            let places: Vec<f64> = cells.iter().flat_map(|x| (0..=parts).map(move |k| place(x, k))).collect();
            let u = self.density.followed(t, &places)?;
            let off = |u: &[f64]| {
                let linear = |k: usize| u[0] + k as f64 / parts as f64 * (u[parts] - u[0]);
                (1..parts).map(|k| (u[k] - linear(k)).abs()).fold(0.0, f64::max)
            };
            Some(u.chunks_exact(parts + 1).map(off).collect())
        };
        let cells: Vec<[f64; 2]> = mesh.windows(2).map(|x| [x[0], x[1]]).collect();
        let batches: Vec<&[[f64; 2]]> = cells.chunks(CELLS_AT_ONCE).collect();
        let rough = parallel::map_large(cells.len(), &batches, |cells| errors(cells, FEW_PARTS));
        let rough: Vec<f64> = rough.into_iter().collect::<Option<Vec<_>>>()?.concat();
        let largest = rough.iter().copied().fold(0.0, f64::max);
        // closely in the cells where the largest error may be
        let worst: Vec<[f64; 2]> = cells
            .into_iter()
            .zip(rough)
            .filter(|(_, off)| *off >= 0.9 * largest)
            .map(|(x, _)| x)
            .take(MOST_CELLS)
            .collect();
        errors(&worst, PARTS)?.into_iter().reduce(f64::max)
    }
}

/// Glued meshes of an iteration, which may be too many to store all.
#[derive(Default)]
struct Path {
    meshes: Vec<(usize, Vec<f64>)>,
    /// Number of meshes seen, stored or not.
    seen: usize,
    /// Only meshes whose number is a multiple of this are stored.
    every: usize,
}

impl Path {
    /// Stores a mesh if its number is due. Where there is no room, every second stored mesh is dropped first.
    fn take(&mut self, mesh: Vec<f64>) {
        let most = (MOST_NODES / mesh.len()).min(MOST_MESHES);
        self.every = self.every.max(1);
        if most > 0 && self.seen.is_multiple_of(self.every) {
            if self.meshes.len() == most {
                self.every *= 2;
                self.meshes.retain(|(n, _)| n.is_multiple_of(self.every));
            }
            if self.seen.is_multiple_of(self.every) && self.meshes.len() < most {
                self.meshes.push((self.seen, mesh));
            }
        }
        self.seen += 1;
    }
}

/// The largest distance between nodes of the same pieces; infinite where one is NaN.
fn distance(a: &[Vec<f64>], b: &[Vec<f64>]) -> f64 {
    largest(a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| a - b))
}
