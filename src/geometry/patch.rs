use super::{Lattice, strides};

/// A box of unknown nodes with a ring of known ones around it
///
/// The unit in which mesh equations are solved. Vectors over a patch are *padded*: they hold the ring too, so that a
/// stencil never asks whether a neighbour exists. What the ring means depends on the axis: given values (a side of the
/// domain, an interface between subdomains), or, where `wraps` is set, images of the opposite nodes.
///
/// The same type serves the whole domain, one subdomain of many, and one side of the domain (D = 1).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Patch<const D: usize> {
    /// Lattice node of the first unknown.
    pub origin: [usize; D],
    /// Unknowns along each axis.
    pub size: [usize; D],
    /// Axes whose ring is the image of the opposite end.
    pub wraps: [bool; D],
}

impl<const D: usize> Patch<D> {
    /// All nodes of a lattice that are not on a bounded side.
    pub fn whole(lattice: &Lattice<D>) -> Self {
        let (cells, wraps) = (lattice.cells(), lattice.periodic());
        Self {
            origin: std::array::from_fn(|d| usize::from(!wraps[d])),
            size: std::array::from_fn(|d| cells[d] - usize::from(!wraps[d])),
            wraps,
        }
    }

    /// Number of unknowns.
    #[allow(clippy::len_without_is_empty)] // a patch of a lattice is never empty
    pub fn len(&self) -> usize {
        self.size.iter().product()
    }

    /// Length of a padded vector.
    pub fn padded_len(&self) -> usize {
        self.size.iter().map(|n| n + 2).product()
    }

    /// How far apart in a padded vector two neighbours along each axis are.
    pub fn padded_strides(&self) -> [usize; D] {
        strides(self.size.map(|n| n + 2))
    }

    /// Unknowns along the last axis: the length of a [pencil](Self::pencils).
    pub fn pencil_len(&self) -> usize {
        self.size[D - 1]
    }

    /// Number of pencils.
    pub fn pencil_count(&self) -> usize {
        self.size[..D - 1].iter().product()
    }

    /// Where the p-th run of unknowns along the last axis starts in a padded vector.
    pub fn pencil(&self, p: usize) -> usize {
        let strides = self.padded_strides();
        let mut rest = p;
        let mut start = 1;
        for d in (0..D - 1).rev() {
            start += (rest % self.size[d] + 1) * strides[d];
            rest /= self.size[d];
        }
        start
    }

    /// All runs of unknowns along the last axis, as starts in a padded vector.
    pub fn pencils(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.pencil_count()).map(|p| self.pencil(p))
    }

    /// Gathers nodal values into a padded vector, ring included; `jump[d]` is added on wrapping around axis d.
    pub fn gather<const K: usize>(&self, lattice: &Lattice<D>, values: &[[f64; K]], jump: [[f64; K]; D]) -> Vec<[f64; K]> {
        let nodes = lattice.nodes();
        let node_strides = lattice.strides();
        let strides = self.padded_strides();
        (0..self.padded_len())
            .map(|k| {
                let mut index = 0;
                let mut offset = [0.0; K];
                for d in 0..D {
                    // position on the lattice, shifted by one period so that the ring below the origin is not negative
                    let i = self.origin[d] + nodes[d] + k / strides[d] % (self.size[d] + 2) - 1;
                    index += i % nodes[d] * node_strides[d];
                    let turns = (i / nodes[d]) as f64 - 1.0;
                    if turns != 0.0 {
                        for c in 0..K {
                            offset[c] += turns * jump[d][c];
                        }
                    }
                }
                std::array::from_fn(|c| values[index][c] + offset[c])
            })
            .collect()
    }

    /// Writes the unknowns of a padded vector back to their nodes.
    pub fn scatter<T: Copy>(&self, lattice: &Lattice<D>, padded: &[T], values: &mut [T]) {
        let node_strides = lattice.strides();
        let n = self.pencil_len();
        for (p, start) in self.pencils().enumerate() {
            let mut rest = p;
            let mut index = self.origin[D - 1];
            for d in (0..D - 1).rev() {
                index += (rest % self.size[d] + self.origin[d]) * node_strides[d];
                rest /= self.size[d];
            }
            values[index..index + n].copy_from_slice(&padded[start..start + n]);
        }
    }

    /// Copies the images of wrapping axes into the ring of a vector without a jump; other rings stay.
    pub fn wrap<T: Copy>(&self, padded: &mut [T]) {
        let strides = self.padded_strides();
        for d in (0..D).filter(|&d| self.wraps[d]) {
            let (n, s) = (self.size[d], strides[d]);
            for block in padded.chunks_exact_mut(s * (n + 2)) {
                block.copy_within(s * n..s * (n + 1), 0);
                block.copy_within(s..2 * s, s * (n + 1));
            }
        }
    }
}
