//! Vectors of one to three components.

/// The scalar product.
#[inline(always)]
pub(crate) fn dot<const D: usize>(a: [f64; D], b: [f64; D]) -> f64 {
    (1..D).fold(a[0] * b[0], |sum, d| sum + a[d] * b[d])
}

/// Range of sums of squares whose root is an exact length: smaller sums lose digits to underflow, larger ones overflow.
const SQUARES: std::ops::Range<f64> = 1e-280..1e280;

/// The length of a vector, which does not overflow where its square would.
#[inline(always)]
pub(crate) fn length<const D: usize>(a: [f64; D]) -> f64 {
    let square = dot(a, a);
    // `hypot` is exact for all vectors, but a call of it was a seventh of a time step
    if SQUARES.contains(&square) { square.sqrt() } else { a[1..].iter().fold(a[0].abs(), |m, along| m.hypot(*along)) }
}
