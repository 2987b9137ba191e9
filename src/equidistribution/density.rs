use crate::error::{Error, Failure, Result};
use crate::formula::{Formula, Mistake, Program};
use std::borrow::Cow;
use std::fmt;
use std::sync::Arc;

/// M(x, t) > 0 on a line, with its exact derivative by x
///
/// M is given by a formula or by the arc length √(1 + u_x²) of one, by a function, or by samples. Only ratios of M
/// count. Iterates with Robin conditions may leave the line, where a formula need not have values: see
/// [`within`](Self::within).
#[derive(Debug, Clone)]
pub struct LineDensity {
    kind: Kind,
    /// u, where M is its arc length.
    followed: Option<Program<1, 1>>,
    /// Places of spikes that the user named.
    spikes: Vec<f64>,
    /// Ends of the line beyond which M is constant.
    line: Option<[f64; 2]>,
}

#[derive(Clone)]
enum Kind {
    /// M and M_x.
    Formula(Program<1, 2>),
    /// u_x and u_xx.
    Arclength(Program<1, 2>),
    /// [M, M_x] as a function of time and places.
    Function(Arc<Function>),
    /// Linear between given places.
    Samples(Samples),
    /// M as a function of time and places on the line with these ends.
    Values(Values, [f64; 2]),
}

/// M by its values alone, defined on a line only.
#[derive(Clone)]
struct Values(Arc<ValuesFunction>);

/// Step of the difference quotient that stands for M_x, as a share of the length of the line. Newton's method only
/// converges a little slower with it.
const APART: f64 = 1e-6;

impl Values {
    /// [M, M_x] at places, M_x by a difference quotient whose places stay on the line.
    fn pairs(&self, t: f64, x: &[f64], [a, b]: [f64; 2]) -> Result<Vec<[f64; 2]>, Failure> {
        let n = x.len();
        let apart = APART * (b - a);
        let lower = x.iter().map(|x| (x - apart).max(a));
        let upper = x.iter().map(|x| (x + apart).min(b));
        let places: Vec<f64> = x.iter().copied().chain(lower).chain(upper).collect();
        let m = (self.0)(t, &places);
        if m.len() != places.len() {
            return Err(Failure::WrongLength { what: "the density", found: m.len(), expected: places.len() });
        }
        let slope = |k: usize| (m[2 * n + k] - m[n + k]) / (places[2 * n + k] - places[n + k]);
        Ok((0..n).map(|k| [m[k], slope(k)]).collect())
    }
}

/// M at some places, linear between them and constant beyond.
#[derive(Clone)]
struct Samples {
    x: Vec<f64>,
    m: Vec<f64>,
    /// ∫M from the first place to each.
    integral: Vec<f64>,
}

impl Samples {
    /// The interval that x lies in, and the distance of x from its beginning.
    fn place(&self, x: f64) -> (usize, f64) {
        let k = self.x.partition_point(|at| *at <= x).clamp(1, self.x.len() - 1) - 1;
        (k, x - self.x[k])
    }

    fn slope(&self, k: usize) -> f64 {
        (self.m[k + 1] - self.m[k]) / (self.x[k + 1] - self.x[k])
    }

    fn at(&self, x: f64) -> [f64; 2] {
        let (k, along) = self.place(x);
        match x.clamp(self.x[0], self.x[self.x.len() - 1]) {
            end if end != x => [self.m[if along < 0.0 { 0 } else { k + 1 }], 0.0],
            _ => [self.m[k] + along * self.slope(k), self.slope(k)],
        }
    }

    /// ∫M from the first place to x.
    fn up_to(&self, x: f64) -> f64 {
        let inside = x.clamp(self.x[0], self.x[self.x.len() - 1]);
        let (k, along) = self.place(inside);
        self.integral[k] + along * (self.m[k] + 0.5 * along * self.slope(k)) + (x - inside) * self.at(x)[0]
    }
}

type Function = dyn Fn(f64, &[f64]) -> Vec<[f64; 2]> + Send + Sync;
type ValuesFunction = dyn Fn(f64, &[f64]) -> Vec<f64> + Send + Sync;

impl fmt::Debug for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Formula(_) => "Formula",
            Self::Arclength(_) => "Arclength",
            Self::Function(_) => "Function",
            Self::Samples(_) => "Samples",
            Self::Values(..) => "Values",
        })
    }
}

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
/// A jump near an end of a piece is not seen by the quadrature, whose outermost places lie .4 % of the piece inside. It
/// is suspected where M changes by more than this share of its range between the end and the place beside it.
const ENDS: f64 = 0.05;
/// Halvings after which the rest of an integral is taken as it is: a piece of 2⁻⁴⁸ of the line is near rounding.
const DEEPEST: usize = 48;
/// Pieces beyond which none is halved any more: M then oscillates faster than can be followed.
const MOST_PIECES: usize = 4096;
/// Places of the first search for an extremum of M, evenly over the line.
const PLACES: usize = 2000;
/// Places of each later search, between the neighbours of the best place so far: each narrows the interval ten times.
const PLACES_AROUND: usize = 20;
/// Searches. Nine leave an interval of 1e-11 of the line.
const LOOKS: usize = 9;
/// Closing in on the largest change of u, the change is a jump where at least this share of it remains between
/// neighbouring floating-point numbers. That of a continuous u tends to 0.
const STILL_A_JUMP: f64 = 0.5;
/// A smallest M below this share of the largest one counts as 0: it is rounding.
const VANISHING: f64 = 1e-14;

impl LineDensity {
    /// M as a formula of x and t.
    ///
    /// # Errors
    /// [`Error::Formula`].
    pub fn formula(text: &str) -> Result<Self> {
        let m = parsed("value", text)?;
        let slope = differentiated("value", text, &m)?;
        Ok(Self { kind: Kind::Formula(Program::new([&m, &slope])), followed: None, spikes: Vec::new(), line: None })
    }

    /// M = √(1 + u_x²), with u as a formula of x and t.
    ///
    /// # Errors
    /// [`Error::Formula`].
    pub fn arclength(text: &str) -> Result<Self> {
        let u = parsed("of", text)?;
        let slope = differentiated("of", text, &u)?;
        let curvature = differentiated("of", text, &slope)?;
        Ok(Self {
            kind: Kind::Arclength(Program::new([&slope, &curvature])),
            followed: Some(Program::new([&u])),
            spikes: Vec::new(),
            line: None,
        })
    }

    /// [M, M_x] as a function of t and places, which returns one pair for each place.
    ///
    /// # Example
    /// ```
    /// use driftmesh::equidistribution::{Line, LineDensity};
    /// let density = LineDensity::function(|_, x| x.iter().map(|x| [x * x + 1.0, 2.0 * x]).collect());
    /// let [by_function, by_formula] = [density, LineDensity::formula("x^2 + 1")?].map(|density| {
    ///     let line = Line::new(density, 20);
    ///     line.solve(0.0, &line.uniform(), None).unwrap().0
    /// });
    /// assert_eq!(by_function, by_formula);
    /// # Ok::<(), driftmesh::Error>(())
    /// ```
    pub fn function(f: impl Fn(f64, &[f64]) -> Vec<[f64; 2]> + Send + Sync + 'static) -> Self {
        Self { kind: Kind::Function(Arc::new(f)), followed: None, spikes: Vec::new(), line: None }
    }

    /// M as a function of t and places, which returns one value for each place. It is called for places on the line
    /// only; beyond its ends M is constant.
    ///
    /// # Example
    /// ```
    /// use driftmesh::equidistribution::{FaceDensity, Line, LineDensity};
    /// // the root has no value left of 0
    /// let density = LineDensity::on_line([0.0, 1.0], |_, x| x.iter().map(|x| x.sqrt() + 0.1).collect());
    /// let x = Line { face: FaceDensity::Exact, ..Line::new(density, 20) }.equidistributed(0.0)?;
    /// assert!(x.is_sorted());
    /// # Ok::<(), driftmesh::Error>(())
    /// ```
    pub fn on_line(ends: [f64; 2], f: impl Fn(f64, &[f64]) -> Vec<f64> + Send + Sync + 'static) -> Self {
        let kind = Kind::Values(Values(Arc::new(f)), ends);
        Self { kind, followed: None, spikes: Vec::new(), line: Some(ends) }
    }

    /// M as samples, linear between them and constant beyond. [`FaceDensity::Exact`](super::FaceDensity) suits them
    /// best.
    ///
    /// # Errors
    /// [`Error::Invalid`] unless there are at least two places in ascending order, each with a finite M > 0. A place
    /// that comes twice is a jump of M.
    ///
    /// # Example
    /// ```
    /// use driftmesh::equidistribution::{FaceDensity, Line, LineDensity};
    /// // ∫M = x + x²/2: half of it lies left of √2.5 − 1
    /// let density = LineDensity::sampled(vec![0.0, 1.0], vec![1.0, 2.0])?;
    /// let line = Line { face: FaceDensity::Exact, ..Line::new(density, 20) };
    /// let x = line.solve(0.0, &line.uniform(), None)?.0;
    /// assert!((x[10] - (2.5_f64.sqrt() - 1.0)).abs() < 1e-12);
    /// # Ok::<(), driftmesh::Error>(())
    /// ```
    pub fn sampled(x: Vec<f64>, m: Vec<f64>) -> Result<Self> {
        if x.len() < 2 || x.len() != m.len() {
            let rule = format!("must have two places or more and one value each, not {}", m.len());
            return Err(Error::invalid("density", format!("{} places", x.len()), rule));
        }
        if let Some(k) = (1..x.len()).find(|&k| {
            let twice = x[k] == x[k - 1] && k > 1 && x[k] > x[k - 2] && k + 1 < x.len();
            !((x[k] > x[k - 1] || twice) && (x[k] - x[0]).is_finite())
        }) {
            let rule = format!(
                "places must be finite and grow from left to right, twice the same where M jumps; place {} is {}",
                k - 1,
                x[k - 1]
            );
            return Err(Error::invalid("density", format!("at {} in place {k}", x[k]), rule));
        }
        if let Some(k) = m.iter().position(|m| !(m.is_finite() && *m > 0.0)) {
            return Err(Error::invalid("density", format!("{} at {}", m[k], x[k]), "it must be finite and above 0"));
        }
        let mut integral = vec![0.0];
        let mut sum = 0.0;
        for k in 1..x.len() {
            sum += 0.5 * (m[k - 1] + m[k]) * (x[k] - x[k - 1]);
            integral.push(sum);
        }
        Ok(Self { kind: Kind::Samples(Samples { x, m, integral }), followed: None, spikes: Vec::new(), line: None })
    }

    /// u at each place, where M is its arc length.
    pub fn followed(&self, t: f64, x: &[f64]) -> Option<Vec<f64>> {
        let mut out = vec![[0.0]; x.len()];
        let points: Vec<[f64; 1]> = x.iter().map(|x| [*x]).collect();
        self.followed.as_ref()?.eval_each(&points, &[t], &mut out);
        Some(out.into_iter().map(|[u]| u).collect())
    }

    /// M and M_x at each place; M_x counts as 0 where it is not finite.
    ///
    /// # Errors
    /// [`Failure::LineDensity`] at the first place where M is not finite and positive.
    pub fn at_each(&self, t: f64, x: &[f64]) -> Result<Vec<[f64; 2]>, Failure> {
        let mut out = self.pairs(t, x)?;
        for ([m, slope], x) in out.iter_mut().zip(x) {
            if !is_sound(*m) {
                return Err(Failure::LineDensity { what: "M", value: *m, x: *x, t });
            }
            // M has a kink or a vertical tangent here
            if !slope.is_finite() {
                *slope = 0.0;
            }
        }
        Ok(out)
    }

    /// The same density with places of spikes that are thinner than a few thousandths of the line and could be
    /// overlooked.
    ///
    /// # Example
    /// ```
    /// use driftmesh::equidistribution::{FaceDensity, Line, LineDensity};
    /// let spike = LineDensity::formula("1 + 1e9*exp(-((x - 0.3)/1e-9)^2)")?.with_spikes(vec![0.3]);
    /// let line = Line { face: FaceDensity::Exact, ..Line::new(spike, 40) };
    /// let x = line.equidistributed(0.0)?;
    /// assert!(x.iter().filter(|x| (*x - 0.3).abs() < 1e-8).count() > 20);
    /// # Ok::<(), driftmesh::Error>(())
    /// ```
    #[must_use]
    pub fn with_spikes(self, spikes: Vec<f64>) -> Self {
        Self { spikes, ..self }
    }

    /// The same density, evaluated on a line only: beyond its ends M is constant.
    #[must_use]
    pub fn within(self, ends: [f64; 2]) -> Self {
        Self { line: Some(ends), ..self }
    }

    pub(super) fn spikes(&self) -> &[f64] {
        &self.spikes
    }

    /// M and M_x at each place, without any check.
    fn pairs(&self, t: f64, x: &[f64]) -> Result<Vec<[f64; 2]>, Failure> {
        let inside = self.inside(x);
        let mut out = vec![[0.0; 2]; x.len()];
        let points: Vec<[f64; 1]> = inside.iter().map(|x| [*x]).collect();
        match &self.kind {
            Kind::Formula(program) => program.eval_each(&points, &[t], &mut out),
            Kind::Arclength(program) => {
                program.eval_each(&points, &[t], &mut out);
                for [m, slope] in &mut out {
                    let (u_x, u_xx) = (*m, *slope);
                    *m = 1.0_f64.hypot(u_x);
                    *slope = u_x * u_xx / *m;
                }
            }
            Kind::Samples(samples) => {
                out.iter_mut().zip(x).for_each(|(out, x)| *out = samples.at(*x));
            }
            Kind::Function(f) => {
                out = f(t, &inside);
                if out.len() != x.len() {
                    return Err(Failure::WrongLength { what: "the density", found: out.len(), expected: x.len() });
                }
            }
            Kind::Values(values, ends) => out = values.pairs(t, &inside, *ends)?,
        }
        for ((pair, x), inside) in out.iter_mut().zip(x).zip(inside.iter()) {
            if x != inside {
                pair[1] = 0.0;
            }
        }
        Ok(out)
    }

    /// The places, with those beyond an end of the line moved to that end.
    fn inside<'a>(&self, x: &'a [f64]) -> Cow<'a, [f64]> {
        match self.line {
            Some([a, b]) if x.iter().any(|x| !(a..=b).contains(x)) => x.iter().map(|x| x.clamp(a, b)).collect(),
            _ => x.into(),
        }
    }

    /// M at each place.
    ///
    /// # Errors
    /// [`Failure::LineDensity`] at the first place where M is not finite and positive.
    pub fn values(&self, t: f64, x: &[f64]) -> Result<Vec<f64>, Failure> {
        let m: Vec<f64> = match &self.kind {
            Kind::Values(values, _) => {
                let m = (values.0)(t, &self.inside(x));
                if m.len() != x.len() {
                    return Err(Failure::WrongLength { what: "the density", found: m.len(), expected: x.len() });
                }
                m
            }
            _ => self.pairs(t, x)?.into_iter().map(|[m, _]| m).collect(),
        };
        match m.iter().position(|m| !is_sound(*m)) {
            None => Ok(m),
            Some(k) => Err(Failure::LineDensity { what: "M", value: m[k], x: x[k], t }),
        }
    }

    /// Places between which M is known to be linear, with both ends of the line; none for other densities.
    pub(super) fn breaks(&self, a: f64, b: f64) -> Option<Vec<f64>> {
        let Kind::Samples(samples) = &self.kind else { return None };
        let mut breaks = vec![a];
        breaks.extend(samples.x.iter().filter(|x| **x > a && **x < b));
        breaks.push(b);
        breaks.dedup();
        Some(breaks)
    }

    /// M at the ends of a piece on which it is linear, as limits from inside the piece.
    pub(super) fn between(&self, t: f64, [a, b]: [f64; 2]) -> Result<[f64; 2], Failure> {
        match &self.kind {
            Kind::Samples(samples) => {
                let middle = 0.5 * (a + b);
                let ([m, slope], half) = (samples.at(middle), 0.5 * (b - a));
                Ok([m - half * slope, m + half * slope])
            }
            _ => self.values(t, &[a, b]).map(|m| [m[0], m[1]]),
        }
    }

    /// M and M_x at one place.
    ///
    /// # Errors
    /// As [`at_each`](Self::at_each).
    pub fn at(&self, t: f64, x: f64) -> Result<[f64; 2], Failure> {
        self.at_each(t, &[x]).map(|m| m[0])
    }

    /// The smallest and the largest M from a to b, by searches in ever smaller intervals.
    ///
    /// # Errors
    /// As [`at_each`](Self::at_each); also where the smallest M counts as 0, or u jumps.
    pub fn extremes(&self, t: f64, [a, b]: [f64; 2]) -> Result<[f64; 2], Failure> {
        let last = |looks: &[[f64; 2]]| looks[looks.len() - 1];
        let high = last(&self.looked(t, [a, b], |[m, _]| m)?)[1];
        let [x, below] = last(&self.looked(t, [a, b], |[m, _]| -m)?);
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
            let places: Vec<f64> = (0..=cells).map(|k| a + (b - a) * k as f64 / cells as f64).collect();
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

    /// The place of the largest value of a function of M, and that value, after each search.
    fn looked(&self, t: f64, ends: [f64; 2], of: impl Fn([f64; 2]) -> f64) -> Result<Vec<[f64; 2]>, Failure> {
        let ([mut a, mut b], mut looks) = (ends, Vec::with_capacity(LOOKS));
        for look in 0..LOOKS {
            let cells = if look == 0 { PLACES } else { PLACES_AROUND };
            let places: Vec<f64> = (0..=cells).map(|k| a + (b - a) * k as f64 / cells as f64).collect();
            let values: Vec<f64> = self.at_each(t, &places)?.into_iter().map(&of).collect();
            let best = (0..=cells).fold(0, |best, k| if values[k] > values[best] { k } else { best });
            looks.push([places[best], values[best]]);
            (a, b) = (places[best.saturating_sub(1)], places[(best + 1).min(cells)]);
        }
        Ok(looks)
    }

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
            let around = |[a, b]: &[f64; 2]| (0.5 * (a + b), 0.5 * (b - a));
            let places = unsure.iter().flat_map(|piece| {
                let (middle, half) = around(piece);
                let inside = KRONROD.into_iter().flat_map(move |[x, ..]| [middle - half * x, middle + half * x]);
                inside.chain(*piece)
            });
            let values = self.at_each(t, &places.collect::<Vec<f64>>())?;
            let mut halves = Vec::new();
            for (piece, values) in unsure.iter().zip(values.chunks_exact(2 * KRONROD.len() + 2)) {
                let (mut fine, mut coarse) = (0.0, 0.0);
                let (values, ends) = values.split_at(2 * KRONROD.len());
                let [low, high] = values.iter().fold([f64::INFINITY, 0.0_f64], |[l, h], m| [l.min(m[0]), h.max(m[0])]);
                // the rule does not see a jump between an end of the piece and its outermost place
                let change = ENDS * (high - low) + 1e-10 * high;
                let jumps = ends.iter().zip(values).any(|(end, next)| (end[0] - next[0]).abs() > change);
                for ([x, kronrod, gauss], pair) in KRONROD.iter().zip(values.chunks_exact(2)) {
                    let sum = if *x == 0.0 { pair[0][0] } else { pair[0][0] + pair[1][0] };
                    fine += kronrod * sum;
                    coarse += gauss * sum;
                }
                let (middle, half) = around(piece);
                // the difference estimates the error of the rule of 7 points; that of 15 points is far more accurate
                if last || !jumps && (fine - coarse).abs() <= 1e-10 * fine.abs() {
                    sum += half * fine;
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

/// Bounds for values of M and for lengths of a line: their sums and products neither overflow nor underflow.
const SMALLEST: f64 = 1e-150;
const LARGEST: f64 = 1e150;

fn is_sound(m: f64) -> bool {
    (SMALLEST..=LARGEST).contains(&m)
}

/// Refuses a line that is too long, too short or too far away for products of its places.
///
/// # Errors
/// [`Error::Invalid`] with the key.
pub fn check_ends(key: &str, [a, b]: [f64; 2]) -> Result<()> {
    match a.abs().max(b.abs()) <= LARGEST && b - a >= SMALLEST {
        true => Ok(()),
        false => {
            let rule = format!(
                "a line has ends up to {LARGEST:e} and a length from {SMALLEST:e} on: take another unit of length"
            );
            Err(Error::invalid(key, format!("[{a:e}, {b:e}]"), rule))
        }
    }
}

fn parsed(key: &str, text: &str) -> Result<Formula> {
    Formula::parse(text, &["x", "t"]).map_err(|mistake| mistaken(key, text, mistake))
}

fn differentiated(key: &str, text: &str, formula: &Formula) -> Result<Formula> {
    formula.derivative(0).map_err(|mistake| mistaken(key, text, mistake))
}

fn mistaken(key: &str, text: &str, Mistake { message, at, help }: Mistake) -> Error {
    Error::Formula { key: key.into(), text: text.into(), at, message, help }
}
