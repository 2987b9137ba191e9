use super::Mesh;

pub(super) fn interpolate_in_plane(from: &Mesh<2>, values: &[f64], to: &Mesh<2>) -> Vec<f64> {
    let cells = Search { mesh: from };
    let lattice = from.lattice();
    // by how many cells the last node was off its own, and the first node of the last row
    let (mut off, mut off_in_row) = ([0; 2], [0; 2]);
    let interpolated = to.x().iter().enumerate().map(|(k, &point)| {
        let node = lattice.node(k);
        let first_in_row = node[1] == 0;
        off = if first_in_row { off_in_row } else { off };
        let (cell, (nodes, weights)) = cells.find(point, [0, 1].map(|d| node[d] as isize + off[d]));
        off = [0, 1].map(|d| cell[d] - node[d] as isize);
        off_in_row = if first_in_row { off } else { off_in_row };
        nodes.iter().zip(weights).map(|(&n, w)| w * values[n]).sum()
    });
    interpolated.collect()
}

/// The cell of a mesh, by its lowest corner, that holds each of some points. The search begins in the cell of the point
/// before, so that neighbouring points cost a few tests each.
pub(super) fn cells_in_plane(mesh: &Mesh<2>, points: impl Iterator<Item = [f64; 2]>) -> Vec<[usize; 2]> {
    let cells = Search { mesh };
    let mut near = [0; 2];
    let cell = |point| {
        let (cell, (nodes, _)) = cells.find(point, near);
        near = cell;
        mesh.lattice().node(nodes[0])
    };
    points.map(cell).collect()
}

/// The cells of a mesh by signed index, which on a periodic axis counts beyond the box.
struct Search<'a> {
    mesh: &'a Mesh<2>,
}

type Triangle = ([usize; 3], [f64; 3]);

impl Search<'_> {
    fn corner(&self, [i, j]: [isize; 2]) -> (usize, [f64; 2]) {
        let lattice = self.mesh.lattice();
        let nodes = lattice.nodes();
        let extent = self.mesh.extent();
        let wrapped = [0, 1].map(|d| [i, j][d].rem_euclid(nodes[d] as isize) as usize);
        let index = lattice.index(wrapped);
        let x = self.mesh.x()[index];
        (index, std::array::from_fn(|d| x[d] + [i, j][d].div_euclid(nodes[d] as isize) as f64 * extent[d]))
    }

    /// The cell that holds `point`, and nodes and barycentric weights of the triangle that does; the search begins in
    /// cell `start`.
    fn find(&self, point: [f64; 2], start: [isize; 2]) -> ([isize; 2], Triangle) {
        let cells = self.mesh.lattice().cells().map(|n| n as isize);
        let periodic = self.mesh.lattice().periodic();
        let exists = |cell: [isize; 2]| (0..2).all(|d| periodic[d] || (0..cells[d]).contains(&cell[d]));
        let mut cell: [isize; 2] =
            std::array::from_fn(|d| if periodic[d] { start[d] } else { start[d].clamp(0, cells[d] - 1) });
        let (near, extent) = (self.corner(cell).1, self.mesh.extent());
        let point: [f64; 2] = std::array::from_fn(|d| match periodic[d] {
            true => point[d] - extent[d] * ((point[d] - near[d]) / extent[d]).round(),
            false => point[d],
        });
        // A straight walk crosses each cell once at most, and the image is at most a period away. A longer walk is
        // caught among cells that are not convex; then all cells are tried.
        let mut left = 4 * (cells[0] + cells[1]);
        loop {
            if left == 0 {
                return self.nearest(point);
            }
            left -= 1;
            let [a, b, c, d] = self.corners(cell).map(|c| c.1);
            let [i, j] = cell;
            let across = [(a, b, [i, j - 1]), (b, c, [i + 1, j]), (c, d, [i, j + 1]), (d, a, [i - 1, j])];
            let next = across
                .into_iter()
                .filter(|&(_, _, neighbour)| exists(neighbour))
                .map(|(p, q, neighbour)| (outside(point, p, q), neighbour))
                .filter(|&(distance, _)| distance > 0.0)
                .max_by(|p, q| p.0.total_cmp(&q.0));
            match next {
                Some((_, neighbour)) => cell = neighbour,
                None => break,
            }
        }
        (cell, self.triangle(point, cell))
    }

    /// Of all triangles the one that holds a point, or is nearest to it.
    fn nearest(&self, point: [f64; 2]) -> ([isize; 2], Triangle) {
        let (cells, extent) = (self.mesh.lattice().cells().map(|n| n as isize), self.mesh.extent());
        let periodic = self.mesh.lattice().periodic();
        let mut best = (f64::INFINITY, ([0, 0], self.triangle(point, [0, 0])));
        for cell in (0..cells[0]).flat_map(|i| (0..cells[1]).map(move |j| [i, j])) {
            let near = self.corner(cell).1;
            let about = |d: usize| match periodic[d] {
                true => point[d] - extent[d] * ((point[d] - near[d]) / extent[d]).round(),
                false => point[d],
            };
            let point = [about(0), about(1)];
            let [a, b, c, d] = self.corners(cell).map(|c| c.1);
            let edges = [(a, b), (b, c), (c, d), (d, a)];
            let off = edges.into_iter().map(|(p, q)| outside(point, p, q)).fold(0.0, f64::max);
            if off < best.0 {
                best = (off, (cell, self.triangle(point, cell)));
            }
        }
        best.1
    }

    fn corners(&self, [i, j]: [isize; 2]) -> [(usize, [f64; 2]); 4] {
        [[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]].map(|c| self.corner(c))
    }

    fn triangle(&self, point: [f64; 2], cell: [isize; 2]) -> Triangle {
        let [a, b, c, d] = self.corners(cell);
        let (p, q, r) = if outside(point, a.1, c.1) >= 0.0 { (a, b, c) } else { (a, c, d) };
        let double_area =
            |u: [f64; 2], v: [f64; 2], w: [f64; 2]| (v[0] - u[0]) * (w[1] - u[1]) - (v[1] - u[1]) * (w[0] - u[0]);
        let raw = [(q, r), (r, p), (p, q)].map(|(u, v)| double_area(u.1, v.1, point).max(0.0));
        let sum: f64 = raw.iter().sum();
        ([p.0, q.0, r.0], raw.map(|w| w / sum))
    }
}

/// Signed distance of a point to the right of the line from p to q; positive outside a counter-clockwise cell.
fn outside(point: [f64; 2], p: [f64; 2], q: [f64; 2]) -> f64 {
    let edge = [q[0] - p[0], q[1] - p[1]];
    let turn = edge[1] * (point[0] - p[0]) - edge[0] * (point[1] - p[1]);
    turn / edge[0].hypot(edge[1])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Lattice, interpolate};

    /// A linear field survives the way between two strongly different meshes, also where the search is long.
    #[test]
    fn linear_fields_are_carried_exactly_across_many_cells() {
        let a = Mesh::uniform(Lattice::bounded([30, 20]).unwrap(), [0.0, 0.0], [1.0, 1.0]).unwrap();
        let squeeze = |s: f64| s.powi(4);
        let from = a.moved(a.x().iter().map(|&[x, y]| [squeeze(x), y + 0.3 * y * (1.0 - y) * x]).collect()).unwrap();
        let to = a.moved(a.x().iter().map(|&[x, y]| [1.0 - squeeze(1.0 - x), squeeze(y)]).collect()).unwrap();
        let linear = |[x, y]: [f64; 2]| 3.0 - 2.0 * x + 5.0 * y;
        let values: Vec<f64> = from.x().iter().map(|&x| linear(x)).collect();
        for (found, &x) in interpolate(&from, &values, &to).iter().zip(to.x()) {
            assert!((found - linear(x)).abs() < 1e-12, "{found} at {x:?}");
        }
    }

    /// On a periodic axis a node that left the box on one side finds its value on the other.
    #[test]
    fn periodic_axes_wrap_around() {
        let lattice = Lattice::new([16, 8], [true, false]).unwrap();
        let mesh = Mesh::uniform(lattice, [0.0, 0.0], [1.0, 1.0]).unwrap();
        let values: Vec<f64> = mesh.x().iter().map(|[x, _]| (2.0 * std::f64::consts::PI * x).cos()).collect();
        for shift in [-0.25, 0.5, 3.0, -7.0625, 100.5] {
            let shifted = mesh.moved(mesh.x().iter().map(|&[x, y]| [x + shift, y]).collect()).unwrap();
            for (found, [x, _]) in interpolate(&mesh, &values, &shifted).iter().zip(shifted.x()) {
                assert!((found - (2.0 * std::f64::consts::PI * x).cos()).abs() < 1e-12, "after {shift}");
            }
        }
    }
}
