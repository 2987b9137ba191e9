use super::{Simulation, State};
use crate::error::{Error, Moment, Result};
use crate::geometry::{DualCells, Mesh, padded};
use crate::numerics::larger;
use crate::physics::Motion;

/// Steps as long as the solution allows: seen from a fixed place, the unknown that the mesh follows changes by about an
/// eighth of its range in each
///
/// Such a step carries a front over half of its width, whatever its width and speed are. The next step is chosen from the
/// change in the last one and never refused; a trial on the resting mesh chooses the first.
#[derive(Debug, Clone)]
pub(super) struct Pace {
    dt: f64,
    longest: f64,
}

/// Change in a step, as a share of the range.
const CHANGE: f64 = 0.125;
/// A step is at most so much longer and shorter than the one before.
const GROWTH: [f64; 2] = [0.5, 1.2];
/// Steps in a run in which nothing changes.
const FEWEST: f64 = 100.0;
/// The first trial, as a share of the longest step, and how many there may be, each a hundredth of the one before.
const TRIAL: f64 = 1e-2;
const TRIALS: usize = 3;

impl Pace {
    /// The first step from a state.
    pub fn new(simulation: &mut Simulation, state: &State) -> Result<Self> {
        let longest = (simulation.schedule.end() - simulation.schedule.start()) / FEWEST;
        let mut trial = TRIAL * longest;
        let mut number = 1;
        loop {
            let motion = Motion { t: state.t, dt: trial, old: &state.mesh, new: &state.mesh };
            match simulation.physics.step(motion, &state.u) {
                Ok((u, _)) => {
                    let share = change(&state.mesh, &state.mesh, &first(&state.u), &first(&u));
                    // a trial in which too much happens says little
                    if share <= CHANGE || number == TRIALS {
                        return Ok(Self { dt: (trial * CHANGE / share).min(longest), longest });
                    }
                }
                Err(failure) if number == TRIALS => {
                    return Err(Error::Failed { failure, moment: Some(Moment { t: state.t + trial, step: 1 }) });
                }
                Err(_) => {}
            }
            trial *= 0.01;
            number += 1;
        }
    }

    /// Length of the next step, if nothing ends before.
    pub fn step(&self) -> f64 {
        self.dt
    }

    /// Learns from a step.
    pub fn learn(&mut self, before: &State, after: &State) {
        let share = change(&before.mesh, &after.mesh, &first(&before.u), &first(&after.u));
        // a step that was cut short to meet a report says what a whole one would have done
        let whole = share * self.dt / (after.t - before.t);
        let factor = if whole.is_finite() { (CHANGE / whole).clamp(GROWTH[0], GROWTH[1]) } else { GROWTH[0] };
        self.dt = (self.dt * factor).min(self.longest);
    }
}

fn first(u: &crate::geometry::Field) -> Vec<[f64; 1]> {
    u.component(0).map(|u| [u]).collect()
}

/// The largest change of u at a fixed place on the way from one mesh to another, over the range of u; 0 for constants.
fn change(old: &Mesh<2>, new: &Mesh<2>, before: &[[f64; 1]], after: &[[f64; 1]]) -> f64 {
    let (from, to) = (DualCells::new(old), DualCells::new(new));
    let swept = from.swept(&to);
    let strides = to.patch().padded_strides();
    let [before, after] = [before, after].map(|u| padded(new.lattice(), u, [[0.0]; 2]));
    let middle = |k: usize, n: usize| 0.25 * ((before[k][0] + before[n][0]) + (after[k][0] + after[n][0]));
    let (mut largest, mut low, mut high) = (0.0, f64::INFINITY, f64::NEG_INFINITY);
    for (i, k) in to.patch().places().enumerate() {
        // what the moving mesh alone would have made of the old values
        let mut carried = from.areas()[i] * before[k][0];
        for (d, s) in strides.into_iter().enumerate() {
            carried += swept[k][d] * middle(k, k + s) - swept[k - s][d] * middle(k - s, k);
        }
        largest = larger(largest, after[k][0] - carried / to.areas()[i]);
        (low, high) = (low.min(after[k][0]), high.max(after[k][0]));
    }
    // differences below this are of rounding
    if high - low > 1e-12 * low.abs().max(high.abs()) { largest / (high - low) } else { 0.0 }
}
