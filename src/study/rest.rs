use super::MovingStudy;
use super::dimension::{GeneratorTable, Studied};
use super::moving_mesh::StartMesh;
use crate::density::{MonitorKind, Strength};
use crate::error::Result;
use crate::geometry::Mesh;
use crate::meshing::{Form, Mmpde, Movable, Relaxation};
use crate::simulation::{Record, Simulation, State};

/// The mesh step that measures what the density asks for is solved to this share of the shortest edge.
const CLOSE: f64 = 1e-2;
/// A mesh whose nodes all moved by less than this many cells in a whole run counts as at rest.
const MOVES: f64 = 0.25;
/// The density asks for motion where one mesh step would move a node by more than this many cells.
const ASKS: f64 = 0.5;
/// A density is flat where its largest value over its smallest is below this after smoothing.
const FLAT: f64 = 1.1;
/// A density was not flat where its largest value over its smallest is above this before smoothing.
const NOT_FLAT: f64 = 1.5;

/// Why a mesh did not move in a run that ended, where it did not although something asked for it
///
/// What the density asks for is how far a node goes from the last mesh in one step of the mesh equation as long as τ. A
/// density that is flat asks for nothing, but nobody means it.
pub(super) fn at_rest<const D: usize>(
    study: &MovingStudy<D>,
    simulation: &Simulation<D>,
    state: &State<D>,
    record: &Record,
) -> Result<Option<String>>
where
    Mesh<D>: Studied<D>,
{
    let mesh = &state.mesh;
    let cell = mesh.equal_cell();
    let went = record.travelled / cell;
    // a mesh that is meant to stay
    if went > MOVES || study.mesh.generator.stays() {
        return Ok(None);
    }
    let equation = Mmpde { relaxation: 1.0.into(), form: Form::Conservative };
    let moved = Mesh::<D>::whole(CLOSE).step(&equation, mesh, &state.rho, 1.0)?;
    let asks = moved.mesh.farthest(mesh) / cell;
    let reason = match spread(state.rho.largest()) {
        _ if asks > ASKS => held_back(study, record),
        // equal cells are enough
        spread
            if spread < FLAT
                && matches!(study.monitor(), MonitorKind::RootGradientTable(_))
                && varies(study, simulation, state)? =>
        {
            return Ok(None);
        }
        spread if spread < FLAT => flattened(study, simulation, state, spread)?,
        _ => return Ok(None),
    };
    Ok(Some(format!(
        "the mesh does not move: no node went farther than {went:.2} cells, and the density at the end asks \
         for a way of {asks:.2} cells; {reason}"
    )))
}

/// Largest over smallest value.
fn spread(values: &[f64]) -> f64 {
    let ends = values.iter().fold((f64::INFINITY, 0.0_f64), |(low, high), v| (low.min(*v), high.max(*v)));
    ends.1 / ends.0
}

/// True where what the mesh follows is not constant: of all unknowns where the density is made of all.
fn varies<const D: usize>(study: &MovingStudy<D>, simulation: &Simulation<D>, state: &State<D>) -> Result<bool>
where
    Mesh<D>: Studied<D>,
{
    let varies = |values: &mut dyn Iterator<Item = f64>| {
        let ends = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
        ends.1 - ends.0 > 1e-12 * ends.0.abs().max(ends.1.abs())
    };
    let followed = simulation.monitor.followed(state.t, &state.mesh, &state.u)?;
    let of_all = matches!(study.monitor(), MonitorKind::RootGradientTable(_)) && study.monitor().of().is_none();
    let others = if of_all { 1..state.u.components() } else { 0..0 };
    Ok(varies(&mut followed.into_iter()) || others.into_iter().any(|c| varies(&mut state.u.component(c))))
}

fn held_back<const D: usize>(study: &MovingStudy<D>, record: &Record) -> String
where
    Mesh<D>: Studied<D>,
{
    let retries = record.safety.substeps + record.safety.smoothed + record.safety.shortened;
    let span = study.time.end - study.time.start;
    if 2 * retries > record.work.steps {
        format!("{retries} tries in {} steps failed, so that [safety] held the mesh back", record.work.steps)
    } else {
        match study.mesh.relaxation {
            Relaxation::Auto if study.mesh.start == Some(StartMesh::Uniform) => {
                "\"auto\" follows what moves and has no hurry on the way from equal cells; set `mesh.start` to \
                 \"adapted\""
                    .into()
            }
            Relaxation::Auto => "\"auto\" follows what moves; give `mesh.relaxation` as a time to follow faster".into(),
            given => {
                let tau = given.over(span / record.work.steps.max(1) as f64);
                format!(
                    "with `mesh.relaxation` it follows in about τ = {tau:.3e}, and the run lasts \
                         {span:.3e}; lower it"
                )
            }
        }
    }
}

fn flattened<const D: usize>(
    study: &MovingStudy<D>,
    simulation: &Simulation<D>,
    state: &State<D>,
    spread: f64,
) -> Result<String>
where
    Mesh<D>: Studied<D>,
{
    let followed = simulation.monitor.followed(state.t, &state.mesh, &state.u)?;
    let mut bare = study.monitor();
    let smoothing = match &mut bare {
        MonitorKind::RootGradientTable(_) => 0,
        MonitorKind::ArclengthTable(arclength) => std::mem::take(&mut arclength.smoothing),
        MonitorKind::CurvatureTable(curvature) => std::mem::take(&mut curvature.smoothing),
        MonitorKind::GivenTable(given) => std::mem::take(&mut given.smoothing),
    };
    let strength = match &bare {
        MonitorKind::ArclengthTable(arclength) => Some(arclength.strength),
        MonitorKind::CurvatureTable(curvature) => Some(curvature.strength),
        MonitorKind::RootGradientTable(_) | MonitorKind::GivenTable(_) => None,
    };
    if let Some(Strength::Relative(0.0) | Strength::Absolute(0.0)) = strength {
        return Ok("its density is constant: `monitor.strength` is 0".into());
    }
    if !varies(study, simulation, state)? {
        let by_default = match study.monitor() {
            MonitorKind::RootGradientTable(_) => "all unknowns",
            _ => "the first unknown",
        };
        let followed = study.monitor().of().unwrap_or(by_default).to_string();
        return Ok(format!(
            "its density is constant, since what it follows is: {followed}; name another in `monitor.of`"
        ));
    }
    let bare = bare.into_monitor(&simulation.physics.unknowns())?;
    let without = self::spread(bare.density(&state.mesh, &followed, None)?.largest());
    Ok(match without > NOT_FLAT {
        true => format!(
            "its density is flat, largest over smallest {spread:.3}: `monitor.smoothing` = {smoothing} passes \
             have lowered that from {without:.3}"
        ),
        false => format!("its density is flat, largest over smallest {spread:.3}: raise `monitor.strength`"),
    })
}
