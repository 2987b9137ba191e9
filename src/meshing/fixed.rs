use super::{MeshGenerator, Mmpde, Moved};
use crate::error::{Failure, Result};
use crate::geometry::{Density, Mesh};
use crate::work::Work;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The mesh does not move.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Fixed {}

impl<const D: usize> MeshGenerator<D> for Fixed {
    fn solve(&mut self, _: &Mmpde, mesh: &Mesh<D>, _rho: &Density, _dt: f64) -> Result<Moved<D>, Failure> {
        Ok(Moved { mesh: mesh.clone(), work: Work::default(), interface: None })
    }

    fn moves(&self) -> bool {
        false
    }
}
