//! Studies of kind `stefan`: what they say.

use super::LaplacianTable;
use super::common::{Header, Output};
use super::mapped::Ends;
use crate::physics::Condition;
use crate::setting::{Auto, fixed, pair};
use crate::stefan::{Filter, Method, Stepping, Transfer};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};
use std::fmt;

/// A study of kind `stefan`: two phases and the front between them.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StefanStudy {
    /// `[study]`.
    pub study: Header,
    /// `[domain]`.
    pub domain: FrontDomain,
    /// `[grid]`.
    pub grid: FrontGrid,
    /// `[phase.lower]` and `[phase.upper]`.
    #[serde(default)]
    pub phase: Phases,
    /// `[front]`.
    #[serde(default)]
    pub front: FrontTable,
    /// `[walls]`.
    #[serde(default)]
    pub walls: Walls,
    /// `[laplacian]`: the discrete Laplacian, of nine points.
    #[serde(default)]
    pub laplacian: LaplacianTable,
    /// `[exact]`: in place of the formulas of initial state, walls and front.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub exact: Option<ExactFront>,
    /// `[time]`.
    pub time: FrontTime,
    /// `[output]`.
    #[serde(default)]
    pub output: Output,
}

/// `[domain]`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FrontDomain {
    /// From the left to the right side.
    pub x: Ends,
    /// The wall below, a formula of x.
    pub bottom: String,
    /// The wall above, a formula of x.
    pub top: String,
    /// The front at the start, a formula of x; from `[exact]` where there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub front: Option<String>,
}

/// `[grid]`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FrontGrid {
    /// Cells across, in the lower and in the upper phase.
    #[serde(deserialize_with = "fixed")]
    pub cells: [usize; 3],
    /// Power by which rows are closer near the front.
    #[serde(default = "grading")]
    pub grading: f64,
}

fn grading() -> f64 {
    1.5
}

/// `[phase]`.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Phases {
    /// Below the front, warm.
    pub lower: PhaseTable,
    /// Above it, cold.
    pub upper: PhaseTable,
}

/// `[phase.lower]` or `[phase.upper]`.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PhaseTable {
    /// D; 1 where nothing is said. Goes with `mobility`, or `conductivity` and `capacity` stand in its place.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub diffusivity: Option<f64>,
    /// k of D = k/C. Goes with `capacity` and `latent_heat`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub conductivity: Option<f64>,
    /// C: heat for each volume and degree.
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

fn wall_schema(_: &mut SchemaGenerator) -> Schema {
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

/// `[front]`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct FrontTable {
    /// L, the inverse of the latent heat; 1 where nothing is said. Goes with `diffusivity`, or `latent_heat` stands in
    /// its place.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mobility: Option<f64>,
    /// Λ: heat for each volume that melts. Goes with `conductivity` and `capacity` of both phases.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub latent_heat: Option<f64>,
    /// T_m, the temperature of the front; 0 where nothing is said. Goes with `latent_heat`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub melting: Option<f64>,
    /// Whether a phase is a melt below its melting temperature, which freezes into it: the upper one if its initial
    /// temperature is below melting anywhere, else the lower one.
    pub undercooled: bool,
    /// How the front is moved.
    pub method: Method,
    /// How temperatures get to the new mesh.
    pub transfer: Transfer,
    /// Smoothing of the front's heights over neighbouring columns of the grid after every step: three weights, or
    /// "none".
    #[serde(serialize_with = "write_filter", deserialize_with = "read_filter")]
    #[schemars(schema_with = "filter_schema")]
    pub filter: Filter,
    /// How a step advances front and temperatures.
    pub stepping: Stepping,
}

impl Default for FrontTable {
    fn default() -> Self {
        Self {
            mobility: None,
            latent_heat: None,
            melting: None,
            undercooled: false,
            method: Method::default(),
            transfer: Transfer::default(),
            filter: Filter::default(),
            stepping: Stepping::default(),
        }
    }
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

/// `[walls]`.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Walls {
    /// What holds on the sides.
    pub sides: crate::stefan::Sides,
}

/// `[exact]`: an exact solution.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ExactFront {
    /// Which one.
    pub kind: ExactKind,
    /// Temperature far away, at most 0.
    pub far: f64,
    /// `planar`: temperature of the wall.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wall: Option<f64>,
    /// `planar`: distance of the front from the wall at the start.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub start_front: Option<f64>,
    /// `planar`: angle by which it rises to the right, in degrees; 0 where nothing is said.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tilt: Option<f64>,
    /// `planar`: distance of the wall from the origin; 0 where nothing is said.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub offset: Option<f64>,
    /// `line-source`: heat given off.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub strength: Option<f64>,
    /// `line-source`: distance of the front at the start.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub start_radius: Option<f64>,
    /// `line-source`: where it is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub centre: Option<Centre>,
}

/// A point.
#[derive(Debug, Clone, Copy, Serialize, Deserialize, JsonSchema)]
pub struct Centre(#[serde(deserialize_with = "pair")] pub [f64; 2]);

/// An exact solution.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ExactKind {
    /// Neumann's similarity solution.
    Planar,
    /// Melting around a line.
    LineSource,
}

/// `[time]`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FrontTime {
    /// Time of the initial state; 0 where nothing is said, and from `[exact]` where there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub start: Option<f64>,
    /// Time of the last state; or `duration`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub end: Option<f64>,
    /// From start to end.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub duration: Option<f64>,
    /// Longest step; or steps that follow the estimated error, of an explicit front half of what is stable.
    #[serde(default)]
    pub step: Auto<f64>,
    /// Times at which `summary.json` reports; the end where none are given.
    #[serde(default)]
    pub report: Vec<f64>,
}
