use crate::geometry::Lattice;

/// Share of what a mesh follows that goes up and down from node to node, above which a run says that it follows noise.
pub const NOISE_WORTH_A_WARNING: f64 = 0.25;

/// Share of all that `values` change along lattice lines that the next edge takes back
///
/// ```text
/// Σ min(|a|, |b|) over neighbouring edges with changes a b < 0, over Σ |a| over all edges
/// ```
///
/// 0 for what rises or falls, about 2/n for waves of n cells, a third and more for random numbers, 1 for what alternates.
///
/// # Example
/// ```
/// use driftmesh::{density::noise, geometry::Lattice};
/// let lattice = Lattice::new([8, 1], [true, true])?;
/// assert_eq!(noise(&lattice, &[0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0]), 1.0);
/// assert_eq!(noise(&lattice, &[0.0, 1.0, 2.0, 3.0, 4.0, 3.0, 2.0, 1.0]), 0.25);
/// # Ok::<(), driftmesh::Error>(())
/// ```
pub fn noise<const D: usize>(lattice: &Lattice<D>, values: &[f64]) -> f64 {
    let (nodes, strides) = (lattice.nodes(), lattice.strides());
    let (mut all, mut back) = (0.0, 0.0);
    for (k, value) in values.iter().enumerate() {
        let node = lattice.node(k);
        for d in 0..D {
            // how much the values change over the edge that begins so many nodes further on
            let change = |further: usize| {
                let place = |i: usize| match lattice.periodic()[d] {
                    true => Some(i % nodes[d]),
                    false => (i < nodes[d]).then_some(i),
                };
                let at = |i: usize| place(i).map(|i| values[k + i * strides[d] - node[d] * strides[d]]);
                Some(at(node[d] + further + 1)? - if further == 0 { *value } else { at(node[d] + further)? })
            };
            let Some(first) = change(0) else { continue };
            all += first.abs();
            if let Some(second) = change(1).filter(|second| first * second < 0.0) {
                back += first.abs().min(second.abs());
            }
        }
    }
    if all > 0.0 { back / all } else { 0.0 }
}
