//! Robin's conditions between overlapping subdomains: the nodes on the ring of each subdomain.

use super::overlap::{Part, place};
use crate::geometry::{Lattice, Patch};

/// A node on the ring of a part, with the unknown beside it inside the part.
#[derive(Debug, Clone, Copy)]
pub(super) struct Trace {
    /// The axis across which the ring lies there, and whether at its upper end.
    pub axis: usize,
    pub upper: bool,
    /// The row of the unknown, and the places of unknown and ring node in padded vectors of the part.
    pub row: usize,
    pub ring: usize,
    pub inner: usize,
    /// The part that owns the ring node, and the places of both nodes in its padded vectors.
    pub other: usize,
    pub other_ring: usize,
    pub other_inner: usize,
    /// The weight of the ring node in the row of the unknown.
    pub weight: f64,
}

/// All ring nodes of a part, for Robin's conditions.
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

/// The nodes of the ring around a patch, without its corners. Each comes with the axis across which it lies, whether at
/// the upper end, and its index along the other axis. There are none on a wrapping axis.
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
