//! What stands on both sides of a face, and how fast it is carried through.

use super::Block;

/// How far the values at the faces below and above a node differ from its own, along one axis: by the differences to
/// the nodes below and above, and the distances to these
///
/// ```text
/// Δ₊ = min(½ h₊ |2 g₊ + g₋| / 3, |d₋|, |d₊|),   g = d/h
/// ```
///
/// with the sign of both differences, and Δ₋ likewise; 0 where their signs differ. A smooth profile has two thirds of
/// the slope on its own side and one third of the other, which is of the third order on equal cells; the bounds keep
/// what stands at a face between the nodes.
///
/// # Source
/// Koren, *A robust upwind discretization method for advection, diffusion and source terms* (1993).
#[inline(always)]
pub(super) fn increments([below, above]: [f64; 2], [h_below, h_above]: [f64; 2]) -> [f64; 2] {
    if below * above <= 0.0 {
        return [0.0; 2];
    }
    let most = below.abs().min(above.abs());
    let [g, k] = [below.abs() / h_below, above.abs() / h_above];
    let towards = |h: f64, own: f64, other: f64| (h * (2.0 * own + other) / 6.0).min(most).copysign(above);
    [towards(h_below, g, k), towards(h_above, k, g)]
}

/// A bound for the largest absolute eigenvalue of the rows and columns of `matrix` that are `taken`: of J,
/// ‖J^(2ᵏ)‖^(2⁻ᵏ) falls to it as k grows.
///
/// # Source
/// Gelfand's formula: Horn and Johnson, *Matrix Analysis* (2013), 5.6.14.
pub(super) fn spectral_radius<const B: usize>(matrix: &Block<B>, taken: [bool; B]) -> f64 {
    let mut power: Block<B> =
        std::array::from_fn(|i| std::array::from_fn(|j| if taken[i] && taken[j] { matrix[i][j] } else { 0.0 }));
    let norm = |m: &Block<B>| m.iter().map(|row| row.iter().map(|v| v.abs()).sum::<f64>()).fold(0.0, f64::max);
    let mut bound = 1.0;
    let mut share = 1.0;
    for _ in 0..SQUARINGS {
        let size = norm(&power);
        // nothing, or what is not finite
        if !(size > 0.0 && size.is_finite()) {
            return size * bound;
        }
        bound *= size.powf(share);
        share *= 0.5;
        let unit: Block<B> = power.map(|row| row.map(|v| v / size));
        power = std::array::from_fn(|i| std::array::from_fn(|j| (0..B).map(|k| unit[i][k] * unit[k][j]).sum()));
    }
    bound * norm(&power).powf(share)
}

/// The bound of [`spectral_radius`] is at most a hundredth too large for a symmetric matrix of eight rows.
const SQUARINGS: usize = 6;

#[cfg(test)]
mod tests {
    use super::*;

    /// A linear profile on any cells has its own values at faces; an extremum has none but its own.
    #[test]
    fn linear_profiles_are_kept() {
        for [h, k] in [[1.0, 1.0], [0.3, 0.5], [2.0, 1.2]] {
            let [below, above] = increments([3.0 * h, 3.0 * k], [h, k]);
            assert!((below - 1.5 * h).abs() < 1e-14 && (above - 1.5 * k).abs() < 1e-14);
        }
        assert_eq!(increments([1.0, -1.0], [1.0, 1.0]), [0.0; 2]);
        assert_eq!(increments([0.0, 1.0], [1.0, 1.0]), [0.0; 2]);
        // beside a jump by a hundred
        assert_eq!(increments([-1.0, -100.0], [1.0, 1.0]), [-1.0, -1.0]);
    }

    /// Eigenvalues of matrices that are known: the Euler equations' u − c, u, u + c; a rotation; nothing.
    #[test]
    fn the_largest_eigenvalue_is_found() {
        let (u, c2, gamma) = (0.7, 1.44, 1.4);
        let h = c2 / (gamma - 1.0) + 0.5 * u * u;
        let euler = [
            [0.0, 1.0, 0.0],
            [0.5 * (gamma - 3.0) * u * u, (3.0 - gamma) * u, gamma - 1.0],
            [u * (0.5 * (gamma - 1.0) * u * u - h), h - (gamma - 1.0) * u * u, gamma * u],
        ];
        let found = spectral_radius(&euler, [true; 3]);
        assert!((1.0..1.05).contains(&(found / 1.9)), "{found}");
        let turn = spectral_radius(&[[0.0, -2.0], [2.0, 0.0]], [true; 2]);
        assert!((1.0..1.02).contains(&(turn / 2.0)), "{turn}");
        assert_eq!(spectral_radius(&[[0.0, 1.0], [0.0, 0.0]], [true; 2]), 0.0);
        assert_eq!(spectral_radius(&[[5.0, 1.0], [0.0, -3.0]], [false, true]), 3.0);
    }
}
