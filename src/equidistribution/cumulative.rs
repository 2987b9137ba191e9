use super::LineDensity;
use super::polynomial::{POINTS, Piece, Tail, clenshaw, points, transform};
use crate::error::Failure;

/// G(x) = ∫M from the beginning of a line to x, and its inverse
///
/// M is interpolated by polynomials of degree 16 in the Chebyshev points of pieces. A piece is halved until the last
/// coefficients of its polynomial are below 1e-12 of the mean of M on it, do not matter to ∫M over the line, or are of
/// rounding. They are of rounding where M changes by as much when x is rounded, or where halving no longer lowers them
/// on either half. Integrated, the polynomials give G everywhere. As M > 0, G grows, and Newton's method held within a
/// bracket inverts it. M is evaluated inside the line only, at many places in one call.
///
/// Where M is the arc length of u, a piece is halved as long as its chord is longer than its arc: so layers are found
/// that are thinner than the distance of the points. For other M the user names the places of spikes. Where M jumps,
/// pieces are halved down to neighbouring floating-point numbers.
///
/// # Source
/// Trefethen, *Approximation Theory and Approximation Practice* (2013), chapters 3, 4 and 19.
#[derive(Debug, Clone)]
pub(super) struct Cumulative {
    pieces: Vec<Piece>,
    whole: f64,
}

/// Pieces at the start: with 17 points each, some 2000 places, between which a spike can be overlooked.
const FIRST: usize = 128;
/// Pieces beyond which none is halved any more: M is then taken as its polynomials have it.
const MOST: usize = 1 << 16;
/// A piece is resolved where its last coefficients are below this share of the mean of M on it.
const RESOLVED: f64 = 1e-12;
/// A piece also counts as resolved where its last coefficients change ∫M over the line by less than this share, which
/// is below rounding.
const ROUNDING: f64 = 1e-16;
/// Last coefficients that halving does not lower are taken for rounding only below this share of the mean of M.
const NOISY: f64 = 1e-6;
/// Share by which the chord of a piece may exceed its arc: rounding of u.
const CHORD: f64 = 1e-9;
/// u jumps between two neighbouring floating-point numbers where its chord is longer than this multiple of the arc.
const JUMP: f64 = 2.0;
/// A chord shorter than this share of the arc length of the whole line is no jump: it may be rounding of u.
const NOTICEABLE: f64 = 1e-12;

impl Cumulative {
    /// ∫M of a density over a line.
    ///
    /// # Errors
    /// [`Failure::LineDensity`] at the first place found where M is not finite and positive, or where u jumps.
    pub fn new(density: &LineDensity, t: f64, [a, b]: [f64; 2]) -> Result<Self, Failure> {
        if let Some(known) = density.breaks(a, b) {
            return Self::linear(density, t, known);
        }
        let mut ends: Vec<f64> = (0..=FIRST).map(|k| a + (b - a) * (k as f64 / FIRST as f64)).collect();
        ends[FIRST] = b;
        ends.extend(density.spikes().iter().filter(|x| (a..b).contains(*x)));
        ends.sort_by(f64::total_cmp);
        ends.dedup();
        let mut unsure: Vec<[f64; 2]> = ends.windows(2).map(|ends| [ends[0], ends[1]]).collect();
        let transform = transform();
        let mut pieces: Vec<Piece> = Vec::new();
        // for each piece the last coefficients of the one that it is a half of
        let mut tails_before = vec![f64::INFINITY; unsure.len()];
        while !unsure.is_empty() {
            let last = pieces.len() + unsure.len() > MOST;
            let places: Vec<f64> = unsure.iter().flat_map(points).collect();
            let values = density.values(t, &places).or_else(|failure| {
                // the failure names the first such place along the line
                let mut sorted = places.clone();
                sorted.sort_by(f64::total_cmp);
                density.values(t, &sorted).and(Err(failure))
            })?;
            let u = density.followed(t, &unsure.concat());
            let found: Vec<(Piece, Tail)> = unsure
                .iter()
                .zip(values.chunks_exact(POINTS))
                .map(|(ends, values)| Piece::through(*ends, values, &transform))
                .collect();
            let whole: f64 =
                pieces.iter().chain(found.iter().map(|(piece, _)| piece)).map(|piece| piece.integral).sum();
            let (mut halves, mut tails) = (Vec::new(), Vec::new());
            let relative: Vec<f64> =
                found.iter().map(|(piece, tail)| tail.size * (piece.upper - piece.lower) / piece.integral).collect();
            let stays = |k: usize| relative[k] <= NOISY && relative[k] >= 0.5 * tails_before[k];
            for (k, (piece, tail)) in found.into_iter().enumerate() {
                let width = piece.upper - piece.lower;
                let middle = piece.lower + 0.5 * width;
                let chord = u.as_ref().map_or(0.0, |u| width.hypot(u[2 * k + 1] - u[2 * k]));
                let seen = chord <= piece.integral * (1.0 + CHORD) + ROUNDING * whole;
                let smooth = relative[k] <= RESOLVED || tail.size * width <= ROUNDING * whole;
                let rounded = tail.size <= tail.rounding || tails_before[k].is_finite() && stays(k) && stays(k ^ 1);
                let divides = piece.lower < middle && middle < piece.upper && width > f64::MIN_POSITIVE;
                if seen && (smooth || rounded) || last || !divides {
                    if !divides && chord > JUMP * piece.integral && chord > NOTICEABLE * whole {
                        return Err(Failure::LineDensity { what: "u_x", value: f64::INFINITY, x: piece.lower, t });
                    }
                    pieces.push(piece);
                } else {
                    halves.extend([[piece.lower, middle], [middle, piece.upper]]);
                    tails.extend([relative[k]; 2]);
                }
            }
            (unsure, tails_before) = (halves, tails);
        }
        Ok(Self::of(pieces))
    }

    /// ∫M of a density that is linear between known places.
    fn linear(density: &LineDensity, t: f64, ends: Vec<f64>) -> Result<Self, Failure> {
        let pieces = ends.windows(2).map(|ends| {
            // at a jump of M the limits from inside the piece
            let [left, right] = density.between(t, [ends[0], ends[1]])?;
            let (mean, slope) = (0.5 * (left + right), 0.5 * (right - left));
            let integral = mean * (ends[1] - ends[0]);
            let coefficients = vec![mean - 0.25 * slope, mean, 0.25 * slope];
            Ok(Piece { lower: ends[0], upper: ends[1], below: 0.0, integral, coefficients })
        });
        Ok(Self::of(pieces.collect::<Result<_, Failure>>()?))
    }

    fn of(mut pieces: Vec<Piece>) -> Self {
        pieces.sort_by(|a, b| a.lower.total_cmp(&b.lower));
        // compensated summation, since there may be tens of thousands of pieces
        let (mut sum, mut lost) = (0.0_f64, 0.0);
        for piece in &mut pieces {
            piece.below = sum + lost;
            let next = sum + piece.integral;
            lost += if sum >= piece.integral { (sum - next) + piece.integral } else { (piece.integral - next) + sum };
            sum = next;
        }
        Self { pieces, whole: sum + lost }
    }

    /// G and M at a place; beyond the ends of the line M is constant.
    pub fn at(&self, x: f64) -> [f64; 2] {
        let [a, b] = self.ends();
        let inside = x.clamp(a, b);
        let k = self.pieces.partition_point(|piece| piece.lower <= inside).max(1) - 1;
        let piece = &self.pieces[k];
        let half = 0.5 * (piece.upper - piece.lower);
        let [g, m] = clenshaw(&piece.coefficients, ((inside - piece.lower) / half - 1.0).clamp(-1.0, 1.0));
        // exactly the whole at the end of the line
        let g = if inside == b { self.whole } else { piece.below + half * g };
        [g + (x - inside) * m, m]
    }

    /// G at a place.
    pub fn up_to(&self, x: f64) -> f64 {
        self.at(x)[0]
    }

    /// The place beyond an end of the line where G has a value; none for the values that it has on the line.
    fn beyond(&self, g: f64) -> Option<f64> {
        let [a, b] = self.ends();
        match g {
            _ if g < 0.0 => Some(a + g / self.at(a)[1]),
            _ if g > self.whole => Some(b + (g - self.whole) / self.at(b)[1]),
            _ => None,
        }
    }

    /// The place where G has a value.
    pub fn place(&self, g: f64) -> f64 {
        self.beyond(g).unwrap_or_else(|| {
            let piece = &self.pieces[self.pieces.partition_point(|piece| piece.below <= g).max(1) - 1];
            piece.place(piece.inverted(g, -1.0, None)[0])
        })
    }

    /// The places where G has some values, which must grow.
    pub fn inverted(&self, values: impl Iterator<Item = f64>) -> Vec<f64> {
        let mut k = 0;
        let (mut s, mut near) = (-1.0, None);
        let place = |g: f64| {
            if let Some(beyond) = self.beyond(g) {
                return beyond;
            }
            while k + 1 < self.pieces.len() && g >= self.pieces[k + 1].below {
                (k, s, near) = (k + 1, -1.0, None);
            }
            let piece = &self.pieces[k];
            // the guess is a Newton step from the last place found
            let guess = near.map(|(before, slope)| s + (g - before) / slope);
            let [found, slope] = piece.inverted(g, s, guess);
            (s, near) = (found, Some((g, slope)));
            piece.place(s)
        };
        values.map(place).collect()
    }

    /// `count` + 1 nodes from a to b, within the line, with the same ∫M in each cell.
    pub fn divided(&self, [a, b]: [f64; 2], count: usize) -> Vec<f64> {
        let [from, to] = [a, b].map(|x| self.up_to(x));
        let share = |i: usize| from + (to - from) * (i as f64 / count as f64);
        let inner = self.inverted((1..count).map(share));
        [a].into_iter().chain(inner.into_iter().map(|x| x.clamp(a, b))).chain([b]).collect()
    }

    /// ∫M over the line.
    pub fn whole(&self) -> f64 {
        self.whole
    }

    /// The ends of the line.
    pub fn ends(&self) -> [f64; 2] {
        [self.pieces[0].lower, self.pieces[self.pieces.len() - 1].upper]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    fn of(m: &str) -> Cumulative {
        Cumulative::new(&LineDensity::formula(m).unwrap(), 0.0, [0.0, 1.0]).unwrap()
    }

    /// Against closed forms, smooth, with a kink, with a jump, and with a layer at an end.
    #[test]
    fn the_integral_is_exact() {
        for (m, exact) in [
            ("x^2 + 1", Box::new(|x: f64| x + x.powi(3) / 3.0) as Box<dyn Fn(f64) -> f64>),
            ("abs(x - 0.3) + 0.1", Box::new(|x| 0.1 * x + 0.5 * (0.09 + (x - 0.3) * (x - 0.3).abs()))),
            ("if(x < 0.37, 1, 1e6)", Box::new(|x| if x < 0.37 { x } else { 0.37 + 1e6 * (x - 0.37) })),
            ("1 + 1e9*exp(-x/1e-9)", Box::new(|x| x - (-x / 1e-9).exp_m1())),
            (
                "sqrt(abs(x - 0.5)) + 1e-6",
                Box::new(|x: f64| {
                    let part = |d: f64| d.abs().powf(1.5).copysign(d) * 2.0 / 3.0;
                    part(x - 0.5) - part(-0.5) + 1e-6 * x
                }),
            ),
        ] {
            let g = of(m);
            for k in 0..=1000 {
                let x = k as f64 / 1000.0;
                assert!((g.up_to(x) - exact(x)).abs() < 3e-14 * g.whole(), "{m} at {x}: {} {}", g.up_to(x), exact(x));
            }
        }
    }

    /// M x_ξ is constant: of x² + 1 the middle node is known.
    #[test]
    fn the_inverse_divides_evenly() {
        let x = of("x^2 + 1").divided([0.0, 1.0], 2);
        assert!((x[1] - 0.596_071_637_983_321_5).abs() < 1e-15, "{}", x[1]);
        let g = of("1 + 1e9*exp(-x/1e-9)");
        for count in [7, 160, 10_000] {
            let x = g.divided([0.0, 1.0], count);
            let shares: Vec<f64> =
                x.windows(2).map(|x| x[1] - x[0] + ((-x[0] / 1e-9).exp() * -((x[0] - x[1]) / 1e-9).exp_m1())).collect();
            assert!(shares.iter().all(|share| (share * count as f64 / 2.0 - 1.0).abs() < 1e-9));
        }
    }

    /// A layer of an arc length, however thin and wherever it is, is not missed; where M is a formula, its place is
    /// named.
    #[test]
    fn thin_layers_are_found() {
        for width in [1e-2, 1e-5, 1e-9, 1e-12_f64] {
            for place in [0.0, 0.3, 0.77_f64] {
                let u = LineDensity::arclength(&format!("tanh((x - {place})/{width})")).unwrap();
                let g = Cumulative::new(&u, 0.0, [0.0, 1.0]).unwrap();
                let jump = if place == 0.0 { 1.0 } else { 2.0 };
                // where u is steeper than 1 its arc is its change; places are rounded
                let (steep, rounding) = (jump * width * (4.0 / width).ln(), 10.0 * f64::EPSILON * place / width);
                assert!((g.whole() - 1.0 - jump).abs() < steep + rounding, "{width} at {place}: {}", g.whole());
            }
            let spike = LineDensity::formula(&format!("1 + exp(-((x - 0.3)/{width})^2)/{width}")).unwrap();
            let g = Cumulative::new(&spike.with_spikes(vec![0.3]), 0.0, [0.0, 1.0]).unwrap();
            assert!((g.whole() - 1.0 - PI.sqrt()).abs() < 1e-9 + f64::EPSILON / width, "{width}: {}", g.whole());
        }
    }

    /// M is asked for inside the line, and seldom.
    #[test]
    fn few_places_are_asked_for_and_none_outside() {
        use std::sync::atomic::{AtomicUsize, Ordering};
        static ASKED: AtomicUsize = AtomicUsize::new(0);
        let density = LineDensity::on_line([-2.0, 3.0], |_, x| {
            ASKED.fetch_add(x.len(), Ordering::Relaxed);
            assert!(x.iter().all(|x| (-2.0..=3.0).contains(x)));
            x.iter().map(|x| 1.0 + 1e6 * (-((x - 0.1) / 1e-6_f64).powi(2)).exp() + (x - 0.7).abs().sqrt()).collect()
        });
        let g = Cumulative::new(&density.with_spikes(vec![0.1]), 0.0, [-2.0, 3.0]).unwrap();
        g.divided([-2.0, 3.0], 160);
        assert!(ASKED.load(Ordering::Relaxed) < 50_000, "{ASKED:?}");
    }
}
