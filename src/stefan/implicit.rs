//! The implicit step: front and temperatures together, by TR-BDF2.

use super::balance::Instant;
use super::columns::{LOWER, UPPER};
use super::conduct::{Edges, Fields, present, velocity};
use super::energy::Energy;
use super::response::Response;
use super::solver::{Front, FrontState, Problem};
use crate::error::{Failure, Result};
use crate::numerics::larger;
use crate::work::Work;

/// Newton's method has converged once the residual of the front is below this share of the height of the box.
const CONVERGED: f64 = 1e-11;
/// Round-off of a height, as a share of its distance from the origin: some fifty units in the last place.
const ROUNDING: f64 = 1e-14;
/// Newton steps after which a time step is given up. Seven are usual.
const MOST_STEPS: usize = 40;

/// d = 1 − 1/√2, the share of the step that is implicit in both stages.
const IMPLICIT: f64 = 1.0 - std::f64::consts::FRAC_1_SQRT_2;
/// √2/4, the weight of the start and of the middle in the whole step.
const OUTER: f64 = 0.5 * std::f64::consts::FRAC_1_SQRT_2;
/// Weights of the three instants in the embedded formula of third order, less those of the step.
const EMBEDDED: [f64; 3] = [(1.0 - OUTER) / 3.0 - OUTER, 1.0 / 3.0, IMPLICIT / 3.0 - IMPLICIT];

impl Front {
    /// A step of TR-BDF2 to time `t`
    ///
    /// ```text
    /// v* = vⁿ + d Δt v'(tⁿ, vⁿ)              v¹ = v* + d Δt v'(tⁿ + 2d Δt, v¹)        v = (h, u),  d = 1 − 1/√2
    /// v° = (v¹ (√2 + 1) − vⁿ (√2 − 1)) / 2     vⁿ⁺¹ = v° + d Δt v'(tⁿ⁺¹, vⁿ⁺¹)
    /// ```
    ///
    /// u' is the rate at a node that moves with the front. `slopes` are ∂u/∂y at the start.
    ///
    /// # Source
    /// Bank and others, *Transient simulation of silicon devices and circuits* (1985); Hosea and Shampine, *Analysis
    /// and implementation of TR-BDF2* (1996), for the estimate of the error.
    pub(super) fn tr_bdf2(
        &mut self,
        problem: &dyn Problem,
        state: &FrontState,
        slopes: &[Vec<f64>; 2],
        t: f64,
    ) -> Result<(Fields, Energy, Work, Option<f64>)> {
        let mut work = Work::default();
        let tau = IMPLICIT * (t - state.t);
        let start = state.fields();
        let leaned = self.leaned(problem, &start, slopes, [state.t, tau])?;
        let between = state.t + 2.0 * tau;
        let middle = self.newton(problem, &leaned, &start.h, [between, tau], &mut work)?;
        let root = std::f64::consts::SQRT_2;
        let base = Fields::sum([(0.5 * (root + 1.0), &middle), (0.5 * (1.0 - root), &start)]);
        let end = self.newton(problem, &base, &middle.h, [t, tau], &mut work)?;
        let instant =
            |t, weight: f64, fields, from| Instant { t, dt: weight * tau / IMPLICIT, fields, from, over: tau };
        // at the start the front has moved on by `tau` to where `leaned` is
        let behind = Fields::sum([(2.0, &start), (-1.0, &leaned)]);
        let instants = [
            instant(state.t, OUTER, &start, &behind.h),
            instant(between, OUTER, &middle, &leaned.h),
            instant(t, IMPLICIT, &end, &base.h),
        ];
        let energy = self.balance(problem, state, &end, &instants);
        let miss = Fields::sum([
            (EMBEDDED[0] / IMPLICIT, &Fields::sum([(1.0, &leaned), (-1.0, &start)])),
            (EMBEDDED[1] / IMPLICIT, &Fields::sum([(1.0, &middle), (-1.0, &leaned)])),
            (EMBEDDED[2] / IMPLICIT, &Fields::sum([(1.0, &end), (-1.0, &base)])),
        ]);
        let error = self.error(&miss, &end, &base, tau)?;
        work.linear_solves += 2;
        Ok((end, energy, work, Some(error)))
    }

    /// The state after an explicit step of Euler of length `dt` from `t`.
    fn leaned(
        &self,
        problem: &dyn Problem,
        start: &Fields,
        slopes: &[Vec<f64>; 2],
        [t, dt]: [f64; 2],
    ) -> Result<Fields> {
        let h = match start.alone {
            None => self.moved(problem, start, &start.h, slopes, [t + dt, dt])?,
            Some(_) => start.h.clone(),
        };
        let (old, new) = (self.heights(&start.h), self.heights(&h));
        let motion = [LOWER, UPPER].map(|phase| velocity(&old[phase], &new[phase], dt));
        let gain = self.gain(problem, start, &motion, [t, dt])?;
        let u = [LOWER, UPPER].map(|phase| start.u[phase].iter().zip(&gain[phase]).map(|(u, gain)| u + gain).collect());
        Ok(Fields { h, u, ..start.clone() })
    }

    /// The size of an estimated error: of the front against its distance from the nearer wall, of the temperatures,
    /// damped like the last stage, against their range.
    fn error(&mut self, miss: &Fields, end: &Fields, base: &Fields, tau: f64) -> Result<f64> {
        let mut error = 0.0_f64;
        for (i, (miss, h)) in miss.h.iter().zip(&end.h).enumerate() {
            if !self.held_at(i) {
                error = larger(error, miss / self.columns.room(i, *h));
            }
        }
        let all = || end.u.iter().flatten().copied();
        let range = all().fold(f64::MIN, f64::max) - all().fold(f64::MAX, f64::min);
        let (old, new) = (self.heights(&base.h), self.heights(&end.h));
        for phase in present(end.alone) {
            let zero = vec![0.0; end.u[phase].len()];
            let mut solver = std::mem::take(&mut self.solvers[phase]);
            let motion = velocity(&old[phase], &new[phase], tau);
            let fields = [&new[phase][..], &miss.u[phase], &zero];
            let edges = Edges::default();
            let step = self.heat(end.reach(phase), tau, fields, Some(&motion), &edges);
            let damped = step.solve(&mut solver, self.laplacian);
            self.solvers[phase] = solver;
            let (damped, work) = damped?;
            self.spent += work;
            error = larger(error, damped.into_iter().fold(0.0, larger) / range.max(f64::MIN_POSITIVE));
        }
        Ok(error)
    }

    /// Front and temperatures v = `from` + dt v'(t, v) at time `t`, sought from the front `guess`.
    fn newton(
        &mut self,
        problem: &dyn Problem,
        from: &Fields,
        guess: &[f64],
        [t, dt]: [f64; 2],
        work: &mut Work,
    ) -> Result<Fields> {
        if from.alone.is_some() {
            let u = self.conduct(problem, from, (guess, &from.u), [t, dt])?;
            work.linear_solves += 1;
            return Ok(Fields { h: guess.to_vec(), u, ..from.clone() });
        }
        let response = match self.response.take() {
            Some((known, response)) if known == dt => response,
            _ => Response::new(&self.columns, &self.material, dt),
        };
        let [tolerance, rounding] = self.tolerances(from, dt);
        let mut h = guess.to_vec();
        self.hold_ends(problem, &mut h, t);
        let (mut miss, mut last) = (f64::INFINITY, None);
        for _ in 0..MOST_STEPS {
            self.columns.check(&h, &from.bare)?;
            let u = self.conduct(problem, from, (&h, last.as_ref().unwrap_or(&from.u)), [t, dt])?;
            work.linear_solves += 2;
            work.newton_iterations += 1;
            let slopes = self.slopes(&h, &u, &from.bare);
            let target = self.moved(problem, from, &h, &slopes, [t, dt])?;
            let residual: Vec<f64> = h.iter().zip(&target).map(|(h, target)| h - target).collect();
            let before = std::mem::replace(&mut miss, residual.iter().copied().fold(0.0, larger));
            // near its round-off the residual falls as long as it can
            if miss <= tolerance || miss <= tolerance + rounding && miss > 0.5 * before {
                self.response = Some((dt, response));
                return Ok(Fields { h, u, ..from.clone() });
            }
            let correction = response.correct(self, (&h, &from.bare), &slopes, dt, &residual);
            h.iter_mut().zip(correction).for_each(|(h, c)| *h += c);
            last = Some(u);
        }
        Err(Failure::NewtonStalled { residual: miss, tolerance, iterations: MOST_STEPS }.into())
    }

    /// The residual of the front at which Newton's method has converged, and its round-off.
    fn tolerances(&self, from: &Fields, dt: f64) -> [f64; 2] {
        let columns = &self.columns;
        let height = (0..from.h.len()).map(|i| columns.gap(i)).fold(0.0, f64::max);
        // heights have the round-off of their distance from the origin
        let farthest = [LOWER, UPPER].into_iter().flat_map(|phase| columns.wall(phase)).copied().fold(0.0, larger);
        // and the jump has that of the temperatures, over the distance of a row
        let y = self.heights(&from.h);
        let jump = |phase: usize| {
            let (size, nodes) = (from.u[phase].iter().copied().fold(0.0, larger), columns.rows(phase) + 1);
            let [front, _] = columns.ends(phase);
            let next = front.max(1) - 1 + usize::from(front == 0);
            let row = |i: usize| (y[phase][i * nodes + front] - y[phase][i * nodes + next]).abs();
            let thinnest = (0..from.h.len()).filter(|&i| from.bare[i].is_none()).map(row).fold(height, f64::min);
            self.material.conductivity[phase] * size / thinnest
        };
        let speed = (jump(LOWER) + jump(UPPER)) / self.material.latent_heat;
        [CONVERGED * height, ROUNDING * (farthest + 10.0 * dt * speed)]
    }
}
