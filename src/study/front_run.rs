//! Studies of kind `stefan` with heat in two phases: how they run.

use super::front_figures::{FrontReport, Row};
use super::front_given::Given;
use super::fronts::{Controller, Fronts, Progress, View};
use super::time_loop::TimeLoop;
use crate::error::{Moment, Result, Unfit};
use crate::geometry::{Mesh, quality};
use crate::kept::check_nodal;
use crate::output::{Picture, Rows, draw_curves, names};
use crate::simulation::{Scene, Values};
use crate::stefan::{Attempt, Energy, Front, FrontState, LOWER, Stepping, UPPER};
use std::path::Path;

/// Automatic steps of an explicit front are at most this share of the longest stable one.
const OF_THE_LIMIT: f64 = 0.5;
/// In an automatic step an explicit front moves at most by this share of its distance from the nearer wall; in the
/// first one of an implicit front, too.
const OF_THE_ROOM: f64 = 0.002;

/// A front between two phases, with what formulas or an exact solution give.
pub struct TwoPhase {
    /// The columns, and how the front moves through them.
    pub front: Front,
    pub(super) given: Given,
}

/// A front between two phases while it runs.
pub type FrontRun = TimeLoop<TwoPhase>;

impl TwoPhase {
    /// Both phases as one mesh.
    fn mesh(&self, state: &FrontState) -> Result<Mesh<2>> {
        self.front.columns.whole(&self.front.shown(state).0)
    }

    /// Both phases, with the front over their mesh.
    fn scene_on(&self, mesh: &Mesh<2>, state: &FrontState) -> Scene {
        let (columns, FrontState { t, step, front, .. }) = (&self.front.columns, state);
        let curve = columns.x().iter().zip(front).map(|(x, y)| [*x, *y]).collect();
        let (_, u) = self.front.shown(state);
        let [at_nodes, in_cells] = self.front.phases(state);
        let nodal = vec![("u".into(), columns.joined(&u)), ("phase".into(), at_nodes)];
        let mut scene = Scene { curve, ..Scene::of_mesh(*t, *step, mesh, nodal) };
        scene.in_cells.push(("phase".into(), Values::Scalars(in_cells)));
        scene
    }
}

impl Fronts for TwoPhase {
    type State = FrontState;
    type Report = FrontReport;

    const CONTROLLER: Controller = Controller { tolerance: 1e-6, root: f64::cbrt, halvings: 6 };
    const TABLES: &'static [&'static str] = &[names::HISTORY, names::FRONTS];
    const PICTURED: Option<usize> = Some(16);

    fn moment(state: &FrontState) -> Moment {
        Moment { t: state.t, step: state.step }
    }

    fn reported(report: &FrontReport) -> f64 {
        report.t
    }

    fn places<'a>(&self, state: &'a FrontState) -> &'a [f64] {
        &state.front
    }

    fn check(&self, state: &FrontState) -> Result<(), Unfit> {
        let columns = &self.front.columns;
        check_nodal("front", state.front.as_chunks::<1>().0, columns.x().len())?;
        if state.bare.len() != columns.x().len() || state.bare.iter().flatten().any(|phase| *phase > UPPER) {
            return Err(Unfit::Damaged("its bare walls are none of the study".into()));
        }
        if state.alone.is_none() {
            columns.check(&state.front, &state.bare).map_err(|failure| Unfit::Damaged(failure.to_string()))?;
        }
        for phase in [LOWER, UPPER] {
            let nodes = columns.x().len() * (columns.rows(phase) + 1);
            check_nodal("temperature", state.u[phase].as_chunks::<1>().0, nodes)?;
        }
        let Energy { start, now, inflow, inflow_by_differences, moved } = state.energy;
        check_nodal("energy", &[[start, now, inflow, inflow_by_differences, moved, state.way[0], state.way[1]]], 1)
    }

    fn attempt(&mut self, state: &FrontState, t: f64) -> Result<Attempt> {
        self.front.attempt(&self.given, state, t)
    }

    fn step_length(&self, state: &FrontState, chosen: Option<f64>, halvings: i32, _span: f64) -> f64 {
        let slow = || OF_THE_ROOM * self.front.passage(&self.given, state);
        match self.front.stepping {
            // the schedule may lengthen a step by a third
            Stepping::Explicit => (OF_THE_LIMIT * self.front.limit(state)).min(slow()) * 0.5_f64.powi(halvings),
            Stepping::Implicit => chosen.unwrap_or_else(slow),
        }
    }

    fn write_heads(&self, tables: &mut [Rows]) -> Result<()> {
        let heads = ["t".to_string()].into_iter().chain(self.front.columns.x().iter().map(|x| format!("x={x}")));
        tables[1].add(heads.collect::<Vec<_>>())
    }

    fn view<'a>(
        &'a self,
        state: &'a FrontState,
        progress: Progress,
        tables: &mut [Rows],
    ) -> Result<View<'a, FrontReport>> {
        let mesh = self.mesh(state)?;
        let quality = quality(&mesh, &vec![1.0; mesh.x().len()])?;
        let report = FrontReport::of(&self.front, &self.given, state);
        if let [history, fronts] = tables {
            let heights = [state.t].into_iter().chain(state.front.iter().copied()).map(|value| value.to_string());
            fronts.add(heights.collect::<Vec<_>>())?;
            history.add(Row::of(&report, self.front.temperatures(state), quality, progress))?;
            history.flush().and(fronts.flush())?;
        }
        Ok(View {
            report,
            smallest: quality.min_scaled_jacobian,
            nodes: mesh.x().to_vec(),
            scene: Box::new(move || self.scene_on(&mesh, state)),
        })
    }

    fn scene(&self, state: &FrontState) -> Result<Scene> {
        Ok(self.scene_on(&self.mesh(state)?, state))
    }

    fn picture(&self, title: &str, fronts: &[(f64, Vec<f64>)]) -> Picture {
        let all = || fronts.iter().flat_map(|(_, h)| h.iter().copied());
        let (low, high) = (all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max));
        let margin = (0.05 * (high - low)).max(1e-3 * high.abs().max(1e-12));
        let x = self.front.columns.x();
        let ends = [[x[0], low - margin], [x[x.len() - 1], high + margin]];
        draw_curves(&format!("{title}, the front over time"), "t", x, fronts, ends[0], ends[1])
    }

    fn written(&self, directory: &Path) -> Result<Vec<(f64, Vec<f64>)>, Unfit> {
        let rows = Rows::numbers(directory, names::FRONTS)?;
        let heights: Vec<[f64; 1]> = rows.iter().flatten().map(|height| [*height]).collect();
        check_nodal(names::FRONTS, &heights, rows.len() * (self.front.columns.x().len() + 1))?;
        Ok(rows.iter().map(|row| (row[0], row[1..].to_vec())).collect())
    }

    /// A warning of a front whose way would change with more rows of cells.
    fn doubt(&self, state: &FrontState) -> Option<String> {
        /// Share of the way of a front above which its uncertainty is worth a warning.
        const DOUBTFUL: f64 = 0.01;
        let doubt = self.front.doubt(state).filter(|doubt| *doubt > DOUBTFUL)?;
        let (percent, [way, rows]) = (100.0 * doubt, state.way);
        Some(if doubt > rows / way {
            format!(
                "the front may have gone too far or not far enough by {percent:.1} % of its way: its speed \
                 in a melt so far below melting turns on the last per cent of the heat, and the balance of heat is off \
                 by more; raise grid.cells"
            )
        } else {
            format!(
                "gradients at the front over four rows in place of three would change its way by {percent:.1} %: rows \
                 there are too few for the temperature; raise grid.cells or grid.grading"
            )
        })
    }
}

// the phases are told by number where a study tells them by name
const _: () = assert!(LOWER == 0 && UPPER == 1);
