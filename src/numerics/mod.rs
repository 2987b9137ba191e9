//! Differences on the lattice, and linear systems on patches of it.

pub mod difference;
pub(crate) mod lanes;
pub mod linear;

/// max(m, |value|) that keeps a NaN, for norms that must not hide one.
pub(crate) fn larger(m: f64, value: f64) -> f64 {
    if value.abs() <= m || m.is_nan() { m } else { value.abs() }
}

/// The least and the largest of some values; [∞, −∞] of none. A NaN counts as none.
pub(crate) fn ends(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| [low.min(value), high.max(value)])
}

/// Compensated sum, in order: its round-off does not grow with the number of terms
///
/// # Source
/// Neumaier, *Rundungsfehleranalyse einiger Verfahren zur Summation endlicher Summen* (1974).
pub(crate) fn sum(values: impl Iterator<Item = f64>) -> f64 {
    let (mut sum, mut lost) = (0.0_f64, 0.0);
    for value in values {
        let next = sum + value;
        lost += if sum.abs() >= value.abs() { (sum - next) + value } else { (value - next) + sum };
        sum = next;
    }
    sum + lost
}

#[cfg(test)]
mod tests {
    use super::{larger, sum};

    /// What ordinary addition loses beside 1e16 is kept.
    #[test]
    fn sums_keep_what_is_small() {
        assert_eq!(sum([1.0, 1e16, 1.0, -1e16].into_iter()), 2.0);
    }

    /// A NaN stays, wherever it stands; `f64::max` would drop it.
    #[test]
    fn a_norm_keeps_a_nan() {
        for values in [[f64::NAN, 1.0, 2.0], [1.0, f64::NAN, 2.0], [1.0, 2.0, f64::NAN]] {
            assert!(values.into_iter().fold(0.0, larger).is_nan());
        }
        assert_eq!([1.0, -3.0, 2.0].into_iter().fold(0.0, larger), 3.0);
    }
}
