//! Corrections after an implicit step: residuals of Newton's method are spread over the nodes, and values beyond the
//! end of their range are set to it.

use super::Side;
use crate::geometry::{DualCells, Patch, strides};
use crate::numerics::sum;

/// Largest distance, in nodes along each axis, within which a node whose value is beyond its bound takes what it lacks
/// from others, before it takes it from all nodes.
const REACH: usize = 8;

/// Sets values that are beyond an end of their range, a lower and an upper one for each unknown, to that end, and takes
/// the amount that this adds from the nodes around, in proportion to what each has beyond the end: Σ A u is unchanged
///
/// Where a front leaves a node within a step, second-order steps in time go beyond the empty state by a share of what
/// was there, as for any function of time with a kink, and nothing diffuses back what is missing. Where the nodes
/// around have too little, those farther away are asked, up to [`REACH`] nodes, and at last all nodes; a lack that
/// these cannot fill either is left. Values that are given on sides stay.
///
/// # Source
/// Kucharik, Shashkov and Wendroff, *An efficient linearity-and-bound-preserving remapping method* (2003).
pub(super) fn repair<const B: usize, const D: usize>(
    cells: &DualCells<D>,
    sides: &[Side<B>],
    ends: &[[f64; 2]; B],
    values: &mut [[f64; B]],
) {
    for (c, ends) in ends.iter().enumerate() {
        for (&end, sign) in ends.iter().zip([1.0, -1.0]).filter(|(end, _)| end.is_finite()) {
            let room = |value: &[f64; B]| sign * (value[c] - end);
            if values.iter().all(|value| room(value) >= 0.0) {
                continue;
            }
            let mut is_given = vec![false; values.len()];
            sides.iter().for_each(|side| is_given[side.i] = side.given[c].is_some());
            let has = |value: &[f64; B], k: usize| if is_given[k] { 0.0 } else { cells.areas()[k] * room(value) };
            for i in (0..values.len()).filter(|&i| !is_given[i]) {
                let missing = -has(&values[i], i);
                if missing <= 0.0 {
                    continue;
                }
                let donors = |reach: usize| around(cells.patch(), i, reach).filter(|&k| has(&values[k], k) > 0.0);
                let of = |reach: usize| donors(reach).fold(0.0, |all, k| all + has(&values[k], k));
                let Some(reach) = (1..=REACH).find(|&reach| of(reach) >= missing) else { continue };
                let (share, donors) = (missing / of(reach), donors(reach).collect::<Vec<usize>>());
                donors.into_iter().for_each(|k| values[k][c] -= share * sign * room(&values[k]));
                values[i][c] = end;
            }
            // what is missing far from all that there is
            let of = |sign: f64| {
                let parts = values.iter().enumerate().map(|(k, value)| (sign * has(value, k)).max(0.0));
                sum(parts)
            };
            let (all, missing) = (of(1.0), of(-1.0));
            if missing > 0.0 && all >= missing {
                for (k, value) in values.iter_mut().enumerate().filter(|(k, _)| !is_given[*k]) {
                    let left = if has(value, k) > 0.0 { 1.0 - missing / all } else { 0.0 };
                    value[c] = end + left * (value[c] - end);
                }
            }
        }
    }
}

/// For each unknown without a flux through the sides, adds the integral of the remaining residual to the values, in
/// proportion to its magnitude at each node: sums are then conserved to round-off, whatever the tolerance of Newton's
/// method, and values stay that have no residual, such as a state that grows if anything is added to it.
pub(super) fn settle<const B: usize, const D: usize>(
    cells: &DualCells<D>,
    residual: &[[f64; B]],
    values: &mut [[f64; B]],
    closed: impl Fn(usize) -> bool,
) {
    let integral = |of: &dyn Fn(&[f64; B]) -> f64| {
        sum(cells.areas().iter().zip(residual).map(|(area, residual)| area * of(residual)))
    };
    for c in (0..B).filter(|&c| closed(c)) {
        let (left, all) = (integral(&|residual| residual[c]), integral(&|residual| residual[c].abs()));
        if all > 0.0 {
            values.iter_mut().zip(residual).for_each(|(value, residual)| value[c] += left / all * residual[c].abs());
        }
    }
}

/// The nodes at most `reach` away from a node along each axis, but that one.
fn around<const D: usize>(patch: &Patch<D>, i: usize, reach: usize) -> impl Iterator<Item = usize> {
    let (size, wraps, strides) = (patch.size, patch.wraps, strides(patch.size));
    let along: [usize; D] = std::array::from_fn(|d| i / strides[d] % size[d]);
    // an axis that wraps is gone round once at most
    let [below, above]: [[usize; D]; 2] = std::array::from_fn(|end| {
        std::array::from_fn(|d| match (wraps[d], end) {
            (true, 0) => reach.min((size[d] - 1) / 2),
            (true, _) => reach.min(size[d] / 2),
            (false, 0) => reach.min(along[d]),
            (false, _) => reach.min(size[d] - 1 - along[d]),
        })
    });
    let widths: [usize; D] = std::array::from_fn(|d| below[d] + above[d] + 1);
    (0..widths.iter().product()).filter_map(move |n| {
        let mut rest = n;
        let index = |d: usize| {
            let step = rest % widths[d];
            rest /= widths[d];
            (along[d] + size[d] + step - below[d]) % size[d] * strides[d]
        };
        let k = (0..D).map(index).sum();
        (k != i).then_some(k)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Lattice, Mesh};

    /// What is beyond an end is on it, Σ A u and what is given on sides stay, and nobody falls below the end.
    #[test]
    fn what_is_missing_is_taken_from_around() {
        let lattice = Lattice::new([6, 5], [false, true]).unwrap();
        let mesh = Mesh::uniform(lattice, [0.0; 2], [1.0; 2]).unwrap();
        let mesh = mesh.moved(mesh.x().iter().map(|[x, y]| [0.5 * x * (1.0 + x), *y]).collect()).unwrap();
        let cells = DualCells::new(&mesh);
        let sum = |u: &[[f64; 1]]| -> f64 { u.iter().zip(cells.areas()).map(|(u, area)| area * u[0]).sum() };
        let places: Vec<usize> = cells.patch().places().collect();
        let sides = [Side { i: 30, k: places[30], given: [Some(1.0)] }];
        for sign in [1.0, -1.0] {
            let mut u: Vec<[f64; 1]> = (0..35).map(|i| [sign * if i < 20 { 0.1 * i as f64 } else { 0.0 }]).collect();
            u[30] = [sign];
            u[20] = [-sign * 0.3];
            u[28] = [-sign * 0.01];
            let before = sum(&u);
            let end = if sign > 0.0 { [0.0, f64::INFINITY] } else { [f64::NEG_INFINITY, 0.0] };
            repair(&cells, &sides, &[end], &mut u);
            assert!((sum(&u) - before).abs() < 1e-15);
            assert!(u.iter().all(|[u]| sign * u >= 0.0) && u[30] == [sign]);
        }
    }

    /// A node far from all others that have something takes from every node; what exceeds the sum of all stays missing.
    #[test]
    fn what_nobody_has_is_left() {
        let mesh = Mesh::uniform(Lattice::bounded([20]).unwrap(), [0.0], [1.0]).unwrap();
        let (cells, ends) = (DualCells::new(&mesh), [[0.0, f64::INFINITY]]);
        let mut u = [[0.0]; 21];
        (u[1], u[2], u[19]) = ([0.5], [0.25], [-0.3]);
        repair(&cells, &[], &ends, &mut u);
        assert!((u[1][0] - 0.3).abs() < 1e-15 && (u[2][0] - 0.15).abs() < 1e-15 && u[19] == [0.0]);
        for lacking in [[[-1.0]; 21], std::array::from_fn(|i| [if i == 9 { 0.5 } else { -0.1 }])] {
            let mut left = lacking;
            repair(&cells, &[], &ends, &mut left);
            let sum = |u: &[[f64; 1]]| -> f64 { u.iter().zip(cells.areas()).map(|(u, area)| area * u[0]).sum() };
            assert!((sum(&left) - sum(&lacking)).abs() < 1e-15);
        }
    }
}
