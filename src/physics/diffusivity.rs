//! The diffusivity of an unknown as a study writes it.

use crate::setting::Text;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::ser::{SerializeMap, SerializeSeq};
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;

/// What multiplies the gradients of unknowns in the equation of one of them
///
/// A number or a formula in all directions; one along each axis; a tensor, row by row, D_ij ∂u/∂x_j being what flows
/// along axis i; or any of these for each unknown by whose gradient something flows, by name.
#[derive(Debug, Clone, PartialEq)]
pub enum Diffusivity {
    /// D ∇u with one D in all directions.
    Scalar(String),
    /// (D_x u_x, D_y u_y) with one D along each axis.
    Axes(Vec<String>),
    /// Σ_j D_ij u_j with a tensor, row by row.
    Tensor(Vec<Vec<String>>),
    /// A sum over unknowns by whose gradients something flows, by name.
    Cross(BTreeMap<String, Diffusivity>),
}

impl Diffusivity {
    /// The formula, where there is one for all directions.
    pub fn scalar(&self) -> Option<&str> {
        match self {
            Self::Scalar(text) => Some(text),
            _ => None,
        }
    }

    /// Whether nothing diffuses.
    pub fn is_zero(&self) -> bool {
        self.scalar() == Some("0")
    }

    /// All formulas, with their keys within this.
    pub(super) fn entries(&self) -> Vec<(String, &str)> {
        match self {
            Self::Scalar(text) => vec![(String::new(), text)],
            Self::Axes(along) => along.iter().enumerate().map(|(d, text)| (format!("[{d}]"), text.as_str())).collect(),
            Self::Tensor(rows) => {
                let row = |(i, row): (usize, &'_ Vec<String>)| -> Vec<(String, usize, usize)> {
                    (0..row.len()).map(|j| (format!("[{i}][{j}]"), i, j)).collect()
                };
                rows.iter().enumerate().flat_map(row).map(|(key, i, j)| (key, rows[i][j].as_str())).collect()
            }
            Self::Cross(by) => {
                let each = |(name, of): (&String, &Self)| -> Vec<String> {
                    of.entries().into_iter().map(|(key, _)| format!(".{name}{key}")).collect()
                };
                let keys: Vec<String> = by.iter().flat_map(each).collect();
                keys.into_iter().zip(by.values().flat_map(Self::entries).map(|(_, text)| text)).collect()
            }
        }
    }

    /// The formula of what flows along axis i, as a sum of products with the derivatives `slope(unknown, axis)` of
    /// unknowns; those of `own` where none is named. Nothing where the number of axes is not `axes`.
    pub(super) fn flow(
        &self,
        (own, i, axes): (&str, usize, usize),
        slope: &impl Fn(&str, usize) -> String,
    ) -> Option<String> {
        match self {
            Self::Scalar(text) => Some(format!("({text})*{}", slope(own, i))),
            Self::Axes(along) => (along.len() == axes).then(|| format!("({})*{}", along[i], slope(own, i))),
            Self::Tensor(rows) => {
                let square = rows.len() == axes && rows.iter().all(|row| row.len() == axes);
                let terms = || rows[i].iter().enumerate().map(|(j, text)| format!("({text})*{}", slope(own, j)));
                square.then(|| terms().collect::<Vec<_>>().join(" + "))
            }
            Self::Cross(by) => {
                let terms: Option<Vec<String>> = by.iter().map(|(name, of)| of.flow((name, i, axes), slope)).collect();
                terms.map(|terms| if terms.is_empty() { "0".into() } else { terms.join(" + ") })
            }
        }
    }

    /// The names of the unknowns by whose gradients something flows, where they are told.
    pub(super) fn names(&self) -> impl Iterator<Item = &String> {
        let by = match self {
            Self::Cross(by) => Some(by),
            _ => None,
        };
        by.into_iter().flat_map(BTreeMap::keys)
    }
}

impl From<&str> for Diffusivity {
    fn from(text: &str) -> Self {
        Self::Scalar(text.into())
    }
}

impl Serialize for Diffusivity {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Scalar(text) => serializer.serialize_str(text),
            Self::Axes(along) => along.serialize(serializer),
            Self::Tensor(rows) => {
                let mut seq = serializer.serialize_seq(Some(rows.len()))?;
                rows.iter().try_for_each(|row| seq.serialize_element(row))?;
                seq.end()
            }
            Self::Cross(by) => {
                let mut map = serializer.serialize_map(Some(by.len()))?;
                by.iter().try_for_each(|(name, of)| map.serialize_entry(name, of))?;
                map.end()
            }
        }
    }
}

impl<'de> Deserialize<'de> for Diffusivity {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Visitor;
        impl<'de> de::Visitor<'de> for Visitor {
            type Value = Diffusivity;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(
                    "a formula, one for each axis, a tensor as rows of formulas, or a table of these by unknown",
                )
            }

            fn visit_str<E: de::Error>(self, text: &str) -> Result<Diffusivity, E> {
                Ok(text.into())
            }

            fn visit_i64<E: de::Error>(self, value: i64) -> Result<Diffusivity, E> {
                Ok(Diffusivity::Scalar(value.to_string()))
            }

            fn visit_u64<E: de::Error>(self, value: u64) -> Result<Diffusivity, E> {
                Ok(Diffusivity::Scalar(value.to_string()))
            }

            fn visit_f64<E: de::Error>(self, value: f64) -> Result<Diffusivity, E> {
                Ok(Diffusivity::Scalar(format!("{value:?}")))
            }

            fn visit_seq<A: de::SeqAccess<'de>>(self, mut seq: A) -> Result<Diffusivity, A::Error> {
                let (mut along, mut rows) = (Vec::new(), Vec::new());
                while let Some(entry) = seq.next_element::<Diffusivity>()? {
                    match entry {
                        Diffusivity::Scalar(text) if rows.is_empty() => along.push(text),
                        Diffusivity::Axes(row) if along.is_empty() => rows.push(row),
                        _ => return Err(de::Error::custom("expected formulas, or rows of formulas")),
                    }
                }
                Ok(if rows.is_empty() { Diffusivity::Axes(along) } else { Diffusivity::Tensor(rows) })
            }

            fn visit_map<A: de::MapAccess<'de>>(self, mut map: A) -> Result<Diffusivity, A::Error> {
                let mut by = BTreeMap::new();
                while let Some((name, of)) = map.next_entry::<String, Diffusivity>()? {
                    if matches!(of, Diffusivity::Cross(_)) {
                        return Err(de::Error::custom("expected a formula, one for each axis, or rows of formulas"));
                    }
                    by.insert(name, of);
                }
                Ok(Diffusivity::Cross(by))
            }
        }
        deserializer.deserialize_any(Visitor)
    }
}

impl JsonSchema for Diffusivity {
    fn schema_name() -> Cow<'static, str> {
        "Diffusivity".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let text = generator.subschema_for::<Text>();
        let own = json_schema!({ "anyOf": [
            text,
            { "type": "array", "items": text, "description": "One along each axis." },
            { "type": "array", "items": { "type": "array", "items": text }, "description": "A tensor, row by row." },
        ] });
        json_schema!({ "anyOf": [
            own,
            { "type": "object", "additionalProperties": own, "description": "By the unknown whose gradient acts." },
        ] })
    }
}
