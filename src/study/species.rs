//! Studies of kind `stefan` with `[species]`: what they say.

use super::common::{Header, Output};
use super::data::DataTables;
use super::stefan::{FrontTime, wall_schema};
use crate::physics::{Condition, Coordinates};
use crate::setting::{Text, text};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};
use std::collections::BTreeMap;
use std::fmt;

/// A study of kind `stefan` with `[species]`: species in the phases of a line, and fronts with a law of their own.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SpeciesStudy {
    /// Name and kind of the study.
    pub study: Header,
    /// Tables of values from files, which every formula may call as functions by their names.
    #[serde(default, skip_serializing_if = "DataTables::is_empty")]
    pub data: DataTables,
    /// The line, its phases, and the fronts between them at the start.
    pub domain: SpeciesDomain,
    /// The number of cells in each phase.
    pub grid: SpeciesGrid,
    /// The species by their names, each with the phases that have it by theirs.
    pub species: BTreeMap<String, BTreeMap<String, SpeciesTable>>,
    /// How the fronts move.
    pub front: LawTable,
    /// Start, end, steps and report times of the run.
    pub time: FrontTime,
    /// What a run leaves behind in its directory.
    #[serde(default)]
    pub output: Output,
}

/// `[domain]`: the line, its phases, and the fronts between them at the start.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SpeciesDomain {
    /// What x is: a Cartesian coordinate, or the distance from an axis or a point.
    #[serde(default)]
    pub coordinates: Coordinates,
    /// x of the left wall; 0 where nothing is said. With cylindrical or spherical coordinates x = 0 is the centre,
    /// where there is no wall.
    #[serde(default = "zero")]
    pub lower: [f64; 1],
    /// x of the right wall; 1 where nothing is said.
    #[serde(default = "one")]
    pub upper: [f64; 1],
    /// Names of the phases from left to right.
    pub phases: Vec<String>,
    /// x of the fronts between them at the start.
    pub front: Vec<f64>,
}

fn zero() -> [f64; 1] {
    [0.0]
}

fn one() -> [f64; 1] {
    [1.0]
}

/// `[grid]`: the number of cells in each phase.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SpeciesGrid {
    /// Number of cells in each phase, all of one width: at least 3.
    pub cells: Vec<usize>,
}

/// `[species.NAME.PHASE]`: a species in a phase, c its concentration there.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SpeciesTable {
    /// D in σ_t = ∇·(D ∇c) + s: a formula of the concentrations in this phase by the names of their species, of x and
    /// t. "0" for a species that does not diffuse.
    #[serde(deserialize_with = "needed")]
    #[schemars(with = "Text")]
    pub diffusivity: String,
    /// σ in σ_t = ∇·(D ∇c) + s, the amount of the species per volume: a formula of the concentrations in this phase, of
    /// x and t; c where nothing is said. "0" for a species that is not stored: 0 = ∇·(D ∇c) + s then holds at every
    /// time.
    #[serde(default, deserialize_with = "text", skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Option<Text>")]
    pub storage: Option<String>,
    /// s in σ_t = ∇·(D ∇c) + s, the amount of the species that is produced per volume and time: a formula of the
    /// concentrations in this phase, of x and t; 0 where nothing is said.
    #[serde(default, deserialize_with = "text", skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Option<Text>")]
    pub source: Option<String>,
    /// c at the start, a formula of x.
    #[serde(deserialize_with = "needed")]
    #[schemars(with = "Text")]
    pub initial: String,
    /// What holds at the left end of the phase: c, a formula; "no-flux"; "outflow", no gradient, so that what the front
    /// sweeps over leaves; or `{ flux = "…" }`, the amount that enters the phase per area and time, D ∂c/∂n + σ V·n, n
    /// being the outward normal and V the velocity of this end. Formulas on a wall take the concentrations in the
    /// phase, x and t; on a front also what `front.law` takes, and the `velocity` of the front. Left out where the
    /// phase begins at x = 0 of a radius.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(schema_with = "end_schema")]
    pub left: Option<Condition>,
    /// What holds at the right end of the phase, with the same choices as `left`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(schema_with = "end_schema")]
    pub right: Option<Condition>,
}

fn needed<'de, D: Deserializer<'de>>(deserializer: D) -> Result<String, D::Error> {
    Text::deserialize(deserializer).map(|Text(text)| text)
}

fn end_schema(generator: &mut SchemaGenerator) -> Schema {
    let walls = wall_schema(generator);
    json_schema!({ "anyOf": [
        { "const": "outflow", "description": "No gradient: what a moving front sweeps over leaves the phase." },
        walls,
    ] })
}

/// `[front]`: how the fronts move.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LawTable {
    /// Velocity of the front to the right, a formula of the concentration `a_b` at the front of each species `a` in the
    /// phase `b` on either side, of its flux to the right there `a_b_flux` = −D ∂c/∂x, of x and t; one for each of
    /// several fronts.
    pub law: Laws,
}

/// The laws of the fronts from left to right.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Laws(pub Vec<String>);

impl JsonSchema for Laws {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Laws".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let formula = json_schema!({ "type": ["string", "number"] });
        json_schema!({ "anyOf": [formula, { "type": "array", "items": formula }] })
    }
}

impl Serialize for Laws {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match &self.0[..] {
            [one] => one.serialize(serializer),
            several => several.serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for Laws {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Visitor;
        impl<'de> de::Visitor<'de> for Visitor {
            type Value = Laws;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a formula, or a list of one for each front")
            }

            fn visit_str<E: de::Error>(self, text: &str) -> Result<Laws, E> {
                Ok(Laws(vec![text.into()]))
            }

            fn visit_f64<E: de::Error>(self, number: f64) -> Result<Laws, E> {
                Ok(Laws(vec![format!("{number:?}")]))
            }

            fn visit_seq<A: de::SeqAccess<'de>>(self, entries: A) -> Result<Laws, A::Error> {
                let laws = Vec::<Text>::deserialize(de::value::SeqAccessDeserializer::new(entries))?;
                Ok(Laws(laws.into_iter().map(|Text(text)| text).collect()))
            }
        }
        deserializer.deserialize_any(Visitor)
    }
}
