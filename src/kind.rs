//! How a study names one of several kinds of a thing.

/// Declares the kinds that a seam knows: an enum over their configuration structs
///
/// A study writes `{ kind = "name", … }`; the study reader hands it on as `{ name = { … } }`, which is what the derived
/// `Deserialize` of the enum expects and which keeps the place of every mistake. `Serialize` writes the study's form.
/// `KINDS` lists names and one line each for `driftmesh list`.
macro_rules! kinds {
    ($(#[$attribute:meta])* $enum:ident { $($kind:literal = $type:ident: $line:literal),+ $(,)? }) => {
        $(#[$attribute])*
        #[allow(clippy::large_enum_variant, clippy::enum_variant_names)] // one value a study, named after its table
        #[derive(Debug, Clone, serde::Deserialize)]
        pub enum $enum {
            $(
                #[doc = $line]
                #[serde(rename = $kind)]
                $type($type),
            )+
        }

        impl $enum {
            /// Name and description of every kind.
            pub const KINDS: &'static [(&'static str, &'static str)] = &[$(($kind, $line)),+];

            /// Its name in a study.
            pub fn name(&self) -> &'static str {
                match self {
                    $(Self::$type(_) => $kind,)+
                }
            }
        }

        impl schemars::JsonSchema for $enum {
            fn schema_name() -> std::borrow::Cow<'static, str> {
                stringify!($enum).into()
            }

            fn json_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
                #[derive(schemars::JsonSchema)]
                #[schemars(tag = "kind")]
                // only its form is asked for
                #[allow(dead_code, clippy::large_enum_variant, clippy::enum_variant_names)]
                enum Tagged {
                    $(#[doc = $line] #[schemars(rename = $kind)] $type($type),)+
                }
                Tagged::json_schema(generator)
            }
        }

        impl serde::Serialize for $enum {
            fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                #[derive(serde::Serialize)]
                #[serde(tag = "kind")]
                #[allow(clippy::enum_variant_names)] // named after its tables
                enum Tagged<'a> {
                    $(#[serde(rename = $kind)] $type(&'a $type),)+
                }
                match self {
                    $(Self::$type(it) => Tagged::$type(it).serialize(serializer),)+
                }
            }
        }
    };
}

pub(crate) use kinds;
