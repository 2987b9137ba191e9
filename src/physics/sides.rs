//! What holds on the sides of the domain for an equation given by formulas.

use super::{AXES, formula};
use crate::error::{Error, Result};
use crate::formula::Formula;
use crate::setting::Text;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::ser::SerializeMap;
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;

/// Names of the sides: the lower and the upper end of each axis.
pub(crate) const SIDES: [[&str; 2]; 2] = [["left", "right"], ["bottom", "top"]];
const NO_FLUX: &str = "no-flux";
const OUTFLOW: &str = "outflow";

/// What holds on a side for one unknown.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Condition {
    /// The value of u: a formula of place and time.
    Value(String),
    /// Nothing flows through: F·N − D ∇u·N = 0.
    NoFlux,
    /// ∇u·N = 0, and what F carries leaves.
    Outflow,
    /// What flows into the domain, D ∇u·N − F·N with N outward: a formula of the unknowns, place and time.
    Flux(String),
}

impl Condition {
    fn of(Text(text): Text) -> Self {
        match text.as_str() {
            NO_FLUX => Self::NoFlux,
            OUTFLOW => Self::Outflow,
            _ => Self::Value(text),
        }
    }

    /// The value that is given, if it is one.
    pub(crate) fn value(&self) -> Option<&str> {
        match self {
            Self::Value(text) => Some(text),
            _ => None,
        }
    }
}

/// The conditions of one unknown: one for all sides, or each by the name of its side.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Conditions {
    /// One condition for all sides.
    All(Condition),
    /// A condition for each side by its name: `left`, `right`, `bottom`, `top`.
    Each(BTreeMap<String, Condition>),
}

impl From<&str> for Conditions {
    fn from(text: &str) -> Self {
        Self::All(Condition::of(Text(text.into())))
    }
}

impl Conditions {
    /// The value that is given on all sides alike, if it is.
    pub fn value(&self) -> Option<&str> {
        match self {
            Self::All(condition) => condition.value(),
            Self::Each(_) => None,
        }
    }

    /// The values that are given, each with its side as (axis, end), or without where all sides have it.
    pub(super) fn values(&self) -> Vec<(Option<(usize, usize)>, &str)> {
        let Self::Each(each) = self else {
            return self.value().map(|text| (None, text)).into_iter().collect();
        };
        let sides = (0..SIDES.len()).flat_map(|axis| [(axis, 0), (axis, 1)]);
        let given = sides.filter_map(|side| match each.get(SIDES[side.0][side.1])? {
            Condition::Value(text) => Some((Some(side), &**text)),
            _ => None,
        });
        given.collect()
    }

    /// Refuses sides that are not there, and sides that are left out.
    ///
    /// # Errors
    /// [`Error::Invalid`] for `name`, the key of these conditions.
    pub(super) fn check<const D: usize>(&self, name: &str, periodic: [bool; D]) -> Result<()> {
        let Self::Each(each) = self else { return Ok(()) };
        let sides: Vec<&str> = (0..D).filter(|&d| !periodic[d]).flat_map(|d| SIDES[d]).collect();
        let all = sides.join(", ");
        if let Some(side) = each.keys().find(|side| !sides.contains(&side.as_str())) {
            let rule = format!("there is no such side; the sides here are {all}");
            return Err(Error::invalid(format!("boundary.{name}.{side}"), "given", rule));
        }
        match sides.iter().find(|side| !each.contains_key(**side)) {
            None => Ok(()),
            Some(side) => {
                let rule = format!("the sides here are {all}; add {side} = \"no-flux\" or another condition");
                Err(Error::invalid(format!("boundary.{name}"), format!("not given for `{side}`"), rule))
            }
        }
    }

    /// The conditions, read, for the lower and the upper end of each axis.
    ///
    /// # Errors
    /// [`Error::Formula`] where the text of a formula is wrong.
    pub(super) fn read<const D: usize>(&self, name: &str, unknowns: &[String]) -> Result<[[Open; 2]; D]> {
        let mut sides = [const { [const { Open::Closed }; 2] }; D];
        for d in 0..D {
            for end in 0..2 {
                let side = SIDES[d][end];
                let (key, condition) = match self {
                    Self::All(condition) => (format!("boundary.{name}"), Some(condition)),
                    Self::Each(each) => (format!("boundary.{name}.{side}"), each.get(side)),
                };
                sides[d][end] = match condition {
                    None | Some(Condition::NoFlux) => Open::Closed,
                    Some(Condition::Outflow) => Open::Outflow,
                    Some(Condition::Value(text)) => Open::Value(formula::<D>(&key, text).map_err(meant_a_word)?),
                    Some(Condition::Flux(text)) => Open::Flux(Flux::read::<D>(&format!("{key}.flux"), text, unknowns)?),
                };
            }
        }
        Ok(sides)
    }
}

/// A condition, ready to be evaluated.
#[derive(Debug, Clone)]
pub(super) enum Open {
    Value(Formula),
    Closed,
    Outflow,
    Flux(Flux),
}

impl Open {
    /// Whether what is given there takes time, in D dimensions.
    pub fn takes_time<const D: usize>(&self) -> bool {
        match self {
            Self::Value(formula) => formula.depends_on(D),
            Self::Flux(flux) => flux.value.depends_on(D + flux.slopes.len()),
            Self::Closed | Self::Outflow => false,
        }
    }
}

/// A flux into the domain and its derivatives by the unknowns: formulas of place, unknowns and time.
#[derive(Debug, Clone)]
pub(super) struct Flux {
    pub value: Formula,
    pub slopes: Vec<Formula>,
}

impl Flux {
    fn read<const D: usize>(key: &str, text: &str, unknowns: &[String]) -> Result<Self> {
        let names: Vec<&str> =
            AXES[..D].iter().copied().chain(unknowns.iter().map(String::as_str)).chain(["t"]).collect();
        let value = Formula::parse(text, &names).map_err(|mistake| mistake.of(key, text))?;
        let slope = |c| value.derivative(D + c).map_err(|mistake| mistake.of(key, text));
        let slopes = (0..unknowns.len()).map(slope).collect::<Result<_>>()?;
        Ok(Self { value, slopes })
    }
}

/// Adds a remedy where a formula for the sides looks like one of the words in another spelling.
fn meant_a_word(error: Error) -> Error {
    match error {
        Error::Formula { key, text, at, message, help } => {
            let word = [NO_FLUX, OUTFLOW].into_iter().find(|word| letters(&text) == letters(word));
            let help = word.map(|word| format!("write \"{word}\"")).or(help);
            Error::Formula { key, text, at, message, help }
        }
        other => other,
    }
}

fn letters(text: &str) -> String {
    text.chars().filter(char::is_ascii_alphanumeric).collect::<String>().to_ascii_lowercase()
}

impl Serialize for Condition {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Value(text) => serializer.serialize_str(text),
            Self::NoFlux => serializer.serialize_str(NO_FLUX),
            Self::Outflow => serializer.serialize_str(OUTFLOW),
            Self::Flux(text) => {
                let mut map = serializer.serialize_map(Some(1))?;
                map.serialize_entry("flux", text)?;
                map.end()
            }
        }
    }
}

impl<'de> Deserialize<'de> for Condition {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        match Conditions::deserialize(deserializer)? {
            Conditions::All(condition) => Ok(condition),
            Conditions::Each(_) => Err(de::Error::custom("expected a formula, a word, or a table { flux = \"…\" }")),
        }
    }
}

impl Serialize for Conditions {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::All(condition) => condition.serialize(serializer),
            Self::Each(each) => each.serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for Conditions {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Visitor;
        impl<'de> de::Visitor<'de> for Visitor {
            type Value = Conditions;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a formula, \"no-flux\", \"outflow\", { flux = \"…\" }, or a table of these by side")
            }

            fn visit_str<E: de::Error>(self, text: &str) -> Result<Conditions, E> {
                Ok(text.into())
            }

            fn visit_i64<E: de::Error>(self, value: i64) -> Result<Conditions, E> {
                Ok(Conditions::All(Condition::Value(value.to_string())))
            }

            fn visit_u64<E: de::Error>(self, value: u64) -> Result<Conditions, E> {
                Ok(Conditions::All(Condition::Value(value.to_string())))
            }

            fn visit_f64<E: de::Error>(self, value: f64) -> Result<Conditions, E> {
                Ok(Conditions::All(Condition::Value(format!("{value:?}"))))
            }

            fn visit_map<A: de::MapAccess<'de>>(self, mut map: A) -> Result<Conditions, A::Error> {
                let mut each = BTreeMap::new();
                while let Some(name) = map.next_key::<String>()? {
                    if name == "flux" && each.is_empty() {
                        let Text(text) = map.next_value()?;
                        return match map.next_key::<String>()? {
                            None => Ok(Conditions::All(Condition::Flux(text))),
                            Some(other) => Err(de::Error::custom(format!("unknown field `{other}`, expected `flux`"))),
                        };
                    }
                    if !SIDES.as_flattened().contains(&name.as_str()) {
                        return Err(de::Error::unknown_field(&name, &["left", "right", "bottom", "top", "flux"]));
                    }
                    each.insert(name, map.next_value()?);
                }
                Ok(Conditions::Each(each))
            }
        }
        deserializer.deserialize_any(Visitor)
    }
}

impl JsonSchema for Conditions {
    fn schema_name() -> Cow<'static, str> {
        "Conditions".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let text = generator.subschema_for::<Text>();
        let flux = json_schema!({
            "type": "object", "properties": { "flux": text }, "required": ["flux"], "additionalProperties": false,
            "description": "What flows into the domain: a formula of the unknowns, place and time."
        });
        let one = json_schema!({ "anyOf": [
            { "const": NO_FLUX, "description": "Nothing flows through." },
            { "const": OUTFLOW, "description": "No normal derivative: what the flux carries leaves." },
            text,
            flux,
        ] });
        let mut sides = Schema::default();
        SIDES.as_flattened().iter().for_each(|side| _ = sides.insert(side.to_string(), one.clone().to_value()));
        json_schema!({ "anyOf": [
            one,
            { "type": "object", "properties": sides.to_value(), "additionalProperties": false },
        ] })
    }
}
