use super::sides::{jump, size};
use super::{MeshGenerator, Mmpde, Moved, move_sides};
use crate::error::{Failure, Result};
use crate::geometry::{Mesh, Patch};
use crate::numerics::linear::Robust;
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
    fn step(&mut self, equation: &Mmpde, mesh: &Mesh<2>, rho: &[f64], dt: f64) -> Result<Moved, Failure> {
        let lattice = mesh.lattice();
        let operator = equation.operator(lattice, rho, dt)?;
        let mut x = mesh.x().to_vec();
        let mut work = move_sides(equation, mesh, rho, dt, &mut x, &mut self.line)?;
        let patch = Patch::whole(lattice);
        let (new, cost) = operator.solve::<5, 2>(patch, mesh.x(), &x, jump(mesh), &mut self.plane, size(mesh))?;
        work += cost;
        patch.scatter(lattice, &new, &mut x, jump(mesh));
        Ok(Moved { mesh: mesh.moved(x)?, work, interface: None })
    }
}
