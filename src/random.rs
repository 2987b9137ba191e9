//! Counter-based random numbers: each number is a function of where it is used, not of when.
//!
//! A draw is keyed by (seed, step, node, path, block). Whoever computes it, in whatever order and on however many
//! threads, gets the same bits; nothing is stored between draws.

use crate::elementary::{ln, sin_cos};

/// The generator Philox4x32-10: four words of 32 random bits from a counter of four words and a key of two
///
/// # Source
/// Salmon, Moraes, Dror and Shaw, *Parallel random numbers: as easy as 1, 2, 3* (2011).
#[derive(Debug, Clone, Copy)]
pub(crate) struct Philox {
    key: [u32; 2],
}

impl Philox {
    /// The family of streams of a seed.
    pub fn new(seed: u64) -> Self {
        Self { key: [seed as u32, (seed >> 32) as u32] }
    }

    /// Four words for each of L counters, side by side so that the compiler can take several at once.
    #[inline(always)]
    pub fn blocks<const L: usize>(self, mut counter: [[u32; L]; 4]) -> [[u32; L]; 4] {
        for l in 0..L {
            // in 64 bits, for the products to stay where they are
            let [mut a, mut b, mut c, mut d] = counter.each_ref().map(|words| u64::from(words[l]));
            let mut key = self.key;
            for _round in 0..10 {
                let (p, q) = (a * 0xD251_1F53, c * 0xCD9E_8D57);
                [a, b] = [(q >> 32) ^ b ^ u64::from(key[0]), q & 0xFFFF_FFFF];
                [c, d] = [(p >> 32) ^ d ^ u64::from(key[1]), p & 0xFFFF_FFFF];
                key = [key[0].wrapping_add(0x9E37_79B9), key[1].wrapping_add(0xBB67_AE85)];
            }
            (counter.iter_mut().zip([a, b, c, d])).for_each(|(words, word)| words[l] = word as u32);
        }
        counter
    }

    /// The words of one path, in order.
    pub fn stream(self, step: u32, node: u32, path: u32) -> Stream {
        Stream { philox: self, counter: [0, path, node, step], words: [0; 4], left: 0 }
    }
}

/// The random words of one path.
#[derive(Debug, Clone)]
pub(crate) struct Stream {
    philox: Philox,
    counter: [u32; 4],
    words: [u32; 4],
    left: usize,
}

impl Stream {
    /// The next 32 random bits.
    #[inline(always)]
    pub fn word(&mut self) -> u32 {
        if self.left == 0 {
            self.words = self.philox.blocks(self.counter.map(|c| [c])).map(|[word]| word);
            self.counter[0] = self.counter[0].wrapping_add(1);
            self.left = 4;
        }
        self.left -= 1;
        self.words[3 - self.left]
    }
}

/// 2⁻³², which takes a random word of 32 bits to a number in [0, 1).
const TINY: f64 = 1.0 / 4_294_967_296.0;

/// A word as a number strictly between 0 and 1: (word + ½) 2⁻³².
#[inline(always)]
pub(crate) fn uniform(word: u32) -> f64 {
    // placed behind the point of 1.…: processors without a conversion from unsigned words do this faster
    f64::from_bits(0x3FF0_0000_0000_0000 | u64::from(word) << 20) - (1.0 - 0.5 * TINY)
}

/// Two independent standard normal numbers from two words, L at a time: the method of Box and Muller.
#[inline(always)]
pub(crate) fn normals<const L: usize>(a: [u32; L], b: [u32; L]) -> [[f64; L]; 2] {
    let mut out = [[0.0; L]; 2];
    for l in 0..L {
        let radius = (-2.0 * ln(uniform(a[l]))).sqrt();
        // the angle from the nearest half turn, −π/2 … π/2; after an odd half turn both numbers change sign
        let (sin, cos) = sin_cos(f64::from((b[l] << 1) as i32) * (std::f64::consts::PI * TINY));
        let odd = u64::from(b[l].wrapping_add(1 << 30) & 1 << 31) << 32;
        let radius = f64::from_bits(radius.to_bits() ^ odd);
        out[0][l] = radius * cos;
        out[1][l] = radius * sin;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The known answers that come with the authors' own implementation.
    #[test]
    fn philox_gives_the_published_answers() {
        let known: [([u32; 4], u64, [u32; 4]); 3] = [
            ([0; 4], 0, [0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8]),
            ([u32::MAX; 4], u64::MAX, [0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd]),
            (
                [0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344],
                0x299f31d0_a4093822,
                [0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1],
            ),
        ];
        for (counter, seed, answer) in known {
            assert_eq!(Philox::new(seed).blocks(counter.map(|c| [c; 3])), answer.map(|a| [a; 3]));
        }
    }

    #[test]
    fn a_stream_runs_through_its_blocks() {
        let philox = Philox::new(7);
        let mut stream = philox.stream(3, 5, 11);
        let words: Vec<u32> = (0..8).map(|_| stream.word()).collect();
        let blocks = [0, 1].map(|block| philox.blocks([[block], [11], [5], [3]]).map(|[w]| w));
        assert_eq!(words, blocks.concat());
    }

    /// Against the standard library, over all magnitudes and quadrants.
    #[test]
    fn normals_follow_box_and_muller() {
        let mut stream = Philox::new(1).stream(0, 0, 0);
        let edges = [0, 1, u32::MAX, 1 << 29, (1 << 29) - 1, 3 << 29, 1 << 30, 1 << 31, 5 << 29, 7 << 29];
        let pairs = edges.iter().flat_map(|&a| edges.map(|b| (a, b)));
        let random: Vec<(u32, u32)> = (0..10_000).map(|_| (stream.word(), stream.word())).collect();
        for (a, b) in pairs.chain(random) {
            let [[x], [y]] = normals([a], [b]);
            let radius = (-2.0 * uniform(a).ln()).sqrt();
            let angle = 2.0 * std::f64::consts::PI * f64::from(b) * TINY;
            assert!((x - radius * angle.cos()).abs() < 1e-11, "{a} {b}: {x}");
            assert!((y - radius * angle.sin()).abs() < 1e-11, "{a} {b}: {y}");
        }
    }

    /// Mean, variance, kurtosis and correlation of a million, each within four standard errors.
    #[test]
    fn normals_have_the_moments_of_the_normal_distribution() {
        let philox = Philox::new(42);
        let n = 250_000;
        let mut sums = [0.0; 4];
        for k in 0..n {
            let [a, b, c, d] = philox.blocks([[0], [k], [0], [0]]);
            for [[x], [y]] in [normals(a, b), normals(c, d)] {
                for (sum, term) in sums.iter_mut().zip([x + y, x * x + y * y, x.powi(4) + y.powi(4), x * y]) {
                    *sum += term;
                }
            }
        }
        let count = 4.0 * f64::from(n);
        for (sum, expected, deviation) in
            [(sums[0], 0.0, 1.0), (sums[1], 1.0, 2_f64.sqrt()), (sums[2], 3.0, 96_f64.sqrt())]
        {
            assert!((sum / count - expected).abs() < 4.0 * deviation / count.sqrt(), "{} for {expected}", sum / count);
        }
        assert!((2.0 * sums[3] / count).abs() < 4.0 / (0.5 * count).sqrt());
    }
}
