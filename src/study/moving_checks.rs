//! Studies of kind `moving-mesh`: what is refused, what is completed, and what is doubtful.

use super::common::StudyKind;
use super::dimension::{GeneratorTable, PdeTable, Studied};
use super::kind::{Kind, common_tables};
use super::moving_mesh::{MovingStudy, StartMesh, Stepper};
use super::moving_run::MovingRun;
use crate::density::{ArclengthTable, GivenTable, MonitorKind};
use crate::error::{Error, Result};
use crate::formula::Formula;
use crate::geometry::{Chart, Lattice, Mesh};
use crate::physics::{StartAndSide, formula};
use crate::setting::Auto;

/// Memory that a run needs for each node: 2250 bytes measured at 600 × 600 cells with subdomains and a reference, and a
/// reserve.
const BYTES_PER_NODE: u128 = 2600;
/// Number of places along an axis at which formulas are sampled.
const SAMPLES: usize = 100;
/// Differences above this share of the largest value are not made of rounding.
const NOT_ROUNDING: f64 = 1e-9;

impl<const D: usize> Kind for MovingStudy<D>
where
    Mesh<D>: Studied<D>,
{
    type Run = MovingRun<D>;

    const KIND: StudyKind = StudyKind::MovingMesh;

    common_tables!();

    fn resolve(&mut self) -> Result<()> {
        Mesh::resolve(self)
    }

    fn memory(&self) -> u128 {
        self.grid.cells.iter().map(|&n| n as u128 + 1).product::<u128>() * BYTES_PER_NODE
    }

    fn warnings(&self) -> Result<Vec<String>> {
        Mesh::contradictions(self)
    }

    fn try_start(&self) -> Result<()> {
        Mesh::try_start(self)
    }

    fn begin(&self) -> Result<MovingRun<D>> {
        Mesh::begin(self)
    }
}

impl<const D: usize> MovingStudy<D>
where
    Mesh<D>: Studied<D>,
{
    /// Checks all settings and fills in what is left out.
    pub(super) fn resolved(&mut self) -> Result<()> {
        self.study.check_name()?;
        self.pde.check().map_err(|error| error.within("pde"))?;
        self.pde.check_axes(&self.domain)?;
        self.check_stepper()?;
        self.check_tolerance()?;
        self.safety.check().map_err(|error| error.within("safety"))?;
        self.check_size()?;
        let lattice = *self.uniform_mesh()?.lattice();
        self.mesh.generator.check(&lattice).map_err(|error| error.within("generator").within("mesh"))?;
        if let Some(compare) = &self.compare {
            compare.generator.check(&lattice).map_err(|error| error.within("generator").within("compare"))?;
        }
        let [_, prescribed_density] = self.pde.prescribes();
        let stays = self.mesh.generator.stays();
        let unknowns = self.physics()?.unknowns();
        let monitor = self.monitor.get_or_insert_with(|| match prescribed_density {
            true => MonitorKind::GivenTable(GivenTable::default()),
            // no mesh follows it: the cheap one
            false if stays => MonitorKind::ArclengthTable(ArclengthTable::default()),
            false => MonitorKind::default(),
        });
        monitor.check().map_err(|error| error.within("monitor"))?;
        monitor.clone().into_monitor::<D>(&unknowns).map_err(|error| error.within("monitor"))?;
        if prescribed_density && !matches!(monitor, MonitorKind::GivenTable(_)) {
            let rule = "pde.rho is the density itself; set it to \"given\", or leave [monitor] out";
            return Err(Error::invalid("monitor.kind", format!("\"{}\"", monitor.name()), rule));
        }
        self.mesh.start.get_or_insert(match stays {
            true => StartMesh::Uniform,
            false => StartMesh::Adapted,
        });
        self.equation().check().map_err(|error| error.within("mesh"))?;
        self.mesh.coupling.check().map_err(|error| error.within("coupling").within("mesh"))?;
        if self.time.report.is_empty() {
            self.time.report = vec![self.time.end];
        }
        self.output.frames = Some(self.output.frames_of(&self.schedule()?)?);
        self.output.check()
    }

    /// Formulas that are not periodic on periodic axes, and those that contradict each other on a side.
    pub(super) fn contradictions(&self) -> Result<Vec<String>> {
        let (mut warnings, chart) = (Vec::new(), Mesh::chart_of(&self.domain)?);
        for (key, text) in self.pde.formulas() {
            let f = formula::<D>(&key, text).map_err(|error| error.within("pde"))?;
            warnings.extend((0..D).filter(|&d| self.domain.periodic[d]).filter_map(|d| self.jump(&key, &f, d)));
        }
        for StartAndSide { start: (at_start, initial), value: (on_sides, boundary), side } in
            self.pde.starts_and_sides()
        {
            let both = [formula::<D>(&at_start, initial)?, formula::<D>(&on_sides, boundary)?];
            warnings.extend(self.gap(chart.as_deref(), [&at_start, &on_sides], &both, side));
        }
        Ok(warnings)
    }

    /// On equal cells: adapting the mesh is part of the run.
    pub(super) fn tried(&self) -> Result<()> {
        self.simulation()?.started(self.uniform_mesh()?).map(|_| ())
    }

    /// Refuses a stepper that the rest of the study does not go with, and fills in its order.
    fn check_stepper(&mut self) -> Result<()> {
        let rk4 = self.time.stepper == Some(Stepper::Rk4);
        if let (false, Some(order)) = (rk4, self.time.order) {
            return Err(Error::invalid(
                "time.order",
                order,
                "only stepper = \"rk4\" has one; add it, or leave this out",
            ));
        }
        if rk4 {
            self.time.order.get_or_insert(2);
        }
        self.physics()?;
        self.time.stepper = self.time.stepper.or(self.pde.stepper());
        Ok(())
    }

    /// Refuses a tolerance that the rest of the study does not go with, and fills in the step where there is none.
    fn check_tolerance(&mut self) -> Result<()> {
        let Some(tolerance) = self.time.tolerance else {
            self.time.step.get_or_insert_default();
            return Ok(());
        };
        if self.time.step == Some(Auto::Auto) {
            let rule =
                "time.tolerance decides on the steps; leave one of both out, or give the longest step as a number";
            return Err(Error::invalid("time.step", "\"auto\"", rule));
        }
        let rule = match (self.pde.prescribes(), self.time.stepper) {
            (_, Some(Stepper::Rk4)) => "stepper = \"rk4\" has steps of its own; leave one of both out",
            ([true, _], _) => "pde.kind = \"prescribed\" has no error in time; leave it out",
            _ => return Ok(()),
        };
        Err(Error::invalid("time.tolerance", tolerance, rule))
    }

    /// Places in the box, or in the unit square that the domain is the image of: `SAMPLES` and one along each axis but
    /// those along which they stand at one place.
    fn places(&self, at: [Option<f64>; D]) -> impl Iterator<Item = [f64; D]> {
        let (lower, upper) = (*self.domain.lower, *self.domain.upper);
        let count = at.iter().filter(|at| at.is_none()).count() as u32;
        (0..(SAMPLES + 1).pow(count)).map(move |k| {
            let mut rest = k;
            std::array::from_fn(|d| {
                at[d].unwrap_or_else(|| {
                    let place = rest % (SAMPLES + 1);
                    rest /= SAMPLES + 1;
                    lower[d] + (upper[d] - lower[d]) * place as f64 / SAMPLES as f64
                })
            })
        })
    }

    /// Says so where a formula jumps from one end of a periodic axis to the other.
    fn jump(&self, key: &str, f: &Formula, d: usize) -> Option<String> {
        let [lower, upper] = [self.domain.lower[d], self.domain.upper[d]];
        let (mut jump, mut size) = (0.0_f64, 0.0_f64);
        for t in [self.time.start, self.time.end] {
            for x in self.places(std::array::from_fn(|e| (e == d).then_some(lower))) {
                let mut across = x;
                across[d] = upper;
                jump = jump.max((at(f, x, t) - at(f, across, t)).abs());
            }
            size = self.places([None; D]).fold(size, |size, x| size.max(at(f, x, t).abs()));
        }
        let axis = ["x", "y"][d];
        (jump > NOT_ROUNDING * size).then(|| {
            format!(
                "`pde.{key}` is not periodic along {axis}: from {axis} = {upper} to {axis} = {lower} it jumps by up to \
                 {jump:.1e}"
            )
        })
    }

    /// Says so where the values on the bounded sides, or on one of them, are not the initial ones at the start.
    fn gap(
        &self,
        chart: Option<&Chart<D>>,
        [at_start, on_sides]: [&str; 2],
        [initial, boundary]: &[Formula; 2],
        side: Option<(usize, usize)>,
    ) -> Option<String> {
        let t = self.time.start;
        // of the data everywhere: what is far below that is rounding
        let map = |s: [f64; D]| chart.map_or(s, |chart| chart.at(s));
        let all = self.places([None; D]).map(|s| at(initial, map(s), t).abs());
        let mut size = all.filter(|u| u.is_finite()).fold(0.0_f64, f64::max);
        let mut worst = (0.0_f64, [0.0; D]);
        for d in (0..D).filter(|&d| !self.domain.wraps()[d]) {
            let ends = [self.domain.lower[d], self.domain.upper[d]].into_iter().enumerate();
            for (_, end) in ends.filter(|(n, _)| side.is_none_or(|side| side == (d, *n))) {
                for x in self.places(std::array::from_fn(|e| (e == d).then_some(end))).map(map) {
                    let [u, side] = [initial, boundary].map(|f| at(f, x, t));
                    size = size.max(u.abs()).max(side.abs());
                    if (u - side).abs() > worst.0 {
                        worst = ((u - side).abs(), x);
                    }
                }
            }
        }
        let (gap, x) = worst;
        let place: Vec<String> = ["x", "y"].iter().zip(x).map(|(axis, x)| format!("{axis} = {x}")).collect();
        (gap > NOT_ROUNDING * size).then(|| {
            format!(
                "`pde.{on_sides}` is not `pde.{at_start}` at the start: on the sides they differ by up to {gap:.1e}, \
                 at {}",
                place.join(", ")
            )
        })
    }

    fn check_size(&self) -> Result<()> {
        let lattice = Lattice::new(*self.grid.cells, self.domain.wraps()).map_err(|error| error.within("grid"))?;
        let nodes = lattice.nodes().into_iter().map(|n| n as u128).product();
        super::memory::check_memory(nodes, BYTES_PER_NODE, &*self.grid.cells)
    }
}

/// The value of a formula of place and time.
fn at<const D: usize>(f: &Formula, x: [f64; D], t: f64) -> f64 {
    let values: Vec<f64> = x.into_iter().chain([t]).collect();
    f.eval(&values)
}
