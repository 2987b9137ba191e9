use super::curved::Curved;
use super::quality::{cross, minus};
use super::{Cells, Lattice, Mesh, Patch};
use crate::parallel;

/// Finite-volume geometry of a mesh: the dual cell of every node
///
/// ```text
/// c_ij = ¼ (x_ij + x_{i+1,j} + x_{i,j+1} + x_{i+1,j+1})
/// dual cell of node (i, j): c_{i−1,j−1}, c_{i,j−1}, c_ij, c_{i−1,j}
/// face to (i+1, j):  t = c_ij − c_{i,j−1},      face to (i, j+1):  t = c_{i−1,j} − c_ij,      N = (t_y, −t_x)
/// ```
///
/// N points to the node above and is as long as the face. The cells tile the box. Beyond a bounded side its own nodes
/// are repeated, so that the cell centres there are the middles of its edges: nodes on a side have half cells, corners
/// quarters, and the outermost faces lie on the side. In a domain with a chart the middles are those of the unit box,
/// faces are as curved as mesh lines, and the outermost ones follow the curve of the side.
///
/// A face is stored with the node below it, in arrays padded like those of [`patch`](Self::patch). Images on periodic
/// axes are equal to the last bit, so that what leaves one cell enters the next.
///
/// # Example
/// ```
/// use driftmesh::geometry::{DualCells, Lattice, Mesh};
/// let mesh = Mesh::uniform(Lattice::bounded([2, 2])?, [0.0, 0.0], [2.0, 4.0])?;
/// // cells of 1 × 2: a corner has a quarter, a side node half, the node in the middle a whole one
/// assert_eq!(DualCells::new(&mesh).areas()[..5], [0.5, 1.0, 0.5, 1.0, 2.0]);
/// # Ok::<(), driftmesh::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct DualCells<const D: usize = 2> {
    pub(super) patch: Patch<D>,
    pub(super) centres: Vec<[f64; D]>,
    pub(super) normals: Vec<[[f64; D]; D]>,
    pub(super) areas: Vec<f64>,
    /// In a domain with a chart only.
    pub(super) curved: Option<Curved>,
}

impl<const D: usize> DualCells<D> {
    /// The dual cells of a mesh.
    pub fn new(mesh: &Mesh<D>) -> Self
    where
        Mesh<D>: Cells<D>,
    {
        mesh.dual_cells()
    }

    /// The patch of all nodes, those on bounded sides included.
    pub fn patch(&self) -> &Patch<D> {
        &self.patch
    }

    /// Areas of the cells, in lattice order; lengths in one dimension.
    pub fn areas(&self) -> &[f64] {
        &self.areas
    }

    /// N of the face above each node along each axis, padded; in one dimension 1.
    pub fn normals(&self) -> &[[[f64; D]; D]] {
        &self.normals
    }

    /// The middle of the face above a place along an axis; `x` are the positions of the nodes, padded.
    pub fn middle(&self, x: &[[f64; D]], place: usize, axis: usize) -> [f64; D] {
        let strides = self.patch.padded_strides();
        let [a, b] = match D {
            1 => [&x[place], &x[place + 1]],
            // from the centre of one of the cells on both sides of the edge to that of the other
            _ => [&self.centres[place], &self.centres[place - strides[1 - axis]]],
        };
        std::array::from_fn(|d| 0.5 * (a[d] + b[d]))
    }

    /// The areas that the faces sweep in the direction of N on the way to `later`, the dual cells of another mesh over
    /// the same lattice. They are padded like [`normals`](Self::normals).
    ///
    /// ```text
    /// s = d × ½ (t + t′),   d = the mean displacement of the two ends of the face
    /// ```
    ///
    /// Exact where the nodes move in straight lines: the area of a cell grows by what its faces sweep outward. This is
    /// the geometric conservation law.
    ///
    /// # Source
    /// Thomas and Lombard, *Geometric conservation law and its application to flow computations on moving grids*
    /// (1979).
    pub fn swept(&self, later: &Self) -> Vec<[f64; D]>
    where
        Mesh<D>: Cells<D>,
    {
        debug_assert_eq!(self.patch, later.patch);
        Mesh::<D>::swept(self, later)
    }
}

impl DualCells<2> {
    pub(super) fn of_plane(mesh: &Mesh<2>) -> Self {
        let (lattice, places) = (mesh.lattice(), mesh.parameters());
        let ([n, m], wraps) = (lattice.nodes(), lattice.periodic());
        let patch = Patch { origin: [0; 2], size: [n, m], wraps };
        let s = m + 2;
        let x = padded(lattice, places.x(), places.jump());

        let mut centres = vec![[0.0; 2]; x.len()];
        parallel::for_each_row(&mut centres[..(n + 1) * s], s, |p, row| {
            for (k, c) in (p * s..).zip(&mut row[..=m]) {
                *c = [0, 1].map(|d| 0.25 * ((x[k][d] + x[k + s + 1][d]) + (x[k + s][d] + x[k + 1][d])));
            }
        });
        let curved = mesh.chart().map(|chart| {
            let places = centres.clone();
            parallel::for_each_row(&mut centres[..(n + 1) * s], s, |_, row| {
                row.iter_mut().for_each(|c| *c = chart.at(*c))
            });
            Curved::new(chart, &patch, &places, &centres)
        });
        let mut normals = vec![[[0.0; 2]; 2]; x.len()];
        parallel::for_each_row(&mut normals[..(n + 1) * s], s, |p, row| {
            for (q, normals) in row[..=m].iter_mut().enumerate() {
                let k = p * s + q;
                let normal = |from: usize, to: usize| {
                    let t = minus(centres[to], centres[from]);
                    [t[1], -t[0]]
                };
                if q > 0 {
                    normals[0] = normal(k - 1, k);
                }
                if p > 0 {
                    normals[1] = normal(k, k - s);
                }
            }
        });
        patch.wrap(&mut normals);
        let mut areas = vec![0.0; patch.len()];
        parallel::for_each_row(&mut areas, m, |p, areas| {
            for (k, area) in (patch.pencil(p)..).zip(areas) {
                let diagonals = [minus(centres[k], centres[k - s - 1]), minus(centres[k - s], centres[k - 1])];
                let beyond = curved.as_ref().map_or(0.0, |curved| curved.area(k, s));
                *area = 0.5 * cross(diagonals[0], diagonals[1]) + beyond;
            }
        });
        Self { patch, centres, normals, areas, curved }
    }

    pub(super) fn swept_in_plane(&self, later: &Self) -> Vec<[f64; 2]> {
        let ([n, m], s) = (self.patch.size, self.patch.size[1] + 2);
        let moved = |k: usize| minus(later.centres[k], self.centres[k]);
        let mut swept = vec![[0.0; 2]; self.normals.len()];
        parallel::for_each_row(&mut swept[..(n + 1) * s], s, |p, row| {
            for (q, swept) in row[..=m].iter_mut().enumerate() {
                let k = p * s + q;
                let area = |end: usize, axis: usize| {
                    let (d, e) = (moved(k), moved(end));
                    let (a, b) = (self.normals[k][axis], later.normals[k][axis]);
                    0.25 * ((d[0] + e[0]) * (a[0] + b[0]) + (d[1] + e[1]) * (a[1] + b[1]))
                };
                if q > 0 {
                    swept[0] = area(k - 1, 0);
                }
                if p > 0 {
                    swept[1] = area(k - s, 1);
                }
                let (Some(old), Some(new)) = (&self.curved, &later.curved) else { continue };
                for axis in (0..2).filter(|axis| [q, p][*axis] > 0) {
                    let centres = [&self.centres[..], &later.centres];
                    Curved::correct([old, new], &self.patch, [p, q], axis, centres, &mut swept[axis]);
                }
            }
        });
        self.patch.wrap(&mut swept);
        swept
    }
}

/// Nodal values with a ring around them, padded like [`DualCells::patch`]. Across a periodic axis the ring holds
/// images, to which `jump[d]` is added for each turn around axis d; beyond a bounded side it repeats the values of the
/// side.
pub fn padded<const D: usize, const K: usize>(
    lattice: &Lattice<D>,
    values: &[[f64; K]],
    jump: [[f64; K]; D],
) -> Vec<[f64; K]> {
    let (nodes, strides, wraps) = (lattice.nodes(), lattice.strides(), lattice.periodic());
    // the node at each padded place along an axis, and how many turns around the axis lead there
    let along = |d: usize| {
        let n = nodes[d];
        (0..n + 2).map(move |place| {
            let above = place + n - 1;
            if wraps[d] { (above % n, (above / n) as f64 - 1.0) } else { (place.clamp(1, n) - 1, 0.0) }
        })
    };
    let last: Vec<(usize, [f64; K])> = along(D - 1).map(|(i, turns)| (i, jump[D - 1].map(|j| turns * j))).collect();
    let mut rows = vec![(0, [0.0; K])];
    for d in 0..D - 1 {
        let shifted = |(first, by): (usize, [f64; K])| {
            along(d)
                .map(move |(i, turns)| (first + i * strides[d], std::array::from_fn(|c| by[c] + turns * jump[d][c])))
        };
        rows = rows.into_iter().flat_map(shifted).collect();
    }
    let mut out = Vec::with_capacity(rows.len() * last.len());
    for (first, by) in rows {
        let row = last.iter().map(|(i, over)| std::array::from_fn(|c| values[first + i][c] + (by[c] + over[c])));
        out.extend(row);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A mesh of [0, 2] × [−1, 2] with every node up to 0.3 cells away from its uniform place, side nodes on their
    /// sides.
    fn random(cells: [usize; 2], periodic: [bool; 2], seed: u64) -> Mesh<2> {
        let mesh = Mesh::uniform(Lattice::new(cells, periodic).unwrap(), [0.0, -1.0], [2.0, 2.0]).unwrap();
        let mut state = seed;
        let x = (mesh.x().iter().enumerate()).map(|(k, x)| {
            let node = mesh.lattice().node(k);
            std::array::from_fn(|d| {
                state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                let shift = 0.6 * ((state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5) * mesh.extent()[d];
                let inside = periodic[d] || !(node[d] == 0 || node[d] == cells[d]);
                x[d] + if inside { shift / cells[d] as f64 } else { 0.0 }
            })
        });
        mesh.moved(x.collect()).unwrap()
    }

    proptest! {
        /// Cells tile the box, faces close around them, and areas grow by what the faces sweep: all to round-off, on
        /// random meshes, for sides and periodic axes.
        #[test]
        fn the_geometric_conservation_law_holds(n in 2_usize..9, m in 2_usize..9, wx: bool, wy: bool, seed: u64) {
            let [old, new] = [seed, seed ^ 0x5555].map(|seed| DualCells::new(&random([n, m], [wx, wy], seed)));
            let swept = old.swept(&new);
            let strides = new.patch().padded_strides();
            prop_assert!((new.areas().iter().sum::<f64>() - 6.0).abs() < 1e-13);
            for (i, k) in new.patch().places().enumerate() {
                let outward: f64 = (0..2).map(|d| swept[k][d] - swept[k - strides[d]][d]).sum();
                let growth = new.areas()[i] - old.areas()[i];
                prop_assert!((growth - outward).abs() < 1e-14, "{growth} against {outward}");
                for c in 0..2 {
                    let sum: f64 = (0..2).map(|d| new.normals()[k][d][c] - new.normals()[k - strides[d]][d][c]).sum();
                    prop_assert!(sum.abs() < 1e-14, "open by {sum}");
                }
            }
        }
    }

    /// A shift of the whole periodic mesh by a cell sweeps a cell through every face across it, and nothing along it.
    #[test]
    fn a_shift_sweeps_whole_cells() {
        let mesh = Mesh::uniform(Lattice::new([4, 4], [true; 2]).unwrap(), [0.0; 2], [4.0; 2]).unwrap();
        let shifted = mesh.moved(mesh.x().iter().map(|x| [x[0] + 1.0, x[1]]).collect()).unwrap();
        let [old, new] = [&mesh, &shifted].map(DualCells::new);
        let swept = old.swept(&new);
        assert!(new.patch().places().all(|k| (swept[k][0] - 1.0).abs() < 1e-14 && swept[k][1].abs() < 1e-14));
        assert!(new.patch().places().all(|k| (new.normals()[k][0][0] - 1.0).abs() < 1e-14));
    }
}
