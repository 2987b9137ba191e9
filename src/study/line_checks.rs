//! Studies of kind `equidistribution`: what is refused, and what is completed.

use super::common::StudyKind;
use super::equidistribution::{
    EquidistributionStudy, FirstMesh, Integral, Interval, LineDomain, LineTime, MethodName, SchwarzTable, StopTable,
};
use super::kind::{Kind, common_tables};
use super::line_run::LineRun;
use super::mapped::parse;
use crate::equidistribution::{
    Coarse, Line, LineDensity, MOST_ITERATIONS, Method, Robin, Stop, Sweep, check_ends, pieces,
};
use crate::error::{Error, Failure, Result, line_rule};
use crate::formula::Formula;
use crate::output::FramesAt;
use crate::simulation::Schedule;

/// Largest number of iterations where a study gives none.
const ITERATIONS: usize = 500;
/// Tolerance of the iterations, as a share of the length of the line, where a study gives neither this nor a number of
/// iterations.
const TOLERANCE: f64 = 1e-10;
/// Bytes of memory that a run needs for each cell: measured at a million of them, with a reserve.
const BYTES_PER_CELL: u128 = 1000;
/// Number of meshes that are kept of a run in time where a study does not say how many.
const FRAMES_BY_DEFAULT: usize = 100;
/// Largest number of panels by which an integral may be computed.
const MOST_PANELS: usize = 1_000_000;

impl Kind for EquidistributionStudy {
    type Run = LineRun;

    const KIND: StudyKind = StudyKind::Equidistribution;

    common_tables!();

    fn resolve(&mut self) -> Result<()> {
        self.output.check()?;
        self.study.check_name()?;
        let LineDomain { lower: [a], upper: [b] } = self.domain;
        if !(a.is_finite() && b.is_finite() && a < b && (b - a).is_normal()) {
            return Err(Error::invalid(
                "domain.upper",
                format!("[{b:?}]"),
                format!("must lie above domain.lower = [{a:?}]"),
            ));
        }
        check_ends("domain", [a, b])?;
        let [cells] = self.grid.cells;
        if cells < 2 {
            return Err(Error::invalid("grid.cells", format!("[{cells}]"), "must be 2 or more"));
        }
        super::memory::check_memory(cells as u128 + 1, BYTES_PER_CELL, &self.grid.cells)?;
        self.equidistribution.check([a, b]).map_err(|error| error.within("equidistribution"))?;
        self.resolve_time()?;
        self.check_density()?;
        if let Some(schwarz) = &mut self.schwarz {
            schwarz.resolve(self.time.is_some()).map_err(|error| error.within("schwarz"))?;
            schwarz.ranges(cells).map_err(|error| error.within("schwarz"))?;
        }
        self.stop.resolve().map_err(|error| error.within("stop"))?;
        let first = if self.time.is_some() { FirstMesh::Equidistributed } else { FirstMesh::Uniform };
        self.start.mesh.get_or_insert(first);
        self.given_start().map(|_| ())
    }

    fn memory(&self) -> u128 {
        self.grid.cells[0] as u128 * BYTES_PER_CELL
    }

    fn has_steps(&self) -> bool {
        self.time.is_some()
    }

    fn begin(&self) -> Result<LineRun> {
        LineRun::of(self)
    }
}

impl EquidistributionStudy {
    fn resolve_time(&mut self) -> Result<()> {
        let Some(time) = self.time else {
            return match self.output.frames {
                None => Ok(()),
                Some(_) => Err(Error::invalid("output.frames", "given", "needs [time]; leave it out")),
            };
        };
        let schedule = time.schedule()?;
        if !(time.relaxation.is_finite() && time.relaxation > 0.0) {
            return Err(Error::invalid("time.relaxation", time.relaxation, "must be above 0"));
        }
        let steps = schedule.steps().unwrap_or(1);
        let frames = self.output.frames.get_or_insert(FramesAt::Every(steps.div_ceil(FRAMES_BY_DEFAULT)));
        frames.check([time.start, time.end]).map_err(|error| error.within("output"))
    }

    /// Refuses a density that is not positive everywhere, at the first and the last time.
    fn check_density(&self) -> Result<()> {
        let density = self.density.density().map_err(|error| error.within("density"))?;
        let (key, text) = self.density.setting();
        if self.time.is_none() && Formula::parse(text, &["x", "t"]).is_ok_and(|formula| formula.depends_on(1)) {
            let rule = "must not depend on t without [time]; add it, or write a number for t";
            return Err(Error::invalid(key, format!("{text:?}"), rule));
        }
        let ends = self.line(density.clone()).ends;
        let times = self.time.map_or([0.0; 2], |time| [time.start, time.end]);
        for t in times {
            if let Err(failure) = density.extremes(t, ends) {
                let rule = match failure {
                    Failure::LineDensity { what, value, x, t } => {
                        let when = if self.time.is_some() { format!(", t = {t}") } else { String::new() };
                        format!("{what} is {value:.1e} at x = {x}{when}; {}", line_rule(what, value))
                    }
                    other => other.to_string(),
                };
                return Err(Error::invalid(key, format!("{text:?}"), rule));
            }
        }
        Ok(())
    }

    fn line(&self, density: LineDensity) -> Line {
        let ends = [self.domain.lower[0], self.domain.upper[0]];
        let density = density.with_spikes(self.equidistribution.points.clone()).within(ends);
        Line { density, face: self.equidistribution.face_density, cells: self.grid.cells[0], ends }
    }

    /// The line itself.
    ///
    /// # Errors
    /// [`Error::Formula`].
    pub fn problem(&self) -> Result<Line> {
        Ok(self.line(self.density.density().map_err(|error| error.within("density"))?))
    }

    /// The method and the subdomains, where there are any.
    ///
    /// # Errors
    /// As [`EquidistributionStudy::resolve`].
    pub fn decomposition(&self) -> Result<Option<(Method, Vec<[usize; 2]>)>> {
        let Some(schwarz) = &self.schwarz else { return Ok(None) };
        let ranges = schwarz.ranges(self.grid.cells[0]).map_err(|error| error.within("schwarz"))?;
        Ok(Some((schwarz.method(), ranges)))
    }

    /// When an iteration ends.
    pub fn until(&self) -> Stop {
        self.stop.until()
    }

    /// The first mesh, where it is not a solution.
    pub(super) fn given_start(&self) -> Result<Option<Vec<f64>>> {
        let line = self.problem()?;
        let Some(FirstMesh::Formula(text)) = &self.start.mesh else {
            return Ok((self.start.mesh != Some(FirstMesh::Equidistributed)).then(|| line.uniform()));
        };
        let key = "start.mesh.formula";
        let formula = parse(key, text, &["xi"])?;
        let [first, last] = [0.0, 1.0].map(|xi| formula.eval(&[xi]));
        // mapped() sets the ends; sines of multiples of pi are rounded
        if !(first.abs() <= 1e-12 && (last - 1.0).abs() <= 1e-12) {
            let rule = format!("must go from 0 to 1, but is {first} at xi = 0 and {last} at xi = 1");
            return Err(Error::invalid(key, format!("{text:?}"), rule));
        }
        let mesh = line.mapped(|xi| formula.eval(&[xi]));
        line.check_mesh(key, &mesh)?;
        Ok(Some(mesh))
    }
}

impl StopTable {
    /// Checks the settings and fills in the defaults.
    ///
    /// # Errors
    /// [`Error::Invalid`].
    pub fn resolve(&mut self) -> Result<()> {
        match (self.iterations, self.tolerance) {
            (Some(0), _) => return Err(Error::invalid("iterations", 0, "must be 1 or more")),
            (Some(n), _) if n > MOST_ITERATIONS => {
                return Err(Error::invalid("iterations", n, format!("must be at most {MOST_ITERATIONS}")));
            }
            (_, Some(tolerance)) if !(tolerance.is_finite() && tolerance > 0.0) => {
                return Err(Error::invalid("tolerance", tolerance, "must be above 0"));
            }
            (None, None) => self.tolerance = Some(TOLERANCE),
            _ => {}
        }
        self.iterations.get_or_insert(ITERATIONS);
        Ok(())
    }

    /// When an iteration ends.
    pub fn until(&self) -> Stop {
        let Self { iterations, tolerance, measure } = *self;
        Stop { iterations: iterations.unwrap_or(ITERATIONS), tolerance, measure }
    }
}

impl LineTime {
    /// The times of all steps.
    ///
    /// # Errors
    /// As [`Schedule::new`], with keys below `time`.
    pub fn schedule(&self) -> Result<Schedule> {
        Schedule::new(self.start, self.end, self.step, Vec::new()).map_err(|error| error.within("time"))
    }
}

impl SchwarzTable {
    /// Refuses options of another method, and fills in this one's.
    ///
    /// # Errors
    /// [`Error::Invalid`].
    pub fn resolve(&mut self, in_time: bool) -> Result<()> {
        use MethodName::{Classical, Optimal, Optimized};
        let options = [
            ("sweep", self.sweep.is_some(), Classical),
            ("linearized", self.linearized.is_some(), Classical),
            ("coarse", self.coarse.is_some(), Classical),
            ("robin", self.robin.is_some(), Optimized),
            ("integral", self.integral.is_some(), Optimal),
        ];
        if let Some((key, ..)) = options.iter().find(|(_, given, of)| *given && *of != self.method) {
            let rule = format!("is no option of the method {:?}; leave it out", self.method).to_lowercase();
            return Err(Error::invalid(*key, "given", rule));
        }
        match self.method {
            Classical => {
                let sweep = *self.sweep.get_or_insert_default();
                self.linearized.get_or_insert(false);
                let coarse = *self.coarse.get_or_insert_default();
                if coarse != Coarse::None && sweep == Sweep::Alternating {
                    let rule = "corrects all subdomains at once; set schwarz.sweep to \"parallel\"";
                    return Err(Error::invalid("coarse", format!("\"{coarse:?}\"").to_lowercase(), rule));
                }
            }
            Optimal if in_time && matches!(self.integral, Some(Integral::Trapezoid(_))) => {
                let rule = "in time there is no integral, the rest of the line is solved; leave it out, or set it to \
                            \"exact\"";
                return Err(Error::invalid("integral", "given", rule));
            }
            Optimal => {
                let integral = *self.integral.get_or_insert_default();
                if matches!(integral, Integral::Trapezoid(n) if n > MOST_PANELS) {
                    return Err(Error::invalid(
                        "integral.trapezoid",
                        format!("{integral:?}"),
                        format!("takes {MOST_PANELS} panels at most"),
                    ));
                }
                if integral == Integral::Trapezoid(0) {
                    return Err(Error::invalid("integral.trapezoid", 0, "must be 1 panel or more"));
                }
            }
            Optimized => {
                if let Robin::Value(p) = *self.robin.get_or_insert(Robin::Auto)
                    && !(p.is_finite() && p > 0.0)
                {
                    return Err(Error::invalid("robin", p, "p must be above 0, or \"auto\" or \"lagged\""));
                }
            }
        }
        Ok(())
    }

    /// The method with its options.
    pub fn method(&self) -> Method {
        match self.method {
            MethodName::Classical => Method::Classical {
                sweep: self.sweep.unwrap_or_default(),
                linearized: self.linearized.unwrap_or_default(),
                coarse: self.coarse.unwrap_or_default(),
            },
            MethodName::Optimal => match self.integral {
                Some(Integral::Trapezoid(panels)) => Method::Optimal { panels: Some(panels) },
                _ => Method::Optimal { panels: None },
            },
            MethodName::Optimized => Method::Optimized { robin: self.robin.unwrap_or(Robin::Auto) },
        }
    }

    /// The first and last node of each subdomain of a line of so many cells.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the key, where there is no node or the method cannot use them.
    pub fn ranges(&self, cells: usize) -> Result<Vec<[usize; 2]>> {
        let given = [
            ("overlap", self.overlap.is_some()),
            ("intervals", self.intervals.is_some()),
            ("cut", self.cut.is_some()),
            ("cuts", self.cuts.is_some()),
            ("subdomains", self.subdomains.is_some()),
        ];
        let given: Vec<&str> = given.into_iter().filter(|(_, given)| *given).map(|(key, _)| key).collect();
        let [key] = given[..] else {
            let ways = "the line is divided by exactly one of overlap, intervals, cut, cuts and subdomains";
            return Err(match given.get(1) {
                Some(second) => Error::invalid(*second, "given", format!("{} is too; {ways}", given[0])),
                None => Error::invalid("overlap", "not given", format!("{ways}; give one, such as [0.45, 0.55]")),
            });
        };
        if self.overlap_cells.is_some() && key != "subdomains" {
            return Err(Error::invalid("overlap_cells", "given", "goes with schwarz.subdomains only; leave it out"));
        }
        let node = |key: String, xi: f64| pieces::node(&key, xi, cells);
        let nodes = |key: String, Interval(ends): Interval| -> Result<[usize; 2]> {
            Ok([node(format!("{key}[0]"), ends[0])?, node(format!("{key}[1]"), ends[1])?])
        };
        let cut = |inner: Vec<usize>| {
            let ends = [vec![0], inner, vec![cells]].concat();
            ends.windows(2).map(|ends| [ends[0], ends[1]]).collect()
        };
        let ranges: Vec<[usize; 2]> = match self {
            Self { overlap: Some(overlap @ Interval([alpha, beta])), .. } => {
                let [first, last] = nodes("overlap".into(), *overlap)?;
                if first > last {
                    let rule = format!(
                        "the subdomains are [0, {beta}] and [{alpha}, 1], which overlap only where the first number \
                         is the lower one"
                    );
                    return Err(Error::invalid("overlap", format!("[{alpha}, {beta}]"), rule));
                }
                vec![[0, last], [first, cells]]
            }
            Self { intervals: Some(intervals), .. } => {
                let each = intervals.iter().enumerate();
                each.map(|(s, interval)| nodes(format!("intervals[{s}]"), *interval)).collect::<Result<_>>()?
            }
            Self { cut: Some(xi), .. } => cut(vec![node("cut".into(), *xi)?]),
            Self { cuts: Some(cuts), .. } => {
                let each = cuts.iter().enumerate();
                cut(each.map(|(s, xi)| node(format!("cuts[{s}]"), *xi)).collect::<Result<_>>()?)
            }
            _ => pieces::equal(cells, self.subdomains.unwrap_or(1), self.overlap_cells.unwrap_or(0))?,
        };
        pieces::check(key, &ranges, cells, self.method())?;
        Ok(ranges)
    }
}
