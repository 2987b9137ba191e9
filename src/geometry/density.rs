use super::{Mesh, check_length, nodal::check_positive};
use crate::error::{Error, Failure, Result};
use serde::{Deserialize, Serialize};

/// A mesh density ρ > 0 with one value a node, in lattice order: one for all axes of the lattice, or one for each
///
/// ```text
/// ∂_ξ(ρ₁ x_ξ) + ∂_η(ρ₂ x_η) = 0,   the same for y
/// ```
///
/// ρ₁ draws nodes together along the lattice lines on which ξ varies, ρ₂ along the others. With ρ₁ = ρ₂ a layer draws
/// nodes along both: where two layers meet that lie across different axes, the nodes of each are drawn into the other.
///
/// # Example
/// ```
/// use driftmesh::density::Density;
/// let one: Density = [1.0, 2.0, 4.0].into_iter().collect();
/// assert_eq!(one.along(1), [1.0, 2.0, 4.0]);
/// let each = Density::of_axes([vec![1.0, 2.0, 4.0], vec![1.0, 6.0, 2.0]])?;
/// assert_eq!((each.along(1), each.largest()), (&[1.0, 6.0, 2.0][..], &[1.0, 6.0, 4.0][..]));
/// # Ok::<(), driftmesh::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(from = "Vec<Vec<f64>>", into = "Vec<Vec<f64>>")]
pub struct Density {
    /// One array, or one for each axis.
    parts: Vec<Vec<f64>>,
    /// The largest over the axes; empty where there is one array for all.
    largest: Vec<f64>,
}

impl Density {
    /// A density for each axis.
    ///
    /// # Errors
    /// [`Error::Invalid`] where the arrays are not of one length, or there is none.
    pub fn of_axes<const D: usize>(axes: [Vec<f64>; D]) -> Result<Self> {
        let lengths = axes.each_ref().map(Vec::len);
        if lengths.iter().any(|length| *length != lengths[0]) || D == 0 {
            return Err(Error::invalid("axes", format!("arrays of {lengths:?} values"), "need one value a node each"));
        }
        Ok(Self::of_parts(axes.into()))
    }

    /// From arrays of one length: one, or one for each axis.
    fn of_parts(parts: Vec<Vec<f64>>) -> Self {
        let largest = match &parts[..] {
            [] | [_] => Vec::new(),
            [first, others @ ..] => {
                let mut largest = first.clone();
                for other in others {
                    largest.iter_mut().zip(other).for_each(|(largest, rho)| *largest = largest.max(*rho));
                }
                largest
            }
        };
        Self { parts, largest }
    }

    /// The density along lattice lines on which only the coordinate of this axis varies.
    pub fn along(&self, axis: usize) -> &[f64] {
        &self.parts[if self.parts.len() == 1 { 0 } else { axis }]
    }

    /// The largest over the axes: what is written and drawn, and the ρ in front of x_t.
    pub fn largest(&self) -> &[f64] {
        match &self.parts[..] {
            [one] => one,
            _ => &self.largest,
        }
    }

    /// The arrays: one, or one for each axis.
    pub(crate) fn parts(&self) -> &[Vec<f64>] {
        &self.parts
    }

    /// What becomes of each array.
    pub(crate) fn map(&self, f: impl FnMut(&Vec<f64>) -> Vec<f64>) -> Self {
        Self::of_parts(self.parts.iter().map(f).collect())
    }

    /// `share` of this density and the rest of another one.
    ///
    /// # Panics
    /// If they have not the same number of nodes.
    pub(crate) fn mixed(&self, share: f64, other: &Self) -> Self {
        assert_eq!(self.largest().len(), other.largest().len(), "both densities need the same nodes");
        let parts = (0..self.parts.len().max(other.parts.len())).map(|axis| {
            let pairs = self.along(axis).iter().zip(other.along(axis));
            pairs.map(|(own, other)| share * own + (1.0 - share) * other).collect()
        });
        Self::of_parts(parts.collect())
    }

    /// Refuses a density that does not fit a mesh, or that has a value which is not finite or not above 0.
    ///
    /// # Errors
    /// [`Failure::WrongLength`], [`Failure::NotPositive`] or [`Failure::NonFinite`].
    pub fn check<const D: usize>(&self, mesh: &Mesh<D>) -> Result<(), Failure> {
        if self.parts.len() != 1 && self.parts.len() != D {
            let (found, expected) = (self.parts.len(), D);
            return Err(Failure::WrongLength { what: "the densities of all axes", found, expected });
        }
        self.parts.iter().try_for_each(|part| {
            check_length(mesh.lattice(), "the density", part.len())?;
            check_positive(mesh, "the mesh density", part)
        })
    }
}

impl From<Vec<Vec<f64>>> for Density {
    /// The arrays of a file, which [`check`](Self::check) has yet to see.
    fn from(parts: Vec<Vec<f64>>) -> Self {
        Self::of_parts(parts)
    }
}

impl From<Density> for Vec<Vec<f64>> {
    fn from(density: Density) -> Self {
        density.parts
    }
}

impl From<Vec<f64>> for Density {
    /// One density for all axes.
    fn from(values: Vec<f64>) -> Self {
        Self::of_parts(vec![values])
    }
}

impl FromIterator<f64> for Density {
    /// One density for all axes.
    fn from_iter<I: IntoIterator<Item = f64>>(values: I) -> Self {
        Self::from(values.into_iter().collect::<Vec<f64>>())
    }
}
