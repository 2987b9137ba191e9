//! The mesh density ρ: large where the mesh should be fine.
//!
//! Every density is positive and finite, and only its ratios matter: ρ and cρ give the same mesh.

mod arclength;
mod curvature;
mod following;
mod given;
mod jump;
mod limited;
mod need;
mod noise;
mod root_gradient;
mod smoothing;
mod tables;

pub use arclength::{Arclength, Strength};
pub use curvature::Curvature;
pub use given::Given;
pub(crate) use jump::{edges, largest_step};
pub use limited::CellSizes;
pub(crate) use need::{Need, interpolation_errors};
pub use noise::{NOISE_WORTH_A_WARNING, noise};
pub use root_gradient::RootGradient;
pub use smoothing::smooth;
pub use tables::{ArclengthTable, CurvatureTable, GivenTable, RootGradientTable};

use crate::error::{Error, Failure, Result};
pub use crate::geometry::Density;
use crate::geometry::{Cells, Field, Mesh};
use crate::kind::kinds;
use crate::numerics::difference::Gradient;
use following::Following;
use limited::Limited;

/// Largest number of passes of the filter over a density that a study may set: more leave nothing of it on any lattice
/// that fits a machine.
const MAX_SMOOTHING: usize = 1000;

/// Refuses more passes than these.
fn check_smoothing(passes: usize) -> Result<()> {
    match passes <= MAX_SMOOTHING {
        true => Ok(()),
        false => Err(Error::invalid("smoothing", passes, format!("must be at most {MAX_SMOOTHING} passes"))),
    }
}

/// Where a mesh should be fine, decided from the solution on the mesh it has.
pub trait Monitor<const D: usize = 2>: Send {
    /// ρ at every node from one value of u a node, both in lattice order; with ∇u where it is known exactly, so that it
    /// need not be differenced.
    ///
    /// # Errors
    /// [`Failure::NonFinite`] names the first node where ρ is not a finite number.
    fn density(&self, mesh: &Mesh<D>, u: &[f64], gradient: Option<&[[f64; D]]>) -> Result<Density, Failure>;

    /// ρ at every node from all unknowns: that of what is [`followed`](Self::followed) where nothing else is said.
    ///
    /// # Errors
    /// As [`density`](Self::density) and [`followed`](Self::followed).
    fn density_of(
        &self,
        t: f64,
        mesh: &Mesh<D>,
        unknowns: &Field,
        gradient: Option<&[[f64; D]]>,
    ) -> Result<Density, Failure> {
        self.density(mesh, &self.followed(t, mesh, unknowns)?, gradient)
    }

    /// The u of [`density`](Self::density), from all unknowns: the first one where nothing else is said.
    ///
    /// # Errors
    /// [`Failure::Formula`] names the first node where it is not a finite number.
    fn followed(&self, _t: f64, _mesh: &Mesh<D>, unknowns: &Field) -> Result<Vec<f64>, Failure> {
        Ok(unknowns.component(0).collect())
    }
}

kinds! {
    /// `[monitor]` of a study.
    MonitorKind {
        "auto" = RootGradientTable: "rho = 1 + 4 sqrt(|du/dx|)/mean along each axis, smoothed; nothing to set",
        "arclength" = ArclengthTable: "rho = sqrt(1 + alpha |grad u|^2), smoothed",
        "curvature" = CurvatureTable: "rho = (1 + alpha |H|^2)^(1/(D + 4)), H the second derivatives of u, smoothed",
        "given" = GivenTable: "rho = the unknown itself, smoothed",
    }
}

impl Default for MonitorKind {
    fn default() -> Self {
        Self::RootGradientTable(RootGradientTable::default())
    }
}

impl MonitorKind {
    /// Refuses settings out of range.
    ///
    /// # Errors
    /// [`Error::Invalid`].
    pub fn check(&self) -> Result<()> {
        self.cells().map_or(Ok(()), CellSizes::check)?;
        match self {
            Self::RootGradientTable(_) => Ok(()),
            Self::ArclengthTable(arclength) => arclength.density().check(),
            Self::CurvatureTable(curvature) => curvature.density().check(),
            Self::GivenTable(given) => given.density().check(),
        }
    }

    /// How the mesh equation differences this density.
    pub fn gradient(&self) -> Gradient {
        match self {
            Self::RootGradientTable(_) => Gradient::Safe,
            Self::ArclengthTable(arclength) => arclength.gradient,
            Self::CurvatureTable(curvature) => curvature.gradient,
            Self::GivenTable(given) => given.gradient,
        }
    }

    /// The unknown, or the formula of them, that the mesh follows, where that is said.
    pub fn of(&self) -> Option<&str> {
        match self {
            Self::RootGradientTable(root) => root.of.as_deref(),
            Self::ArclengthTable(arclength) => arclength.of.as_deref(),
            Self::CurvatureTable(curvature) => curvature.of.as_deref(),
            Self::GivenTable(given) => given.of.as_deref(),
        }
    }

    /// Limits on the sizes of cells, where there are some.
    pub fn cells(&self) -> Option<&CellSizes> {
        match self {
            Self::RootGradientTable(root) => root.cells.as_ref(),
            Self::ArclengthTable(arclength) => arclength.cells.as_ref(),
            Self::CurvatureTable(curvature) => curvature.cells.as_ref(),
            Self::GivenTable(given) => given.cells.as_ref(),
        }
    }

    /// The monitor for an equation of these unknowns, ready to use.
    ///
    /// # Errors
    /// [`Error::Formula`] where `of` is no formula of the unknowns, x, y and t.
    pub fn into_monitor<const D: usize>(self, unknowns: &[String]) -> Result<Box<dyn Monitor<D>>>
    where
        Mesh<D>: Cells<D>,
    {
        // the first unknown is what all but the default follow without a word
        let of_all = matches!(self, Self::RootGradientTable(_)) && unknowns.len() > 1;
        let is_first = |of: &str| Some(of) == unknowns.first().map(String::as_str);
        let cells = self.cells().copied().filter(|cells| *cells != CellSizes::default());
        let of = self.of().filter(|of| of_all || !is_first(of)).map(String::from);
        let monitor: Box<dyn Monitor<D>> = match self {
            Self::RootGradientTable(_) => Box::new(RootGradient::default()),
            Self::ArclengthTable(arclength) => Box::new(arclength.density()),
            Self::CurvatureTable(curvature) => Box::new(curvature.density()),
            Self::GivenTable(given) => Box::new(given.density()),
        };
        let monitor = match of {
            Some(of) => Box::new(Following::new(monitor, &of, unknowns)?),
            None => monitor,
        };
        Ok(match cells {
            Some(cells) => Box::new(Limited { monitor, cells }),
            None => monitor,
        })
    }
}
