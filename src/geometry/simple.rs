use super::Mesh;
use super::quality::{cross, minus};
use crate::error::Failure;

/// Refuses a bounded mesh whose sides touch or cross each other
///
/// Together with [`check_unfolded`](super::check_unfolded) this makes the map from the lattice one to one: no cell is
/// folded, and the sides form one simple curve.
///
/// # Errors
/// [`Failure::SelfTouching`] with the two cells at the first such place. Periodic meshes are not checked.
pub fn check_simple(mesh: &Mesh<2>) -> Result<(), Failure> {
    let lattice = mesh.lattice();
    if lattice.periodic().contains(&true) {
        return Ok(());
    }
    let [n, m] = lattice.cells();
    let x = mesh.x();
    // the sides in one turn around the mesh: (nodes at both ends of an edge, its cell)
    let south = (0..n).map(|i| ([i, 0], [i + 1, 0], [i, 0]));
    let east = (0..m).map(|j| ([n, j], [n, j + 1], [n - 1, j]));
    let north = (0..n).rev().map(|i| ([i + 1, m], [i, m], [i, m - 1]));
    let west = (0..m).rev().map(|j| ([0, j + 1], [0, j], [0, j]));
    let mut edges: Vec<_> = (south.chain(east).chain(north).chain(west).enumerate())
        .map(|(k, (a, b, cell))| (k, [x[lattice.index(a)], x[lattice.index(b)]], cell))
        .collect();
    let count = edges.len();
    let low = |e: &[[f64; 2]; 2], d: usize| e[0][d].min(e[1][d]);
    let high = |e: &[[f64; 2]; 2], d: usize| e[0][d].max(e[1][d]);
    // points closer than this may coincide but for rounding
    let reach = 8.0 * f64::EPSILON * x.iter().flatten().fold(0.0_f64, |m, x| m.max(x.abs()));
    edges.sort_by(|a, b| low(&a.1, 0).total_cmp(&low(&b.1, 0)));
    for (place, (k, a, cell)) in edges.iter().enumerate() {
        for (l, b, other) in edges[place + 1..].iter().take_while(|(_, b, _)| low(b, 0) <= high(a, 0) + reach) {
            let apart = k.abs_diff(*l);
            let neighbours = apart == 1 || apart == count - 1;
            if neighbours || low(a, 1) > high(b, 1) + reach || low(b, 1) > high(a, 1) + reach {
                continue;
            }
            let sides = |[p, q]: [[f64; 2]; 2], r: [[f64; 2]; 2]| {
                let along = minus(q, p);
                r.map(|r| cross(along, minus(r, p)))
                    .map(|s| if s.abs() <= reach * along[0].hypot(along[1]) { 0.0 } else { s })
            };
            let ([s, t], [v, w]) = (sides(*a, *b), sides(*b, *a));
            if s * t <= 0.0 && v * w <= 0.0 {
                let share = if v == w { 0.5 } else { v / (v - w) };
                let meet = [0, 1].map(|d| a[0][d] + share * (a[1][d] - a[0][d]));
                return Err(Failure::SelfTouching { cells: [*cell, *other], x: meet });
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Lattice, check_unfolded};

    /// An annulus of 1.1 turns folds no cell but lies on itself, one of a whole turn but for rounding; one of 0.9 does
    /// not.
    #[test]
    fn a_mesh_that_lies_on_itself_is_refused() {
        let annulus = |turns: f64| {
            let lattice = Lattice::bounded([4, 40]).unwrap();
            let x = (0..lattice.len()).map(|k| {
                let [i, j] = lattice.node(k);
                let (r, angle) = (1.0 + i as f64 / 4.0, turns * std::f64::consts::TAU * j as f64 / 40.0);
                [r * angle.cos(), r * angle.sin()]
            });
            Mesh::mapped(lattice, x.collect()).unwrap()
        };
        assert!(check_unfolded(&annulus(1.1)).is_ok());
        for turns in [1.1, 1.0] {
            let error = check_simple(&annulus(turns)).unwrap_err();
            assert!(matches!(error, Failure::SelfTouching { .. }), "{turns}: {error}");
        }
        assert!(check_simple(&annulus(0.9)).is_ok());
    }
}
