use crate::error::Failure;
use crate::geometry::{Lattice, check_length};

/// Passes of the filter (1 2 1)/4 along each axis over a nodal field
///
/// Sides repeat their own value (not mirrored, which would weigh the interior neighbour twice); periodic axes wrap.
///
/// # Errors
/// [`Failure::WrongLength`] where there is not one value a node.
///
/// # Example
/// ```
/// use driftmesh::{density::smooth, geometry::Lattice};
/// let mut spike = vec![0.0, 0.0, 0.0, 0.0, 16.0, 0.0, 0.0, 0.0, 0.0]; // 3 × 3 nodes
/// smooth(&Lattice::bounded([2, 2])?, &mut spike, 1)?;
/// assert_eq!(spike, [1.0, 2.0, 1.0, 2.0, 4.0, 2.0, 1.0, 2.0, 1.0]);
/// # Ok::<(), driftmesh::Error>(())
/// ```
pub fn smooth<const D: usize>(lattice: &Lattice<D>, values: &mut [f64], passes: usize) -> Result<(), Failure> {
    check_length(lattice, "what is smoothed", values.len())?;
    for axis in 0..D {
        along(lattice.nodes(), axis, values, Passes { wraps: lattice.periodic()[axis], passes });
    }
    Ok(())
}

/// Passes of the filter (1 2 1)/4 along each axis of a grid of cells, last axis fastest, at a cost that does not depend
/// on their number, which need not be whole
///
/// A pass adds ½ to the variance of the filter, in cells². More than [`MOST_PASSES`] are done on a grid of half as many
/// cells: a pass, the means of neighbours, the passes that are left there, their values back on the finer cells, and a
/// pass again. The filter keeps constants, the sum of all values and the sign of positive ones, and treats both ends
/// alike.
pub(super) fn smooth_widely<const D: usize>(
    size: [usize; D],
    periodic: [bool; D],
    values: &mut [f64],
    passes: [f64; D],
) {
    for axis in 0..D {
        along(size, axis, values, Spread { wraps: periodic[axis], passes: passes[axis] });
    }
}

/// Largest number of passes of the wide filter that are done on a grid itself; for more, a grid of half as many cells
/// takes over, on which at least three are left.
const MOST_PASSES: f64 = 15.0;
/// Smallest number of cells along an axis that is halved for the wide filter.
const FEWEST_HALVED: usize = 4;
/// Number of lines that are filtered side by side, so that all that is done to them is done within the cache. With half
/// as many, lines across memory cost up to twice the time on 512² cells.
const LANES: usize = 32;
/// Number of values of a line that are read at once where they are neighbours in memory: those that one fetch brings.
const PIECE: usize = 8;

/// The values at one place of L lines.
type Row<const L: usize> = [f64; L];

/// What is done to L lines side by side.
trait Filter {
    fn filter<const L: usize>(&self, lines: &mut [Row<L>]);
}

/// Passes of the filter (1 2 1)/4.
struct Passes {
    wraps: bool,
    passes: usize,
}

impl Filter for Passes {
    fn filter<const L: usize>(&self, lines: &mut [Row<L>]) {
        (0..self.passes).for_each(|_| pass(lines, self.wraps, 1.0));
    }
}

/// The wide filter.
struct Spread {
    wraps: bool,
    passes: f64,
}

impl Filter for Spread {
    fn filter<const L: usize>(&self, lines: &mut [Row<L>]) {
        spread(lines, self.wraps, self.passes);
    }
}

/// Filters all lines along an axis of a grid, [`LANES`] at a time, or the only one there is.
fn along<const D: usize>(size: [usize; D], axis: usize, values: &mut [f64], filter: impl Filter) {
    match values.len() == size[axis] {
        true => side_by_side::<D, 1>(size, axis, values, filter),
        false => side_by_side::<D, LANES>(size, axis, values, filter),
    }
}

fn side_by_side<const D: usize, const L: usize>(
    size: [usize; D],
    axis: usize,
    values: &mut [f64],
    filter: impl Filter,
) {
    let n = size[axis];
    let stride: usize = size[axis + 1..].iter().product();
    // lines that are runs in memory are read and written in pieces, others across
    let piece = if stride == 1 { PIECE } else { 1 };
    let count = values.len() / n;
    let mut lines = vec![[0.0; L]; n];
    for first in (0..count).step_by(L) {
        let lanes = L.min(count - first);
        let starts: [usize; L] = std::array::from_fn(|lane| {
            let line = first + lane;
            line / stride * stride * n + line % stride
        });
        let starts = &starts[..lanes];
        for (p, rows) in lines.chunks_mut(piece).enumerate() {
            for (lane, start) in starts.iter().enumerate() {
                for (i, row) in rows.iter_mut().enumerate() {
                    row[lane] = values[start + (p * piece + i) * stride];
                }
            }
        }
        filter.filter(&mut lines);
        for (p, rows) in lines.chunks(piece).enumerate() {
            for (lane, start) in starts.iter().enumerate() {
                for (i, row) in rows.iter().enumerate() {
                    values[start + (p * piece + i) * stride] = row[lane];
                }
            }
        }
    }
}

/// One pass (1 2 1)/4, or one with this share of its variance.
fn pass<const L: usize>(lines: &mut [Row<L>], wraps: bool, share: f64) {
    let (own, beside) = (4.0 / share - 2.0, 0.25 * share);
    let (first, last) = (lines[0], lines[lines.len() - 1]);
    let mut below = if wraps { last } else { first };
    for i in 0..lines.len() {
        let row = lines[i];
        let above = *lines.get(i + 1).unwrap_or(if wraps { &first } else { &row });
        lines[i] = std::array::from_fn(|k| beside * (below[k] + own * row[k] + above[k]));
        below = row;
    }
}

fn spread<const L: usize>(lines: &mut [Row<L>], wraps: bool, passes: f64) {
    let n = lines.len();
    if passes < MOST_PASSES || n < FEWEST_HALVED {
        // after 4 n² passes nothing but the mean is left along the axis
        let passes = passes.min((4 * n * n) as f64);
        (0..passes as usize).for_each(|_| pass(lines, wraps, 1.0));
        if passes.fract() > 0.0 {
            pass(lines, wraps, passes.fract());
        }
        return;
    }
    pass(lines, wraps, 1.0);
    let mut coarse = vec![[0.0; L]; n.div_ceil(2)];
    let ratio = n as f64 / coarse.len() as f64;
    average(lines, &mut coarse);
    // two passes here, and the means of `ratio` cells twice, each of variance (ratio² − 1)/12
    spread(&mut coarse, wraps, (passes - 2.0 - (ratio * ratio - 1.0) / 3.0) / (ratio * ratio));
    average(&coarse, lines);
    pass(lines, wraps, 1.0);
}

/// The mean over each cell of another grid along the same lines, values being constant in cells.
fn average<const L: usize>(from: &[Row<L>], to: &mut [Row<L>]) {
    let (n, m) = (from.len(), to.len());
    // in units of 1/(n m) of the axis, cell i is [i m, (i + 1) m] and cell j is [j n, (j + 1) n]
    let mut i = 0;
    for (j, to) in to.iter_mut().enumerate() {
        *to = [0.0; L];
        let (begin, end) = (j * n, (j + 1) * n);
        loop {
            let shared = ((i + 1) * m).min(end) - (i * m).max(begin);
            let weight = shared as f64 / n as f64;
            to.iter_mut().zip(&from[i]).for_each(|(to, from)| *to += weight * from);
            let over = (i + 1) * m;
            i += usize::from(over <= end);
            if over >= end {
                break;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// The wide filter keeps the mean, constants, the range and the reflection of any data, on grids of any size.
        #[test]
        fn the_wide_filter_keeps_mean_range_and_reflection(
            n in 2_usize..70, m in 2_usize..9, wraps: bool, passes in 0_usize..900, seed: u64,
        ) {
            let mut state = seed | 1;
            let data: Vec<f64> = (0..n * m).map(|_| {
                state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                1.0 + 1e6 * ((state >> 11) as f64 / (1_u64 << 53) as f64).powi(8)
            }).collect();
            let wide = |data: &[f64]| {
                let mut values = data.to_vec();
                smooth_widely([n, m], [wraps, false], &mut values, [passes as f64; 2]);
                values
            };
            let values = wide(&data);
            let [before, after] = [&data, &values].map(|v| v.iter().sum::<f64>());
            prop_assert!((after / before - 1.0).abs() < 1e-12);
            let most = data.iter().copied().fold(0.0, f64::max);
            prop_assert!(values.iter().all(|v| *v >= 1.0 - 1e-9 && *v <= most * (1.0 + 1e-12)));
            let mut reversed: Vec<f64> = data.iter().rev().copied().collect();
            reversed = wide(&reversed);
            reversed.reverse();
            prop_assert!(values.iter().zip(&reversed).all(|(a, b)| (a / b - 1.0).abs() < 1e-12));
        }
    }

    /// Where the grid is halved, a hot cell in the middle spreads as it does by the passes themselves, to a few
    /// hundredths of its largest value, and with the same variance.
    #[test]
    fn the_wide_filter_spreads_as_the_passes_do() {
        for (n, passes) in [(64, 19), (101, 49), (256, 312), (511, 1243)] {
            let mut direct = vec![0.0; n];
            direct[n / 2 - 3] = 1.0;
            let mut wide = direct.clone();
            smooth(&Lattice::bounded([n - 1]).unwrap(), &mut direct, passes).unwrap();
            smooth_widely([n], [false], &mut wide, [passes as f64]);
            let most = direct.iter().copied().fold(0.0, f64::max);
            let off = direct.iter().zip(&wide).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
            assert!(off < 0.06 * most, "{n} cells, {passes} passes: off by {off} of {most}");
            let moment =
                |v: &[f64], p: i32, c: f64| v.iter().enumerate().map(|(i, v)| v * (i as f64 - c).powi(p)).sum::<f64>();
            let variance = |v: &[f64]| moment(v, 2, moment(v, 1, 0.0));
            let ratio = variance(&wide) / variance(&direct);
            assert!((ratio - 1.0).abs() < 0.03, "{n} cells, {passes} passes: variances differ by {ratio}");
        }
    }
}
