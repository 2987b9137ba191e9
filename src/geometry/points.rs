//! Values of nodal fields at any points.

use super::determinant::{cofactors, determinant};
use super::{Cells, Lattice, Mesh};
use crate::parallel;

/// Where a point lies in a mesh: the lowest corner of its cell, and its ξ in the cell, from 0 to 1 along each axis
///
/// The cell is the image of the unit square by the map that is linear along each axis between its corners; of the unit
/// interval in one dimension.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place<const D: usize> {
    /// The lowest corner.
    pub cell: [usize; D],
    /// ξ in the cell.
    pub share: [f64; D],
}

/// How an [`Interpolator`] continues nodal values between the nodes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Degree {
    /// Linear along each axis of a cell: of second order, and within the range of the values at its corners.
    Linear,
    /// Cubic along each axis through four nodes, x and u alike: of fourth order where the map ξ → x is smooth. It may
    /// leave the range of the values.
    Cubic,
}

/// Interpolates nodal fields at points that are located once
///
/// ```text
/// u(x) = Σ_k N_k(ξ) u_k,   x = Σ_k N_k(ξ) x_k,   N_k = products of Lagrange's polynomials of a degree along each axis
/// ```
///
/// Functions linear in x are exact on any mesh, and polynomials of the degree in each coordinate on uniform meshes.
/// Beside bounded sides cubics take the four nodes next to the side. Where the cubic map has no ξ close to the one of
/// the linear map, as among cells of very different shapes, the point is interpolated linearly. In a domain with a
/// chart s takes the place of x: no point between a side and its chords is lost, and polynomials of s are exact.
///
/// # Example
/// ```
/// use driftmesh::geometry::{Degree, Interpolator, Lattice, Mesh};
/// let mesh = Mesh::uniform(Lattice::bounded([4, 4])?, [0.0, 0.0], [1.0, 1.0])?;
/// let u: Vec<f64> = mesh.x().iter().map(|[x, y]| x * y).collect();
/// let at = Interpolator::new(&mesh, &[[0.3, 0.6]], Degree::Linear).expect("a point inside");
/// assert!((at.values(&u)[0] - 0.18).abs() < 1e-15);
/// assert_eq!(Interpolator::new(&mesh, &[[0.3, 0.6], [1.1, 0.5]], Degree::Linear).err(), Some(1));
/// # Ok::<(), driftmesh::Error>(())
/// ```
pub struct Interpolator<const D: usize> {
    lattice: Lattice<D>,
    /// Each place with the number of nodes along an axis that are interpolated: 2 or 4.
    places: Vec<(Place<D>, usize)>,
}

/// A distance below this share of the size of the box is taken for round-off of positions.
const ROUNDING: f64 = 1e-9;
/// Most steps of Newton's method to find ξ in the cubic map. From the linear one it takes three or four.
const NEWTON_STEPS: usize = 12;
/// Newton's method has converged once it changes ξ by less than this, in cells: rounding.
const CONVERGED: f64 = 1e-12;
/// Newton's method is given up where it leads farther than this beyond the cell, in cells: the point then has no place
/// in the cubic map.
const BEYOND: f64 = 0.5;

/// True where two points are one, up to rounding.
pub(super) fn lies_within<const D: usize>(mesh: &Mesh<D>, found: [f64; D], point: [f64; D]) -> bool {
    let extent = mesh.extent();
    (0..D).all(|d| (found[d] - point[d]).abs() <= ROUNDING * extent[d])
}

impl<const D: usize> Interpolator<D>
where
    Mesh<D>: Cells<D>,
{
    /// Locates some points. The mesh must have no folded cells.
    ///
    /// # Errors
    /// The index of the first point outside of the mesh, which does not end along periodic axes.
    pub fn new(mesh: &Mesh<D>, points: &[[f64; D]], degree: Degree) -> Result<Self, usize> {
        let points = &*mesh.parameters_of(points)?;
        let mesh = mesh.parameters();
        let places = mesh.places(points);
        let mut found = Vec::with_capacity(places.len());
        for (k, place) in places.into_iter().enumerate() {
            found.push((place.ok_or(k)?, 2));
        }
        if degree == Degree::Cubic {
            parallel::for_each_piece(&mut found, |first, piece| {
                for (k, found) in (first..).zip(piece) {
                    let point = nearest_image(mesh, found.0, points[k]);
                    if let Some(share) = refined(mesh, found.0, point) {
                        *found = (Place { share, ..found.0 }, 4);
                    }
                }
            });
        }
        Ok(Self { lattice: *mesh.lattice(), places: found })
    }

    /// The values of a nodal field at the points.
    ///
    /// # Panics
    /// If `u` has not one value a node.
    pub fn values(&self, u: &[f64]) -> Vec<f64> {
        assert_eq!(u.len(), self.lattice.len(), "one value a node");
        let mut values = vec![0.0; self.places.len()];
        parallel::for_each_piece(&mut values, |first, piece| {
            for (value, &(place, nodes)) in piece.iter_mut().zip(&self.places[first..]) {
                let axes: [Axis; D] = std::array::from_fn(|d| Axis::new(&self.lattice, d, place, nodes));
                each_node(&self.lattice, &axes, |k, at| {
                    *value += (0..D).map(|d| axes[d].weights[at[d]]).product::<f64>() * u[k];
                });
            }
        });
        values
    }
}

/// The image of a point that is nearest to where its place says it is.
fn nearest_image<const D: usize>(mesh: &Mesh<D>, place: Place<D>, point: [f64; D]) -> [f64; D] {
    let (there, _) = mapped(mesh, place, 2, [0.0; D]);
    let (extent, periodic) = (mesh.extent(), mesh.lattice().periodic());
    std::array::from_fn(|d| {
        let turns = if periodic[d] { ((there[d] - point[d]) / extent[d]).round() } else { 0.0 };
        point[d] + turns * extent[d]
    })
}

/// ξ of a point in the cubic map, by Newton's method; nothing where it does not lie near the cell.
fn refined<const D: usize>(mesh: &Mesh<D>, place: Place<D>, point: [f64; D]) -> Option<[f64; D]> {
    let mut at = place;
    // from a corner of the cell, so that round-off is that of the cell, wherever the box lies
    let corner = mesh.x()[mesh.lattice().index(place.cell)];
    let point: [f64; D] = std::array::from_fn(|d| point[d] - corner[d]);
    for _ in 0..NEWTON_STEPS {
        let (there, derivatives) = mapped(mesh, at, 4, corner);
        let (cofactors, determinant) = (cofactors(derivatives), determinant(derivatives));
        let change: [f64; D] =
            std::array::from_fn(|d| (0..D).map(|c| cofactors[d][c] * (point[c] - there[c])).sum::<f64>() / determinant);
        at.share = std::array::from_fn(|d| at.share[d] + change[d]);
        if !at.share.iter().all(|s| (-BEYOND..=1.0 + BEYOND).contains(s)) {
            return None;
        }
        if change.iter().all(|c| c.abs() < CONVERGED) {
            return Some(at.share);
        }
    }
    None
}

/// x at a place, from an origin, and ∂x/∂ξ_d of the map through so many nodes along an axis.
fn mapped<const D: usize>(
    mesh: &Mesh<D>,
    place: Place<D>,
    nodes: usize,
    origin: [f64; D],
) -> ([f64; D], [[f64; D]; D]) {
    let (lattice, extent) = (mesh.lattice(), mesh.extent());
    let axes: [Axis; D] = std::array::from_fn(|d| Axis::new(lattice, d, place, nodes));
    let (mut x, mut derivatives) = ([0.0; D], [[0.0; D]; D]);
    each_node(lattice, &axes, |k, at| {
        let weights = std::array::from_fn::<f64, D, _>(|d| axes[d].weights[at[d]]);
        let along = |d: usize| (0..D).map(|e| if e == d { axes[d].slopes[at[d]] } else { weights[e] }).product::<f64>();
        let (weight, slopes) = (weights.iter().product::<f64>(), std::array::from_fn::<f64, D, _>(along));
        for c in 0..D {
            let there = mesh.x()[k][c] - origin[c] + axes[c].turns[at[c]] * extent[c];
            x[c] += weight * there;
            (0..D).for_each(|d| derivatives[d][c] += slopes[d] * there);
        }
    });
    (x, derivatives)
}

/// Up to four nodes along an axis: which, after how many turns around a periodic axis, with which weight, and the
/// derivative of the weight by ξ in cells.
struct Axis {
    count: usize,
    nodes: [usize; 4],
    turns: [f64; 4],
    weights: [f64; 4],
    slopes: [f64; 4],
}

impl Axis {
    fn new<const D: usize>(lattice: &Lattice<D>, d: usize, place: Place<D>, count: usize) -> Self {
        let (n, wraps, cell) = (lattice.nodes()[d], lattice.periodic()[d], place.cell[d] as isize);
        let count = if wraps { count } else { count.min(n) };
        let below = cell - (count as isize - 2).div_euclid(2);
        let first = if wraps { below } else { below.clamp(0, (n - count) as isize) };
        let at = place.share[d] + (cell - first) as f64;
        let mut axis = Self { count, nodes: [0; 4], turns: [0.0; 4], weights: [0.0; 4], slopes: [0.0; 4] };
        for k in 0..count {
            let node = first + k as isize;
            axis.nodes[k] = node.rem_euclid(n as isize) as usize;
            axis.turns[k] = node.div_euclid(n as isize) as f64;
            (axis.weights[k], axis.slopes[k]) = lagrange(count, k, at);
        }
        axis
    }
}

/// Lagrange's polynomial that is 1 at k and 0 at the other whole numbers below `count`, and its derivative.
pub(super) fn lagrange(count: usize, k: usize, at: f64) -> (f64, f64) {
    let (mut value, mut slope) = (1.0, 0.0);
    for other in (0..count).filter(|other| *other != k) {
        let scale = 1.0 / (k as f64 - other as f64);
        slope = (slope * (at - other as f64) + value) * scale;
        value *= (at - other as f64) * scale;
    }
    (value, slope)
}

/// Calls `f(index, at)` for each node that some axes reach, the `at[d]`-th of axis d.
fn each_node<const D: usize>(lattice: &Lattice<D>, axes: &[Axis; D], mut f: impl FnMut(usize, [usize; D])) {
    let all = axes.iter().map(|axis| axis.count).product();
    for number in 0..all {
        let mut rest: usize = number;
        let at: [usize; D] = std::array::from_fn(|d| {
            let k = rest % axes[d].count;
            rest /= axes[d].count;
            k
        });
        f(lattice.index(std::array::from_fn(|d| axes[d].nodes[at[d]])), at);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    /// A mesh whose cells are no parallelograms, and points all over its box, in no order.
    fn bent(n: usize, periodic: bool) -> Mesh<2> {
        let mesh = Mesh::uniform(Lattice::new([n, n], [periodic; 2]).unwrap(), [0.0; 2], [1.0; 2]).unwrap();
        let wave =
            |a: f64, b: f64| 0.08 * (2.0 * PI * a).sin() * if periodic { (2.0 * PI * b).cos() } else { (PI * b).sin() };
        mesh.moved(mesh.x().iter().map(|&[x, y]| [x + wave(x, y), y - wave(y, x)]).collect()).unwrap()
    }

    fn points(count: usize) -> Vec<[f64; 2]> {
        (0..count).map(|k| [0.618, 0.755].map(|s| (s * k as f64).fract())).collect()
    }

    fn error(mesh: &Mesh<2>, degree: Degree, of: impl Fn([f64; 2]) -> f64) -> f64 {
        let (points, u): (_, Vec<f64>) = (points(5000), mesh.x().iter().map(|&x| of(x)).collect());
        let found = Interpolator::new(mesh, &points, degree).unwrap().values(&u);
        found.iter().zip(&points).map(|(found, &x)| (found - of(x)).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn linear_functions_are_exact_on_any_mesh() {
        for degree in [Degree::Linear, Degree::Cubic] {
            assert!(error(&bent(13, false), degree, |[x, y]| 1.0 - 2.0 * x + 3.0 * y) < 1e-13);
        }
    }

    /// Second and fourth order on bounded axes, and across the ends of periodic ones.
    #[test]
    fn smooth_functions_are_interpolated_with_the_order_of_the_degree() {
        for (periodic, degree, expected) in [
            (false, Degree::Linear, 2.0),
            (true, Degree::Linear, 2.0),
            (false, Degree::Cubic, 4.0),
            (true, Degree::Cubic, 4.0),
        ] {
            let wave = |[x, y]: [f64; 2]| (2.0 * PI * x).sin() * (2.0 * PI * y).cos();
            let [coarse, fine] = [24, 48].map(|n| error(&bent(n, periodic), degree, wave));
            let order = (coarse / fine).log2();
            assert!((order - expected).abs() < 0.4, "observed order {order:.2}, expected {expected}, {periodic}");
        }
    }

    /// As good in a box far from the origin, up to the round-off of its coordinates.
    #[test]
    fn a_box_may_lie_anywhere() {
        let wave = |x: f64| (2.0 * PI * x).sin();
        let error = |offset: f64| {
            let mesh = Mesh::uniform(Lattice::bounded([40]).unwrap(), [offset], [offset + 1.0]).unwrap();
            let bend = |x: f64| x + 0.1 * x * (1.0 - x);
            let mesh = mesh.moved(mesh.x().iter().map(|[x]| [offset + bend(x - offset)]).collect()).unwrap();
            let u: Vec<f64> = mesh.x().iter().map(|[x]| wave(x - offset)).collect();
            let points: Vec<[f64; 1]> = (0..500).map(|k| [offset + (k as f64 + 0.5) / 500.0]).collect();
            let found = Interpolator::new(&mesh, &points, Degree::Cubic).unwrap().values(&u);
            found.iter().zip(&points).map(|(found, [x])| (found - wave(x - offset)).abs()).fold(0.0, f64::max)
        };
        let near = error(0.0);
        for offset in [1e2, 2e3, 1e6] {
            assert!(error(offset) < 1.1 * near, "{offset}: {:e} for {near:e}", error(offset));
        }
    }

    #[test]
    fn points_outside_are_told_of() {
        let mut points = points(40_000);
        points[20_001] = [0.5, 1.0 + 1e-6];
        assert_eq!(Interpolator::new(&bent(9, false), &points, Degree::Linear).err(), Some(20_001));
        assert!(Interpolator::new(&bent(9, true), &points, Degree::Linear).is_ok());
    }
}
