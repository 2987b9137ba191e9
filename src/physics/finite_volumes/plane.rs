//! Finite volumes in the plane: four faces around a dual cell, nine nodes in a stencil.

use super::{Around, Block, Crossing, Face, Half, Law, Made, add};
use crate::geometry::Patch;
use crate::parallel;

impl Around<2, 9> for Half<'_, 2> {
    fn faces<const B: usize, L: Law<B, 2>>(
        &self,
        law: &L,
        made: &Made<'_, L::Node, B, 2>,
        u: &[[f64; B]],
    ) -> Vec<[Face<B>; 2]> {
        let patch = self.cells.patch();
        let ([n, m], wraps) = (patch.size, patch.wraps);
        let s = m + 2;
        let mut faces = vec![[Face::CLOSED; 2]; u.len()];
        parallel::for_each_row(&mut faces, s, |p, row| {
            if p == 0 || p > n {
                return;
            }
            for (q, faces) in row.iter_mut().enumerate().take(m + 1).skip(1) {
                let k = p * s + q;
                if p < n || wraps[0] {
                    faces[0] = self.between(law, made, u, [k, k + s], 0);
                }
                if q < m || wraps[1] {
                    faces[1] = self.between(law, made, u, [k, k + 1], 1);
                }
            }
        });
        patch.wrap(&mut faces);
        self.open(law, made.nodes, u, &mut faces);
        faces
    }

    fn change<const B: usize>(&self, u: &[[f64; B]], k: usize, axis: usize) -> [f64; B] {
        let [p, q, r, s] = self.ends(k, axis).map(|k| &u[k]);
        std::array::from_fn(|c| (p[c] + q[c]) - (r[c] + s[c]))
    }

    #[inline(always)]
    fn leaving<const B: usize>(&self, faces: &[[Face<B>; 2]], k: usize) -> [f64; B] {
        let [right, left, top, bottom] = self.around(faces, k);
        std::array::from_fn(|c| {
            (right.crossing.value[c] - left.crossing.value[c]) + (top.crossing.value[c] - bottom.crossing.value[c])
        })
    }

    #[inline(always)]
    fn row<const B: usize>(&self, faces: &[[Face<B>; 2]], i: usize, k: usize) -> [Block<B>; 9] {
        let [right, left, top, bottom] = self.around(faces, k);
        let share = 1.0 / self.cells.areas()[i];
        let mut row = [[[0.0; B]; B]; 9];
        for (face, sign, own, other) in
            [(right, share, true, 2), (left, -share, false, 1), (top, share, true, 4), (bottom, -share, false, 3)]
        {
            let Crossing { by_below, by_above, .. } = &face.crossing;
            let (mine, theirs) = if own { (by_below, by_above) } else { (by_above, by_below) };
            add(&mut row[0], sign, mine);
            add(&mut row[other], sign, theirs);
        }
        #[allow(clippy::needless_range_loop)] // c is an equation and an unknown
        for c in 0..B {
            row[0][c][c] += 1.0;
            for e in 0..B {
                // the ends b and a of the four faces, as points of the stencil
                for (weight, b, a) in [
                    (share * right.tangent[c][e], [4, 8], [3, 7]),
                    (-share * left.tangent[c][e], [6, 4], [5, 3]),
                    (share * top.tangent[c][e], [1, 6], [2, 8]),
                    (-share * bottom.tangent[c][e], [5, 1], [7, 2]),
                ] {
                    b.into_iter().for_each(|point| row[point][c][e] += weight);
                    a.into_iter().for_each(|point| row[point][c][e] -= weight);
                }
            }
        }
        row
    }

    fn fold_sides<const B: usize>([[left, right], [below, above]]: [[bool; 2]; 2], row: &mut [Block<B>; 9]) {
        let mut fold = |from: usize, to: usize| {
            let block = std::mem::replace(&mut row[from], [[0.0; B]; B]);
            add(&mut row[to], 1.0, &block);
        };
        // the three points beyond each side, as (from, to)
        for (beyond, points) in [
            (left, [(1, 0), (5, 3), (6, 4)]),
            (right, [(2, 0), (7, 3), (8, 4)]),
            (below, [(3, 0), (5, 1), (7, 2)]),
            (above, [(4, 0), (6, 1), (8, 2)]),
        ] {
            if beyond {
                points.into_iter().for_each(|(from, to)| fold(from, to));
            }
        }
    }

    fn repeat_sides<const B: usize>(patch: &Patch<2>, u: &mut [[f64; B]]) {
        let [n, m] = patch.size;
        let s = m + 2;
        patch.wrap(u);
        if !patch.wraps[1] {
            for p in 0..n + 2 {
                (u[p * s], u[p * s + m + 1]) = (u[p * s + 1], u[p * s + m]);
            }
        }
        if !patch.wraps[0] {
            u.copy_within(s..2 * s, 0);
            u.copy_within(n * s..(n + 1) * s, (n + 1) * s);
        }
    }
}

impl Half<'_, 2> {
    /// The face between two places.
    #[inline(always)]
    fn between<const B: usize, L: Law<B, 2>>(
        &self,
        law: &L,
        made: &Made<'_, L::Node, B, 2>,
        u: &[[f64; B]],
        [i, k]: [usize; 2],
        axis: usize,
    ) -> Face<B> {
        let (d, [nx, ny]) = (self.way(i, k), self.cells.normals()[i][axis]);
        let [p, q, r, s] = self.ends(i, axis).map(|k| &u[k]);
        self.face(law, made, u, [i, k], axis, d[0] * ny - d[1] * nx, |c| (p[c] + q[c]) - (r[c] + s[c]))
    }

    /// The places around the end b of the face above a place, then those around its end a.
    #[inline(always)]
    fn ends(&self, k: usize, axis: usize) -> [usize; 4] {
        let s = self.cells.patch().size[1] + 2;
        match axis {
            0 => [k + 1, k + s + 1, k - 1, k + s - 1],
            _ => [k - s, k - s + 1, k + s, k + s + 1],
        }
    }

    /// The faces of a dual cell: above and below along ξ, above and below along η.
    fn around<'f, const B: usize>(&self, faces: &'f [[Face<B>; 2]], k: usize) -> [&'f Face<B>; 4] {
        let s = self.cells.patch().size[1] + 2;
        [&faces[k][0], &faces[k - s][0], &faces[k][1], &faces[k - 1][1]]
    }
}
