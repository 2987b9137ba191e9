use super::{Block, Gravity, Scheme, Water};
use crate::geometry::DualCells;

/// The flux form on dual cells: finite volumes.
pub(super) struct Flux<'a> {
    pub dt: f64,
    pub gravity: Gravity,
    pub old: &'a DualCells,
    pub new: &'a DualCells,
    /// The area that each face sweeps in the step, padded.
    pub swept: Vec<[f64; 2]>,
}

/// The fluxes through a face in the direction of its normal, in one half of the step, in terms of the means at its two
/// nodes.
struct Face {
    normal: [f64; 2],
    /// The area of water that passes the face: ½ (Δt ū·N − s).
    passed: f64,
    h: f64,
    u: f64,
    v: f64,
    /// The depths at the two nodes.
    depths: [f64; 2],
}

impl Flux<'_> {
    /// The face above place k.
    fn face(&self, cells: &DualCells, w: &[Water], k: usize, axis: usize) -> Face {
        let (a, b) = (&w[k], &w[k + self.new.patch().padded_strides()[axis]]);
        let [h, u, v] = std::array::from_fn(|c| 0.5 * (a[c] + b[c]));
        let normal = cells.normals()[k][axis];
        let passed = 0.5 * (self.dt * (u * normal[0] + v * normal[1]) - self.swept[k][axis]);
        Face { normal, passed, h, u, v, depths: [a[0], b[0]] }
    }

    /// Mass and momentum through the face above place k: h̄(ū·N) (1, ū) + ½g \overline{h²} N, minus what the moving
    /// face sweeps.
    fn through(&self, cells: &DualCells, w: &[Water], k: usize, axis: usize) -> Water {
        let Face { normal, passed, h, u, v, depths: [a, b] } = self.face(cells, w, k, axis);
        let mass = h * passed;
        let pressure = 0.125 * self.gravity * self.dt * (a * a + b * b);
        [mass, mass * u + pressure * normal[0], mass * v + pressure * normal[1]]
    }

    /// The sum of the fluxes out of the dual cell of place k, in one half of the step.
    fn leaving(&self, cells: &DualCells, w: &[Water], k: usize) -> Water {
        let mut sum = [0.0; 3];
        for (axis, stride) in cells.patch().padded_strides().into_iter().enumerate() {
            let (above, below) = (self.through(cells, w, k, axis), self.through(cells, w, k - stride, axis));
            (0..3).for_each(|c| sum[c] += above[c] - below[c]);
        }
        sum
    }

    /// Derivatives of [`through`](Self::through) on the new mesh by the nodes below and above the face.
    fn derivatives(&self, w: &[Water], k: usize, axis: usize) -> [Block; 2] {
        let Face { normal: [nx, ny], passed, h, u, v, depths } = self.face(self.new, w, k, axis);
        let (by_h, [by_u, by_v]) = (0.5 * passed, [nx, ny].map(|n| 0.25 * self.dt * h * n));
        let half = 0.5 * h * passed;
        depths.map(|depth| {
            let pressure = 0.25 * self.gravity * self.dt * depth;
            [
                [by_h, by_u, by_v],
                [by_h * u + pressure * nx, by_u * u + half, by_v * u],
                [by_h * v + pressure * ny, by_u * v, by_v * v + half],
            ]
        })
    }
}

impl Scheme for Flux<'_> {
    fn scales(&self, depth: f64, speed: f64) -> Water {
        [depth, depth * speed, depth * speed]
    }

    fn courant(&self, i: usize, k: usize) -> f64 {
        let faces = self.new.normals()[k].map(|[x, y]| x.hypot(y));
        self.dt * (faces[0] + faces[1]) / self.new.areas()[i]
    }

    fn known(&self, w: &[Water], i: usize, k: usize) -> Water {
        let (q, leaving) = (conserved(&w[k]), self.leaving(self.old, w, k));
        let (before, after) = (self.old.areas()[i], self.new.areas()[i]);
        std::array::from_fn(|c| (before * q[c] - leaving[c]) / after)
    }

    fn unknown(&self, w: &[Water], i: usize, k: usize) -> Water {
        let (q, leaving) = (conserved(&w[k]), self.leaving(self.new, w, k));
        std::array::from_fn(|c| q[c] + leaving[c] / self.new.areas()[i])
    }

    fn jacobian(&self, w: &[Water], i: usize, k: usize) -> [Block; 5] {
        let mut row = [[[0.0; 3]; 3]; 5];
        let per_area = 1.0 / self.new.areas()[i];
        let mut add = |point: usize, sign: f64, part: Block| {
            let entries = row[point].as_flattened_mut().iter_mut().zip(part.as_flattened());
            entries.for_each(|(entry, part)| *entry += sign * part);
        };
        for (axis, stride) in self.new.patch().padded_strides().into_iter().enumerate() {
            let [own, above] = self.derivatives(w, k, axis);
            add(0, per_area, own);
            add(2 + 2 * axis, per_area, above);
            let [below, own] = self.derivatives(w, k - stride, axis);
            add(0, -per_area, own);
            add(1 + 2 * axis, -per_area, below);
        }
        let [h, u, v] = w[k];
        add(0, 1.0, [[1.0, 0.0, 0.0], [u, h, 0.0], [v, 0.0, h]]);
        row
    }

    /// Evaluates the update formula once more: whatever one cell loses through a face the other one gains, so that mass
    /// and momentum are conserved however well Newton's method converged.
    fn finish(&self, known: &Water, w: &[Water], i: usize, k: usize) -> Water {
        let leaving = self.leaving(self.new, w, k);
        let [h, hu, hv] = std::array::from_fn(|c| known[c] - leaving[c] / self.new.areas()[i]);
        [h, hu / h, hv / h]
    }
}

fn conserved(&[h, u, v]: &Water) -> Water {
    [h, h * u, h * v]
}
