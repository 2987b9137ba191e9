use super::sides::size;
use super::{MeshGenerator, Mmpde, Moved, move_sides};
use crate::error::{Failure, Result, Unfit};
use crate::geometry::{Cells, Density, Mesh, Patch};
use crate::kept::{Kept, check_nodal};
use crate::numerics::linear::{Elimination, Fallback, LinearSolver, Pcg, Robust, SparseLu};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// One implicit solve of the mesh equation on the whole domain: the sides first, then all other nodes at once
///
/// For one, two or three dimensions. On a line, and in the gradient form, it is solved to round-off. The conservative
/// form is solved by conjugate gradients to a hundredth of the shortest edge or better, starting from the mesh to which
/// the motion of the last step would lead.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Whole")]
pub struct Whole<const D: usize = 2> {
    #[serde(skip)]
    line: Robust<1>,
    #[serde(skip)]
    inside: Robust<D>,
    /// For three dimensions, in which alternating directions do not converge.
    #[serde(skip)]
    elimination: SparseLu,
    #[serde(skip)]
    symmetric: Pcg<D, D>,
    /// Tolerance of conjugate gradients, as a share of the shortest edge of the mesh. A residual of the mesh equation
    /// bounds the error that it leaves in the positions.
    #[serde(skip, default = "closeness")]
    closeness: f64,
    /// The last step: from which mesh to which, and its length.
    #[serde(skip)]
    last: Option<Step<D>>,
}

#[derive(Debug, Clone)]
struct Step<const D: usize> {
    from: Mesh<D>,
    to: Mesh<D>,
    dt: f64,
}

/// Default tolerance of the linear solve, as a share of the shortest edge of the mesh. Even with ten times as much,
/// errors of the solution are the same in the digits that a run prints.
fn closeness() -> f64 {
    1e-2
}

impl<const D: usize> Default for Whole<D> {
    fn default() -> Self {
        Self::to(closeness())
    }
}

impl<const D: usize> Whole<D> {
    /// Solves the conservative form to this share of the shortest edge of the mesh.
    pub fn to(closeness: f64) -> Self {
        Self {
            line: Robust::default(),
            inside: Robust::default(),
            elimination: SparseLu::default(),
            symmetric: Pcg::default(),
            closeness,
            last: None,
        }
    }

    /// One step. S = 2D + 1 is the number of points of the star; `direct` solves what conjugate gradients cannot.
    fn solve_with<const S: usize, Direct: LinearSolver<D, S, D>>(
        &mut self,
        equation: &Mmpde,
        mesh: &Mesh<D>,
        (rho, dt): (&Density, f64),
        direct: impl FnOnce(&mut Self) -> &mut Direct,
    ) -> Result<Moved<D>, Failure> {
        let lattice = mesh.lattice();
        let operator = equation.operator(lattice, rho, dt)?;
        let mut x = mesh.x().to_vec();
        let mut work = move_sides(equation, mesh, rho, dt, &mut x, &mut self.line)?;
        let patch = Patch::whole(lattice);
        if operator.is_symmetric() {
            let guess = self.guess(mesh, &x, dt);
            let (solver, closeness) = (&mut self.symmetric, self.closeness * mesh.shortest_edge());
            match operator.solve_symmetric::<S, D>(patch, mesh.x(), &guess, mesh.jump(), solver, closeness) {
                Ok((new, cost)) => {
                    work += cost;
                    patch.scatter(lattice, &new, &mut x, mesh.jump());
                    let moved = mesh.moved(x)?;
                    self.last = Some(Step { from: mesh.clone(), to: moved.clone(), dt });
                    return Ok(Moved { mesh: moved, work, interface: None });
                }
                Err(Failure::LinearStalled { iterations, .. }) => {
                    work.linear_iterations += iterations;
                    // the other solver of three dimensions is elimination
                    work.direct_stalled += if D == 3 { D } else { 0 };
                }
                Err(other) => return Err(other),
            }
        }
        let (new, cost) = operator.solve::<S, D>(patch, mesh.x(), &x, mesh.jump(), direct(self), size(mesh))?;
        work += cost;
        patch.scatter(lattice, &new, &mut x, mesh.jump());
        Ok(Moved { mesh: mesh.moved(x)?, work, interface: None })
    }

    /// The mesh to which the motion of the last step would lead, if that step led to this mesh; on the sides it is `x`.
    fn guess(&mut self, mesh: &Mesh<D>, x: &[[f64; D]], dt: f64) -> Vec<[f64; D]> {
        let mut guess = x.to_vec();
        if let Some(Step { from, dt: before, .. }) = self.last.take().filter(|last| last.to == *mesh) {
            for k in Patch::whole(mesh.lattice()).nodes(mesh.lattice()) {
                guess[k] = std::array::from_fn(|d| x[k][d] + dt / before * (x[k][d] - from.x()[k][d]));
            }
        }
        guess
    }

    fn put(&self, kept: &mut Kept) {
        let plain = |mesh: &Mesh<D>| mesh.x().as_flattened().to_vec();
        kept.put("last mesh step", &self.last.as_ref().map(|last| (plain(&last.from), plain(&last.to), last.dt)));
    }

    fn take_up(&mut self, mesh: &Mesh<D>, kept: &Kept) -> Result<(), Unfit> {
        type Last = (Vec<f64>, Vec<f64>, f64);
        let moved = |x: Vec<f64>| {
            let (x, rest) = x.as_chunks::<D>();
            check_nodal("last mesh step", x, mesh.lattice().len() + rest.len())?;
            mesh.moved(x.to_vec()).map_err(|failure| Unfit::Damaged(failure.to_string()))
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

/// Meshes that can be moved to rest: lines and those in the plane.
pub trait Movable<const D: usize>: Cells<D> {
    /// [`Whole::to`] for meshes of this dimension.
    fn whole(closeness: f64) -> Box<dyn MeshGenerator<D>>;
}

impl Movable<1> for Mesh<1> {
    fn whole(closeness: f64) -> Box<dyn MeshGenerator<1>> {
        Box::new(Whole::to(closeness))
    }
}

impl Movable<2> for Mesh<2> {
    fn whole(closeness: f64) -> Box<dyn MeshGenerator<2>> {
        Box::new(Whole::to(closeness))
    }
}

/// A line is solved by elimination, and nothing is remembered.
impl MeshGenerator<1> for Whole<1> {
    fn solve(&mut self, equation: &Mmpde, mesh: &Mesh<1>, rho: &Density, dt: f64) -> Result<Moved<1>, Failure> {
        let (lattice, jump) = (mesh.lattice(), mesh.jump());
        let operator = equation.operator(lattice, rho, dt)?;
        let (patch, mut x) = (Patch::whole(lattice), mesh.x().to_vec());
        let mut solver = Fallback::<Elimination, SparseLu>::default();
        let (new, work) = operator.solve::<3, 1>(patch, mesh.x(), mesh.x(), jump, &mut solver, size(mesh))?;
        patch.scatter(lattice, &new, &mut x, jump);
        Ok(Moved { mesh: mesh.moved(x)?, work, interface: None })
    }
}

/// The implementation for D dimensions, with stars of S = 2D + 1 points: Rust cannot compute S from D.
macro_rules! generator {
    ($D:literal, $S:literal, $direct:ident) => {
        impl MeshGenerator<$D> for Whole<$D> {
            fn solve(
                &mut self,
                equation: &Mmpde,
                mesh: &Mesh<$D>,
                rho: &Density,
                dt: f64,
            ) -> Result<Moved<$D>, Failure> {
                self.solve_with::<$S, _>(equation, mesh, (rho, dt), |whole| &mut whole.$direct)
            }

            fn keep(&self, kept: &mut Kept) {
                self.put(kept);
            }

            fn resume(&mut self, mesh: &Mesh<$D>, kept: &Kept) -> Result<(), Unfit> {
                self.take_up(mesh, kept)
            }
        }
    };
}

generator!(2, 5, inside);
generator!(3, 7, elimination);
