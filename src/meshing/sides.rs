use super::mmpde::cell_means;
use super::{Form, Mmpde};
use crate::error::{Failure, Result};
use crate::geometry::{Lattice, Mesh, Patch};
use crate::numerics::linear::Robust;
use crate::work::Work;

/// Moves the nodes along the bounded sides of the box: the mesh equation in one dimension, on each side by itself
///
/// On a side the coordinate across it is fixed and the one along it solves the mesh equation with the ρ of the side;
/// corners stay. `x` holds the old positions of all nodes and receives the new ones on the sides.
pub fn move_sides(
    equation: &Mmpde,
    mesh: &Mesh<2>,
    rho: &[f64],
    dt: f64,
    x: &mut [[f64; 2]],
    solver: &mut Robust<1>,
) -> Result<Work, Failure> {
    let lattice = mesh.lattice();
    let (cells, nodes, strides) = (lattice.cells(), lattice.nodes(), lattice.strides());
    let mut work = Work::default();
    let cell_rho = match equation.form {
        Form::Gradient(_) => None,
        Form::Conservative => Some(cell_means(lattice, rho)),
    };
    for across in (0..2).filter(|&d| !lattice.periodic()[d]) {
        let along = 1 - across;
        let line = Lattice::<1>::new([cells[along]], [lattice.periodic()[along]]).expect("an axis of a lattice is one");
        let jump = [[mesh.extent()[along]]];
        for end in [0, cells[across]] {
            let place = |i: usize| end * strides[across] + i * strides[along];
            let side_rho: Vec<f64> = (0..nodes[along]).map(|i| rho[place(i)]).collect();
            let old: Vec<[f64; 1]> = (0..nodes[along]).map(|i| [mesh.x()[place(i)][along]]).collect();
            let patch = Patch::whole(&line);
            let operator = match &cell_rho {
                None => equation.operator(&line, &side_rho, dt)?,
                Some(rho) => {
                    // the one row of cells beside the side
                    let row = if end == 0 { 0 } else { cells[across] - 1 };
                    let cell = |i: usize| if across == 0 { row * cells[1] + i } else { i * cells[1] + row };
                    equation.on_cells(&line, &(0..cells[along]).map(|i| rho[cell(i)]).collect::<Vec<_>>(), dt)
                }
            };
            let (new, cost) = operator.solve::<3, 1>(patch, &old, &old, jump, solver, [size(mesh)[along]])?;
            work += cost;
            for (i, k) in patch.nodes(&line).zip(patch.places()) {
                x[place(i)][along] = new[k][0];
            }
        }
    }
    Ok(work)
}

/// What is added to positions on wrapping around each axis.
pub(super) fn jump(mesh: &Mesh<2>) -> [[f64; 2]; 2] {
    let [width, height] = mesh.extent();
    [[width, 0.0], [0.0, height]]
}

/// The largest coordinate along each axis.
pub(super) fn size(mesh: &Mesh<2>) -> [f64; 2] {
    std::array::from_fn(|d| mesh.lower()[d].abs().max(mesh.upper()[d].abs()))
}
