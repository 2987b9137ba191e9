use super::{MeshGenerator, Mmpde};
use crate::error::{Failure, Result};
use crate::geometry::Mesh;
use crate::work::Work;
use serde::{Deserialize, Serialize};

/// The mesh does not move.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fixed {}

impl MeshGenerator for Fixed {
    fn step(&mut self, _: &Mmpde, mesh: &Mesh<2>, _rho: &[f64], _dt: f64) -> Result<(Mesh<2>, Work), Failure> {
        Ok((mesh.clone(), Work::default()))
    }
}
