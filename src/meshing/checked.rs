//! Checks of what a step of a mesh generator is given, and of what it returns.

use super::{Mmpde, Moved, Relaxation, Steps};
use crate::error::Failure;
use crate::geometry::{Density, Mesh, check_unfolded};

/// A folded mesh is blamed on noise where the standard error of the interface values exceeds this share of its shortest
/// edge.
const NOISE_THAT_FOLDS: f64 = 0.05;
/// Nodes may lie off the sides of the box by this share of its extent, which is round-off.
const ROUNDING: f64 = 1e-9;

/// Refuses meshes, densities and time steps with which no mesh equation can be stepped.
pub(super) fn check_given<const D: usize>(
    equation: &Mmpde,
    mesh: &Mesh<D>,
    rho: &Density,
    dt: f64,
) -> Result<(), Failure> {
    if !(dt.is_finite() && dt > 0.0) {
        return Err(Failure::out_of_range("the time step", dt, "must be a finite number above 0"));
    }
    equation.check().map_err(Failure::refusing)?;
    if let Relaxation::Steps(Steps { prediction, .. }) = equation.relaxation
        && prediction != 0.0
    {
        let rule = "a generator by itself keeps no velocity of the nodes; set it to 0, or step with a Mover";
        return Err(Failure::out_of_range("`relaxation.prediction`", prediction, rule));
    }
    rho.check(mesh)
}

/// Refuses a mesh whose bounded sides do not lie on the box around it: nodes on sides move along straight lines.
pub(super) fn check_box<const D: usize>(mesh: &Mesh<D>) -> Result<(), Failure> {
    let (lattice, ends, extent) = (mesh.lattice(), [mesh.lower(), mesh.upper()], mesh.extent());
    for k in lattice.sides() {
        for (axis, beyond) in lattice.beyond(k).into_iter().enumerate() {
            for end in (0..2).filter(|&end| beyond[end]) {
                let off = (mesh.x()[k][axis] - ends[end][axis]).abs();
                if off.is_nan() || off > ROUNDING * extent[axis] {
                    let (node, x) = mesh.told(k);
                    return Err(Failure::NotABox { off, axis, node, x });
                }
            }
        }
    }
    Ok(())
}

/// Refuses a folded mesh; the failure carries the noise that may have folded it.
pub(super) fn check_made<const D: usize>(moved: Moved<D>) -> Result<Moved<D>, Failure> {
    let noise = moved.interface.and_then(|interface| interface.noise).filter(|noise| *noise > NOISE_THAT_FOLDS);
    check_unfolded(&moved.mesh).map_err(|failure| match failure {
        Failure::Folded { cell, jacobian, x, .. } => Failure::Folded { cell, jacobian, x, noise },
        other => other,
    })?;
    Ok(moved)
}
