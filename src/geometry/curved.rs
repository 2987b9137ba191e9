//! Dual cells of a mesh whose lines are curved.

use super::quality::{cross, minus};
use super::{Chart, Patch};
use crate::parallel;

/// What curved faces have beyond straight ones
///
/// ```text
/// A = area of the polygon + Σ ± b,   b = area between a face and its chord, on the side of N
/// ```
///
/// Faces are images of straight lines in the unit box. Without b the cells of a thin layer along a curved side would
/// lie beyond the side, and the area of all cells would change as nodes slide along it. On a side b is a difference of
/// the area that is swept along the side from its beginning, so that cells add up to the domain to round-off wherever
/// the nodes are. Inside it is that of a parabola through the middle of the face.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Curved {
    /// b of the face above each node along each axis, padded.
    bulges: Vec<[f64; 2]>,
    /// Twice the area swept along each side to the ends of its faces, for each axis across and both of its ends; empty
    /// on closed axes.
    along: [[Vec<f64>; 2]; 2],
    middle: [f64; 2],
}

impl Curved {
    /// From the places of the centres of cells in the unit box, padded as in `DualCells`, and their positions.
    pub fn new(chart: &Chart<2>, patch: &Patch<2>, places: &[[f64; 2]], centres: &[[f64; 2]]) -> Self {
        let ([n, m], s, middle) = (patch.size, patch.size[1] + 2, chart.middle());
        let along = |axis: usize, end: usize| -> Vec<f64> {
            let last = [n, m][axis] * end;
            let place = |i: usize| if axis == 0 { last * s + i } else { i * s + last };
            let count = if patch.wraps[axis] { 0 } else { [n, m][1 - axis] + 1 };
            (0..count).map(|i| chart.swept_to(axis, end, places[place(i)][1 - axis])).collect()
        };
        let along = [0, 1].map(|axis| [0, 1].map(|end| along(axis, end)));
        let curved = Self { bulges: Vec::new(), along, middle };
        let mut bulges = vec![[0.0; 2]; centres.len()];
        parallel::for_each_row(&mut bulges[..(n + 1) * s], s, |p, row| {
            for (q, bulges) in row[..=m].iter_mut().enumerate() {
                let k = p * s + q;
                for (axis, [from, to], exists) in
                    [(0, [k.wrapping_sub(1), k], q > 0), (1, [k, k.wrapping_sub(s)], p > 0)]
                {
                    if !exists {
                        continue;
                    }
                    let (a, b) = (centres[from], centres[to]);
                    bulges[axis] = match side(patch, [p, q], axis) {
                        Some(end) => {
                            let [first, last] = if axis == 0 { [q - 1, q] } else { [p, p - 1] };
                            let sums = &curved.along[axis][end];
                            curved.beyond(sums[last] - sums[first], a, b)
                        }
                        None => {
                            let between = [0, 1].map(|d| 0.5 * (places[from][d] + places[to][d]));
                            2.0 / 3.0 * cross(minus(chart.at(between), a), minus(b, a))
                        }
                    };
                }
            }
        });
        patch.wrap(&mut bulges);
        Self { bulges, ..curved }
    }

    /// The area between a curve and its chord from a to b, from twice the area that is swept along it.
    fn beyond(&self, swept: f64, a: [f64; 2], b: [f64; 2]) -> f64 {
        0.5 * (swept - cross(minus(a, self.middle), minus(b, self.middle)))
    }

    /// What bulges add to the area of the cell at a padded place.
    pub fn area(&self, k: usize, s: usize) -> f64 {
        let b = &self.bulges;
        (b[k][0] - b[k - s][0]) + (b[k][1] - b[k - 1][1])
    }

    /// Corrects what the face above a place sweeps on its way between two meshes: faces on sides sweep nothing, and
    /// those that end at a side follow its curve.
    pub fn correct(
        [old, new]: [&Self; 2],
        patch: &Patch<2>,
        [p, q]: [usize; 2],
        axis: usize,
        centres: [&[[f64; 2]]; 2],
        swept: &mut f64,
    ) {
        if side(patch, [p, q], axis).is_some() {
            *swept = 0.0;
            return;
        }
        let s = patch.size[1] + 2;
        let k = p * s + q;
        *swept += new.bulges[k][axis] - old.bulges[k][axis];
        // both ends of the face, each with its place across it
        let across = 1 - axis;
        let (at, upper) = if across == 0 { (p, k) } else { (q, k) };
        let lower = if across == 0 { k - s } else { k - 1 };
        let along = if across == 0 { q } else { p };
        for (end, meets, place) in [(0, at == 1, lower), (1, at == patch.size[across], upper)] {
            if patch.wraps[across] || !meets {
                continue;
            }
            let sums = [old, new].map(|curved| curved.along[across][end][along]);
            let missed = old.beyond(sums[1] - sums[0], centres[0][place], centres[1][place]);
            *swept += if (across == 0) == (end == 1) { missed } else { -missed };
        }
    }
}

/// At which end of an axis a face across it lies on a side; nothing where it is inside.
fn side(patch: &Patch<2>, place: [usize; 2], axis: usize) -> Option<usize> {
    match place[axis] {
        _ if patch.wraps[axis] => None,
        0 => Some(0),
        last if last == patch.size[axis] => Some(1),
        _ => None,
    }
}
