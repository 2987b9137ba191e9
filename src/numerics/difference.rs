//! Second-order differences on the lattice, and the metrics of a mesh that follow from them.

use crate::geometry::{Lattice, Mesh, cofactors};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Derivative along one axis of the lattice at every node
///
/// ```text
/// ∂_ξ f ≈ (f_{i+1} − f_{i−1}) / 2h,   at a bounded side (−3 f_0 + 4 f_1 − f_2) / 2h
/// ```
///
/// On a periodic axis `jump` is added on wrapping around: the period for coordinates, zero for other fields.
///
/// # Example
/// ```
/// use driftmesh::{geometry::Lattice, numerics::difference::derivative};
/// let lattice = Lattice::bounded([4])?;
/// let square: Vec<[f64; 1]> = (0..5).map(|i| [(i as f64 / 4.0).powi(2)]).collect();
/// // exact for quadratics, at the ends too
/// let slopes: Vec<f64> = derivative(&lattice, &square, 0, [0.0]).as_flattened().to_vec();
/// assert_eq!(slopes, [0.0, 0.5, 1.0, 1.5, 2.0]);
/// # Ok::<(), driftmesh::Error>(())
/// ```
pub fn derivative<const D: usize, const K: usize>(
    lattice: &Lattice<D>,
    values: &[[f64; K]],
    axis: usize,
    jump: [f64; K],
) -> Vec<[f64; K]> {
    let s = lattice.strides()[axis];
    let n = lattice.nodes()[axis];
    let scale = 0.5 / lattice.spacing()[axis];
    let periodic = lattice.periodic()[axis];
    let mut out = vec![[0.0; K]; values.len()];
    for (f, df) in values.chunks_exact(s * n).zip(out.chunks_exact_mut(s * n)) {
        let (below, above) = (f, f.get(2 * s..).unwrap_or_default());
        for ((d, below), above) in df[s..].iter_mut().zip(below).zip(above) {
            *d = std::array::from_fn(|c| (above[c] - below[c]) * scale);
        }
        for k in 0..s {
            let at = |i: usize, c: usize| f[i * s + k][c];
            if periodic {
                // on an axis of one node it is its own neighbour on both sides, one jump away
                let (second, last) = (1 % n, n - 1);
                let over = if n == 1 { 1.0 } else { 0.0 };
                df[k] = std::array::from_fn(|c| (at(second, c) + over * jump[c] - (at(last, c) - jump[c])) * scale);
                if n > 1 {
                    df[last * s + k] = std::array::from_fn(|c| (at(0, c) + jump[c] - at(last - 1, c)) * scale);
                }
            } else {
                df[k] = std::array::from_fn(|c| (4.0 * at(1, c) - 3.0 * at(0, c) - at(2, c)) * scale);
                df[(n - 1) * s + k] =
                    std::array::from_fn(|c| (at(n - 3, c) + 3.0 * at(n - 1, c) - 4.0 * at(n - 2, c)) * scale);
            }
        }
    }
    out
}

/// Difference scheme for b = ∇_ξρ/ρ in the gradient form of the mesh equation.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Gradient {
    /// Central differences of ρ, over ρ.
    #[default]
    Central,
    /// Central differences of ln ρ, which a single steep cell cannot make larger than half the jump of ln ρ over two
    /// cells.
    Log,
    /// bh = 2 tanh(h ∂ ln ρ / 2) with central differences of ln ρ. It is of second order like the others, and |b|h < 2
    /// for every ρ, so that the mesh equation is an M-matrix and its weights are probabilities of random walks.
    Safe,
}

impl Gradient {
    /// b = ∇_ξρ/ρ at every node.
    pub fn of_log<const D: usize>(self, lattice: &Lattice<D>, rho: &[f64]) -> Vec<[f64; D]> {
        let logarithm: Vec<f64>;
        let potential = match self {
            Self::Central => rho,
            Self::Log | Self::Safe => {
                logarithm = rho.iter().map(|r| r.ln()).collect();
                &logarithm
            }
        };
        let mut b = vec![[0.0; D]; rho.len()];
        for (d, h) in lattice.spacing().into_iter().enumerate() {
            let slopes = derivative(lattice, potential.as_chunks::<1>().0, d, [0.0]);
            for ((b, [slope]), rho) in b.iter_mut().zip(slopes).zip(rho) {
                b[d] = match self {
                    Self::Central => slope / rho,
                    Self::Log => slope,
                    Self::Safe => 2.0 / h * (0.5 * h * slope).tanh(),
                };
            }
        }
        b
    }
}

/// Nodal metrics of a mesh
///
/// ```text
/// ∇u = Σ_d C_d ∂u/∂ξ_d / J,   J = det(∂x/∂ξ),   C its cofactors
/// ```
///
/// In the plane J = x_ξ y_η − x_η y_ξ, u_x = (u_ξ y_η − u_η y_ξ)/J and u_y = (u_η x_ξ − u_ξ x_η)/J.
#[derive(Debug, Clone)]
pub struct Metrics<const D: usize = 2> {
    lattice: Lattice<D>,
    /// ∂x/∂ξ_d at all nodes, for each axis d.
    tangents: [Vec<[f64; D]>; D],
}

impl<const D: usize> Metrics<D> {
    /// Metrics at all nodes, by [`derivative`].
    pub fn new(mesh: &Mesh<D>) -> Self {
        let (lattice, jump) = (*mesh.lattice(), mesh.jump());
        let tangents = std::array::from_fn(|d| derivative(&lattice, mesh.x(), d, jump[d]));
        Self { lattice, tangents }
    }

    /// ∇u at all nodes from nodal values.
    pub fn gradient(&self, u: &[f64]) -> Vec<[f64; D]> {
        let u = u.as_chunks::<1>().0;
        let slopes: [_; D] = std::array::from_fn(|d| derivative(&self.lattice, u, d, [0.0]));
        let at = |k: usize| {
            let along = std::array::from_fn(|d| self.tangents[d][k]);
            let (scaled, determinant) = scaled_gradient(along, std::array::from_fn(|d| slopes[d][k][0]));
            let inverse = 1.0 / determinant;
            scaled.map(|g| g * inverse)
        };
        (0..u.len()).map(at).collect()
    }
}

/// J ∇u and J, from the changes of place and of u along D directions.
#[inline(always)]
pub(crate) fn scaled_gradient<const D: usize>(along: [[f64; D]; D], changes: [f64; D]) -> ([f64; D], f64) {
    let cofactors = cofactors(along);
    let product = |c: usize, of: [f64; D]| (1..D).fold(of[0] * cofactors[0][c], |sum, d| sum + of[d] * cofactors[d][c]);
    (std::array::from_fn(|c| product(c, changes)), product(0, along.map(|tangent| tangent[0])))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The gradient of a linear field is exact on any mesh, because metrics and field are differenced alike.
    #[test]
    fn linear_fields_have_their_exact_gradient_on_distorted_meshes() {
        let mesh = Mesh::uniform(Lattice::bounded([9, 7]).unwrap(), [0.0, -1.0], [2.0, 1.0]).unwrap();
        let mesh =
            mesh.moved(mesh.x().iter().map(|&[x, y]| [x + 0.1 * (3.0 * y).sin(), y + 0.2 * x * x]).collect()).unwrap();
        let u: Vec<f64> = mesh.x().iter().map(|[x, y]| 4.0 * x - 3.0 * y).collect();
        for g in Metrics::new(&mesh).gradient(&u) {
            assert!((g[0] - 4.0).abs() < 1e-11 && (g[1] + 3.0).abs() < 1e-11, "{g:?}");
        }
    }

    /// On a periodic lattice the coordinate itself has derivative 1 everywhere thanks to the jump.
    #[test]
    fn the_jump_makes_periodic_coordinates_differentiable() {
        let lattice = Lattice::new([6, 5], [true, false]).unwrap();
        let mesh = Mesh::uniform(lattice, [0.0, 0.0], [3.0, 1.0]).unwrap();
        for d in derivative(&lattice, mesh.x(), 0, [3.0, 0.0]) {
            assert!((d[0] - 3.0).abs() < 1e-13 && d[1].abs() < 1e-13);
        }
    }
}
