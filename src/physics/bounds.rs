//! Between which values unknowns stay.

use super::formula;
use super::prescribed::evaluate;
use crate::error::{Error, Failure, Result};
use crate::formula::{Formula, Program};
use crate::geometry::Mesh;
use crate::setting::Fluxes;

/// The lower and the upper bound of each unknown, as formulas of place and time; texts by name.
pub(super) type BoundTexts = Fluxes<2>;

/// Bounds that a study gives, and those that an equation keeps by itself.
pub(super) struct Bounds<const D: usize, const B: usize> {
    names: [String; B],
    given: [[Option<Program<D, 1>>; 2]; B],
    kept: [Vec<f64>; B],
}

/// Values that equations may keep: what is empty, full, or magnetised either way.
const STATES: [f64; 3] = [-1.0, 0.0, 1.0];

impl<const D: usize, const B: usize> Bounds<D, B> {
    /// `flows` are the fluxes of each unknown, formulas of D coordinates, the unknowns and t, and `reactions` the sources
    /// of those that have one: the others are conserved, which bounds of their own would change.
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
            kept: std::array::from_fn(|c| match reactions[c] {
                None => Vec::new(),
                Some(source) => STATES.into_iter().filter(|state| keeps::<D>(c, *state, &flows[c], source)).collect(),
            }),
        }
    }

    /// The bounds at all nodes at time t, in a step that begins with the values `u`; empty where there are none.
    ///
    /// # Errors
    /// [`Failure::Formula`] where a bound has no value, or the lower one is above the upper.
    pub fn at(&self, t: f64, mesh: &Mesh<D>, u: &[[f64; B]]) -> Result<Vec<[[f64; 2]; B]>, Failure> {
        let own: [[f64; 2]; B] = std::array::from_fn(|c| {
            let [least, largest] =
                u.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], u| [l.min(u[c]), h.max(u[c])]);
            let below = self.kept[c].iter().copied().filter(|state| *state <= least);
            let above = self.kept[c].iter().copied().filter(|state| *state >= largest);
            [below.fold(f64::NEG_INFINITY, f64::max), above.fold(f64::INFINITY, f64::min)]
        });
        let is_given = self.given.as_flattened().iter().any(Option::is_some);
        if !is_given && own.as_flattened().iter().all(|bound| bound.is_infinite()) {
            return Ok(Vec::new());
        }
        let mut bounds = vec![own; mesh.x().len()];
        for (c, name) in self.names.iter().enumerate() {
            let failure = |k: usize, what: String, value: f64| {
                let (node, x) = mesh.told(k);
                Failure::Formula { what, value, node, x, given: Vec::new() }
            };
            for (end, program) in self.given[c].iter().enumerate() {
                let Some(program) = program else { continue };
                for (k, ([value], bounds)) in evaluate(program, t, mesh).into_iter().zip(&mut bounds).enumerate() {
                    if value.is_nan() {
                        return Err(failure(k, format!("`pde.bounds.{name}[{end}]`"), value));
                    }
                    bounds[c][end] = if end == 0 { value.max(bounds[c][0]) } else { value.min(bounds[c][1]) };
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

/// Whether unknown c stays at a value where it has it, whatever the others are: no source there, and a flux that is the
/// same everywhere. Formulas are asked at some places, times and values of the others.
fn keeps<const D: usize>(c: usize, state: f64, flows: &[&Formula], source: &Formula) -> bool {
    let values = |sample: usize| -> Vec<f64> {
        let number = source.variables().len();
        // numbers without a pattern, of either sign, of all sizes up to ten
        let at = |v: usize| 10.0 * (1.7 + 3.1 * sample as f64 + 2.3 * v as f64 * (sample + 1) as f64).sin();
        (0..number).map(|v| if v == D + c { state } else { at(v) }).collect()
    };
    let same = |formula: &Formula| {
        let first = formula.eval(&values(0));
        (1..SAMPLES).all(|sample| formula.eval(&values(sample)) == first)
    };
    (0..SAMPLES).all(|sample| source.eval(&values(sample)) == 0.0) && flows.iter().all(|flow| same(flow))
}

/// Places at which formulas are asked.
const SAMPLES: usize = 24;

#[cfg(test)]
mod tests {
    use super::*;

    fn kept(source: &str, flux: &str) -> Vec<f64> {
        let names = ["x", "u", "v", "t"];
        let [source, flux] = [source, flux].map(|text| Formula::parse(text, &names).unwrap());
        STATES.into_iter().filter(|state| keeps::<1>(0, *state, &[&flux], &source)).collect()
    }

    /// Logistic, bistable and Gray and Scott's reactions keep their states; what is fed, or carried together by a
    /// place, does not.
    #[test]
    fn states_of_reactions_are_found() {
        assert_eq!(kept("u*(1-u)", "0"), [0.0, 1.0]);
        assert_eq!(kept("u - u^3", "u^2"), [-1.0, 0.0, 1.0]);
        assert_eq!(kept("u^2*v - 0.1*u", "0"), [0.0]);
        assert_eq!(kept("0.04*(1 - u) - u*v", "0"), [0.0; 0]);
        assert_eq!(kept("u*(1-u)", "v*u"), [0.0]);
        assert_eq!(kept("u*(1-u)", "v"), [0.0; 0]);
    }
}
