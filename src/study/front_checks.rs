//! Studies of kind `stefan`: what is refused, what is doubtful, and what runs.

use super::common::{Header, Output, StudyKind};
use super::front_run::{FrontCourse, FrontRun};
use super::kind::Kind;
use super::mapped::{Ends, check_between, parse};
use super::stefan::{Centre, ExactFront, ExactKind, FrontTime, PhaseTable, StefanStudy};
use crate::error::{Error, Failure, Result};
use crate::formula::Formula;
use crate::laplacian::Laplacian;
use crate::setting::Auto;
use crate::simulation::Schedule;
use crate::stefan::{Columns, Front, FrontState, INITIAL, LOWER, Problem, Sides, Similarity, UPPER};

/// Bytes of memory that a run needs for each node: nodal arrays, the sparse matrix and its factors.
const BYTES_PER_NODE: u128 = 6000;
/// Differences above this share of the largest value are not made of rounding.
const NOT_ROUNDING: f64 = 1e-9;

impl Kind for StefanStudy {
    type Run = FrontRun;

    const KIND: StudyKind = StudyKind::Stefan;

    fn common(&self) -> (&Header, &Output) {
        (&self.study, &self.output)
    }

    /// Refuses a start that no run can begin with, too.
    fn resolve(&mut self) -> Result<()> {
        self.begin().map(|_| ())
    }

    fn memory(&self) -> u128 {
        let [across, lower, upper] = self.grid.cells.map(|n| n as u128 + 1);
        across * (lower + upper) * BYTES_PER_NODE
    }

    fn warnings(&self) -> Result<Vec<String>> {
        let FrontRun { front, given, course: FrontCourse { state, .. }, .. } = &self.begin()?;
        if let Given::Exact(..) = given {
            return Ok(self.crosses_walls(front, given, state).into_iter().collect());
        }
        let mut warnings = Vec::new();
        for (phase, name) in [(LOWER, "lower"), (UPPER, "upper")] {
            let columns = front.columns.x().iter().zip(&state.front).zip(front.columns.wall(phase));
            let (mut on_front, mut on_wall) = ((0.0_f64, 0.0), (0.0_f64, 0.0));
            for ((&x, &h), &wall) in columns {
                let off = given.initial(phase, [x, h]).abs();
                let gap = (given.initial(phase, [x, wall]) - given.boundary(phase, [x, wall], state.t)).abs();
                on_front = if off > on_front.0 { (off, x) } else { on_front };
                on_wall = if gap > on_wall.0 { (gap, x) } else { on_wall };
            }
            let size = state.u[phase].iter().fold(0.0_f64, |m, u| m.max(u.abs()));
            if on_front.0 > NOT_ROUNDING * size {
                let (off, x) = on_front;
                warnings.push(format!("`phase.{name}.initial` is not 0 on the front: off by {off:.1e} at x = {x}"));
            }
            if on_wall.0 > NOT_ROUNDING * size {
                let (gap, x) = on_wall;
                warnings.push(format!(
                    "`phase.{name}.boundary` is not `phase.{name}.initial` at the start: they differ by {gap:.1e} at \
                     x = {x}"
                ));
            }
        }
        Ok(warnings)
    }

    fn begin(&self) -> Result<FrontRun> {
        self.study.check_name()?;
        let Ends(x) = self.domain.x;
        let wall = |key: &str, text: &str| parse(&format!("domain.{key}"), text, &["x"]);
        let walls = [wall("bottom", &self.domain.bottom)?, wall("top", &self.domain.top)?];
        check_between(x, &walls).map_err(|error| error.within("domain"))?;
        let nodes = self.memory() / BYTES_PER_NODE;
        super::memory::check_memory(nodes, BYTES_PER_NODE, &self.grid.cells)?;
        let [bottom, top] = &walls;
        let columns =
            Columns::new(x, [&|x| bottom.eval(&[x]), &|x| top.eval(&[x])], self.grid.cells, self.grid.grading)
                .map_err(|error| error.within("grid"))?;
        let diffusivity = [self.phase.lower.diffusivity, self.phase.upper.diffusivity];
        let mut front = Front::new(columns, diffusivity, self.front.mobility)?;
        self.front.filter.check().map_err(|error| error.within("front"))?;
        front.method = self.front.method;
        front.transfer = self.front.transfer;
        front.filter = self.front.filter;
        front.stepping = self.front.stepping;
        front.sides = self.walls.sides;
        front.laplacian = self.laplacian.laplacian()?;
        if front.laplacian == Laplacian::Compact25 {
            let rule = "its 25 points reach across the front; take another kind";
            return Err(Error::invalid("laplacian.kind", "\"compact25\"", rule));
        }
        let given = self.given()?;
        let schedule = self.schedule(&given).map_err(|error| error.within("time"))?;
        if let Given::Exact(solution, _) = &given
            && let Some([cx, cy]) = solution.source()
            && (x[0]..=x[1]).contains(&cx)
            && (bottom.eval(&[cx])..=top.eval(&[cx])).contains(&cy)
        {
            let rule = "the temperature is infinite there, inside the box; move it below bottom or beyond the sides";
            return Err(Error::invalid("exact.centre", format!("[{cx}, {cy}]"), rule));
        }
        let state = front.start(&given, schedule.start()).map_err(|error| self.blame(error))?;
        let frames = self.output.frames_of(&schedule)?;
        self.output.check()?;
        Ok(FrontRun::of(&self.study.name, front, given, (state, schedule), frames))
    }
}

impl StefanStudy {
    fn given(&self) -> Result<Given> {
        let phases = [("lower", &self.phase.lower), ("upper", &self.phase.upper)];
        if let Some(exact) = &self.exact {
            let formulas = phases.iter().flat_map(|(name, phase)| {
                [("initial", &phase.initial), ("boundary", &phase.boundary)]
                    .map(|(key, text)| (format!("phase.{name}.{key}"), text))
            });
            let all = formulas.chain([("domain.front".to_string(), &self.domain.front)]);
            if let Some((key, Some(text))) = all.into_iter().find(|(_, text)| text.is_some()) {
                let rule = "the exact solution of [exact] gives it; leave one of them out";
                return Err(Error::invalid(key, format!("{text:?}"), rule));
            }
            let diffusivity = phases.map(|(_, phase)| phase.diffusivity);
            let (solution, start) =
                exact.solution(diffusivity, self.front.mobility).map_err(|error| error.within("exact"))?;
            return Ok(Given::Exact(solution, start));
        }
        if self.walls.sides == crate::stefan::Sides::Exact {
            let rule = "needs an exact solution; add [exact], or set it to \"neumann\"";
            return Err(Error::invalid("walls.sides", "\"exact\"", rule));
        }
        let read = |key: String, text: &Option<String>, variables: &[&str]| match text {
            Some(text) => parse(&key, text, variables),
            None => Err(Error::invalid(key, "not given", "add it, or an exact solution: [exact]")),
        };
        let both =
            |key: &str, take: &dyn Fn(&PhaseTable) -> Option<String>, variables: &[&str]| -> Result<[Formula; 2]> {
                let [lower, upper] =
                    phases.map(|(name, phase)| read(format!("phase.{name}.{key}"), &take(phase), variables));
                Ok([lower?, upper?])
            };
        Ok(Given::Formulas {
            front: read("domain.front".into(), &self.domain.front, &["x"])?,
            initial: both("initial", &|phase| phase.initial.clone(), &["x", "y"])?,
            boundary: both("boundary", &|phase| phase.boundary.clone(), &["x", "y", "t"])?,
        })
    }

    fn schedule(&self, given: &Given) -> Result<Schedule> {
        let FrontTime { start, end, duration, step, report } = &self.time;
        let from = match (given, start) {
            (Given::Exact(_, _), Some(start)) => {
                let rule = "the exact solution of [exact] starts at a time of its own; leave this out";
                return Err(Error::invalid("start", start, rule));
            }
            (Given::Exact(_, start), None) => *start,
            (Given::Formulas { .. }, start) => start.unwrap_or(0.0),
        };
        let to = match (end, duration) {
            (Some(end), None) => *end,
            (None, Some(duration)) if *duration > 0.0 && duration.is_finite() => from + duration,
            (None, Some(duration)) => return Err(Error::invalid("duration", duration, "must be above 0")),
            (None, None) => return Err(Error::invalid("end", "not given", "give one of end and duration")),
            (Some(_), Some(duration)) => {
                return Err(Error::invalid("duration", duration, "goes not with end; leave one of them out"));
            }
        };
        let report = if report.is_empty() { vec![to] } else { report.clone() };
        match *step {
            Auto::Value(step) => Schedule::new(from, to, step, report),
            Auto::Auto => Schedule::automatic(from, to, report),
        }
    }

    /// Says which setting makes a start that no run can begin with.
    fn blame(&self, error: Error) -> Error {
        let Error::Failed { failure, .. } = &error else { return error };
        let key = match (failure, self.exact.as_ref().map(|exact| exact.kind)) {
            (Failure::WrongSide { .. }, None) => "phase.lower.initial",
            (Failure::NonFinite { what, .. }, None) if *what == INITIAL[LOWER] => "phase.lower.initial",
            (Failure::NonFinite { what, .. }, None) if *what == INITIAL[UPPER] => "phase.upper.initial",
            (_, None) => "domain.front",
            (_, Some(ExactKind::Planar)) => "exact.start_front",
            (_, Some(ExactKind::LineSource)) => "exact.start_radius",
        };
        let table = toml::Table::try_from(self).unwrap_or_default();
        let present = key.split('.').try_fold(toml::Value::Table(table), |value, part| value.get(part).cloned());
        let value = present.map_or("not given".into(), |value| value.to_string());
        let help = self.remedy(&error).unwrap_or_default();
        Error::invalid(key, value, format!("{failure}; {help}"))
    }

    /// Says so where an exact solution flows through sides that are insulated.
    fn crosses_walls(&self, front: &Front, given: &Given, state: &FrontState) -> Option<String> {
        const STEP: f64 = 1e-6;
        const NOTICEABLE: f64 = 1e-3;
        if self.walls.sides != Sides::Neumann {
            return None;
        }
        let x = front.columns.x();
        let width = x[x.len() - 1] - x[0];
        let all = || state.u.iter().flatten();
        let range = all().fold(f64::MIN, |m, u| m.max(*u)) - all().fold(f64::MAX, |m, u| m.min(*u));
        let sides = [(0, STEP), (x.len() - 1, -STEP)].into_iter().flat_map(|(i, step)| {
            let walls = [LOWER, UPPER].map(|phase| front.columns.wall(phase)[i]);
            [walls[0], state.front[i], walls[1]].map(|y| ([x[i], y], step * width))
        });
        let flow = sides.filter_map(|([x, y], step)| {
            let slope = (given.exact([x + step, y], state.t)? - given.exact([x, y], state.t)?) / step;
            Some((slope * width).abs())
        });
        let share = flow.fold(0.0, f64::max) / range;
        (share > NOTICEABLE).then(|| {
            format!(
                "the exact solution flows through the sides, which are insulated: over the width it changes by \
                 {share:.1e} of its range \
                 there, and errors are against another problem; set walls.sides to \"exact\""
            )
        })
    }
}

/// What a study makes of its formulas or of its exact solution.
#[derive(Debug, Clone)]
#[allow(clippy::large_enum_variant)] // one value a run
pub(super) enum Given {
    Formulas { front: Formula, initial: [Formula; 2], boundary: [Formula; 2] },
    Exact(Similarity, f64),
}

impl Problem for Given {
    fn boundary(&self, phase: usize, [x, y]: [f64; 2], t: f64) -> f64 {
        match self {
            Self::Formulas { boundary, .. } => boundary[phase].eval(&[x, y, t]),
            Self::Exact(solution, _) => solution.temperature([x, y], t),
        }
    }

    fn initial(&self, phase: usize, x: [f64; 2]) -> f64 {
        match self {
            Self::Formulas { initial, .. } => initial[phase].eval(&x),
            Self::Exact(solution, start) => solution.temperature(x, *start),
        }
    }

    fn initial_front(&self, x: f64) -> f64 {
        match self {
            Self::Formulas { front, .. } => front.eval(&[x]),
            Self::Exact(solution, start) => solution.height(x, *start),
        }
    }

    fn exact_front(&self, x: f64, t: f64) -> Option<f64> {
        match self {
            Self::Formulas { .. } => None,
            Self::Exact(solution, _) => Some(solution.height(x, t)),
        }
    }

    fn exact(&self, x: [f64; 2], t: f64) -> Option<f64> {
        match self {
            Self::Formulas { .. } => None,
            Self::Exact(solution, _) => Some(solution.temperature(x, t)),
        }
    }
}

impl ExactFront {
    /// The solution and the time at which it starts.
    fn solution(&self, diffusivity: [f64; 2], mobility: f64) -> Result<(Similarity, f64)> {
        let planar = self.kind == ExactKind::Planar;
        let given = [
            ("wall", self.wall.is_some(), true),
            ("start_front", self.start_front.is_some(), true),
            ("tilt", self.tilt.is_some(), true),
            ("offset", self.offset.is_some(), true),
            ("strength", self.strength.is_some(), false),
            ("start_radius", self.start_radius.is_some(), false),
            ("centre", self.centre.is_some(), false),
        ];
        if let Some((key, ..)) = given.into_iter().find(|&(_, given, of_planar)| given && of_planar != planar) {
            let kind = if planar { "planar" } else { "line-source" };
            return Err(Error::invalid(key, "given", format!("kind = \"{kind}\" does not have it; leave it out")));
        }
        let need = |key, value: Option<f64>| value.ok_or_else(|| Error::invalid(key, "not given", "add it"));
        let (key, distance, solution) = match self.kind {
            ExactKind::Planar => {
                let (wall, start) = (need("wall", self.wall)?, need("start_front", self.start_front)?);
                let (tilt, offset) = (self.tilt.unwrap_or(0.0), self.offset.unwrap_or(0.0));
                ("start_front", start, Similarity::planar([wall, self.far], diffusivity, mobility, tilt, offset)?)
            }
            ExactKind::LineSource => {
                let (strength, start) = (need("strength", self.strength)?, need("start_radius", self.start_radius)?);
                let Centre(centre) = self.centre.ok_or_else(|| Error::invalid("centre", "not given", "add it"))?;
                ("start_radius", start, Similarity::line_source(strength, self.far, diffusivity, mobility, centre)?)
            }
        };
        if !(distance > 0.0 && distance.is_finite()) {
            return Err(Error::invalid(key, distance, "must be above 0"));
        }
        let start = solution.time(distance);
        if !start.is_normal() {
            return Err(Error::invalid(key, distance, format!("is where the front is at t = {start:e}, out of range")));
        }
        Ok((solution, start))
    }
}
