use crate::geometry::Lattice;

/// Passes of the filter (1 2 1)⊗(1 2 1)/16 over a nodal field
///
/// Sides repeat their own value (not mirrored, which would weigh the interior neighbour twice); periodic axes wrap.
///
/// # Example
/// ```
/// use driftmesh::{density::smooth, geometry::Lattice};
/// let mut spike = vec![0.0, 0.0, 0.0, 0.0, 16.0, 0.0, 0.0, 0.0, 0.0]; // 3 × 3 nodes
/// smooth(&Lattice::bounded([2, 2])?, &mut spike, 1);
/// assert_eq!(spike, [1.0, 2.0, 1.0, 2.0, 4.0, 2.0, 1.0, 2.0, 1.0]);
/// # Ok::<(), driftmesh::Error>(())
/// ```
pub fn smooth<const D: usize>(lattice: &Lattice<D>, values: &mut [f64], passes: usize) {
    let mut source = Vec::with_capacity(values.len());
    for axis in (0..passes).flat_map(|_| 0..D) {
        let pencils = Pencils::of(lattice.nodes(), axis, lattice.periodic()[axis]);
        pencils.pass(values, &mut source, 1.0);
    }
}

/// So many passes of the filter (1 2 1)/4 along each axis of a grid of cells, last axis fastest, at a cost that does not
/// depend on their number, which need not be whole
///
/// A pass adds ½ to the variance of the filter, in cells². More than [`MOST_PASSES`] are done on a grid of half as many
/// cells: a pass, the means of neighbours, the passes that are left there, their values back on the finer cells, and a pass
/// again. The filter keeps constants, the sum of all values and the sign of positive ones, and treats both ends alike.
pub(super) fn smooth_widely<const D: usize>(
    size: [usize; D],
    periodic: [bool; D],
    values: &mut Vec<f64>,
    passes: [f64; D],
) {
    let mut source = Vec::with_capacity(values.len());
    for axis in 0..D {
        Pencils::of(size, axis, periodic[axis]).spread(values, &mut source, passes[axis]);
    }
}

/// With more passes a coarser grid takes over, on which at least three are left.
const MOST_PASSES: f64 = 15.0;
/// The fewest cells along an axis that are halved.
const FEWEST_HALVED: usize = 4;

/// A grid of values seen along one axis: blocks of `len` rows of `stride` values.
#[derive(Clone, Copy)]
struct Pencils {
    len: usize,
    stride: usize,
    wraps: bool,
}

impl Pencils {
    fn of<const D: usize>(size: [usize; D], axis: usize, wraps: bool) -> Self {
        Self { len: size[axis], stride: size[axis + 1..].iter().product(), wraps }
    }

    /// One pass (1 2 1)/4, or the share of it that has so much of its variance.
    fn pass(self, values: &mut [f64], source: &mut Vec<f64>, share: f64) {
        let Self { len: n, stride: s, wraps } = self;
        source.clear();
        source.extend_from_slice(values);
        let (own, beside) = (4.0 / share - 2.0, 0.25 * share);
        for (f, out) in source.chunks_exact(s * n).zip(values.chunks_exact_mut(s * n)) {
            let ends = if wraps { [n - 1, 0] } else { [0, n - 1] };
            let row = |i: usize| &f[i * s..(i + 1) * s];
            for (i, out) in out.chunks_exact_mut(s).enumerate() {
                let below = row(if i == 0 { ends[0] } else { i - 1 });
                let above = row(if i + 1 == n { ends[1] } else { i + 1 });
                for (((out, f), b), a) in out.iter_mut().zip(row(i)).zip(below).zip(above) {
                    *out = beside * (b + own * f + a);
                }
            }
        }
    }

    fn spread(self, values: &mut Vec<f64>, source: &mut Vec<f64>, passes: f64) {
        let n = self.len;
        if passes < MOST_PASSES || n < FEWEST_HALVED {
            // after 4 n² passes nothing but the mean is left along the axis
            let passes = passes.min((4 * n * n) as f64);
            (0..passes as usize).for_each(|_| self.pass(values, source, 1.0));
            if passes.fract() > 0.0 {
                self.pass(values, source, passes.fract());
            }
            return;
        }
        self.pass(values, source, 1.0);
        let half = Self { len: n.div_ceil(2), ..self };
        let ratio = n as f64 / half.len as f64;
        let mut coarse = self.onto(half, values);
        // two passes here, and the means of `ratio` cells twice, each of variance (ratio² − 1)/12
        let left = (passes - 2.0 - (ratio * ratio - 1.0) / 3.0) / (ratio * ratio);
        half.spread(&mut coarse, source, left);
        *values = half.onto(self, &coarse);
        self.pass(values, source, 1.0);
    }

    /// The mean over each cell of another grid along this axis, values being constant in cells.
    fn onto(self, other: Self, values: &[f64]) -> Vec<f64> {
        let (n, m, s) = (self.len, other.len, self.stride);
        let mut out = vec![0.0; values.len() / n * m];
        for (from, to) in values.chunks_exact(n * s).zip(out.chunks_exact_mut(m * s)) {
            for (j, to) in to.chunks_exact_mut(s).enumerate() {
                // in units of 1/(n m) of the axis, cell i is [i m, (i + 1) m] and cell j is [j n, (j + 1) n]
                for i in j * n / m..((j + 1) * n).div_ceil(m) {
                    let shared = ((i + 1) * m).min((j + 1) * n) - (i * m).max(j * n);
                    let weight = shared as f64 / n as f64;
                    to.iter_mut().zip(&from[i * s..(i + 1) * s]).for_each(|(to, from)| *to += weight * from);
                }
            }
        }
        out
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

    /// Where the grid is halved, a hot cell in the middle spreads as it does by the passes themselves, to a few hundredths of
    /// its largest value, and with the same variance.
    #[test]
    fn the_wide_filter_spreads_as_the_passes_do() {
        for (n, passes) in [(64, 19), (101, 49), (256, 312), (511, 1243)] {
            let mut direct = vec![0.0; n];
            direct[n / 2 - 3] = 1.0;
            let mut wide = direct.clone();
            smooth(&Lattice::bounded([n - 1]).unwrap(), &mut direct, passes);
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
