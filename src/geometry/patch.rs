use super::{Lattice, strides};

/// A box of unknown nodes with a ring of known ones around it
///
/// Mesh equations are solved patch by patch. Vectors over a patch are *padded*: they also hold the ring, so that a
/// stencil never has to ask whether a neighbour exists. Along an axis with `wraps` the ring holds images of the
/// opposite nodes; along another one it holds given values, on a side of the domain or on an interface between
/// subdomains.
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

    /// Distance in a padded vector between neighbours along each axis.
    pub fn padded_strides(&self) -> [usize; D] {
        strides(self.size.map(|n| n + 2))
    }

    /// Whether a place of a padded vector is that of an unknown with another one, or an image, above it along an axis.
    pub fn has_face(&self, place: usize, axis: usize) -> bool {
        let strides = self.padded_strides();
        (0..D).all(|d| {
            let along = place / strides[d] % (self.size[d] + 2);
            let last = if d == axis && !self.wraps[d] { self.size[d] - 1 } else { self.size[d] };
            (1..=last).contains(&along)
        })
    }

    /// Whether a place of a padded vector is that of an unknown, not one of the ring.
    pub fn is_unknown(&self, place: usize) -> bool {
        let strides = self.padded_strides();
        (0..D).all(|d| (1..=self.size[d]).contains(&(place / strides[d] % (self.size[d] + 2))))
    }

    /// Unknowns along the last axis: the length of a [pencil](Self::pencils).
    pub fn pencil_len(&self) -> usize {
        self.size[D - 1]
    }

    /// Number of pencils.
    pub fn pencil_count(&self) -> usize {
        self.size[..D - 1].iter().product()
    }

    /// The start, in a padded vector, of the p-th pencil, which is a run of unknowns along the last axis.
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

    /// The pencil in the q-th row of a padded vector that is cut into rows of `pencil_len() + 2`; none in rows of the
    /// ring.
    pub fn pencil_in_row(&self, q: usize) -> Option<usize> {
        let (mut rest, mut pencil, mut stride) = (q, 0, 1);
        for d in (0..D - 1).rev() {
            let place = rest % (self.size[d] + 2);
            if !(1..=self.size[d]).contains(&place) {
                return None;
            }
            pencil += (place - 1) * stride;
            stride *= self.size[d];
            rest /= self.size[d] + 2;
        }
        Some(pencil)
    }

    /// The starts of all pencils in a padded vector.
    pub fn pencils(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.pencil_count()).map(|p| self.pencil(p))
    }

    /// Nodal values as a padded vector with its ring; `jump[d]` is added on wrapping around axis d.
    pub fn gather<const K: usize>(
        &self,
        lattice: &Lattice<D>,
        values: &[[f64; K]],
        jump: [[f64; K]; D],
    ) -> Vec<[f64; K]> {
        if (self.origin, self.size.map(|n| n + 2)) == ([1; D], lattice.nodes()) {
            return values.to_vec(); // all of a bounded lattice
        }
        let mut padded = Vec::with_capacity(self.padded_len());
        self.for_each_padded(lattice, |index, turns| {
            let mut value = values[index];
            if turns != [0; D] {
                for (turns, jump) in turns.iter().zip(jump) {
                    (0..K).for_each(|c| value[c] += f64::from(*turns) * jump[c]);
                }
            }
            padded.push(value);
        });
        padded
    }

    /// Calls `visit(index of the node, turns around each axis)` for every place of a padded vector, in order.
    fn for_each_padded(&self, lattice: &Lattice<D>, mut visit: impl FnMut(usize, [i32; D])) {
        let (nodes, strides) = (lattice.nodes(), lattice.strides());
        let mut place = [0; D];
        loop {
            let mut index = 0;
            let mut turns = [0; D];
            for d in 0..D {
                // a period is added, so that the ring below the origin has no negative index
                let i = self.origin[d] + nodes[d] + place[d] - 1;
                index += i % nodes[d] * strides[d];
                turns[d] = (i / nodes[d]) as i32 - 1;
            }
            visit(index, turns);
            let mut d = D - 1;
            while place[d] == self.size[d] + 1 {
                place[d] = 0;
                if d == 0 {
                    return;
                }
                d -= 1;
            }
            place[d] += 1;
        }
    }

    /// Indices of the nodes of the unknowns, last axis fastest.
    pub fn nodes(&self, lattice: &Lattice<D>) -> impl Iterator<Item = usize> {
        self.entries(lattice).map(|(node, _)| node)
    }

    /// For each unknown its node, and along which axes it lies beyond the end of the lattice, one period from that
    /// node.
    pub fn entries(&self, lattice: &Lattice<D>) -> impl Iterator<Item = (usize, [bool; D])> {
        let (strides, nodes, last) = (lattice.strides(), lattice.nodes(), D - 1);
        (0..self.pencil_count()).flat_map(move |p| {
            let mut rest = p;
            let (mut first, mut beyond) = (0, [false; D]);
            for d in (0..last).rev() {
                let i = rest % self.size[d] + self.origin[d];
                beyond[d] = i >= nodes[d];
                first += if beyond[d] { i - nodes[d] } else { i } * strides[d];
                rest /= self.size[d];
            }
            (self.origin[last]..self.origin[last] + self.size[last]).map(move |j| {
                let mut beyond = beyond;
                beyond[last] = j >= nodes[last];
                (first + if beyond[last] { j - nodes[last] } else { j }, beyond)
            })
        })
    }

    /// Places of the unknowns in a padded vector, last axis fastest.
    pub fn places(&self) -> impl Iterator<Item = usize> {
        self.pencils().flat_map(|start| start..start + self.pencil_len())
    }

    /// Writes the unknowns of a padded vector back to their nodes: the inverse of [`gather`](Self::gather).
    pub fn scatter<const K: usize>(
        &self,
        lattice: &Lattice<D>,
        padded: &[[f64; K]],
        values: &mut [[f64; K]],
        jump: [[f64; K]; D],
    ) {
        if (self.origin, self.size.map(|n| n + 2)) == ([1; D], lattice.nodes()) {
            // all of a bounded lattice: runs of nodes are runs of places
            for start in self.pencils() {
                values[start..start + self.pencil_len()].copy_from_slice(&padded[start..start + self.pencil_len()]);
            }
            return;
        }
        for ((node, beyond), place) in self.entries(lattice).zip(self.places()) {
            values[node] = padded[place];
            for d in (0..D).filter(|&d| beyond[d]) {
                (0..K).for_each(|c| values[node][c] -= jump[d][c]);
            }
        }
    }

    /// Copies the images of wrapping axes into the ring of a vector, without adding a jump; the rest of the ring stays.
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
