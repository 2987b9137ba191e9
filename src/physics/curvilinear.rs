use crate::geometry::Patch;
use crate::parallel;

/// Differential operators in x as stencils on the lattice, at every unknown of the whole domain
///
/// ```text
/// u_x = (u_ξ y_η − u_η y_ξ) / J,   u_y = (u_η x_ξ − u_ξ x_η) / J,   J = x_ξ y_η − x_η y_ξ
/// Δu  = (1/J) [ ∂_ξ((α u_ξ − β u_η)/J) + ∂_η((γ u_η − β u_ξ)/J) ]
/// α = x_η² + y_η²,   β = x_ξ x_η + y_ξ y_η,   γ = x_ξ² + y_ξ²
/// ```
///
/// Metrics at nodes are central differences. Those at the faces of the Laplacian follow from the coordinates: the
/// difference across the face, and the mean of the two central differences along it. Points are in the order of
/// [`LatticeMatrix`](crate::numerics::linear::LatticeMatrix).
#[derive(Debug, Clone)]
pub(super) struct Stencils {
    /// Weights of u_x and u_y for the four neighbours of the star; the node itself has none.
    pub gradient: Vec<[[f64; 2]; 4]>,
    /// Weights of Δu for the nine points.
    pub laplacian: Vec<[f64; 9]>,
}

/// The flux through a face as a function of u: the weight of the difference across the face, and that of the difference
/// along it, which is a quarter of the sum of four differences over two spacings.
type Face = [f64; 2];

impl Stencils {
    /// Stencils of a mesh given by its positions, padded on the patch of all unknowns.
    ///
    /// It uses undivided differences, from which all lattice spacings cancel.
    pub fn new(patch: &Patch<2>, x: &[[f64; 2]]) -> Self {
        let [s, _] = patch.padded_strides();
        let n = patch.pencil_len();
        let mut gradient = vec![[[0.0; 2]; 4]; patch.len()];
        let mut laplacian = vec![[0.0; 9]; patch.len()];
        parallel::for_each_row_pair(&mut gradient, n, &mut laplacian, n, |p, gradient, laplacian| {
            let start = patch.pencil(p);
            let mut south = face(x, start - 1, 1, s);
            for (k, (gradient, laplacian)) in (start..).zip(gradient.iter_mut().zip(laplacian)) {
                let inverse;
                (*gradient, inverse) = gradient_and_inverse(x, k, [s, 1]);
                let (west, east, north) = (face(x, k - s, s, 1), face(x, k, s, 1), face(x, k, 1, s));
                let scale = 4.0 * inverse;
                *laplacian = [
                    -(west[0] + east[0] + south[0] + north[0]),
                    west[0] - south[1] + north[1],
                    east[0] + south[1] - north[1],
                    south[0] - west[1] + east[1],
                    north[0] + west[1] - east[1],
                    -west[1] - south[1],
                    west[1] + north[1],
                    east[1] + south[1],
                    -east[1] - north[1],
                ]
                .map(|w| w * scale);
                south = north;
            }
        });
        Self { gradient, laplacian }
    }
}

/// Weights of u_x and u_y at place k for the four neighbours of the star.
pub(super) fn gradient(x: &[[f64; 2]], k: usize, strides: [usize; 2]) -> [[f64; 2]; 4] {
    gradient_and_inverse(x, k, strides).0
}

/// The weights of [`gradient`], and 1/J with undivided differences.
fn gradient_and_inverse(x: &[[f64; 2]], k: usize, [s, t]: [usize; 2]) -> ([[f64; 2]; 4], f64) {
    let (xi, eta) = (minus(x[k + s], x[k - s]), minus(x[k + t], x[k - t]));
    let inverse = 1.0 / cross(xi, eta);
    let above = [eta[1] * inverse, -eta[0] * inverse];
    let right = [-xi[1] * inverse, xi[0] * inverse];
    ([above.map(|v| -v), above, right.map(|v| -v), right], inverse)
}

/// The face between nodes k and k + `step`; `side` is the step along the face.
fn face(x: &[[f64; 2]], k: usize, step: usize, side: usize) -> Face {
    let across = minus(x[k + step], x[k]);
    let (here, there) = (minus(x[k + side], x[k - side]), minus(x[k + step + side], x[k + step - side]));
    let along = [0.25 * (here[0] + there[0]), 0.25 * (here[1] + there[1])];
    let inverse = 1.0 / cross(across, along).abs();
    [dot(along, along) * inverse, 0.25 * dot(across, along) * inverse]
}

fn minus(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

fn dot(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

fn cross(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}
