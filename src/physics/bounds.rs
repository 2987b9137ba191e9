//! Between which values unknowns stay.

use super::formula;
use super::prescribed::evaluate;
use crate::error::{Error, Failure, Result};
use crate::formula::{Formula, Program};
use crate::geometry::Mesh;
use crate::setting::Fluxes;

/// The lower and the upper bound of each unknown, as formulas of place and time; texts by name.
pub(super) type BoundTexts = Fluxes<2>;

/// Bounds that a study gives, and values that an equation may keep by itself.
pub(super) struct Bounds<const D: usize, const B: usize> {
    names: [String; B],
    given: [[Option<Program<D, 1>>; 2]; B],
    /// Those of −1, 0 and 1 that the equation of each unknown keeps, as far as samples of its formulas tell.
    pub states: [Vec<f64>; B],
}

/// Values that the equation of an unknown may keep: empty, full, or magnetised either way.
const STATES: [f64; 3] = [-1.0, 0.0, 1.0];

impl<const D: usize, const B: usize> Bounds<D, B> {
    /// `flows` are the fluxes of each unknown, formulas of D coordinates, the unknowns and t, and `reactions` the
    /// sources of those that have one and nothing else that changes them at their sides: what is only carried and
    /// diffused is conserved, which bounds would change.
    pub fn new(
        names: &[String],
        given: &[[Option<Formula>; 2]],
        flows: [Vec<&Formula>; B],
        reactions: [Option<&Formula>; B],
    ) -> Self {
        let compiled = |c: usize, end: usize| given[c][end].as_ref().map(|formula| Program::new([formula]));
        Self {
            names: std::array::from_fn(|c| names[c].clone()),
            given: std::array::from_fn(|c| [0, 1].map(|end| compiled(c, end))),
            states: std::array::from_fn(|c| match reactions[c] {
                None => Vec::new(),
                Some(source) => states::<D>(c, &flows[c], source),
            }),
        }
    }

    /// The bounds at all nodes at time t: `own` of each unknown, and those that are given; empty where there are none.
    ///
    /// # Errors
    /// [`Failure::Formula`] where a bound has no value, or the lower one is above the upper.
    pub fn at(&self, t: f64, mesh: &Mesh<D>, own: [[f64; 2]; B]) -> Result<Vec<[[f64; 2]; B]>, Failure> {
        let is_given = self.given.as_flattened().iter().any(Option::is_some);
        if !is_given && own.as_flattened().iter().all(|bound| bound.is_infinite()) {
            return Ok(Vec::new());
        }
        let mut bounds = vec![own; mesh.x().len()];
        for (c, name) in self.names.iter().enumerate() {
            let failure = |k: usize, what: String, value: f64| {
                let at = mesh.node_place(k);
                Failure::Formula { what, value, at, given: Vec::new() }
            };
            for (end, program) in self.given[c].iter().enumerate() {
                let Some(program) = program else { continue };
                for (k, ([value], bounds)) in evaluate(program, t, mesh).into_iter().zip(&mut bounds).enumerate() {
                    if value.is_nan() {
                        return Err(failure(k, format!("`pde.bounds.{name}[{end}]`"), value));
                    }
                    // what a study says goes before what an equation keeps
                    bounds[c][end] = value;
                }
            }
            if let Some(k) = bounds.iter().position(|bounds| bounds[c][0] > bounds[c][1]) {
                let what = format!("the lower bound of {name}, above the upper one {},", bounds[k][c][1]);
                return Err(failure(k, what, bounds[k][c][0]));
            }
        }
        Ok(bounds)
    }
}

/// Reads the bounds of an unknown; ±∞ is none.
///
/// # Errors
/// [`Error::Formula`] with the key; [`Error::Invalid`] where numbers are in the wrong order.
pub(super) fn read<const D: usize>(name: &str, texts: &BoundTexts) -> Result<[Option<Formula>; 2]> {
    let Some(texts) = texts.get(name) else { return Ok([None, None]) };
    let mut read = [None, None];
    for (end, text) in texts.iter().enumerate() {
        if !["inf", "+inf", "-inf"].contains(&text.trim()) {
            read[end] = Some(formula::<D>(&format!("bounds.{name}[{end}]"), text)?);
        }
    }
    if let [Some(lower), Some(upper)] = &read {
        let [low, high] = [lower, upper].map(|formula| formula.eval(&[]));
        if low > high {
            let (key, found) = (format!("bounds.{name}"), format!("[{low}, {high}]"));
            return Err(Error::invalid(key, found, "the first is the lower bound; exchange them"));
        }
    }
    Ok(read)
}

/// Those of −1, 0 and 1 that the equation of unknown c keeps: with the unknown at this value its source is 0 and its
/// fluxes are constant, at [`SAMPLES`] sampled places, times and values of the other unknowns. Empty unless the source
/// pushes away from one of them: else rounding heals by itself, and what one unknown loses and another gains is better
/// left in balance.
fn states<const D: usize>(c: usize, flows: &[&Formula], source: &Formula) -> Vec<f64> {
    let values = |sample: usize, state: f64| sampled(source, sample, (D + c, state));
    let keeps = |state: &f64| {
        let same = |flow: &&Formula| {
            let first = flow.eval(&values(0, *state));
            (1..SAMPLES).all(|sample| flow.eval(&values(sample, *state)) == first)
        };
        (0..SAMPLES).all(|sample| source.eval(&values(sample, *state)) == 0.0) && flows.iter().all(same)
    };
    let kept: Vec<f64> = STATES.into_iter().filter(keeps).collect();
    let pushes = |state: &f64| {
        let by = source.derivative(D + c);
        by.is_ok_and(|by| (0..SAMPLES).any(|sample| by.eval(&values(sample, *state)) > 0.0))
    };
    if kept.iter().any(pushes) { kept } else { Vec::new() }
}

/// Values of the variables of a formula at a sample, without a pattern, of either sign and all sizes up to ten; the one
/// that is fixed has its value.
pub(super) fn sampled(formula: &Formula, sample: usize, (fixed, value): (usize, f64)) -> Vec<f64> {
    let number_at = |v: usize| 10.0 * (1.7 + 3.1 * sample as f64 + 2.3 * (v * (sample + 1)) as f64).sin();
    (0..formula.variables().len()).map(|v| if v == fixed { value } else { number_at(v) }).collect()
}

/// Number of samples at which formulas are evaluated to find out what they keep.
pub(super) const SAMPLES: usize = 24;

#[cfg(test)]
mod tests {
    use super::*;

    fn kept(source: &str, flux: &str) -> Vec<f64> {
        let names = ["x", "u", "v", "t"];
        let [source, flux] = [source, flux].map(|text| Formula::parse(text, &names).unwrap());
        states::<1>(0, &[&flux], &source)
    }

    /// Logistic, bistable and predators' reactions keep their states; reactions without an unstable state, and what is
    /// fed or carried by a place or by others, keep none.
    #[test]
    fn states_of_reactions_are_found() {
        assert_eq!(kept("u*(1-u)", "0"), [0.0, 1.0]);
        assert_eq!(kept("u - u^3", "u^2"), [-1.0, 0.0, 1.0]);
        assert_eq!(kept("u*v - 0.1*u", "0"), [0.0]);
        assert_eq!(kept("u*(1-u)", "v*u"), [0.0]);
        for (source, flux) in [("u^2*v - 0.1*u", "0"), ("0.04*(1 - u) - u*v", "0"), ("u*(1-u)", "v"), ("-u", "0")] {
            assert_eq!(kept(source, flux), [0.0; 0], "{source}, {flux}");
        }
    }
}
