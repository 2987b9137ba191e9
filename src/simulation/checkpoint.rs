//! Everything that the rest of a run depends on, as a value.

use super::conserved::AtStart;
use super::forced::Forced;
use super::pace::Pace;
use super::{Record, Safety, Schedule, State};
use crate::error::{Result, Unfit};
use crate::geometry::{Density, Field, Mesh, check_unfolded};
use crate::kept::{Kept, check_nodal, nodal};
use crate::mover::Gait;
use crate::physics::Physics;
use serde::{Deserialize, Serialize};

/// Where the checkpoints of a run go.
pub(crate) trait Keeper<const D: usize = 2> {
    /// Whether one is to be kept after a step.
    fn due(&self, step: usize) -> bool;

    /// Keeps one, which may be that after the last step.
    ///
    /// # Errors
    /// Whatever keeps the checkpoint from being written.
    fn keep(&mut self, checkpoint: &Checkpoint<D>, last: bool) -> Result<()>;
}

/// Memory of the time loop beside state and record.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Course {
    pub at_start: AtStart,
    pub pace: Pace,
    pub forced: Forced,
    /// Seconds of the steps since the run began, over all its parts.
    pub seconds: f64,
}

/// Everything that the steps of a run to come depend on, and what was found in those done.
#[derive(Debug, Serialize, Deserialize)]
pub(crate) struct Checkpoint<const D: usize = 2> {
    t: f64,
    pub step: usize,
    /// Positions of the nodes, in a domain with a chart those in the unit box.
    #[serde(with = "nodal")]
    x: Vec<[f64; D]>,
    u: Vec<f64>,
    rho: Density,
    gait: Gait<D>,
    own_change: f64,
    pub record: Record,
    pub course: Course,
    /// Memory of the generator and the observers.
    pub kept: Kept,
}

impl<const D: usize> Checkpoint<D> {
    pub fn of(state: &State<D>, record: Record, course: Course, kept: Kept) -> Self {
        let State { t, step, mesh, u, rho, gait, own_change } = state;
        Self {
            t: *t,
            step: *step,
            x: mesh.parameters().x().to_vec(),
            u: u.values().to_vec(),
            rho: rho.clone(),
            gait: gait.clone(),
            own_change: *own_change,
            record,
            course,
            kept,
        }
    }

    /// The state, if one of the study can be so. `mesh` is any of its meshes.
    pub fn state(
        &self,
        mesh: &Mesh<D>,
        physics: &dyn Physics<D>,
        schedule: &Schedule,
        safety: Safety,
    ) -> Result<State<D>, Unfit> {
        let damaged = |reason: String| Err(Unfit::Damaged(reason));
        let (nodes, components) = (mesh.lattice().len(), physics.unknowns().len());
        let Self { t, step, x, u, rho, gait, own_change, course, .. } = self;
        check_nodal("mesh", x, nodes)?;
        check_nodal("solution", u.as_chunks::<1>().0, nodes * components)?;
        rho.check(mesh).map_err(|failure| Unfit::Damaged(failure.to_string()))?;
        gait.check(mesh)?;
        if !(*own_change >= 0.0 && own_change.is_finite()) {
            return damaged(format!("its solution cannot have changed by {own_change}"));
        }
        if !schedule.meets(*step, *t) {
            return damaged(format!("its step {step} at t = {t} is none of the run"));
        }
        if !(course.at_start.is_sound(components) && course.seconds.is_finite()) {
            return damaged(format!("its integrals {:?} or seconds {} cannot be", course.at_start, course.seconds));
        }
        if !course.pace.is_sound(schedule, safety) {
            return damaged("its time steps are none of the run".into());
        }
        let mesh = mesh.placed(x.clone()).map_err(|failure| Unfit::Damaged(failure.to_string()))?;
        let u = Field::of(components, u.clone()).map_err(|failure| Unfit::Damaged(failure.to_string()))?;
        let sound = check_unfolded(&mesh).and_then(|()| physics.check(*t, &mesh, &u));
        sound.map_err(|failure| Unfit::Damaged(failure.to_string()))?;
        Ok(State { t: *t, step: *step, mesh, u, rho: rho.clone(), gait: gait.clone(), own_change: *own_change })
    }
}
