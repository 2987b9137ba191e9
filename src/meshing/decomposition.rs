use crate::error::{Error, Result};
use crate::geometry::{Lattice, Patch, strides};

/// A division of the lattice into S_ξ × S_η subdomains, on a line into S of them
///
/// Cuts are lines of nodes, spaced as evenly as the cells allow: at s·cells/S, rounded. On a bounded axis S subdomains
/// have S − 1 cuts between them. On a periodic axis they have S cuts, the first of them at node 0; a single subdomain
/// has none and wraps.
///
/// # Example
/// ```
/// use driftmesh::{geometry::Lattice, meshing::Decomposition};
/// let lattice = Lattice::bounded([40, 40])?;
/// let decomposition = Decomposition::new(&lattice, [4, 4])?;
/// assert_eq!(decomposition.points().len(), 225); // 2 × 3 cuts of 39 nodes, less the 9 crossings
/// assert_eq!(decomposition.patches().len(), 16);
/// # Ok::<(), driftmesh::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct Decomposition<const D: usize = 2> {
    lattice: Lattice<D>,
    /// The first and the last node of the subdomains along each axis.
    spans: [Vec<[usize; 2]>; D],
}

/// A line of nodes between subdomains.
#[derive(Debug, Clone, PartialEq)]
pub struct Cut {
    /// The axis along which it runs.
    pub along: usize,
    /// Its nodes in order, with those on bounded sides.
    pub nodes: Vec<usize>,
}

impl<const D: usize> Decomposition<D> {
    /// Divides a lattice.
    ///
    /// # Errors
    /// [`Error::Invalid`] unless every axis has at least one subdomain and no more than cells.
    pub fn new(lattice: &Lattice<D>, subdomains: [usize; D]) -> Result<Self> {
        let cells = lattice.cells();
        if (0..D).any(|d| !(1..=cells[d]).contains(&subdomains[d])) {
            let rule = format!("every axis needs at least 1 subdomain and at most one a cell, here {cells:?}");
            return Err(Error::invalid("subdomains", format!("{subdomains:?}"), rule));
        }
        let spans = std::array::from_fn(|d| {
            let (n, s) = (cells[d], subdomains[d]);
            let end = |k: usize| (2 * k * n + s) / (2 * s);
            (0..s).map(|k| [end(k), end(k + 1)]).collect()
        });
        Ok(Self { lattice: *lattice, spans })
    }

    /// The lattice that is divided.
    pub fn lattice(&self) -> &Lattice<D> {
        &self.lattice
    }

    /// Whether there are cuts across an axis.
    pub fn is_divided(&self, d: usize) -> bool {
        self.spans[d].len() > 1
    }

    /// Cells of the narrowest subdomain along axes with cuts; the largest number there is where there are no cuts.
    pub fn narrowest(&self) -> usize {
        let divided = self.spans.iter().filter(|spans| spans.len() > 1).flatten();
        divided.map(|[low, high]| high - low).min().unwrap_or(usize::MAX)
    }

    /// Whether a single subdomain fills a periodic axis.
    fn wraps(&self, d: usize) -> bool {
        self.lattice.periodic()[d] && self.spans[d].len() == 1
    }

    /// The cuts across one axis, as node indices along it.
    fn cuts(&self, d: usize) -> impl Iterator<Item = usize> {
        let none = self.spans[d].len() == 1;
        let first = if self.lattice.periodic()[d] && !none { 0 } else { 1 };
        self.spans[d].iter().skip(first).map(|span| span[0])
    }

    /// All nodes on cuts in ascending order, without those on bounded sides.
    pub fn points(&self) -> Vec<usize> {
        let cuts: [Vec<usize>; D] = std::array::from_fn(|d| self.cuts(d).collect());
        let on_cut = |k: &usize| self.lattice.node(*k).iter().zip(&cuts).any(|(i, cuts)| cuts.contains(i));
        (0..self.lattice.len()).filter(|k| on_cut(k) && !self.on_side(*k)).collect()
    }

    /// Whether a node stands on a bounded side.
    pub fn on_side(&self, index: usize) -> bool {
        let (node, nodes, periodic) = (self.lattice.node(index), self.lattice.nodes(), self.lattice.periodic());
        (0..D).any(|d| !periodic[d] && (node[d] == 0 || node[d] + 1 == nodes[d]))
    }

    /// The unknowns of all subdomains; a subdomain of a single cell has none and is left out.
    pub fn patches(&self) -> Vec<Patch<D>> {
        self.extended([0, 0]).into_iter().map(|(patch, _)| patch).collect()
    }

    /// All subdomains, enlarged along each axis by `more[0]` cells downwards and `more[1]` upwards as far as there are
    /// nodes. Each comes with the nodes that it owns: those above its lower cut up to its upper one.
    pub fn extended(&self, more: [usize; 2]) -> Vec<(Patch<D>, Vec<usize>)> {
        let spans = boxes(std::array::from_fn(|d| self.spans[d].len()));
        let all = spans.map(|number: [usize; D]| self.one(std::array::from_fn(|d| self.spans[d][number[d]]), more));
        all.filter(|(patch, _)| patch.len() > 0).collect()
    }

    /// The subdomain with the given first and last nodes, enlarged, and the nodes that it owns.
    fn one(&self, spans: [[usize; 2]; D], more: [usize; 2]) -> (Patch<D>, Vec<usize>) {
        let (cells, nodes, periodic) = (self.lattice.cells(), self.lattice.nodes(), self.lattice.periodic());
        let wraps = std::array::from_fn(|d| self.wraps(d));
        let mut patch = Patch { origin: [0; D], size: cells, wraps };
        let mut own: [Vec<usize>; D] = std::array::from_fn(|d| (0..nodes[d]).collect());
        for (d, [low, high]) in spans.into_iter().enumerate().filter(|&(d, _)| !wraps[d]) {
            let n = cells[d];
            let (from, to) = if periodic[d] {
                // on a short periodic axis both rings may be the same node, but a patch never overlaps itself, and it
                // holds its upper cut
                let spare = n - (high - low);
                let down = more[0].min(spare / 2);
                (low + n - down, high + n + more[1].min(spare - down))
            } else {
                (low.saturating_sub(more[0]), (high + more[1]).min(n))
            };
            patch.size[d] = to - from - 1;
            patch.origin[d] = (from + 1) % n;
            let last = if periodic[d] || high < n { high } else { n - 1 };
            own[d] = (low + 1..=last).map(|i| i % nodes[d]).collect();
        }
        let node = |i: [usize; D]| self.lattice.index(std::array::from_fn(|d| own[d][i[d]]));
        let nodes = boxes(std::array::from_fn(|d| own[d].len())).map(node).collect();
        (patch, nodes)
    }
}

impl Decomposition {
    /// All cuts, those across ξ first.
    pub fn lines(&self) -> Vec<Cut> {
        let nodes = self.lattice.nodes();
        let mut lines = Vec::new();
        for across in 0..2 {
            let along = 1 - across;
            for at in self.cuts(across) {
                let node = |k: usize| if across == 0 { [at, k] } else { [k, at] };
                lines.push(Cut { along, nodes: (0..nodes[along]).map(|k| self.lattice.index(node(k))).collect() });
            }
        }
        lines
    }

    /// The number of the subdomain that each cell lies in, in lattice order. Subdomains are numbered with the second
    /// axis fastest.
    pub fn of_cells(&self) -> Vec<usize> {
        let number = |d: usize, cell: usize| self.spans[d].iter().position(|span| cell < span[1]).unwrap_or(0);
        let [n, m] = self.lattice.cells();
        let across: Vec<usize> = (0..m).map(|j| number(1, j)).collect();
        (0..n)
            .flat_map(|i| across.iter().map(move |b| (i, b)))
            .map(|(i, b)| number(0, i) * self.spans[1].len() + b)
            .collect()
    }
}

/// All places in a box of so many, with the last axis fastest.
pub(super) fn boxes<const D: usize>(size: [usize; D]) -> impl Iterator<Item = [usize; D]> {
    let strides = strides(size);
    (0..size.iter().product()).map(move |k| std::array::from_fn(|d| k / strides[d] % size[d]))
}
