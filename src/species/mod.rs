//! Species in the phases of a line, and the fronts between these, whose law is a formula.
//!
//! ```text
//! ∂σ(c)/∂t = x^−m ∂/∂x (x^m D ∂c/∂x) + s      in every phase for each of its species,      m = 0, 1, 2
//! dX/dt = law(c, J) at every front X,      J = −D ∂c/∂x
//! ```
//!
//! c is the concentration of a species, σ what a volume stores of it, D its diffusivity, s its source, all formulas; m
//! = 1 and 2 are for distances from an axis and from a point. Finite volumes fill each phase and move with its ends.
//! What leaves a cell enters the next one, and what crosses a front is what the law sees, so that totals are kept to
//! round-off. Two implicit stages make a step of second order in time ([`Species::attempt`]).

mod dual;
mod equations;
mod names;
mod newton;
mod rate;
mod step;

pub use names::Names;
pub use rate::Rate;
pub use step::{SpeciesState, Total};

use crate::physics::Coordinates;

/// What holds for a species at an end of a phase.
#[derive(Debug, Clone)]
pub enum EndCondition {
    /// Its concentration.
    Value(Rate),
    /// What flows into the phase for each area and time, beside an end that may move: D ∂c/∂n + σ V·n, n outward.
    Flux(Rate),
    /// ∂c/∂n = 0: what the moving end sweeps over leaves.
    Outflow,
}

/// A species in a phase.
#[derive(Debug, Clone)]
pub struct Resident {
    /// Which of the species.
    pub species: usize,
    /// σ, the amount in a volume, of the concentrations in the phase, x and t.
    pub storage: Rate,
    /// D, of the same.
    pub diffusivity: Rate,
    /// s, of the same.
    pub source: Rate,
    /// The concentration at the start, of x.
    pub initial: Rate,
    /// What holds at the left and at the right end; there of the concentrations in the phase, x and t on a wall, and of
    /// [`Names::beside`] on a front.
    pub ends: [EndCondition; 2],
}

/// The problem: phases from left to right, with a front between each two.
#[derive(Debug, Clone)]
pub struct Species {
    /// The weight of volumes.
    pub coordinates: Coordinates,
    /// The left and the right wall.
    pub walls: [f64; 2],
    /// Names of species and phases.
    pub names: Names,
    /// Number of cells in each phase.
    pub cells: Vec<usize>,
    /// The species of each phase, in the order of their names.
    pub residents: Vec<Vec<Resident>>,
    /// Velocity of each front to the right, of [`Names::at_front`].
    pub laws: Vec<Rate>,
}

impl Species {
    /// m: volumes have the weight x^m.
    fn power(&self) -> i32 {
        match self.coordinates {
            Coordinates::Cartesian => 0,
            Coordinates::Cylindrical => 1,
            Coordinates::Spherical => 2,
        }
    }

    /// Number of unknowns before those of a phase; of all phases for one more than the last.
    fn before(&self, phase: usize) -> usize {
        (0..phase).map(|p| (self.cells[p] + 2) * self.residents[p].len()).sum()
    }

    /// The unknown of a resident of a phase at a place: 0 is its left end, then come the cells, then the right end.
    fn at(&self, phase: usize, place: usize, resident: usize) -> usize {
        self.before(phase) + place * self.residents[phase].len() + resident
    }

    /// The unknown that is the place of a front.
    fn front(&self, k: usize) -> usize {
        self.before(self.cells.len()) + k
    }

    fn unknowns(&self) -> usize {
        self.front(self.laws.len())
    }
}
