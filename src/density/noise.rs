use crate::geometry::Lattice;

/// Share of all changes of what a mesh follows that goes up and down from node to node, as [`noise`] measures it, above
/// which a run warns that it follows noise.
pub const NOISE_WORTH_A_WARNING: f64 = 0.25;

/// Share of all that `values` change along lattice lines that the next edge takes back
///
/// ```text
/// Σ min(|a|, |b|) over neighbouring edges with changes a b < 0, over Σ |a| over all edges
/// ```
///
/// 0 for what rises or falls, about 2/n for waves of n cells, a third and more for random numbers, 1 for what
/// alternates. 0, too, along axes where fewer than a quarter of all pairs of neighbouring edges turn: a few spikes are
/// no noise.
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
    for d in 0..D {
        let (mut pairs, mut turns, mut undone) = (0_usize, 0_usize, 0.0);
        for k in 0..values.len() {
            let first_of_line = k - k / strides[d] % nodes[d] * strides[d];
            let at = |further: usize| {
                let i = k / strides[d] % nodes[d] + further;
                let i = if lattice.periodic()[d] { i % nodes[d] } else { i };
                (i < nodes[d]).then(|| values[first_of_line + i * strides[d]])
            };
            let Some(next) = at(1) else { continue };
            let change = next - values[k];
            all += change.abs();
            let Some(after) = at(2) else { continue };
            pairs += 1;
            if change * (after - next) < 0.0 {
                turns += 1;
                undone += change.abs().min((after - next).abs());
            }
        }
        if 4 * turns >= pairs {
            back += undone;
        }
    }
    if all > 0.0 { back / all } else { 0.0 }
}
