use super::Relaxation;
use crate::error::{Failure, Result};
use crate::geometry::{Density, Lattice, Mesh, Patch, check_length, strides};
use crate::numerics::difference::Gradient;
use crate::numerics::larger;
use crate::numerics::linear::{LatticeMatrix, LinearSolver, Pcg};
use crate::work::Work;

/// The moving mesh equation, with ρ frozen over a time step
///
/// ```text
/// x_t = (1/τ) (b·∇_ξ x + ∇²_ξ x),   b = ∇_ξ ρ / ρ      or the same as      ρ x_t = (1/τ) ∇_ξ·(ρ ∇_ξ x),
/// ```
///
/// and the same for y. τ > 0 (`relaxation`) has the unit of time: it is how long the mesh takes to follow its density
/// across the domain.
///
/// The default is that of studies and of Python: the conservative form, with a τ that is chosen from how the mesh
/// moves. A generator used alone takes [`STEPS_TO_BEGIN_WITH`](super::STEPS_TO_BEGIN_WITH) time steps for it.
/// [`Mmpde::published`] is the form of the paper.
///
/// # Source
/// (2.4) of Bihlo, Haynes and Walsh (2015), MMPDE5 divided by ρ before it is relaxed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mmpde {
    /// The relaxation time τ.
    pub relaxation: Relaxation,
    /// The discretisation.
    pub form: Form,
}

/// How the mesh equation is discretised.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Form {
    /// b·∇x + ∇²x at the nodes, as published, with this difference scheme for b.
    Gradient(Gradient),
    /// Fluxes ρ∇x through the faces of dual cells
    ///
    /// ```text
    /// W_i (xⁿ⁺¹ − xⁿ)_i = Δt/(τh²) Σ_e ρ_e (x_e − x_i)ⁿ⁺¹
    /// ```
    ///
    /// ρ is averaged from the nodes to the mesh cells; ρ_e is the mean over the cells beside an edge of the density
    /// along its axis, W_i the mean over the cells around a node, the largest over the axes. Multiplied by W, the
    /// matrix is a symmetric M-matrix for any ρ, and the same for x and y.
    Conservative,
}

/// Tolerance of the gradient form and of solves on subdomains and sides, as a share of the largest coordinate: far
/// below any cell.
const EXACTNESS: f64 = 1e-12;

impl Default for Mmpde {
    fn default() -> Self {
        Self { relaxation: Relaxation::Auto, form: Form::Conservative }
    }
}

impl Mmpde {
    /// As published: the gradient form by central differences, τ = 1.
    pub fn published() -> Self {
        Self { relaxation: Relaxation::Time(1.0), form: Form::Gradient(Gradient::Central) }
    }

    /// Refuses settings out of range.
    ///
    /// # Errors
    /// As [`Relaxation::check`].
    pub fn check(&self) -> Result<()> {
        self.relaxation.check()
    }

    /// Δt/(τh²) along each axis.
    pub fn stiffness<const D: usize>(&self, lattice: &Lattice<D>, dt: f64) -> [f64; D] {
        lattice.spacing().map(|h| dt / (self.relaxation.over(dt) * h * h))
    }

    /// The implicit step over `dt` on a lattice with density `rho`, one value a node.
    ///
    /// # Errors
    /// [`Failure::WrongLength`] where ρ does not fit the lattice.
    pub fn operator<const D: usize>(
        &self,
        lattice: &Lattice<D>,
        rho: &Density,
        dt: f64,
    ) -> Result<MeshOperator<D>, Failure> {
        check_length(lattice, "the density", rho.largest().len())?;
        let Form::Gradient(gradient) = self.form else {
            return Ok(self.on_cells(lattice, &cell_means(lattice, rho), dt));
        };
        let (h, a) = (lattice.spacing(), self.stiffness(lattice, dt));
        let b = gradient.of_log(lattice, rho.largest());
        let weights = b
            .into_iter()
            .map(|b| {
                std::array::from_fn(|d| {
                    let skew = 0.5 * b[d] * h[d];
                    [a[d] * (1.0 - skew), a[d] * (1.0 + skew)]
                })
            })
            .collect();
        Ok(MeshOperator { lattice: *lattice, weights, volumes: None })
    }

    /// The conservative form from ρ in the mesh cells, one array for all axes or one for each. Nodes on sides, which
    /// have no row, have weights of zero.
    pub(super) fn on_cells<const D: usize>(
        &self,
        lattice: &Lattice<D>,
        parts: &[Vec<f64>],
        dt: f64,
    ) -> MeshOperator<D> {
        let a = self.stiffness(lattice, dt);
        let mut weights = vec![[[0.0; 2]; D]; lattice.len()];
        let mut volumes = vec![1.0; lattice.len()];
        let parts: Vec<Vec<f64>> = parts.iter().map(|cells| around_nodes(lattice, cells)).collect();
        let along: [&[f64]; D] = std::array::from_fn(|d| &parts[if parts.len() == 1 { 0 } else { d }][..]);
        // the cells around a node have its indices, or one less along some of the axes
        let below = strides(lattice.nodes().map(|n| n + 1));
        let patch = Patch::whole(lattice);
        for (k, place) in patch.nodes(lattice).zip(places(&patch, below)) {
            let mut sums = [[0.0; 2]; D];
            for corner in 0..1 << D {
                let cell = place + (0..D).map(|d| (corner >> d & 1) * below[d]).sum::<usize>();
                (0..D).for_each(|d| sums[d][corner >> d & 1] += along[d][cell]);
            }
            volumes[k] = sums.iter().map(|[below, above]| below + above).fold(0.0, f64::max) / (1 << D) as f64;
            let share = 1.0 / ((1 << (D - 1)) as f64 * volumes[k]);
            weights[k] = std::array::from_fn(|d| sums[d].map(|sum| a[d] * share * sum));
        }
        MeshOperator { lattice: *lattice, weights, volumes: Some(volumes) }
    }
}

/// Indices, in an array with these strides, of the cells below the nodes of a patch.
fn places<const D: usize>(patch: &Patch<D>, strides: [usize; D]) -> impl Iterator<Item = usize> {
    let (size, origin) = (patch.size, patch.origin);
    (0..patch.pencil_count()).flat_map(move |p| {
        let (mut rest, mut first) = (p, origin[D - 1] * strides[D - 1]);
        for d in (0..D - 1).rev() {
            first += (rest % size[d] + origin[d]) * strides[d];
            rest /= size[d];
        }
        first..first + size[D - 1]
    })
}

/// Cell values in an array with one cell more along each axis: entry i is the cell below node i, entry i + 1 the one
/// above. Below the first node of a bounded axis and above its last one the values are zero.
fn around_nodes<const D: usize>(lattice: &Lattice<D>, cells: &[f64]) -> Vec<f64> {
    let (n, size, periodic) = (lattice.cells(), lattice.nodes().map(|n| n + 1), lattice.periodic());
    let mut out = Vec::with_capacity(size.iter().product());
    let mut place = [0; D];
    for _ in 0..size.iter().product() {
        let cell = (0..D).try_fold(0, |sum, d| match (place[d], periodic[d]) {
            (0, true) => Some(sum * n[d] + n[d] - 1),
            (0, false) => None,
            (i, _) if i > n[d] => None,
            (i, _) => Some(sum * n[d] + i - 1),
        });
        out.push(cell.map_or(0.0, |cell| cells[cell]));
        for d in (0..D).rev() {
            place[d] += 1;
            if place[d] < size[d] {
                break;
            }
            place[d] = 0;
        }
    }
    out
}

/// Means of each array of a density over the mesh cells, in arrays with the last axis fastest.
pub(super) fn cell_means<const D: usize>(lattice: &Lattice<D>, rho: &Density) -> Vec<Vec<f64>> {
    rho.parts().iter().map(|part| means(lattice, part)).collect()
}

fn means<const D: usize>(lattice: &Lattice<D>, values: &[f64]) -> Vec<f64> {
    let (cells, closed) = (lattice.cells(), lattice.closed(values));
    let strides = strides(cells.map(|n| n + 1));
    let patch = Patch { origin: [0; D], size: cells, wraps: [false; D] };
    let corners: Vec<usize> = (0..1 << D).map(|corner| (0..D).map(|d| (corner >> d & 1) * strides[d]).sum()).collect();
    let mean = |place: usize| corners.iter().map(|corner| closed[place + corner]).sum::<f64>() / corners.len() as f64;
    places(&patch, strides).map(mean).collect()
}

/// One implicit Euler step of a mesh equation, as what each node draws from its neighbours
///
/// ```text
/// (1 + Σ_e w_e) x_i − Σ_e w_e x_e = xⁿ_i,   e the 2D neighbours of node i
/// ```
///
/// Rows sum to one. With all weights ≥ 0 a residual therefore bounds the error of the mesh in the maximum norm, and
/// w_e/(1 + Σ w) are the jump probabilities of a random walk on the lattice that stops with 1/(1 + Σ w). Every form of
/// the mesh equation is turned into this type, and every way to solve it starts from it.
#[derive(Debug, Clone)]
pub struct MeshOperator<const D: usize> {
    lattice: Lattice<D>,
    /// For each node and axis the weights of the neighbours below and above.
    weights: Vec<[[f64; 2]; D]>,
    /// W at each node, if the rows multiplied by W are symmetric.
    volumes: Option<Vec<f64>>,
}

impl<const D: usize> MeshOperator<D> {
    /// The lattice of the mesh.
    pub fn lattice(&self) -> &Lattice<D> {
        &self.lattice
    }

    /// For each node and axis the weights of the neighbours below and above.
    pub fn weights(&self) -> &[[[f64; 2]; D]] {
        &self.weights
    }

    /// The system on one patch, as a star of S = 2D + 1 points.
    pub fn matrix<const S: usize>(&self, patch: Patch<D>) -> LatticeMatrix<D, S> {
        let mut matrix = LatticeMatrix::zero(patch);
        for (row, node) in matrix.rows.iter_mut().zip(patch.nodes(&self.lattice)) {
            row[0] = 1.0;
            for (d, w) in self.weights[node].iter().enumerate() {
                row[0] += w[0] + w[1];
                row[1 + 2 * d] = -w[0];
                row[2 + 2 * d] = -w[1];
            }
        }
        matrix
    }

    /// Whether the rows are symmetric up to a factor, as in the conservative form.
    pub fn is_symmetric(&self) -> bool {
        self.volumes.is_some()
    }

    /// Solves a symmetric step on one patch by conjugate gradients, to an error of at most `closeness` in each
    /// position; otherwise as [`solve`](Self::solve).
    ///
    /// # Errors
    /// [`Failure::LinearStalled`] where the iteration fails, without an iteration where the operator is not symmetric.
    pub fn solve_symmetric<const S: usize, const K: usize>(
        &self,
        patch: Patch<D>,
        old: &[[f64; K]],
        new: &[[f64; K]],
        jump: [[f64; K]; D],
        solver: &mut Pcg<D, K>,
        closeness: f64,
    ) -> Result<(Vec<[f64; K]>, Work), Failure> {
        let Some(volumes) = self.volumes.as_ref() else {
            return Err(Failure::LinearStalled {
                unknowns: 0,
                residual: f64::NAN,
                tolerance: closeness,
                iterations: 0,
            });
        };
        let weights: Vec<f64> = patch.nodes(&self.lattice).map(|node| volumes[node]).collect();
        let mut matrix = self.matrix::<S>(patch);
        let mut right = self.right(patch, old, jump);
        for ((row, right), weight) in matrix.rows.iter_mut().zip(&mut right).zip(&weights) {
            row.iter_mut().chain(right).for_each(|entry| *entry *= weight);
        }
        let mut x = patch.gather(&self.lattice, new, jump);
        let linear_iterations = solver.solve(&matrix, &weights, &right, &mut x, [closeness; K])?;
        Ok((x, Work { linear_solves: K, linear_iterations, ..Work::default() }))
    }

    /// The first node off the sides that has a weight below zero (|b|h > 2) or NaN.
    pub(super) fn negative_weight(&self) -> Option<usize> {
        let negative = |k: &usize| !self.weights[*k].as_flattened().iter().all(|&w| w >= 0.0);
        Patch::whole(&self.lattice).nodes(&self.lattice).find(negative)
    }

    /// Refuses an operator whose weights cannot be probabilities: |b|h > 2 at a node that is not on a side.
    ///
    /// # Errors
    /// [`Failure::SteepDensity`] at the first such node.
    pub fn check_weights(&self, mesh: &Mesh<D>) -> Result<(), Failure> {
        match self.negative_weight() {
            None => Ok(()),
            Some(k) => {
                let skews = self.weights[k].map(|[below, above]| 2.0 * ((above - below) / (above + below)).abs());
                Err(Failure::SteepDensity { skew: skews.into_iter().fold(0.0, larger), at: mesh.node_place(k) })
            }
        }
    }

    /// Solves the step on one patch, given new values on the ring around it
    ///
    /// `old` and `new` are nodal values on the whole lattice. `new` holds the known values on the ring and a guess
    /// inside. The result is the padded vector of the patch. Its error is at most 1e-12 of `size`, the largest
    /// coordinate, or round-off where that is more because Δt/(τh²) is large. `jump[d]` is added on wrapping around
    /// axis d.
    ///
    /// # Errors
    /// [`Failure::LinearStalled`].
    pub fn solve<const S: usize, const K: usize>(
        &self,
        patch: Patch<D>,
        old: &[[f64; K]],
        new: &[[f64; K]],
        jump: [[f64; K]; D],
        solver: &mut impl LinearSolver<D, S, K>,
        size: [f64; K],
    ) -> Result<(Vec<[f64; K]>, Work), Failure> {
        let right = self.right(patch, old, jump);
        let mut x = patch.gather(&self.lattice, new, jump);
        let matrix = self.matrix(patch);
        let work = solver.solve(&matrix, &right, &mut x, exactness(&matrix, size))?;
        Ok((x, work))
    }

    /// The right-hand side on one patch: the old positions, continued across the ends of periodic axes.
    pub(super) fn right<const K: usize>(
        &self,
        patch: Patch<D>,
        old: &[[f64; K]],
        jump: [[f64; K]; D],
    ) -> Vec<[f64; K]> {
        let padded = patch.gather(&self.lattice, old, jump);
        let mut right = Vec::with_capacity(patch.len());
        patch.pencils().for_each(|start| right.extend_from_slice(&padded[start..start + patch.pencil_len()]));
        right
    }
}

/// The residual below which a mesh equation counts as solved.
pub(super) fn exactness<const D: usize, const S: usize, const K: usize>(
    matrix: &LatticeMatrix<D, S>,
    size: [f64; K],
) -> [f64; K] {
    let diagonal = matrix.rows.iter().fold(1.0_f64, |m, row| m.max(row[0]));
    size.map(|size| size * EXACTNESS.max(8.0 * f64::EPSILON * diagonal))
}
