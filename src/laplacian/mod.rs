//! The pointwise optimised Laplacian on structured quadrilateral meshes.
//!
//! ```text
//! Δu(x₀) ≈ Σ_j a_j (u(x_j) − u(x₀))        or, for `compact25`,        Σ_j a_j u(x_j) = Σ_j b_j Δu(x_j)
//! ```
//!
//! The weights a of a node follow from the positions of its neighbours alone, without elements or assembly.
//! [`stencils`] computes those of a whole mesh, for any [`Laplacian`].
//!
//! # Source
//! Castillo and Izsák, *Efficient discretization of the Laplacian: application to moving boundary problems* (2024).

mod compact25;
mod diffusion;
mod nine;
mod poisson;
mod stencils;

pub use diffusion::{diffusion, diffusion_by, edge_places};
pub use poisson::{Entry, Poisson, outward};
pub use stencils::{NearDegenerate, Stencils};

use crate::error::{Error, Failure, Result};
use crate::geometry::{Mesh, Patch, check_unfolded, padded};
use crate::parallel;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How the weights of a node are determined from the positions of its neighbours.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Laplacian {
    /// Exact for all quadratics. Among such weights it takes those with the smallest Σ(|d_j|³ a_j)², d_j being the
    /// distances. Second order on meshes from smooth mappings and on perturbed ones.
    #[default]
    Optimised,
    /// Exact for all quadratics. The remaining freedom fits the harmonic polynomials of degrees 3 to 5 by least
    /// squares, in the unit of the coordinates. More accurate on sheared meshes, unstable on moving ones.
    Harmonic,
    /// The published method: least squares on eleven weighted polynomials, exact for constants only. It does not
    /// converge on perturbed meshes.
    Published {
        /// The polynomials as printed, or with the misprints corrected.
        polynomials: Polynomials,
        /// The unit of length in which the polynomials are evaluated.
        scaling: Scaling,
    },
    /// 25 points, with weights on Δu too, exact up to degree 5: fourth order where the solution is smooth.
    Compact25,
    /// The conservative curvilinear form with metrics by central differences, for comparison.
    Mapped,
}

/// The polynomials that [`Laplacian::Published`] fits.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Polynomials {
    /// As the source prints them; three of them are not harmonic.
    #[default]
    Printed,
    /// Harmonic ones, with x³ − 3xy², y³ − 3x²y and x⁴ − 6x²y² + y⁴ in place of those three.
    Harmonic,
}

/// The unit of length of the polynomials of [`Laplacian::Published`].
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Scaling {
    /// The unit of the coordinates.
    #[default]
    None,
    /// The spacing of the lattice along ξ.
    Global,
    /// For each node the largest distance to a neighbour along an axis.
    Local,
}

impl Laplacian {
    /// Name and description of every kind.
    pub const KINDS: &'static [(&'static str, &'static str)] = &[
        ("optimised", "exact for quadratics, smallest distance-weighted weights: the default"),
        ("harmonic", "exact for quadratics, the rest fitted to harmonic polynomials; not for moving meshes"),
        ("compact25", "25 points with weights on the source: fourth order"),
        ("published", "the slides' least squares on weighted polynomials; does not converge on every mesh"),
        ("mapped", "the conservative curvilinear form, for comparison"),
    ];

    /// The name of the kind in a study.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Optimised => "optimised",
            Self::Harmonic => "harmonic",
            Self::Published { .. } => "published",
            Self::Compact25 => "compact25",
            Self::Mapped => "mapped",
        }
    }
}

/// Condition number above which a node is reported as [near degenerate](Stencils::near_degenerate): rounding then
/// breaks the exactness for quadratics by more than 1e-11.
pub const NEAR_DEGENERATE: f64 = 3e3;

/// The weights of all nodes of a mesh that are not on a bounded side
///
/// ```text
/// (A u)_i = Σ_j a_ij u_j ≈ Δu(x_i)
/// ```
///
/// Nodes are computed independently on all threads, with the same bits for any number of them.
///
/// # Errors
/// [`Failure::Folded`] or [`Failure::NonFinite`] for a mesh with folded cells or nodes that are not finite;
/// [`Failure::DegenerateStencil`] where the neighbours of a node determine no Laplacian; [`Error::Invalid`] for
/// `compact25` on a periodic axis or with fewer than 4 cells. Nodes that come near to that are listed by
/// [`Stencils::near_degenerate`].
///
/// # Example
/// ```
/// use driftmesh::geometry::{Lattice, Mesh};
/// use driftmesh::laplacian::{Laplacian, stencils};
/// // a parallelogram: x = s + r/2, y = r
/// let mesh = Mesh::uniform(Lattice::bounded([8, 8])?, [0.0, 0.0], [1.5, 1.0])?;
/// let mesh = mesh.moved(mesh.x().iter().map(|&[x, y]| [x / 1.5 + 0.5 * y, y]).collect())?;
/// let a = stencils(&mesh, Laplacian::Optimised)?;
/// let u: Vec<f64> = mesh.x().iter().map(|[x, y]| x * x + 3.0 * x * y + y * y).collect();
/// // Δu = 4, exactly
/// assert!(a.apply(&u)?.iter().all(|v| (v - 4.0).abs() < 1e-10));
/// assert_eq!(a.exact_degree(&mesh), Some(3)); // it is a mesh of equal cells
/// # Ok::<(), driftmesh::Error>(())
/// ```
///
/// # Source
/// Castillo and Izsák (2024); the constrained form is this project's.
pub fn stencils(mesh: &Mesh<2>, laplacian: Laplacian) -> Result<Stencils> {
    check_unfolded(mesh)?;
    unchecked(mesh, laplacian)
}

/// [`stencils`] of a mesh that is known not to be folded, such as one that was checked before.
///
/// # Errors
/// As [`stencils`], without [`Failure::Folded`].
pub fn unchecked(mesh: &Mesh<2>, laplacian: Laplacian) -> Result<Stencils> {
    let lattice = mesh.lattice();
    let patch = Patch::whole(lattice);
    if laplacian == Laplacian::Compact25 {
        return compact25::stencils(mesh, patch);
    }
    // padded like the patch, with positions of nodes on the sides or of images
    let everything = padded(lattice, mesh.x(), mesh.jump());
    let width = lattice.nodes()[1] + 2;
    let skip = patch.wraps.map(|wraps| usize::from(!wraps));
    let row = |i: usize| {
        let first = (i + skip[0]) * width + skip[1];
        &everything[first..first + patch.size[1] + 2]
    };
    let n = patch.size[1];
    let mut rows = vec![[0.0; 9]; patch.len()];
    let mut conditions = vec![0.0; patch.len()];
    parallel::for_each_row_pair(&mut rows, n, &mut conditions, n, |i, rows, conditions| {
        pulp::Arch::new().dispatch(nine::Batch {
            laplacian: &laplacian,
            spacing: lattice.spacing()[0],
            x: [row(i), row(i + 1), row(i + 2)],
            rows,
            conditions,
        });
    });
    if let Some(k) = rows.iter().position(|row| !row.iter().all(|a| a.is_finite())) {
        return Err(degenerate(mesh, &patch, k, f64::INFINITY).into());
    }
    Ok(Stencils::nine(mesh, laplacian, patch, rows, &conditions))
}

/// The node of an unknown.
fn node(patch: &Patch<2>, k: usize) -> [usize; 2] {
    [patch.origin[0] + k / patch.size[1], patch.origin[1] + k % patch.size[1]]
}

fn degenerate(mesh: &Mesh<2>, patch: &Patch<2>, k: usize, condition: f64) -> Failure {
    let at = mesh.node_place(mesh.lattice().index(node(patch, k)));
    Failure::DegenerateStencil { at, condition }
}

impl Laplacian {
    /// The kind of this name; `polynomials` and `scaling` belong to `published` and are refused with another kind.
    ///
    /// # Errors
    /// [`Error::Invalid`] where there is no such kind, or where it has no such setting.
    pub fn named(name: &str, polynomials: Option<Polynomials>, scaling: Option<Scaling>) -> Result<Self> {
        let found = match name {
            "optimised" => Self::Optimised,
            "harmonic" => Self::Harmonic,
            "compact25" => Self::Compact25,
            "mapped" => Self::Mapped,
            "published" => {
                return Ok(Self::Published {
                    polynomials: polynomials.unwrap_or_default(),
                    scaling: scaling.unwrap_or_default(),
                });
            }
            _ => {
                let names: Vec<&str> = Self::KINDS.iter().map(|(name, _)| *name).collect();
                return Err(Error::invalid(
                    "kind",
                    format!("\"{name}\""),
                    format!("must be one of {}", names.join(", ")),
                ));
            }
        };
        let key = if polynomials.is_some() { "polynomials" } else { "scaling" };
        match (polynomials, scaling) {
            (None, None) => Ok(found),
            _ => Err(Error::invalid(key, "given", "only kind = \"published\" has it; leave it out")),
        }
    }
}
