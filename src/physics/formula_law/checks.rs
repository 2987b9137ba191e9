//! What an equation refuses of the values of its formulas.

use super::FormulaLaw;
use crate::error::Failure;
use crate::geometry::Mesh;
use crate::physics::prescribed::evaluate;

/// A diffusivity may be negative by up to this share of its largest value, as where it is a function of a solution that
/// oscillates slightly around zero.
pub(super) const WIGGLES: f64 = 1e-3;
/// After the start, a diffusivity that vanishes at a value of an unknown may be negative by up to this share of its
/// largest value: the solution overshoots that value at fronts.
pub(super) const BEYOND: f64 = 0.1;

impl<const D: usize, const B: usize, const P: usize, const K: usize, Solver: Default> FormulaLaw<D, B, P, K, Solver> {
    /// Refuses a diffusivity that is more negative than a share of its largest value; `node` is that of a place.
    pub(super) fn check_diffusivities(
        &self,
        mesh: &Mesh<D>,
        nodes: &[[f64; K]],
        shares: [f64; B],
        node: impl Fn(usize) -> usize,
    ) -> Result<(), Failure> {
        for (c, share) in shares.into_iter().enumerate() {
            let values = || nodes.iter().map(|node| Self::value(node, Self::DIFFUSIVITY, c));
            let [least, largest] = values().fold([0.0_f64; 2], |[l, h], value| [l.min(value), h.max(value.abs())]);
            if least < -share * largest {
                let k = node(values().position(|value| value == least).unwrap_or_default());
                let at = mesh.node_place(k);
                return Err(Failure::NotPositive { what: "the diffusivity of a formula", value: least, at });
            }
        }
        Ok(())
    }

    pub(super) fn check_exact(&self, t: f64, mesh: &Mesh<D>) -> Result<(), Failure> {
        for (c, exact) in &self.exact {
            let values = evaluate(exact, t, mesh);
            if let Some(k) = values.iter().position(|[u]| !u.is_finite()) {
                return Err(self.failure(format!("`pde.exact.{}`", self.names[*c]), values[k][0], mesh, k, None));
            }
        }
        Ok(())
    }

    /// Refuses boundary values that are not finite.
    pub(super) fn check_sides(&self, t: f64, mesh: &Mesh<D>) -> Result<(), Failure> {
        for k in mesh.lattice().sides() {
            let beyond = mesh.lattice().beyond(k);
            for (c, value) in self.given(t, mesh.image(mesh.x()[k]), beyond).into_iter().enumerate() {
                if let Some(value) = value.filter(|value| !value.is_finite()) {
                    return Err(self.failure(format!("`pde.boundary.{}`", self.names[c]), value, mesh, k, None));
                }
            }
        }
        Ok(())
    }
}
