use super::{MeshGenerator, Mmpde, move_sides, sides::size};
use crate::error::{Failure, Result};
use crate::geometry::{Mesh, Patch};
use crate::numerics::linear::Robust;
use crate::work::Work;
use serde::{Deserialize, Serialize};

/// One implicit solve of the mesh equation on the whole domain: the sides first, then all other nodes at once.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Whole {
    #[serde(skip)]
    line: Robust<1>,
    #[serde(skip)]
    plane: Robust<2>,
}

impl MeshGenerator for Whole {
    fn step(&mut self, equation: &Mmpde, mesh: &Mesh<2>, rho: &[f64], dt: f64) -> Result<(Mesh<2>, Work), Failure> {
        let lattice = mesh.lattice();
        let [width, height] = mesh.extent();
        let operator = equation.operator(lattice, rho, dt)?;
        let mut x = mesh.x().to_vec();
        let mut work = move_sides(equation, mesh, rho, dt, &mut x, &mut self.line)?;
        let jump = [[width, 0.0], [0.0, height]];
        work += operator.solve::<5, 2>(Patch::whole(lattice), mesh.x(), &mut x, jump, &mut self.plane, size(mesh))?;
        Ok((mesh.moved(x)?, work))
    }
}
