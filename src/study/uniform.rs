use super::{Kind, MovingMesh, Source};
use crate::error::Result;
use crate::physics::PdeKind;
use crate::simulation::Report;

/// The uniform mesh of as small an error: see [`MovingMesh::uniform_equivalent`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UniformEquivalent {
    /// Nodes along each axis.
    pub nodes: [usize; 2],
    /// How many times thicker the front was on which this was measured.
    pub thicker: f64,
    /// The time of the errors.
    pub t: f64,
}

/// Smallest viscosity of the fronts that uniform runs are made on, so that each takes a few hundredths of a second.
const THINNEST: f64 = 5e-3;
/// Number of cells along the longer side in the first uniform run.
const CELLS: f64 = 120.0;
/// Number of cells along the longer side above which no further uniform run is made.
const MOST: f64 = 400.0;
/// Number of cells along the longer side below which a uniform mesh does not show the front, and is not reported.
const FEWEST: f64 = 8.0;
/// Number of uniform runs, each with the cells that the error of the one before asks for.
const RUNS: usize = 3;

impl MovingMesh {
    /// The uniform mesh on which second-order differences would have the l_inf of a report; none where the solution is
    /// not the exact front of Burgers' equation, or the mesh of the study does not move
    ///
    /// Errors on a uniform mesh depend on the cell over the width of the front, so they are measured on a front of
    /// ν = 5e-3, and cells grow like 1/ν. Between runs l_inf ~ h².
    ///
    /// # Errors
    /// As [`Kind::compute`].
    pub fn uniform_equivalent(&self, report: &Report) -> Result<Option<UniformEquivalent>> {
        let PdeKind::Burgers(burgers) = &self.pde else { return Ok(None) };
        let Some(error) = report.error.filter(|error| error.linf > 0.0 && report.t > self.time.start) else {
            return Ok(None);
        };
        if burgers.initial.is_some()
            || !self.domain.is_box()
            || matches!(self.mesh.generator, crate::meshing::GeneratorKind::Fixed(_))
        {
            return Ok(None);
        }
        let [width, height] = [0, 1].map(|d| self.domain.upper[d] - self.domain.lower[d]);
        let along = |n: f64| [width, height].map(|w| (n * w / width.max(height)).round().max(1.0) as usize);
        let viscosity = burgers.viscosity.max(THINNEST);
        let thicker = viscosity / burgers.viscosity;
        let mut cells = CELLS;
        for _ in 0..RUNS {
            let text = format!(
                "[study]\nname = \"uniform\"\nkind = \"moving-mesh\"\n[domain]\nlower = {:?}\nupper = {:?}\n\
                 [grid]\ncells = {:?}\n[time]\nstart = {:?}\nend = {:?}\nstep = 1e9\nstepper = \"rk4\"\n\
                 [pde]\nkind = \"burgers\"\nviscosity = {viscosity:e}\n[mesh]\ngenerator = {{ kind = \"fixed\" }}\n",
                self.domain.lower,
                self.domain.upper,
                along(cells),
                self.time.start,
                report.t
            );
            let (run, _) = Self::from_source(&Source::new("uniform", text))?.compute()?;
            let Some(found) = run.record.reports.last().and_then(|report| report.error) else { return Ok(None) };
            cells *= (found.linf / error.linf).sqrt();
            if cells > MOST {
                break;
            }
            // the front is not there
            if cells.is_nan() || cells < FEWEST {
                return Ok(None);
            }
        }
        let nodes = along(cells * thicker).map(|n| n + 1);
        Ok(Some(UniformEquivalent { nodes, thicker, t: report.t }))
    }
}
