use crate::geometry::Patch;

/// How a coarse level lies in a fine one, along one axis
///
/// Every second node is kept: the I-th kept node is the 2I-th of all. Of an odd number of nodes on a periodic axis the
/// last one is kept, too, and its edge to the first one stays as it is.
#[derive(Debug, Clone, Copy)]
pub(super) struct Halving {
    pub axis: usize,
    wraps: bool,
    /// Number of unknowns along the axis before and after halving.
    size: [usize; 2],
    /// Number of padded lines along the axes before this one, and distance in memory between neighbours along this
    /// axis.
    outer: usize,
    inner: usize,
}

impl Halving {
    /// Whether there are nodes to leave out: at least two on a periodic axis, three between sides.
    pub fn possible<const D: usize>(patch: &Patch<D>, axis: usize) -> bool {
        patch.size[axis] > if patch.wraps[axis] { 1 } else { 2 }
    }

    pub fn of<const D: usize>(patch: &Patch<D>, axis: usize) -> Self {
        let (n, wraps) = (patch.size[axis], patch.wraps[axis]);
        let outer = patch.size[..axis].iter().map(|n| n + 2).product();
        let inner = patch.padded_strides()[axis];
        Self { axis, wraps, size: [n, if wraps { n.div_ceil(2) } else { n / 2 }], outer, inner }
    }

    pub fn patch<const D: usize>(&self, fine: &Patch<D>) -> Patch<D> {
        let mut size = fine.size;
        size[self.axis] = self.size[1];
        Patch { origin: [0; D], size, wraps: fine.wraps }
    }

    /// The place on the fine level of the I-th place on the coarse one, rings included.
    fn kept(&self, i: usize) -> usize {
        (2 * i).min(self.size[0] + usize::from(!self.wraps))
    }

    /// Whether a node was left out between the I-th place and the one below.
    fn skips(&self, i: usize) -> bool {
        self.kept(i) == self.kept(i - 1) + 2
    }

    /// The range of the i-th line across the axis, in the o-th block of an array with `n` unknowns along the axis.
    fn line(&self, o: usize, i: usize, n: usize) -> std::ops::Range<usize> {
        let start = (o * (n + 2) + i) * self.inner;
        start..start + self.inner
    }

    /// Block by block the lines from 1 to `last`.
    fn lines(&self, last: usize) -> impl Iterator<Item = (usize, usize)> + use<> {
        (0..self.outer).flat_map(move |o| (1..=last).map(move |i| (o, i)))
    }

    /// Adds to each kept node its own fine value and half of that on each neighbour that was left out.
    pub fn restrict<T: Copy>(&self, fine: &[T], coarse: &mut [T], add: impl Fn(&mut T, f64, &T)) {
        let [n, m] = self.size;
        for (o, i) in self.lines(m) {
            let kept = self.kept(i);
            let to = &mut coarse[self.line(o, i, m)];
            to.copy_from_slice(&fine[self.line(o, kept, n)]);
            // above the last node of a periodic axis lies the first one
            let above = if self.wraps && i == m { 1 } else { i + 1 };
            for (from, shares) in [(kept - 1, self.skips(i)), (kept + 1, self.skips(above))] {
                if shares {
                    to.iter_mut().zip(&fine[self.line(o, from, n)]).for_each(|(to, from)| add(to, 0.5, from));
                }
            }
        }
    }

    /// The edges along the axis: two edges in a row become one with half of their mean conductance.
    pub fn join(&self, fine: &[f64], coarse: &mut [f64]) {
        let [n, m] = self.size;
        for (o, i) in self.lines(m + usize::from(!self.wraps)) {
            let kept = self.kept(i);
            let to = &mut coarse[self.line(o, i, m)];
            to.copy_from_slice(&fine[self.line(o, kept, n)]);
            if self.skips(i) {
                to.iter_mut().zip(&fine[self.line(o, kept - 1, n)]).for_each(|(to, from)| *to = 0.25 * (*to + from));
            }
        }
    }

    /// Interpolates linearly: adds to each kept node its coarse value, and to nodes in between the mean of both
    /// neighbours.
    pub fn prolong<const K: usize>(&self, coarse: &[[f64; K]], fine: &mut [[f64; K]]) {
        let [n, m] = self.size;
        for (o, i) in self.lines(m + 1) {
            let kept = self.kept(i);
            let (below, here) = (&coarse[self.line(o, i - 1, m)], &coarse[self.line(o, i, m)]);
            if i <= m {
                fine[self.line(o, kept, n)].iter_mut().zip(here).for_each(|(to, from)| add(to, 1.0, from));
            }
            if self.skips(i) {
                let to = &mut fine[self.line(o, kept - 1, n)];
                for (to, (below, here)) in to.iter_mut().zip(below.iter().zip(here)) {
                    (0..K).for_each(|c| to[c] += 0.5 * (below[c] + here[c]));
                }
            }
        }
    }
}

/// sum ← sum + share · v
pub(super) fn add<const K: usize>(sum: &mut [f64; K], share: f64, v: &[f64; K]) {
    (0..K).for_each(|c| sum[c] += share * v[c]);
}
