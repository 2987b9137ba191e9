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
    smooth_values(lattice.nodes(), lattice.periodic(), values, passes);
}

/// The same over any grid of values, last axis fastest.
pub(super) fn smooth_values<const D: usize>(size: [usize; D], periodic: [bool; D], values: &mut [f64], passes: usize) {
    let mut source = Vec::with_capacity(values.len());
    for axis in (0..passes).flat_map(|_| 0..D) {
        source.clear();
        source.extend_from_slice(values);
        let (n, s) = (size[axis], size[axis + 1..].iter().product::<usize>());
        for (f, out) in source.chunks_exact(s * n).zip(values.chunks_exact_mut(s * n)) {
            let ends = if periodic[axis] { [n - 1, 0] } else { [0, n - 1] };
            let mut set = |i: usize, below: usize, above: usize| {
                let (f, b, a) =
                    (&f[i * s..(i + 1) * s], &f[below * s..(below + 1) * s], &f[above * s..(above + 1) * s]);
                for (((out, f), b), a) in out[i * s..(i + 1) * s].iter_mut().zip(f).zip(b).zip(a) {
                    *out = 0.25 * (b + 2.0 * f + a);
                }
            };
            for i in 0..n {
                set(i, if i == 0 { ends[0] } else { i - 1 }, if i + 1 == n { ends[1] } else { i + 1 });
            }
        }
    }
}
