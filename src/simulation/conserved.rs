//! What a run keeps: the integrals of its unknowns, and how far they drift.

use crate::geometry::{Cells, Field, Mesh};
use crate::numerics::larger;
use crate::physics::Physics;
use serde::{Deserialize, Serialize};

/// What a conservative scheme keeps, up to what flows through the sides
///
/// `summary.json` has `mass` and `drift` of the first unknown, and beside them those of each unknown under its name. An
/// unknown that is itself called `mass` or `drift` is there as `unknown mass` or `unknown drift`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Conserved {
    /// The integral ∫u dA of the first unknown.
    pub mass: f64,
    /// Change of `mass` since the start, over its size there (the change itself where it was 0 but for rounding).
    pub drift: f64,
    /// Integral and drift of each unknown by name, in the order of the unknowns.
    #[serde(flatten, with = "by_name")]
    pub unknowns: Vec<(String, Amount)>,
}

/// How much there is of an unknown.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Amount {
    /// The integral of the unknown.
    pub mass: f64,
    /// Change of `mass` since the start, over its size there (the change itself where it was 0 but for rounding).
    pub drift: f64,
}

/// An integral at the start is made of rounding where it is below this share of the largest value times the area of the
/// box.
const ROUNDING: f64 = 1e-12;

/// Integrals at the start of a run, and the largest value of each unknown there.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct AtStart {
    masses: Vec<f64>,
    largest: Vec<f64>,
}

impl AtStart {
    pub fn of<const D: usize>(physics: &dyn Physics<D>, mesh: &Mesh<D>, u: &Field) -> Self
    where
        Mesh<D>: Cells<D>,
    {
        Self { masses: physics.integrals(mesh, u), largest: largest_of(u) }
    }

    /// True where a run of this number of unknowns can have begun so.
    pub fn is_sound(&self, unknowns: usize) -> bool {
        let Self { masses, largest } = self;
        [masses.len(), largest.len()] == [unknowns; 2] && masses.iter().chain(largest).all(|value| value.is_finite())
    }

    /// The integrals now, and how far they have drifted since the start.
    pub fn conserved<const D: usize>(&self, physics: &dyn Physics<D>, mesh: &Mesh<D>, u: &Field) -> Conserved
    where
        Mesh<D>: Cells<D>,
    {
        let area = mesh.volume();
        let amount = |c: usize, mass: f64, now: f64| {
            let began = self.masses[c];
            // an integral that began with nothing but rounding is no measure
            let measures = began.abs() > ROUNDING * area * now.max(self.largest[c]);
            Amount { mass, drift: (mass - began) / if measures { began.abs() } else { 1.0 } }
        };
        let each = physics.integrals(mesh, u).into_iter().zip(largest_of(u)).enumerate();
        let amounts: Vec<Amount> = each.map(|(c, (mass, now))| amount(c, mass, now)).collect();
        let Amount { mass, drift } = amounts[0];
        let unknowns = physics.unknowns().into_iter().map(key).zip(amounts).collect();
        Conserved { mass, drift, unknowns }
    }
}

/// The largest size of each unknown.
fn largest_of(u: &Field) -> Vec<f64> {
    (0..u.components()).map(|c| u.component(c).fold(0.0, |m, u| larger(m, u.abs()))).collect()
}

/// Under which key an unknown stands beside `mass` and `drift`.
fn key(name: String) -> String {
    if ["mass", "drift"].contains(&name.as_str()) { format!("unknown {name}") } else { name }
}

/// Pairs of a name and a value as entries of a map, in their order.
mod by_name {
    use super::Amount;
    use serde::de::{Deserializer, MapAccess, Visitor};
    use serde::ser::{SerializeMap, Serializer};

    pub fn serialize<S: Serializer>(unknowns: &[(String, Amount)], to: S) -> Result<S::Ok, S::Error> {
        let mut map = to.serialize_map(Some(unknowns.len()))?;
        unknowns.iter().try_for_each(|(name, amount)| map.serialize_entry(name, amount))?;
        map.end()
    }

    pub fn deserialize<'de, T: Deserializer<'de>>(from: T) -> Result<Vec<(String, Amount)>, T::Error> {
        struct Entries;
        impl<'de> Visitor<'de> for Entries {
            type Value = Vec<(String, Amount)>;

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("the integrals of unknowns by name")
            }

            fn visit_map<M: MapAccess<'de>>(self, mut map: M) -> Result<Self::Value, M::Error> {
                let mut entries = Vec::new();
                while let Some(entry) = map.next_entry()? {
                    entries.push(entry);
                }
                Ok(entries)
            }
        }
        from.deserialize_map(Entries)
    }
}
