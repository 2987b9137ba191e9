//! Determinants of one to three rows.

/// The determinant of up to three rows.
pub(crate) fn determinant<const D: usize>(rows: [[f64; D]; D]) -> f64 {
    let cross = |a: usize, b: usize, c: usize, d: usize| rows[a][c] * rows[b][d] - rows[a][d] * rows[b][c];
    match D {
        1 => rows[0][0],
        2 => cross(0, 1, 0, 1),
        3 => rows[0][0] * cross(1, 2, 1, 2) - rows[0][1] * cross(1, 2, 0, 2) + rows[0][2] * cross(1, 2, 0, 1),
        _ => unreachable!("meshes have one to three axes"),
    }
}

/// The cofactors of one to three rows: Σ_d C[d][c] m[d][c'] = det m where c = c', else 0
///
/// Where m[d] = ∂x/∂ξ_d, the gradient of u is Σ_d C[d] ∂u/∂ξ_d over the determinant.
pub(crate) fn cofactors<const D: usize>(m: [[f64; D]; D]) -> [[f64; D]; D] {
    std::array::from_fn(|d| {
        std::array::from_fn(|c| match D {
            1 => 1.0,
            2 => {
                let opposite = m[1 - d][1 - c];
                if d == c { opposite } else { -opposite }
            }
            3 => {
                let ([p, q], [i, j]) = ([(d + 1) % 3, (d + 2) % 3], [(c + 1) % 3, (c + 2) % 3]);
                m[p][i] * m[q][j] - m[p][j] * m[q][i]
            }
            _ => unreachable!("meshes have one to three axes"),
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows times cofactors are the determinant on the diagonal and 0 elsewhere.
    #[test]
    fn cofactors_invert_their_rows() {
        fn check<const D: usize>(m: [[f64; D]; D]) {
            let (found, determinant) = (cofactors(m), determinant(m));
            for (a, b) in (0..D).flat_map(|a| (0..D).map(move |b| (a, b))) {
                let product: f64 = found.iter().zip(m).map(|(found, m)| found[a] * m[b]).sum();
                assert!((product - if a == b { determinant } else { 0.0 }).abs() < 1e-14, "{D} rows: {product}");
            }
        }
        check([[3.0]]);
        check([[2.0, 1.0], [-0.5, 3.0]]);
        check([[2.0, 1.0, 0.3], [-0.5, 3.0, 0.1], [0.7, -0.2, 1.5]]);
    }
}
