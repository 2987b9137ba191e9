//! A user's equation as physics: where it starts, and how it is stepped.

use super::FormulaLaw;
use crate::error::Failure;
use crate::geometry::{Cells, Field, Mesh};
use crate::numerics::linear::{RobustLine, RobustTransport};
use crate::physics::finite_volumes::Law;
use crate::physics::prescribed::evaluate;
use crate::physics::{Motion, Physics, nodal};
use crate::work::Work;

impl<const D: usize, const B: usize, const P: usize, const K: usize, Solver> Physics<D>
    for FormulaLaw<D, B, P, K, Solver>
where
    Solver: Default + Send + Sync,
    Self: Stepped<D, B>,
    Mesh<D>: Cells<D>,
{
    fn unknowns(&self) -> Vec<String> {
        self.names.to_vec()
    }

    fn initial(&self, t: f64, mesh: &Mesh<D>) -> Field {
        Field::nodal(evaluate(&self.initial, t, mesh))
    }

    fn side_values(&self, t: f64, x: [f64; D], beyond: [[bool; 2]; D]) -> Vec<Option<f64>> {
        self.given(t, x, beyond).to_vec()
    }

    fn check(&self, t: f64, mesh: &Mesh<D>, u: &Field) -> Result<(), Failure> {
        let values = u.values().as_chunks::<B>().0;
        if let Some(place) = u.values().iter().position(|u| !u.is_finite()) {
            let (k, c) = (place / B, place % B);
            return Err(self.failure(format!("`pde.initial.{}`", self.names[c]), values[k][c], mesh, k, None));
        }
        self.check_sides(t, mesh)?;
        self.check_exact(t, mesh)?;
        for (k, node) in self.nodes(t, &mesh.images(), values).iter().enumerate() {
            if let Some(worst) = node.iter().position(|v| !v.is_finite()) {
                return Err(self.failure(self.what(worst), node[worst], mesh, k, Some(&values[k])));
            }
        }
        Ok(())
    }

    fn exact(&self, t: f64, mesh: &Mesh<D>) -> Option<Field> {
        let unknown = |exact| evaluate(exact, t, mesh).into_flattened();
        let known: Vec<Vec<f64>> = self.exact.iter().map(|(_, exact)| unknown(exact)).collect();
        (!known.is_empty()).then(|| Field::joined(&known).expect("each has one value a node"))
    }

    fn keeps_range(&self) -> Vec<bool> {
        self.keeps_range.to_vec()
    }

    fn known(&self) -> Vec<usize> {
        self.exact.iter().map(|(c, _)| *c).collect()
    }

    fn areas(&self, mesh: &Mesh<D>) -> Vec<f64> {
        (self.cells)(mesh).areas().to_vec()
    }

    fn step(&mut self, motion: Motion<'_, D>, u: &Field) -> Result<(Field, Work), Failure> {
        let start = nodal::<D, B>(motion, u)?;
        let end = motion.t + motion.dt;
        self.check_sides(end, motion.new)?;
        let (values, work) = self.advanced(motion, start)?;
        self.check_exact(end, motion.new)?;
        Ok((Field::nodal(values), work))
    }
}

/// A step of finite volumes, whose stencils differ between the line and the plane.
trait Stepped<const D: usize, const B: usize> {
    fn advanced(&mut self, motion: Motion<'_, D>, start: &[[f64; B]]) -> Result<(Vec<[f64; B]>, Work), Failure>;
}

macro_rules! stepped {
    ($D:literal, $Solver:ty) => {
        impl<const B: usize, const P: usize, const K: usize> Stepped<$D, B> for FormulaLaw<$D, B, P, K, $Solver> {
            fn advanced(
                &mut self,
                motion: Motion<'_, $D>,
                start: &[[f64; B]],
            ) -> Result<(Vec<[f64; B]>, Work), Failure> {
                let mut volumes = std::mem::take(&mut self.volumes);
                let stepped = volumes.step(self, motion, start);
                self.volumes = volumes;
                stepped
            }
        }
    };
}

stepped!(1, RobustLine);
stepped!(2, RobustTransport<B>);
