use super::{Motion, Physics, formula};
use crate::error::{Error, Failure, Result};
use crate::formula::Program;
use crate::geometry::{Field, Mesh};
use crate::work::Work;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A prescribed field instead of an equation: the solution, or the mesh density itself, as a formula of x, y and t
///
/// The mesh follows `u`, with its exact gradient, or `rho` as it is. Exactly one of the two is given.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Prescribed {
    /// The solution, a formula of x, y and t.
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
        self.field().map(|_| ())
    }

    /// The formula, compiled.
    ///
    /// # Errors
    /// As [`Prescribed::check`].
    pub fn field(&self) -> Result<PrescribedField> {
        match (&self.u, &self.rho) {
            (Some(u), None) => {
                let f = formula("u", u)?;
                let slope = |d| f.derivative(d).map_err(|mistake| super::mistaken("u", u, mistake));
                Ok(PrescribedField::Solution(Program::new([&f, &slope(0)?, &slope(1)?])))
            }
            (None, Some(rho)) => Ok(PrescribedField::Density(Program::new([&formula("rho", rho)?]))),
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
pub enum PrescribedField {
    /// u, u_x and u_y.
    Solution(Program<2, 3>),
    /// ρ.
    Density(Program<2, 1>),
}

impl PrescribedField {
    fn at(&self, t: f64, mesh: &Mesh<2>) -> Field {
        Field::scalar(match self {
            Self::Solution(program) => evaluate(program, t, mesh).into_iter().map(|[u, ..]| u).collect(),
            Self::Density(program) => evaluate(program, t, mesh).into_iter().map(|[rho]| rho).collect(),
        })
    }
}

/// The values of formulas of x, y and t at all nodes of a mesh, or at their images in the box.
pub(super) fn evaluate<const K: usize>(program: &Program<2, K>, t: f64, mesh: &Mesh<2>) -> Vec<[f64; K]> {
    let mut out = vec![[0.0; K]; mesh.x().len()];
    program.eval_each(&mesh.images(), &[t], &mut out);
    out
}

impl Physics for PrescribedField {
    fn unknowns(&self) -> Vec<String> {
        match self {
            Self::Solution(_) => vec!["u".into()],
            Self::Density(_) => vec!["prescribed".into()],
        }
    }

    fn initial(&self, t: f64, mesh: &Mesh<2>) -> Field {
        self.at(t, mesh)
    }

    fn step(&mut self, motion: Motion<'_>, _u: &Field) -> Result<(Field, Work), Failure> {
        Ok((self.at(motion.t + motion.dt, motion.new), Work::default()))
    }

    fn is_given(&self) -> bool {
        true
    }

    fn gradient(&self, t: f64, mesh: &Mesh<2>) -> Option<Vec<[f64; 2]>> {
        match self {
            Self::Solution(program) => Some(evaluate(program, t, mesh).into_iter().map(|[_, x, y]| [x, y]).collect()),
            Self::Density(_) => None,
        }
    }
}
