//! ∇·(D ∇u) in place of Δu, with a D that varies from place to place or jumps.

use super::{Laplacian, Stencils, node};
use crate::error::{Error, Failure, NodePlace, Result};
use crate::geometry::{Mesh, padded};
use crate::parallel;

/// Places along an edge at which D is looked at. Their number is even, so that a jump in the middle of an edge, at the
/// face between two nodes, is between two of them.
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
    let (lattice, patch) = (mesh.lattice(), stencils.patch());
    let Some(nine) = stencils.nine_points() else {
        let rule = "has 25 points, which take no diffusivity; take \"mapped\" or another kind of nine points";
        return Err(Error::invalid("laplacian.kind", "\"compact25\"", rule));
    };
    let everything = padded(lattice, mesh.x(), mesh.jump());
    let width = lattice.nodes()[1] + 2;
    let skip = patch.wraps.map(|wraps| usize::from(!wraps));
    let n = patch.size[1];
    let conservative = stencils.laplacian() == Laplacian::Mapped;
    let mut rows = nine.to_vec();
    parallel::for_each_row(&mut rows, n, |i, rows| {
        for (j, row) in rows.iter_mut().enumerate() {
            let at = |p: usize, q: usize| everything[(i + skip[0] + p) * width + skip[1] + q + j];
            let own = at(1, 1);
            let e = NEIGHBOURS.map(|[p, q]| [at(p, q)[0] - own[0], at(p, q)[1] - own[1]]);
            let along = |k: usize| resistance(own, e[k - 1], &d);
            if conservative {
                *row = faces(&e, along);
            } else {
                (1..9).for_each(|k| row[k] *= along(k));
                row[0] = -row[1..].iter().sum::<f64>();
            }
        }
    });
    match rows.iter().position(|row| !row.iter().all(|a| a.is_finite())) {
        None => Ok(stencils.with_rows(rows)),
        Some(k) => Err(not_positive(mesh, stencils, k, &d).into()),
    }
}

/// The inverse of the mean of 1/D along an edge; NaN where D is not above 0.
fn resistance(from: [f64; 2], e: [f64; 2], d: impl Fn([f64; 2]) -> f64) -> f64 {
    let sample = |k: usize| {
        let share = (k as f64 + 0.5) / SAMPLES as f64;
        let found = d([from[0] + share * e[0], from[1] + share * e[1]]);
        if found > 0.0 && found.is_finite() { 1.0 / found } else { f64::NAN }
    };
    SAMPLES as f64 / (0..SAMPLES).map(sample).sum::<f64>()
}

/// The first value of D around a node that is not above 0.
fn not_positive(mesh: &Mesh<2>, stencils: &Stencils, k: usize, d: impl Fn([f64; 2]) -> f64) -> Failure {
    let (node, own) = (node(stencils.patch(), k), mesh.x()[stencils.index(k)]);
    for (index, ..) in stencils.points(k) {
        let x = mesh.x()[index];
        for share in (0..=2 * SAMPLES).map(|s| s as f64 / (2 * SAMPLES) as f64) {
            let place = [0, 1].map(|c| own[c] + share * (x[c] - own[c]));
            let value = d(place);
            if !(value > 0.0 && value.is_finite()) {
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
