//! Robin's conditions between overlapping subdomains: the nodes on the ring of each subdomain.

use super::decomposition::boxes;
use super::overlap::{Part, place};
use crate::geometry::{Lattice, Patch, strides};

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
pub(super) fn traces<const D: usize, const S: usize>(
    part: &Part<D, S>,
    parts: &[Part<D, S>],
    owner: &[usize],
    lattice: &Lattice<D>,
) -> Vec<Trace> {
    let (places, rows) = (part.patch.padded_strides(), strides(part.patch.size));
    let mut all = Vec::new();
    for Bound { node, axis, upper, inside } in ring(&part.patch, lattice) {
        let Some(&other) = owner.get(node).filter(|&&other| other < parts.len()) else { continue };
        let step = places[axis] as isize * if upper { -1 } else { 1 };
        let inner: usize = (0..D).map(|d| (inside[d] + 1) * places[d]).sum();
        let Some(other_ring) = place(&parts[other].patch, lattice, node, 0) else { continue };
        let other_step = parts[other].patch.padded_strides()[axis] as isize * step.signum();
        all.push(Trace {
            axis,
            upper,
            row: (0..D).map(|d| inside[d] * rows[d]).sum(),
            ring: inner.wrapping_add_signed(-step),
            inner,
            other,
            other_ring,
            other_inner: other_ring.wrapping_add_signed(other_step),
            weight: 0.0,
        });
    }
    all
}

/// A node of the ring around a patch.
pub(super) struct Bound<const D: usize> {
    pub node: usize,
    /// The axis across which the ring lies there, and whether at its upper end.
    pub axis: usize,
    pub upper: bool,
    /// The unknown beside it, counted from the first of the patch along each axis.
    pub inside: [usize; D],
}

/// The nodes of the ring around a patch, without its corners. There are none on a wrapping axis.
pub(super) fn ring<'a, const D: usize>(
    patch: &'a Patch<D>,
    lattice: &'a Lattice<D>,
) -> impl Iterator<Item = Bound<D>> + 'a {
    let nodes = lattice.nodes();
    (0..D).filter(|&d| !patch.wraps[d]).flat_map(move |axis| {
        [false, true].into_iter().flat_map(move |upper| {
            let mut along = patch.size;
            along[axis] = 1;
            boxes(along).map(move |mut inside| {
                inside[axis] = if upper { patch.size[axis] - 1 } else { 0 };
                let mut at: [usize; D] = std::array::from_fn(|d| patch.origin[d] + inside[d] + nodes[d]);
                at[axis] = if upper { at[axis] + 1 } else { at[axis] - 1 };
                let node = lattice.index(std::array::from_fn(|d| at[d] % nodes[d]));
                Bound { node, axis, upper, inside }
            })
        })
    })
}
