//! An explicit solver on a uniform mesh, made as fast as is sensible, with which moving meshes are compared.

mod band;
mod stencil;

use super::{Burgers, Convection, Motion, Physics, nodal};
use crate::error::{Error, Failure, NodePlace, Result};
use crate::geometry::{Field, Mesh, check_finite};
use crate::numerics::larger;
use crate::work::Work;
use stencil::Stencil;

/// Burgers' equation on a uniform mesh at rest, by central differences and classical Runge–Kutta steps
///
/// ```text
/// u_t = −(u²/2)_x − (u²/2)_y + ν (u_xx + u_yy)
/// ```
///
/// Differences are conservative and central, of order 2 or 4 (`order`). A step Δt is divided into equal substeps of
/// fourth order, of at most 95 % of the length that is stable for the linearised equation with the largest |u|. Every
/// stage takes the side values of its own time. Order 4 also needs values one node beyond the sides, where it takes the
/// exact front: this is more than a solver knows in general, and favours this one.
///
/// A substep goes through memory once: its four stages follow each other row by row, within the cache. `u` has one
/// value for each node, in lattice order.
///
/// # Errors
/// A step returns [`Failure::NotUniform`] where the mesh moves or is not uniform, [`Failure::NotPeriodic`] where
/// a bounded axis has initial values but no side values, [`Failure::NonFinite`] where u blows up,
/// [`Failure::ManySubsteps`] where stability asks for more than 1e8.
///
/// # Example
/// ```
/// use driftmesh::geometry::{Lattice, Mesh};
/// use driftmesh::physics::{Burgers, Convection, Motion, Physics, UniformBurgers};
/// let mesh = Mesh::uniform(Lattice::bounded([40, 40])?, [0.0; 2], [1.0; 2])?;
/// let mut burgers = UniformBurgers::new(Burgers::new(0.05, Convection::Conservative)?, 4)?;
/// let u = burgers.initial(0.25, &mesh);
/// let (u, work) = burgers.step(Motion { t: 0.25, dt: 0.5, old: &mesh, new: &mesh }, &u)?;
/// // Δt = .95 · .75 · 2.785 h²/8ν = 3.1e-3
/// assert_eq!(work.substeps, 162);
/// let exact = burgers.exact(0.75, &mesh).unwrap();
/// assert!(u.values().iter().zip(exact.values()).all(|(u, e)| (u - e).abs() < 2e-5));
/// # Ok::<(), driftmesh::Error>(())
/// ```
///
/// # Source
/// Differences and Runge–Kutta steps are classical; stages that run through memory together are the wavefronts of
/// Wellein et al., *Efficient temporal blocking for stencil computations by multicore-aware wavefront parallelization*
/// (2009).
#[derive(Debug, Clone)]
pub struct UniformBurgers {
    burgers: Burgers,
    order: usize,
}

/// Length of substeps as a share of the longest stable one: the bound is for constant u, but u varies in space.
const SAFETY: f64 = 0.95;
/// Number of substeps after which the largest |u| is computed again, since side values may raise it.
const ROUND: usize = 64;
/// Largest number of substeps in a step: this many take minutes even on the smallest mesh.
const MOST: f64 = 1e8;
/// Number of rows in a band, for each ghost row. At either end of a band, 3 rows of the first stage, 2 of the second
/// and 1 of the third are computed twice for each ghost row, which makes 3 % of all.
const BAND: usize = 96;

impl UniformBurgers {
    /// The equation, with its sides and initial values, for differences of `order` 2 or 4.
    ///
    /// # Errors
    /// [`Error::Invalid`] for another order, for order 4 where side values are a formula (which need not have values
    /// beyond the sides), and for the advective form.
    pub fn new(burgers: Burgers, order: usize) -> Result<Self> {
        if order != 2 && order != 4 {
            return Err(Error::invalid("order", order, "must be 2 or 4"));
        }
        if order == 4 && burgers.boundary.is_some() {
            let rule =
                "looks past the sides, where pde.boundary means nothing; set it to 2, or make both axes periodic";
            return Err(Error::invalid("order", order, rule));
        }
        if burgers.convection == Convection::Advective {
            let rule = "has conservative convection only; set pde.convection to \"conservative\"";
            return Err(Error::invalid("stepper", "\"rk4\"", rule));
        }
        Ok(Self { burgers: burgers.compiled()?, order })
    }

    fn advance<const G: usize>(&self, motion: Motion<'_>, start: &[f64]) -> Result<(Field, Work), Failure> {
        let Motion { t, dt, new: mesh, .. } = motion;
        let grid = Grid::<G>::new(&self.burgers, mesh)?;
        let mut u = grid.gather(t, start);
        let mut next = u.clone();
        let mut scratch = grid.scratch();
        let mut solution = start.to_vec();
        let mut work = Work::default();
        let mut now = t;
        loop {
            let largest = u.iter().fold(0.0, |m, u| larger(m, *u));
            if !largest.is_finite() {
                break;
            }
            let left = ((t + dt - now) / (SAFETY * grid.stencil.stable_step(largest))).ceil().max(1.0);
            // NaN counts as too many
            if left.partial_cmp(&MOST).is_none_or(|o| o.is_gt()) {
                return Err(Failure::ManySubsteps { substeps: left, speed: largest });
            }
            let substep = (t + dt - now) / left;
            let round = left.min(ROUND as f64);
            for n in 0..round as usize {
                grid.substep(now + n as f64 * substep, substep, &u, &mut next, &mut scratch);
                std::mem::swap(&mut u, &mut next);
            }
            work.substeps += round as usize;
            if round == left {
                break;
            }
            now += round * substep;
        }
        grid.scatter(t + dt, &u, &mut solution);
        check_finite(["u"], mesh, solution.as_chunks().0)?;
        Ok((Field::scalar(solution), work))
    }
}

impl Physics for UniformBurgers {
    fn unknowns(&self) -> Vec<String> {
        self.burgers.unknowns()
    }

    fn initial(&self, t: f64, mesh: &Mesh<2>) -> Field {
        self.burgers.initial(t, mesh)
    }

    fn step(&mut self, motion: Motion<'_>, u: &Field) -> Result<(Field, Work), Failure> {
        let start = nodal::<2, 1>(motion, u)?.as_flattened();
        check_finite(["u"], motion.new, nodal::<2, 1>(motion, u)?)?;
        [motion.old, motion.new].into_iter().try_for_each(check_uniform)?;
        match self.order {
            2 => self.advance::<1>(motion, start),
            _ => self.advance::<2>(motion, start),
        }
    }

    fn exact(&self, t: f64, mesh: &Mesh<2>) -> Option<Field> {
        self.burgers.exact(t, mesh)
    }
}

/// Refuses a mesh that is not uniform in its box up to round-off.
fn check_uniform(mesh: &Mesh<2>) -> Result<(), Failure> {
    let (lattice, lower, extent) = (mesh.lattice(), mesh.lower(), mesh.extent());
    let cells = lattice.cells();
    for (k, &x) in mesh.x().iter().enumerate() {
        let node = lattice.node(k);
        for d in 0..2 {
            let off = x[d] - lower[d] - extent[d] * node[d] as f64 / cells[d] as f64;
            let tolerance = 1e-9 * extent[d] / cells[d] as f64 + 4.0 * f64::EPSILON * x[d].abs();
            // NaN counts as off
            if off.abs().partial_cmp(&tolerance).is_none_or(|o| o.is_gt()) {
                return Err(Failure::NotUniform { off, axis: d, at: NodePlace::new(node, x) });
            }
        }
    }
    Ok(())
}

/// The unknowns of a uniform mesh, with G ghost nodes around them
///
/// The unknowns are the nodes inside bounded axes, and all nodes of periodic ones. A stored row is padded at either end
/// by G columns, which hold nodes on and beyond a side, or periodic images. Rows beyond the ends are computed where
/// they are needed.
struct Grid<'a, const G: usize> {
    burgers: &'a Burgers,
    stencil: Stencil<G>,
    /// Unknowns along each axis.
    size: [usize; 2],
    periodic: [bool; 2],
    /// Nodes of the lattice along the second axis.
    stride: usize,
    /// Lattice indices of the first unknown.
    first: [usize; 2],
    lower: [f64; 2],
    spacing: [f64; 2],
    /// Length of a padded row.
    width: usize,
    /// Number of rows in a band.
    band: usize,
}

impl<'a, const G: usize> Grid<'a, G> {
    /// Rows of a stage that are stored at a time: the last stage reads the first one up to 3G rows behind its newest
    /// row.
    const KEPT: usize = 4 * G;

    fn new(burgers: &'a Burgers, mesh: &Mesh<2>) -> Result<Self, Failure> {
        let (lattice, extent) = (mesh.lattice(), mesh.extent());
        let (cells, periodic) = (lattice.cells(), lattice.periodic());
        if let (Some(axis), None) = (periodic.iter().position(|p| !p), burgers.side_value(0.0, mesh.lower())) {
            return Err(Failure::NotPeriodic { what: "initial values without side values", axis });
        }
        let spacing = [0, 1].map(|d| extent[d] / cells[d] as f64);
        let size = [0, 1].map(|d| if periodic[d] { cells[d] } else { cells[d] - 1 });
        let bands = size[0].div_ceil(BAND * G);
        Ok(Self {
            burgers,
            stencil: Stencil::new(burgers.viscosity, spacing),
            size,
            periodic,
            stride: lattice.nodes()[1],
            first: periodic.map(|p| usize::from(!p)),
            lower: mesh.lower(),
            spacing,
            width: size[1] + 2 * G,
            band: size[0].div_ceil(bands),
        })
    }

    /// Number of rows stored. Some at the end are unused, so that every band has the same number.
    fn rows(&self) -> usize {
        self.size[0].div_ceil(self.band) * self.band
    }

    fn scratch(&self) -> Vec<f64> {
        vec![0.0; self.rows() / self.band * 3 * Self::KEPT * self.width]
    }

    fn gather(&self, t: f64, nodes: &[f64]) -> Vec<f64> {
        let mut rows = vec![0.0; self.rows() * self.width];
        for (i, row) in rows.chunks_exact_mut(self.width).take(self.size[0]).enumerate() {
            let from = (i + self.first[0]) * self.stride + self.first[1];
            row[G..][..self.size[1]].copy_from_slice(&nodes[from..][..self.size[1]]);
            self.fill_ends(t, i as isize, row);
        }
        rows
    }

    fn scatter(&self, t: f64, rows: &[f64], nodes: &mut [f64]) {
        let [m, n] = self.size;
        for (i, row) in rows.chunks_exact(self.width).take(m).enumerate() {
            let to = (i + self.first[0]) * self.stride;
            nodes[to + self.first[1]..][..n].copy_from_slice(&row[G..][..n]);
            if !self.periodic[1] {
                [nodes[to], nodes[to + n + 1]] = [-1, n as isize].map(|j| self.given(t, [i as isize, j]));
            }
        }
        if !self.periodic[0] {
            for (row, i) in [(0, -1), (m + 1, m as isize)] {
                let columns = (0..self.stride).map(|j| j as isize - self.first[1] as isize);
                let to = &mut nodes[row * self.stride..][..self.stride];
                to.iter_mut().zip(columns).for_each(|(to, j)| *to = self.given(t, [i, j]));
            }
        }
    }

    /// u on or beyond a side, at a place counted from the first unknown.
    fn given(&self, t: f64, at: [isize; 2]) -> f64 {
        let x = [0, 1].map(|d| self.lower[d] + (at[d] + self.first[d] as isize) as f64 * self.spacing[d]);
        // NaN is never used: the caller asks only for places where u is known
        self.burgers.side_value(t, x).unwrap_or(f64::NAN)
    }

    /// Fills the ghosts of row i: from its unknowns on a periodic axis, else with side values.
    fn fill_ends(&self, t: f64, i: isize, row: &mut [f64]) {
        let n = self.size[1];
        for k in 0..G {
            [row[k], row[G + n + k]] = match self.periodic[1] {
                true => [row[n + k], row[G + k]],
                false => [k as isize - G as isize, (n + k) as isize].map(|j| self.given(t, [i, j])),
            };
        }
    }

    /// Fills a whole row beyond an end with side values.
    fn fill_row(&self, t: f64, i: isize, row: &mut [f64]) {
        row.iter_mut().enumerate().for_each(|(k, u)| *u = self.given(t, [i, k as isize - G as isize]));
    }
}
