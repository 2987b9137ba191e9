use super::mmpde::cell_means;
use super::{Form, Mmpde};
use crate::error::{Failure, Result};
use crate::geometry::{Density, Lattice, Mesh, Patch, diagonal, strides};
use crate::numerics::larger;
use crate::numerics::linear::{LinearSolver, Robust};
use crate::work::Work;

/// Moves the nodes on the bounded sides of the box
///
/// Each side solves the mesh equation by itself, in as many dimensions as it has. Coordinates across the side are
/// fixed; those along it solve the equation with the ρ of the side, between the edges around it, which have been moved
/// before. Corners stay. `x` holds the old positions of all nodes, and receives the new ones on the sides.
///
/// # Errors
/// The failures of these solves.
pub fn move_sides<const D: usize>(
    equation: &Mmpde,
    mesh: &Mesh<D>,
    rho: &Density,
    dt: f64,
    x: &mut [[f64; D]],
    solver: &mut Robust<1>,
) -> Result<Work, Failure> {
    let sides = Sides::new(equation, mesh, rho, dt);
    let mut work = Work::default();
    for along in (0..D).rev() {
        work += sides.solve::<1, 3>([along], x, solver)?;
    }
    for across in (0..D).filter(|_| D == 3) {
        let along = if across == 0 { [1, 2] } else { [0, 3 - across] };
        work += sides.solve::<2, 5>(along, x, &mut Robust::default())?;
    }
    Ok(work)
}

/// All sides of a mesh in one step.
struct Sides<'a, const D: usize> {
    equation: &'a Mmpde,
    mesh: &'a Mesh<D>,
    rho: &'a Density,
    /// ρ in the mesh cells; in the conservative form only.
    cells: Option<Vec<Vec<f64>>>,
    dt: f64,
}

impl<'a, const D: usize> Sides<'a, D> {
    fn new(equation: &'a Mmpde, mesh: &'a Mesh<D>, rho: &'a Density, dt: f64) -> Self {
        let cells = match equation.form {
            Form::Gradient(_) => None,
            Form::Conservative => Some(cell_means(mesh.lattice(), rho)),
        };
        Self { equation, mesh, rho, cells, dt }
    }

    /// Moves the nodes of all sides that extend along some of the axes, with a star of S = 2E + 1 points. There are no
    /// such sides where an axis across them is periodic, or where all axes extend along them.
    fn solve<const E: usize, const S: usize>(
        &self,
        along: [usize; E],
        x: &mut [[f64; D]],
        solver: &mut impl LinearSolver<E, S, E>,
    ) -> Result<Work, Failure> {
        let across: Vec<usize> = (0..D).filter(|d| !along.contains(d)).collect();
        let mut work = Work::default();
        if across.is_empty() || across.iter().any(|&d| self.mesh.lattice().periodic()[d]) {
            return Ok(work);
        }
        for ends in 0..1_usize << across.len() {
            let upper = |d: usize| across.iter().position(|&a| a == d).is_some_and(|k| ends >> k & 1 == 1);
            work += self.solve_one(along, upper, x, solver)?;
        }
        Ok(work)
    }

    /// Moves the nodes of one side: at the upper or lower end of each axis across it.
    fn solve_one<const E: usize, const S: usize>(
        &self,
        along: [usize; E],
        upper: impl Fn(usize) -> bool,
        x: &mut [[f64; D]],
        solver: &mut impl LinearSolver<E, S, E>,
    ) -> Result<Work, Failure> {
        let (lattice, extent, size) = (self.mesh.lattice(), self.mesh.extent(), size(self.mesh));
        let (cells, periodic) = (lattice.cells(), lattice.periodic());
        let side = Lattice::<E>::new(along.map(|d| cells[d]), along.map(|d| periodic[d])).expect("axes of a lattice");
        let place =
            Places { along, origin: at_ends(lattice.strides(), cells, &along, &upper), strides: lattice.strides() };
        let operator = match &self.cells {
            None => {
                let rho = self.rho.largest();
                let rho: Density = (0..side.len()).map(|k| rho[place.of(side.node(k))]).collect();
                self.equation.operator(&side, &rho, self.dt)?
            }
            Some(rho) => {
                // the layer of cells beside the side
                let steps = strides(cells);
                let beside =
                    Places { along, origin: at_ends(steps, cells.map(|n| n - 1), &along, &upper), strides: steps };
                let size = side.cells();
                let node = |k: usize| std::array::from_fn(|e| k / strides(size)[e] % size[e]);
                let of = |part: &Vec<f64>| (0..size.iter().product()).map(|k| part[beside.of(node(k))]).collect();
                let rho: Vec<Vec<f64>> = match &rho[..] {
                    [one] => vec![of(one)],
                    each => along.iter().map(|&d| of(&each[d])).collect(),
                };
                self.equation.on_cells(&side, &rho, self.dt)
            }
        };
        let of = |x: &[f64; D]| along.map(|d| x[d]);
        let old: Vec<[f64; E]> = (0..side.len()).map(|k| of(&self.mesh.x()[place.of(side.node(k))])).collect();
        let new: Vec<[f64; E]> = (0..side.len()).map(|k| of(&x[place.of(side.node(k))])).collect();
        let jump = diagonal(along.map(|d| extent[d]));
        let patch = Patch::whole(&side);
        let (found, work) = operator.solve::<S, E>(patch, &old, &new, jump, solver, along.map(|d| size[d]))?;
        let mut moved = new;
        patch.scatter(&side, &found, &mut moved, jump);
        for (k, moved) in moved.iter().enumerate() {
            let node = place.of(side.node(k));
            along.iter().zip(moved).for_each(|(&d, value)| x[node][d] = *value);
        }
        Ok(work)
    }
}

/// Indices of the nodes, or cells, of a side in an array over the whole mesh.
struct Places<const D: usize, const E: usize> {
    along: [usize; E],
    origin: usize,
    strides: [usize; D],
}

impl<const D: usize, const E: usize> Places<D, E> {
    fn of(&self, node: [usize; E]) -> usize {
        self.origin + self.along.iter().zip(node).map(|(&d, i)| i * self.strides[d]).sum::<usize>()
    }
}

/// The first entry of a side, at `last` along those axes across it of which it is the upper end.
fn at_ends<const D: usize>(
    strides: [usize; D],
    last: [usize; D],
    along: &[usize],
    upper: impl Fn(usize) -> bool,
) -> usize {
    (0..D).filter(|&d| !along.contains(&d) && upper(d)).map(|d| last[d] * strides[d]).sum()
}

/// The largest coordinate along each axis, of the box or, where nodes have left it along a periodic axis, of a node:
/// what is computed with it is rounded to a share of it.
pub(super) fn size<const D: usize>(mesh: &Mesh<D>) -> [f64; D] {
    let of_box = std::array::from_fn(|d| mesh.lower()[d].abs().max(mesh.upper()[d].abs()));
    mesh.x().iter().fold(of_box, |size, x| std::array::from_fn(|d| larger(size[d], x[d])))
}
