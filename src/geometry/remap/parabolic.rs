//! Fields carried by parabolas along each axis, kept within bounds by limited corrections of upwind fluxes.

use crate::geometry::{Cells, DualCells, Lattice, Mesh, padded};

/// The share of the upwind parabola in the value at a face; the rest is the mean of the parabolas on both sides, which
/// is of fourth order. Without it short waves would stay for ever; all of it lowers peaks four times as much.
const UPWIND: f64 = 0.25;

/// Widths of the dual cells along each axis, in padded order; 0 beyond a bounded side.
pub(super) struct Widths<const D: usize>(Vec<[f64; D]>);

impl<const D: usize> Widths<D>
where
    Mesh<D>: Cells<D>,
{
    pub fn of(mesh: &Mesh<D>, cells: &DualCells<D>) -> Self {
        let patch = cells.patch();
        let x = padded(mesh.lattice(), mesh.x(), mesh.jump());
        let strides = patch.padded_strides();
        let apart = |a: usize, b: usize| (0..D).map(|c| (x[a][c] - x[b][c]).powi(2)).sum::<f64>().sqrt();
        let mut widths = vec![[0.0; D]; x.len()];
        for k in patch.places() {
            widths[k] = strides.map(|s| 0.5 * (apart(k + s, k) + apart(k, k - s)));
        }
        patch.wrap(&mut widths);
        Self(widths)
    }
}

/// The value at the edge of the middle one of three cells toward the third, from their means u and widths w: that of
/// the cubic through the integrals; of the parabola where there is no first cell
fn edge(u: [f64; 3], w: [f64; 3]) -> f64 {
    let toward = (u[2] - u[1]) / (w[1] + w[2]);
    if w[0] == 0.0 {
        return u[1] + w[1] * toward;
    }
    if w[2] == 0.0 {
        return u[1];
    }
    let from = (u[1] - u[0]) / (w[0] + w[1]);
    u[1] + w[1] * from + w[1] * (w[0] + w[1]) * (toward - from) / (w[0] + w[1] + w[2])
}

/// The step of a field whose cells change from the first to the second of `cells`: three stages of a strong-stability
/// preserving method, whose fluxes correct upwind ones as far as the field stays within its bounds.
///
/// # Source
/// Shu and Osher (1988), of third order; Zalesak, *Fully multidimensional flux-corrected transport* (1979).
pub(super) fn stepped<const D: usize>(
    lattice: &Lattice<D>,
    u: &[f64],
    [old, new]: [&DualCells<D>; 2],
    widths: &Widths<D>,
    bounds: [f64; 2],
) -> Vec<f64>
where
    Mesh<D>: Cells<D>,
{
    let faces = Faces { lattice, cells: old, swept: old.swept(new), widths };
    let areas = |k: usize| [old.areas()[k], new.areas()[k]];
    let every = |f: &dyn Fn(usize) -> f64| -> Vec<f64> { (0..u.len()).map(f).collect() };
    let first = faces.fluxes(u, true);
    let c = faces.gains(&first);
    let one = every(&|k| (areas(k)[0] * u[k] + c[k]) / areas(k)[1]);
    let second = faces.fluxes(&one, true);
    let c = faces.gains(&second);
    let two = every(&|k| {
        let [before, after] = areas(k);
        (0.75 * before * u[k] + 0.25 * (after * one[k] + c[k])) / (0.5 * (before + after))
    });
    let third = faces.fluxes(&two, true);
    let low = faces.fluxes(u, false);
    let c = faces.gains(&low);
    let safe = every(&|k| (areas(k)[0] * u[k] + c[k]) / areas(k)[1]);
    let mut corrections: Vec<[f64; D]> = (0..low.len())
        .map(|k| std::array::from_fn(|d| (first[k][d] + second[k][d] + 4.0 * third[k][d]) / 6.0 - low[k][d]))
        .collect();
    faces.limit(&mut corrections, &safe, new, bounds);
    let c = faces.gains(&corrections);
    // what is left beyond the bounds is round-off
    every(&|k| (safe[k] + c[k] / areas(k)[1]).clamp(bounds[0], bounds[1]))
}

struct Faces<'a, const D: usize> {
    lattice: &'a Lattice<D>,
    cells: &'a DualCells<D>,
    swept: Vec<[f64; D]>,
    widths: &'a Widths<D>,
}

impl<const D: usize> Faces<'_, D>
where
    Mesh<D>: Cells<D>,
{
    /// What goes into the cell below each face, at the place of this cell: by parabolas or by upwind values.
    fn fluxes(&self, values: &[f64], parabolas: bool) -> Vec<[f64; D]> {
        let patch = self.cells.patch();
        let (strides, width) = (patch.padded_strides(), &self.widths.0);
        let nodal: Vec<[f64; 1]> = values.iter().map(|u| [*u]).collect();
        let u: Vec<f64> = padded(self.lattice, &nodal, [[0.0]; D]).into_flattened();
        // values of each cell at its lower and its upper face
        let mut edges: Vec<[[f64; 2]; D]> = u.iter().map(|&u| [[u; 2]; D]).collect();
        for k in patch.places().filter(|_| parabolas) {
            edges[k] = std::array::from_fn(|d| {
                let s = strides[d];
                let at = |places: [usize; 3]| edge(places.map(|k| u[k]), places.map(|k| width[k][d]));
                [at([k + s, k, k - s]), at([k - s, k, k + s])]
            });
        }
        patch.wrap(&mut edges);
        let mut fluxes = vec![[0.0; D]; u.len()];
        for k in patch.places() {
            fluxes[k] = std::array::from_fn(|d| {
                let swept = self.swept[k][d];
                let [below, above] = [edges[k][d][1], edges[k + strides[d]][d][0]];
                // a face that moves up takes in what is above it
                let [taken, left] = if swept > 0.0 { [above, below] } else { [below, above] };
                swept * if parabolas { UPWIND * taken + (1.0 - UPWIND) * 0.5 * (taken + left) } else { taken }
            });
        }
        patch.wrap(&mut fluxes);
        fluxes
    }

    /// What the faces bring into each cell.
    fn gains(&self, fluxes: &[[f64; D]]) -> Vec<f64> {
        let (patch, strides) = (self.cells.patch(), self.cells.patch().padded_strides());
        patch.places().map(|k| (0..D).map(|d| fluxes[k][d] - fluxes[k - strides[d]][d]).sum()).collect()
    }

    /// Shortens corrections so that they leave no value beyond the bounds.
    fn limit(&self, corrections: &mut [[f64; D]], safe: &[f64], new: &DualCells<D>, [low, high]: [f64; 2]) {
        let (patch, strides) = (self.cells.patch(), self.cells.patch().padded_strides());
        // shares of what comes in, and of what goes out, that a cell takes
        let mut shares = vec![[1.0_f64; 2]; corrections.len()];
        for (place, k) in patch.places().enumerate() {
            let mut sums = [0.0; 2];
            for d in 0..D {
                for part in [corrections[k][d], -corrections[k - strides[d]][d]] {
                    sums[usize::from(part < 0.0)] += part.abs();
                }
            }
            let room = [high - safe[place], safe[place] - low].map(|room| room.max(0.0) * new.areas()[place]);
            shares[k] = [0, 1].map(|c| if sums[c] > room[c] { room[c] / sums[c] } else { 1.0 });
        }
        patch.wrap(&mut shares);
        for k in patch.places() {
            for d in 0..D {
                let above = k + strides[d];
                let part = corrections[k][d];
                let share =
                    if part > 0.0 { shares[k][0].min(shares[above][1]) } else { shares[k][1].min(shares[above][0]) };
                corrections[k][d] *= share;
            }
        }
        patch.wrap(corrections);
    }
}

#[cfg(test)]
mod tests {
    use crate::geometry::{Lattice, Mesh, Remap, remap_all};
    use std::f64::consts::PI;

    /// Third order in the mean on a periodic line, for a motion of half the wave; many fields at once are each as one.
    #[test]
    fn parabolas_are_of_third_order() {
        let bent = |n: usize, amount: f64| {
            let mesh = Mesh::uniform(Lattice::new([n], [true]).unwrap(), [0.0], [1.0]).unwrap();
            mesh.moved(mesh.x().iter().map(|[x]| [x + amount * (2.0 * PI * x).sin()]).collect()).unwrap()
        };
        // means of cos 2πx over the dual cells, which end halfway between nodes
        let means = |mesh: &Mesh<1>| -> Vec<f64> {
            let x: Vec<f64> = mesh.x().iter().map(|x| x[0]).collect();
            let n = x.len();
            let primitive = |x: f64| (2.0 * PI * x).sin() / (2.0 * PI);
            let ends = |k: usize| {
                let above = if k + 1 == n { x[0] + 1.0 } else { x[k + 1] };
                let below = if k == 0 { x[n - 1] - 1.0 } else { x[k - 1] };
                [0.5 * (below + x[k]), 0.5 * (x[k] + above)]
            };
            (0..n).map(ends).map(|[a, b]| (primitive(b) - primitive(a)) / (b - a)).collect()
        };
        let error = |n: usize| {
            let [from, to] = [bent(n, -0.05), bent(n, 0.05)];
            let u = means(&from);
            let twice: Vec<f64> = u.iter().map(|u| 2.0 * u).collect();
            let carried = remap_all(&from, &[&u, &twice], &to, Remap::Parabolic(None)).unwrap();
            assert!(carried[0].iter().zip(&carried[1]).all(|(a, b)| (2.0 * a - b).abs() < 1e-13));
            carried[0].iter().zip(means(&to)).map(|(v, e)| (v - e).abs()).sum::<f64>() / n as f64
        };
        let order = (error(32) / error(128)).log(4.0);
        assert!(order > 2.6, "observed order {order:.2}, expected 3");
    }
}
