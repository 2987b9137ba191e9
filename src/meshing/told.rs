//! What ranks tell each other of a mesh step.

use super::Estimate;
use crate::ranks::Shared;
use crate::work::Work;

impl Shared for Work {
    fn put(&self, words: &mut Vec<u64>) {
        let Self {
            linear_solves,
            linear_iterations,
            direct_unstarted,
            direct_stalled,
            newton_iterations,
            substeps,
            path_steps,
        } = *self;
        [linear_solves, linear_iterations, direct_unstarted, direct_stalled].put(words);
        [newton_iterations, substeps, path_steps].put(words);
    }

    fn take(words: &mut &[u64]) -> Self {
        let [linear_solves, linear_iterations, direct_unstarted, direct_stalled] = Shared::take(words);
        let [newton_iterations, substeps, path_steps] = Shared::take(words);
        Self {
            linear_solves,
            linear_iterations,
            direct_unstarted,
            direct_stalled,
            newton_iterations,
            substeps,
            path_steps,
        }
    }
}

impl<const D: usize> Shared for Estimate<D> {
    fn put(&self, words: &mut Vec<u64>) {
        self.x.put(words);
        self.standard_error.put(words);
    }

    fn take(words: &mut &[u64]) -> Self {
        Self { x: Shared::take(words), standard_error: Shared::take(words) }
    }
}
