//! The state that the parts of a run carry from step to step, stored under names: the contents of a checkpoint.

use crate::error::Unfit;
use serde::{Deserialize, Serialize, de::DeserializeOwned};
use serde_bytes::ByteBuf;
use std::collections::BTreeMap;

/// Values under names, each as MessagePack, which keeps every bit of a number.
///
/// # Example
/// ```
/// let mut kept = driftmesh::kept::Kept::default();
/// kept.put("steps", &3_u32);
/// assert_eq!(kept.get::<u32>("steps")?, 3);
/// assert!(kept.get::<String>("steps").is_err() && kept.get::<u32>("paths").is_err());
/// # Ok::<(), driftmesh::error::Unfit>(())
/// ```
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct Kept(BTreeMap<String, ByteBuf>);

impl Kept {
    /// Adds a value.
    pub fn put(&mut self, name: &str, value: &impl Serialize) {
        self.0.insert(name.into(), ByteBuf::from(encoded(value)));
    }

    /// A value of the type that was put there.
    ///
    /// # Errors
    /// [`Unfit::Damaged`] where there is none.
    pub fn get<T: DeserializeOwned>(&self, name: &str) -> Result<T, Unfit> {
        let bytes = self.0.get(name).ok_or_else(|| Unfit::Damaged(format!("it has no `{name}`")))?;
        rmp_serde::from_slice(bytes).map_err(|error| Unfit::Damaged(format!("its `{name}` is none: {error}")))
    }
}

/// A value as MessagePack, the fields of structs by name.
pub(crate) fn encoded(value: &impl Serialize) -> Vec<u8> {
    rmp_serde::to_vec_named(value).expect("writing plain data to memory cannot fail")
}

/// Nodal vectors as plain numbers: an array whose length is not known by itself is none to serde.
pub(crate) mod nodal {
    use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error};

    pub fn serialize<S: Serializer, const K: usize>(values: &[[f64; K]], serializer: S) -> Result<S::Ok, S::Error> {
        values.as_flattened().serialize(serializer)
    }

    pub fn deserialize<'de, D: Deserializer<'de>, const K: usize>(deserializer: D) -> Result<Vec<[f64; K]>, D::Error> {
        let plain = Vec::<f64>::deserialize(deserializer)?;
        match plain.as_chunks::<K>() {
            (values, []) => Ok(values.to_vec()),
            _ => Err(D::Error::custom(format!("{} numbers are no vectors of {K}", plain.len()))),
        }
    }
}

/// Refuses an array that does not hold one finite entry for each node.
pub(crate) fn check_nodal<const K: usize>(what: &str, values: &[[f64; K]], nodes: usize) -> Result<(), Unfit> {
    if values.len() != nodes {
        return Err(Unfit::Damaged(format!("its {what} has {} entries for {nodes} nodes", values.len())));
    }
    match values.iter().position(|value| value.iter().any(|v| !v.is_finite())) {
        Some(k) => Err(Unfit::Damaged(format!("its {what} is {:?} at node {k}", values[k]))),
        None => Ok(()),
    }
}
