//! Checks of what a step of a mesh generator is given, and of what it returns.

use super::{Mmpde, Moved, Relaxation, Steps};
use crate::error::Failure;
use crate::geometry::{Density, Lattice, Mesh, check_unfolded, mark_folded};

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

/// The most times that ways are halved.
const HALVINGS: usize = 16;

/// The mesh whose nodes go to other places of the unit box, some of them only part of the way
///
/// Cells with straight edges may fold where those of the unit box do not: where few of them follow a strong curve, as
/// around the nose of an aerofoil. The nodes of such cells go half as far, again and again, and no node goes more than
/// twice the share of the way that its neighbours go. The mesh from which they come has no folded cells; where nothing
/// helps it stays.
pub(super) fn held_within<const D: usize>(mesh: &Mesh<D>, places: &Mesh<D>) -> Result<Mesh<D>, Failure> {
    check_unfolded(places)?;
    let (from, lattice) = (mesh.parameters(), mesh.lattice());
    let mut shares = vec![1.0; from.x().len()];
    let mut made = mesh.placed(places.x().to_vec())?;
    for _ in 0..HALVINGS {
        let mut marks = vec![false; shares.len()];
        let any = mark_folded(&made, &mut marks) | mark_folded(made.parameters(), &mut marks);
        if !any {
            return Ok(made);
        }
        shares.iter_mut().zip(marks).filter(|(_, mark)| *mark).for_each(|(share, _)| *share *= 0.5);
        even_out(lattice, &mut shares);
        let ways = from.x().iter().zip(places.x()).zip(&shares);
        let way =
            |((a, b), share): ((&[f64; D], &[f64; D]), &f64)| std::array::from_fn(|d| a[d] + share * (b[d] - a[d]));
        made = mesh.placed(ways.map(way).collect())?;
    }
    Ok(mesh.clone())
}

/// Lowers shares to at most twice those of the neighbours along the lattice.
fn even_out<const D: usize>(lattice: &Lattice<D>, shares: &mut [f64]) {
    let (nodes, steps, wraps) = (lattice.nodes(), lattice.strides(), lattice.periodic());
    loop {
        let mut changed = false;
        for k in 0..shares.len() {
            let node = lattice.node(k);
            for d in 0..D {
                let above = match node[d] + 1 < nodes[d] {
                    true => k + steps[d],
                    false if wraps[d] => k - node[d] * steps[d],
                    false => continue,
                };
                let [a, b] = [shares[k], shares[above]];
                (shares[k], shares[above]) = (a.min(2.0 * b), b.min(2.0 * a));
                changed |= [a, b] != [shares[k], shares[above]];
            }
        }
        if !changed {
            return;
        }
    }
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
