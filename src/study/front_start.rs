//! Studies of kind `stefan`: what formulas and temperatures would make go wrong later in a run.

use super::front_given::{Given, Wall};
use super::stefan::StefanStudy;
use crate::error::{Error, Result};
use crate::stefan::{Front, FrontState, LOWER, Problem, Side, UPPER};

/// Number of moments of a run at which formulas of its walls and sides are evaluated before it begins.
const MOMENTS: usize = 512;
/// Number of columns at which formulas of walls are evaluated before a run begins.
const COLUMNS: usize = 16;
/// Temperatures on the wrong side of melting by less than this share of the largest are round-off.
const ROUNDING: f64 = 1e-9;
/// Height of a row over the width of a column above which round-off is worth a warning.
const FLAT: f64 = 1e4;

const NAMES: [&str; 2] = ["lower", "upper"];

impl Given {
    /// Whether nothing depends on x, so far as the formulas between the walls go.
    pub(super) fn is_alike(&self) -> bool {
        match self {
            Self::Formulas { sides, .. } if sides.iter().any(Option::is_some) => false,
            Self::Formulas { front, initial, walls, .. } => {
                let wall = |wall: &Wall| match wall {
                    Wall::Value(formula) => formula.depends_on(0),
                    Wall::Flux { value, .. } => value.depends_on(1),
                };
                !front.depends_on(0) && !initial.iter().any(|f| f.depends_on(0)) && !walls.iter().any(wall)
            }
            Self::Exact(solution, _) => solution.is_flat(),
        }
    }
}

/// What holds on the wall of a phase at moments of the run from `start` to `end`: its temperature, or the heat that
/// flows in at the melting temperature, with place and time.
fn over_the_run<'a>(
    front: &'a Front,
    given: &'a Given,
    phase: usize,
    [start, end]: [f64; 2],
) -> impl Iterator<Item = ([f64; 2], f64, f64)> + 'a {
    let x = front.columns.x();
    let step = x.len().div_ceil(COLUMNS);
    let place = move |i: usize| [x[i], front.columns.wall(phase)[i]];
    let moments = (0..=MOMENTS).map(move |k| start + (end - start) * k as f64 / MOMENTS as f64);
    moments.flat_map(move |t| {
        (0..x.len()).step_by(step).map(place).map(move |place| {
            let flux = given.flux(phase, place, front.material.melting, t);
            (place, t, flux.map_or_else(|| given.boundary(phase, place, t), |[flux, _]| flux))
        })
    })
}

/// Says so where columns are so narrow that the exchange between them leaves little of that along them.
pub(super) fn too_narrow(front: &Front) -> Option<String> {
    let flatness = front.columns.flatness();
    (flatness > FLAT).then(|| {
        format!(
            "rows are {flatness:.0e} times higher than columns are wide, and round-off may reach {:.0e} of the flux of \
             heat; widen domain.x, or let nothing depend on x",
            1e-12 * flatness * flatness
        )
    })
}

/// Says so where one phase fills the box, and the wall of the other one never comes beyond the melting temperature.
pub(super) fn never_appears(front: &Front, given: &Given, state: &FrontState, run: [f64; 2]) -> Option<String> {
    let phase = 1 - state.alone?;
    let flux = given.flux(phase, [front.columns.x()[0], front.columns.wall(phase)[0]], front.material.melting, run[0]);
    let warm = phase == LOWER;
    let values = over_the_run(front, given, phase, run).map(|(_, _, value)| value);
    let most = if warm { values.fold(f64::MIN, f64::max) } else { values.fold(f64::MAX, f64::min) };
    let melting = front.material.melting;
    let beyond = if warm { most > melting } else { most < melting };
    let (name, side) = (NAMES[phase], if warm { "above" } else { "below" });
    (flux.is_none() && !beyond).then(|| {
        format!(
            "the {name} phase never appears, and heat is conducted in one phase alone: `phase.{name}.boundary` comes \
             to {most} and would have to be {side} the melting temperature {melting}; give both on one scale, with \
             the warm phase below, or begin with the front between the walls"
        )
    })
}

impl StefanStudy {
    /// Refuses formulas of walls that have no finite value at some time of the run.
    pub(super) fn check_formulas(&self, front: &Front, given: &Given, run: [f64; 2]) -> Result<()> {
        let Given::Formulas { walls, .. } = given else { return Ok(()) };
        for phase in [LOWER, UPPER] {
            let lost = over_the_run(front, given, phase, run).find(|(_, _, value)| !value.is_finite());
            if let Some(([x, y], t, value)) = lost {
                let (key, text) = match &walls[phase] {
                    Wall::Value(formula) => ("boundary", formula.text()),
                    Wall::Flux { value, .. } => ("boundary.flux", value.text()),
                };
                let rule = format!("is {value} at x = {x}, y = {y}, t = {t}; it must be finite over the whole run");
                return Err(Error::invalid(format!("phase.{}.{key}", NAMES[phase]), format!("{text:?}"), rule));
            }
        }
        self.check_sides(front, given, run)
    }

    /// Refuses formulas of sides that have no finite value at some time of the run, and temperatures that leave the
    /// front no place on a side.
    fn check_sides(&self, front: &Front, given: &Given, [start, end]: [f64; 2]) -> Result<()> {
        /// Number of equal parts of a side at whose ends its formula is evaluated.
        const HEIGHTS: usize = 16;
        let (x, melting) = (front.columns.x(), front.material.melting);
        for (side, i) in
            [0, x.len() - 1].into_iter().enumerate().filter(|(side, _)| front.sides[*side] != Side::Insulated)
        {
            let walls @ [bottom, top] = [LOWER, UPPER].map(|phase| front.columns.wall(phase)[i]);
            let refused = |t: f64, said: String| {
                let key = self.walls.side(side).map_or_else(|| "walls.sides".into(), |(key, _)| key);
                Err(Error::invalid(key, "given", format!("{said} at x = {}, t = {t}", x[i])))
            };
            for t in (0..=MOMENTS).map(|k| start + (end - start) * k as f64 / MOMENTS as f64) {
                let at = |k: usize| [x[i], bottom + (top - bottom) * k as f64 / HEIGHTS as f64];
                let value = |k: usize| match given.side_flux(side, at(k), melting, t) {
                    Some([flux, _]) => flux,
                    None => given.side(LOWER, at(k), t),
                };
                if let Some(lost) = (0..=HEIGHTS).map(value).find(|value| !value.is_finite()) {
                    return refused(t, format!("is {lost}, and must be finite over the whole run,"));
                }
                if front.sides[side] == Side::Given && given.side_front(x[i], walls, t).is_none() {
                    let rule = format!("never falls through the melting temperature {melting} from bottom to top");
                    return refused(t, rule);
                }
            }
        }
        Ok(())
    }

    /// Refuses a melt so cold that what freezes cannot warm it up to melting: growth would have no finite speed.
    pub(super) fn check_undercooling(&self, front: &Front, state: &FrontState) -> Result<()> {
        let Some(melt) = front.undercooled.filter(|melt| state.alone.is_none_or(|alone| alone == *melt)) else {
            return Ok(());
        };
        let s = front.undercooling(melt, state);
        if s < 1.0 {
            return Ok(());
        }
        let name = NAMES[melt];
        let most = front.material.latent_heat / front.material.capacity[melt];
        let rule = format!(
            "is {s:.3} times latent heat over capacity, {most}, below melting: what freezes cannot warm this melt up \
             to melting, and the front would run away; raise it, or the latent heat"
        );
        let text = [&self.phase.lower, &self.phase.upper][melt].initial.clone().unwrap_or_default();
        Err(Error::invalid(format!("phase.{name}.initial"), format!("{text:?}"), rule))
    }

    /// Refuses phases that are farther on the wrong side of the melting temperature than on their own.
    pub(super) fn check_temperatures(&self, front: &Front, state: &FrontState) -> Result<()> {
        let melting = front.material.melting;
        for phase in [LOWER, UPPER].into_iter().filter(|&p| state.alone.is_none_or(|alone| alone == p)) {
            let [side, warm, wrong] = [["above", "warm", "below"], ["below", "cold", "above"]][phase];
            let own = if phase == LOWER { 1.0 } else { -1.0 };
            let farthest = |sign: f64| {
                state.u[phase].iter().copied().fold(melting, |most, u| if sign * (u - most) > 0.0 { u } else { most })
            };
            let [right, most] = [farthest(own), farthest(-own)];
            let size = state.u[phase].iter().fold(0.0_f64, |m, u| m.max(u.abs()));
            let off = (most - melting).abs();
            if front.undercooled.is_some() || off <= ROUNDING * size || off <= (right - melting).abs() {
                continue;
            }
            let name = NAMES[phase];
            let filled = if state.alone.is_some() { ", which fills the box," } else { "" };
            let rule = format!(
                "comes to {most} at the start, {wrong} the melting temperature {melting}: the {name} phase{filled} is \
                 the {warm} one, at temperatures {side} it; turn the box upside down, give all temperatures on the \
                 scale of front.melting, or set front.undercooled to true for a melt that freezes"
            );
            let text = [&self.phase.lower, &self.phase.upper][phase].initial.clone().unwrap_or_default();
            return Err(Error::invalid(format!("phase.{name}.initial"), format!("{text:?}"), rule));
        }
        Ok(())
    }
}
