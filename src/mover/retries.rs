use crate::density::smooth;
use crate::error::{Failure, Result};
use crate::geometry::{Density, Mesh};
use std::borrow::Cow;

/// Tries of a mesh step that failed and were done again.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Retries {
    /// Tries in more parts.
    pub substeps: usize,
    /// Tries with a smoother density.
    pub smoothed: usize,
}

/// Limits of what is tried where a step of the mesh fails
///
/// First the step is done in 2, 4, … `substeps` parts, ρ carried along by interpolation; then ρ is smoothed by 2, 4, …
/// `smoothing` further passes of the filter [`smooth`] before it moves the mesh.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Care {
    /// Largest number of parts into which a step is divided; 1 for none.
    pub substeps: usize,
    /// Largest number of further smoothing passes over ρ; 0 for none.
    pub smoothing: usize,
}

impl Default for Care {
    fn default() -> Self {
        Self { substeps: 8, smoothing: 8 }
    }
}

impl Care {
    /// The number of parts and of passes that are tried next, if anything is.
    fn beyond(self, substeps: usize, smoothing: usize) -> Option<(usize, usize)> {
        if smoothing == 0 && substeps < self.substeps {
            return Some(((2 * substeps).min(self.substeps), smoothing));
        }
        (smoothing < self.smoothing).then(|| (substeps, (2 * smoothing).max(2).min(self.smoothing)))
    }

    /// Tries with more and more parts and passes.
    ///
    /// # Errors
    /// The failure of the first try.
    pub(super) fn persist<T>(
        self,
        retries: &mut Retries,
        mut step: impl FnMut(usize, usize) -> Result<T, Failure>,
    ) -> Result<T, Failure> {
        let (mut substeps, mut smoothing) = (1, 0);
        let mut first = None;
        loop {
            match step(substeps, smoothing) {
                Ok(done) => return Ok(done),
                Err(failure) if !failure.is_curable() => return Err(failure),
                Err(failure) => {
                    let failure = first.get_or_insert(failure);
                    let Some(more) = self.beyond(substeps, smoothing) else { return Err(failure.clone()) };
                    match more.1 > 0 {
                        true => retries.smoothed += 1,
                        false => retries.substeps += 1,
                    }
                    (substeps, smoothing) = more;
                }
            }
        }
    }
}

/// A density after further passes of the filter.
pub(super) fn smoother<'a, const D: usize>(
    mesh: &Mesh<D>,
    rho: &'a Density,
    passes: usize,
) -> Result<Cow<'a, Density>, Failure> {
    if passes == 0 {
        return Ok(Cow::Borrowed(rho));
    }
    rho.check(mesh)?;
    Ok(Cow::Owned(rho.map(|part| {
        let mut part = part.clone();
        smooth(mesh.lattice(), &mut part, passes).expect("one value a node");
        part
    })))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// First the parts, then the passes, each doubled up to its limit and never beyond it.
    #[test]
    fn the_ladder_ends_at_its_limits() {
        let ladder = |substeps, smoothing| {
            let care = Care { substeps, smoothing };
            let all = std::iter::successors(Some((1, 0)), |tried| care.beyond(tried.0, tried.1));
            all.collect::<Vec<_>>()
        };
        assert_eq!(ladder(8, 8), [(1, 0), (2, 0), (4, 0), (8, 0), (8, 2), (8, 4), (8, 8)]);
        assert_eq!(ladder(3, 1), [(1, 0), (2, 0), (3, 0), (3, 1)]);
        assert_eq!(ladder(1, 8), [(1, 0), (1, 2), (1, 4), (1, 8)]);
        assert_eq!(ladder(1, 0), [(1, 0)]);
    }
}
