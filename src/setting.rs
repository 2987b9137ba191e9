//! How a study writes a setting.

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{self, IntoDeserializer};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;

/// A setting that a study gives as a value, or leaves to the program with `"auto"`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Auto<T> {
    /// The program chooses.
    #[default]
    Auto,
    /// This value.
    Value(T),
}

impl<T: Serialize> Serialize for Auto<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Auto => serializer.serialize_str("auto"),
            Self::Value(value) => value.serialize(serializer),
        }
    }
}

/// A number or a text in a study.
pub(crate) enum Scalar<'a> {
    Text(&'a str),
    Signed(i64),
    Unsigned(u64),
    Real(f64),
}

/// Reads a number or a text. A message says what was `expected`.
pub(crate) fn scalar<'de, D: Deserializer<'de>, T>(
    deserializer: D,
    expected: &'static str,
    read: impl FnOnce(Scalar<'_>) -> Result<T, de::value::Error>,
) -> Result<T, D::Error> {
    struct Visitor<F>(&'static str, F);
    impl<T, F: FnOnce(Scalar<'_>) -> Result<T, de::value::Error>> de::Visitor<'_> for Visitor<F> {
        type Value = T;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str(self.0)
        }

        fn visit_str<E: de::Error>(self, text: &str) -> Result<T, E> {
            (self.1)(Scalar::Text(text)).map_err(E::custom)
        }

        fn visit_i64<E: de::Error>(self, value: i64) -> Result<T, E> {
            (self.1)(Scalar::Signed(value)).map_err(E::custom)
        }

        fn visit_u64<E: de::Error>(self, value: u64) -> Result<T, E> {
            (self.1)(Scalar::Unsigned(value)).map_err(E::custom)
        }

        fn visit_f64<E: de::Error>(self, value: f64) -> Result<T, E> {
            (self.1)(Scalar::Real(value)).map_err(E::custom)
        }
    }
    deserializer.deserialize_any(Visitor(expected, read))
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Auto<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        const EXPECTED: &str = "a number or \"auto\"";
        let value = scalar(deserializer, EXPECTED, |found| match found {
            Scalar::Text("auto") => Ok(None),
            Scalar::Text(text) => Err(de::Error::invalid_value(de::Unexpected::Str(text), &EXPECTED)),
            Scalar::Signed(value) => T::deserialize(value.into_deserializer()).map(Some),
            Scalar::Unsigned(value) => T::deserialize(value.into_deserializer()).map(Some),
            Scalar::Real(value) => T::deserialize(value.into_deserializer()).map(Some),
        });
        Ok(value?.map_or(Self::Auto, Self::Value))
    }
}

impl<T: JsonSchema> JsonSchema for Auto<T> {
    fn schema_name() -> Cow<'static, str> {
        format!("Auto_{}", T::schema_name()).into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        json_schema!({ "anyOf": [{ "const": "auto" }, generator.subschema_for::<T>()] })
    }
}

/// An array of exactly two entries; serde's own arrays take the first two of more.
pub(crate) fn pair<'de, D: Deserializer<'de>, T: Deserialize<'de>>(deserializer: D) -> Result<[T; 2], D::Error> {
    fixed(deserializer)
}

/// An array of exactly N entries.
pub(crate) fn fixed<'de, D: Deserializer<'de>, T: Deserialize<'de>, const N: usize>(
    deserializer: D,
) -> Result<[T; N], D::Error> {
    let entries = Vec::<T>::deserialize(deserializer)?;
    <[T; N]>::try_from(entries)
        .map_err(|entries| de::Error::custom(format!("expected an array of length {N}, found {}", entries.len())))
}

/// A formula: text, or a number in its place.
pub(crate) struct Text(pub String);

impl JsonSchema for Text {
    fn schema_name() -> Cow<'static, str> {
        "Formula".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": ["string", "number"], "description": "A formula, or a number in its place." })
    }
}

impl<'de> Deserialize<'de> for Text {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = scalar(deserializer, "a formula as a string", |found| {
            Ok(match found {
                Scalar::Text(text) => text.into(),
                Scalar::Signed(value) => value.to_string(),
                Scalar::Unsigned(value) => value.to_string(),
                Scalar::Real(value) => format!("{value:?}"),
            })
        });
        text.map(Self)
    }
}

/// A formula that may be left out.
pub(crate) fn text<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<String>, D::Error> {
    Text::deserialize(deserializer).map(|Text(text)| Some(text))
}

/// Formulas by name.
pub(crate) fn texts<'de, D: Deserializer<'de>>(deserializer: D) -> Result<BTreeMap<String, String>, D::Error> {
    let entries = BTreeMap::<String, Text>::deserialize(deserializer)?;
    Ok(entries.into_iter().map(|(name, Text(text))| (name, text)).collect())
}

/// One entry for each of D axes, which a study writes as an array of exactly so many
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Axes<T, const D: usize>(pub [T; D]);

impl<T: fmt::Debug, const D: usize> fmt::Debug for Axes<T, D> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl<T, const D: usize> std::ops::Deref for Axes<T, D> {
    type Target = [T; D];

    fn deref(&self) -> &[T; D] {
        &self.0
    }
}

impl<T, const D: usize> From<[T; D]> for Axes<T, D> {
    fn from(entries: [T; D]) -> Self {
        Self(entries)
    }
}

impl<T: Serialize, const N: usize> Serialize for Axes<T, N> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.0.as_slice().serialize(serializer)
    }
}

impl<'de, T: Deserialize<'de>, const N: usize> Deserialize<'de> for Axes<T, N> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        fixed(deserializer).map(Self)
    }
}

impl<T: JsonSchema, const D: usize> JsonSchema for Axes<T, D> {
    fn schema_name() -> Cow<'static, str> {
        format!("Axes_{}_{D}", T::schema_name()).into()
    }

    fn inline_schema() -> bool {
        true
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "array", "items": generator.subschema_for::<T>(), "minItems": D, "maxItems": D })
    }
}

/// The flux of each unknown, by its name: formulas for its components along D axes.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Fluxes<const D: usize>(pub BTreeMap<String, [String; D]>);

impl<const D: usize> std::ops::Deref for Fluxes<D> {
    type Target = BTreeMap<String, [String; D]>;

    fn deref(&self) -> &Self::Target {
        &self.0
    }
}

impl<const D: usize> Serialize for Fluxes<D> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().map(|(name, along)| (name, along.as_slice())))
    }
}

impl<'de, const N: usize> Deserialize<'de> for Fluxes<N> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let entries = BTreeMap::<String, Axes<Text, N>>::deserialize(deserializer)?;
        let texts = entries.into_iter().map(|(name, Axes(along))| (name, along.map(|Text(text)| text)));
        Ok(Self(texts.collect()))
    }
}

impl<const D: usize> JsonSchema for Fluxes<D> {
    fn schema_name() -> Cow<'static, str> {
        format!("Fluxes_{D}").into()
    }

    fn inline_schema() -> bool {
        true
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        generator.subschema_for::<BTreeMap<String, Axes<Text, D>>>()
    }
}
