//! Poisson's equation on any structured mesh.

use super::{NEAR_DEGENERATE, Stencils};
use crate::error::{Failure, NodePlace};
use crate::geometry::{Lattice, Mesh, check_length, node_areas};
use crate::numerics::lanes::{Lanes, Qr};
use crate::numerics::linear::{BlockMatrix, LinearSolver, RobustTransport, SparseSystem};
use crate::numerics::{larger, sum};
use crate::work::Work;

/// Tolerance of the iteration: the largest residual, with each row divided by its diagonal, as a share of the largest
/// given value.
const ITERATED: f64 = 1e-13;
/// Condition number above which the one-sided derivative at a side counts as lost to rounding.
const DEGENERATE: f64 = 1e7;

/// Poisson's equation with given values or fluxes on the sides of a mesh
///
/// ```text
/// ∇·(D ∇u) = f inside,   u = g   or   D n·∇u = g + c u on the sides,   n outward
/// ```
///
/// All arrays have one value a node in lattice order. Inside, D is that of the stencils, which are those of Δu or of
/// [`diffusion`](super::diffusion).
///
/// Where u is given nowhere and c is 0, what flows in must be the integral of f, and u is known up to a constant. What
/// the discrete system lacks to that is spread evenly over f, and the constant follows from `mean`.
///
/// # Example
/// ```
/// use driftmesh::geometry::{Lattice, Mesh};
/// use driftmesh::laplacian::{Laplacian, Poisson, stencils};
/// let mesh = Mesh::uniform(Lattice::bounded([4, 4])?, [0.0, 0.0], [1.0, 2.0])?;
/// let exact: Vec<f64> = mesh.x().iter().map(|[x, y]| x * x + x * y).collect();
/// let problem = Poisson { source: &[2.0; 25], side: &exact, ..Poisson::default() };
/// let u = problem.solve(&mesh, &stencils(&mesh, Laplacian::Optimised)?)?;
/// assert!(u.iter().zip(&exact).all(|(u, e)| (u - e).abs() < 1e-13));
/// # Ok::<(), driftmesh::Error>(())
/// ```
#[derive(Debug, Clone, Copy, Default)]
pub struct Poisson<'a> {
    /// f, at every node.
    pub source: &'a [f64],
    /// g, at every node of the sides: a value, or on Neumann sides the flux, which with D = 1 is the normal derivative.
    pub side: &'a [f64],
    /// c, at every node of Neumann sides; 0 where the array is empty.
    pub robin: &'a [f64],
    /// D, at every node of Neumann sides; 1 where the array is empty.
    pub diffusivity: &'a [f64],
    /// The mean of u over the domain, where nothing else determines it.
    pub mean: f64,
    /// Which sides are Neumann sides: the lower and the upper one across each axis. A corner with a side of the other
    /// kind belongs to that.
    pub neumann: [[bool; 2]; 2],
}

/// An entry of the matrices of A u = B f + g over the nodes of a mesh, in lattice order.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Entry {
    /// The node whose equation it is.
    pub row: usize,
    /// The node whose u and f it multiplies.
    pub column: usize,
    /// Of A.
    pub on_u: f64,
    /// Of B.
    pub on_source: f64,
}

impl Poisson<'_> {
    /// The solution at every node, by a sparse direct solver.
    ///
    /// # Errors
    /// [`Failure::WrongLength`] where an array does not fit the mesh; [`Failure::LinearStalled`] where the system is
    /// singular.
    pub fn solve(&self, mesh: &Mesh<2>, stencils: &Stencils) -> Result<Vec<f64>, Failure> {
        let lattice = mesh.lattice();
        let expected = self.check(lattice)?;
        let known = |index: usize| lattice.on_side(index) && self.neumann_side(lattice, index).is_none();
        let mut place = vec![usize::MAX; expected];
        let unknown: Vec<usize> = (0..expected).filter(|&index| !known(index)).collect();
        unknown.iter().enumerate().for_each(|(k, &index)| place[index] = k);

        // with a constant free: the first node is 0 until the mean is known, and what f lacks is unknown in its place
        let free = self.is_free(lattice);
        let mut system = SparseSystem::new(unknown.len());
        let mut b = vec![0.0; unknown.len()];
        for Entry { row, column, on_u, on_source } in self.entries(mesh, stencils)? {
            let row = place[row];
            match place[column] {
                _ if row == usize::MAX => continue,
                usize::MAX => b[row] -= on_u * self.side[column],
                0 if free => {}
                column => system.add(row, column, on_u),
            }
            b[row] += on_source * self.source[column];
        }
        for &index in unknown.iter().filter(|&&index| lattice.on_side(index)) {
            b[place[index]] += self.side[index];
        }
        if free {
            (0..stencils.patch().len()).for_each(|k| system.add(place[stencils.index(k)], 0, 1.0));
        }
        let solution = system.solve(&b)?;
        let mut u = self.side.to_vec();
        unknown.iter().zip(solution).for_each(|(&index, value)| u[index] = value);
        if free {
            u[unknown[0]] = 0.0;
            let areas = node_areas(mesh);
            let mean = sum(areas.iter().zip(&u).map(|(area, u)| area * u)) / sum(areas.iter().copied());
            u.iter_mut().for_each(|u| *u += self.mean - mean);
        }
        Ok(u)
    }

    /// The equations of all nodes, A u = B f + g, g being [`side`](Self::side) on the sides and 0 inside: entries of A
    /// and B in order of the rows, those of nodes inside first
    ///
    /// ```text
    /// Σ_j a_j u_j = Σ_j b_j f_j inside,   u = g   or   D n·∇u − c u = g on the sides
    /// ```
    ///
    /// n·∇u at a node of a side comes from the 3 × 3 nodes next to it and is exact for quadratics.
    ///
    /// # Errors
    /// [`Failure::WrongLength`] where `robin` or `diffusivity` does not fit the mesh; [`Failure::DegenerateStencil`]
    /// where the nodes next to a side determine no derivative there.
    ///
    /// # Example
    /// ```
    /// use driftmesh::geometry::{Lattice, Mesh};
    /// use driftmesh::laplacian::{Laplacian, Poisson, stencils};
    /// let mesh = Mesh::uniform(Lattice::bounded([4, 4])?, [0.0, 0.0], [1.0, 1.0])?;
    /// let entries = Poisson::default().entries(&mesh, &stencils(&mesh, Laplacian::Mapped)?)?;
    /// // nine for each node inside, one for each on a side, where u is given
    /// assert_eq!(entries.len(), 9 * 9 + 16);
    /// # Ok::<(), driftmesh::Error>(())
    /// ```
    pub fn entries(&self, mesh: &Mesh<2>, stencils: &Stencils) -> Result<Vec<Entry>, Failure> {
        let lattice = mesh.lattice();
        self.check_sides(lattice)?;
        let mut entries = Vec::with_capacity(9 * lattice.len());
        for k in 0..stencils.patch().len() {
            let row = stencils.index(k);
            let points = stencils.points(k).into_iter();
            entries.extend(points.map(|(column, on_u, on_source)| Entry { row, column, on_u, on_source }));
        }
        for row in (0..lattice.len()).filter(|&index| lattice.on_side(index)) {
            let entry = |column, on_u| Entry { row, column, on_u, on_source: 0.0 };
            let Some(side) = self.neumann_side(lattice, row) else {
                entries.push(entry(row, 1.0));
                continue;
            };
            let [d, c] = [(self.diffusivity, 1.0), (self.robin, 0.0)]
                .map(|(values, none)| values.get(row).copied().unwrap_or(none));
            let slope = derivative(mesh, row, side, outward(mesh, row, side))?;
            entries.extend(slope.map(|(column, a)| entry(column, d * a)));
            entries.push(entry(row, -c));
        }
        Ok(entries)
    }

    /// Whether u is known up to a constant only: it is given nowhere, and no flux depends on it.
    pub fn is_free(&self, lattice: &Lattice<2>) -> bool {
        let determines = |&index: &usize| {
            let given = self.neumann_side(lattice, index).is_none();
            given || self.robin.get(index).is_some_and(|c| *c != 0.0)
        };
        !lattice.sides().any(|index| determines(&index))
    }

    /// Refuses arrays that do not fit the lattice; returns its number of nodes.
    fn check(&self, lattice: &Lattice<2>) -> Result<usize, Failure> {
        check_length(lattice, "the source", self.source.len())?;
        check_length(lattice, "the side data", self.side.len())?;
        self.check_sides(lattice)?;
        Ok(lattice.len())
    }

    fn check_sides(&self, lattice: &Lattice<2>) -> Result<(), Failure> {
        for (what, values) in [("the diffusivity", self.diffusivity), ("what fluxes take of u", self.robin)] {
            if !values.is_empty() {
                check_length(lattice, what, values.len())?;
            }
        }
        Ok(())
    }

    /// The solution by an iterative solver, for nine-point stencils on a mesh with given values on all sides. It takes
    /// less memory than the direct solver and is faster on fine meshes. The work counts iterations, and the systems
    /// that needed the direct solver after all.
    ///
    /// # Errors
    /// As [`Poisson::solve`]; [`Failure::WrongLength`] also for stencils of 25 points and for Neumann sides, which it
    /// cannot solve.
    pub fn iterate(&self, mesh: &Mesh<2>, stencils: &Stencils) -> Result<(Vec<f64>, Work), Failure> {
        let lattice = mesh.lattice();
        let expected = self.check(lattice)?;
        let patch = *stencils.patch();
        let nine = match stencils.nine_points() {
            Some(nine) if self.neumann == [[false; 2]; 2] && patch.padded_len() == expected => nine,
            _ => return Err(Failure::WrongLength { what: "a nine-point system with given sides", found: 0, expected }),
        };
        let mut matrix = BlockMatrix::<2, 9, 1>::zero_blocks(patch);
        let mut b = vec![[0.0]; patch.len()];
        for (k, row) in nine.iter().enumerate() {
            matrix.rows[k] = row.map(|a| [[a / row[0]]]);
            b[k] = [self.source[stencils.index(k)] / row[0]];
        }
        // on bounded axes a padded vector has the layout of the lattice
        let mut x: Vec<[f64; 1]> = self.side.iter().map(|&u| [u]).collect();
        patch.places().for_each(|k| x[k] = [0.0]);
        let size = b.as_flattened().iter().chain(self.side).copied().fold(f64::MIN_POSITIVE, larger);
        let work = RobustTransport::<1>::default().solve(&matrix, &b, &mut x, [ITERATED * size])?;
        Ok((x.into_flattened(), work))
    }

    /// The Neumann side on which a node stands, as (axis, upper); none for a node that also stands on a side with given
    /// values.
    pub fn neumann_side(&self, lattice: &Lattice<2>, index: usize) -> Option<(usize, bool)> {
        let beyond = lattice.beyond(index);
        let on = |kind: bool| {
            (0..2)
                .flat_map(|d| [(d, false), (d, true)])
                .find(move |&(d, upper)| beyond[d][usize::from(upper)] && self.neumann[d][usize::from(upper)] == kind)
        };
        if on(false).is_some() { None } else { on(true) }
    }
}

/// The outward normal at a node of a side, from the nodes beside it along the side.
pub fn outward(mesh: &Mesh<2>, index: usize, (axis, upper): (usize, bool)) -> [f64; 2] {
    let (lattice, x) = (mesh.lattice(), mesh.x());
    let (node, nodes, along) = (lattice.node(index), lattice.nodes(), 1 - axis);
    let at = |k: usize| {
        let mut node = node;
        node[along] = k;
        x[lattice.index(node)]
    };
    let (i, n) = (node[along], nodes[along]);
    let (before, after) = match lattice.periodic()[along] {
        true => (at((i + n - 1) % n), at((i + 1) % n)),
        false => (at(i.max(1) - 1), at((i + 1).min(n - 1))),
    };
    // at the seam of a periodic axis one of them is the image of a node at the other end
    let turns = f64::from(u8::from(lattice.periodic()[along] && (i == 0 || i + 1 == n)));
    let t: [f64; 2] = std::array::from_fn(|c| after[c] - before[c] + turns * mesh.jump()[along][c]);
    // rotating the tangent by a right angle points outward on the upper side of axis 0 and on the lower one of axis 1,
    // unless the mesh is mirrored
    let sign = if (axis == 0) == upper { 1.0 } else { -1.0 };
    let size = t[0].hypot(t[1]);
    [sign * t[1] / size, -sign * t[0] / size]
}

/// n·∇u at a node of a side from the 3 × 3 nodes next to it, exact for quadratics: (lattice index, weight)
///
/// Among the rows that are exact it takes the one with the smallest Σ(|ξ_j|³ a_j)², where ξ = J⁻¹(x − x₀) and J is a
/// local length. Where the cells are so flat that such a row is lost to rounding, the columns of J are instead half the
/// way across the nodes along each axis, so that distances are measured in cells. A quadratic in x is one in ξ, and
/// n·∇ₓ = (J⁻¹n)·∇_ξ.
///
/// The node itself may then have next to no weight, which would leave its value undetermined. If its weight is less
/// than half of that in the one-sided difference inward, (d₁ + d₂)/(d₁ d₂) with distances d from the side, it is given
/// the latter, except in flat cells.
fn derivative(
    mesh: &Mesh<2>,
    index: usize,
    (axis, upper): (usize, bool),
    n: [f64; 2],
) -> Result<[(usize, f64); 9], Failure> {
    let (lattice, x) = (mesh.lattice(), mesh.x());
    let (node, nodes, wraps) = (lattice.node(index), lattice.nodes(), lattice.periodic());
    // the three nodes along each axis
    let around: [[usize; 3]; 2] = std::array::from_fn(|d| match wraps[d] {
        true => [nodes[d] - 1, 0, 1].map(|k| (node[d] + k) % nodes[d]),
        false => [0, 1, 2].map(|k| (node[d].max(1) - 1).min(nodes[d] - 3) + k),
    });
    // from the node to one of these, which at the seam of a periodic axis is an image
    let jump = mesh.jump();
    let turns = |d: usize, k: usize| match wraps[d] {
        true if node[d] + k == 0 => -1.0,
        true if node[d] + k > nodes[d] => 1.0,
        _ => 0.0,
    };
    let away_to = |k: [usize; 2]| -> [f64; 2] {
        let p = lattice.index([around[0][k[0]], around[1][k[1]]]);
        std::array::from_fn(|c| {
            let turned = turns(0, k[0]) * jump[0][c] + turns(1, k[1]) * jump[1][c];
            x[p][c] - x[index][c] + turned
        })
    };
    let (mut points, mut away) = ([index; 9], [[0.0; 2]; 9]);
    let all = (0..9).map(|p| [p / 3, p % 3]).map(|k| (lattice.index([around[0][k[0]], around[1][k[1]]]), away_to(k)));
    let all = all.filter(|(p, _)| *p != index);
    points[1..].iter_mut().zip(&mut away[1..]).zip(all).for_each(|((point, way), to)| (*point, *way) = to);
    let h = away.iter().flatten().fold(0.0_f64, |h, d| h.max(d.abs()));
    let cell: [[f64; 2]; 2] = std::array::from_fn(|d| {
        let [from, to] = [0, 2].map(|k| {
            let mut end = node;
            end[d] = around[d][k];
            let x = x[lattice.index(end)];
            [0, 1].map(|c| x[c] + turns(d, k) * jump[d][c])
        });
        [0, 1].map(|c| 0.5 * (to[c] - from[c]))
    });
    let inward: [f64; 2] = std::array::from_fn(|k| {
        let mut next = node;
        next[axis] = if upper { nodes[axis] - 2 - k } else { 1 + k };
        let [dx, dy] = [0, 1].map(|c| x[lattice.index(next)][c] - x[index][c]);
        -(n[0] * dx + n[1] * dy)
    });
    let own = (inward[0] + inward[1]) / (inward[0] * inward[1]);
    let mut condition = f64::NAN;
    for [a, b] in [[[h, 0.0], [0.0, h]], cell] {
        let det = a[0] * b[1] - b[0] * a[1];
        let local = |v: [f64; 2]| [(v[0] * b[1] - b[0] * v[1]) / det, (a[0] * v[1] - v[0] * a[1]) / det];
        let places: [[f64; 2]; 8] = std::array::from_fn(|j| local(away[j + 1]));
        let [nx, ny] = local(n);
        let free = shortest(&places, [nx, ny, 0.0, 0.0, 0.0]);
        let weak = -free.0.iter().sum::<f64>() < 0.5 * own;
        let pinned = weak.then(|| shortest(&places, [nx, ny, 0.0, 0.0, 0.0, -own]));
        let (weights, found) = pinned.filter(|pinned| pinned.1 < NEAR_DEGENERATE).unwrap_or(free);
        condition = found;
        if condition < DEGENERATE && weights.iter().all(|a| a.is_finite()) {
            let mut row = points.map(|p| (p, 0.0));
            for (j, a) in weights.into_iter().enumerate() {
                row[j + 1].1 = a;
                row[0].1 -= a;
            }
            return Ok(row);
        }
    }
    Err(Failure::DegenerateStencil { at: NodePlace::new(node, x[index]), condition })
}

/// The weights a with the smallest Σ(|ξ_j|³ a_j)² among those with given values Σ a_j p_k(ξ_j), for p = x, y, xy, x² −
/// y², x² and 1, and their condition number.
fn shortest<const N: usize>(places: &[[f64; 2]; 8], wanted: [f64; N]) -> ([f64; 8], f64) {
    let share = places.map(|[x, y]| x.hypot(y).powi(-3));
    let mut columns = [[Lanes::ZERO; 8]; N];
    for (j, [x, y]) in places.iter().enumerate() {
        for (column, p) in columns.iter_mut().zip([*x, *y, x * y, x * x - y * y, x * x, 1.0]) {
            column[j] = Lanes::splat(p * share[j]);
        }
    }
    let qr = Qr::new(columns);
    let a = qr.shortest(&wanted.map(Lanes::splat));
    (std::array::from_fn(|j| a[j].0[0] * share[j]), qr.condition().0[0])
}
