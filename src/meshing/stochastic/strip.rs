use super::coarse::FEWEST_CELLS;
use super::coarse::SOLVED;
use super::strips::{Reach, Strips};
use super::{Estimates, Estimator, Problem};
use crate::error::{Error, Failure, Result};
use crate::meshing::Decomposition;
use crate::meshing::overlap::Local;
use crate::setting::Auto;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Every subdomain is solved once with a strip of its neighbours: a deterministic alternative to random walks
///
/// This is an overlapping Schwarz iteration that stops after its first sweep. The influence of nodes beyond a strip of
/// width d is e^(−d/ℓ) with ℓ = √(Δt/τ); where this is not small, a coarse lattice gives the start: see [`Strips`]. A
/// step takes one exchange with the neighbours and one gathering of the coarse right-hand sides. Its error is
/// systematic, whereas that of walks averages out.
///
/// With "auto" strips are so wide that the influence beyond them is below a thousandth, if ten nodes are enough for
/// that; else there is a coarse lattice with one cell for 2 × 2, and strips of eight nodes. Strips may reach over
/// several narrow subdomains. The coarse lattice estimates its own error: as long as more than a hundredth of the
/// shortest edge of the mesh may be left, further exchanges follow.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Strip {
    /// Width of the strip beyond each cut, in nodes, that a subdomain solves for together with its own nodes: from 1 to
    /// the number of cells of the narrowest subdomain. "auto" takes as many as leave the nodes beyond an influence
    /// below a thousandth if ten are enough for that, else eight.
    pub width: Auto<usize>,
    /// Cells along each axis that make one cell of the coarse lattice, from whose solution the strips start; 1 for no
    /// coarse lattice. "auto" takes 2 where ten nodes of strip are not enough, else 1.
    pub coarse: Auto<usize>,
    /// Exchanges between neighbours in a step; "auto" goes on with them until the error that is left is estimated at no
    /// more than a hundredth of the shortest edge of the mesh.
    pub exchanges: Auto<usize>,
}

/// Largest number of exchanges that may be set.
const MAX_EXCHANGES: usize = 1000;

impl Strip {
    /// One exchange of strips of a given width, without a coarse lattice.
    pub fn plain(width: usize) -> Self {
        Self { width: Auto::Value(width), coarse: Auto::Value(1), exchanges: Auto::Value(1) }
    }

    /// Refuses settings out of range for a decomposition.
    ///
    /// # Errors
    /// [`Error::Invalid`].
    pub fn check<const D: usize>(&self, decomposition: &Decomposition<D>) -> Result<()> {
        let (narrowest, cells) = (decomposition.narrowest(), decomposition.lattice().cells());
        let coarsest = cells.into_iter().max().unwrap_or(0) / FEWEST_CELLS;
        match *self {
            Self { width: Auto::Value(0), .. } => Err(Error::invalid(
                "width",
                0,
                "a strip needs 1 node or more; \"auto\" takes as many as ℓ = √(Δt/τ) asks for",
            )),
            Self { width: Auto::Value(width), .. } if width > narrowest => {
                let rule = format!(
                    "must be at most the {narrowest} cells of the narrowest subdomain; lower it, or give fewer \
                     subdomains"
                );
                Err(Error::invalid("width", width, rule))
            }
            Self { coarse: Auto::Value(0), .. } => Err(Error::invalid(
                "coarse",
                0,
                "must be 2 or more cells to a coarse one, 1 for no coarse lattice, or \"auto\"",
            )),
            Self { coarse: Auto::Value(coarse), .. } if coarse > 1 && coarse > coarsest => {
                let rule =
                    format!("must leave {FEWEST_CELLS} coarse cells along an axis, that is be at most {coarsest} here");
                Err(Error::invalid("coarse", coarse, rule))
            }
            Self { exchanges: Auto::Value(n), .. } if !(1..=MAX_EXCHANGES).contains(&n) => {
                Err(Error::invalid("exchanges", n, format!("must be between 1 and {MAX_EXCHANGES}, or \"auto\"")))
            }
            _ => Ok(()),
        }
    }

    /// The settings that are given, with the others chosen for the step.
    fn reach<const D: usize>(&self, problem: &Problem<'_, D>, decomposition: &Decomposition<D>) -> Reach {
        let by_itself = Reach::of(problem, decomposition);
        let width = match (self.width, self.coarse) {
            (Auto::Value(width), _) => width,
            (Auto::Auto, Auto::Auto) => by_itself.width,
            (Auto::Auto, Auto::Value(1)) => Reach::alone(problem, decomposition),
            (Auto::Auto, Auto::Value(coarse)) => Reach::alone(problem, decomposition).min(4 * coarse),
        };
        let coarse = match self.coarse {
            Auto::Value(coarse) => coarse,
            Auto::Auto if width >= Reach::alone(problem, decomposition) => 1,
            Auto::Auto => by_itself.coarse,
        };
        Reach { width, coarse }
    }
}

impl<const D: usize, const S: usize> Estimator<D, S> for Strip {
    fn check(&self, decomposition: &Decomposition<D>) -> Result<()> {
        self.check(decomposition)
    }

    fn estimate(
        &self,
        problem: &Problem<'_, D>,
        points: &[usize],
        strips: &mut Strips<D, S>,
    ) -> Result<Estimates<D>, Failure> {
        let reach = self.reach(problem, strips.decomposition());
        let exchanges = match self.exchanges {
            Auto::Auto => None,
            Auto::Value(exchanges) => Some(exchanges),
        };
        let found = strips.correct(problem, reach, Local::Solve { share: SOLVED }, exchanges)?;
        Ok(Estimates::of_strips(&found, points))
    }
}
