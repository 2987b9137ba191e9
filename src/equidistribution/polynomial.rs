//! The polynomials of which [`Cumulative`](super::cumulative::Cumulative) consists, one on each piece of a line.

use std::f64::consts::PI;

/// A piece of the line, with `half` its half length: G(lower + half (1 + s)) = below + half Σ c_k T_k(s), −1 ≤ s ≤ 1.
#[derive(Debug, Clone)]
pub(super) struct Piece {
    pub lower: f64,
    pub upper: f64,
    /// G at the beginning of the piece.
    pub below: f64,
    /// ∫M over the piece.
    pub integral: f64,
    /// Chebyshev coefficients c_k of ∫M ds, which is 0 at s = −1.
    pub coefficients: Vec<f64>,
}

/// The last coefficients of the polynomial of a piece.
pub(super) struct Tail {
    /// Sum of their absolute values.
    pub size: f64,
    /// The size that rounding of the places alone gives them.
    pub rounding: f64,
}

/// Distance of the Chebyshev points in the middle of a piece, about sin(π/16)/2, as a share of its width: changes of M
/// from point to point over it estimate the largest slope of M.
const PLACES_APART: f64 = 0.1;
/// Degree of the polynomials: smooth M is resolved to round-off on few pieces.
const DEGREE: usize = 16;
/// Number of Chebyshev points of a piece.
pub(super) const POINTS: usize = DEGREE + 1;
/// Steps of Newton's method or of bisection for one place. Bisection alone takes 53.
const MOST_NEWTON: usize = 100;

impl Piece {
    /// The polynomial through the values of M in the Chebyshev points between two places, integrated, and its last
    /// coefficients.
    pub fn through([lower, upper]: [f64; 2], values: &[f64], transform: &[[f64; POINTS]; POINTS]) -> (Self, Tail) {
        let c: [f64; POINTS] =
            std::array::from_fn(|k| transform[k].iter().zip(values).map(|(weight, value)| weight * value).sum());
        // ∫T_k = (T_{k+1}/(k + 1) − T_{k−1}/(k − 1))/2, ∫T_0 = T_1, ∫T_1 = T_2/4
        let at = |k: usize| c.get(k).copied().unwrap_or(0.0);
        let mut coefficients: Vec<f64> = (0..=POINTS)
            .map(|k| match k {
                0 => 0.0,
                1 => at(0) - 0.5 * at(2),
                k => (at(k - 1) - at(k + 1)) / (2.0 * k as f64),
            })
            .collect();
        // T_k(−1) = (−1)^k, T_k(1) = 1
        coefficients[0] = (1..=POINTS).map(|k| if k % 2 == 1 { coefficients[k] } else { -coefficients[k] }).sum();
        let integral = 0.5 * (upper - lower) * coefficients.iter().sum::<f64>();
        let size = c[DEGREE - 2..].iter().map(|c| c.abs()).sum();
        let steepest =
            values.windows(2).map(|m| (m[1] - m[0]).abs()).fold(0.0, f64::max) / (PLACES_APART * (upper - lower));
        let rounding = 2.0 * f64::EPSILON * lower.abs().max(upper.abs()) * steepest;
        (Self { lower, upper, below: 0.0, integral, coefficients }, Tail { size, rounding })
    }

    /// The place at s, −1 ≤ s ≤ 1.
    pub fn place(&self, s: f64) -> f64 {
        self.lower + 0.5 * (self.upper - self.lower) * (1.0 + s)
    }

    /// s where G is `g`, in from ≤ s ≤ 1, and dG/ds there. The search begins at a guess.
    pub fn inverted(&self, g: f64, from: f64, guess: Option<f64>) -> [f64; 2] {
        let half = 0.5 * (self.upper - self.lower);
        let wanted = (g - self.below) / half;
        let (mut low, mut high) = (from, 1.0_f64);
        let mut s =
            guess.filter(|s| s.is_finite()).unwrap_or(2.0 * (g - self.below) / self.integral - 1.0).clamp(low, high);
        let mut slope = 0.0;
        for _ in 0..MOST_NEWTON {
            let value;
            [value, slope] = clenshaw(&self.coefficients, s);
            let off = value - wanted;
            *(if off > 0.0 { &mut high } else { &mut low }) = s;
            let newton = s - off / slope;
            // once the Newton step is within rounding of s, so is the error
            if (newton - s).abs() <= f64::EPSILON || high - low <= f64::EPSILON {
                return [newton.clamp(low, high), half * slope];
            }
            s = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
        }
        [s, half * slope]
    }
}

/// Σ c_k T_k(s) and its derivative, by Clenshaw's recurrence.
pub(super) fn clenshaw(c: &[f64], s: f64) -> [f64; 2] {
    let (mut b, mut b_next) = (0.0, 0.0);
    let (mut d, mut d_next) = (0.0, 0.0);
    for &c in c[1..].iter().rev() {
        (d, d_next) = (2.0 * b + 2.0 * s * d - d_next, d);
        (b, b_next) = (c + 2.0 * s * b - b_next, b);
    }
    [c[0] + s * b - b_next, b + s * d - d_next]
}

/// The Chebyshev points between two places, which include both ends.
pub(super) fn points([lower, upper]: &[f64; 2]) -> impl Iterator<Item = f64> + use<> {
    let [lower, upper] = [*lower, *upper];
    let half = 0.5 * (upper - lower);
    (0..POINTS).map(move |j| match j {
        0 => upper,
        DEGREE => lower,
        // measured from the nearer end, so that rounding puts no point outside the piece
        j if 2 * j < DEGREE => upper - half * 2.0 * (0.5 * PI * j as f64 / DEGREE as f64).sin().powi(2),
        j => lower + half * 2.0 * (0.5 * PI * j as f64 / DEGREE as f64).cos().powi(2),
    })
}

/// From values in the Chebyshev points, s_j = cos(jπ/n), to coefficients: c_k = (2/n) Σ″ f_j cos(jkπ/n), halved for k =
/// 0 and n.
pub(super) fn transform() -> [[f64; POINTS]; POINTS] {
    let half = |k: usize| if k == 0 || k == DEGREE { 0.5 } else { 1.0 };
    std::array::from_fn(|k| {
        std::array::from_fn(|j| {
            2.0 / DEGREE as f64 * half(k) * half(j) * (PI * (j * k % (2 * DEGREE)) as f64 / DEGREE as f64).cos()
        })
    })
}
