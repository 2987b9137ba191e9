use super::sides::{jump, size};
use super::{MeshGenerator, Mmpde, Moved, move_sides};
use crate::error::{Failure, Result, Unfit};
use crate::geometry::{Mesh, Patch};
use crate::kept::{Kept, check_nodal};
use crate::numerics::linear::{Pcg, Robust};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// One implicit solve of the mesh equation on the whole domain: the sides first, then all other nodes at once
///
/// The gradient form is solved to round-off. The conservative form is solved by conjugate gradients from the mesh that
/// the last step would lead to if it went on, to a hundredth of the shortest edge or better.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Whole {
    #[serde(skip)]
    line: Robust<1>,
    #[serde(skip)]
    plane: Robust<2>,
    #[serde(skip)]
    symmetric: Pcg<2, 2>,
    /// How exactly conjugate gradients solve for positions, as a share of the shortest edge. A residual of the mesh
    /// equation bounds the error it leaves.
    #[serde(skip, default = "closeness")]
    closeness: f64,
    /// The last step: from where to where, and how long it took.
    #[serde(skip)]
    last: Option<Step>,
}

#[derive(Debug, Clone)]
struct Step {
    from: Mesh<2>,
    to: Mesh<2>,
    dt: f64,
}

/// Tolerance of the linear solve, as a share of the shortest edge of the mesh. With ten times as much, errors of the solution
/// still agree in the digits that a run prints.
fn closeness() -> f64 {
    1e-2
}

impl Default for Whole {
    fn default() -> Self {
        Self::to(closeness())
    }
}

impl Whole {
    /// Solves the conservative form to a share of the shortest edge of the mesh.
    pub fn to(closeness: f64) -> Self {
        Self { line: Robust::default(), plane: Robust::default(), symmetric: Pcg::default(), closeness, last: None }
    }
}

impl MeshGenerator for Whole {
    fn solve(&mut self, equation: &Mmpde, mesh: &Mesh<2>, rho: &[f64], dt: f64) -> Result<Moved, Failure> {
        let lattice = mesh.lattice();
        let operator = equation.operator(lattice, rho, dt)?;
        let mut x = mesh.x().to_vec();
        let mut work = move_sides(equation, mesh, rho, dt, &mut x, &mut self.line)?;
        let patch = Patch::whole(lattice);
        if operator.is_symmetric() {
            let last = self.last.take().filter(|last| last.to == *mesh);
            let mut guess = x.clone();
            if let Some(Step { from, dt: before, .. }) = last {
                for k in patch.nodes(lattice) {
                    guess[k] = [0, 1].map(|d| x[k][d] + dt / before * (x[k][d] - from.x()[k][d]));
                }
            }
            let (solver, closeness) = (&mut self.symmetric, self.closeness * mesh.shortest_edge());
            if let Some((new, cost)) =
                operator.solve_symmetric::<5, 2>(patch, mesh.x(), &guess, jump(mesh), solver, closeness)
            {
                work += cost;
                patch.scatter(lattice, &new, &mut x, jump(mesh));
                let moved = mesh.moved(x)?;
                self.last = Some(Step { from: mesh.clone(), to: moved.clone(), dt });
                return Ok(Moved { mesh: moved, work, interface: None });
            }
        }
        let (new, cost) = operator.solve::<5, 2>(patch, mesh.x(), &x, jump(mesh), &mut self.plane, size(mesh))?;
        work += cost;
        patch.scatter(lattice, &new, &mut x, jump(mesh));
        Ok(Moved { mesh: mesh.moved(x)?, work, interface: None })
    }

    fn keep(&self, kept: &mut Kept) {
        kept.put("last mesh step", &self.last.as_ref().map(|last| (last.from.x(), last.to.x(), last.dt)));
    }

    fn resume(&mut self, mesh: &Mesh<2>, kept: &Kept) -> Result<(), Unfit> {
        type Last = (Vec<[f64; 2]>, Vec<[f64; 2]>, f64);
        let moved = |x: Vec<[f64; 2]>| {
            check_nodal("last mesh step", &x, mesh.lattice().len())?;
            mesh.moved(x).map_err(|failure| Unfit::Damaged(failure.to_string()))
        };
        self.last = match kept.get::<Option<Last>>("last mesh step")? {
            Some((.., dt)) if !(dt.is_finite() && dt > 0.0) => {
                return Err(Unfit::Damaged(format!("its last mesh step is {dt} long")));
            }
            Some((from, to, dt)) => Some(Step { from: moved(from)?, to: moved(to)?, dt }),
            None => None,
        };
        Ok(())
    }
}
