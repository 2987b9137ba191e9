//! Densities of a line: [`LineDensity`] with its values, its extremes and its integrals.

mod extremes;
mod integral;
mod samples;

use crate::error::{Error, Failure, Result};
use crate::formula::{Formula, Program};
use samples::Samples;
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

type Function = dyn Fn(f64, &[f64]) -> Vec<[f64; 2]> + Send + Sync;
type ValuesFunction = dyn Fn(f64, &[f64]) -> Vec<f64> + Send + Sync;

/// M by its values alone, defined on a line only.
#[derive(Clone)]
struct Values(Arc<ValuesFunction>);

/// Step of the difference quotient that stands for M_x, as a share of the length of the line: M has some 1e-16 of
/// rounding, which leaves 1e-10 of the slope. Newton's method only converges a little slower with it.
const APART: f64 = 1e-6;

impl Values {
    fn at(&self, t: f64, x: &[f64]) -> Result<Vec<f64>, Failure> {
        of_length((self.0)(t, x), x.len())
    }

    /// [M, M_x] at places, M_x by a difference quotient whose places stay on the line.
    fn pairs(&self, t: f64, x: &[f64], [a, b]: [f64; 2]) -> Result<Vec<[f64; 2]>, Failure> {
        let n = x.len();
        let apart = APART * (b - a);
        let lower = x.iter().map(|x| (x - apart).max(a));
        let upper = x.iter().map(|x| (x + apart).min(b));
        let places: Vec<f64> = x.iter().copied().chain(lower).chain(upper).collect();
        let m = self.at(t, &places)?;
        let slope = |k: usize| (m[2 * n + k] - m[n + k]) / (places[2 * n + k] - places[n + k]);
        Ok((0..n).map(|k| [m[k], slope(k)]).collect())
    }
}

/// Refuses values of a function that are not one for each of its places.
fn of_length<T>(values: Vec<T>, places: usize) -> Result<Vec<T>, Failure> {
    match values.len() {
        found if found != places => Err(Failure::WrongLength { what: "the density", found, expected: places }),
        _ => Ok(values),
    }
}

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

impl LineDensity {
    fn of(kind: Kind) -> Self {
        Self { kind, followed: None, spikes: Vec::new(), line: None }
    }

    /// M as a formula of x and t.
    ///
    /// # Errors
    /// [`Error::Formula`].
    pub fn formula(text: &str) -> Result<Self> {
        let m = parsed("value", text)?;
        let slope = differentiated("value", text, &m)?;
        Ok(Self::of(Kind::Formula(Program::new([&m, &slope]))))
    }

    /// M = √(1 + u_x²), with u as a formula of x and t.
    ///
    /// # Errors
    /// [`Error::Formula`].
    pub fn arclength(text: &str) -> Result<Self> {
        let u = parsed("of", text)?;
        let slope = differentiated("of", text, &u)?;
        let curvature = differentiated("of", text, &slope)?;
        let followed = Some(Program::new([&u]));
        Ok(Self { followed, ..Self::of(Kind::Arclength(Program::new([&slope, &curvature]))) })
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
        Self::of(Kind::Function(Arc::new(f)))
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
        Self::of(Kind::Values(Values(Arc::new(f)), ends)).within(ends)
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
        Samples::new(x, m).map(|samples| Self::of(Kind::Samples(samples)))
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
        check_sound(t, x, out.iter().map(|[m, _]| *m))?;
        // where M has a kink or a vertical tangent
        out.iter_mut().filter(|[_, slope]| !slope.is_finite()).for_each(|[_, slope]| *slope = 0.0);
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
            Kind::Function(f) => out = of_length(f(t, &inside), x.len())?,
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
            Kind::Values(values, _) => values.at(t, &self.inside(x))?,
            _ => self.pairs(t, x)?.into_iter().map(|[m, _]| m).collect(),
        };
        check_sound(t, x, m.iter().copied())?;
        Ok(m)
    }

    /// Places between which M is known to be linear, with both ends of the line; none for other densities.
    pub(super) fn breaks(&self, a: f64, b: f64) -> Option<Vec<f64>> {
        if let Kind::Samples(samples) = &self.kind { Some(samples.breaks(a, b)) } else { None }
    }

    /// M at the ends of a piece on which it is linear, as limits from inside the piece.
    pub(super) fn between(&self, t: f64, [a, b]: [f64; 2]) -> Result<[f64; 2], Failure> {
        match &self.kind {
            Kind::Samples(samples) => Ok(samples.between([a, b])),
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
}

/// The smallest value of M and the shortest line, in any unit: products of two such numbers do not underflow.
const SMALLEST: f64 = 1e-150;
/// The largest value of M and the farthest end of a line, in any unit: products of two such numbers do not overflow.
const LARGEST: f64 = 1e150;

/// Refuses the first M that is not finite and positive, or out of these bounds.
fn check_sound(t: f64, x: &[f64], m: impl Iterator<Item = f64>) -> Result<(), Failure> {
    match m.zip(x).find(|(m, _)| !(SMALLEST..=LARGEST).contains(m)) {
        None => Ok(()),
        Some((value, x)) => Err(Failure::LineDensity { what: "M", value, x: *x, t }),
    }
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
    Formula::parse(text, &["x", "t"]).map_err(|mistake| mistake.of(key, text))
}

fn differentiated(key: &str, text: &str, formula: &Formula) -> Result<Formula> {
    formula.derivative(0).map_err(|mistake| mistake.of(key, text))
}
