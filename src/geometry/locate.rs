use super::points::{Place, lies_within};
use super::{Mesh, quality::minus};
use crate::parallel;
use std::borrow::Cow;

pub(super) fn interpolate_in_plane(from: &Mesh<2>, values: &[f64], to: &Mesh<2>) -> Vec<f64> {
    let cells = Search { mesh: from };
    let lattice = from.lattice();
    // by how many cells the last node was off its own, and the first node of the last row
    let (mut off, mut off_in_row) = ([0; 2], [0; 2]);
    let interpolated = to.x().iter().enumerate().map(|(k, &point)| {
        let node = lattice.node(k);
        let first_in_row = node[1] == 0;
        off = if first_in_row { off_in_row } else { off };
        let (cell, image) = cells.find(point, [0, 1].map(|d| node[d] as isize + off[d]));
        let (nodes, weights) = cells.triangle(image, cell);
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
        near = cells.find(point, near).0;
        mesh.lattice().node(cells.corner(near).0)
    };
    points.map(cell).collect()
}

/// The cell of each of some points, and where in it the point lies; nothing for points outside.
pub(super) fn places_in_plane(mesh: &Mesh<2>, points: &[[f64; 2]]) -> Vec<Option<Place<2>>> {
    let search = Search { mesh };
    let starts = Starts::new(&search, points.len());
    let mut places = vec![None; points.len()];
    parallel::for_each_piece(&mut places, |first, piece| {
        let mut near = [0; 2];
        for (place, &point) in piece.iter_mut().zip(&points[first..]) {
            let away = |cell| {
                let way = minus(mesh.image(search.corner(cell).1), mesh.image(point));
                way[0].hypot(way[1])
            };
            let start = starts.beside(mesh.image(point));
            let start = if away(near) < away(start) { near } else { start };
            let (cell, image) = search.find(point, start);
            near = cell;
            *place = search.place(image, cell);
            if place.is_none() {
                // the walk may have ended at a side that is no wall of a box, with the point behind another one
                let (cell, image) = search.nearest(point);
                *place = search.place(image, cell);
            }
            if place.is_none() {
                // one point outside is enough to be told of, and each costs a look at every cell
                break;
            }
        }
    });
    places
}

/// The places in the unit box of points in a domain with a chart; where there is none, the points themselves.
///
/// # Errors
/// The index of the first point outside.
pub(super) fn parameters_in_plane<'a>(mesh: &Mesh<2>, points: &'a [[f64; 2]]) -> Result<Cow<'a, [[f64; 2]]>, usize> {
    let Some(chart) = mesh.chart() else { return Ok(Cow::Borrowed(points)) };
    let (search, flat) = (Search { mesh }, Search { mesh: mesh.parameters() });
    let mut places = vec![None; points.len()];
    parallel::for_each_piece(&mut places, |first, piece| {
        let mut near = [0; 2];
        for (place, &point) in piece.iter_mut().zip(&points[first..]) {
            let guess = |cell: [isize; 2]| {
                let share = search.place(point, cell).map_or([0.5; 2], |place| place.share);
                let [a, b, c, d] = flat.corners(cell).map(|c| c.1);
                let [s, t] = share;
                let at = |k: usize| (1.0 - t) * ((1.0 - s) * a[k] + s * b[k]) + t * ((1.0 - s) * d[k] + s * c[k]);
                [at(0), at(1)]
            };
            near = search.find(point, near).0;
            *place = chart.place(point, guess(near));
            if place.is_none() {
                near = search.nearest(point).0;
                *place = chart.place(point, guess(near));
            }
            if place.is_none() {
                break;
            }
        }
    });
    let mut found = Vec::with_capacity(points.len());
    for (k, place) in places.into_iter().enumerate() {
        found.push(place.ok_or(k)?);
    }
    Ok(Cow::Owned(found))
}

/// Cells at which the search for a point may begin: one for each of the equal boxes that the box of the mesh is divided
/// into.
struct Starts<'a> {
    mesh: &'a Mesh<2>,
    boxes: [usize; 2],
    cells: Vec<[isize; 2]>,
}

/// Number of points that share a starting cell: a starting cell costs a search of its own, and fewer would make the
/// searches from it longer.
const POINTS_A_START: f64 = 8.0;

impl<'a> Starts<'a> {
    fn new(search: &Search<'a>, points: usize) -> Self {
        let (mesh, cells) = (search.mesh, search.mesh.lattice().cells());
        let share = (points as f64 / POINTS_A_START / (cells[0] * cells[1]) as f64).sqrt().min(1.0);
        let boxes = cells.map(|n| ((n as f64 * share) as usize).max(1));
        let (lower, extent) = (mesh.lower(), mesh.extent());
        let mut near = [0; 2];
        let mut found = Vec::with_capacity(boxes[0] * boxes[1]);
        for i in 0..boxes[0] {
            let mut first_in_row = near;
            for j in 0..boxes[1] {
                let at = [i, j];
                let middle = [0, 1].map(|d| lower[d] + extent[d] * (at[d] as f64 + 0.5) / boxes[d] as f64);
                near = search.find(middle, near).0;
                first_in_row = if j == 0 { near } else { first_in_row };
                found.push(near);
            }
            near = first_in_row;
        }
        Self { mesh, boxes, cells: found }
    }

    /// A cell near a point of the box.
    fn beside(&self, point: [f64; 2]) -> [isize; 2] {
        let (lower, extent) = (self.mesh.lower(), self.mesh.extent());
        let at = [0, 1].map(|d| {
            let share = (point[d] - lower[d]) / extent[d] * self.boxes[d] as f64;
            (share.max(0.0) as usize).min(self.boxes[d] - 1)
        });
        self.cells[at[0] * self.boxes[1] + at[1]]
    }
}

/// The cells of a mesh by signed index, which on a periodic axis counts beyond the box.
struct Search<'a> {
    mesh: &'a Mesh<2>,
}

type Triangle = ([usize; 3], [f64; 3]);

impl Search<'_> {
    /// What positions jump by on a turn around each axis; 0 where they do not.
    fn period(&self) -> [f64; 2] {
        let jump = self.mesh.jump();
        [0, 1].map(|d| if self.mesh.lattice().periodic()[d] { jump[d][d] } else { 0.0 })
    }

    /// The image of a point that is nearest to another one.
    fn image(&self, point: [f64; 2], near: [f64; 2]) -> [f64; 2] {
        let period = self.period();
        std::array::from_fn(|d| match period[d] > 0.0 {
            true => point[d] - period[d] * ((point[d] - near[d]) / period[d]).round(),
            false => point[d],
        })
    }

    fn corner(&self, node: [isize; 2]) -> (usize, [f64; 2]) {
        let lattice = self.mesh.lattice();
        let (nodes, period) = (lattice.nodes(), self.period());
        // divisions take longer than all the rest, and most nodes need none
        let counted = [0, 1].map(|d| match usize::try_from(node[d]) {
            Ok(k) if k < nodes[d] => (k, 0.0),
            _ => {
                let n = nodes[d] as isize;
                (node[d].rem_euclid(n) as usize, node[d].div_euclid(n) as f64)
            }
        });
        let index = lattice.index(counted.map(|(k, _)| k));
        let x = self.mesh.x()[index];
        (index, [0, 1].map(|d| x[d] + counted[d].1 * period[d]))
    }

    /// The cell that holds `point`, and the image of the point in it; the search begins in cell `start`. For a point
    /// outside it is a cell at a side.
    fn find(&self, point: [f64; 2], start: [isize; 2]) -> ([isize; 2], [f64; 2]) {
        let cells = self.mesh.lattice().cells().map(|n| n as isize);
        let periodic = self.mesh.lattice().periodic();
        let exists = |cell: [isize; 2]| (0..2).all(|d| periodic[d] || (0..cells[d]).contains(&cell[d]));
        let mut cell: [isize; 2] =
            std::array::from_fn(|d| if periodic[d] { start[d] } else { start[d].clamp(0, cells[d] - 1) });
        let point = self.image(point, self.corner(cell).1);
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
        (cell, point)
    }

    /// Of all cells the one that holds a point, or is nearest to it, and the image of the point there.
    fn nearest(&self, point: [f64; 2]) -> ([isize; 2], [f64; 2]) {
        let cells = self.mesh.lattice().cells().map(|n| n as isize);
        let mut best = (f64::INFINITY, ([0, 0], point));
        for cell in (0..cells[0]).flat_map(|i| (0..cells[1]).map(move |j| [i, j])) {
            let point = self.image(point, self.corner(cell).1);
            let [a, b, c, d] = self.corners(cell).map(|c| c.1);
            let edges = [(a, b), (b, c), (c, d), (d, a)];
            let off = edges.into_iter().map(|(p, q)| outside(point, p, q)).fold(0.0, f64::max);
            if off < best.0 {
                best = (off, (cell, point));
            }
        }
        best.1
    }

    /// Where a point lies in a cell; nothing where it lies outside.
    ///
    /// The cell is the image of the unit square by x = a + s e + t f + s t g. With q = x − a, the cross product of
    /// q − s e = t (f + s g) with f + s g leaves (e × g) s² + (e × f − q × g) s − q × f = 0. The derivative of its left
    /// side at s is the Jacobian there, so that the root wanted is the one where it is positive.
    fn place(&self, point: [f64; 2], cell: [isize; 2]) -> Option<Place<2>> {
        let corners = self.corners(cell);
        let [a, b, c, d] = corners.map(|c| c.1);
        let (q, e, f) = (minus(point, a), minus(b, a), minus(d, a));
        let g = minus(minus(c, b), f);
        let cross = |u: [f64; 2], v: [f64; 2]| u[0] * v[1] - u[1] * v[0];
        let (square, linear, constant) = (cross(e, g), cross(e, f) - cross(q, g), cross(q, f));
        let root = (linear * linear + 4.0 * square * constant).max(0.0).sqrt();
        // of both ways to write the root the one in which nothing cancels
        let s = if linear > 0.0 { 2.0 * constant / (linear + root) } else { (root - linear) / (2.0 * square) };
        let s = s.clamp(0.0, 1.0);
        let (along, rest) = ([0, 1].map(|d| f[d] + s * g[d]), [0, 1].map(|d| q[d] - s * e[d]));
        let t = (along[0] * rest[0] + along[1] * rest[1]) / (along[0] * along[0] + along[1] * along[1]);
        let t = t.clamp(0.0, 1.0);
        let found = [0, 1].map(|d| a[d] + s * e[d] + t * along[d]);
        let place = Place { cell: self.mesh.lattice().node(corners[0].0), share: [s, t] };
        lies_within(self.mesh, found, point).then_some(place)
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
