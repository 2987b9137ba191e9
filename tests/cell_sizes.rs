//! Limits on the sizes of cells, as they cut a density.

use driftmesh::density::{CellSizes, Density};
use driftmesh::geometry::{Lattice, Mesh};
use proptest::prelude::*;

/// A line whose nodes stand at the running sums of some lengths.
fn line(lengths: &[f64], periodic: bool) -> Mesh<1> {
    let total: f64 = lengths.iter().sum();
    let nodes = lengths.iter().scan(0.0, |x, h| {
        let at = *x;
        *x += h / total;
        Some([at])
    });
    let lattice = Lattice::new([lengths.len()], [periodic]).unwrap();
    let end = (!periodic).then_some([1.0]);
    Mesh::uniform(lattice, [0.0], [1.0]).unwrap().moved(nodes.chain(end).collect()).unwrap()
}

proptest! {
    /// ρ lies between m/largest and m/smallest with its own mean m, is what it was where it is strictly between, and
    /// keeps its ratios when multiplied.
    #[test]
    fn a_density_is_cut_to_its_own_mean(
        cells in prop::collection::vec((0.05_f64..1.0, -3.0_f64..3.0), 3..40),
        periodic: bool,
        smallest in prop::option::of(0.05_f64..0.95),
        largest in prop::option::of(1.05_f64..5.0),
    ) {
        let lengths: Vec<f64> = cells.iter().map(|(h, _)| *h).collect();
        let mesh = line(&lengths, periodic);
        let rho: Vec<f64> = (0..mesh.x().len()).map(|k| 10_f64.powf(cells[k % cells.len()].1)).collect();
        let sizes = CellSizes { smallest, largest };
        let cut = sizes.limit(&mesh, rho.clone().into());
        let cut = cut.largest();
        // by the trapezoidal rule, over a length of 1
        let x = |k: usize| mesh.x().get(k).map_or(1.0, |x| x[0]);
        let at = |k: usize| cut[k % cut.len()];
        let mean: f64 = (0..cells.len()).map(|k| 0.5 * (at(k) + at(k + 1)) * (x(k + 1) - x(k))).sum();
        let [low, high] = [largest.map_or(0.0, |l| mean / l), smallest.map_or(f64::INFINITY, |s| mean / s)];
        for (rho, cut) in rho.iter().zip(cut) {
            prop_assert!(*cut >= low * (1.0 - 1e-9) && *cut <= high * (1.0 + 1e-9), "{cut} of {low} to {high}");
            let within = *rho > low * (1.0 + 1e-9) && *rho < high * (1.0 - 1e-9);
            prop_assert!(!within || rho == cut);
            prop_assert!(within || (cut / rho.clamp(low, high) - 1.0).abs() < 1e-9);
        }
        let tenfold: Density = rho.iter().map(|rho| 10.0 * rho).collect();
        for (tenfold, cut) in sizes.limit(&mesh, tenfold).largest().iter().zip(cut) {
            prop_assert!((tenfold / cut / 10.0 - 1.0).abs() < 1e-9);
        }
    }
}

/// A density in the plane becomes one for each axis where it is cut: along a layer nothing changes.
#[test]
fn mesh_lines_along_a_layer_keep_their_density() {
    let mesh = Mesh::uniform(Lattice::bounded([20, 10]).unwrap(), [0.0, 0.0], [1.0, 1.0]).unwrap();
    let rho: Vec<f64> = mesh.x().iter().map(|[x, _]| 1.0 + 50.0 * (-100.0 * (x - 0.5).powi(2)).exp()).collect();
    let cut = CellSizes { smallest: Some(0.5), largest: None }.limit(&mesh, rho.clone().into());
    assert_eq!(cut.along(1), rho);
    assert!(cut.along(0).iter().zip(&rho).any(|(cut, rho)| cut < rho));
}
