//! The equations that are solved on the moving mesh.

mod bounds;
mod burgers;
mod curvilinear;
mod diffusivity;
mod finite_volumes;
mod formula_law;
mod formula_pde;
mod line;
mod prescribed;
mod shallow_water;
mod sides;
mod terms;
mod uniform;

pub use burgers::{Burgers, BurgersFlux, Convection};
pub use diffusivity::Diffusivity;
pub use finite_volumes::Stepper;
pub use formula_pde::{FormulaPde, MAX_UNKNOWNS, MAX_UNKNOWNS_ON_A_LINE, Scheme};
pub use line::{Coordinates, LineBurgers, LineFormulaPde, LinePdeKind};
pub use prescribed::{Prescribed, PrescribedField};
pub use shallow_water::{ShallowWater, WaterForm};
pub(crate) use sides::SIDES;
pub use sides::{Condition, Conditions};
pub use uniform::UniformBurgers;

use crate::error::{Failure, Result};
use crate::formula::Formula;
use crate::geometry::{Cells, Field, Mesh, node_areas};
use crate::kind::kinds;
use crate::numerics::sum;
use crate::work::Work;

/// One time step on a mesh that moves during it.
#[derive(Debug, Clone, Copy)]
pub struct Motion<'a, const D: usize = 2> {
    /// Time at the start.
    pub t: f64,
    /// Length of the step.
    pub dt: f64,
    /// The mesh at t.
    pub old: &'a Mesh<D>,
    /// The mesh at t + dt.
    pub new: &'a Mesh<D>,
}

/// What is prescribed in time for an unknown at a place; 0 where nothing is.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Forcing {
    /// The source of the unknown.
    pub source: f64,
    /// The inflow through the sides at this place.
    pub inflow: f64,
    /// The value that is given on a side.
    pub value: f64,
}

/// A partial differential equation that can be advanced on a moving mesh.
pub trait Physics<const D: usize = 2>: Send {
    /// Names of the unknowns.
    fn unknowns(&self) -> Vec<String>;

    /// The initial solution, at time t on a mesh.
    fn initial(&self, t: f64, mesh: &Mesh<D>) -> Field;

    /// The value of each unknown at a point at the lower or the upper ends of some axes ([`Lattice::beyond`]), if it is
    /// given there; empty if no unknown is given anywhere.
    ///
    /// [`Lattice::beyond`]: crate::geometry::Lattice::beyond
    fn side_values(&self, _t: f64, _x: [f64; D], _beyond: [[bool; 2]; D]) -> Vec<Option<f64>> {
        Vec::new()
    }

    /// The solution at t + dt on the new mesh from the one at t on the old mesh.
    ///
    /// # Errors
    /// A [`Failure`] where the step cannot be solved; [`Failure::NonFinite`] where its result is not finite.
    fn step(&mut self, motion: Motion<'_, D>, u: &Field) -> Result<(Field, Work), Failure>;

    /// What formulas that take time prescribe at some places, with the unknowns there: for each place and unknown.
    /// `beyond` says on which sides a place lies ([`Lattice::beyond`]). Empty if no formula takes time.
    ///
    /// [`Lattice::beyond`]: crate::geometry::Lattice::beyond
    fn forcing(&self, _t: f64, _x: &[[f64; D]], _beyond: &[[[bool; 2]; D]], _u: &[f64]) -> Vec<Forcing> {
        Vec::new()
    }

    /// For each unknown, whether it never leaves the range of its initial and side values, since it is only carried and
    /// diffused; empty if nothing is known.
    fn keeps_range(&self) -> Vec<bool> {
        Vec::new()
    }

    /// Whether an unknown without diffusion has a flux that is not linear in the unknowns, so that it steepens until it
    /// jumps.
    fn forms_shocks(&self) -> bool {
        false
    }

    /// For each unknown, whether it has no time derivative, so that it is at any time what the others make of it; empty
    /// if all have one.
    fn instantaneous(&self) -> Vec<bool> {
        Vec::new()
    }

    /// The unknown, the node below an edge, and the cell Péclet number there, |F′| h/D, of an edge on which central
    /// fluxes outweigh diffusion by much and an unknown changes by much of its range, if there is one: a front there
    /// may be at the wrong place.
    fn unresolved_flux(&self, _t: f64, _mesh: &Mesh<D>, _u: &Field) -> Option<(usize, usize, f64)> {
        None
    }

    /// At each node the width w = √(D/k) of the widest cell ahead of a front, k being the rate at which the source lets
    /// small values grow there, and infinity where it does not; empty if it does so nowhere. The front of
    /// u_t = D u_xx + k u goes with the speed 2√(D k), and ahead of it u falls by a factor e over w.
    fn widest_cells(&self, _t: f64, _mesh: &Mesh<D>, _u: &Field) -> Vec<f64> {
        Vec::new()
    }

    /// For each node and unknown, as the solution has them, the rate at which its own source lets a small change of it
    /// grow, ∂S/∂u where that is above 0; empty if it does so nowhere.
    fn growth_rates(&self, _t: f64, _mesh: &Mesh<D>, _u: &Field) -> Vec<f64> {
        Vec::new()
    }

    /// Whether the solution is given for every time and place, so that nothing is carried from mesh to mesh.
    fn is_given(&self) -> bool {
        false
    }

    /// ∇ of the first unknown at all nodes, if it is known exactly.
    fn gradient(&self, _t: f64, _mesh: &Mesh<D>) -> Option<Vec<[f64; D]>> {
        None
    }

    /// Areas of the nodes for which a conservative scheme conserves integrals.
    fn areas(&self, mesh: &Mesh<D>) -> Vec<f64>
    where
        Mesh<D>: Cells<D>,
    {
        node_areas(mesh)
    }

    /// The integral of each unknown, or of what its equation conserves in its place.
    fn integrals(&self, mesh: &Mesh<D>, u: &Field) -> Vec<f64>
    where
        Mesh<D>: Cells<D>,
    {
        let areas = self.areas(mesh);
        (0..u.components()).map(|c| sum(areas.iter().zip(u.component(c)).map(|(area, u)| area * u))).collect()
    }

    /// The integral of the first unknown.
    fn conserved(&self, mesh: &Mesh<D>, u: &Field) -> f64
    where
        Mesh<D>: Cells<D>,
    {
        self.integrals(mesh, u)[0]
    }

    /// The exact solution, if there is one, for the unknowns in [`known`](Self::known).
    fn exact(&self, _t: f64, _mesh: &Mesh<D>) -> Option<Field> {
        None
    }

    /// Indices of the unknowns for which [`exact`](Self::exact) has values; by default all.
    fn known(&self) -> Vec<usize> {
        (0..self.unknowns().len()).collect()
    }

    /// Refuses a start at which the equation has no finite values.
    ///
    /// # Errors
    /// A [`Failure`] that names the place.
    fn check(&self, _t: f64, _mesh: &Mesh<D>, _u: &Field) -> Result<(), Failure> {
        Ok(())
    }
}

kinds! {
    /// `[pde]` of a study.
    PdeKind {
        "burgers" = Burgers: "u_t + u u_x + u u_y = nu (u_xx + u_yy), an oblique front with exact solution",
        "shallow-water" = ShallowWater: "h_t + div(h u) = 0, (h u)_t + div(h u u) + grad(g h^2/2) = 0, a pile of water \
                                         that collapses",
        "formula" = FormulaPde: "u_t + div(F) = div(D grad u) + S, up to four unknowns with F, D and S as formulas",
        "prescribed" = Prescribed: "no equation: the solution or the mesh density is a formula of x, y and t",
    }
}

impl PdeKind {
    /// Refuses settings out of range.
    ///
    /// # Errors
    /// [`Error::Invalid`](crate::Error::Invalid) or [`Error::Formula`](crate::Error::Formula).
    pub fn check(&self) -> Result<()> {
        match self {
            Self::Burgers(burgers) => burgers.check(),
            Self::ShallowWater(water) => water.check(),
            Self::FormulaPde(pde) => pde.check(),
            Self::Prescribed(prescribed) => prescribed.check(),
        }
    }

    /// The equation, ready to step.
    ///
    /// # Errors
    /// As [`PdeKind::check`].
    pub fn into_physics(self) -> Result<Box<dyn Physics>> {
        Ok(match self {
            Self::Burgers(burgers) => Box::new(burgers.compiled()?),
            Self::ShallowWater(water) => Box::new(water),
            Self::FormulaPde(pde) => pde.into_physics()?,
            Self::Prescribed(prescribed) => Box::new(prescribed.field::<2>()?),
        })
    }

    /// The formulas of x, y and t that are to hold on the whole domain, with their keys.
    pub fn formulas(&self) -> Vec<(String, &str)> {
        let all = match self {
            Self::Burgers(burgers) => vec![("initial", &burgers.initial), ("boundary", &burgers.boundary)],
            Self::ShallowWater(_) => vec![],
            Self::FormulaPde(pde) => return pde.formulas(),
            Self::Prescribed(prescribed) => vec![("u", &prescribed.u), ("rho", &prescribed.rho)],
        };
        all.into_iter().filter_map(|(key, text)| Some((key.into(), text.as_deref()?))).collect()
    }

    /// The initial values and the side values that are both formulas of x, y and t, with their keys.
    pub fn starts_and_sides(&self) -> Vec<StartAndSide<'_>> {
        match self {
            Self::Burgers(Burgers { initial: Some(initial), boundary: Some(boundary), .. }) => {
                vec![StartAndSide {
                    start: ("initial".into(), initial),
                    value: ("boundary".into(), boundary),
                    side: None,
                }]
            }
            Self::FormulaPde(pde) => pde.starts_and_sides(),
            _ => vec![],
        }
    }
}

/// An initial value and one that is given on a side, both formulas of place and time, with their keys.
#[derive(Debug, Clone)]
pub struct StartAndSide<'a> {
    /// The initial value.
    pub start: (String, &'a str),
    /// The value on the side.
    pub value: (String, &'a str),
    /// The side as (axis, end); none for all of them.
    pub side: Option<(usize, usize)>,
}

/// Parses a formula of place, in D dimensions, and time: of x, y and t, or of x and t.
///
/// # Errors
/// [`Error::Formula`](crate::Error::Formula) with the key.
pub fn formula<const D: usize>(key: &str, text: &str) -> Result<Formula> {
    let names: Vec<&str> = AXES[..D].iter().copied().chain(["t"]).collect();
    Formula::parse(text, &names).map_err(|mistake| mistake.of(key, text))
}

/// Names of the axes in formulas.
const AXES: [&str; 2] = ["x", "y"];

/// The values of a solution at the start of a step, K for each node. Solution and both meshes must have the same
/// lattice.
fn nodal<'a, const D: usize, const K: usize>(motion: Motion<'_, D>, u: &'a Field) -> Result<&'a [[f64; K]], Failure> {
    let (lattice, expected) = (motion.new.lattice(), motion.new.lattice().len());
    let (nodes, rest) = u.values().as_chunks::<K>();
    if motion.old.lattice() != lattice {
        return Err(Failure::WrongLength { what: "the old mesh", found: motion.old.x().len(), expected });
    }
    if nodes.len() != expected || !rest.is_empty() {
        return Err(Failure::WrongLength { what: "the solution", found: nodes.len(), expected });
    }
    Ok(nodes)
}
