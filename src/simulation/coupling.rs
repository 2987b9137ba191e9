use super::journey::{self, Way};
use super::{Record, Schedule, Simulation, State, growth, shocks, timed};
use crate::density::Monitor;
use crate::error::{Error, Failure, Result};
use crate::geometry::{Cells, Density, Field, Mesh, check_unfolded};
use crate::meshing::{Interface, Moved, Relaxation};
use crate::mover::{Mover, Predicted, Retries, Stride};
use crate::numerics::larger;
use crate::physics::{Motion, Physics};
use crate::work::Work;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How mesh and physics alternate within one time step
///
/// With M for a step of the mesh and P for one of the physics, `mesh_steps` = k > 1 is M^kP: the mesh goes to the new
/// time in k sub-steps, ρ carried onto each sub-mesh by piecewise linear interpolation, so that it follows ρ(x) rather
/// than ρ(ξ). `iterations` = l > 1 is (MP)^l: mesh and physics are computed l times from the same old state, each time
/// with ρ from the newest solution.
///
/// With a `tolerance` ε > 0 both numbers are upper limits. The number of sub-steps is doubled, 1, 2, 4 …, until the
/// mesh changes by at most ε from one doubling to the next: M^vP, with v chosen anew in each step. Mesh and physics are
/// computed again until the mesh changes by at most ε: (MP)^∞, which solves both together. ε is a share of the longest
/// side of the box.
///
/// # Source
/// Section 5 of Bihlo, Haynes and Walsh (2015).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Coupling {
    /// Number of sub-steps of the mesh in a time step; with a tolerance the largest number.
    pub mesh_steps: usize,
    /// How often mesh and solution are computed in a time step; with a tolerance the largest number.
    pub iterations: usize,
    /// Sub-steps are doubled, and mesh and solution computed again, until the mesh changes by at most this share of the
    /// longest side of the box; 0 for exactly `mesh_steps` and `iterations`.
    pub tolerance: f64,
}

impl Default for Coupling {
    fn default() -> Self {
        Self { mesh_steps: 1, iterations: 1, tolerance: 0.0 }
    }
}

impl Coupling {
    /// Refuses settings out of range.
    ///
    /// # Errors
    /// [`Error::Invalid`] unless both counts are between 1 and 1000, and the tolerance between 0 and 1.
    pub fn check(&self) -> Result<()> {
        for (key, value) in [("mesh_steps", self.mesh_steps), ("iterations", self.iterations)] {
            if !(1..=1000).contains(&value) {
                return Err(Error::invalid(key, value, "must be between 1 and 1000"));
            }
        }
        match self.tolerance {
            0.0..=1.0 => Ok(()),
            other => Err(Error::invalid("tolerance", other, "must be between 0, for none, and 1")),
        }
    }

    /// Whether sub-steps of the mesh are doubled until the mesh does not change.
    fn doubles(&self) -> bool {
        self.tolerance > 0.0 && self.mesh_steps > 1
    }

    /// Moves the mesh over a step, in as many sub-steps as the coupling says; adds tries and seconds to `record`.
    fn move_mesh<const D: usize>(
        &self,
        mover: &mut Mover<D>,
        predicted: &Predicted<D>,
        rho: &Density,
        stride: Stride,
        record: &mut Record,
    ) -> Result<Moved<D>, Failure>
    where
        Mesh<D>: Cells<D>,
    {
        let seconds = &mut record.seconds.parts;
        let (mut retries, mut work, mut parts) = (Retries::default(), Work::default(), stride.parts);
        let mut moved = timed(&mut seconds.mesh, || mover.relax(predicted, rho, stride, &mut retries));
        while let (true, Ok(coarse)) = (self.doubles() && 2 * parts <= self.mesh_steps, &moved) {
            parts *= 2;
            let finer = Stride { parts, ..stride };
            let again = timed(&mut seconds.mesh, || mover.relax(predicted, rho, finer, &mut retries));
            let done = again.as_ref().is_ok_and(|again| self.same(&again.mesh, &coarse.mesh));
            work += coarse.work;
            moved = again;
            if done {
                break;
            }
        }
        record.safety.substeps += retries.substeps;
        record.safety.smoothed += retries.smoothed;
        record.work.rejected_steps += retries.substeps + retries.smoothed;
        let moved = moved?;
        let spent = moved.interface.map_or(0.0, |i| i.seconds);
        seconds.mesh -= spent;
        seconds.interface += spent;
        work += moved.work;
        Ok(Moved { work, ..moved })
    }

    /// Whether two meshes are the same within the tolerance of the coupling.
    fn same<const D: usize>(&self, a: &Mesh<D>, b: &Mesh<D>) -> bool {
        let longest = a.extent().into_iter().fold(0.0, f64::max);
        let off = |(a, b): (&[f64; D], &[f64; D])| (0..D).fold(0.0, |m, d| larger(m, a[d] - b[d]));
        self.tolerance > 0.0 && a.x().iter().zip(b.x()).map(off).fold(0.0, larger) <= self.tolerance * longest
    }
}

/// A finished step and its cost.
pub(super) struct Advanced<const D: usize> {
    pub state: State<D>,
    pub work: Work,
    pub interface: Option<Interface>,
    /// Estimated error of the step in each unknown, where the estimate was asked for.
    pub errors: Option<Vec<f64>>,
}

/// The time step to be done from a state.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stretch {
    /// Time at the end of the step.
    pub t: f64,
    /// Length of the step.
    pub dt: f64,
    /// The time step of which τ is a multiple.
    pub scale: f64,
    /// Whether the error of the step is to be estimated.
    pub estimated: bool,
}

/// One step: mesh, then physics, as often as the coupling says; `record` adds up tries of the mesh and seconds.
///
/// # Errors
/// The first failure of the mesh, after all that safety allows was tried, or a failure of the physics.
pub(super) fn attempt<const D: usize>(
    simulation: &mut Simulation<D>,
    state: &State<D>,
    stretch: Stretch,
    record: &mut Record,
) -> Result<Advanced<D>, Failure>
where
    Mesh<D>: Cells<D>,
{
    let Stretch { t, dt, scale, estimated } = stretch;
    let Simulation { physics, monitor, mover, coupling, safety, schedule } = simulation;
    mover.care = safety.care();
    let parts = if coupling.doubles() { 1 } else { coupling.mesh_steps };
    let stride = Stride { dt, scale, parts, share: 1.0 };
    let mut work = Work::default();
    let mut interface: Option<Interface> = None;
    let mut rho = state.rho.clone();
    let followed = state.u.values().to_vec();
    let predicted =
        timed(&mut record.seconds.parts.mesh, || mover.predict(&state.mesh, &state.gait, &followed, stride))?;
    // a mesh whose way nobody has set goes no faster than is good for the solution
    let guarded = mover.equation.relaxation == Relaxation::Auto && !physics.is_given();
    type Round<const D: usize> = (Mesh<D>, Field, Option<Vec<f64>>, Density, Way);
    let mut latest: Option<Round<D>> = None;
    for _ in 0..coupling.iterations {
        let mixed = state.gait.mixed(&rho, mover.equation.relaxation);
        let moved = coupling.move_mesh(mover, &predicted, &mixed, stride, record)?;
        work += moved.work;
        interface = moved.interface;
        let (mesh, way) = match guarded {
            true => held_back(state, &predicted, moved.mesh, dt, schedule),
            false => (moved.mesh, Way::WHOLE),
        };
        let motion = Motion { t: state.t, dt, old: &state.mesh, new: &mesh };
        let seconds = &mut record.seconds.parts;
        let (u, cost, errors) = timed(&mut seconds.pde, || stepped(physics.as_mut(), motion, &state.u, estimated))?;
        work += cost;
        rho = timed(&mut seconds.monitor, || density(physics.as_ref(), monitor.as_ref(), t, &mesh, &u))?;
        let settled = latest.as_ref().is_some_and(|(last, ..)| coupling.same(last, &mesh));
        latest = Some((mesh, u, errors, mixed, way));
        if settled {
            break;
        }
    }
    let (mesh, u, errors, mixed, way) = latest.expect("a coupling has at least one iteration");
    let gait = mover.learn(&state.gait, &predicted, &mesh, (mixed, followed), Stride { share: way.share, ..stride });
    let own_change = if guarded { journey::own_change(state, &mesh, &u, way.harm, dt) } else { 0.0 };
    let state = State { t, step: state.step + 1, mesh, u, rho, gait, own_change };
    Ok(Advanced { state, work, interface, errors })
}

/// The mesh moved only as far as [`journey::allowed`] says, and that way.
fn held_back<const D: usize>(
    state: &State<D>,
    predicted: &Predicted<D>,
    mesh: Mesh<D>,
    dt: f64,
    schedule: &Schedule,
) -> (Mesh<D>, Way)
where
    Mesh<D>: Cells<D>,
{
    let from = &predicted.mesh;
    let way = journey::allowed(state, from, &mesh, dt, schedule.span());
    if way.share == 1.0 {
        return (mesh, way);
    }
    match from.between(&mesh, way.share) {
        Ok(held) if check_unfolded(&held).is_ok() => (held, way),
        _ => (from.clone(), Way::NONE),
    }
}

/// The physics over a step; where its error is asked for in two halves, on the same straight paths of the nodes, beside
/// the whole
///
/// All steppers are trapezoidal: their error over a step is of the third order, that of two halves a quarter of it, and
/// so a third of the difference. Formulas of several steps would be cheaper, but the nodes turn from step to step, and
/// the bends would count as errors.
fn stepped<const D: usize>(
    physics: &mut dyn Physics<D>,
    motion: Motion<'_, D>,
    u: &Field,
    estimated: bool,
) -> Result<(Field, Work, Option<Vec<f64>>), Failure> {
    let (whole, mut work) = physics.step(motion, u)?;
    if !estimated {
        return Ok((whole, work, None));
    }
    let Motion { t, dt, old, new } = motion;
    let half = 0.5 * dt;
    let middle = old.between(new, 0.5)?;
    check_unfolded(&middle)?;
    let (first, cost) = physics.step(Motion { t, dt: half, old, new: &middle }, u)?;
    work += cost;
    let (second, cost) = physics.step(Motion { t: t + half, dt: half, old: &middle, new }, &first)?;
    work += cost;
    let error = |c: usize| whole.component(c).zip(second.component(c)).fold(0.0, |m, (a, b)| larger(m, (a - b) / 3.0));
    let errors = (0..second.components()).map(error).collect();
    Ok((second, work, Some(errors)))
}

/// ρ from the solution: what the monitor makes of what it follows, and of the gradient of the first unknown where that
/// is known exactly, no more than [a shock](shocks::blunted) takes, and no less than [what grows](growth::narrowed)
/// needs.
pub(super) fn density<const D: usize>(
    physics: &dyn Physics<D>,
    monitor: &dyn Monitor<D>,
    t: f64,
    mesh: &Mesh<D>,
    u: &Field,
) -> Result<Density, Failure>
where
    Mesh<D>: Cells<D>,
{
    let gradient = physics.gradient(t, mesh);
    let mut rho = monitor.density_of(t, mesh, u, gradient.as_deref())?;
    if physics.forms_shocks() {
        rho = shocks::blunted(&rho);
    }
    let widest = physics.widest_cells(t, mesh, u);
    Ok(if widest.is_empty() { rho } else { growth::narrowed(mesh, &rho, &widest) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Lattice;
    use crate::physics::{Burgers, Convection, FormulaPde, ShallowWater, WaterForm};

    fn bent(periodic: bool, [s, c]: [f64; 2]) -> Mesh<2> {
        use std::f64::consts::PI;
        let lattice = Lattice::new([16, 16], [periodic; 2]).unwrap();
        let mesh = Mesh::uniform(lattice, [0.0; 2], [1.0; 2]).unwrap();
        let x = mesh.x().iter().map(|x| {
            let [a, b] = x.map(|x| (2.0 * PI * x).sin());
            [x[0] + s * a * b, x[1] + c * a * b]
        });
        mesh.moved(x.collect()).unwrap()
    }

    /// For every stepper, on nodes that move, the estimate is the error against a hundred steps along the same paths,
    /// and of the third order. Limited fluxes have kinks where they change from one bound to another, and errors there
    /// that no formula for smooth ones knows: a third of these is seen.
    #[test]
    fn the_estimate_is_the_error() {
        let formula = |scheme: &str| {
            let text = r#"{"unknowns": ["u", "v"], "flux": {"u": ["u^2", "u"]}, SCHEME
                "diffusivity": {"u": "0.02", "v": "0.01"}, "source": {"v": "u*(1-v)"},
                "initial": {"u": "2+sin(2*pi*x)*cos(2*pi*y)", "v": "0.2"}}"#;
            let formula: FormulaPde = serde_json::from_str(&text.replace("SCHEME", scheme)).unwrap();
            formula.into_physics().unwrap()
        };
        let water = |form| {
            let shape = ShallowWater { pile: 1.0, radius: 0.2, width: 0.15, ..ShallowWater::default() };
            Box::new(ShallowWater { form, ..shape }) as Box<dyn Physics>
        };
        let burgers = |convection| Box::new(Burgers::new(0.05, convection).unwrap()) as Box<dyn Physics>;
        let all: [(&str, bool, f64, Box<dyn Physics>); 7] = [
            ("conservative", false, 0.01, burgers(Convection::Conservative)),
            ("advective", false, 0.02, burgers(Convection::Advective)),
            ("flux", false, 0.02, burgers(Convection::Flux)),
            ("formula", true, 0.01, formula(r#""scheme": "central","#)),
            ("formula, limited", true, 0.005, formula("")),
            ("water by flux", true, 0.004, water(WaterForm::Flux)),
            ("water by advection", true, 0.004, water(WaterForm::Advective)),
        ];
        for (name, periodic, dt, mut physics) in all {
            let old = bent(periodic, [0.02, -0.03]);
            let u = physics.initial(0.25, &old);
            let mut estimates = Vec::new();
            let [least, steepest] = if name.ends_with("limited") { [0.25, 3.5] } else { [0.7, 3.3] };
            for dt in [dt, 0.5 * dt] {
                // the same velocity for both
                let to = bent(periodic, [0.02 + dt, -0.03 + dt]);
                let between = |share: f64| {
                    let x = old.x().iter().zip(to.x()).map(|(a, b)| [0, 1].map(|d| a[d] + share * (b[d] - a[d])));
                    old.moved(x.collect()).unwrap()
                };
                let (found, _, errors) =
                    stepped(physics.as_mut(), Motion { t: 0.25, dt, old: &old, new: &to }, &u, true).unwrap();
                let mut fine = u.clone();
                for n in 0..100 {
                    let [a, b] = [between(n as f64 / 100.0), between((n + 1) as f64 / 100.0)];
                    let motion = Motion { t: 0.25 + dt * n as f64 / 100.0, dt: dt / 100.0, old: &a, new: &b };
                    fine = physics.step(motion, &fine).unwrap().0;
                }
                let error = found.component(0).zip(fine.component(0)).fold(0.0, |m, (a, b)| larger(m, a - b));
                let estimate = errors.unwrap()[0];
                assert!((least..1.4).contains(&(estimate / error)), "{name}: {estimate:e} where it is {error:e}");
                estimates.push(estimate);
            }
            let order = (estimates[0] / estimates[1]).log2();
            assert!((2.5..steepest).contains(&order), "{name}: order {order:.2}");
        }
    }
}
