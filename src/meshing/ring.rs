//! What Robin's conditions between overlapping subdomains need to know of their rings.

use super::overlap::{Part, place};
use crate::geometry::{Lattice, Patch};

/// A node on the ring of a part and the unknown before it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Trace {
    /// Across which axis, and whether at its upper end.
    pub axis: usize,
    pub upper: bool,
    /// The row of the unknown, and both places in padded vectors of the part.
    pub row: usize,
    pub ring: usize,
    pub inner: usize,
    /// The part that answers for the node on the ring, and both places there.
    pub other: usize,
    pub other_ring: usize,
    pub other_inner: usize,
    /// What the unknown draws from the ring.
    pub weight: f64,
}

/// What Robin's conditions need of the ring of a part.
pub(super) fn traces(part: &Part, parts: &[Part], owner: &[usize], lattice: &Lattice<2>) -> Vec<Trace> {
    let strides = part.patch.padded_strides();
    let mut all = Vec::new();
    for (node, axis, upper, along) in ring(&part.patch, lattice) {
        let Some(&other) = owner.get(node).filter(|&&other| other < parts.len()) else { continue };
        let last = part.patch.size[axis];
        let (mut at, step) = ([0; 2], if upper { -1 } else { 1 });
        at[axis] = if upper { last + 1 } else { 0 };
        at[1 - axis] = along + 1;
        let ring = at[0] * strides[0] + at[1] * strides[1];
        let inner = ring.wrapping_add_signed(step * strides[axis] as isize);
        let mut unknown = at.map(|i| i.wrapping_sub(1));
        unknown[axis] = if upper { last - 1 } else { 0 };
        let Some(other_ring) = place(&parts[other].patch, lattice, node, 0) else { continue };
        let other_strides = parts[other].patch.padded_strides();
        let other_inner = other_ring.wrapping_add_signed(step * other_strides[axis] as isize);
        let row = unknown[0] * part.patch.size[1] + unknown[1];
        all.push(Trace { axis, upper, row, ring, inner, other, other_ring, other_inner, weight: 0.0 });
    }
    all
}

/// Nodes of the ring around a patch, without its corners, each with the axis across which it lies, whether at the upper
/// end, and its place along the other axis; on a wrapping axis there is none.
pub(super) fn ring<'a>(
    patch: &'a Patch<2>,
    lattice: &'a Lattice<2>,
) -> impl Iterator<Item = (usize, usize, bool, usize)> + 'a {
    let nodes = lattice.nodes();
    let strides = lattice.strides();
    (0..2).filter(|&d| !patch.wraps[d]).flat_map(move |d| {
        let ends = [(patch.origin[d] + nodes[d] - 1, false), (patch.origin[d] + patch.size[d], true)];
        ends.into_iter().flat_map(move |(end, upper)| {
            (0..patch.size[1 - d]).map(move |k| {
                let across = end % nodes[d] * strides[d];
                let along = (patch.origin[1 - d] + k) % nodes[1 - d] * strides[1 - d];
                (across + along, d, upper, k)
            })
        })
    })
}
