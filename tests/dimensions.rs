//! The same generator in one, two and three dimensions.

use driftmesh::geometry::{Density, Lattice, Mesh, check_unfolded};
use driftmesh::meshing::{MeshGenerator, Mmpde, Moved, Whole};

/// ρ(x) = Π_d exp(x_d) has the mesh of its factors: along each axis ∫eˣ is the same in all cells.
fn exact(xi: f64) -> f64 {
    (1.0 + xi * (1.0_f64.exp() - 1.0)).ln()
}

/// The largest distance from that mesh, of the mesh at rest in ρ.
fn error<const D: usize>(cells: usize) -> f64
where
    Whole<D>: MeshGenerator<D>,
{
    let mut mesh = Mesh::uniform(Lattice::bounded([cells; D]).unwrap(), [0.0; D], [1.0; D]).unwrap();
    let mut whole = Whole::<D>::to(1e-9);
    for _ in 0..200 {
        let rho: Density = mesh.x().iter().map(|x| x.iter().sum::<f64>().exp()).collect();
        let Moved { mesh: moved, work, .. } = whole.step(&Mmpde::default(), &mesh, &rho, 1.0).unwrap();
        assert_eq!(work.direct_solves(), 0, "{D} dimensions: left to elimination");
        let way = moved.farthest(&mesh);
        mesh = moved;
        if way < 1e-9 {
            break;
        }
    }
    check_unfolded(&mesh).unwrap();
    let lattice = *mesh.lattice();
    let off = |k: usize| {
        let node = lattice.node(k);
        (0..D).map(|d| (mesh.x()[k][d] - exact(node[d] as f64 / cells as f64)).abs()).fold(0.0, f64::max)
    };
    (0..lattice.len()).map(off).fold(0.0, f64::max)
}

fn is_second_order<const D: usize>(fine: usize)
where
    Whole<D>: MeshGenerator<D>,
{
    let order = (error::<D>(fine / 2) / error::<D>(fine)).log2();
    assert!((order - 2.0).abs() < 0.1, "{D} dimensions: observed order {order:.2}, expected 2");
}

#[test]
fn a_separable_density_is_equidistributed_with_second_order() {
    is_second_order::<1>(32);
    is_second_order::<2>(32);
    is_second_order::<3>(16);
}
