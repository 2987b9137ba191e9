//! Equations on a line.

use super::finite_volumes::{Crossing, FiniteVolumes, Law};
use super::prescribed::evaluate;
use super::{BurgersFlux, FormulaPde, Motion, Physics, Prescribed, StartAndSide, Stepper, formula, nodal};
use crate::elementary::exp;
use crate::error::{Error, Failure, Result};
use crate::formula::Program;
use crate::geometry::{DualCells, Field, Mesh, check_finite};
use crate::kind::kinds;
use crate::numerics::linear::RobustLine;
use crate::work::Work;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

kinds! {
    /// `[pde]` of a study in one dimension.
    LinePdeKind {
        "burgers" = LineBurgers: "u_t + u u_x = nu u_xx, a front with exact solution",
        "formula" = LineFormulaPde: "u_t + F_x = (D u_x)_x + S, up to eight unknowns with F, D and S as formulas",
        "prescribed" = Prescribed: "no equation: the solution or the mesh density is a formula of x and t",
    }
}

/// [`FormulaPde`] on a line.
pub type LineFormulaPde = FormulaPde<1>;

/// The coordinate along a line.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Coordinates {
    /// The Cartesian coordinate x.
    #[default]
    Cartesian,
    /// The distance r from an axis: volumes have the weight r.
    Cylindrical,
    /// The distance r from a point: volumes have the weight r².
    Spherical,
}

impl Coordinates {
    /// How the dual cells of a mesh are made.
    pub fn dual_cells(self) -> fn(&Mesh<1>) -> DualCells<1> {
        match self {
            Self::Cartesian => DualCells::new,
            Self::Cylindrical => DualCells::cylindrical,
            Self::Spherical => DualCells::spherical,
        }
    }
}

impl LinePdeKind {
    /// Refuses settings out of range.
    ///
    /// # Errors
    /// [`Error::Invalid`] or [`Error::Formula`].
    pub fn check(&self) -> Result<()> {
        match self {
            Self::LineBurgers(burgers) => burgers.clone().compiled().map(|_| ()),
            Self::LineFormulaPde(pde) => pde.check(),
            Self::Prescribed(prescribed) => prescribed.field::<1>().map(|_| ()),
        }
    }

    /// The equation in these coordinates, ready to step; a formula as is said, or as suits it.
    ///
    /// # Errors
    /// As [`LinePdeKind::check`].
    pub fn into_physics(self, coordinates: Coordinates, stepper: Option<Stepper>) -> Result<Box<dyn Physics<1>>> {
        Ok(match self {
            Self::LineBurgers(burgers) => Box::new(burgers.compiled()?),
            Self::LineFormulaPde(pde) => {
                let stepper = stepper.unwrap_or(pde.stepper());
                pde.into_physics_on_a_line(coordinates, stepper)?
            }
            Self::Prescribed(prescribed) => Box::new(prescribed.field::<1>()?),
        })
    }

    /// The formulas of x and t that are to hold on the whole line, with their keys.
    pub fn formulas(&self) -> Vec<(String, &str)> {
        let all = match self {
            Self::LineBurgers(burgers) => vec![("initial", &burgers.initial), ("boundary", &burgers.boundary)],
            Self::LineFormulaPde(pde) => return pde.formulas(),
            Self::Prescribed(prescribed) => vec![("u", &prescribed.u), ("rho", &prescribed.rho)],
        };
        all.into_iter().filter_map(|(key, text)| Some((key.into(), text.as_deref()?))).collect()
    }

    /// The initial values and the values at the ends that are both formulas of x and t, with their keys.
    pub fn starts_and_sides(&self) -> Vec<StartAndSide<'_>> {
        match self {
            Self::LineBurgers(LineBurgers { initial: Some(initial), boundary: Some(boundary), .. }) => {
                vec![StartAndSide {
                    start: ("initial".into(), initial),
                    value: ("boundary".into(), boundary),
                    side: None,
                }]
            }
            Self::LineFormulaPde(pde) => pde.starts_and_sides(),
            _ => vec![],
        }
    }
}

/// Burgers' equation on a line with a travelling front
///
/// ```text
/// u_t + u u_x = ν u_xx,   exact   u = 1 / (1 + exp((x − t/2) / 2ν))
/// ```
///
/// ν > 0 (`viscosity`) sets the width of the front, about 9ν between u = .1 and .9. Initial values and those at the
/// ends come from the exact solution, or from the formulas `initial` and `boundary`. The scheme is that of
/// [`Convection::Flux`](super::Convection::Flux) in the plane, with the flux ½ a b between the values a and b at two
/// nodes, limited where cells are too wide for it.
///
/// # Source
/// Whitham, *Linear and Nonlinear Waves* (1974), 4.3.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LineBurgers {
    /// The viscosity ν, above 0.
    pub viscosity: f64,
    /// u at the start, a formula of x (and t, the start time); the exact front by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub initial: Option<String>,
    /// u at the ends, a formula of x and t; only with `initial`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub boundary: Option<String>,
    /// The formulas of `initial` and `boundary`, compiled.
    #[serde(skip)]
    given: [Option<Program<1, 1>>; 2],
    #[serde(skip)]
    volumes: FiniteVolumes<1, 1, RobustLine>,
}

impl LineBurgers {
    /// The equation with its formulas compiled.
    fn compiled(mut self) -> Result<Self> {
        if !(self.viscosity.is_finite() && self.viscosity > 0.0) {
            return Err(Error::invalid("viscosity", self.viscosity, "must be a finite number above 0"));
        }
        if let (None, Some(boundary)) = (&self.initial, &self.boundary) {
            let rule = "without initial the front gives the values at the ends; add initial, or leave it out";
            return Err(Error::invalid("boundary", format!("{boundary:?}"), rule));
        }
        let compiled = |key: &str, text: &Option<String>| -> Result<Option<Program<1, 1>>> {
            match text {
                Some(text) => Ok(Some(Program::new([&formula::<1>(key, text)?]))),
                None => Ok(None),
            }
        };
        self.given = [compiled("initial", &self.initial)?, compiled("boundary", &self.boundary)?];
        Ok(self)
    }

    fn front(&self, t: f64, [x]: [f64; 1]) -> f64 {
        1.0 / (1.0 + exp((x - 0.5 * t) / (2.0 * self.viscosity)))
    }

    fn end(&self, t: f64, x: [f64; 1]) -> Option<f64> {
        match &self.given {
            [None, _] => Some(self.front(t, x)),
            [Some(_), boundary] => boundary.as_ref().map(|formula| formula.eval(x, &[t])[0]),
        }
    }
}

impl Law<1, 1> for LineBurgers {
    type Node = f64;

    fn names(&self) -> [&'static str; 1] {
        ["u"]
    }

    fn nodes(&self, _t: f64, _x: &[[f64; 1]], u: &[[f64; 1]]) -> Vec<f64> {
        u.as_flattened().to_vec()
    }

    fn convection(&self, &a: &f64, &b: &f64, [n]: [f64; 1]) -> Crossing<1> {
        let (value, by_a, by_b) = BurgersFlux::Product.between(a, b);
        Crossing { value: [n * value], by_below: [[n * by_a]], by_above: [[n * by_b]] }
    }

    fn diffusivity(&self, _: &f64, _: &f64) -> Crossing<1> {
        Crossing { value: [self.viscosity], by_below: [[0.0]], by_above: [[0.0]] }
    }

    /// Layers thinner than the cells, before the mesh has come to them, have no overshoots.
    fn damped(&self) -> [bool; 1] {
        [true]
    }

    fn has_own_flux(&self) -> [bool; 1] {
        [true]
    }

    /// No coupled mass: for u = x/t the errors of the product flux and of A u on growing cells cancel.
    fn shares_mass(&self) -> [bool; 1] {
        [false]
    }

    fn side(&self, t: f64, x: [f64; 1], _beyond: [[bool; 2]; 1]) -> [Option<f64>; 1] {
        [self.end(t, x)]
    }
}

impl Physics<1> for LineBurgers {
    fn unknowns(&self) -> Vec<String> {
        vec!["u".into()]
    }

    fn initial(&self, t: f64, mesh: &Mesh<1>) -> Field {
        match &self.given[0] {
            Some(formula) => Field::nodal(evaluate(formula, t, mesh)),
            None => Field::scalar(mesh.x().iter().map(|x| self.front(t, *x)).collect()),
        }
    }

    fn side_values(&self, t: f64, x: [f64; 1], _beyond: [[bool; 2]; 1]) -> Vec<Option<f64>> {
        vec![self.end(t, x)]
    }

    fn keeps_range(&self) -> Vec<bool> {
        vec![true]
    }

    fn exact(&self, t: f64, mesh: &Mesh<1>) -> Option<Field> {
        self.given[0].is_none().then(|| Field::scalar(mesh.x().iter().map(|x| self.front(t, *x)).collect()))
    }

    fn check(&self, _t: f64, mesh: &Mesh<1>, u: &Field) -> Result<(), Failure> {
        check_finite(["the initial solution"], mesh, u.values().as_chunks::<1>().0)
    }

    fn step(&mut self, motion: Motion<'_, 1>, u: &Field) -> Result<(Field, Work), Failure> {
        let start = nodal::<1, 1>(motion, u)?;
        let mut volumes = std::mem::take(&mut self.volumes);
        let stepped = volumes.step(self, motion, start);
        self.volumes = volumes;
        let (values, work) = stepped?;
        Ok((Field::nodal(values), work))
    }
}
