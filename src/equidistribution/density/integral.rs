use super::{Kind, LineDensity};
use crate::error::Failure;

/// Nodes and weights of the Gauss–Kronrod rule of 15 points on [−1, 1], of the half with x ≥ 0, and of the 7-point
/// Gauss rule inside it.
///
/// # Source
/// Piessens et al., *QUADPACK* (1983).
const KRONROD: [[f64; 3]; 8] = [
    [0.991_455_371_120_812_6, 0.022_935_322_010_529_224, 0.0],
    [0.949_107_912_342_758_5, 0.063_092_092_629_978_56, 0.129_484_966_168_869_7],
    [0.864_864_423_359_769_1, 0.104_790_010_322_250_19, 0.0],
    [0.741_531_185_599_394_5, 0.140_653_259_715_525_92, 0.279_705_391_489_276_64],
    [0.586_087_235_467_691_1, 0.169_004_726_639_267_9, 0.0],
    [0.405_845_151_377_397_2, 0.190_350_578_064_785_42, 0.381_830_050_505_118_9],
    [0.207_784_955_007_898_47, 0.204_432_940_075_298_89, 0.0],
    [0.0, 0.209_482_141_084_727_82, 0.417_959_183_673_469_4],
];
/// Number of places of the rule on a piece; the middle counts twice.
const PLACES: usize = 2 * KRONROD.len();
/// A jump of M between an end of a piece and the outermost place of the rule, .4 % of the piece inside, is not seen by
/// the rule. It is suspected where M changes between these two by more than this share of its range on the piece.
const ENDS: f64 = 0.05;
/// A share of M that counts as nothing: as the difference of the rules of 15 and of 7 points, since the error of the
/// former is then of rounding, and as a change of M between two places.
const NOTHING: f64 = 1e-10;
/// Halvings after which the rest of an integral is taken as it is: a piece of 2⁻⁴⁸ of the line is near rounding.
const DEEPEST: usize = 48;
/// Pieces beyond which none is halved any more: M then oscillates faster than can be followed.
const MOST_PIECES: usize = 4096;

impl LineDensity {
    /// ∫ M from a to b to round-off, by the rule of Gauss and Kronrod on pieces that are halved where its error
    /// estimate is too large. Around a jump of M they are halved down to rounding. Where M oscillates too fast to be
    /// followed, the integral is what the rule gives.
    ///
    /// # Errors
    /// As [`at_each`](Self::at_each).
    pub fn integral(&self, t: f64, a: f64, b: f64) -> Result<f64, Failure> {
        if let Kind::Samples(samples) = &self.kind {
            return Ok(samples.up_to(b) - samples.up_to(a));
        }
        let mut sum = 0.0;
        let mut unsure = vec![[a, b]];
        for level in 0..=DEEPEST {
            let last = level == DEEPEST || unsure.len() > MOST_PIECES;
            let values = self.at_each(t, &unsure.iter().flat_map(places).collect::<Vec<f64>>())?;
            let mut halves = Vec::new();
            for (piece, values) in unsure.iter().zip(values.chunks_exact(PLACES + 2)) {
                let (integral, sure) = gauss_kronrod(values);
                let (middle, half) = middle_and_half(piece);
                if last || sure {
                    sum += half * integral;
                } else {
                    halves.extend([[piece[0], middle], [middle, piece[1]]]);
                }
            }
            if halves.is_empty() {
                break;
            }
            unsure = halves;
        }
        Ok(sum)
    }
}

fn middle_and_half([a, b]: &[f64; 2]) -> (f64, f64) {
    (0.5 * (a + b), 0.5 * (b - a))
}

/// The places of the rule on a piece, then its ends.
fn places(piece: &[f64; 2]) -> impl Iterator<Item = f64> + use<> {
    let (middle, half) = middle_and_half(piece);
    let inside = KRONROD.into_iter().flat_map(move |[x, ..]| [middle - half * x, middle + half * x]);
    inside.chain(*piece)
}

/// ∫M over a piece divided by half its length, from [M, M_x] at its [`places`], and whether it is accurate.
fn gauss_kronrod(values: &[[f64; 2]]) -> (f64, bool) {
    let (values, ends) = values.split_at(PLACES);
    let [low, high] = values.iter().fold([f64::INFINITY, 0.0_f64], |[l, h], m| [l.min(m[0]), h.max(m[0])]);
    let change = ENDS * (high - low) + NOTHING * high;
    let jumps = ends.iter().zip(values).any(|(end, next)| (end[0] - next[0]).abs() > change);
    let (mut fine, mut coarse) = (0.0, 0.0);
    for ([x, kronrod, gauss], pair) in KRONROD.iter().zip(values.chunks_exact(2)) {
        let sum = if *x == 0.0 { pair[0][0] } else { pair[0][0] + pair[1][0] };
        fine += kronrod * sum;
        coarse += gauss * sum;
    }
    (fine, !jumps && (fine - coarse).abs() <= NOTHING * fine.abs())
}
