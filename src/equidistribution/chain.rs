use super::LineDensity;
use super::beyond::Beyond;
use super::cumulative::Cumulative;
use crate::error::{Act, Failure, Remedy, Setting};
use crate::numerics::linear::tridiagonal;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How M is averaged over a cell.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum FaceDensity {
    /// The trapezoidal rule: the mean of M at both ends of the cell.
    #[default]
    Trapezoid,
    /// The midpoint rule: M in the middle of the cell.
    Midpoint,
    /// ∫M over the cell, divided by its length. The nodes of the discrete problem are then those of the continuous one.
    Exact,
}

/// M̄ of a cell with its derivatives by the left and the right node.
#[derive(Debug, Clone, Copy)]
struct Face {
    mean: f64,
    by: [f64; 2],
}

/// A transmission condition at an end of a piece: the flux there is g + φ(x), with φ as follows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Law<'a> {
    /// φ = slope · x.
    Robin { slope: f64 },
    /// φ = (∫ M from x to `to`) / `length`: the flux of the rest of the line, which begins at x and is `length` long in
    /// ξ. The integral is exact, or by the trapezoidal rule with `panels`.
    Rest { to: f64, length: f64, panels: Option<usize> },
    /// φ = the flux of a time step into the rest of the line.
    Beyond(Beyond<'a>),
}

/// The boundary condition at an end of a piece of the line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum End<'a> {
    /// The position of the node.
    Value(f64),
    /// The flux F = g + φ(x).
    Flux { g: f64, law: Law<'a> },
}

/// The backward Euler step of x_t = (1/τ) (M x_ξ)_ξ.
#[derive(Debug, Clone, Copy)]
pub(super) struct Step<'a> {
    /// Nodes of this piece before the step.
    pub old: &'a [f64],
    /// τ/Δt.
    pub ratio: f64,
}

impl Step<'_> {
    /// The change of the flux over half a cell beside node i, which is at x, and its derivative by x.
    pub fn half(&self, h: f64, i: usize, x: f64) -> [f64; 2] {
        let slope = 0.5 * self.ratio * h;
        [slope * (x - self.old[i]), slope]
    }
}

/// (M x_ξ)_ξ = 0 on nodes ξ_i a distance `h` apart, as F_{i+½} = F_{i−½} with F_{i+½} = M̄ (x_{i+1} − x_i)/h.
#[derive(Debug, Clone, Copy)]
pub(super) struct Chain<'a> {
    pub density: &'a LineDensity,
    pub face: FaceDensity,
    pub t: f64,
    pub h: f64,
    /// The ends of the line in x.
    pub ends: [f64; 2],
    /// ∫M from the beginning of the line to any place, where it has been computed.
    pub cumulative: Option<&'a Cumulative>,
}

/// Largest number of Newton steps for a piece whose end nodes are given. With conditions on the flux a quarter of it is
/// taken: then many pieces have no discrete solution near an iterate and never converge. Of 2000 random lines as many
/// converged with the quarter as with all.
const MAX_NEWTON: usize = 200;
/// Largest number of steps in the search for a flux: Newton's, or doublings and halvings of a bracket. From a bracket
/// on, some 60 halvings reach rounding.
const MAX_BISECTIONS: usize = 400;
/// Halvings of a Newton step along straight lines before it is given up: 2⁻⁴⁰ of a step changes next to nothing.
const HALVINGS: i32 = 40;
/// Halvings that are tried before nodes may pass through each other, which iterates with conditions on the flux do.
const FEW_HALVINGS: i32 = 8;

/// Along which path a share of a Newton step is taken: by x, or by ∫M up to the node, in which the steady problem is
/// linear.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Way {
    Straight,
    Curved,
}

/// The steps to try in turn: the whole Newton step, halved ones along ∫M, and halved ones along x, all with nodes in
/// order. Where conditions on the flux allow it (`free`), the same follow with nodes in any order.
fn ways(free: bool) -> impl Iterator<Item = (bool, Way, f64)> {
    let halved = |ordered: bool, way: Way, halvings: std::ops::Range<i32>| {
        halvings.map(move |n| (ordered, way, 0.5_f64.powi(n)))
    };
    let tries = if free { FEW_HALVINGS } else { HALVINGS };
    halved(true, Way::Straight, 0..1)
        .chain(halved(true, Way::Curved, 0..tries / 2))
        .chain(halved(true, Way::Straight, 1..tries))
        .chain(halved(false, Way::Curved, 0..if free { tries } else { 0 }))
        .chain(halved(false, Way::Straight, 0..if free { HALVINGS } else { 0 }))
}

impl Law<'_> {
    /// φ and φ′.
    fn at(self, chain: &Chain<'_>, x: f64) -> Result<[f64; 2], Failure> {
        let (density, t) = (chain.density, chain.t);
        match self {
            Self::Robin { slope } => Ok([slope * x, slope]),
            Self::Beyond(beyond) => beyond.flux(chain, x),
            Self::Rest { to, length, panels: None } => {
                Ok([chain.integral(x, to)? / length, -density.at(t, x)?[0] / length])
            }
            Self::Rest { to, length, panels: Some(n) } => {
                let step = (to - x) / n as f64;
                let places: Vec<f64> = (0..=n).map(|k| x + k as f64 * step).collect();
                let (mut sum, mut slope) = (0.0, 0.0);
                for (k, [m, m_x]) in density.at_each(t, &places)?.into_iter().enumerate() {
                    let weight = if k == 0 || k == n { 0.5 } else { 1.0 };
                    sum += weight * m;
                    slope += weight * m_x * (1.0 - k as f64 / n as f64);
                }
                Ok([step * sum / length, (step * slope - sum / n as f64) / length])
            }
        }
    }
}

impl Chain<'_> {
    /// The nodes after a share of a Newton step along ∫M: each moves to where ∫M has changed by share × change × M(x).
    fn along(&self, cumulative: &Cumulative, x: &[f64], change: &[f64], share: f64) -> Vec<f64> {
        let moved = |(x, change): (&f64, &f64)| {
            let [g, m] = cumulative.at(*x);
            cumulative.place(g - share * change * m)
        };
        x.iter().zip(change).map(moved).collect()
    }

    /// ∫M from a to b.
    fn integral(&self, a: f64, b: f64) -> Result<f64, Failure> {
        match self.cumulative {
            Some(cumulative) => Ok(cumulative.up_to(b) - cumulative.up_to(a)),
            None => self.density.integral(self.t, a, b),
        }
    }

    /// The nodes of a piece where M is averaged exactly. All its cells have the same ∫M, so that one unknown is left,
    /// the flux F. With G = ∫M from the beginning of the line, n cells and the conditions at its ends,
    ///
    /// ```text
    /// G_right(F) − G_left(F) = n h F,   G_end(F) = G(x) at a given node,   G(to) − length (F − g),   G((F − g)/slope)
    /// ```
    ///
    /// where G_end(F) is, in this order, that of a given node, of the flux of the rest of the line, and of a Robin
    /// condition. The left side falls with F, so that there is one solution. None where G is not known or a condition
    /// is of another kind.
    fn even(&self, guess: &[f64], ends: [End<'_>; 2]) -> Option<Vec<f64>> {
        let (cumulative, n) = (self.cumulative?, guess.len() - 1);
        let length = n as f64 * self.h;
        let place = |end: End<'_>, flux: f64| match end {
            End::Value(x) => Some([cumulative.up_to(x), 0.0]),
            End::Flux { g, law: Law::Robin { slope } } => {
                let [y, m] = cumulative.at((flux - g) / slope);
                Some([y, m / slope])
            }
            End::Flux { g, law: Law::Rest { to, length, panels: None } } => {
                Some([cumulative.up_to(to) - length * (flux - g), -length])
            }
            End::Flux { .. } => None,
        };
        let left_over = |flux: f64| {
            let [[left, left_slope], [right, right_slope]] = [place(ends[0], flux)?, place(ends[1], flux)?];
            let falls = left_slope >= 0.0 && right_slope <= 0.0;
            falls.then_some([right - left - length * flux, right_slope - left_slope - length])
        };
        let first = (cumulative.up_to(guess[n]) - cumulative.up_to(guess[0])) / length;
        let flux = falling_root(first, cumulative.whole(), left_over)?;
        let [from, to] = [place(ends[0], flux)?[0], place(ends[1], flux)?[0]];
        let share = |i: usize| from + (to - from) * (i as f64 / n as f64);
        // with conditions on the flux the right end may lie left of the left one
        let mut x = match from <= to {
            true => cumulative.inverted((0..=n).map(share)),
            false => cumulative.inverted((0..=n).rev().map(share)).into_iter().rev().collect(),
        };
        for (end, node) in ends.into_iter().zip([0, n]) {
            if let End::Value(given) = end {
                x[node] = given;
            }
        }
        if let [End::Value(a), End::Value(b)] = ends {
            x.iter_mut().for_each(|x| *x = x.clamp(a.min(b), a.max(b)));
        }
        Some(x)
    }

    fn faces(&self, x: &[f64]) -> Result<Vec<Face>, Failure> {
        let cells = x.windows(2);
        match self.face {
            FaceDensity::Trapezoid => {
                let m = self.density.at_each(self.t, x)?;
                let face =
                    |m: &[[f64; 2]]| Face { mean: 0.5 * (m[0][0] + m[1][0]), by: [0.5 * m[0][1], 0.5 * m[1][1]] };
                Ok(m.windows(2).map(face).collect())
            }
            FaceDensity::Midpoint => {
                let middles: Vec<f64> = cells.map(|x| 0.5 * (x[0] + x[1])).collect();
                let m = self.density.at_each(self.t, &middles)?;
                Ok(m.into_iter().map(|[m, slope]| Face { mean: m, by: [0.5 * slope; 2] }).collect())
            }
            FaceDensity::Exact => {
                let m = self.density.at_each(self.t, x)?;
                cells
                    .zip(m.windows(2))
                    .map(|(x, m)| {
                        let width = x[1] - x[0];
                        if width == 0.0 {
                            return Ok(Face { mean: m[0][0], by: [0.5 * m[0][1], 0.5 * m[1][1]] });
                        }
                        let mean = self.integral(x[0], x[1])? / width;
                        Ok(Face { mean, by: [(mean - m[0][0]) / width, (m[1][0] - mean) / width] })
                    })
                    .collect()
            }
        }
    }

    /// The fluxes between the nodes.
    pub fn fluxes(&self, x: &[f64]) -> Result<Vec<f64>, Failure> {
        Ok(self.faces(x)?.iter().zip(x.windows(2)).map(|(face, x)| face.mean * (x[1] - x[0]) / self.h).collect())
    }

    /// The flux of one cell.
    pub fn flux(&self, left: f64, right: f64) -> Result<f64, Failure> {
        Ok(self.fluxes(&[left, right])?[0])
    }

    /// The flux of one cell, and its derivatives by the nodes at its ends.
    pub fn flux_of_cell(&self, left: f64, right: f64) -> Result<[f64; 3], Failure> {
        let (face, width) = (self.faces(&[left, right])?[0], right - left);
        Ok([face.mean * width, face.by[0] * width - face.mean, face.by[1] * width + face.mean].map(|v| v / self.h))
    }

    /// φ of a condition, for the end node at x.
    pub fn law(&self, law: Law<'_>, x: f64) -> Result<f64, Failure> {
        Ok(law.at(self, x)?[0])
    }

    /// Residuals at all nodes, 0 where the node is given, and their derivatives: below, own, above.
    pub fn linearised(
        &self,
        x: &[f64],
        ends: [End<'_>; 2],
        step: Option<Step<'_>>,
    ) -> Result<(Vec<f64>, Vec<[f64; 3]>), Failure> {
        let faces = self.faces(x)?;
        let n = faces.len();
        let mut residual = vec![0.0; n + 1];
        let mut rows = vec![[0.0, 1.0, 0.0]; n + 1];
        // flux of a cell, and its derivatives by the nodes at its ends
        let flux = |i: usize| {
            let (face, width) = (faces[i], x[i + 1] - x[i]);
            [face.mean * width, face.by[0] * width - face.mean, face.by[1] * width + face.mean].map(|v| v / self.h)
        };
        let mut below = flux(0);
        for i in 1..n {
            let above = flux(i);
            residual[i] = above[0] - below[0];
            rows[i] = [-below[1], above[1] - below[2], above[2]];
            if let Some(Step { old, ratio }) = step {
                residual[i] -= ratio * self.h * (x[i] - old[i]);
                rows[i][1] -= ratio * self.h;
            }
            below = above;
        }
        for (end, i) in ends.into_iter().zip([0, n]) {
            if let End::Flux { g, law } = end {
                let ([f, by_left, by_right], [phi, slope]) = (flux(i.min(n - 1)), law.at(self, x[i])?);
                // from the middle of the outermost cell to the end node the flux changes by half a cell's share
                let [more, by_node] = step.map_or([0.0; 2], |step| step.half(self.h, i, x[i]));
                let sign = if i == 0 { -1.0 } else { 1.0 };
                residual[i] = f + sign * more - g - phi;
                let own = sign * by_node - slope;
                rows[i] = if i == 0 { [0.0, by_left + own, by_right] } else { [by_left, by_right + own, 0.0] };
            }
        }
        Ok((residual, rows))
    }

    /// The nodes of a piece, and the number of linear solves that they took. Where M is averaged exactly the nodes
    /// follow from inverting ∫M, without any. Else Newton's method starts from a guess and, if that stalls, from the
    /// nodes that exact averages have.
    ///
    /// # Errors
    /// [`Failure::LineDensity`], [`Failure::LineStalled`].
    pub fn solve(
        &self,
        guess: &[f64],
        ends: [End<'_>; 2],
        step: Option<Step<'_>>,
    ) -> Result<(Vec<f64>, usize), Failure> {
        if self.face == FaceDensity::Exact
            && step.is_none()
            && let Some(nodes) = self.even(guess, ends)
        {
            return Ok((nodes, 0));
        }
        match self.newton(guess, ends, step) {
            Err(stalled @ Failure::LineStalled { .. }) => match self.even(guess, ends) {
                Some(near) if near.is_sorted_by(|a, b| a < b) => self.newton(&near, ends, step).map_err(|_| stalled),
                _ => Err(stalled),
            },
            other => other,
        }
    }

    /// The remedies to offer where Newton's method stalls.
    fn unstalling(&self, in_time: bool) -> Remedy {
        let exact = Act::Set(Setting::FaceDensity, &["\"exact\""]);
        let finer = [Act::Lower(Setting::TimeStep), Act::Refine(Setting::Cells)];
        match (self.face, in_time) {
            (FaceDensity::Exact, true) => Remedy::any(finer),
            (FaceDensity::Exact, false) => {
                Remedy::any([Act::Set(Setting::Integral, &["\"exact\""]), Act::Refine(Setting::Cells)])
            }
            (_, true) => Remedy::any([exact, finer[0], finer[1]]),
            (_, false) => Remedy::any([exact])
                .with(": a density that jumps or peaks within a cell has no mesh by trapezoids or midpoints"),
        }
    }

    /// Newton's method, damped so that nodes keep their order.
    pub fn newton(
        &self,
        guess: &[f64],
        ends: [End<'_>; 2],
        step: Option<Step<'_>>,
    ) -> Result<(Vec<f64>, usize), Failure> {
        let mut x = stretched(guess, ends);
        let size = x.iter().fold(f64::MIN_POSITIVE, |m: f64, x| m.max(x.abs()));
        let (mut residual, mut rows) = self.linearised(&x, ends, step)?;
        let mut last = f64::INFINITY;
        // with conditions on the flux an iterate may run backwards, and pass through nodes in no order on the way there
        let free = ends.iter().any(|end| matches!(end, End::Flux { .. }));
        let stalled = |residual: f64, iterations: usize| Failure::LineStalled {
            residual,
            iterations,
            remedies: vec![self.unstalling(step.is_some())],
        };
        let most = if free { MAX_NEWTON / 4 } else { MAX_NEWTON };
        for solves in 1..=most {
            let change = tridiagonal(&rows, &residual);
            let largest = change.iter().fold(0.0, |m: f64, c| m.max(c.abs()));
            let before = norm(&residual);
            // residuals below this are of rounding: moving each node by its last bit changes as much
            let rounding = 4.0 * f64::EPSILON * size * rows.iter().fold(0.0, |m: f64, row| m.max(row[1].abs()));
            let mut found = None;
            for (ordered, way, share) in ways(free) {
                let mut tried: Vec<f64> = match way {
                    Way::Straight => x.iter().zip(&change).map(|(x, c)| x - share * c).collect(),
                    Way::Curved => match self.cumulative {
                        Some(cumulative) => self.along(cumulative, &x, &change, share),
                        None => continue,
                    },
                };
                // nodes that are given keep their exact value
                for (end, node) in ends.into_iter().zip([0, x.len() - 1]) {
                    if let End::Value(given) = end {
                        tried[node] = given;
                    }
                }
                if !ordered || tried.windows(2).all(|x| x[1] > x[0]) || free && tried.windows(2).all(|x| x[1] < x[0]) {
                    let (r, m) = match self.linearised(&tried, ends, step) {
                        // a step beyond the end of the line, where the rest of it is empty
                        Err(Failure::LineStalled { .. }) => continue,
                        other => other?,
                    };
                    if norm(&r) < before.max(rounding) || largest <= 1e-9 * size {
                        found = Some((tried, r, m, share));
                        break;
                    }
                }
            }
            let Some((tried, r, m, share)) = found else {
                return Err(stalled(before, solves));
            };
            (x, residual, rows) = (tried, r, m);
            // Newton's method converges quadratically until rounding, and from there on steps no longer shrink
            if share == 1.0
                && largest <= 1e-9 * size
                && (largest >= 0.25 * last || largest <= 4.0 * f64::EPSILON * size)
            {
                return Ok((x, solves));
            }
            last = largest;
        }
        Err(stalled(norm(&residual), most))
    }

    /// One linear solve with the face densities of given nodes frozen.
    ///
    /// # Errors
    /// [`Failure::LineDensity`].
    pub fn frozen(&self, at: &[f64], ends: [f64; 2], step: Option<Step<'_>>) -> Result<Vec<f64>, Failure> {
        let faces = self.faces(at)?;
        let n = faces.len();
        let mut right = vec![0.0; n + 1];
        let mut rows = vec![[0.0, 1.0, 0.0]; n + 1];
        (right[0], right[n]) = (ends[0], ends[1]);
        for i in 1..n {
            let (a, b) = (faces[i - 1].mean / self.h, faces[i].mean / self.h);
            rows[i] = [-a, a + b, -b];
            if let Some(Step { old, ratio }) = step {
                rows[i][1] += ratio * self.h;
                right[i] = ratio * self.h * old[i];
            }
        }
        Ok(tridiagonal(&rows, &right))
    }
}

/// The root of a decreasing function, given with its derivative, by Newton's method within a bracket that is found
/// first. None where the function has no value or no bracket exists.
fn falling_root(first: f64, size: f64, f: impl Fn(f64) -> Option<[f64; 2]>) -> Option<f64> {
    let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
    let mut at = first;
    let mut step = size.max(first.abs());
    for _ in 0..MAX_BISECTIONS {
        let [value, slope] = f(at)?;
        if value == 0.0 {
            return Some(at);
        }
        if value.is_nan() {
            return None;
        }
        *(if value > 0.0 { &mut low } else { &mut high }) = at;
        let bounded = low.is_finite() && high.is_finite();
        let newton = at - value / slope;
        if (newton - at).abs() <= f64::EPSILON * at.abs()
            || bounded && high - low <= f64::EPSILON * low.abs().max(high.abs())
        {
            return Some(if newton >= low && newton <= high { newton } else { at });
        }
        at = if newton > low && newton < high {
            newton
        } else if bounded {
            0.5 * (low + high)
        } else {
            step *= 2.0;
            at + step.copysign(value)
        };
    }
    (low.is_finite() && high.is_finite()).then_some(at)
}

/// The guess with the end nodes that are given: the whole piece is stretched linearly, which keeps the order of nodes.
fn stretched(guess: &[f64], ends: [End<'_>; 2]) -> Vec<f64> {
    let (first, last) = (guess[0], guess[guess.len() - 1]);
    let [left, right] = [(ends[0], first), (ends[1], last)].map(|(end, own)| match end {
        End::Value(x) => x,
        End::Flux { .. } => own,
    });
    let mut x: Vec<f64> = guess.iter().map(|x| left + (x - first) / (last - first) * (right - left)).collect();
    let n = x.len() - 1;
    (x[0], x[n]) = (left, right);
    x
}

fn norm(residual: &[f64]) -> f64 {
    residual.iter().fold(0.0, |m, r| if r.is_nan() { f64::INFINITY } else { m.max(r.abs()) })
}
