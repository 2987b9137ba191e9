//! Finite volumes on a line: two faces around a dual cell, three nodes in a stencil.

use super::{Around, Block, Crossing, Face, Half, Law, Made, add};
use crate::geometry::Patch;

impl Around<1, 3> for Half<'_, 1> {
    fn faces<const B: usize, L: Law<B, 1>>(
        &self,
        law: &L,
        made: &Made<'_, L::Node, B, 1>,
        u: &[[f64; B]],
    ) -> Vec<[Face<B>; 1]> {
        let patch = self.cells.patch();
        let last = if patch.wraps[0] { patch.size[0] } else { patch.size[0] - 1 };
        let mut faces = vec![[Face::CLOSED]; u.len()];
        for (k, face) in faces.iter_mut().enumerate().take(last + 1).skip(1) {
            *face = [self.face(law, made, u, [k, k + 1], 0, 0.0, |_| 0.0)];
        }
        patch.wrap(&mut faces);
        self.open(law, made.nodes, u, &mut faces);
        faces
    }

    fn change<const B: usize>(&self, _u: &[[f64; B]], _k: usize, _axis: usize) -> [f64; B] {
        [0.0; B]
    }

    fn leaving<const B: usize>(&self, faces: &[[Face<B>; 1]], k: usize) -> [f64; B] {
        let [right, left] = [&faces[k][0], &faces[k - 1][0]];
        std::array::from_fn(|c| right.crossing.value[c] - left.crossing.value[c])
    }

    fn row<const B: usize>(&self, faces: &[[Face<B>; 1]], i: usize, k: usize) -> [Block<B>; 3] {
        let Crossing { by_below: own, by_above: above, .. } = &faces[k][0].crossing;
        let Crossing { by_below: below, by_above: mine, .. } = &faces[k - 1][0].crossing;
        let share = 1.0 / self.cells.areas()[i];
        let mut row = [[[0.0; B]; B]; 3];
        for (point, sign, block) in [(0, share, own), (2, share, above), (0, -share, mine), (1, -share, below)] {
            add(&mut row[point], sign, block);
        }
        (0..B).for_each(|c| row[0][c][c] += 1.0);
        row
    }

    fn fold_sides<const B: usize>([beyond]: [[bool; 2]; 1], row: &mut [Block<B>; 3]) {
        for (end, point) in beyond.into_iter().zip([1, 2]) {
            if end {
                let block = std::mem::replace(&mut row[point], [[0.0; B]; B]);
                add(&mut row[0], 1.0, &block);
            }
        }
    }

    fn repeat_sides<const B: usize>(patch: &Patch<1>, u: &mut [[f64; B]]) {
        let n = patch.size[0];
        patch.wrap(u);
        if !patch.wraps[0] {
            (u[0], u[n + 1]) = (u[1], u[n]);
        }
    }
}
