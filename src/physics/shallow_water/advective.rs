use super::super::curvilinear::gradient;
use super::{Block, Gravity, Scheme, Water};

/// The advective form at the nodes, by central differences.
pub(super) struct Advective<'a> {
    pub dt: f64,
    pub gravity: Gravity,
    pub strides: [usize; 2],
    /// Positions at the start and at the end of the step, padded.
    pub old: &'a [[f64; 2]],
    pub new: &'a [[f64; 2]],
}

/// Half of Δt R at a node, with the velocity relative to the node and the derivatives of (h, u, v).
struct Half {
    past: [f64; 2],
    slopes: [[f64; 2]; 3],
    value: Water,
}

impl Advective<'_> {
    fn star(&self, k: usize) -> [usize; 4] {
        let [s, t] = self.strides;
        [k - s, k + s, k - t, k + t]
    }

    /// ½Δt ((ẋ − u)·∇(h, u, v) − (h ∇·u, g h_x, g h_y)) on a mesh.
    fn half(&self, x: &[[f64; 2]], weights: &[[f64; 2]; 4], w: &[Water], k: usize) -> Half {
        debug_assert_eq!(x.len(), w.len());
        let [h, u, v] = w[k];
        let moved = [0, 1].map(|d| (self.new[k][d] - self.old[k][d]) / self.dt);
        let past = [moved[0] - u, moved[1] - v];
        let mut slopes = [[0.0; 2]; 3];
        for (weight, n) in weights.iter().zip(self.star(k)) {
            (0..3).for_each(|c| (0..2).for_each(|d| slopes[c][d] += weight[d] * w[n][c]));
        }
        let gained = [h * (slopes[1][0] + slopes[2][1]), self.gravity * slopes[0][0], self.gravity * slopes[0][1]];
        let value =
            std::array::from_fn(|c| 0.5 * self.dt * (past[0] * slopes[c][0] + past[1] * slopes[c][1] - gained[c]));
        Half { past, slopes, value }
    }
}

impl Scheme for Advective<'_> {
    fn scales(&self, depth: f64, speed: f64) -> Water {
        [depth, speed, speed]
    }

    fn courant(&self, _i: usize, k: usize) -> f64 {
        self.dt * gradient(self.new, k, self.strides).iter().map(|w| w[0].hypot(w[1])).sum::<f64>()
    }

    fn known(&self, w: &[Water], _i: usize, k: usize) -> Water {
        let half = self.half(self.old, &gradient(self.old, k, self.strides), w, k);
        std::array::from_fn(|c| w[k][c] + half.value[c])
    }

    fn unknown(&self, w: &[Water], _i: usize, k: usize) -> Water {
        let half = self.half(self.new, &gradient(self.new, k, self.strides), w, k);
        std::array::from_fn(|c| w[k][c] - half.value[c])
    }

    fn jacobian(&self, w: &[Water], _i: usize, k: usize) -> [Block; 5] {
        let weights = gradient(self.new, k, self.strides);
        let Half { past, slopes: [dh, du, dv], .. } = self.half(self.new, &weights, w, k);
        let (h, g, half) = (w[k][0], self.gravity, 0.5 * self.dt);
        let mut row = [[[0.0; 3]; 3]; 5];
        row[0] = [
            [1.0 + half * (du[0] + dv[1]), half * dh[0], half * dh[1]],
            [0.0, 1.0 + half * du[0], half * du[1]],
            [0.0, half * dv[0], 1.0 + half * dv[1]],
        ];
        for (block, weight) in row[1..].iter_mut().zip(weights) {
            let carried = half * (past[0] * weight[0] + past[1] * weight[1]);
            let [x, y] = weight.map(|w| half * w);
            *block = [[-carried, h * x, h * y], [g * x, -carried, 0.0], [g * y, 0.0, -carried]];
        }
        row
    }

    fn finish(&self, _known: &Water, w: &[Water], _i: usize, k: usize) -> Water {
        w[k]
    }
}
