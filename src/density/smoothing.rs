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
    let (nodes, strides) = (lattice.nodes(), lattice.strides());
    let mut source = Vec::with_capacity(values.len());
    for axis in (0..passes).flat_map(|_| 0..D) {
        source.clear();
        source.extend_from_slice(values);
        let (n, s) = (nodes[axis], strides[axis]);
        for (f, out) in source.chunks_exact(s * n).zip(values.chunks_exact_mut(s * n)) {
            let ends = if lattice.periodic()[axis] { [n - 1, 0] } else { [0, n - 1] };
            let mut set = |i: usize, below: usize, above: usize| {
                let (f, b, a) =
                    (&f[i * s..(i + 1) * s], &f[below * s..(below + 1) * s], &f[above * s..(above + 1) * s]);
                for (((out, f), b), a) in out[i * s..(i + 1) * s].iter_mut().zip(f).zip(b).zip(a) {
                    *out = 0.25 * (b + 2.0 * f + a);
                }
            };
            set(0, ends[0], 1);
            (1..n - 1).for_each(|i| set(i, i - 1, i + 1));
            set(n - 1, n - 2, ends[1]);
        }
    }
}
