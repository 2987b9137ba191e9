//! The nodes of a piece of a line where M is averaged exactly: one equation for the flux instead of one for each node.

use super::chain::Chain;
use super::conditions::{End, Law, pin};
use super::cumulative::Cumulative;

/// Largest number of steps in the search for a flux: Newton's, doublings that look for a bracket, and halvings of it.
/// Within a bracket some 60 halvings reach rounding.
const MOST_STEPS: usize = 400;

impl End<'_> {
    /// G at the end node where its flux is F, and dG/dF, as [`Chain::even`] has them for each condition; none for
    /// other conditions.
    fn integral(self, cumulative: &Cumulative, flux: f64) -> Option<[f64; 2]> {
        match self {
            Self::Value(x) => Some([cumulative.up_to(x), 0.0]),
            Self::Flux { g, law: Law::Robin { slope } } => {
                let [y, m] = cumulative.at((flux - g) / slope);
                Some([y, m / slope])
            }
            Self::Flux { g, law: Law::Rest { to, length, panels: None } } => {
                Some([cumulative.up_to(to) - length * (flux - g), -length])
            }
            Self::Flux { .. } => None,
        }
    }
}

impl Chain<'_> {
    /// The nodes of a piece where M is averaged exactly. All its cells have the same ∫M, so that one unknown is left,
    /// the flux F. With G(x) = ∫M from the beginning of the line to x, its values G_left and G_right at the end nodes,
    /// and n cells,
    ///
    /// ```text
    /// G_right(F) − G_left(F) = n h F,   G_end(F) = G(x),   G(to) − length (F − g)   or   G((F − g)/slope)
    /// ```
    ///
    /// where G_end(F) is, in this order, that of a node given at x, of the flux of the rest of the line, and of a Robin
    /// condition. The left side falls with F, so that there is one solution. None where G is not known or a condition
    /// is of another kind.
    pub fn even(&self, guess: &[f64], ends: [End<'_>; 2]) -> Option<Vec<f64>> {
        let (cumulative, n) = (self.cumulative?, guess.len() - 1);
        let length = n as f64 * self.h;
        let left_over = |flux: f64| {
            let [left, left_slope] = ends[0].integral(cumulative, flux)?;
            let [right, right_slope] = ends[1].integral(cumulative, flux)?;
            let falls = left_slope >= 0.0 && right_slope <= 0.0;
            falls.then_some([right - left - length * flux, right_slope - left_slope - length])
        };
        let first = (cumulative.up_to(guess[n]) - cumulative.up_to(guess[0])) / length;
        let flux = falling_root(first, cumulative.whole(), left_over)?;
        let [from, to] = [ends[0].integral(cumulative, flux)?[0], ends[1].integral(cumulative, flux)?[0]];
        let share = |i: usize| from + (to - from) * (i as f64 / n as f64);
        // with conditions on the flux the right end may lie left of the left one
        let mut x = match from <= to {
            true => cumulative.inverted((0..=n).map(share)),
            false => cumulative.inverted((0..=n).rev().map(share)).into_iter().rev().collect(),
        };
        pin(&mut x, ends);
        if let [End::Value(a), End::Value(b)] = ends {
            x.iter_mut().for_each(|x| *x = x.clamp(a.min(b), a.max(b)));
        }
        Some(x)
    }
}

/// The root of a decreasing function, given with its derivative, by Newton's method within a bracket that is found
/// first. None where the function has no value or no bracket exists.
fn falling_root(first: f64, size: f64, f: impl Fn(f64) -> Option<[f64; 2]>) -> Option<f64> {
    let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
    let mut at = first;
    let mut step = size.max(first.abs());
    for _ in 0..MOST_STEPS {
        let [value, slope] = f(at)?;
        if value == 0.0 {
            return Some(at);
        }
        if value.is_nan() {
            return None;
        }
        *(if value > 0.0 { &mut low } else { &mut high }) = at;
        let bounded = low.is_finite() && high.is_finite();
        let newton = at - value / slope;
        if (newton - at).abs() <= f64::EPSILON * at.abs()
            || bounded && high - low <= f64::EPSILON * low.abs().max(high.abs())
        {
            return Some(if newton >= low && newton <= high { newton } else { at });
        }
        at = if newton > low && newton < high {
            newton
        } else if bounded {
            0.5 * (low + high)
        } else {
            step *= 2.0;
            at + step.copysign(value)
        };
    }
    (low.is_finite() && high.is_finite()).then_some(at)
}
