use super::prediction::{Predicted, blend};
use super::{NOISE_WORTH_A_WARNING, Record, Simulation, State, timed};
use crate::density::{Monitor, smooth};
use crate::error::{Error, Failure, Result};
use crate::geometry::{Field, Mesh, check_unfolded, interpolate};
use crate::meshing::{Interface, MeshGenerator, Mmpde};
use crate::physics::{Motion, Physics};
use crate::work::Work;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How mesh and physics alternate within one time step
///
/// `mesh_steps` = k > 1 is M^kP: the mesh goes to the new time in k sub-steps, ρ carried onto each sub-mesh by
/// piecewise linear interpolation, so that it follows ρ(x) rather than ρ(ξ). `iterations` = l > 1 is (MP)^l: mesh and
/// physics are computed l times from the same old state, each time with ρ from the newest solution.
///
/// # Source
/// Section 5 of Bihlo, Haynes and Walsh (2015).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Coupling {
    /// k ≥ 1.
    pub mesh_steps: usize,
    /// l ≥ 1.
    pub iterations: usize,
}

impl Default for Coupling {
    fn default() -> Self {
        Self { mesh_steps: 1, iterations: 1 }
    }
}

impl Coupling {
    /// Refuses settings out of range.
    ///
    /// # Errors
    /// [`Error::Invalid`] unless both are between 1 and 1000.
    pub fn check(&self) -> Result<()> {
        for (key, value) in [("mesh_steps", self.mesh_steps), ("iterations", self.iterations)] {
            if !(1..=1000).contains(&value) {
                return Err(Error::invalid(key, value, "must be between 1 and 1000"));
            }
        }
        Ok(())
    }
}

/// One step, and what it cost.
pub(super) struct Advanced {
    pub state: State,
    pub work: Work,
    pub interface: Option<Interface>,
}

/// One step to time `t`: mesh, then physics, as often as the coupling says. `scale` is the step that τ is measured in.
pub(super) fn advance(
    simulation: &mut Simulation,
    state: &State,
    t: f64,
    dt: f64,
    scale: f64,
    record: &mut Record,
) -> Result<Advanced, Failure> {
    let Simulation { physics, monitor, generator, equation, coupling, safety, .. } = simulation;
    let Record { seconds, safety: rescues, .. } = record;
    let mut work = Work::default();
    let mut interface: Option<Interface> = None;
    let mut rho = state.rho.clone();
    // where steps are short against τ the velocity learns no faster in time
    let gain = equation.relaxation.prediction() * dt / scale;
    let equation = Mmpde { relaxation: equation.relaxation.at(scale), ..*equation };
    let predicted = timed(&mut seconds.mesh, || Predicted::after(state, gain, dt))?;
    let mut latest = None;
    for _ in 0..coupling.iterations {
        let mut attempts = safety.attempts().peekable();
        let moved = loop {
            let [parts, passes] = attempts.next().expect("there is a first attempt");
            let substeps = coupling.mesh_steps * parts;
            let moved = timed(&mut seconds.mesh, || {
                let mut smoother = rho.clone();
                smooth(predicted.mesh.lattice(), &mut smoother, passes);
                moved(generator.as_mut(), &equation, &predicted.mesh, &smoother, dt, substeps)
            });
            match moved {
                Err(failure) if failure.may_pass() && attempts.peek().is_some() => continue,
                moved => {
                    rescues.substeps += usize::from(moved.is_ok() && parts > 1);
                    rescues.smoothed += usize::from(moved.is_ok() && passes > 0);
                    break moved?;
                }
            }
        };
        work += moved.work;
        interface = moved.interface;
        seconds.mesh -= moved.between;
        seconds.interface += moved.between;
        let mesh = moved.mesh;
        let motion = Motion { t: state.t, dt, old: &state.mesh, new: &mesh };
        let (u, cost) = timed(&mut seconds.pde, || physics.step(motion, &state.u))?;
        work += cost;
        rho = timed(&mut seconds.monitor, || density(physics.as_ref(), monitor.as_ref(), t, &mesh, &u))?;
        if gain > 0.0 {
            blend(&state.rho, &mut rho);
        }
        latest = Some((mesh, u));
    }
    let (mesh, u) = latest.expect("a coupling has at least one iteration");
    let velocity = predicted.corrected(&mesh, gain, dt);
    Ok(Advanced { state: State { t, step: state.step + 1, mesh, u, rho, velocity }, work, interface })
}

/// Where mesh sub-steps lead.
struct Moved {
    mesh: Mesh<2>,
    work: Work,
    interface: Option<Interface>,
    /// Seconds on interfaces.
    between: f64,
}

/// A mesh step in so many sub-steps, ρ carried along onto each sub-mesh.
fn moved(
    generator: &mut dyn MeshGenerator,
    equation: &Mmpde,
    from: &Mesh<2>,
    rho: &[f64],
    dt: f64,
    substeps: usize,
) -> Result<Moved, Failure> {
    let mut all = Moved { mesh: from.clone(), work: Work::default(), interface: None, between: 0.0 };
    for sub in 0..substeps {
        let carried = if sub == 0 { None } else { Some(interpolate(from, rho, &all.mesh)) };
        let rho = carried.as_deref().unwrap_or(rho);
        let moved = generator.step(equation, &all.mesh, rho, dt / substeps as f64)?;
        let noise = moved.interface.and_then(|i| i.noise).filter(|noise| *noise > NOISE_WORTH_A_WARNING);
        check_unfolded(&moved.mesh).map_err(|failure| match failure {
            Failure::Folded { cell, jacobian, x, .. } => Failure::Folded { cell, jacobian, x, noise },
            other => other,
        })?;
        all.mesh = moved.mesh;
        all.work += moved.work;
        all.between += moved.interface.map_or(0.0, |i| i.seconds);
        all.interface = moved.interface;
    }
    Ok(all)
}

/// One step to time `t`, in halves where it fails, and these in halves, so many times.
pub(super) fn advance_in_halves(
    simulation: &mut Simulation,
    state: &State,
    [t, dt]: [f64; 2],
    scale: f64,
    halvings: u32,
    record: &mut Record,
) -> Result<Advanced, Failure> {
    match advance(simulation, state, t, dt, scale, record) {
        Err(failure) if halvings > 0 && failure.may_pass() => {
            record.work.rejected_steps += 1;
            record.safety.halved += 1;
            let half = 0.5 * dt;
            let first = advance_in_halves(simulation, state, [state.t + half, half], scale, halvings - 1, record)?;
            let mut both = advance_in_halves(simulation, &first.state, [t, half], scale, halvings - 1, record)?;
            both.state.step = state.step + 1;
            both.work += first.work;
            Ok(both)
        }
        done => done,
    }
}

/// ρ from the solution: what the monitor makes of what it follows, and of the gradient of the first unknown where that
/// is known exactly.
pub(super) fn density(
    physics: &dyn Physics,
    monitor: &dyn Monitor,
    t: f64,
    mesh: &Mesh<2>,
    u: &Field,
) -> Result<Vec<f64>, Failure> {
    let values = monitor.followed(t, mesh, u)?;
    let gradient = physics.gradient(t, mesh);
    monitor.density(mesh, &values, gradient.as_deref())
}
