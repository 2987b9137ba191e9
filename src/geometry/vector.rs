//! Vectors of one to three components.

/// The scalar product.
#[inline(always)]
pub(crate) fn dot<const D: usize>(a: [f64; D], b: [f64; D]) -> f64 {
    (1..D).fold(a[0] * b[0], |sum, d| sum + a[d] * b[d])
}

/// The length of a vector, which does not overflow where its square would.
#[inline(always)]
pub(crate) fn length<const D: usize>(a: [f64; D]) -> f64 {
    a[1..].iter().fold(a[0].abs(), |length, along| length.hypot(*along))
}
