use crate::error::{Error, Result};
use std::borrow::Cow;

/// The logically rectangular set of nodes of the computational domain [0, 1]^D
///
/// ```text
/// ξ_i = i h,   h = 1 / cells,   i = 0 … cells (bounded axis)   or   0 … cells − 1 (periodic axis)
/// ```
///
/// Nodal values are stored with the *last* axis fastest: node (i, j) has index `i * nodes[1] + j`, so that an array of
/// shape (nodes\[0\], nodes\[1\]) in C order has its first index along ξ.
///
/// # Example
/// ```
/// let lattice = driftmesh::geometry::Lattice::bounded([40, 20])?;
/// assert_eq!(lattice.nodes(), [41, 21]);
/// assert_eq!(lattice.index([1, 2]), 23);
/// # Ok::<(), driftmesh::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Lattice<const D: usize> {
    cells: [usize; D],
    periodic: [bool; D],
}

impl<const D: usize> Lattice<D> {
    /// A lattice of `cells` cells an axis.
    ///
    /// # Errors
    /// [`Error::Invalid`] where a bounded axis has fewer than two cells (second-order differences at a side need three
    /// nodes) or a periodic one has none, or where the number of nodes does not fit the address space.
    pub fn new(cells: [usize; D], periodic: [bool; D]) -> Result<Self> {
        let rule = if cells.iter().zip(periodic).any(|(&n, wraps)| n < if wraps { 1 } else { 2 }) {
            Some("every axis needs at least 2 cells, or 1 where it is periodic")
        } else if cells.iter().try_fold(1_usize, |all, &n| all.checked_mul(n.checked_add(3)?)).is_none() {
            Some("so many nodes cannot be counted; lower it")
        } else {
            None
        };
        match rule {
            Some(rule) => Err(Error::invalid("cells", format!("{cells:?}"), rule)),
            None => Ok(Self { cells, periodic }),
        }
    }

    /// A lattice with no periodic axis.
    ///
    /// # Errors
    /// As [`Lattice::new`].
    pub fn bounded(cells: [usize; D]) -> Result<Self> {
        Self::new(cells, [false; D])
    }

    /// Cells along each axis.
    pub fn cells(&self) -> [usize; D] {
        self.cells
    }

    /// Which axes wrap around.
    pub fn periodic(&self) -> [bool; D] {
        self.periodic
    }

    /// Distinct nodes along each axis.
    pub fn nodes(&self) -> [usize; D] {
        std::array::from_fn(|d| self.cells[d] + usize::from(!self.periodic[d]))
    }

    /// Number of nodes.
    #[allow(clippy::len_without_is_empty)] // a lattice is never empty
    pub fn len(&self) -> usize {
        self.nodes().iter().product()
    }

    /// Lattice spacing h along each axis.
    pub fn spacing(&self) -> [f64; D] {
        self.cells.map(|n| 1.0 / n as f64)
    }

    /// Distance in memory between neighbours along each axis.
    pub fn strides(&self) -> [usize; D] {
        strides(self.nodes())
    }

    /// Indices of all nodes of the array of shape cells + 1, in which a periodic axis repeats its first node.
    pub(super) fn closed_nodes(&self) -> impl Iterator<Item = [usize; D]> + use<D> {
        let size = self.cells.map(|n| n + 1);
        let strides = strides(size);
        (0..size.iter().product()).map(move |k| std::array::from_fn(|d| k / strides[d] % size[d]))
    }

    /// Nodal values with the closing nodes of periodic axes appended: an array of shape cells + 1.
    pub fn closed<'a, T: Copy>(&self, values: &'a [T]) -> Cow<'a, [T]> {
        let nodes = self.nodes();
        if self.periodic.iter().all(|p| !p) {
            return Cow::Borrowed(values);
        }
        Cow::Owned(
            self.closed_nodes().map(|node| values[self.index(std::array::from_fn(|d| node[d] % nodes[d]))]).collect(),
        )
    }

    /// Whether a node stands on the bounded side at the lower and at the upper end of each axis.
    pub fn beyond(&self, index: usize) -> [[bool; 2]; D] {
        let (node, nodes) = (self.node(index), self.nodes());
        std::array::from_fn(|d| [node[d] == 0, node[d] + 1 == nodes[d]].map(|at_end| at_end && !self.periodic[d]))
    }

    /// True for a node on a bounded side.
    pub fn on_side(&self, index: usize) -> bool {
        self.beyond(index).as_flattened().contains(&true)
    }

    /// Positions in memory of all nodes on bounded sides, axis by axis; a corner comes once for each of its sides.
    ///
    /// # Example
    /// ```
    /// let lattice = driftmesh::geometry::Lattice::new([2, 2], [false, true])?; // 3 × 2 nodes
    /// assert_eq!(lattice.sides().collect::<Vec<_>>(), [0, 1, 4, 5]);
    /// # Ok::<(), driftmesh::Error>(())
    /// ```
    pub fn sides(&self) -> impl Iterator<Item = usize> + use<D> {
        let (lattice, periodic) = (*self, self.periodic);
        (0..D).filter(move |&d| !periodic[d]).flat_map(move |d| (0..2).flat_map(move |end| lattice.side(d, end)))
    }

    /// Positions in memory of the nodes at the lower (0) or the upper (1) end of an axis.
    pub fn side(&self, axis: usize, end: usize) -> impl Iterator<Item = usize> + use<D> {
        let (n, s) = (self.nodes()[axis], self.strides()[axis]);
        let first = end * s * (n - 1);
        (0..self.len() / (s * n)).flat_map(move |block| (0..s).map(move |k| block * s * n + first + k))
    }

    /// Position in memory of a node.
    pub fn index(&self, node: [usize; D]) -> usize {
        node.iter().zip(self.strides()).map(|(i, s)| i * s).sum()
    }

    /// The node at a position in memory.
    pub fn node(&self, index: usize) -> [usize; D] {
        let nodes = self.nodes();
        let strides = self.strides();
        std::array::from_fn(|d| index / strides[d] % nodes[d])
    }
}

/// A diagonal matrix: what x jumps by on a turn around each axis, from the periods.
pub(crate) fn diagonal<const D: usize>(values: [f64; D]) -> [[f64; D]; D] {
    std::array::from_fn(|d| std::array::from_fn(|c| if c == d { values[d] } else { 0.0 }))
}

/// Strides of a box of nodes, last axis fastest.
pub(crate) fn strides<const D: usize>(size: [usize; D]) -> [usize; D] {
    let mut strides = [1; D];
    for d in (0..D.saturating_sub(1)).rev() {
        strides[d] = strides[d + 1] * size[d + 1];
    }
    strides
}
