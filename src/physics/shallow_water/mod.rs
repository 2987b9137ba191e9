//! The shallow water equations: settings, and Newton's method for either form.

mod advective;
mod flux;

use super::{Motion, Physics, nodal};
use crate::error::{Error, Failure, Result};
use crate::geometry::{DualCells, Field, Mesh, Patch, check_finite};
use crate::numerics::linear::{BlockMatrix, LinearSolver, RobustBlock};
use crate::numerics::{larger, sum};
use crate::parallel;
use crate::work::Work;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The shallow water equations, and a pile of water that collapses
///
/// ```text
/// h_t + ∇·(h u) = 0,   (h u)_t + ∇·(h u ⊗ u) + ∇(g h²/2) = 0                                   (flux)
/// h_t + u·∇h + h ∇·u = 0,   u_t + u·∇u + g ∇h = 0                                              (advective)
/// at the start   h = depth + (pile/2) (1 − tanh((r − radius)/width)),   u = 0,   r from the centre of the box
/// ```
///
/// The unknowns are the depth h > 0 and the velocity (u, v). Both axes must be periodic; r is the distance to the
/// nearest image of the centre. The scheme is trapezoidal in time, solved by Newton's method with the exact Jacobian,
/// and of second order in space and time.
///
/// **Flux form.** Finite volumes on the [dual cells](DualCells) of areas A, with faces of normal N that sweep the area
/// s:
///
/// ```text
/// A′ q′ − A q = − ½ Σ [Δt F(q, N) − s q̄] − ½ Σ [Δt F(q′, N′) − s q̄′],   q = (h, h u)
/// F = h̄ (ū·N) (1, ū) + ½ g \overline{h²} (0, N),   q̄ = h̄ (1, ū),   bars: means of the two nodes of a face
/// ```
///
/// After Newton's method the formula is evaluated once more, so that mass and momentum are conserved to round-off for
/// any tolerance. A constant state stays constant for any motion of the mesh. F conserves energy on a mesh at rest.
///
/// **Advective form.** Central differences at the nodes, with the velocity ẋ of the mesh in both halves of the step: R
/// = (ẋ − u)·∇ … . It conserves nothing exactly.
///
/// # Example
/// ```
/// use driftmesh::{geometry::{Lattice, Mesh}, physics::{Motion, Physics, ShallowWater}};
/// let lattice = Lattice::new([8, 8], [true; 2])?;
/// let mesh = Mesh::uniform(lattice, [0.0; 2], [6.0; 2])?;
/// let mut water = ShallowWater::default();
/// let still = water.initial(0.0, &mesh);
/// let motion = Motion { t: 0.0, dt: 0.01, old: &mesh, new: &mesh };
/// let (moving, _) = water.step(motion, &still)?;
/// let [before, after] = [&still, &moving].map(|u| water.conserved(&mesh, u));
/// assert!((after - before).abs() < 1e-14 * before);
/// # Ok::<(), driftmesh::Error>(())
/// ```
///
/// # Source
/// Fjordholm, Mishra and Tadmor, *Well-balanced and energy stable schemes for the shallow water equations with
/// discontinuous topography* (2011), for F. (4.2) of Bihlo, Haynes and Walsh (2015) for the advective form; the shape
/// of their pile is not published.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ShallowWater {
    /// Form of the equations: `"flux"`, which conserves mass and momentum, or `"advective"`, as published.
    pub form: WaterForm,
    /// Gravitational acceleration g, above 0.
    pub gravity: f64,
    /// Depth of the water far from the pile, above 0.
    pub depth: f64,
    /// Height of the pile above that depth. It may be negative, but some water must be left.
    pub pile: f64,
    /// Radius of the pile at half of its height, above 0.
    pub radius: f64,
    /// Width of the pile's edge, above 0: at the distance `radius` + `width` from the centre of the box (1 − tanh 1)/2
    /// = 12 % of its height are left.
    pub width: f64,
}

/// Form of the shallow water equations.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum WaterForm {
    /// In h and h u. It conserves mass and momentum.
    #[default]
    Flux,
    /// In h and u, as published. It conserves nothing exactly.
    Advective,
}

impl Default for ShallowWater {
    fn default() -> Self {
        Self { form: WaterForm::Flux, gravity: 1.0, depth: 10.0, pile: 2.5, radius: 1.0, width: 0.3 }
    }
}

/// (h, u, v) at a node, or its three equations.
type Water = [f64; 3];
/// Derivatives of three equations by (h, u, v) at one node.
type Block = [[f64; 3]; 3];
type Gravity = f64;

/// A discrete form of the equations over one step, written `known(start) = unknown(end)` at every node
///
/// `w` holds (h, u, v), padded; `i` counts the nodes, `k` is the place of node i in `w`.
trait Scheme: Sync {
    /// The sizes of the three equations for water of a given depth and speed, to which residuals are compared.
    fn scales(&self, depth: f64, speed: f64) -> Water;
    /// The share of the cell of node i that a wave of speed one crosses in a step.
    fn courant(&self, i: usize, k: usize) -> f64;
    /// The part of the equations that depends on the start of the step.
    fn known(&self, w: &[Water], i: usize, k: usize) -> Water;
    /// The part of the equations that depends on the end of the step.
    fn unknown(&self, w: &[Water], i: usize, k: usize) -> Water;
    /// The derivatives of [`unknown`](Self::unknown) by the nodes of the star.
    fn jacobian(&self, w: &[Water], i: usize, k: usize) -> [Block; 5];
    /// (h, u, v) at the node, from the converged `w`.
    fn finish(&self, known: &Water, w: &[Water], i: usize, k: usize) -> Water;
}

/// Newton's method has converged once every residual is below this share of the size of its equation. It is near
/// round-off, since the remaining error is advanced explicitly and may grow.
const TOLERANCE: f64 = 1e-13;
/// Number of Newton steps after which a time step is given up.
const MAX_NEWTON: usize = 20;

impl ShallowWater {
    /// Refuses settings out of range.
    ///
    /// # Errors
    /// [`Error::Invalid`] unless all settings are finite, gravity, depth, radius and width are positive, and the pile
    /// leaves water.
    pub fn check(&self) -> Result<()> {
        let positive =
            [("gravity", self.gravity), ("depth", self.depth), ("radius", self.radius), ("width", self.width)];
        for (key, value) in positive {
            if !(value.is_finite() && value > 0.0) {
                return Err(Error::invalid(key, value, "must be a finite number above 0"));
            }
        }
        if !(self.pile.is_finite() && self.depth + self.pile > 0.0) {
            let rule = format!("must be a finite number above -depth = -{}, or no water is left", self.depth);
            return Err(Error::invalid("pile", self.pile, rule));
        }
        Ok(())
    }

    /// Solves one step of a scheme from the padded state `w`. Returns the new values at the nodes, and the failure of
    /// Newton's method if it stalled.
    fn solve(&self, patch: Patch<2>, scheme: &impl Scheme, mut w: Vec<Water>) -> Result<Solved, Failure> {
        let n = patch.pencil_len();
        let places = |p: usize| (p * n..(p + 1) * n).zip(patch.pencil(p)..);
        let every_node = |out: &mut [Water], f: &(dyn Fn(usize, usize) -> Water + Sync)| {
            parallel::for_each_row(out, n, |p, out| {
                out.iter_mut().zip(places(p)).for_each(|(out, (i, k))| *out = f(i, k));
            });
        };
        let [depth, u, v] = [0, 1, 2].map(|c| w.iter().fold(0.0, |m, w| larger(m, w[c])));
        let speed = u + v + (self.gravity * depth).sqrt();
        let scales = scheme.scales(depth, speed);
        // where a wave crosses many cells in a step, round-off alone leaves residuals above the tolerance
        let courant = patch.places().enumerate().fold(0.0, |m, (i, k)| larger(m, speed * scheme.courant(i, k)));
        let wanted = TOLERANCE.max(8.0 * f64::EPSILON * (1.0 + courant));
        let mut known = vec![[0.0; 3]; patch.len()];
        every_node(&mut known, &|i, k| scheme.known(&w, i, k));

        let mut work = Work::default();
        let mut solver = RobustBlock::default();
        let mut matrix = BlockMatrix::<2, 5, 3>::zero_blocks(patch);
        let mut residual = vec![[0.0; 3]; patch.len()];
        let stalled = loop {
            every_node(&mut residual, &|i, k| {
                let unknown = scheme.unknown(&w, i, k);
                std::array::from_fn(|c| known[i][c] - unknown[c])
            });
            // relative to the sizes of the equations
            let sizes: Water = std::array::from_fn(|c| residual.iter().fold(0.0, |m, r| larger(m, r[c])) / scales[c]);
            let largest = sizes.into_iter().fold(0.0, larger);
            if largest <= wanted {
                break None;
            }
            let iterations = work.newton_iterations;
            if iterations == MAX_NEWTON || !largest.is_finite() {
                break Some(Failure::NewtonStalled { residual: largest, tolerance: wanted, iterations });
            }
            parallel::for_each_row(&mut matrix.rows, n, |p, rows| {
                rows.iter_mut().zip(places(p)).for_each(|(row, (i, k))| *row = scheme.jacobian(&w, i, k));
            });
            let mut correction = vec![[0.0; 3]; patch.padded_len()];
            // Newton's method squares the residual, so that a much more accurate linear solve is wasted
            let share = (0.01 * largest * largest.min(1.0)).max(0.1 * wanted);
            let tolerance = scales.map(|scale| share * scale);
            work += solver.solve(&matrix, &residual, &mut correction, tolerance)?;
            work.newton_iterations += 1;
            for (w, correction) in w.iter_mut().zip(&correction) {
                (0..3).for_each(|c| w[c] += correction[c]);
            }
        };
        let mut values = vec![[0.0; 3]; patch.len()];
        every_node(&mut values, &|i, k| scheme.finish(&known[i], &w, i, k));
        Ok(Solved { values, work, stalled })
    }
}

/// The values at the end of a step, one for each node.
struct Solved {
    values: Vec<Water>,
    work: Work,
    stalled: Option<Failure>,
}

impl Physics for ShallowWater {
    fn unknowns(&self) -> Vec<String> {
        UNKNOWNS.map(String::from).into()
    }

    fn initial(&self, _t: f64, mesh: &Mesh<2>) -> Field {
        let (lower, extent, periodic) = (mesh.lower(), mesh.extent(), mesh.lattice().periodic());
        let depth = |x: &[f64; 2]| {
            let [dx, dy] = [0, 1].map(|d| {
                let from_centre = x[d] - (lower[d] + 0.5 * extent[d]);
                let turns = if periodic[d] { (from_centre / extent[d]).round() } else { 0.0 };
                from_centre - turns * extent[d]
            });
            self.depth + 0.5 * self.pile * (1.0 - ((dx.hypot(dy) - self.radius) / self.width).tanh())
        };
        Field::nodal(mesh.x().iter().map(|x| [depth(x), 0.0, 0.0]).collect())
    }

    fn areas(&self, mesh: &Mesh<2>) -> Vec<f64> {
        DualCells::new(mesh).areas().to_vec()
    }

    /// The integrals of the depth, and of the momentum along both axes.
    fn integrals(&self, mesh: &Mesh<2>, w: &Field) -> Vec<f64> {
        let areas = self.areas(mesh);
        let momentum = |c: usize| {
            let moving = w.component(0).zip(w.component(c));
            sum(areas.iter().zip(moving).map(|(area, (h, u))| area * h * u))
        };
        let water = sum(areas.iter().zip(w.component(0)).map(|(area, h)| area * h));
        vec![water, momentum(1), momentum(2)]
    }

    fn step(&mut self, motion: Motion<'_>, u: &Field) -> Result<(Field, Work), Failure> {
        let Motion { dt, old, new, .. } = motion;
        let lattice = new.lattice();
        if let Some(axis) = lattice.periodic().iter().position(|periodic| !periodic) {
            return Err(Failure::NotPeriodic { what: "the shallow water equations", axis });
        }
        let start = nodal::<2, 3>(motion, u)?;
        check(old, start)?;
        let patch = Patch::whole(lattice);
        let w = patch.gather(lattice, start, [[0.0; 3]; 2]);
        let Solved { values, work, stalled } = match self.form {
            WaterForm::Flux => {
                let [old, new] = [old, new].map(DualCells::new);
                let swept = old.swept(&new);
                let scheme = flux::Flux { dt, gravity: self.gravity, old: &old, new: &new, swept };
                self.solve(patch, &scheme, w)?
            }
            WaterForm::Advective => {
                let [width, height] = new.extent();
                let [old, new] = [old, new].map(|m| patch.gather(lattice, m.x(), [[width, 0.0], [0.0, height]]));
                let strides = patch.padded_strides();
                let scheme = advective::Advective { dt, gravity: self.gravity, strides, old: &old, new: &new };
                self.solve(patch, &scheme, w)?
            }
        };
        check(new, &values)?;
        stalled.map_or(Ok((Field::nodal(values), work)), Err)
    }
}

const UNKNOWNS: [&str; 3] = ["h", "u", "v"];

/// Refuses values that are not finite and depths that are not positive.
fn check(mesh: &Mesh<2>, values: &[Water]) -> Result<(), Failure> {
    check_finite(UNKNOWNS, mesh, values)?;
    match values.iter().position(|w| w[0] <= 0.0) {
        None => Ok(()),
        Some(k) => {
            let at = mesh.node_place(k);
            Err(Failure::NotPositive { what: "the depth h", value: values[k][0], at })
        }
    }
}
