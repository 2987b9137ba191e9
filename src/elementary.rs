//! Elementary functions without branches, so that the compiler can evaluate several at once, and with the same bits on
//! every machine, which those of the system's library do not have.

/// e^x of any number, to two units in the last place.
#[inline(always)]
pub(crate) fn exp(x: f64) -> f64 {
    // added to a number of moderate size, it leaves the nearest whole one in the last bits
    const WHOLE: f64 = 6_755_399_441_055_744.0; // 3·2⁵¹
    // ln 2, and what its first 33 bits leave: a whole number times these is exact
    const HIGH: f64 = f64::from_bits(0x3FE6_2E42_FEE0_0000);
    const LOW: f64 = 1.908_214_929_270_587_7e-10;
    const TERMS: [f64; 14] = factorials();
    // the result beyond is 0 or infinite; a NaN stays
    let x = if x > 710.0 { 710.0 } else { x };
    let x = if x < -746.0 { -746.0 } else { x };
    // x = n ln 2 + r with |r| ≤ ½ ln 2: the first term left out is below 1e-17
    let n = (x * std::f64::consts::LOG2_E + WHOLE) - WHOLE;
    let r = (x - n * HIGH) - n * LOW;
    // 2ⁿ as a product of two powers, since n may exceed the range of exponents
    let half = 0.5 * n + WHOLE;
    let rest = n - (half - WHOLE) + WHOLE;
    let power = |bits: f64| f64::from_bits(bits.to_bits().wrapping_add(1023) << 52);
    polynomial(r, TERMS) * power(half) * power(rest)
}

/// 1/k! for k = 0, 1, 2, …
const fn factorials<const N: usize>() -> [f64; N] {
    let mut terms = [1.0; N];
    let mut n = 1;
    while n < N {
        terms[n] = terms[n - 1] / n as f64;
        n += 1;
    }
    terms
}

/// Natural logarithm of a positive normal number, to 1e-12.
#[inline(always)]
pub(crate) fn ln(x: f64) -> f64 {
    const ROOT_HALF: u64 = 0x3FE6_A09E_667F_3BCD;
    const ONE: u64 = 0x3FF0_0000_0000_0000;
    const TWO_52: u64 = 0x4330_0000_0000_0000;
    // x = 2^e m with m between √½ and √2; e + 1023 stands in the last bits of 2⁵² + e + 1023
    let bits = x.to_bits() + (ONE - ROOT_HALF);
    let exponent = f64::from_bits(TWO_52 | bits >> 52) - (f64::from_bits(TWO_52) + 1023.0);
    let m = f64::from_bits((bits & 0x000F_FFFF_FFFF_FFFF) + ROOT_HALF);
    // 2 artanh s; the first term left out is below 1e-12
    let s = (m - 1.0) / (m + 1.0);
    let z = s * s;
    let tail = polynomial(z, [1.0 / 3.0, 1.0 / 5.0, 1.0 / 7.0, 1.0 / 9.0, 1.0 / 11.0, 1.0 / 13.0]);
    exponent * std::f64::consts::LN_2 + 2.0 * (s + s * z * tail)
}

/// Sine and cosine of an angle between −π/2 and π/2, by Taylor's series: the first terms left out are below 1e-12.
#[inline(always)]
pub(crate) fn sin_cos(x: f64) -> (f64, f64) {
    const SIN: [f64; 9] = taylor(1);
    const COS: [f64; 9] = taylor(0);
    let z = x * x;
    (x * polynomial(z, SIN), polynomial(z, COS))
}

/// 1/k!, −1/(k+2)!, 1/(k+4)!, … for k = 0 or 1.
const fn taylor<const N: usize>(mut k: usize) -> [f64; N] {
    let mut terms = [1.0; N];
    let mut n = 1;
    while n < N {
        terms[n] = -terms[n - 1] / ((k + 1) * (k + 2)) as f64;
        k += 2;
        n += 1;
    }
    terms
}

/// c₀ + c₁ z + c₂ z² + …
#[inline(always)]
fn polynomial<const N: usize>(z: f64, c: [f64; N]) -> f64 {
    let mut sum = c[N - 1];
    for k in (0..N - 1).rev() {
        sum = sum * z + c[k];
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::exp;

    /// Against the standard library, over all magnitudes, at the ends of the range and beyond.
    #[test]
    fn exponentials_are_right_to_two_units_in_the_last_place() {
        for k in -1_500_000..=1_500_000 {
            let x = 5e-4 * f64::from(k) * (1.0 + 1e-9 * f64::from(k % 1000));
            let (found, expected) = (exp(x), x.exp());
            let units = (found.to_bits() as i64).abs_diff(expected.to_bits() as i64);
            assert!(units <= 2, "e^{x}: {found:e} where {expected:e}");
        }
        assert_eq!([exp(0.0), exp(-0.0), exp(f64::INFINITY), exp(f64::NEG_INFINITY)], [1.0, 1.0, f64::INFINITY, 0.0]);
        assert_eq!([exp(709.79), exp(1e300), exp(-745.2), exp(-1e300)], [f64::INFINITY, f64::INFINITY, 0.0, 0.0]);
        assert!(exp(f64::NAN).is_nan());
    }
}
