use crate::error::{Error, Failure, NodePlace, Result};
use crate::geometry::{Lattice, Mesh};

/// The phase below the front, warm: number 1 of the equations.
pub const LOWER: usize = 0;
/// The phase above the front, cold: number 0 of the equations.
pub const UPPER: usize = 1;

/// A phase counts as vanished where it is thinner than this share of the distance between the walls: its rows could
/// then no longer be told apart.
const VANISHED: f64 = 1e-3;
/// Where the wall of a phase is bare, the front lies at this share of the distance between the walls before it.
pub(super) const FILM: f64 = 1.5e-3;
/// Largest slope |dh/dx| of a front that is a graph over x; steeper ones are about to turn over.
const STEEP: f64 = 10.0;

/// Equally spaced columns between two walls, with rows in both phases that are closer near the front
///
/// ```text
/// below:  y = b + (h − b)(1 − (1 − s)^p)      above:  y = h + (c − h) s^p      s = j / rows
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Columns {
    x: Vec<f64>,
    /// Distance of neighbouring columns in the stencils: another one than that of x where all columns are alike.
    width: f64,
    walls: [Vec<f64>; 2],
    rows: [usize; 2],
    /// For each row of a phase, its share of the way from the lower to the upper end of the phase.
    shares: [Vec<f64>; 2],
}

impl Columns {
    /// Columns from x\[0\] to x\[1\]; `walls` gives the bottom and the top.
    ///
    /// # Errors
    /// [`Error::Invalid`] for fewer than 4 cells across or 3 in a phase, or a power that is not between 1 and 4.
    pub fn new(x: [f64; 2], walls: [&dyn Fn(f64) -> f64; 2], cells: [usize; 3], power: f64) -> Result<Self> {
        if cells[0] < 4 || cells[1] < 3 || cells[2] < 3 {
            let rule = "needs at least 4 cells across and 3 in each phase";
            return Err(Error::invalid("cells", format!("{cells:?}"), rule));
        }
        if cells.iter().try_fold(1_usize, |all, &n| all.checked_mul(n + 3)).is_none() {
            return Err(Error::invalid("cells", format!("{cells:?}"), "so many nodes cannot be counted; lower it"));
        }
        if !(1.0..=4.0).contains(&power) {
            return Err(Error::invalid("grading", power, "must be between 1 (equal rows) and 4"));
        }
        let n = cells[0];
        let middle = 0.5 * (x[0] + x[1]);
        // symmetric about the middle to the last bit
        let half = 0.5 * (x[1] - x[0]);
        let x: Vec<f64> = (0..=n).map(|i| middle + half * ((2 * i) as f64 - n as f64) / n as f64).collect();
        let shares = [LOWER, UPPER].map(|phase| {
            let rows = cells[1 + phase];
            let share = |j: usize| match phase {
                LOWER if j < rows => 1.0 - (1.0 - j as f64 / rows as f64).powf(power),
                UPPER if j < rows => (j as f64 / rows as f64).powf(power),
                _ => 1.0,
            };
            (0..=rows).map(share).collect()
        });
        let walls = walls.map(|wall| x.iter().map(|&x| wall(x)).collect());
        let width = (x[n] - x[0]) / n as f64;
        Ok(Self { x, width, walls, rows: [cells[1], cells[2]], shares })
    }

    /// Says that nothing depends on x. Stencils then take columns to be no narrower than rows are high, since of
    /// flat columns the exchange along x would leave nothing of that along y but round-off.
    pub fn alike(&mut self) {
        let gap = self.gap(0);
        self.width = self.spacing().max(gap / (self.rows[LOWER] + self.rows[UPPER]) as f64);
    }

    /// How many times a row is higher than a column of the stencils is wide.
    pub fn flatness(&self) -> f64 {
        let rows = (self.rows[LOWER] + self.rows[UPPER]) as f64;
        (0..self.x.len()).map(|i| self.gap(i)).fold(0.0, f64::max) / (rows * self.width)
    }

    /// x of each column.
    pub fn x(&self) -> &[f64] {
        &self.x
    }

    /// Distance between neighbouring columns.
    pub fn spacing(&self) -> f64 {
        (self.x[self.x.len() - 1] - self.x[0]) / (self.x.len() - 1) as f64
    }

    /// Number of cells across a phase.
    pub fn rows(&self, phase: usize) -> usize {
        self.rows[phase]
    }

    /// The failure of a quantity that is not finite at the k-th node of a phase, whose height is y.
    pub(super) fn not_finite(&self, what: &'static str, value: f64, phase: usize, k: usize, y: f64) -> Failure {
        let [i, j] = [k / (self.rows[phase] + 1), k % (self.rows[phase] + 1)];
        Failure::NonFinite { what, value, at: NodePlace::new([i, j], [self.x[i], y]) }
    }

    /// Height of the wall of a phase, the bottom for the lower one.
    pub fn wall(&self, phase: usize) -> &[f64] {
        &self.walls[phase]
    }

    /// Distance between the walls at a column.
    pub(super) fn gap(&self, i: usize) -> f64 {
        self.walls[UPPER][i] - self.walls[LOWER][i]
    }

    /// Height of the front at a column where the wall of a phase is bare.
    pub(super) fn film(&self, phase: usize, i: usize) -> f64 {
        self.walls[phase][i] + if phase == LOWER { FILM } else { -FILM } * self.gap(i)
    }

    /// Distance of a front at height y from the nearer wall at a column, a hundredth of that between the walls at
    /// least.
    pub(super) fn room(&self, i: usize, y: f64) -> f64 {
        let [bottom, top] = self.walls.each_ref().map(|wall| wall[i]);
        (y - bottom).min(top - y).max(0.01 * (top - bottom))
    }

    /// Row of the front and of the wall in a phase.
    pub fn ends(&self, phase: usize) -> [usize; 2] {
        if phase == LOWER { [self.rows[LOWER], 0] } else { [0, self.rows[UPPER]] }
    }

    /// y of all nodes of a phase, column by column.
    pub fn heights(&self, phase: usize, front: &[f64]) -> Vec<f64> {
        let mut y = Vec::with_capacity(self.x.len() * (self.rows[phase] + 1));
        for (wall, &h) in self.walls[phase].iter().zip(front) {
            let (low, high) = if phase == LOWER { (*wall, h) } else { (h, *wall) };
            let last = self.rows[phase];
            y.extend(self.shares[phase].iter().enumerate().map(|(j, share)| match j {
                j if j == last => high,
                _ => low + (high - low) * share,
            }));
        }
        y
    }

    /// The mesh of m nodes a column at heights y; one more column beyond each side that is `mirrored`.
    pub(super) fn mesh(&self, m: usize, y: &[f64], mirrored: [bool; 2]) -> Result<Mesh<2>> {
        let (n, h) = (self.x.len(), self.width);
        let at = |i: usize| if h == self.spacing() { self.x[i] } else { i as f64 * h };
        let mut nodes = Vec::with_capacity((n + 2) * m);
        let mut column = |x: f64, i: usize| nodes.extend(y[i * m..(i + 1) * m].iter().map(|&y| [x, y]));
        if mirrored[0] {
            column(at(0) - h, 1);
        }
        (0..n).for_each(|i| column(at(i), i));
        if mirrored[1] {
            column(at(n - 1) + h, n - 2);
        }
        let across = n - 1 + mirrored.into_iter().filter(|mirrored| *mirrored).count();
        Mesh::mapped(Lattice::bounded([across, m - 1])?, nodes)
    }

    /// Both phases as one mesh, the front being row `rows(LOWER)`.
    ///
    /// # Errors
    /// [`Failure::NonFinite`] where a height is not finite.
    pub fn whole(&self, front: &[f64]) -> Result<Mesh<2>> {
        let [low, high] = [LOWER, UPPER].map(|phase| self.heights(phase, front));
        let [n, m] = self.rows;
        let mut nodes = Vec::with_capacity(self.x.len() * (n + m + 1));
        for (i, &x) in self.x.iter().enumerate() {
            nodes.extend(low[i * (n + 1)..(i + 1) * (n + 1)].iter().map(|&y| [x, y]));
            nodes.extend(high[i * (m + 1) + 1..(i + 1) * (m + 1)].iter().map(|&y| [x, y]));
        }
        Mesh::mapped(Lattice::bounded([self.x.len() - 1, n + m])?, nodes)
    }

    /// Values of both phases in the order of [`whole`](Self::whole).
    pub fn joined(&self, u: &[Vec<f64>; 2]) -> Vec<f64> {
        let [n, m] = self.rows;
        let column = |i: usize| {
            u[LOWER][i * (n + 1)..(i + 1) * (n + 1)].iter().chain(&u[UPPER][i * (m + 1) + 1..(i + 1) * (m + 1)])
        };
        (0..self.x.len()).flat_map(column).copied().collect()
    }

    /// Refuses a front that leaves the space between the walls, leaves too little of a phase, or is too steep to be a
    /// graph. At columns where the wall of a phase is `bare` there may be little of it.
    ///
    /// # Errors
    /// [`Failure::NonFinite`], [`Failure::FrontOutside`], [`Failure::VanishingPhase`] or [`Failure::NotAGraph`].
    pub fn check(&self, front: &[f64], bare: &[Option<usize>]) -> Result<(), Failure> {
        for (i, (&x, &y)) in self.x.iter().zip(front).enumerate() {
            if !y.is_finite() {
                return Err(Failure::NonFinite {
                    what: "the front",
                    value: y,
                    at: NodePlace::new([i, self.rows[LOWER]], [x, y]),
                });
            }
            let [bottom, top] = self.walls.each_ref().map(|wall| wall[i]);
            if y <= bottom {
                return Err(Failure::FrontOutside { x: [x, y], wall: "bottom", y: bottom });
            }
            if y >= top {
                return Err(Failure::FrontOutside { x: [x, y], wall: "top", y: top });
            }
            let of = top - bottom;
            for (phase, thickness) in [("lower", y - bottom), ("upper", top - y)] {
                if thickness < VANISHED * of && bare.get(i).is_none_or(Option::is_none) {
                    let phase = phase.into();
                    return Err(Failure::VanishingPhase { phase, x, thickness, of });
                }
            }
        }
        let h = self.spacing();
        for (i, pair) in front.windows(2).enumerate() {
            let slope = (pair[1] - pair[0]) / h;
            if slope.abs() > STEEP {
                return Err(Failure::NotAGraph { x: [self.x[i], pair[0]], slope });
            }
        }
        Ok(())
    }
}
