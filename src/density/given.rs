use super::{Density, Monitor, check_smoothing, smooth};
use crate::error::{Failure, Result};
use crate::geometry::{Mesh, check_length, check_positive};

/// The first unknown, or what is followed in its place, is the density itself: a prescribed ρ, or a depth of water
///
/// It must be positive everywhere; `smoothing` passes of the filter [`smooth`] follow.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Given {
    /// Passes of the filter (1 2 1)/4 along each axis.
    pub smoothing: usize,
}

impl Given {
    /// Refuses settings out of range.
    ///
    /// # Errors
    /// [`Error::Invalid`](crate::Error::Invalid) where the smoothing is beyond all reason.
    pub fn check(&self) -> Result<()> {
        check_smoothing(self.smoothing)
    }
}

impl<const D: usize> Monitor<D> for Given {
    fn density(&self, mesh: &Mesh<D>, u: &[f64], _gradient: Option<&[[f64; D]]>) -> Result<Density, Failure> {
        self.check().map_err(Failure::refusing)?;
        check_length(mesh.lattice(), "the density", u.len())?;
        check_positive(mesh, "the mesh density", u)?;
        let mut rho = u.to_vec();
        smooth(mesh.lattice(), &mut rho, self.smoothing)?;
        Ok(rho.into())
    }
}
