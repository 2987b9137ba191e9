//! How much a solution changes in a step.

use super::{CHANGE, OF_ROUNDING};
use crate::geometry::{Field, Lattice, Mesh};
use crate::meshing::{Movable, Relaxation};
use crate::numerics::larger;
use crate::physics::Motion;
use crate::simulation::journey::range;
use crate::simulation::{Simulation, State};

/// An unknown whose range is below this share of its size is the same everywhere but for what Newton's method leaves.
pub(crate) const ALIKE: f64 = 1e-8;

/// The change in a step of length `dt` if the mesh rested, and the solution that this would lead to; none where that
/// fails.
pub(super) fn at_rest<const D: usize>(
    simulation: &mut Simulation<D>,
    State { t, mesh, u, .. }: &State<D>,
    dt: f64,
) -> Option<(f64, Field)>
where
    Mesh<D>: Movable<D>,
{
    let motion = Motion { t: *t, dt, old: mesh, new: mesh };
    let (after, _) = simulation.physics.step(motion, u).ok()?;
    Some((change_at_nodes(mesh.lattice(), u, &after), after))
}

/// True where the solution changes by more in a step than automatic steps aim at, at the nodes of a mesh whose
/// relaxation is chosen automatically.
pub(crate) fn rushed<const D: usize>(simulation: &Simulation<D>, before: &State<D>, after: &State<D>) -> bool
where
    Mesh<D>: Movable<D>,
{
    let follows = simulation.mover.equation.relaxation == Relaxation::Auto && simulation.mover.generator.moves();
    let of = |measure: fn(&Field, usize) -> f64| measure(&before.u, 0).max(measure(&after.u, 0));
    let (range, size) = (of(range), of(largest));
    // what is the same everywhere needs no mesh
    follows
        && !simulation.physics.is_given()
        && range > ALIKE * size
        && share(change_at_nodes(after.mesh.lattice(), &before.u, &after.u), range) > CHANGE
}

/// The largest error of all unknowns, each as a share of its range.
pub(super) fn relative(errors: &[f64], ranges: &[f64]) -> f64 {
    let largest = ranges.iter().copied().fold(0.0, f64::max);
    let counted = errors.iter().zip(ranges).filter(|(_, range)| **range > OF_ROUNDING * largest);
    counted.fold(0.0, |m, (error, range)| larger(m, error / range))
}

/// The largest change of the first unknown at a node inside. On sides, where values are given, nothing has to be solved
/// for.
pub(super) fn change_at_nodes<const D: usize>(lattice: &Lattice<D>, before: &Field, after: &Field) -> f64 {
    let changes = before.component(0).zip(after.component(0)).map(|(before, after)| after - before);
    let inside = changes.enumerate().filter(|(k, _)| lattice.beyond(*k) == [[false; 2]; D]);
    inside.fold(0.0, |m, (_, change)| larger(m, change))
}

/// A change as a share of a range; 0 for constants.
pub(super) fn share(change: f64, range: f64) -> f64 {
    if range > 0.0 { change / range } else { 0.0 }
}

/// What the changes of an unknown are measured by: its range, or its size where it is the same everywhere.
pub(super) fn scale(range: f64, size: f64) -> f64 {
    if range > ALIKE * size { range } else { size }
}

/// The largest size of an unknown.
pub(super) fn largest(u: &Field, c: usize) -> f64 {
    u.component(c).fold(0.0, larger)
}
