use super::prediction::{Predicted, blend};
use super::{NOISE_WORTH_A_WARNING, Seconds, Simulation, State, timed};
use crate::density::Monitor;
use crate::error::{Error, Failure, Result};
use crate::geometry::{Field, Mesh, check_unfolded, interpolate};
use crate::meshing::{Interface, Mmpde};
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
    seconds: &mut Seconds,
) -> Result<Advanced, Failure> {
    let Simulation { physics, monitor, generator, equation, coupling, .. } = simulation;
    let mut work = Work::default();
    let mut interface: Option<Interface> = None;
    let mut rho = state.rho.clone();
    // where steps are short against τ the velocity learns no faster in time
    let gain = equation.relaxation.prediction() * dt / scale;
    let equation = Mmpde { relaxation: equation.relaxation.at(scale), ..*equation };
    let predicted = timed(&mut seconds.mesh, || Predicted::after(state, gain, dt))?;
    let mut latest = None;
    for _ in 0..coupling.iterations {
        let mut spent = 0.0;
        let mesh = timed(&mut seconds.mesh, || {
            let mut mesh = predicted.mesh.clone();
            for sub in 0..coupling.mesh_steps {
                let carried = if sub == 0 { None } else { Some(interpolate(&predicted.mesh, &rho, &mesh)) };
                let rho = carried.as_ref().unwrap_or(&rho);
                let moved = generator.step(&equation, &mesh, rho, dt / coupling.mesh_steps as f64)?;
                let noise = moved.interface.and_then(|i| i.noise).filter(|noise| *noise > NOISE_WORTH_A_WARNING);
                check_unfolded(&moved.mesh).map_err(|failure| match failure {
                    Failure::Folded { cell, jacobian, x, .. } => Failure::Folded { cell, jacobian, x, noise },
                    other => other,
                })?;
                mesh = moved.mesh;
                work += moved.work;
                spent += moved.interface.map_or(0.0, |i| i.seconds);
                interface = moved.interface;
            }
            Ok::<_, Failure>(mesh)
        })?;
        seconds.mesh -= spent;
        seconds.interface += spent;
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
