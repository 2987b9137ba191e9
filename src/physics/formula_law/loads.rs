//! Sources as functions of place and time, with unknowns that are given.

use crate::formula::{Formula, Program};
use crate::parallel;

/// Sources of B unknowns, each a formula of the P values at a node, place first and then unknowns; none for an unknown
/// without such a source.
pub(super) struct Loads<const P: usize, const B: usize> {
    sources: [Option<Program<P, 1>>; B],
}

impl<const P: usize, const B: usize> Loads<P, B> {
    pub fn new(sources: [Option<&Formula>; B]) -> Self {
        Self { sources: sources.map(|source| source.map(|source| Program::new([source]))) }
    }

    pub fn are_some(&self) -> bool {
        self.sources.iter().any(Option::is_some)
    }

    /// The sources at some places, at the k-th of which the unknowns are u(k); 0 for unknowns without such a source.
    pub fn at<const D: usize>(&self, t: f64, x: &[[f64; D]], u: impl Fn(usize) -> [f64; B] + Sync) -> Vec<[f64; B]> {
        let mut loads = vec![[0.0; B]; x.len()];
        parallel::for_each_piece(&mut loads, |begin, loads| {
            let point = |k: usize| {
                let u = u(k);
                std::array::from_fn(|v| if v < D { x[k][v] } else { u[v - D] })
            };
            let points: Vec<[f64; P]> = (begin..begin + loads.len()).map(point).collect();
            let mut values = vec![[0.0]; points.len()];
            for (c, source) in self.sources.iter().enumerate() {
                let Some(source) = source else { continue };
                source.eval_each(&points, &[t], &mut values);
                loads.iter_mut().zip(&values).for_each(|(load, [value])| load[c] = *value);
            }
        });
        loads
    }
}
