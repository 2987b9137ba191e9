use serde::{Deserialize, Serialize};

/// Steps by the error of a step, which is of the third order in its length: a PI controller
///
/// ```text
/// Δt ← Δt (1/eₙ)^(0.7/3) (eₙ₋₁)^(0.4/3),   eₙ = error of step n over four fifths of the tolerance
/// ```
///
/// The second factor damps what the first would make swing. After a refusal Δt ← Δt (1/e)^(1/3), and the next step is
/// no longer.
///
/// # Source
/// Gustafsson, *Control-theoretic techniques for stepsize selection in implicit Runge-Kutta methods* (1994), with k_I =
/// 0.3 and k_P = 0.4: PI.3.4 of Söderlind, *Digital filters in adaptive time-stepping* (2003). Hairer and Wanner,
/// *Solving Ordinary Differential Equations II*, IV.2.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub(super) struct Control {
    tolerance: f64,
    /// e of the last step that was taken; 1 before any.
    before: f64,
    /// Whether the last step was refused.
    refused: bool,
}

/// Order of the error of a step in its length.
const ORDER: f64 = 3.0;
/// Weight of the newest error in the exponent of the next step length.
const NEWEST: f64 = 0.7;
/// Weight of the error of the step before in the exponent of the next step length.
const BEFORE: f64 = 0.4;
/// Error of a step at which steps aim, as a share of the tolerance, so that few are refused.
const AIM: f64 = 0.8;
/// Factors by which a step is at most shorter and longer than the one before it.
const GROWTH: [f64; 2] = [0.2, 2.0];
/// Smallest e, the error of a step over the error that steps aim at: a step in which nothing changes has an error of 0,
/// by which the formula divides.
const LEAST: f64 = 1e-4;

impl Control {
    pub fn to(tolerance: f64) -> Self {
        Self { tolerance, before: 1.0, refused: false }
    }

    pub fn is_sound(&self, tolerance: f64) -> bool {
        self.tolerance == tolerance && self.before.is_finite() && self.before >= LEAST
    }

    /// Whether a step with this error is taken, and the factor by which the next is longer than the whole step, of
    /// which this one was the part 1/`cut`.
    pub fn judge(&mut self, error: f64, cut: f64) -> (bool, f64) {
        // not `>`: an error that is no number is too large
        let taken = error <= self.tolerance;
        let whole = error * cut.powf(ORDER) / (AIM * self.tolerance);
        let e = if whole.is_finite() { whole.max(LEAST) } else { f64::MAX };
        if !taken {
            self.refused = true;
            return (false, e.powf(-1.0 / ORDER).clamp(GROWTH[0], 1.0 - GROWTH[0]));
        }
        let factor = e.powf(-NEWEST / ORDER) * self.before.powf(BEFORE / ORDER);
        let most = if self.refused { 1.0 } else { GROWTH[1] };
        (self.before, self.refused) = (e, false);
        (true, factor.clamp(GROWTH[0], most))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Where e = c Δt³ steps settle on Δt with c Δt³ = 0.8 of the tolerance, from far above and far below.
    #[test]
    fn steps_settle_where_the_error_is_what_they_aim_at() {
        for start in [1e-4, 1.0] {
            let mut control = Control::to(1e-3);
            let (mut dt, mut refused): (f64, usize) = (start, 0);
            for _ in 0..60 {
                let (taken, factor) = control.judge(5.0 * dt.powi(3), 1.0);
                refused += usize::from(!taken);
                dt *= factor;
            }
            let error = 5.0 * dt.powi(3);
            assert!((error / 0.8e-3 - 1.0).abs() < 1e-3, "{error:e} from Δt = {start}");
            assert_eq!(refused > 0, start == 1.0);
        }
    }

    /// A step that was cut to meet a report does not shorten the next.
    #[test]
    fn a_cut_step_is_judged_as_a_whole_one() {
        let [whole, cut] =
            [(0.8e-3, 1.0), (0.8e-3 / 1000.0, 10.0)].map(|(error, cut)| Control::to(1e-3).judge(error, cut));
        assert!(whole.0 && cut.0 && (whole.1 - 1.0).abs() < 1e-12 && (cut.1 - 1.0).abs() < 1e-12, "{whole:?} {cut:?}");
    }

    #[test]
    fn an_error_that_is_no_number_refuses_the_step() {
        assert_eq!(Control::to(1e-3).judge(f64::NAN, 1.0), (false, 0.2));
        assert_eq!(Control::to(1e-3).judge(f64::INFINITY, 1.0), (false, 0.2));
    }
}
