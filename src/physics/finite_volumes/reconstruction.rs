//! What stands on both sides of a face, and how fast it is carried through.

use super::{Block, Side};
use crate::geometry::{Lattice, Patch, length};
use crate::numerics::{ends, larger};
use crate::parallel;

/// Limited increments from a node to its two faces along an axis, from the differences to the nodes below and above and
/// the distances to these
///
/// ```text
/// Δ₊ = min(½ h₊ |2 g₊ + g₋| / 3, 2 |d₋|, |d₊|),   g = d/h
/// ```
///
/// with the sign of both differences, and Δ₋ likewise; 0 where their signs differ, but for [smooth](smoothness)
/// extrema, which have Δ₊ without bounds. A smooth profile has two thirds of the slope on its own side and one third of
/// the other, which is of the third order on equal cells; the bounds keep the value at a face between those of the
/// nodes.
///
/// # Source
/// Koren, *A robust upwind discretization method for advection, diffusion and source terms* (1993).
#[inline(always)]
pub(super) fn increments([below, above]: [f64; 2], [h_below, h_above]: [f64; 2], smooth: f64) -> [f64; 2] {
    let [g, k] = [below / h_below, above / h_above];
    let towards = |h: f64, own: f64, other: f64| h * (2.0 * own + other) / 6.0;
    let free = [towards(h_below, g, k), towards(h_above, k, g)];
    if below * above > 0.0 {
        let within = |step: f64, own: f64, other: f64| step.abs().min(own.abs()).min(2.0 * other.abs()).copysign(own);
        return [within(free[0], below, above), within(free[1], above, below)];
    }
    // beyond a bounded side lies nothing, and no slope
    if smooth > 0.0 { free.map(|free| smooth * free) } else { [0.0; 2] }
}

/// How much second derivatives at three nodes in a row are those of a smooth extremum: wholly where they have one sign
/// and the smallest is at least half of the largest, and not at all where it is less than a third. Where a limiter
/// would cut off its peak, it is left as it is.
#[inline(always)]
pub(super) fn smoothness(seconds: [f64; 3]) -> f64 {
    let [least, most] = ends(seconds.iter().copied());
    let ratio = if least > 0.0 {
        least / most
    } else if most < 0.0 {
        most / least
    } else {
        0.0
    };
    (6.0 * ratio - 2.0).clamp(0.0, 1.0)
}

/// Where the values are of which those at faces are made.
pub(super) struct Places<'a, const B: usize, const D: usize> {
    pub lattice: &'a Lattice<D>,
    pub patch: Patch<D>,
    /// Positions, padded.
    pub x: &'a [[f64; D]],
    pub sides: &'a [Side<B>],
    /// The unknowns whose values are wanted.
    pub wanted: [bool; B],
    /// The places, with their rings, where values along each axis are wanted; none for all places.
    pub marked: Option<&'a [[bool; D]]>,
}

impl<const B: usize, const D: usize> Places<'_, B, D> {
    fn is_marked(&self, k: usize, axis: usize) -> bool {
        self.marked.is_none_or(|marked| marked[k][axis])
    }

    fn distance(&self, i: usize, k: usize) -> f64 {
        let way: [f64; D] = std::array::from_fn(|d| self.x[k][d] - self.x[i][d]);
        length(way)
    }

    /// By how much values at the faces below and above each node differ from its own along each axis.
    pub fn increments(&self, u: &[[f64; B]]) -> Vec<[[[f64; B]; 2]; D]> {
        let patch = self.patch;
        let (strides, wanted) = (patch.padded_strides(), self.wanted);
        let seconds = self.seconds(u);
        let mut steps = vec![[[[0.0; B]; 2]; D]; u.len()];
        let row = patch.pencil_len() + 2;
        parallel::for_each_row(&mut steps, row, |q, steps| {
            if patch.pencil_in_row(q).is_none() {
                return;
            }
            for (k, steps) in (q * row..).zip(steps).skip(1).take(row - 2) {
                for (d, s) in strides.into_iter().enumerate().filter(|&(d, _)| self.is_marked(k, d)) {
                    let h = [self.distance(k - s, k), self.distance(k, k + s)];
                    for c in (0..B).filter(|&c| wanted[c]) {
                        let differences = [u[k][c] - u[k - s][c], u[k + s][c] - u[k][c]];
                        let smooth = smoothness([k - s, k, k + s].map(|k| seconds[k][d][c]));
                        let [below, above] = increments(differences, h, smooth);
                        (steps[d][0][c], steps[d][1][c]) = (below, above);
                    }
                }
            }
        });
        self.go_on_beyond(u, &mut steps);
        patch.wrap(&mut steps);
        steps
    }

    /// Second derivatives along the lattice lines.
    fn seconds(&self, u: &[[f64; B]]) -> Vec<[[f64; B]; D]> {
        let patch = self.patch;
        let (strides, wanted) = (patch.padded_strides(), self.wanted);
        let mut seconds = vec![[[0.0; B]; D]; u.len()];
        let row = patch.pencil_len() + 2;
        parallel::for_each_row(&mut seconds, row, |q, seconds| {
            if patch.pencil_in_row(q).is_none() {
                return;
            }
            for (k, seconds) in (q * row..).zip(seconds).skip(1).take(row - 2) {
                for (d, s) in strides.into_iter().enumerate() {
                    // those of neighbours tell whether an extremum is smooth
                    if [k - s, k, k + s].iter().all(|&k| !self.is_marked(k, d)) {
                        continue;
                    }
                    let [below, above] = [self.distance(k - s, k), self.distance(k, k + s)];
                    // beyond a bounded side there is nothing
                    if below == 0.0 || above == 0.0 {
                        continue;
                    }
                    for c in (0..B).filter(|&c| wanted[c]) {
                        let slopes = [(u[k][c] - u[k - s][c]) / below, (u[k + s][c] - u[k][c]) / above];
                        seconds[d][c] = 2.0 * (slopes[1] - slopes[0]) / (below + above);
                    }
                }
            }
        });
        patch.wrap(&mut seconds);
        seconds
    }

    /// Where a value is given the profile goes on beyond the side as before it.
    fn go_on_beyond(&self, u: &[[f64; B]], steps: &mut [[[[f64; B]; 2]; D]]) {
        let strides = self.patch.padded_strides();
        for side in self.sides {
            for (d, ends) in self.lattice.beyond(side.i).into_iter().enumerate() {
                let inner = match ends {
                    [true, false] => side.k + strides[d],
                    [false, true] => side.k - strides[d],
                    _ => continue,
                };
                for c in (0..B).filter(|&c| self.wanted[c] && side.given[c].is_some()) {
                    let half = 0.5 * (u[inner][c] - u[side.k][c]);
                    steps[side.k][d] = steps[side.k][d].map(|mut step| {
                        step[c] = if ends[0] { half } else { -half };
                        step
                    });
                }
            }
        }
    }
}

/// The largest absolute eigenvalue that belongs to each unknown, of two matrices: those of the `taken` that are not
/// coupled to others of these have their own, all others have one in common.
pub(super) fn speeds<const B: usize>(matrices: &[Block<B>; 2], taken: [bool; B]) -> [f64; B] {
    let alone =
        |c: usize| matrices.iter().all(|j| (0..B).all(|e| e == c || !taken[e] || (j[c][e] == 0.0 && j[e][c] == 0.0)));
    let coupled: [bool; B] = std::array::from_fn(|c| taken[c] && !alone(c));
    let together = match coupled.contains(&true) {
        true => matrices.iter().map(|j| spectral_radius(j, coupled)).fold(0.0, larger),
        false => 0.0,
    };
    std::array::from_fn(|c| match (taken[c], coupled[c]) {
        (false, _) => 0.0,
        (_, true) => together,
        _ => larger(matrices[0][c][c].abs(), matrices[1][c][c]),
    })
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

/// Number of squarings in [`spectral_radius`]: its bound is then at most a hundredth too large for a symmetric matrix
/// of eight rows.
const SQUARINGS: usize = 6;

#[cfg(test)]
mod tests {
    use super::*;

    /// A linear profile on any cells has its own values at faces; an extremum has none but its own.
    #[test]
    fn linear_profiles_are_kept() {
        for [h, k] in [[1.0, 1.0], [0.3, 0.5], [2.0, 1.2]] {
            let [below, above] = increments([3.0 * h, 3.0 * k], [h, k], 0.0);
            assert!((below - 1.5 * h).abs() < 1e-14 && (above - 1.5 * k).abs() < 1e-14);
        }
        assert_eq!(increments([1.0, -1.0], [1.0, 1.0], 0.0), [0.0; 2]);
        assert_eq!(increments([0.0, 1.0], [1.0, 1.0], 0.0), [0.0; 2]);
        // beside a jump by a hundred
        assert_eq!(increments([-1.0, -100.0], [1.0, 1.0], 0.0), [-1.0, -2.0]);
    }

    /// A parabola has a smooth peak, a hat, a step and a plateau have none.
    #[test]
    fn smooth_peaks_are_told_from_others() {
        assert_eq!([[-2.0, -2.0, -2.0], [1.0, 1.9, 1.5]].map(smoothness), [1.0; 2]);
        for sharp in [[0.0, -2.0, 0.0], [1.0, -1.0, 0.0], [0.0; 3], [-1.0, -3.0, -1.0]] {
            assert!(smoothness(sharp) < 1e-9, "{sharp:?}");
        }
        let [below, above] = increments([1.0, -1.0], [1.0, 1.0], 1.0);
        assert_eq!((below, above), (1.0 / 6.0, -1.0 / 6.0));
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
