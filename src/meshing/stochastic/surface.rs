use crate::geometry::Lattice;

/// The place of a point in a lattice, in units of its spacing.
pub(super) struct Place {
    /// Turns around periodic axes.
    pub turns: [f64; 2],
    /// The first node of the cell.
    pub cell: [usize; 2],
    /// The distance from there along each axis, 0 … 1.
    pub share: [f64; 2],
}

/// The cells of a lattice, and the cell that a point lies in.
///
/// It avoids conversions between floats and integers and roundings, which x86-64 does one at a time.
#[derive(Debug, Clone, Copy)]
pub(super) struct Grid {
    pub cells: [f64; 2],
    pub periodic: [bool; 2],
    /// 1/cells.
    inverse: [f64; 2],
}

/// Adding 1.5·2⁵² to a number rounds it to a whole number, which stands in the last bits of the sum.
const SHIFT: f64 = 6_755_399_441_055_744.0;

/// The nearest whole number, for |x| below 2⁵¹.
#[inline(always)]
fn nearest(x: f64) -> f64 {
    (x + SHIFT) - SHIFT
}

/// A whole number from 0 to 2³² − 1, as an index.
#[inline(always)]
fn index(x: f64) -> usize {
    (x + SHIFT).to_bits() as u32 as usize
}

impl Grid {
    pub fn new(lattice: &Lattice<2>) -> Self {
        let cells = lattice.cells().map(|n| n as f64);
        Self { cells, periodic: lattice.periodic(), inverse: cells.map(f64::recip) }
    }

    /// Turns around axis d that bring a point into the box.
    #[inline(always)]
    pub fn turns(&self, d: usize, x: f64) -> f64 {
        if self.periodic[d] { nearest(x * self.inverse[d] - 0.5) } else { 0.0 }
    }

    /// Index along axis d of the cell that holds a point; the first or the last one for a point outside.
    #[inline(always)]
    pub fn cell(&self, d: usize, x: f64) -> f64 {
        let (x, last) = (x - 0.5, self.cells[d] - 1.0);
        let x = if x > 0.0 { x } else { 0.0 };
        nearest(if x < last { x } else { last })
    }

    #[inline(always)]
    pub fn place(&self, x: [f64; 2]) -> Place {
        let turns = [0, 1].map(|d| self.turns(d, x[d]));
        let inside = [0, 1].map(|d| x[d] - turns[d] * self.cells[d]);
        let cell = [0, 1].map(|d| self.cell(d, inside[d]));
        Place { turns, cell: cell.map(index), share: [0, 1].map(|d| inside[d] - cell[d]) }
    }
}

/// Positions as a bicubic function of the lattice coordinates: along each axis the cubic through two nodes on either
/// side
///
/// It stores one more line of nodes around the lattice, with images on periodic axes and extrapolated positions beyond
/// bounded sides.
pub(super) struct Surface {
    values: Vec<[f64; 2]>,
    width: usize,
    jump: [[f64; 2]; 2],
}

impl Surface {
    pub fn new(lattice: &Lattice<2>, x: &[[f64; 2]], jump: [[f64; 2]; 2]) -> Self {
        let (nodes, periodic) = (lattice.nodes(), lattice.periodic());
        // lines −1 … cells + 1 along each axis
        let lines = lattice.cells().map(|n| n + 3);
        let width = lines[1];
        let mut values = vec![[0.0; 2]; lines[0] * width];
        let known = |d: usize, i: usize| periodic[d] || (1..=nodes[d]).contains(&i);
        for i in (0..lines[0]).filter(|&i| known(0, i)) {
            for j in (0..width).filter(|&j| known(1, j)) {
                let lifted = [i + nodes[0] - 1, j + nodes[1] - 1];
                let value = x[lattice.index([lifted[0] % nodes[0], lifted[1] % nodes[1]])];
                values[i * width + j] = [0, 1].map(|c| {
                    value[c] + (0..2).map(|d| ((lifted[d] / nodes[d]) as f64 - 1.0) * jump[d][c]).sum::<f64>()
                });
            }
        }
        let mut extrapolate = |out: usize, step: isize, lines: usize| {
            let at = |m: isize| values[out.wrapping_add_signed(m * step)];
            values[out] = std::array::from_fn(|c| match lines {
                // extrapolated by a parabola through three nodes, or a cubic through four
                5 => 3.0 * at(1)[c] - 3.0 * at(2)[c] + at(3)[c],
                _ => 4.0 * at(1)[c] - 6.0 * at(2)[c] + 4.0 * at(3)[c] - at(4)[c],
            });
        };
        if !periodic[0] {
            for j in (0..width).filter(|&j| known(1, j)) {
                extrapolate(j, width as isize, lines[0]);
                extrapolate((lines[0] - 1) * width + j, -(width as isize), lines[0]);
            }
        }
        if !periodic[1] {
            for i in 0..lines[0] {
                extrapolate(i * width, 1, width);
                extrapolate((i + 1) * width - 1, -1, width);
            }
        }
        Self { values, width, jump }
    }

    #[inline(always)]
    pub fn at(&self, place: &Place) -> [f64; 2] {
        let mut sum = [0, 1].map(|c| place.turns[0] * self.jump[0][c] + place.turns[1] * self.jump[1][c]);
        let [p, q] = place.share.map(cubic);
        for (line, p) in p.into_iter().enumerate() {
            let four = &self.values[(place.cell[0] + line) * self.width + place.cell[1]..][..4];
            for c in 0..2 {
                sum[c] += p * (q[0] * four[0][c] + q[1] * four[1][c] + q[2] * four[2][c] + q[3] * four[3][c]);
            }
        }
        sum
    }
}

/// Weights of nodes −1, 0, 1 and 2 in the cubic through them.
#[inline(always)]
fn cubic(s: f64) -> [f64; 4] {
    let (before, after, beyond) = (s + 1.0, s - 1.0, s - 2.0);
    [-s * after * beyond / 6.0, 0.5 * before * after * beyond, -0.5 * before * s * beyond, before * s * after / 6.0]
}

/// A bilinear function on each cell of a lattice, continuous across cells: c₀ + c₁ r + s (c₂ + c₃ r)
///
/// The coefficients of a cell are stored together, so that a look-up reads a single place in memory.
pub(super) struct Bilinear<const K: usize> {
    cells: Vec<[[f64; K]; 4]>,
    width: f64,
}

impl<const K: usize> Bilinear<K> {
    /// Through nodal values.
    pub fn new(lattice: &Lattice<2>, values: &[[f64; K]]) -> Self {
        let values = lattice.closed(values);
        let [n, m] = lattice.cells();
        let cell = |k: usize| {
            let first = k / m * (m + 1) + k % m;
            let [a, b, c, d] = [0, 1, m + 1, m + 2].map(|node| values[first + node]);
            let term = |f: &dyn Fn(usize) -> f64| std::array::from_fn(f);
            [a, term(&|e| b[e] - a[e]), term(&|e| c[e] - a[e]), term(&|e| d[e] - c[e] - b[e] + a[e])]
        };
        Self { cells: (0..n * m).map(cell).collect(), width: m as f64 }
    }

    /// The index in memory of a cell.
    #[inline(always)]
    pub fn position(&self, cell: [f64; 2]) -> usize {
        index(cell[0] * self.width + cell[1])
    }

    #[inline(always)]
    pub fn at(&self, position: usize, [s, r]: [f64; 2]) -> [f64; K] {
        let c = &self.cells[position];
        std::array::from_fn(|e| c[0][e] + r * c[1][e] + s * (c[2][e] + r * c[3][e]))
    }
}
