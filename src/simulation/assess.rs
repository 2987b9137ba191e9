//! What is told of a state: its mesh, its error, what is conserved, and what the mesh is worth.

use super::conserved::AtStart;
use super::{Benefit, ErrorNorms, Report, Simulation, State};
use crate::geometry::{Cells, Mesh, Quality, largest};
use crate::meshing::{Interface, Movable};

impl<const D: usize> Simulation<D>
where
    Mesh<D>: Movable<D>,
{
    /// Quality of the mesh, and the error where an exact solution is known.
    pub(super) fn assess(&self, state: &State<D>) -> (Quality, Option<ErrorNorms>) {
        let Some(exact) = self.physics.exact(state.t, &state.mesh) else {
            return (state.mesh.quality_and_integral(state.rho.largest(), state.rho.largest()).0, None);
        };
        let known = self.physics.known();
        let (mut linf, mut squares) = (0.0_f64, vec![0.0; state.mesh.x().len()]);
        for (n, &c) in known.iter().enumerate() {
            let errors: Vec<f64> = state.u.component(c).zip(exact.component(n)).map(|(u, exact)| u - exact).collect();
            linf = linf.max(largest(&errors));
            squares.iter_mut().zip(&errors).for_each(|(square, error)| *square += error * error);
        }
        let (quality, integral) = state.mesh.quality_and_integral(state.rho.largest(), &squares);
        let mean = integral / (state.mesh.volume() * known.len() as f64);
        (quality, Some(ErrorNorms { linf, l2: mean.sqrt() }))
    }

    pub(super) fn report(&self, state: &State<D>, at_start: &AtStart, interface: Option<Interface>) -> Report {
        let (quality, error) = self.assess(state);
        let followed = self.monitor.followed(state.t, &state.mesh, &state.u).ok();
        let benefit = followed.and_then(|u| Benefit::of(&state.mesh, &u).ok());
        Report {
            t: state.t,
            error,
            quality,
            conserved: at_start.conserved(&*self.physics, &state.mesh, &state.u),
            interface,
            comparison: None,
            benefit,
        }
    }
}
