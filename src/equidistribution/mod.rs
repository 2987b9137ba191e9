//! Equidistribution in one dimension, on the whole line and by Schwarz's method.
//!
//! The mesh x(ξ) on \[0, 1\] solves (M(x) x_ξ)_ξ = 0 with its ends fixed, or x_t = (1/τ) (M x_ξ)_ξ in time. In
//! Schwarz's method the line is divided into pieces, which are solved separately and exchange what they have at their
//! ends until they agree.
//!
//! # Source
//! M. J. Gander and R. D. Haynes, *Domain decomposition approaches for mesh generation via the equidistribution
//! principle* (2012). Its theorem 3.4, that the linearised iteration always converges, does not hold: for the density M
//! = 300 (x − ½)² + 1 and two pieces that overlap in (.48, .52) the iteration oscillates for ever.

mod beyond;
mod chain;
mod coarse;
mod conditions;
mod counts;
mod cumulative;
mod density;
mod even;
mod history;
mod iteration;
mod newton;
pub mod pieces;
mod polynomial;
mod predict;
mod schwarz;

#[cfg(test)]
mod tests;

pub use chain::FaceDensity;
pub use density::{LineDensity, check_ends};
pub(crate) use history::MOST_ITERATIONS;
pub use history::{History, Iterate, Measure, Stop};
pub use predict::Prediction;
pub use schwarz::{Coarse, Method, Robin, Sweep};

use crate::error::{Error, Failure, Result};
use chain::{Chain, Equations, Step};
use conditions::End;
use cumulative::Cumulative;

/// A line with a density, to be divided into cells of equal ∫M.
///
/// # Example
/// ```
/// use driftmesh::equidistribution::{Line, LineDensity};
/// let line = Line::new(LineDensity::formula("x^2 + 1")?, 20);
/// let mesh = line.solve(0.0, &line.uniform(), None)?.0;
/// // the continuous mesh has x(½) = .59607164; the discrete one is of second order
/// assert!((mesh[10] - 0.59607164).abs() < 2e-4);
/// # Ok::<(), driftmesh::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct Line {
    /// The density M.
    pub density: LineDensity,
    /// How M is averaged over a cell.
    pub face: FaceDensity,
    /// Number of cells, of equal width in ξ.
    pub cells: usize,
    /// The ends of the line in x.
    pub ends: [f64; 2],
}

/// The mesh before a time step, and τ/Δt of the step; none without time.
pub type Before<'a> = Option<(&'a [f64], f64)>;

/// The mesh of a whole line without time, and how it was found.
#[derive(Debug, Clone)]
pub struct Settled {
    /// Nodes.
    pub mesh: Vec<f64>,
    /// Linear solves that it took.
    pub linear_solves: usize,
    /// The failure of Newton's method for the average that was asked for, where these nodes are those of
    /// [`FaceDensity::Exact`] instead.
    pub stalled: Option<Failure>,
}

impl Line {
    /// The density M on \[0, 1\], averaged by trapezoids.
    pub fn new(density: LineDensity, cells: usize) -> Self {
        Self { density, face: FaceDensity::default(), cells, ends: [0.0, 1.0] }
    }

    fn chain<'a>(&'a self, t: f64, cumulative: Option<&'a Cumulative>) -> Chain<'a> {
        Chain { density: &self.density, face: self.face, t, h: 1.0 / self.cells as f64, ends: self.ends, cumulative }
    }

    fn cumulative(&self, t: f64) -> Result<Cumulative, Failure> {
        Cumulative::new(&self.density, t, self.ends)
    }

    /// The nodes of equal cells.
    pub fn uniform(&self) -> Vec<f64> {
        self.mapped(|xi| xi)
    }

    /// The nodes at which a function of ξ, from 0 to 1, divides the line.
    pub fn mapped(&self, f: impl Fn(f64) -> f64) -> Vec<f64> {
        let [a, b] = self.ends;
        let mut x: Vec<f64> = (0..=self.cells).map(|i| a + (b - a) * f(i as f64 / self.cells as f64)).collect();
        (x[0], x[self.cells]) = (a, b);
        x
    }

    /// The mesh on which all cells have the same ∫M. Its nodes are those of the continuous problem, found by inverting
    /// ∫M; it exists for every finite and positive density.
    ///
    /// # Errors
    /// [`Failure::LineDensity`]; [`Failure::LineUnresolved`] where so many cells lie in so thin a layer that
    /// neighbouring nodes are the same floating-point number.
    pub fn equidistributed(&self, t: f64) -> Result<Vec<f64>, Failure> {
        self.divided(&self.cumulative(t)?)
    }

    fn divided(&self, cumulative: &Cumulative) -> Result<Vec<f64>, Failure> {
        let mesh = cumulative.divided(self.ends, self.cells);
        match (1..mesh.len()).find(|&i| mesh[i] <= mesh[i - 1]) {
            None => Ok(mesh),
            Some(i) => Err(Failure::LineUnresolved { node: i, x: mesh[i], cells: self.cells }),
        }
    }

    /// The discrete mesh of the whole line, and the number of linear solves. For [`FaceDensity::Exact`] without time it
    /// is [`equidistributed`](Self::equidistributed) and takes none. Otherwise Newton's method starts there, or in time
    /// at the guess.
    ///
    /// # Errors
    /// As [`iterate`](Self::iterate), and those of [`equidistributed`](Self::equidistributed).
    pub fn solve(&self, t: f64, guess: &[f64], before: Before<'_>) -> Result<(Vec<f64>, usize)> {
        self.check_start("guess", guess, before)?;
        let cumulative = self.cumulative(t)?;
        Ok(self.solved(t, &cumulative, guess, before)?)
    }

    fn solved(
        &self,
        t: f64,
        cumulative: &Cumulative,
        guess: &[f64],
        before: Before<'_>,
    ) -> Result<(Vec<f64>, usize), Failure> {
        let step = before.map(|(old, ratio)| Step { old, ratio });
        let chain = &self.chain(t, Some(cumulative));
        let equations = Equations { chain, ends: self.ends.map(End::Value), step };
        if before.is_some() {
            return equations.solve(guess);
        }
        let near = self.divided(cumulative)?;
        if self.face == FaceDensity::Exact {
            return Ok((near, 0));
        }
        match equations.newton(&near) {
            Err(Failure::LineStalled { .. }) => equations.newton(guess),
            other => other,
        }
    }

    /// The discrete mesh of the whole line. Where Newton's method does not converge, it is the one whose cells have the
    /// same ∫M: with trapezoids or midpoints there may be no discrete mesh for an M that jumps or peaks within a cell.
    ///
    /// # Errors
    /// As [`equidistributed`](Self::equidistributed).
    pub fn settled(&self, t: f64) -> Result<Settled, Failure> {
        let cumulative = self.cumulative(t)?;
        match self.solved(t, &cumulative, &self.uniform(), None) {
            Ok((mesh, linear_solves)) => Ok(Settled { mesh, linear_solves, stalled: None }),
            Err(stalled @ Failure::LineStalled { .. }) => {
                let mesh = self.divided(&cumulative)?;
                Ok(Settled { mesh, linear_solves: 0, stalled: Some(stalled) })
            }
            Err(other) => Err(other),
        }
    }

    /// The continuous mesh at some ξ in ascending order: ∫M up to x(ξ) is ξ times that over the line.
    ///
    /// # Errors
    /// [`Failure::LineDensity`].
    pub fn exact(&self, t: f64, xi: &[f64]) -> Result<Vec<f64>, Failure> {
        let cumulative = self.cumulative(t)?;
        Ok(cumulative.inverted(xi.iter().map(|xi| xi * cumulative.whole())))
    }

    /// ∫M over each cell of a mesh, with M averaged as `face` says.
    ///
    /// # Errors
    /// [`Failure::LineDensity`].
    pub fn shares(&self, t: f64, mesh: &[f64]) -> Result<Vec<f64>, Failure> {
        let chain = self.chain(t, None);
        Ok(chain.fluxes(mesh)?.into_iter().map(|flux| flux * chain.h).collect())
    }

    /// Refuses nodes that are no mesh of the line: their number, their ends and their order must be right.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the key.
    pub fn check_mesh(&self, key: &str, mesh: &[f64]) -> Result<()> {
        let nodes = self.cells + 1;
        if mesh.len() != nodes {
            let rule = format!("{} cells have {nodes}; give one value a node", self.cells);
            return Err(Error::invalid(key, format!("{} nodes", mesh.len()), rule));
        }
        if let Some(i) = (1..nodes).find(|&i| !(mesh[i] > mesh[i - 1] && mesh[i].is_finite())) {
            let rule = format!("nodes must grow from left to right; node {} is at {}", i - 1, mesh[i - 1]);
            return Err(Error::invalid(key, format!("{} at node {i}", mesh[i]), rule));
        }
        if [mesh[0], mesh[self.cells]] != self.ends {
            let rule = format!("must go from {} to {}", self.ends[0], self.ends[1]);
            return Err(Error::invalid(key, format!("from {} to {}", mesh[0], mesh[self.cells]), rule));
        }
        Ok(())
    }

    /// Refuses a start, or nodes before a time step, that are no mesh of the line.
    fn check_start(&self, key: &str, start: &[f64], before: Before<'_>) -> Result<()> {
        self.check_mesh(key, start)?;
        before.map_or(Ok(()), |(old, _)| self.check_mesh("before", old))
    }
}
