//! How things are computed: differences on the lattice and linear systems on patches of it.

pub mod difference;
pub mod linear;

/// max(m, |value|) that keeps a NaN: for norms in which nothing may be lost.
pub(crate) fn larger(m: f64, value: f64) -> f64 {
    if value.abs() <= m || m.is_nan() { m } else { value.abs() }
}

#[cfg(test)]
mod tests {
    use super::larger;

    /// A NaN stays, wherever it stands; `f64::max` would drop it.
    #[test]
    fn a_norm_keeps_a_nan() {
        for values in [[f64::NAN, 1.0, 2.0], [1.0, f64::NAN, 2.0], [1.0, 2.0, f64::NAN]] {
            assert!(values.into_iter().fold(0.0, larger).is_nan());
        }
        assert_eq!([1.0, -3.0, 2.0].into_iter().fold(0.0, larger), 3.0);
    }
}
