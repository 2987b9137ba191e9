//! Studies of kind `stefan` with `[species]`: how they run.

use super::fronts::{Controller, Fronts, Progress, View};
use super::species_figures::{SpeciesReport, heads, row};
use super::time_loop::TimeLoop;
use crate::error::{Moment, Result, Unfit};
use crate::output::{Curve, Figure, Picture, Rows, RunDirectory, Scale, final_arrays, names};
use crate::simulation::{Scene, Values};
use crate::species::{Species, SpeciesState};
use crate::stefan::Attempt;

/// Length of the first automatic step, as a share of the run.
const FIRST: f64 = 1e-5;

/// Fronts between species while they run.
pub type SpeciesRun = TimeLoop<Species>;

impl Fronts for Species {
    type State = SpeciesState;
    type Report = SpeciesReport;

    const CONTROLLER: Controller = Controller { tolerance: 1e-5, root: f64::sqrt, halvings: 12 };
    const TABLES: &'static [&'static str] = &[names::HISTORY];
    const PICTURED: Option<usize> = None;

    fn moment(state: &SpeciesState) -> Moment {
        Moment { t: state.t, step: state.step }
    }

    fn reported(report: &SpeciesReport) -> f64 {
        report.t
    }

    fn places<'a>(&self, state: &'a SpeciesState) -> &'a [f64] {
        self.fronts(state)
    }

    fn check(&self, state: &SpeciesState) -> Result<(), Unfit> {
        match self.knows(state) {
            true => Ok(()),
            false => Err(Unfit::Damaged("its state is none of the study".into())),
        }
    }

    fn attempt(&mut self, state: &SpeciesState, t: f64) -> Result<Attempt<SpeciesState>> {
        let (state, work, error) = Species::attempt(self, state, t)?;
        Ok(Attempt { state, work, error: Some(error), event: None })
    }

    fn step_length(&self, _state: &SpeciesState, chosen: Option<f64>, _halvings: i32, span: f64) -> f64 {
        chosen.unwrap_or(FIRST * span)
    }

    fn write_heads(&self, tables: &mut [Rows]) -> Result<()> {
        tables[0].add(heads(self))
    }

    fn view<'a>(
        &'a self,
        state: &'a SpeciesState,
        progress: Progress,
        tables: &mut [Rows],
    ) -> Result<View<'a, SpeciesReport>> {
        let report = SpeciesReport::of(self, state);
        for history in tables {
            history.add(row(&report, progress))?;
            history.flush()?;
        }
        let smallest = self.widths_at(state).into_iter().fold(f64::INFINITY, f64::min);
        Ok(View { report, smallest, nodes: Vec::new(), scene: Box::new(|| profile(self, state)) })
    }

    fn scene(&self, state: &SpeciesState) -> Result<Scene> {
        Ok(profile(self, state))
    }

    fn picture(&self, title: &str, fronts: &[(f64, Vec<f64>)]) -> Picture {
        let curve = |k: usize| Curve {
            name: if self.laws.len() == 1 { String::new() } else { format!("front {}", k + 1) },
            points: fronts.iter().map(|(t, x)| [*t, x[k]]).collect(),
            plain: true,
            ..Curve::default()
        };
        let figure = Figure {
            title: format!("{title}, the front over time"),
            labels: ["t".into(), "x".into()],
            scales: [Scale::Linear; 2],
            curves: (0..self.laws.len()).map(curve).map(Curve::outlined).collect(),
            ..Figure::default()
        };
        figure.draw()
    }

    fn leave(&self, state: &SpeciesState, directory: &RunDirectory) -> Result<()> {
        directory.write(names::ARRAYS, &final_arrays(&profile(self, state)))
    }
}

/// Every phase with its species, and the phase by number; places of fronts occur twice.
fn profile(species: &Species, state: &SpeciesState) -> Scene {
    let (x, phases, values) = species.profile(state);
    let names = species.names.species().iter().cloned();
    let mut nodal: Vec<(String, Values)> = names.zip(values.into_iter().map(Values::Scalars)).collect();
    nodal.push(("phase".into(), Values::Scalars(phases.into_iter().map(|phase| phase as f64).collect())));
    let [lower, upper] = species.walls;
    Scene {
        t: state.t,
        step: state.step,
        cells: [x.len() - 1, 0],
        periodic: [false; 2],
        closed: [false; 2],
        lower: [lower, 0.0],
        extent: [upper - lower, 0.0],
        points: x.into_iter().map(|[x]| [x, 0.0]).collect(),
        nodal,
        density: None,
        in_cells: Vec::new(),
        curve: Vec::new(),
    }
}
