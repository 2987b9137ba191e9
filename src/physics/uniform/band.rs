//! A substep, band by band of rows.

use super::{Grid, Stencil};
use crate::parallel;

impl<const G: usize> Grid<'_, G> {
    /// One substep of classical RK4 from `u` at t to `next`.
    pub(super) fn substep(&self, t: f64, dt: f64, u: &[f64], next: &mut [f64], scratch: &mut [f64]) {
        let (w, m) = (self.width, self.size[0] as isize);
        // rows beyond the ends at time t: indices 0 … G − 1 before the first row, G … 2G − 1 after the last one
        let mut outside = vec![0.0; if self.periodic[0] { 0 } else { 2 * G * w }];
        for (k, row) in outside.chunks_exact_mut(w).enumerate() {
            self.fill_row(t, if k < G { k as isize - G as isize } else { m + (k - G) as isize }, row);
        }
        let by = [0.5 * dt, 0.5 * dt, dt, dt / 6.0].map(|s| self.stencil.scaled(s));
        let stages = Stages { grid: self, t, dt, u, outside: &outside, by };
        parallel::for_each_row_pair(next, self.band * w, scratch, 3 * Self::KEPT * w, |band, next, scratch| {
            let first = band * self.band;
            pulp::Arch::new().dispatch(Band { stages: &stages, first, next, scratch });
        });
    }

    /// Takes a band of rows through all stages
    ///
    /// ```text
    /// u₁ = u + Δt/2 R(u)   u₂ = u + Δt/2 R(u₁)   u₃ = u + Δt R(u₂)   next = (−u + u₁ + 2u₂ + u₃)/3 + Δt/6 R(u₃)
    /// ```
    ///
    /// Each stage follows G rows behind the one before it, so that the rows that it reads are still in the cache.
    #[inline(always)]
    fn advance_band(&self, stages: &Stages<'_, G>, first: usize, next: &mut [f64], scratch: &mut [f64]) {
        let (w, g) = (self.width, G as isize);
        let (low, high) = (first as isize, (first + self.band).min(self.size[0]) as isize);
        let (u1, rest) = scratch.split_at_mut(Self::KEPT * w);
        let (u2, u3) = rest.split_at_mut(Self::KEPT * w);
        let reached = |i: isize| self.periodic[0] || (-g..self.size[0] as isize + g).contains(&i);
        for newest in low - 3 * g..high + 3 * g {
            if reached(newest) {
                self.first_stage(stages, newest, u1);
            }
            let i = newest - g;
            if i >= low - 2 * g && reached(i) {
                self.second_stage(stages, i, u1, u2);
            }
            let i = newest - 2 * g;
            if i >= low - g && reached(i) {
                self.third_stage(stages, i, u2, u3);
            }
            let i = newest - 3 * g;
            if i >= low {
                self.last_stage(stages, i, [u1, u2, u3], &mut next[(i - low) as usize * w..][..w]);
            }
        }
    }

    #[inline(always)]
    fn first_stage(&self, stages: &Stages<'_, G>, i: isize, u1: &mut [f64]) {
        let (w, n, to) = (self.width, self.size[1], self.slot(i));
        let t = stages.t + 0.5 * stages.dt;
        if self.is_outside(i) {
            return self.fill_row(t, i, &mut u1[to..][..w]);
        }
        let u = &self.base(stages, i)[G..][..n];
        stages.by[0].apply(|k| self.base(stages, i + k), &mut u1[to + G..][..n], |j, r| u[j] + r);
        self.fill_ends(t, i, &mut u1[to..][..w]);
    }

    /// The second stage of RK4 for a row; its time is that of the first stage.
    #[inline(always)]
    fn second_stage(&self, stages: &Stages<'_, G>, i: isize, u1: &[f64], u2: &mut [f64]) {
        let (w, n, to) = (self.width, self.size[1], self.slot(i));
        let from = &u1[to..][..w];
        if self.is_outside(i) {
            return u2[to..][..w].copy_from_slice(from);
        }
        let u = &self.base(stages, i)[G..][..n];
        stages.by[1].apply(|k| &u1[self.slot(i + k)..][..w], &mut u2[to + G..][..n], |j, r| u[j] + r);
        if self.periodic[1] {
            self.fill_ends(stages.t, i, &mut u2[to..][..w]);
        } else {
            u2[to..][..G].copy_from_slice(&from[..G]);
            u2[to + G + n..][..G].copy_from_slice(&from[G + n..]);
        }
    }

    #[inline(always)]
    fn third_stage(&self, stages: &Stages<'_, G>, i: isize, u2: &[f64], u3: &mut [f64]) {
        let (w, n, to) = (self.width, self.size[1], self.slot(i));
        let t = stages.t + stages.dt;
        if self.is_outside(i) {
            return self.fill_row(t, i, &mut u3[to..][..w]);
        }
        let u = &self.base(stages, i)[G..][..n];
        stages.by[2].apply(|k| &u2[self.slot(i + k)..][..w], &mut u3[to + G..][..n], |j, r| u[j] + r);
        self.fill_ends(t, i, &mut u3[to..][..w]);
    }

    #[inline(always)]
    fn last_stage(&self, stages: &Stages<'_, G>, i: isize, all: [&[f64]; 3], to: &mut [f64]) {
        let (w, n) = (self.width, self.size[1]);
        let u = &self.base(stages, i)[G..][..n];
        let [u1, u2, u3_ends] = all.map(|stage| &stage[self.slot(i)..][..w]);
        let [u1, u2] = [u1, u2].map(|row| &row[G..][..n]);
        stages.by[3].apply(
            |k| &all[2][self.slot(i + k)..][..w],
            &mut to[G..][..n],
            |j, r| u2[j] + ((u1[j] - u[j]) + (u3_ends[G + j] - u2[j])) * (1.0 / 3.0) + r,
        );
        if self.periodic[1] {
            self.fill_ends(stages.t, i, to);
        } else {
            to[..G].copy_from_slice(&u3_ends[..G]);
            to[G + n..].copy_from_slice(&u3_ends[G + n..]);
        }
    }

    /// Where row i of a stage is kept.
    #[inline(always)]
    fn slot(&self, i: isize) -> usize {
        i.rem_euclid(Self::KEPT as isize) as usize * self.width
    }

    /// Whether a row lies beyond a bounded end.
    #[inline(always)]
    fn is_outside(&self, i: isize) -> bool {
        !self.periodic[0] && !(0..self.size[0] as isize).contains(&i)
    }

    /// Row i at the start of the substep.
    #[inline(always)]
    fn base<'s>(&self, stages: &Stages<'s, G>, i: isize) -> &'s [f64] {
        let (w, m) = (self.width, self.size[0]);
        if self.periodic[0] {
            return &stages.u[i.rem_euclid(m as isize) as usize * w..][..w];
        }
        match usize::try_from(i) {
            Ok(i) if i < m => &stages.u[i * w..][..w],
            Ok(i) => &stages.outside[(G + i - m) * w..][..w],
            Err(_) => &stages.outside[(i + G as isize) as usize * w..][..w],
        }
    }
}

/// What all bands of a substep have in common.
struct Stages<'s, const G: usize> {
    grid: &'s Grid<'s, G>,
    t: f64,
    dt: f64,
    u: &'s [f64],
    outside: &'s [f64],
    /// R, multiplied by the length of each stage.
    by: [Stencil<G>; 4],
}

/// A band as a task for [`pulp`], which compiles it once more for wider vectors and runs what the machine supports.
/// Products and sums are not fused, so that the bits are the same on every machine.
struct Band<'s, const G: usize> {
    stages: &'s Stages<'s, G>,
    first: usize,
    next: &'s mut [f64],
    scratch: &'s mut [f64],
}

impl<const G: usize> pulp::WithSimd for Band<'_, G> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        self.stages.grid.advance_band(self.stages, self.first, self.next, self.scratch);
    }
}
