//! Studies of kind `stefan`: the problem that formulas or an exact solution give.

use super::mapped::parse;
use super::stefan::{Centre, ExactFront, ExactKind, PhaseTable, StefanStudy, Walls};
use crate::error::{Error, Result};
use crate::formula::Formula;
use crate::physics::Condition;
use crate::stefan::{Material, Problem, Side, Similarity};

/// What holds on the wall of a phase.
#[derive(Debug, Clone)]
pub(super) enum Wall {
    /// The temperature, of x, y and t.
    Value(Formula),
    /// What flows in, and its derivative by u: of u, x, y and t.
    Flux { value: Formula, by_u: Formula },
}

impl Wall {
    fn read(key: &str, condition: &Condition) -> Result<Self> {
        match condition {
            Condition::Value(text) => Ok(Self::Value(parse(key, text, &["x", "y", "t"])?)),
            Condition::NoFlux => Self::flux(key, "0"),
            Condition::Flux(text) => Self::flux(&format!("{key}.flux"), text),
            Condition::Outflow => {
                let rule = "nothing is carried through a wall; write \"no-flux\", a temperature or { flux = \"…\" }";
                Err(Error::invalid(key, "\"outflow\"", rule))
            }
        }
    }

    fn flux(key: &str, text: &str) -> Result<Self> {
        let value = parse(key, text, &["u", "x", "y", "t"])?;
        let by_u = value.derivative(0).map_err(|mistake| mistake.of(key, text))?;
        Ok(Self::Flux { value, by_u })
    }
}

/// What a study makes of its formulas or of its exact solution.
#[derive(Debug, Clone)]
#[allow(clippy::large_enum_variant)] // one value a run
pub(super) enum Given {
    Formulas {
        front: Formula,
        initial: [Formula; 2],
        walls: [Wall; 2],
        /// The left and the right side, where they are not insulated.
        sides: [Option<Wall>; 2],
        /// An x between them.
        middle: f64,
        melting: f64,
    },
    Exact(Similarity, f64),
}

impl Problem for Given {
    fn boundary(&self, phase: usize, [x, y]: [f64; 2], t: f64) -> f64 {
        match self {
            Self::Formulas { walls, .. } => match &walls[phase] {
                Wall::Value(formula) => formula.eval(&[x, y, t]),
                Wall::Flux { .. } => f64::NAN,
            },
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

    fn side(&self, phase: usize, [x, y]: [f64; 2], t: f64) -> f64 {
        match self.side_at(x) {
            Some(Wall::Value(formula)) => formula.eval(&[x, y, t]),
            Some(Wall::Flux { .. }) => f64::NAN,
            None => self.boundary(phase, [x, y], t),
        }
    }

    /// Where the temperatures of the side pass that of melting, by bisection.
    fn side_front(&self, x: f64, [bottom, top]: [f64; 2], t: f64) -> Option<f64> {
        let Self::Formulas { melting, .. } = self else { return self.exact_front(x, t) };
        let above = |y: f64| self.side(0, [x, y], t) - melting;
        let (mut low, mut high) = (bottom, top);
        if !(above(low) > 0.0 && above(high) <= 0.0 || above(low) >= 0.0 && above(high) < 0.0) {
            return None;
        }
        while high - low > 1e-15 * (top - bottom) {
            let middle = 0.5 * (low + high);
            if middle <= low || middle >= high {
                break;
            }
            if above(middle) > 0.0 { low = middle } else { high = middle }
        }
        Some(0.5 * (low + high))
    }

    fn side_flux(&self, side: usize, [x, y]: [f64; 2], u: f64, t: f64) -> Option<[f64; 2]> {
        let Self::Formulas { sides, .. } = self else { return None };
        match sides[side].as_ref()? {
            Wall::Value(_) => None,
            Wall::Flux { value, by_u } => Some([value, by_u].map(|formula| formula.eval(&[u, x, y, t]))),
        }
    }

    fn flux(&self, phase: usize, [x, y]: [f64; 2], u: f64, t: f64) -> Option<[f64; 2]> {
        match self {
            Self::Formulas { walls, .. } => match &walls[phase] {
                Wall::Value(_) => None,
                Wall::Flux { value, by_u } => Some([value, by_u].map(|formula| formula.eval(&[u, x, y, t]))),
            },
            Self::Exact(..) => None,
        }
    }
}

impl Given {
    /// The condition of the side at x.
    fn side_at(&self, x: f64) -> Option<&Wall> {
        let Self::Formulas { sides, middle, .. } = self else { return None };
        sides[usize::from(x > *middle)].as_ref()
    }

    /// What kind of condition the left and the right side have.
    pub(super) fn sides(&self, walls: &Walls) -> [Side; 2] {
        let kind = |side: usize| match self {
            Self::Exact(..) if walls.is(side, "exact") => Side::Given,
            Self::Exact(..) => Side::Insulated,
            Self::Formulas { sides, .. } => match &sides[side] {
                None => Side::Insulated,
                Some(Wall::Value(_)) => Side::Given,
                Some(Wall::Flux { .. }) => Side::Flux,
            },
        };
        [kind(0), kind(1)]
    }
}

impl StefanStudy {
    fn phases(&self) -> [(&'static str, &PhaseTable); 2] {
        [("lower", &self.phase.lower), ("upper", &self.phase.upper)]
    }

    /// Writes down the defaults of what conducts and melts.
    pub(super) fn complete(&mut self) {
        match self.front.latent_heat {
            Some(_) => _ = self.front.melting.get_or_insert(0.0),
            None => {
                self.front.mobility.get_or_insert(1.0);
                self.phase.lower.diffusivity.get_or_insert(1.0);
                self.phase.upper.diffusivity.get_or_insert(1.0);
            }
        }
    }

    /// What conducts and melts: by `diffusivity` and `mobility`, or by the keys of a data sheet.
    pub(super) fn material(&self) -> Result<Material> {
        let [lower, upper] = [&self.phase.lower, &self.phase.upper];
        let sheet = [
            ("phase.lower.conductivity", lower.conductivity),
            ("phase.lower.capacity", lower.capacity),
            ("phase.upper.conductivity", upper.conductivity),
            ("phase.upper.capacity", upper.capacity),
            ("front.latent_heat", self.front.latent_heat),
        ];
        let ratios = [
            ("phase.lower.diffusivity", lower.diffusivity),
            ("phase.upper.diffusivity", upper.diffusivity),
            ("front.mobility", self.front.mobility),
        ];
        let all = sheet.into_iter().chain([("front.melting", self.front.melting)]);
        let Some((first, _)) = all.into_iter().find(|(_, value)| value.is_some()) else {
            let [lower, upper, mobility] = ratios.map(|(_, value)| value.unwrap_or(1.0));
            return Material::diffusing([lower, upper], mobility);
        };
        if let Some((key, Some(value))) = ratios.into_iter().find(|(_, value)| value.is_some()) {
            let rule = format!(
                "goes not with {first}: give conductivity and capacity of both phases with front.latent_heat, or \
                 diffusivity of both with front.mobility"
            );
            return Err(Error::invalid(key, value, rule));
        }
        if let Some((key, _)) = sheet.into_iter().find(|(_, value)| value.is_none()) {
            let rule = format!(
                "{first} needs conductivity and capacity of both phases and front.latent_heat; add it, or give \
                 diffusivity and front.mobility in place of all of them"
            );
            return Err(Error::invalid(key, "not given", rule));
        }
        let [k1, c1, k0, c0, latent] = sheet.map(|(_, value)| value.unwrap_or_default());
        Material::new([k1, k0], [c1, c0], latent, self.front.melting.unwrap_or(0.0))
    }

    pub(super) fn given(&self, material: Material) -> Result<Given> {
        let phases = self.phases();
        if let Some(exact) = &self.exact {
            self.check_exact_sides()?;
            let written = |condition: &Option<Condition>| condition.as_ref().map(|_| "given".to_string());
            let quoted = |text: &Option<String>| text.as_ref().map(|text| format!("{text:?}"));
            let formulas = phases.iter().flat_map(|(name, phase)| {
                [("initial", quoted(&phase.initial)), ("boundary", written(&phase.boundary))]
                    .map(|(key, text)| (format!("phase.{name}.{key}"), text))
            });
            let all = formulas.chain([("domain.front".to_string(), quoted(&self.domain.front))]);
            if let Some((key, Some(text))) = all.into_iter().find(|(_, text)| text.is_some()) {
                let rule = "the exact solution of [exact] gives it; leave one of them out";
                return Err(Error::invalid(key, text, rule));
            }
            let (solution, start) = exact.solution(material).map_err(|error| error.within("exact"))?;
            return Ok(Given::Exact(solution, start));
        }
        let missing = |key: &str| Error::invalid(key, "not given", "add it, or an exact solution: [exact]");
        let read = |key: String, text: &Option<String>, variables: &[&str]| match text {
            Some(text) => parse(&key, text, variables),
            None => Err(missing(&key)),
        };
        let wall = |(name, phase): (&str, &PhaseTable)| {
            let key = format!("phase.{name}.boundary");
            Wall::read(&key, phase.boundary.as_ref().ok_or_else(|| missing(&key))?)
        };
        let initial =
            |(name, phase): (&str, &PhaseTable)| read(format!("phase.{name}.initial"), &phase.initial, &["x", "y"]);
        let [lower, upper] = phases;
        Ok(Given::Formulas {
            front: read("domain.front".into(), &self.domain.front, &["x"])?,
            initial: [initial(lower)?, initial(upper)?],
            walls: [wall(lower)?, wall(upper)?],
            sides: self.sides()?,
            middle: 0.5 * (self.domain.x.0[0] + self.domain.x.0[1]),
            melting: material.melting,
        })
    }

    /// The left and the right side; none of one that is insulated.
    fn sides(&self) -> Result<[Option<Wall>; 2]> {
        let read = |(key, condition): (String, &Condition)| match condition {
            Condition::NoFlux => Ok(None),
            _ if condition.value() == Some("neumann") => Ok(None),
            _ if condition.value() == Some("exact") => {
                let rule = "needs an exact solution; add [exact], or set it to \"neumann\"";
                Err(Error::invalid(key, "\"exact\"", rule))
            }
            _ => Wall::read(&key, condition).map(Some),
        };
        let [left, right] = self.walls.each()?;
        Ok([read(left)?, read(right)?])
    }

    /// Refuses conditions that an exact solution does not have.
    fn check_exact_sides(&self) -> Result<()> {
        let insulated = |condition: &Condition| *condition == Condition::NoFlux;
        let known = |condition: &Condition| matches!(condition.value(), Some("exact" | "neumann"));
        match self.walls.each()?.into_iter().find(|(_, condition)| !insulated(condition) && !known(condition)) {
            None => Ok(()),
            Some((key, _)) => {
                let rule = "with [exact] it is \"exact\" or \"neumann\"";
                Err(Error::invalid(key, "given", rule))
            }
        }
    }
}

impl ExactFront {
    /// The solution and the time at which it starts.
    fn solution(&self, material: Material) -> Result<(Similarity, f64)> {
        use ExactKind::{DiscGrowth, LineSource, Planar, PlanarGrowth};
        let given: [(&str, bool, &[ExactKind]); 7] = [
            ("wall", self.wall.is_some(), &[Planar]),
            ("start_front", self.start_front.is_some(), &[Planar, PlanarGrowth]),
            ("tilt", self.tilt.is_some(), &[Planar, PlanarGrowth]),
            ("offset", self.offset.is_some(), &[Planar, PlanarGrowth]),
            ("strength", self.strength.is_some(), &[LineSource]),
            ("start_radius", self.start_radius.is_some(), &[LineSource, DiscGrowth]),
            ("centre", self.centre.is_some(), &[LineSource, DiscGrowth]),
        ];
        if let Some((key, ..)) = given.into_iter().find(|(_, given, kinds)| *given && !kinds.contains(&self.kind)) {
            let rule = format!("kind = \"{}\" does not have it; leave it out", self.kind.name());
            return Err(Error::invalid(key, "given", rule));
        }
        let need = |key, value: Option<f64>| value.ok_or_else(|| Error::invalid(key, "not given", "add it"));
        let (tilt, offset) = (self.tilt.unwrap_or(0.0), self.offset.unwrap_or(0.0));
        let centre = || match self.centre {
            Some(Centre(centre)) => Ok(centre),
            None => Err(Error::invalid("centre", "not given", "add it")),
        };
        let solution = match self.kind {
            Planar => Similarity::planar([need("wall", self.wall)?, self.far], material, tilt, offset)?,
            LineSource => Similarity::line_source(need("strength", self.strength)?, self.far, material, centre()?)?,
            PlanarGrowth => Similarity::planar_growth(self.far, material, tilt, offset)?,
            DiscGrowth => Similarity::disc_growth(self.far, material, centre()?)?,
        };
        let (key, distance) = match self.kind {
            Planar | PlanarGrowth => ("start_front", self.start_front),
            LineSource | DiscGrowth => ("start_radius", self.start_radius),
        };
        let distance = need(key, distance)?;
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
