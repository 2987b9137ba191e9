use super::LineDensity;
use crate::error::Failure;

/// Equal cells of the line whose ends are compared in the first search for an extremum of M. A narrower peak can be
/// overlooked.
const PLACES: usize = 2000;
/// Equal cells of each later search, between the neighbours of the best place so far: each narrows the interval ten
/// times.
const PLACES_AROUND: usize = 20;
/// Searches for an extremum, the first included. Nine leave an interval of 1e-11 of the line.
const SEARCHES: usize = 9;
/// u jumps where at least this share of its largest change between cells remains while the cell is halved down to
/// neighbouring floating-point numbers. The change of a continuous u tends to 0.
const STILL_A_JUMP: f64 = 0.5;
/// A smallest M below this share of the largest one counts as 0: it is rounding.
const VANISHING: f64 = 1e-14;

impl LineDensity {
    /// The smallest and the largest M from a to b, by searches in ever smaller intervals.
    ///
    /// # Errors
    /// As [`at_each`](Self::at_each); also where the smallest M counts as 0, or u jumps.
    pub fn extremes(&self, t: f64, [a, b]: [f64; 2]) -> Result<[f64; 2], Failure> {
        let [_, high] = self.largest(t, [a, b], |m| m)?;
        let [x, below] = self.largest(t, [a, b], |m| -m)?;
        let low = -below;
        if low <= VANISHING * high {
            return Err(Failure::LineDensity { what: "M", value: low, x, t });
        }
        if let Some(x) = self.jump(t, [a, b]) {
            return Err(Failure::LineDensity { what: "u_x", value: f64::INFINITY, x, t });
        }
        Ok([low, high])
    }

    /// The place where u jumps, if it does: the interval with the largest change is divided until its ends are
    /// neighbouring floating-point numbers.
    fn jump(&self, t: f64, [mut a, mut b]: [f64; 2]) -> Option<f64> {
        let mut first = None;
        loop {
            let cells = if first.is_none() { PLACES } else { 2 };
            let places = evenly([a, b], cells);
            let u = self.followed(t, &places)?;
            let change = |k: usize| (u[k + 1] - u[k]).abs();
            let most = (0..cells).fold(0, |most, k| if change(k) > change(most) { k } else { most });
            let size = *first.get_or_insert(change(most));
            if change(most).is_nan() || change(most) <= STILL_A_JUMP * size {
                return None;
            }
            (a, b) = (places[most], places[most + 1]);
            if b - a <= 4.0 * f64::EPSILON * a.abs().max(b.abs()).max(f64::MIN_POSITIVE) {
                return Some(a);
            }
        }
    }

    /// The place of the largest value of a function of M, and that value.
    fn largest(&self, t: f64, [mut a, mut b]: [f64; 2], of: impl Fn(f64) -> f64) -> Result<[f64; 2], Failure> {
        let mut found = [a, f64::NAN];
        for search in 0..SEARCHES {
            let cells = if search == 0 { PLACES } else { PLACES_AROUND };
            let places = evenly([a, b], cells);
            let values: Vec<f64> = self.at_each(t, &places)?.into_iter().map(|[m, _]| of(m)).collect();
            let best = (0..=cells).fold(0, |best, k| if values[k] > values[best] { k } else { best });
            found = [places[best], values[best]];
            (a, b) = (places[best.saturating_sub(1)], places[(best + 1).min(cells)]);
        }
        Ok(found)
    }
}

/// The places that divide the line from a to b into equal cells, with both ends.
fn evenly([a, b]: [f64; 2], cells: usize) -> Vec<f64> {
    (0..=cells).map(|k| a + (b - a) * k as f64 / cells as f64).collect()
}
