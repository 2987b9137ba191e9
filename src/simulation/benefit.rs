use crate::error::Result;
use crate::geometry::{Cells, Mesh, interpolate, length, strides};
use crate::numerics::larger;
use serde::{Deserialize, Serialize};

/// What adaptation brought: how well the solution is interpolated on this mesh, and how well on one of equal cells
///
/// Both are estimates of the largest error of linear interpolation, in the unit of what the mesh follows. Without every
/// other node of a line of the lattice the values left out would be off by e₂; with all of them the error is about
/// e₂/4, where the mesh resolves the solution. On equal cells it is at least as large as what is lost on the way there
/// and back.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Benefit {
    /// Error of interpolation on this mesh.
    pub mesh: f64,
    /// Error of interpolation on as many equal cells.
    pub uniform: f64,
}

impl Benefit {
    /// The benefit of a mesh for nodal values on it.
    ///
    /// # Errors
    /// Where the box makes no mesh of equal cells.
    pub(super) fn of<const D: usize>(mesh: &Mesh<D>, u: &[f64]) -> Result<Self>
    where
        Mesh<D>: Cells<D>,
    {
        let equal = mesh.even(*mesh.lattice())?;
        let there = interpolate(mesh, u, &equal);
        let back = interpolate(&equal, &there, mesh);
        let lost = u.iter().zip(&back).fold(0.0, |m, (u, back)| larger(m, u - back));
        Ok(Self { mesh: left_out(mesh, u), uniform: larger(lost, left_out(&equal, &there)) })
    }
}

/// A quarter of what values are off when they are interpolated from both neighbours on a line of the lattice.
fn left_out<const D: usize>(mesh: &Mesh<D>, u: &[f64]) -> f64 {
    let lattice = mesh.lattice();
    let (x, u, cells) = (mesh.closed(), lattice.closed(u), lattice.cells());
    let nodes = cells.map(|n| n + 1);
    let strides = strides(nodes);
    let mut off = 0.0;
    for k in 0..u.len() {
        let node: [usize; D] = std::array::from_fn(|d| k / strides[d] % nodes[d]);
        for d in (0..D).filter(|&d| node[d] > 0 && node[d] < cells[d]) {
            let (below, above) = (k - strides[d], k + strides[d]);
            let edge = |a: usize, b: usize| length::<D>(std::array::from_fn(|d| x[a][d] - x[b][d]));
            let (first, second) = (edge(k, below), edge(above, k));
            let between = (second * u[below] + first * u[above]) / (first + second);
            off = larger(off, 0.25 * (u[k] - between));
        }
    }
    off
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Lattice;

    /// tanh(40 (x − ½)) is interpolated on 40 equal cells to 0.0894, its largest error over all places, and 25 times
    /// better by cells that are as much finer in the layer as it is thin; both are told to a fifth.
    #[test]
    fn interpolation_errors_are_told_where_the_layer_is_resolved() {
        let f = |x: f64| (40.0 * (x - 0.5)).tanh();
        let equal = Mesh::uniform(Lattice::bounded([80, 4]).unwrap(), [0.0; 2], [1.0; 2]).unwrap();
        let squeezed = |x: f64| 0.5 + 0.5 * (2.0 * x - 1.0).powi(3) * 0.9 + 0.1 * (x - 0.5);
        let fine = equal.moved(equal.x().iter().map(|x| [squeezed(x[0]), x[1]]).collect()).unwrap();
        let exact = |mesh: &Mesh<2>| {
            let places = mesh.x().iter().step_by(5).map(|x| x[0]).collect::<Vec<_>>();
            let worst = |w: &[f64]| {
                let inside = (1..100).map(|k| f64::from(k) / 100.0);
                inside.fold(0.0_f64, |m, s| {
                    m.max((f(w[0] + s * (w[1] - w[0])) - (1.0 - s) * f(w[0]) - s * f(w[1])).abs())
                })
            };
            places.windows(2).map(worst).fold(0.0, f64::max)
        };
        let u: Vec<f64> = fine.x().iter().map(|x| f(x[0])).collect();
        let told = Benefit::of(&fine, &u).unwrap();
        for (told, exact) in [(told.mesh, exact(&fine)), (told.uniform, exact(&equal))] {
            assert!((told / exact - 1.0).abs() < 0.3, "{told:e} where it is {exact:e}");
        }
        assert!(told.uniform > 3.0 * told.mesh, "{told:?}");
    }
}
