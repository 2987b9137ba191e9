//! Studies of kind `moving-mesh`: what is refused, what is completed, and what is doubtful.

use super::common::{Header, Output, StudyKind};
use super::kind::Kind;
use super::moving_mesh::{Domain, MovingMesh, StartMesh, Stepper};
use super::moving_run::MovingRun;
use crate::density::{ArclengthTable, GivenTable, MonitorKind};
use crate::error::{Error, Result};
use crate::formula::Formula;
use crate::geometry::Lattice;
use crate::meshing::GeneratorKind;
use crate::physics::{PdeKind, formula};
use crate::setting::Auto;

/// Memory that a run needs for each node: 2250 bytes measured at 600 × 600 cells with subdomains and a reference, and a
/// reserve.
const BYTES_PER_NODE: u128 = 2600;
/// Places along an axis at which formulas are looked at.
const SAMPLES: usize = 100;
/// A difference, as a share of the largest value, that is not of rounding.
const NOT_ROUNDING: f64 = 1e-9;

impl Kind for MovingMesh {
    type Run = MovingRun;

    const KIND: StudyKind = StudyKind::MovingMesh;

    fn common(&self) -> (&Header, &Output) {
        (&self.study, &self.output)
    }

    fn resolve(&mut self) -> Result<()> {
        self.study.check_name()?;
        self.pde.check().map_err(|error| error.within("pde"))?;
        self.check_axes()?;
        self.check_stepper()?;
        self.check_tolerance()?;
        self.safety.check().map_err(|error| error.within("safety"))?;
        self.check_size()?;
        let lattice = *self.uniform_mesh()?.lattice();
        self.mesh.generator.check(&lattice).map_err(|error| error.within("generator").within("mesh"))?;
        if let Some(compare) = &self.compare {
            compare.generator.check(&lattice).map_err(|error| error.within("generator").within("compare"))?;
        }
        let prescribed_density = matches!(&self.pde, PdeKind::Prescribed(p) if p.rho.is_some());
        let stays = matches!(self.mesh.generator, GeneratorKind::Fixed(_));
        let monitor = self.monitor.get_or_insert_with(|| match prescribed_density {
            true => MonitorKind::GivenTable(GivenTable::default()),
            // no mesh follows it: the cheap one
            false if stays => MonitorKind::ArclengthTable(ArclengthTable::default()),
            false => MonitorKind::default(),
        });
        monitor.check().map_err(|error| error.within("monitor"))?;
        let unknowns = self.pde.clone().into_physics().map_err(|error| error.within("pde"))?.unknowns();
        monitor.clone().into_monitor::<2>(&unknowns).map_err(|error| error.within("monitor"))?;
        if prescribed_density && !matches!(monitor, MonitorKind::GivenTable(_)) {
            let rule = "pde.rho is the density itself; set it to \"given\", or leave [monitor] out";
            return Err(Error::invalid("monitor.kind", format!("\"{}\"", monitor.name()), rule));
        }
        self.mesh.start.get_or_insert(match self.mesh.generator {
            GeneratorKind::Fixed(_) => StartMesh::Uniform,
            _ => StartMesh::Adapted,
        });
        self.equation().check().map_err(|error| error.within("mesh"))?;
        self.mesh.coupling.check().map_err(|error| error.within("coupling").within("mesh"))?;
        if self.time.report.is_empty() {
            self.time.report = vec![self.time.end];
        }
        self.output.frames = Some(self.output.frames_of(&self.schedule()?)?);
        self.output.check()
    }

    fn memory(&self) -> u128 {
        self.grid.cells.iter().map(|&n| n as u128 + 1).product::<u128>() * BYTES_PER_NODE
    }

    /// Formulas that are not periodic on periodic axes, and those that contradict each other on a side.
    fn warnings(&self) -> Result<Vec<String>> {
        let mut warnings = Vec::new();
        for (key, text) in self.pde.formulas() {
            let f = formula::<2>(&key, text).map_err(|error| error.within("pde"))?;
            warnings.extend((0..2).filter(|&d| self.domain.periodic[d]).filter_map(|d| self.jump(&key, &f, d)));
        }
        for [(at_start, initial), (on_sides, boundary)] in self.pde.starts_and_sides() {
            let both = [formula::<2>(&at_start, initial)?, formula::<2>(&on_sides, boundary)?];
            warnings.extend(self.gap(&at_start, &on_sides, &both));
        }
        Ok(warnings)
    }

    /// On equal cells: adapting the mesh is part of the run.
    fn try_start(&self) -> Result<()> {
        self.simulation()?.start(self.uniform_mesh()?).map(|_| ())
    }

    fn begin(&self) -> Result<MovingRun> {
        MovingRun::of(self)
    }
}

impl MovingMesh {
    /// Refuses axes that the equation is not made for.
    fn check_axes(&self) -> Result<()> {
        let periodic = self.domain.periodic;
        let (wrong, rule) = match &self.pde {
            PdeKind::Burgers(burgers) if burgers.initial.is_none() => (
                periodic.contains(&true),
                "the front of pde.kind = \"burgers\" needs bounded axes; set it to [false, false], or give pde.initial",
            ),
            PdeKind::Burgers(burgers) => (
                periodic.contains(&false) == burgers.boundary.is_none(),
                match burgers.boundary {
                    None => {
                        "pde.initial needs pde.boundary beside it on bounded axes; add it, or make both axes periodic"
                    }
                    Some(_) => "pde.boundary has no side to stand on; leave it out, or make an axis bounded",
                },
            ),
            PdeKind::ShallowWater(_) => {
                (periodic.contains(&false), "pde.kind = \"shallow-water\" needs periodic axes; set it to [true, true]")
            }
            PdeKind::FormulaPde(pde) => return pde.check_sides(periodic).map_err(|error| error.within("pde")),
            PdeKind::Prescribed(_) => (false, ""),
        };
        if !wrong {
            return Ok(());
        }
        Err(Error::invalid("domain.periodic", format!("{periodic:?}"), rule))
    }

    /// Refuses a stepper that the rest of the study does not go with, and fills in its order.
    fn check_stepper(&mut self) -> Result<()> {
        if let (None, Some(order)) = (self.time.stepper, self.time.order) {
            return Err(Error::invalid(
                "time.order",
                order,
                "only stepper = \"rk4\" has one; add it, or leave this out",
            ));
        }
        if self.time.stepper.is_some() {
            self.time.order.get_or_insert(2);
            self.physics()?;
        }
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
        let rule = match (&self.pde, self.time.stepper) {
            (_, Some(Stepper::Rk4)) => "stepper = \"rk4\" has steps of its own; leave one of both out",
            (PdeKind::Prescribed(_), _) => "pde.kind = \"prescribed\" has no error in time; leave it out",
            _ => return Ok(()),
        };
        Err(Error::invalid("time.tolerance", tolerance, rule))
    }

    /// Places along an axis, both ends among them.
    fn samples(&self, d: usize) -> impl Iterator<Item = f64> + Clone {
        let Domain { lower, upper, .. } = self.domain;
        (0..=SAMPLES).map(move |k| lower[d] + (upper[d] - lower[d]) * k as f64 / SAMPLES as f64)
    }

    /// Says so where a formula jumps from one end of a periodic axis to the other.
    fn jump(&self, key: &str, f: &Formula, d: usize) -> Option<String> {
        let Domain { lower, upper, .. } = self.domain;
        let (mut jump, mut size) = (0.0_f64, 0.0_f64);
        for (t, along) in [self.time.start, self.time.end].iter().flat_map(|t| self.samples(1 - d).map(move |s| (t, s)))
        {
            let at = |across: f64| {
                let x = if d == 0 { [across, along] } else { [along, across] };
                f.eval(&[x[0], x[1], *t])
            };
            jump = jump.max((at(lower[d]) - at(upper[d])).abs());
            size = self.samples(d).fold(size, |size, across| size.max(at(across).abs()));
        }
        let axis = ["x", "y"][d];
        (jump > NOT_ROUNDING * size).then(|| {
            format!(
                "`pde.{key}` is not periodic along {axis}: from {axis} = {} to {axis} = {} it jumps by up to \
                 {jump:.1e}",
                upper[d], lower[d]
            )
        })
    }

    /// Says so where the values on the bounded sides are not the initial ones at the start.
    fn gap(&self, at_start: &str, on_sides: &str, both: &[Formula; 2]) -> Option<String> {
        let Domain { lower, upper, periodic } = self.domain;
        let mut worst = (0.0_f64, [0.0; 2]);
        // of the data everywhere: what is far below that is rounding
        let inside = (0..100).map(|k| [0, 1].map(|d| [k % 10, k / 10][d] as f64 / 9.0));
        let inside = inside.map(|s| [0, 1].map(|d| lower[d] + s[d] * (upper[d] - lower[d])));
        let at = |[x, y]: [f64; 2]| both[0].eval(&[x, y, self.time.start]).abs();
        let mut size = inside.map(at).filter(|u| u.is_finite()).fold(0.0_f64, f64::max);
        for d in (0..2).filter(|&d| !periodic[d]) {
            for (across, along) in [lower[d], upper[d]].iter().flat_map(|x| self.samples(1 - d).map(move |s| (*x, s))) {
                let x = if d == 0 { [across, along] } else { [along, across] };
                let [u, side] = [0, 1].map(|k| both[k].eval(&[x[0], x[1], self.time.start]));
                size = size.max(u.abs()).max(side.abs());
                if (u - side).abs() > worst.0 {
                    worst = ((u - side).abs(), x);
                }
            }
        }
        let (gap, [x, y]) = worst;
        (gap > NOT_ROUNDING * size).then(|| {
            format!(
                "`pde.{on_sides}` is not `pde.{at_start}` at the start: on the sides they differ by up to {gap:.1e}, \
                 at x = {x}, y = {y}"
            )
        })
    }

    fn check_size(&self) -> Result<()> {
        let lattice = Lattice::new(self.grid.cells, self.domain.periodic).map_err(|error| error.within("grid"))?;
        let nodes = lattice.nodes().into_iter().map(|n| n as u128).product();
        super::memory::check_memory(nodes, BYTES_PER_NODE, &self.grid.cells)
    }
}
