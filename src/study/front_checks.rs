//! Studies of kind `stefan`: what is refused, what is doubtful, and what runs.

use super::common::StudyKind;
use super::front_given::Given;
use super::front_run::{FrontRun, TwoPhase};
use super::front_start;
use super::kind::{Kind, common_tables};
use super::mapped::{Ends, check_between, parse};
use super::stefan::{ExactKind, StefanStudy};
use super::time_loop::FrontCourse;
use crate::error::{Error, Failure, Result};
use crate::laplacian::Laplacian;
use crate::simulation::Schedule;
use crate::stefan::{Columns, Front, FrontState, INITIAL, LOWER, Problem, Side, UPPER};

/// Bytes of memory that a run needs for each node: nodal arrays, the sparse matrix and its factors.
const BYTES_PER_NODE: u128 = 6000;
/// Differences above this share of the largest value are not made of rounding.
const NOT_ROUNDING: f64 = 1e-9;

impl Kind for StefanStudy {
    type Run = FrontRun;

    const KIND: StudyKind = StudyKind::Stefan;

    common_tables!();

    /// Refuses a start that no run can begin with, too.
    fn resolve(&mut self) -> Result<()> {
        self.begin()?;
        self.complete();
        Ok(())
    }

    fn memory(&self) -> u128 {
        let [across, lower, upper] = self.grid.cells.map(|n| n as u128 + 1);
        across * (lower + upper) * BYTES_PER_NODE
    }

    fn warnings(&self) -> Result<Vec<String>> {
        let FrontRun { problem: TwoPhase { front, given }, course: FrontCourse { state, .. }, .. } = &self.begin()?;
        if let Given::Exact(..) = given {
            return Ok(self.crosses_walls(front, given, state).into_iter().collect());
        }
        let schedule = self.schedule(given)?;
        let run = [schedule.start(), schedule.end()];
        let mut warnings: Vec<String> = front_start::too_narrow(front)
            .into_iter()
            .chain(front_start::never_appears(front, given, state, run))
            .collect();
        for (phase, name) in [(LOWER, "lower"), (UPPER, "upper")] {
            let columns = front.columns.x().iter().zip(&state.front).zip(front.columns.wall(phase));
            let (mut on_front, mut on_wall) = ((0.0_f64, 0.0), (0.0_f64, 0.0));
            for ((&x, &h), &wall) in columns {
                let off = (given.initial(phase, [x, h]) - front.material.melting).abs();
                let gap = match given.flux(phase, [x, wall], 0.0, state.t) {
                    Some(_) => 0.0,
                    None => (given.initial(phase, [x, wall]) - given.boundary(phase, [x, wall], state.t)).abs(),
                };
                on_front = if off > on_front.0 { (off, x) } else { on_front };
                on_wall = if gap > on_wall.0 { (gap, x) } else { on_wall };
            }
            let size = state.u[phase].iter().fold(0.0_f64, |m, u| m.max(u.abs()));
            if on_front.0 > NOT_ROUNDING * size && state.alone.is_none() {
                let (off, x) = on_front;
                let melting = front.material.melting;
                let said = format!("`phase.{name}.initial` is not {melting} on the front: off by {off:.1e} at x = {x}");
                warnings.push(said);
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
        let mut front = Front::new(columns, self.material()?);
        self.front.filter.check().map_err(|error| error.within("front"))?;
        front.method = self.front.method;
        front.transfer = self.front.transfer;
        front.filter = self.front.filter;
        front.stepping = self.front.stepping;
        front.laplacian = self.laplacian.laplacian()?;
        if front.laplacian == Laplacian::Compact25 {
            let rule = "its 25 points reach across the front; take another kind";
            return Err(Error::invalid("laplacian.kind", "\"compact25\"", rule));
        }
        let given = self.given(front.material)?;
        front.sides = given.sides(&self.walls);
        let schedule = self.schedule(&given).map_err(|error| error.within("time"))?;
        if let Given::Exact(solution, _) = &given
            && let Some([cx, cy]) = solution.source()
            && (x[0]..=x[1]).contains(&cx)
            && (bottom.eval(&[cx])..=top.eval(&[cx])).contains(&cy)
        {
            let rule = "the temperature is infinite there, inside the box; move it below bottom or beyond the sides";
            return Err(Error::invalid("exact.centre", format!("[{cx}, {cy}]"), rule));
        }
        front.undercooled = self.undercooled(&front, &given)?;
        if !walls.iter().any(|wall| wall.depends_on(0)) && given.is_alike() {
            front.columns.alike();
        }
        self.check_formulas(&front, &given, [schedule.start(), schedule.end()])?;
        let state = front.start(&given, schedule.start()).map_err(|error| self.blame(error))?;
        self.check_temperatures(&front, &state)?;
        self.check_undercooling(&front, &state)?;
        let frames = self.output.frames_of(&schedule)?;
        self.output.check()?;
        Ok(FrontRun::of(&self.study.name, TwoPhase { front, given }, (state, schedule), frames))
    }
}

impl StefanStudy {
    /// The phase that is an undercooled melt, where `front.undercooled` says that there is one.
    fn undercooled(&self, front: &Front, given: &Given) -> Result<Option<usize>> {
        let grows = |kind| matches!(kind, ExactKind::PlanarGrowth | ExactKind::DiscGrowth);
        if !self.front.undercooled {
            return match self.exact.as_ref().filter(|exact| grows(exact.kind)) {
                None => Ok(None),
                Some(_) => {
                    let rule = "the exact solution grows into a melt below its melting temperature; set it to true";
                    Err(Error::invalid("front.undercooled", false, rule))
                }
            };
        }
        let cold = |phase: usize| {
            let places = front.columns.x().iter().zip(front.columns.wall(phase)).flat_map(|(&x, &wall)| {
                let h = given.initial_front(x);
                (1..=8).map(move |k| [x, h + (wall - h) * f64::from(k) / 8.0])
            });
            places.into_iter().any(|place| given.initial(phase, place) < front.material.melting)
        };
        match [UPPER, LOWER].into_iter().find(|&phase| cold(phase)) {
            Some(phase) => Ok(Some(phase)),
            None => {
                let rule = "no phase is below the melting temperature at the start; leave it out";
                Err(Error::invalid("front.undercooled", true, rule))
            }
        }
    }

    fn schedule(&self, given: &Given) -> Result<Schedule> {
        let from = match (given, self.time.start) {
            (Given::Exact(_, _), Some(start)) => {
                let rule = "the exact solution of [exact] starts at a time of its own; leave this out";
                return Err(Error::invalid("start", start, rule));
            }
            (Given::Exact(_, start), None) => *start,
            (Given::Formulas { .. }, start) => start.unwrap_or(0.0),
        };
        self.time.schedule(from)
    }

    /// Says which setting makes a start that no run can begin with.
    fn blame(&self, error: Error) -> Error {
        let Error::Failed { failure, .. } = &error else { return error };
        let key = match (failure, self.exact.as_ref().map(|exact| exact.kind)) {
            (Failure::WrongSide { .. }, None) => "phase.lower.initial",
            (Failure::NonFinite { what, .. }, None) if *what == INITIAL[LOWER] => "phase.lower.initial",
            (Failure::NonFinite { what, .. }, None) if *what == INITIAL[UPPER] => "phase.upper.initial",
            (_, None) => "domain.front",
            (_, Some(ExactKind::Planar | ExactKind::PlanarGrowth)) => "exact.start_front",
            (_, Some(ExactKind::LineSource | ExactKind::DiscGrowth)) => "exact.start_radius",
        };
        let table = toml::Table::try_from(self).unwrap_or_default();
        let present = key.split('.').try_fold(toml::Value::Table(table), |value, part| value.get(part).cloned());
        let value = present.map_or("not given".into(), |value| value.to_string());
        let help = match failure {
            Failure::FrontOutside { .. } | Failure::VanishingPhase { .. } => {
                "begin between the walls, or with the front on one of them everywhere".into()
            }
            _ => self.remedy(&error).unwrap_or_default(),
        };
        Error::invalid(key, value, format!("{failure}; {help}"))
    }

    /// Says so where an exact solution flows through sides that are insulated.
    fn crosses_walls(&self, front: &Front, given: &Given, state: &FrontState) -> Option<String> {
        /// Step of the difference quotient at a side, as a share of the width of the box.
        const STEP: f64 = 1e-6;
        /// Normal derivative at a side times the width of the box, as a share of the range, above which a run warns.
        const NOTICEABLE: f64 = 1e-3;
        let x = front.columns.x();
        let width = x[x.len() - 1] - x[0];
        let all = || state.u.iter().flatten();
        let range = all().fold(f64::MIN, |m, u| m.max(*u)) - all().fold(f64::MAX, |m, u| m.min(*u));
        let ends = [(0, STEP), (x.len() - 1, -STEP)].into_iter().zip(front.sides);
        let insulated = ends.filter(|(_, side)| *side == Side::Insulated).map(|(end, _)| end);
        let places = insulated.flat_map(|(i, step)| {
            let walls = [LOWER, UPPER].map(|phase| front.columns.wall(phase)[i]);
            [walls[0], state.front[i], walls[1]].map(|y| ([x[i], y], step * width))
        });
        let flow = places.filter_map(|([x, y], step)| {
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
