//! Checks of what a step of a mesh generator is given, and of what it returns.

use super::{Mmpde, Moved, Relaxation, Steps};
use crate::error::Failure;
use crate::geometry::{Density, Mesh, check_unfolded, mark_folded};

/// A message blames a fold on noise where the standard error of the interface values exceeds this share of the shortest
/// edge of the mesh.
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
                    let at = mesh.node_place(k);
                    return Err(Failure::NotABox { off, axis, at });
                }
            }
        }
    }
    Ok(())
}

/// Largest number of passes that even out the nodes around folded cells.
const PASSES: usize = 60;
/// Largest number of halvings of the distances that nodes move: 2⁻¹⁶ of a step makes no progress.
const HALVINGS: usize = 16;

/// The mesh whose nodes lie at other places of the unit box, or next to them
///
/// Cells with straight edges may fold where those of the unit box do not: where few of them follow a strong curve, and
/// lie aslant. Around such cells places are evened out, each half way to the mean of its neighbours, pass after pass,
/// until no cell is folded: equal cells are none. If that takes too long, nodes go only part of the way from the mesh
/// from which they come, which has no folded cells; where nothing helps it stays.
pub(super) fn held_within<const D: usize>(mesh: &Mesh<D>, places: &Mesh<D>) -> Result<Mesh<D>, Failure> {
    check_unfolded(places)?;
    let mut made = mesh.placed(places.x().to_vec())?;
    for _ in 0..PASSES {
        let mut marks = vec![false; places.x().len()];
        if !mark_folded(&made, &mut marks) {
            return Ok(made);
        }
        let evened = evened(made.parameters(), &marks);
        let next = mesh.placed(evened)?;
        if check_unfolded(next.parameters()).is_err() {
            break;
        }
        made = next;
    }
    let (from, mut share) = (mesh.parameters(), 1.0);
    for _ in 0..HALVINGS {
        share *= 0.5;
        let ways = from.x().iter().zip(places.x());
        let part = ways.map(|(a, b)| std::array::from_fn(|d| a[d] + share * (b[d] - a[d])));
        let held = mesh.placed(part.collect())?;
        if check_unfolded(&held).is_ok() {
            return Ok(held);
        }
    }
    Ok(mesh.clone())
}

/// Places in the unit box, the marked ones and those next to them half way to the mean of their neighbours; along sides
/// those on the side.
fn evened<const D: usize>(places: &Mesh<D>, marks: &[bool]) -> Vec<[f64; D]> {
    let (lattice, x, jump) = (places.lattice(), places.x(), places.jump());
    let (nodes, steps, wraps) = (lattice.nodes(), lattice.strides(), lattice.periodic());
    // the neighbours of a node along an axis, with the turns that lead there; none from a side
    let beside = |k: usize, d: usize| -> Option<[(usize, f64); 2]> {
        let (i, n) = (lattice.node(k)[d], nodes[d]);
        let around = (n - 1) * steps[d];
        match i {
            0 if wraps[d] => Some([(k + around, -1.0), (k + steps[d], 0.0)]),
            i if i + 1 == n && wraps[d] => Some([(k - steps[d], 0.0), (k - around, 1.0)]),
            i if i == 0 || i + 1 == n => None,
            _ => Some([(k - steps[d], 0.0), (k + steps[d], 0.0)]),
        }
    };
    let sides = |k: usize| (0..D).filter(move |&d| beside(k, d).is_none());
    let near = |k: usize| marks[k] || (0..D).filter_map(|d| beside(k, d)).flatten().any(|(n, _)| marks[n]);
    let even = |k: usize| {
        let (mut sum, mut count) = ([0.0; D], 0.0);
        for (d, jump) in jump.iter().enumerate() {
            for (n, turns) in beside(k, d).into_iter().flatten() {
                (0..D).for_each(|c| sum[c] += x[n][c] + turns * jump[c]);
                count += 1.0;
            }
        }
        let mut place: [f64; D] =
            std::array::from_fn(|c| if count > 0.0 { 0.5 * (x[k][c] + sum[c] / count) } else { x[k][c] });
        // along a side, and not off it
        sides(k).for_each(|d| place[d] = x[k][d]);
        place
    };
    (0..x.len()).map(|k| if near(k) { even(k) } else { x[k] }).collect()
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
