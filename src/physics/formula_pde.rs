mod read;

pub(super) use read::Formulas;

use super::formula_law::FormulaLaw;
use super::sides::{Conditions, SIDES};
use super::{Coordinates, Diffusivity, Physics, StartAndSide, Stepper};
use crate::error::{Error, Result};
use crate::geometry::DualCells;
use crate::numerics::linear::{RobustLine, RobustTransport};
use crate::setting::{Fluxes, Text, texts};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// An equation of your own, given by formulas, for one to four unknowns in the plane and one to eight on a line
///
/// ```text
/// u_t + ∇·F(u, x, y, t) = ∇·(D(u, x, y, t) ∇u) + S(u, x, y, t)
/// ```
///
/// for every unknown u. F (`flux`, along x and along y), D ≥ 0 (`diffusivity`) and S (`source`) may contain all
/// unknowns, and are 0 by default. `initial`, a formula of x and y (and t, the start time), is required for each
/// unknown. On bounded sides `boundary` gives a [`Condition`](super::Condition), for all of them or by side. `exact`,
/// the solution if it is known, is used for the errors in a report: the largest and the root mean square error over the
/// unknowns that have one.
///
/// The scheme is finite volumes on [dual cells](crate::geometry::DualCells) and a [`Stepper`] in time, solved by
/// Newton's method with the derivatives of the formulas: second order in space and time. At a face, F and D are means
/// of their values at the two nodes; where a cell is too wide for such central fluxes, the value from upstream limits
/// them, and without diffusion they are [limited](Scheme::Limited) everywhere. Σ A u changes only by the flux through
/// the sides, by S, and where `bounds` are met, on any moving mesh. A solution has one value for each node and unknown,
/// in the order of `unknowns`.
///
/// # Errors
/// A step ends with [`Failure::Formula`](crate::Failure::Formula) where a formula is not finite.
///
/// # Example
/// ```
/// use driftmesh::{geometry::{Lattice, Mesh}, physics::{FormulaPde, Motion, Stepper}};
/// // u decays and v gains what u loses
/// let pde: FormulaPde = toml::from_str(r#"
///     unknowns = ["u", "v"]
///     source = { u = "-u", v = "u" }
///     initial = { u = "1", v = "0" }
/// "#)?;
/// let mut physics = pde.stepped(Stepper::Trapezoid)?;
/// let mesh = Mesh::uniform(Lattice::new([4, 4], [true; 2])?, [0.0; 2], [1.0; 2])?;
/// let start = physics.initial(0.0, &mesh);
/// let (end, _) = physics.step(Motion { t: 0.0, dt: 0.2, old: &mesh, new: &mesh }, &start)?;
/// // the trapezoid makes (1 − 0.1)/(1 + 0.1) of u
/// assert!(end.component(0).all(|u| (u - 0.9 / 1.1).abs() < 1e-12));
/// assert!(end.component(0).zip(end.component(1)).all(|(u, v)| (u + v - 1.0).abs() < 1e-12));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Source
/// Hundsdorfer and Verwer, *Numerical Solution of Time-Dependent Advection-Diffusion-Reaction Equations*, Springer
/// (2003), for the scheme on a mesh at rest.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "FormulaPde")]
pub struct FormulaPde<const D: usize = 2> {
    /// Names of the unknowns: at most four in the plane, eight on a line.
    pub unknowns: Vec<String>,
    /// Flux F of each unknown, as formulas along x and along y; 0 by default.
    #[serde(default, skip_serializing_if = "no_flux")]
    pub flux: Fluxes<D>,
    /// Diffusivity D ≥ 0 of each unknown: a formula, one for each axis, a tensor as rows of formulas, or a table of
    /// these by the unknown whose gradient drives the flux; 0 by default.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub diffusivity: BTreeMap<String, Diffusivity>,
    /// What takes the place of u in u_t, a formula of the unknowns, x, y and t; 0 for an equation without time
    /// derivative. u itself by default.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty", deserialize_with = "texts")]
    #[schemars(with = "BTreeMap<String, Text>")]
    pub storage: BTreeMap<String, String>,
    /// Source S of each unknown; 0 by default.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty", deserialize_with = "texts")]
    #[schemars(with = "BTreeMap<String, Text>")]
    pub source: BTreeMap<String, String>,
    /// Initial value of each unknown, a formula of x and y (and t, the start time).
    #[serde(deserialize_with = "texts")]
    #[schemars(with = "BTreeMap<String, Text>")]
    pub initial: BTreeMap<String, String>,
    /// What holds for each unknown on bounded sides: a value, a formula of x, y and t; `"no-flux"`; `"outflow"`, no
    /// normal derivative; `{ flux = "…" }`, what flows into the domain, a formula of the unknowns, x, y and t. One for
    /// all sides, or a table of them by side: `left`, `right`, `bottom`, `top`. Required unless all axes are periodic.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub boundary: BTreeMap<String, Conditions>,
    /// The lower and the upper bound of an unknown, formulas of x, y and t, or ±∞ for none: an obstacle, or what is
    /// known of a solution. Where an unknown lies on its bound, its equation has a further source, just strong enough
    /// to keep it there, so that ∫u changes. An unknown with a source and without bounds does not pass those of −1, 0
    /// and 1 that solve its equation, if the source drives it away from one of them: round-off would grow there.
    #[serde(default, skip_serializing_if = "no_flux")]
    pub bounds: Fluxes<2>,
    /// `"limited"` fluxes, of the second order where the solution is smooth and without new extrema, which are carried
    /// in explicit substeps; or `"central"` ones, without limits. By default limited ones for the unknowns without
    /// diffusion; and for others implicit central ones that are limited where the cell Péclet number is above 2.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scheme: Option<Scheme>,
    /// Exact solution of each unknown, a formula of x, y and t, if it is known.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty", deserialize_with = "texts")]
    #[schemars(with = "BTreeMap<String, Text>")]
    pub exact: BTreeMap<String, String>,
}

/// How fluxes, and the motion of the mesh, carry an unknown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Scheme {
    /// The value at a face is the mean of the values on both sides of it; stepped implicitly.
    Central,
    /// The value at a face is limited so that no new extrema arise; stepped in explicit substeps.
    Limited,
}

/// Largest number of unknowns of a [`FormulaPde`] in the plane.
pub const MAX_UNKNOWNS: usize = 4;
/// Largest number of unknowns of a [`FormulaPde`] on a line.
pub const MAX_UNKNOWNS_ON_A_LINE: usize = 8;

impl<const D: usize> FormulaPde<D> {
    /// Refuses settings that define no equation.
    ///
    /// # Errors
    /// [`Error::Formula`] where the text of a formula is wrong or D is a negative number; [`Error::Invalid`] where a
    /// name cannot be one of an unknown, an initial value is missing, or a key is no unknown.
    pub fn check(&self) -> Result<()> {
        self.read().map(|_| ())
    }

    /// Refuses sides without values and values without sides.
    ///
    /// # Errors
    /// [`Error::Invalid`] unless every unknown has a `boundary` if there is a bounded axis, and none has one if there
    /// is not.
    pub fn check_sides(&self, periodic: [bool; D]) -> Result<()> {
        let missing = self.unknowns.iter().find(|name| !self.boundary.contains_key(*name));
        match (periodic.contains(&false), missing, self.boundary.keys().next()) {
            (false, _, Some(name)) => {
                let rule = match D {
                    1 => "a periodic line has no ends; leave it out",
                    _ => "both axes are periodic and have no sides; leave it out",
                };
                Err(Error::invalid("boundary", format!("given for `{name}`"), rule))
            }
            (false, _, None) => Ok(()),
            (_, None, _) => self.boundary.iter().try_for_each(|(name, conditions)| conditions.check(name, periodic)),
            (_, Some(name), _) => {
                let rule = format!(
                    "a bounded axis has sides; add {name} = \"no-flux\" or a formula, or set domain.periodic to {:?}",
                    [true; D]
                );
                Err(Error::invalid("boundary", format!("not given for `{name}`"), rule))
            }
        }
    }

    /// The default stepper: [`Stepper::TrBdf2`] where something diffuses or has a source, which may decay faster than
    /// any step is short, and where a flux takes gradients or there is a storage; else the trapezoid.
    pub fn stepper(&self) -> Stepper {
        let diffuses = self.diffusivity.values().any(|of| !of.is_zero());
        let has_source = self.source.values().any(|text| text != "0");
        // what a flux makes of gradients diffuses, too
        let by_gradients = self.storage.is_empty() && self.flux.values().flatten().all(|text| !text.contains('_'));
        match diffuses || has_source || !by_gradients {
            true => Stepper::TrBdf2,
            false => Stepper::Trapezoid,
        }
    }

    /// The formulas of x, y and t alone, with their keys.
    pub fn formulas(&self) -> Vec<(String, &str)> {
        let tables = [("initial", &self.initial), ("exact", &self.exact)];
        let all = tables
            .into_iter()
            .flat_map(|(key, table)| table.iter().map(move |(name, text)| (format!("{key}.{name}"), text.as_str())));
        let sides = self.boundary.iter();
        all.chain(sides.filter_map(|(name, conditions)| Some((format!("boundary.{name}"), conditions.value()?))))
            .collect()
    }

    /// The initial value and the side values of each unknown.
    pub fn starts_and_sides(&self) -> Vec<StartAndSide<'_>> {
        let given =
            self.unknowns.iter().filter_map(|name| Some((name, self.initial.get(name)?, self.boundary.get(name)?)));
        let all = given.flat_map(|(name, initial, conditions)| {
            conditions.values().into_iter().map(move |(side, text)| {
                let of_side = side.map_or(String::new(), |(axis, end)| format!(".{}", SIDES[axis][end]));
                StartAndSide {
                    start: (format!("initial.{name}"), initial),
                    value: (format!("boundary.{name}{of_side}"), text),
                    side,
                }
            })
        });
        all.collect()
    }
}

impl FormulaPde {
    /// The equation, ready to step.
    ///
    /// # Errors
    /// As [`FormulaPde::check`].
    pub fn into_physics(self) -> Result<Box<dyn Physics>> {
        let stepper = self.stepper();
        self.stepped(stepper)
    }

    /// The equation, ready to step with this stepper.
    ///
    /// # Errors
    /// As [`FormulaPde::check`].
    pub fn stepped(self, stepper: Stepper) -> Result<Box<dyn Physics>> {
        let formulas = self.read()?;
        type Plane<const B: usize, const P: usize, const K: usize> = FormulaLaw<2, B, P, K, RobustTransport<B>>;
        Ok(match formulas.names.len() {
            1 => Box::new(Plane::<1, 3, 8>::new(formulas, DualCells::new, stepper, true)),
            2 => Box::new(Plane::<2, 4, 24>::new(formulas, DualCells::new, stepper, true)),
            3 => Box::new(Plane::<3, 5, 48>::new(formulas, DualCells::new, stepper, true)),
            _ => Box::new(Plane::<4, 6, 80>::new(formulas, DualCells::new, stepper, true)),
        })
    }
}

impl FormulaPde<1> {
    /// The equation on a line in these coordinates, ready to step.
    ///
    /// # Errors
    /// As [`FormulaPde::check`].
    pub fn into_physics_on_a_line(self, coordinates: Coordinates, stepper: Stepper) -> Result<Box<dyn Physics<1>>> {
        let formulas = self.read()?;
        let cells = coordinates.dual_cells();
        type Line<const B: usize, const P: usize, const K: usize> = FormulaLaw<1, B, P, K, RobustLine>;
        Ok(match formulas.names.len() {
            1 => Box::new(Line::<1, 2, 6>::new(formulas, cells, stepper, coordinates == Coordinates::Cartesian)),
            2 => Box::new(Line::<2, 3, 18>::new(formulas, cells, stepper, coordinates == Coordinates::Cartesian)),
            3 => Box::new(Line::<3, 4, 36>::new(formulas, cells, stepper, coordinates == Coordinates::Cartesian)),
            4 => Box::new(Line::<4, 5, 60>::new(formulas, cells, stepper, coordinates == Coordinates::Cartesian)),
            5 => Box::new(Line::<5, 6, 90>::new(formulas, cells, stepper, coordinates == Coordinates::Cartesian)),
            6 => Box::new(Line::<6, 7, 126>::new(formulas, cells, stepper, coordinates == Coordinates::Cartesian)),
            7 => Box::new(Line::<7, 8, 168>::new(formulas, cells, stepper, coordinates == Coordinates::Cartesian)),
            _ => Box::new(Line::<8, 9, 216>::new(formulas, cells, stepper, coordinates == Coordinates::Cartesian)),
        })
    }
}

fn no_flux<const D: usize>(fluxes: &Fluxes<D>) -> bool {
    fluxes.is_empty()
}
