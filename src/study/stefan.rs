//! Studies of kind `stefan`: what they say.

use super::LaplacianTable;
use super::common::{Header, Output};
use super::data::DataTables;
use super::mapped::Ends;
use crate::error::{Error, Result};
use crate::physics::{Condition, Conditions};
use crate::setting::{Auto, fixed, pair};
use crate::simulation::Schedule;
use crate::stefan::{Filter, Method, Stepping, Transfer};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};
use std::fmt;

/// A study of kind `stefan`: two phases and the front between them.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StefanStudy {
    /// Name and kind of the study.
    pub study: Header,
    /// Tables of values from files, which every formula may call as functions by their names.
    #[serde(default, skip_serializing_if = "DataTables::is_empty")]
    pub data: DataTables,
    /// The box with its two walls, and the front at the start.
    pub domain: FrontDomain,
    /// The number of cells, and how close their rows lie near the front.
    pub grid: FrontGrid,
    /// Diffusivity, initial and wall temperatures of both phases.
    #[serde(default)]
    pub phase: Phases,
    /// How the front between the phases moves.
    #[serde(default)]
    pub front: FrontTable,
    /// What holds on the left and the right side of the box.
    #[serde(default)]
    pub walls: Walls,
    /// The discrete Laplacian of the heat equation: any kind of nine points.
    #[serde(default)]
    pub laplacian: LaplacianTable,
    /// An exact solution, which takes the place of the formulas of initial state, walls and front, and against which
    /// errors are reported.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub exact: Option<ExactFront>,
    /// Start, end, steps and report times of the run.
    pub time: FrontTime,
    /// What a run leaves behind in its directory.
    #[serde(default)]
    pub output: Output,
}

/// `[domain]`: the box with its two walls, and the front at the start.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FrontDomain {
    /// x of the left and of the right side of the box.
    pub x: Ends,
    /// The wall below, a formula of x.
    pub bottom: String,
    /// The wall above, a formula of x.
    pub top: String,
    /// The height of the front at the start, a formula of x; left out where `[exact]` gives it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub front: Option<String>,
}

/// `[grid]`: the number of cells, and how close their rows lie near the front.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FrontGrid {
    /// Number of cells across the box, in the lower phase and in the upper phase: at least 4, 3 and 3.
    #[serde(deserialize_with = "fixed")]
    pub cells: [usize; 3],
    /// How much closer rows lie near the front: the power p, from 1 to 4, of 1 − (1 − s)^p, where s is the share of the
    /// rows between the wall and the front. 1 for equal rows.
    #[serde(default = "grading")]
    pub grading: f64,
}

fn grading() -> f64 {
    1.5
}

/// `[phase]`: the two phases, below and above the front.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Phases {
    /// The phase below the front, with temperatures at or above the melting temperature 0.
    pub lower: PhaseTable,
    /// The phase above the front, with temperatures at or below the melting temperature 0.
    pub upper: PhaseTable,
}

/// `[phase.lower]` or `[phase.upper]`: one of the two phases.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PhaseTable {
    /// Thermal diffusivity D of this phase, above 0; 1 where nothing is said. Goes with `front.mobility`;
    /// `conductivity` and `capacity` may stand in its place.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub diffusivity: Option<f64>,
    /// Thermal conductivity k, with D = k/C. Goes with `capacity` and `front.latent_heat`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub conductivity: Option<f64>,
    /// Volumetric heat capacity C: heat per volume and degree. Goes with `conductivity`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub capacity: Option<f64>,
    /// Temperature at the start, a formula of x and y.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub initial: Option<String>,
    /// What holds on the wall: its temperature, a formula of x, y and t; `"no-flux"`; or `{ flux = "…" }`, what flows
    /// in, a formula of u, x, y and t.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(schema_with = "wall_schema")]
    pub boundary: Option<Condition>,
}

pub(super) fn wall_schema(_: &mut SchemaGenerator) -> Schema {
    let flux = json_schema!({
        "type": "object", "properties": { "flux": { "type": ["string", "number"] } }, "required": ["flux"],
        "additionalProperties": false, "description": "What flows in: a formula of u, x, y and t."
    });
    json_schema!({ "anyOf": [
        { "const": "no-flux", "description": "Nothing flows through." },
        { "type": ["string", "number"], "description": "The temperature: a formula of x, y and t." },
        flux,
    ] })
}

/// `[front]`: how the front between the phases moves.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct FrontTable {
    /// L in h_t = L (1 + h_x²)(D₀ ∂u₀/∂y − D₁ ∂u₁/∂y), where h is the height of the front, 0 the upper and 1 the lower
    /// phase: the inverse of the latent heat; 1 where nothing is said. Goes with `diffusivity`; `latent_heat` may stand
    /// in its place.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mobility: Option<f64>,
    /// Volumetric latent heat Λ: heat per volume that melts. Goes with `conductivity` and `capacity` of both phases.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub latent_heat: Option<f64>,
    /// Melting temperature T_m, that of the front; 0 where nothing is said. Goes with `latent_heat`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub melting: Option<f64>,
    /// Whether one of the phases is undercooled: a melt below its melting temperature, into which the front moves as it
    /// freezes. It is the upper phase if its initial temperature is below melting anywhere, else the lower one.
    pub undercooled: bool,
    /// How the front is moved: column by column as a graph over x, or by segments along their normals, as published and
    /// less accurate.
    pub method: Method,
    /// How temperatures get from the mesh of a step to the next: by a term with the velocity of the nodes ("ale"), or
    /// by interpolation along the columns, which is less accurate.
    pub transfer: Transfer,
    /// Weights `[a, b, a]` over three neighbouring columns of the grid, which smooth the velocity of the front in every
    /// step; "none" for no smoothing.
    #[serde(serialize_with = "write_filter", deserialize_with = "read_filter")]
    #[schemars(schema_with = "filter_schema")]
    pub filter: Filter,
    /// How a step advances front and temperatures: together and implicitly, of second order in time ("implicit"), or
    /// the front from the temperatures at the start of the step ("explicit", with a longest stable step).
    pub stepping: Stepping,
}

fn filter_schema(_: &mut SchemaGenerator) -> Schema {
    let weights = json_schema!({ "type": "array", "items": { "type": "number" }, "minItems": 3, "maxItems": 3 });
    json_schema!({ "anyOf": [{ "const": "none" }, weights] })
}

fn write_filter<S: Serializer>(filter: &Filter, serializer: S) -> Result<S::Ok, S::Error> {
    match filter.0 {
        Some(weights) => weights.serialize(serializer),
        None => serializer.serialize_str("none"),
    }
}

fn read_filter<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Filter, D::Error> {
    struct Visitor;
    impl<'de> de::Visitor<'de> for Visitor {
        type Value = Filter;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("three weights such as [1, 6, 1], or \"none\"")
        }

        fn visit_str<E: de::Error>(self, text: &str) -> Result<Filter, E> {
            if text == "none" { Ok(Filter(None)) } else { Err(E::invalid_value(de::Unexpected::Str(text), &self)) }
        }

        fn visit_seq<A: de::SeqAccess<'de>>(self, entries: A) -> Result<Filter, A::Error> {
            fixed(de::value::SeqAccessDeserializer::new(entries)).map(|weights| Filter(Some(weights)))
        }
    }
    deserializer.deserialize_any(Visitor)
}

/// `[walls]`: what holds on the left and the right side of the box.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Walls {
    /// What holds on the left and the right side, for both or by `left` and `right`, each of its own kind: no flux
    /// ("neumann" or "no-flux"); temperatures, a formula of x, y and t, with the front where they pass the melting
    /// temperature; `{ flux = "…" }`, what flows in, a formula of u, x, y and t; or the exact solution ("exact", only
    /// with `[exact]`).
    pub sides: Conditions,
}

impl Default for Walls {
    fn default() -> Self {
        Self { sides: "neumann".into() }
    }
}

/// Names of the sides.
const NAMES: [&str; 2] = ["left", "right"];

impl Walls {
    /// The condition of a side with its key, written as one of those of a formula.
    pub(super) fn side(&self, side: usize) -> Option<(String, &Condition)> {
        match &self.sides {
            Conditions::All(condition) => Some(("walls.sides".into(), condition)),
            Conditions::Each(each) => {
                let name = NAMES[side];
                Some((format!("walls.sides.{name}"), each.get(name)?))
            }
        }
    }

    /// The conditions of the left and the right side with their keys.
    pub(super) fn each(&self) -> Result<[(String, &Condition); 2]> {
        if let Conditions::Each(each) = &self.sides
            && let Some(side) = each.keys().find(|side| !NAMES.contains(&side.as_str()))
        {
            let rule = "there is no such side; `bottom` and `top` are `boundary` of a phase";
            return Err(Error::invalid(format!("walls.sides.{side}"), "given", rule));
        }
        let of = |side: usize| {
            self.side(side).ok_or_else(|| {
                let rule = format!("not given for `{}`", NAMES[side]);
                Error::invalid("walls.sides", rule, "needs `left` and `right`, or one condition for both")
            })
        };
        Ok([of(0)?, of(1)?])
    }

    /// Whether a side has this word.
    pub(super) fn is(&self, side: usize, word: &str) -> bool {
        self.side(side).is_some_and(|(_, condition)| condition.value() == Some(word))
    }
}

/// `[exact]`: an exact solution of the equations on both sides of a moving front.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ExactFront {
    /// Which exact solution: "planar", a flat front that moves away from a warm wall; "line-source", melting around a
    /// line that gives off heat; "planar-growth" or "disc-growth", a flat front or a disc that grows into a melt below
    /// its melting temperature.
    pub kind: ExactKind,
    /// Temperature of the upper phase far away from the front, at most that of melting.
    pub far: f64,
    /// Temperature of the warm wall, above 0. Only with `planar`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wall: Option<f64>,
    /// Distance of the front from the wall at the start. Only with `planar` and `planar-growth`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub start_front: Option<f64>,
    /// Angle by which the front rises to the right, from -60 to 60 degrees; 0 where nothing is said. Only with
    /// `planar` and `planar-growth`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tilt: Option<f64>,
    /// Distance of the wall from the origin; 0 where nothing is said. Only with `planar` and `planar-growth`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub offset: Option<f64>,
    /// Heat given off by the line source, per length and time, above 0. Only with `line-source`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub strength: Option<f64>,
    /// Distance of the front from the line source or the centre of the disc at the start. Only with `line-source` and
    /// `disc-growth`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub start_radius: Option<f64>,
    /// Place of the line source, outside the box, or of the centre of the disc, x and y. Only with `line-source` and
    /// `disc-growth`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub centre: Option<Centre>,
}

/// A point, as x and y.
#[derive(Debug, Clone, Copy, Serialize, Deserialize, JsonSchema)]
pub struct Centre(#[serde(deserialize_with = "pair")] pub [f64; 2]);

/// Which exact solution of a front between two phases.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ExactKind {
    /// Neumann's similarity solution: a flat front that moves away from a warm wall.
    Planar,
    /// Melting around a line that gives off heat.
    LineSource,
    /// A flat front that grows into a melt below its melting temperature.
    PlanarGrowth,
    /// Frank's disc, which grows into a melt below its melting temperature.
    DiscGrowth,
}

impl ExactKind {
    /// As a study writes it.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Planar => "planar",
            Self::LineSource => "line-source",
            Self::PlanarGrowth => "planar-growth",
            Self::DiscGrowth => "disc-growth",
        }
    }
}

/// `[time]`: start, end, steps and report times of the run.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FrontTime {
    /// Time of the initial state; 0 where nothing is said. Left out where `[exact]` gives it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub start: Option<f64>,
    /// Time of the last state; in its place `duration` may be given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub end: Option<f64>,
    /// Length of the run, from its start to its end; instead of `end`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub duration: Option<f64>,
    /// Longest time step. "auto" follows the estimated error; with an explicit front it takes half of the stable step.
    #[serde(default)]
    pub step: Auto<f64>,
    /// Times at which `summary.json` reports; the end where none are given.
    #[serde(default)]
    pub report: Vec<f64>,
}

impl FrontTime {
    /// The times of all steps of a run that starts at `from`.
    pub(super) fn schedule(&self, from: f64) -> Result<Schedule> {
        let Self { end, duration, step, report, .. } = self;
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
}
