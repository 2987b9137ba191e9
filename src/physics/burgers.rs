mod differences;

use super::finite_volumes::{Crossing, FiniteVolumes, Law};
use super::prescribed::evaluate;
use super::{Motion, Physics, curvilinear::Stencils, formula, nodal};
use crate::elementary::exp;
use crate::error::{Error, Failure, Result};
use crate::formula::Program;
use crate::geometry::{DualCells, Field, Mesh, node_areas};
use crate::numerics::linear::Robust;
use crate::work::Work;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Burgers' equation with a travelling oblique front
///
/// ```text
/// u_t + u u_x + u u_y = ν (u_xx + u_yy),   exact   u = 1 / (1 + exp((x + y − t) / 2ν))
/// ```
///
/// ν > 0 (`viscosity`) sets the width of the front, about 10ν between u = .1 and .9. Initial and side values come from
/// the exact solution, or from the formulas `initial` and `boundary`. On periodic axes `initial` is required and
/// `boundary` is not. In the moving coordinate ξ, with the velocity ẋ of the nodes, the right-hand side is
///
/// ```text
/// R = ẋ·∇u − (u²/2)_x − (u²/2)_y + ν Δu   (conservative)      R = (ẋ − u)·∇u + ν Δu   (advective)
/// (uⁿ⁺¹ − uⁿ)/Δt = ½ R(uⁿ; meshⁿ) + ½ R(uⁿ⁺¹; meshⁿ⁺¹)
/// ```
///
/// with ẋ = (xⁿ⁺¹ − xⁿ)/Δt in both halves, solved by Newton's method with the true Jacobian. Second order in space
/// and time.
///
/// # Source
/// (4.1) of Bihlo, Haynes and Walsh (2015), whose diffusion has the wrong sign in print and whose exact solution has
/// t₀ where t must stand.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Burgers {
    /// The viscosity ν, above 0.
    pub viscosity: f64,
    /// Form of the convection term.
    #[serde(default)]
    pub convection: Convection,
    /// Numerical flux through the faces of dual cells, in the flux form.
    #[serde(default)]
    pub flux: BurgersFlux,
    /// u at the start, a formula of x and y (and t, the start time); the exact front by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub initial: Option<String>,
    /// u on bounded sides, a formula of x, y and t; only with `initial`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub boundary: Option<String>,
    /// The formulas of `initial` and `boundary`, compiled.
    #[serde(skip)]
    given: [Option<Program<2, 1>>; 2],
    #[serde(skip)]
    volumes: FiniteVolumes<1>,
    #[serde(skip)]
    solver: Robust<1>,
    /// The newest mesh with its stencils, on which the next step starts.
    #[serde(skip)]
    newest: Option<(Mesh<2>, Stencils)>,
}

/// Form of the convection term.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Convection {
    /// (u²/2)_x + (u²/2)_y by central differences at nodes.
    Conservative,
    /// u u_x + u u_y by central differences at nodes.
    Advective,
    /// Finite volumes on dual cells: Σ A u changes only by the flux through the sides, on any moving mesh. Where cells
    /// are wider than 2ν/u and u changes over them by more than a few hundredths of its range, the flux through a face
    /// is limited toward that of the upstream value.
    #[default]
    Flux,
}

/// Numerical flux for values a and b on both sides of a face with normal N, divided by N_x + N_y, in the flux form.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum BurgersFlux {
    /// ½ a b. It conserves Σ A ln u too, and is the most accurate of the three in thin fronts; u may undershoot a
    /// little.
    #[default]
    Product,
    /// (a² + ab + b²)/6. It conserves Σ A u² too.
    Energy,
    /// ¼ (a² + b²), the mean of the fluxes of both values.
    Central,
}

impl BurgersFlux {
    /// The flux between two values, and its derivatives by both.
    #[inline(always)]
    pub(super) fn between(self, a: f64, b: f64) -> (f64, f64, f64) {
        match self {
            Self::Product => (0.5 * a * b, 0.5 * b, 0.5 * a),
            Self::Energy => ((a * a + a * b + b * b) / 6.0, (2.0 * a + b) / 6.0, (a + 2.0 * b) / 6.0),
            Self::Central => (0.25 * (a * a + b * b), 0.5 * a, 0.5 * b),
        }
    }
}

impl Burgers {
    /// Burgers' equation with a viscosity and a form of its convection term.
    ///
    /// # Errors
    /// As [`Burgers::check`].
    pub fn new(viscosity: f64, convection: Convection) -> Result<Self> {
        Self {
            viscosity,
            convection,
            flux: BurgersFlux::default(),
            initial: None,
            boundary: None,
            given: [None, None],
            volumes: FiniteVolumes::default(),
            solver: Robust::default(),
            newest: None,
        }
        .compiled()
    }

    /// The same equation with initial values of your own, as a formula of x, y and t; `boundary` is needed on bounded
    /// sides.
    ///
    /// # Errors
    /// As [`Burgers::check`].
    pub fn from(self, initial: &str, boundary: Option<&str>) -> Result<Self> {
        Self { initial: Some(initial.into()), boundary: boundary.map(Into::into), ..self }.compiled()
    }

    /// Refuses settings out of range.
    ///
    /// # Errors
    /// [`Error::Invalid`] unless ν is positive and finite; [`Error::Formula`] where the text of a formula is wrong.
    pub fn check(&self) -> Result<()> {
        self.clone().compiled().map(|_| ())
    }

    /// The equation with its formulas compiled.
    pub(super) fn compiled(mut self) -> Result<Self> {
        if !(self.viscosity.is_finite() && self.viscosity > 0.0) {
            return Err(Error::invalid("viscosity", self.viscosity, "must be a finite number above 0"));
        }
        if let (None, Some(boundary)) = (&self.initial, &self.boundary) {
            let rule = "without initial the front gives the sides; add initial, or leave it out";
            return Err(Error::invalid("boundary", format!("{boundary:?}"), rule));
        }
        for (n, (key, text)) in [("initial", &self.initial), ("boundary", &self.boundary)].into_iter().enumerate() {
            self.given[n] = match text {
                Some(text) => Some(Program::new([&formula::<2>(key, text)?])),
                None => None,
            };
        }
        Ok(self)
    }

    /// The exact solution.
    #[inline(always)]
    pub fn front(&self, t: f64, x: [f64; 2]) -> f64 {
        1.0 / (1.0 + exp((x[0] + x[1] - t) / (2.0 * self.viscosity)))
    }

    /// u on a bounded side, where it is given.
    pub(super) fn side_value(&self, t: f64, x: [f64; 2]) -> Option<f64> {
        match &self.given {
            [_, Some(boundary)] => Some(boundary.eval(x, &[t])[0]),
            [Some(_), None] => None,
            [None, None] => Some(self.front(t, x)),
        }
    }

    fn on_mesh(&self, t: f64, mesh: &Mesh<2>) -> Field {
        let mut u = vec![0.0; mesh.x().len()];
        pulp::Arch::new().dispatch(FrontAt { burgers: self, t, x: mesh.x(), u: &mut u });
        Field::scalar(u)
    }
}

/// The exact front at many places as a task for [`pulp`], which compiles it for wider vectors too.
struct FrontAt<'a> {
    burgers: &'a Burgers,
    t: f64,
    x: &'a [[f64; 2]],
    u: &'a mut [f64],
}

impl pulp::WithSimd for FrontAt<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        self.u.iter_mut().zip(self.x).for_each(|(u, &x)| *u = self.burgers.front(self.t, x));
    }
}

impl Law<1> for Burgers {
    type Node = f64;
    /// Fluxes in wide cells are limited where u changes over a face by more than these shares of its range. Where a
    /// layer that the mesh resolves begins and ends, cells are wide and u changes little over them: the flux `product`
    /// hardly oscillates there, and limited fluxes have up to twice the error.
    const COUNTING: Option<[f64; 2]> = Some([0.02, 0.05]);

    fn names(&self) -> [&'static str; 1] {
        ["u"]
    }

    fn nodes(&self, _t: f64, _x: &[[f64; 2]], u: &[[f64; 1]]) -> Vec<f64> {
        u.as_flattened().to_vec()
    }

    #[inline(always)]
    fn convection(&self, &a: &f64, &b: &f64, [nx, ny]: [f64; 2]) -> Crossing<1> {
        let n = nx + ny;
        let (value, by_a, by_b) = self.flux.between(a, b);
        Crossing { value: [n * value], by_below: [[n * by_a]], by_above: [[n * by_b]] }
    }

    #[inline(always)]
    fn diffusivity(&self, _: &f64, _: &f64) -> Crossing<1> {
        Crossing { value: [self.viscosity], by_below: [[0.0]], by_above: [[0.0]] }
    }

    /// No coupled mass: for u = x/t the errors of the product flux and of A u on growing cells cancel.
    fn shares_mass(&self) -> [bool; 1] {
        [false]
    }

    fn damped(&self) -> [bool; 1] {
        [true]
    }

    fn has_own_flux(&self) -> [bool; 1] {
        [true]
    }

    fn side(&self, t: f64, x: [f64; 2], _beyond: [[bool; 2]; 2]) -> [Option<f64>; 1] {
        [self.side_value(t, x)]
    }
}

impl Physics for Burgers {
    fn unknowns(&self) -> Vec<String> {
        vec!["u".into()]
    }

    fn initial(&self, t: f64, mesh: &Mesh<2>) -> Field {
        match &self.given[0] {
            Some(formula) => Field::nodal(evaluate(formula, t, mesh)),
            None => self.on_mesh(t, mesh),
        }
    }

    fn side_values(&self, t: f64, x: [f64; 2], _beyond: [[bool; 2]; 2]) -> Vec<Option<f64>> {
        vec![self.side_value(t, x)]
    }

    fn keeps_range(&self) -> Vec<bool> {
        vec![true]
    }

    fn exact(&self, t: f64, mesh: &Mesh<2>) -> Option<Field> {
        self.given[0].is_none().then(|| self.on_mesh(t, mesh))
    }

    fn areas(&self, mesh: &Mesh<2>) -> Vec<f64> {
        match self.convection {
            Convection::Flux => DualCells::new(mesh).areas().to_vec(),
            Convection::Conservative | Convection::Advective => node_areas(mesh),
        }
    }

    fn step(&mut self, motion: Motion<'_>, u: &Field) -> Result<(Field, Work), Failure> {
        let start = nodal::<2, 1>(motion, u)?;
        if self.convection == Convection::Flux {
            let mut volumes = std::mem::take(&mut self.volumes);
            let stepped = volumes.step(self, motion, start);
            self.volumes = volumes;
            return stepped.map(|(values, work)| (Field::nodal(values), work));
        }
        self.step_by_differences(motion, u)
    }
}
