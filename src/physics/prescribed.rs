use super::{Motion, Physics, formula};
use crate::error::{Error, Failure, Result};
use crate::formula::{Formula, Program};
use crate::geometry::{Field, Mesh};
use crate::work::Work;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A prescribed field instead of an equation: the solution, or the mesh density itself, as a formula of place and time
///
/// The mesh follows `u`, with its exact gradient, or `rho` as it is. Exactly one of the two is given.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Prescribed {
    /// The solution, a formula of x, y and t; without y in one dimension.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub u: Option<String>,
    /// The density, a formula of x, y and t that is positive everywhere; the monitor must be of kind `given`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rho: Option<String>,
}

impl Prescribed {
    /// Refuses a text that is no formula.
    ///
    /// # Errors
    /// [`Error::Invalid`] unless exactly one of the two is given; [`Error::Formula`] where its text is wrong.
    pub fn check(&self) -> Result<()> {
        self.field::<2>().map(|_| ())
    }

    /// The formula for meshes of D dimensions, compiled.
    ///
    /// # Errors
    /// As [`Prescribed::check`].
    pub fn field<const D: usize>(&self) -> Result<PrescribedField<D>> {
        match (&self.u, &self.rho) {
            (Some(u), None) => {
                let f = formula::<D>("u", u)?;
                let slopes = (0..D).map(|d| f.derivative(d).map_err(|mistake| mistake.of("u", u)));
                let slopes: Vec<Formula> = slopes.collect::<Result<_>>()?;
                let gradient = Program::new(std::array::from_fn(|d| &slopes[d]));
                Ok(PrescribedField::Solution { u: Program::new([&f]), gradient })
            }
            (None, Some(rho)) => Ok(PrescribedField::Density(Program::new([&formula::<D>("rho", rho)?]))),
            (None, None) => Err(Error::invalid("u", "not given", "pde.kind = \"prescribed\" needs a formula u or rho")),
            (Some(_), Some(rho)) => Err(Error::invalid(
                "rho",
                format!("{rho:?}"),
                "only one of u and rho can be given; leave the other out",
            )),
        }
    }
}

/// A prescribed solution or density, ready to be evaluated.
#[derive(Debug, Clone)]
#[allow(clippy::large_enum_variant)] // one value a run
pub enum PrescribedField<const D: usize = 2> {
    /// A solution and its gradient.
    Solution {
        /// The solution u.
        u: Program<D, 1>,
        /// The gradient ∇u.
        gradient: Program<D, D>,
    },
    /// The density ρ.
    Density(Program<D, 1>),
}

impl<const D: usize> PrescribedField<D> {
    fn at(&self, t: f64, mesh: &Mesh<D>) -> Field {
        let (Self::Solution { u: program, .. } | Self::Density(program)) = self;
        Field::scalar(evaluate(program, t, mesh).into_flattened())
    }
}

/// The values of formulas of place and time at all nodes of a mesh, or at their images in the box.
pub(super) fn evaluate<const D: usize, const K: usize>(
    program: &Program<D, K>,
    t: f64,
    mesh: &Mesh<D>,
) -> Vec<[f64; K]> {
    let mut out = vec![[0.0; K]; mesh.x().len()];
    program.eval_each(&mesh.images(), &[t], &mut out);
    out
}

impl<const D: usize> Physics<D> for PrescribedField<D> {
    fn unknowns(&self) -> Vec<String> {
        match self {
            Self::Solution { .. } => vec!["u".into()],
            Self::Density(_) => vec!["prescribed".into()],
        }
    }

    fn initial(&self, t: f64, mesh: &Mesh<D>) -> Field {
        self.at(t, mesh)
    }

    fn step(&mut self, motion: Motion<'_, D>, _u: &Field) -> Result<(Field, Work), Failure> {
        Ok((self.at(motion.t + motion.dt, motion.new), Work::default()))
    }

    fn is_given(&self) -> bool {
        true
    }

    fn gradient(&self, t: f64, mesh: &Mesh<D>) -> Option<Vec<[f64; D]>> {
        match self {
            Self::Solution { gradient, .. } => Some(evaluate(gradient, t, mesh)),
            Self::Density(_) => None,
        }
    }
}
