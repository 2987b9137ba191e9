//! ∇·(D ∇u) in place of Δu, with a D that varies from place to place or jumps.

use super::{Laplacian, Stencils, node};
use crate::error::{Error, Failure, NodePlace, Result};
use crate::geometry::{Mesh, padded};
use crate::parallel;

/// Number of places along an edge at which D is evaluated. Their number is even, so that a jump in the middle of an
/// edge, at the face between two nodes, is between two of them.
const SAMPLES: usize = 8;

/// Places of the eight neighbours of a node, in the order of [`LatticeMatrix::POINTS`] behind the node itself.
///
/// [`LatticeMatrix::POINTS`]: crate::numerics::linear::LatticeMatrix::POINTS
const NEIGHBOURS: [[usize; 2]; 8] = [[0, 1], [2, 1], [1, 0], [1, 2], [0, 0], [0, 2], [2, 0], [2, 2]];
// their indices in a row
const WEST: usize = 1;
const EAST: usize = 2;
const SOUTH: usize = 3;
const NORTH: usize = 4;
const SW: usize = 5;
const NW: usize = 6;
const SE: usize = 7;
const NE: usize = 8;

/// ∇·(D ∇u) by the nine-point stencils of Δu
///
/// ```text
/// Σ_j a_j D_j (u_j − u₀),   1/D_j = the mean of 1/D along the edge to x_j
/// ```
///
/// Since Σ a_j d_j d_jᵀ is twice the unit matrix, D_j ≈ D + ∇D·d_j/2 makes D Δu + ∇D·∇u of it. With
/// [`Laplacian::Mapped`] the edge is that of a face, and all that flows through the face has its D_j, which is
/// conservative: of second order on smooth meshes, also where D jumps along lines of the mesh. The other kinds have
/// weights on the diagonals, and are of the first order at such jumps.
///
/// # Errors
/// [`Failure::NotPositive`] where D is not above 0; [`Error::Invalid`] for the 25 points of [`Laplacian::Compact25`].
///
/// # Example
/// ```
/// use driftmesh::geometry::{Lattice, Mesh};
/// use driftmesh::laplacian::{Laplacian, diffusion, stencils};
/// let mesh = Mesh::uniform(Lattice::bounded([4, 4])?, [0.0, 0.0], [1.0, 1.0])?;
/// let a = diffusion(&mesh, &stencils(&mesh, Laplacian::Mapped)?, |[x, _]| if x < 0.375 { 1.0 } else { 3.0 })?;
/// // the flux 3 goes through a wall of both, so the slope is 3 and then 1
/// let u: Vec<f64> = mesh.x().iter().map(|[x, _]| if *x < 0.375 { 3.0 * x } else { 0.75 + x }).collect();
/// assert!(a.apply(&u)?.iter().all(|v| v.abs() < 1e-12));
/// # Ok::<(), driftmesh::Error>(())
/// ```
pub fn diffusion(mesh: &Mesh<2>, stencils: &Stencils, d: impl Fn([f64; 2]) -> f64 + Sync) -> Result<Stencils> {
    weighted(mesh, stencils, |_, own, e| harmonic(|s| d(sample(own, e, s))))?
        .map_err(|k| not_positive(mesh, stencils, k, &d).into())
}

/// The places at which [`diffusion`] looks at D: for each row of the stencils, for each of its eight neighbours in the
/// order of [`LatticeMatrix::POINTS`](crate::numerics::linear::LatticeMatrix::POINTS), eight along the edge to it.
///
/// # Errors
/// [`Error::Invalid`] for the 25 points of [`Laplacian::Compact25`].
pub fn edge_places(mesh: &Mesh<2>, stencils: &Stencils) -> Result<Vec<[f64; 2]>> {
    nine_points(stencils)?;
    let (ring, n) = (Ring::of(mesh, stencils), stencils.patch().size[1]);
    let edges = (0..stencils.patch().len()).flat_map(|k| {
        let (own, around) = ring.around(k / n, k % n);
        around.into_iter().map(move |e| (own, e))
    });
    Ok(edges.flat_map(|(own, e)| (0..SAMPLES).map(move |s| sample(own, e, s))).collect())
}

/// [`diffusion`] by the values of D at the [`edge_places`], for a D that only one thread can evaluate.
///
/// # Errors
/// [`Failure::WrongLength`] where there is not one value a place; else as [`diffusion`].
///
/// # Example
/// ```
/// use driftmesh::geometry::{Lattice, Mesh};
/// use driftmesh::laplacian::{Laplacian, diffusion, diffusion_by, edge_places, stencils};
/// let mesh = Mesh::uniform(Lattice::bounded([4, 4])?, [0.0, 0.0], [1.0, 1.0])?;
/// let laplacian = stencils(&mesh, Laplacian::Mapped)?;
/// let d: Vec<f64> = edge_places(&mesh, &laplacian)?.iter().map(|[x, y]| 1.0 + x * y).collect();
/// let by_values = diffusion_by(&mesh, &laplacian, &d)?;
/// assert_eq!(by_values.nine_points(), diffusion(&mesh, &laplacian, |[x, y]| 1.0 + x * y)?.nine_points());
/// # Ok::<(), driftmesh::Error>(())
/// ```
pub fn diffusion_by(mesh: &Mesh<2>, stencils: &Stencils, d: &[f64]) -> Result<Stencils> {
    let expected = stencils.patch().len() * NEIGHBOURS.len() * SAMPLES;
    if d.len() != expected {
        return Err(Failure::WrongLength { what: "the diffusivity along the edges", found: d.len(), expected }.into());
    }
    let (edges, _) = d.as_chunks::<SAMPLES>();
    let at = |row: usize, edge: usize| &edges[row * NEIGHBOURS.len() + edge];
    weighted(mesh, stencils, |[row, edge], _, _| harmonic(|s| at(row, edge)[s]))?.map_err(|k| {
        let (n, node) = (stencils.patch().size[1], node(stencils.patch(), k));
        let (own, around) = Ring::of(mesh, stencils).around(k / n, k % n);
        let all = (0..NEIGHBOURS.len()).flat_map(|edge| (0..SAMPLES).map(move |s| (edge, s)));
        let bad = |&(edge, s): &(usize, usize)| !is_positive(at(k, edge)[s]);
        let (place, value) =
            all.clone().find(bad).map_or((own, f64::NAN), |(edge, s)| (sample(own, around[edge], s), at(k, edge)[s]));
        Failure::NotPositive { what: "the diffusivity", value, at: NodePlace::new(node, place) }.into()
    })
}

fn nine_points(stencils: &Stencils) -> Result<&[[f64; 9]]> {
    let rule = "has 25 points, which take no diffusivity; take \"mapped\" or another kind of nine points";
    stencils.nine_points().ok_or_else(|| Error::invalid("laplacian.kind", "\"compact25\"", rule))
}

/// The stencils with the inverse of the mean of 1/D along each edge, a function of row and edge, of the node and of the
/// way to its neighbour; else the first row that is not finite.
fn weighted(
    mesh: &Mesh<2>,
    stencils: &Stencils,
    along: impl Fn([usize; 2], [f64; 2], [f64; 2]) -> f64 + Sync,
) -> Result<std::result::Result<Stencils, usize>> {
    let n = stencils.patch().size[1];
    let conservative = stencils.laplacian() == Laplacian::Mapped;
    let mut rows = nine_points(stencils)?.to_vec();
    let ring = Ring::of(mesh, stencils);
    parallel::for_each_row(&mut rows, n, |i, rows| {
        for (j, row) in rows.iter_mut().enumerate() {
            let (own, e) = ring.around(i, j);
            let along = |k: usize| along([i * n + j, k - 1], own, e[k - 1]);
            if conservative {
                *row = faces(&e, along);
            } else {
                (1..9).for_each(|k| row[k] *= along(k));
                row[0] = -row[1..].iter().sum::<f64>();
            }
        }
    });
    Ok(match rows.iter().position(|row| !row.iter().all(|a| a.is_finite())) {
        None => Ok(stencils.with_rows(rows)),
        Some(k) => Err(k),
    })
}

/// Positions of the nodes, with images beyond the ends of closed axes.
struct Ring {
    x: Vec<[f64; 2]>,
    width: usize,
    skip: [usize; 2],
}

impl Ring {
    fn of(mesh: &Mesh<2>, stencils: &Stencils) -> Self {
        let lattice = mesh.lattice();
        let skip = stencils.patch().wraps.map(|wraps| usize::from(!wraps));
        Self { x: padded(lattice, mesh.x(), mesh.jump()), width: lattice.nodes()[1] + 2, skip }
    }

    /// The node of the patch with these indices, and the ways to its neighbours.
    fn around(&self, i: usize, j: usize) -> ([f64; 2], [[f64; 2]; 8]) {
        let at = |p: usize, q: usize| self.x[(i + self.skip[0] + p) * self.width + self.skip[1] + q + j];
        let own = at(1, 1);
        (own, NEIGHBOURS.map(|[p, q]| [at(p, q)[0] - own[0], at(p, q)[1] - own[1]]))
    }
}

/// The s-th place along an edge at which D is looked at.
fn sample(from: [f64; 2], e: [f64; 2], s: usize) -> [f64; 2] {
    let share = (s as f64 + 0.5) / SAMPLES as f64;
    [from[0] + share * e[0], from[1] + share * e[1]]
}

/// The inverse of the mean of 1/D over the places along an edge; NaN where D is not above 0.
fn harmonic(d: impl Fn(usize) -> f64) -> f64 {
    let inverse = |s: usize| Some(d(s)).filter(|d| is_positive(*d)).map_or(f64::NAN, |d| 1.0 / d);
    SAMPLES as f64 / (0..SAMPLES).map(inverse).sum::<f64>()
}

fn is_positive(d: f64) -> bool {
    d > 0.0 && d.is_finite()
}

/// The first value of D around a node that is not above 0.
fn not_positive(mesh: &Mesh<2>, stencils: &Stencils, k: usize, d: impl Fn([f64; 2]) -> f64) -> Failure {
    let (node, own) = (node(stencils.patch(), k), mesh.x()[stencils.index(k)]);
    for (index, ..) in stencils.points(k) {
        let x = mesh.x()[index];
        for share in (0..=2 * SAMPLES).map(|s| s as f64 / (2 * SAMPLES) as f64) {
            let place = [0, 1].map(|c| own[c] + share * (x[c] - own[c]));
            let value = d(place);
            if !is_positive(value) {
                return Failure::NotPositive { what: "the diffusivity", value, at: NodePlace::new(node, place) };
            }
        }
    }
    Failure::NotPositive { what: "the diffusivity", value: f64::NAN, at: NodePlace::new(node, own) }
}

/// The conservative curvilinear form with its own D in each face, as [`Laplacian::Mapped`] with D = 1.
fn faces(e: &[[f64; 2]; 8], d: impl Fn(usize) -> f64) -> [f64; 9] {
    let at = |k: usize| if k == 0 { [0.0; 2] } else { e[k - 1] };
    let dot = |a: [f64; 2], b: [f64; 2]| a[0] * b[0] + a[1] * b[1];
    let cross = |a: [f64; 2], b: [f64; 2]| a[0] * b[1] - a[1] * b[0];
    let mut row = [0.0; 9];
    // a face between the node, 0, and a neighbour, with the nodes above and below both of its ends
    for (out, [up, up_out, down, down_out]) in [
        (EAST, [NORTH, NE, SOUTH, SE]),
        (WEST, [NORTH, NW, SOUTH, SW]),
        (NORTH, [EAST, NE, WEST, NW]),
        (SOUTH, [EAST, SE, WEST, SW]),
    ] {
        let [p, q, r, s] = [up, up_out, down, down_out].map(at);
        let along = [0, 1].map(|c| (p[c] + q[c] - r[c] - s[c]) * 0.25);
        let across = at(out);
        let share = d(out) / cross(across, along).abs();
        row[out] += dot(along, along) * share;
        row[0] -= dot(along, along) * share;
        let mixed = dot(across, along) * share * 0.25;
        for (k, sign) in [(up, -1.0), (up_out, -1.0), (down, 1.0), (down_out, 1.0)] {
            row[k] += mixed * sign;
        }
    }
    let [x_xi, x_eta] = [(EAST, WEST), (NORTH, SOUTH)].map(|(u, d)| [0, 1].map(|c| (at(u)[c] - at(d)[c]) * 0.5));
    let area = cross(x_xi, x_eta);
    row.map(|a| a / area)
}
