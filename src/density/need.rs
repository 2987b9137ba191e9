use crate::geometry::{Mesh, Patch, padded};
use crate::numerics::larger;

/// Changes of u over a uniform cell, as shares of its range, that equal cells resolve at most, and that take the whole
/// density at least: a Gaussian is interpolated to 1 % of its range at the first and to 2 % at the second.
const SLOPES: [f64; 2] = [0.18, 0.25];
/// The same for errors of interpolation between equal cells. A jump by a third of the range counts by them where it is
/// at a node, and is shared by two cells; the foot of a parabola of 15 cells does not.
const ERRORS: [f64; 2] = [0.018, 0.024];

/// How much equal cells leave to be desired where u changes by this share of its range over one at most: from 0 to 1.
pub(crate) fn need(share: f64) -> f64 {
    between(SLOPES, share)
}

/// The same where they are off by this share of the range.
pub(super) fn need_by_error(share: f64) -> f64 {
    between(ERRORS, share)
}

/// Rises from 0 to 1 between two values, with a slope that is 0 at both.
fn between([low, high]: [f64; 2], value: f64) -> f64 {
    let s = ((value - low) / (high - low)).clamp(0.0, 1.0);
    s * s * (3.0 - 2.0 * s)
}

/// The largest error of linear interpolation of u between equal cells, as many as `mesh` has, as its nodes see it
///
/// ```text
/// max |λ|/8,   λ the eigenvalues of the Hessian matrix of u by x/h_x and y/h_y
/// ```
///
/// over the nodes inside: h² |u_nn|/8 in a layer with normal n on square cells. The Hessian is H = J⁻ᵀ C J⁻¹, where
/// C_ab = δ_aδ_b u − ∇u·δ_aδ_b x, J = (x_ξ, x_η), all differences central. Where a layer is thinner than a uniform cell
/// it is more than such cells can be off.
pub(super) fn missed_by_equal_cells(mesh: &Mesh<2>, u: &[f64]) -> f64 {
    let (lattice, extent) = (mesh.lattice(), mesh.extent());
    let patch = Patch { origin: [0; 2], size: lattice.nodes(), wraps: lattice.periodic() };
    let per_cell = [0, 1].map(|d| lattice.cells()[d] as f64 / extent[d]);
    let x = padded(lattice, mesh.x(), [[extent[0], 0.0], [0.0, extent[1]]]);
    let u = padded(lattice, u.as_chunks::<1>().0, [[0.0]; 2]);
    let [s, t] = patch.padded_strides();
    // u, x and y less those at a node in the middle, in uniform cells
    let from =
        |k: usize, n: usize| [u[n][0] - u[k][0], (x[n][0] - x[k][0]) * per_cell[0], (x[n][1] - x[k][1]) * per_cell[1]];
    let missed = |k: usize| {
        let [left, right, below, above] = [k - s, k + s, k - t, k + t].map(|n| from(k, n));
        let [p, a, b] = [0, 1, 2].map(|c| 0.5 * (right[c] - left[c]));
        let [q, c, d] = [0, 1, 2].map(|c| 0.5 * (above[c] - below[c]));
        let inverse = 1.0 / (a * d - b * c);
        let gradient = [(p * d - q * b) * inverse, (q * a - p * c) * inverse];
        let bent = |difference: [f64; 3]| difference[0] - gradient[0] * difference[1] - gradient[1] * difference[2];
        let corners = [k + s + t, k - s - t, k + s - t, k - s + t].map(|n| from(k, n));
        let along = bent([0, 1, 2].map(|c| right[c] + left[c]));
        let up = bent([0, 1, 2].map(|c| above[c] + below[c]));
        let across = bent([0, 1, 2].map(|c| 0.25 * (corners[0][c] + corners[1][c] - corners[2][c] - corners[3][c])));
        // H = J⁻ᵀ C J⁻¹ with J⁻¹ = (d −c; −b a)/det
        let squared = inverse * inverse;
        let xx = squared * (d * d * along - 2.0 * b * d * across + b * b * up);
        let yy = squared * (c * c * along - 2.0 * a * c * across + a * a * up);
        let xy = squared * ((a * d + b * c) * across - c * d * along - a * b * up);
        0.125 * (0.5 * (xx + yy).abs() + (0.25 * (xx - yy) * (xx - yy) + xy * xy).sqrt())
    };
    let inside = patch.places().enumerate().filter(|(i, _)| !lattice.on_side(*i));
    inside.fold(0.0, |most, (_, k)| larger(most, missed(k)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Lattice;

    /// A quadratic function of one axis is missed by h² |u″|/8, on equal cells and on any others along that axis, bent
    /// or not across it, whatever the unit of length.
    #[test]
    fn the_error_of_a_quadratic_function_is_exact() {
        for unit in [1.0, 1e-6] {
            let mesh = Mesh::uniform(Lattice::bounded([20, 10]).unwrap(), [0.0; 2], [unit, unit]).unwrap();
            let bent = mesh.x().iter().map(|&[x, y]| {
                let (x, y) = (x / unit, y / unit);
                [unit * (x + 0.8 * x * (1.0 - x) * (x - 0.5)), unit * (y + 0.3 * y * (1.0 - y) * x)]
            });
            for mesh in [mesh.clone(), mesh.moved(bent.collect()).unwrap()] {
                let u: Vec<f64> = mesh.x().iter().map(|x| 3.0 * (x[0] / unit).powi(2) + 7.0 * x[1] / unit).collect();
                let exact = 6.0 / (8.0 * 400.0);
                let told = missed_by_equal_cells(&mesh, &u);
                assert!((told / exact - 1.0).abs() < 1e-2, "{told:e} where it is {exact:e}");
            }
        }
    }

    /// A layer is missed by as much whichever way it lies, and a blob as wide by as much.
    #[test]
    fn the_direction_of_a_layer_does_not_matter() {
        let mesh = Mesh::uniform(Lattice::bounded([200, 200]).unwrap(), [0.0; 2], [1.0; 2]).unwrap();
        let missed = |f: &dyn Fn(f64, f64) -> f64| {
            let u: Vec<f64> = mesh.x().iter().map(|x| f(x[0] - 0.5, x[1] - 0.5)).collect();
            missed_by_equal_cells(&mesh, &u)
        };
        let exact = 0.005_f64.powi(2) / (8.0 * 0.005);
        let gauss = |r: f64| (-r * r / 0.01).exp();
        for told in [
            missed(&|x, _| gauss(x)),
            missed(&|x, y| gauss(0.6 * x + 0.8 * y)),
            missed(&|x, y| gauss(0.5_f64.sqrt() * (x + y))),
            missed(&|x, y| gauss(x.hypot(y))),
        ] {
            assert!((told / exact - 1.0).abs() < 5e-3, "{told:e} where it is {exact:e}");
        }
    }

    /// The steps of a staircase count wherever they are in their cells; a tent that rises over 15 cells does not.
    #[test]
    fn every_step_of_a_staircase_counts() {
        let mesh = Mesh::uniform(Lattice::bounded([40, 4]).unwrap(), [0.0; 2], [1.0, 0.1]).unwrap();
        let told = |f: &dyn Fn(f64) -> f64| {
            let u: Vec<f64> = mesh.x().iter().map(|x| f(x[0])).collect();
            let slopes = u.iter().zip(&u[5..]).map(|(a, b)| (a - b).abs());
            need(slopes.fold(0.0, f64::max)).max(need_by_error(missed_by_equal_cells(&mesh, &u)))
        };
        for shift in [0.0, 0.3, 0.5] {
            let steps = |x: f64| [4.0, 16.0, 28.0].map(|at| 0.5 + 0.5 * (7.0 * (40.0 * x - at - shift)).tanh());
            let told = told(&|x| steps(x).iter().sum::<f64>() / 3.0);
            assert!(told > 0.2, "shifted by {shift}: {told}");
        }
        assert_eq!(told(&|x| (1.0 - (40.0 * x - 20.0).abs() / 15.0).max(0.0)), 0.0);
    }
}
