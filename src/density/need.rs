use crate::geometry::{Cells, Mesh, Patch, length, padded, strides};
use crate::numerics::difference::scaled_gradient;
use crate::numerics::larger;

/// Largest change of u over an equal cell, as a share of its range, up to which equal cells are good enough, and from
/// which on the density counts in full: a Gaussian is interpolated with an error of 1 % of its range at the first, and
/// of 2 % at the second.
const SLOPES: [f64; 2] = [0.18, 0.25];
/// Largest bends of u in both directions within [`WINDOW`] nodes, as shares of its range, up to which equal cells are
/// good enough, and from which on the density counts in full. A jump by J has the bends J where it is within a cell,
/// and J/2 where it is at a node, so that two cells share it and no slope tells of it.
const BENDS: [f64; 2] = [0.06, 0.09];
/// Number of nodes in a row over which bends are added up: those of a jump are in four of them.
const WINDOW: usize = 4;

/// Factor of [`SLOPES`] and [`BENDS`] on a mesh that is far from even: it goes back to equal cells only where these
/// resolve u that much better. On its way back a front would leave the nodes behind, which have to travel far, and pass
/// through cells wider than equal ones; and were the limits the same, a solution near them would send the mesh to and
/// fro.
const KEPT: f64 = 0.25;
/// 1 − (smallest cell)/(equal cell), by volume: up to the first a mesh counts as even, from the second on as far from
/// even.
const UNEVEN: [f64; 2] = [0.4, 0.7];

/// Error of linear interpolation on a mesh over that on equal cells, up to which the density counts in full, and from
/// which on not at all: it may draw nodes to steep slopes of smooth u and leave too few where u bends most.
const LOSS: [f64; 2] = [1.0, 1.5];

/// The need for a density that is not even
#[derive(Debug, Clone, Copy)]
pub(crate) struct Need {
    /// Factor of [`SLOPES`] and [`BENDS`] on this mesh, from [`KEPT`] to 1.
    kept: f64,
}

impl Need {
    /// The need of equal cells, whatever the mesh is.
    pub const OF_EQUAL_CELLS: Self = Self { kept: 1.0 };

    /// The need on a mesh, which is larger where the mesh is uneven.
    pub fn on<const D: usize>(mesh: &Mesh<D>) -> Self
    where
        Mesh<D>: Cells<D>,
    {
        let mesh = mesh.parameters();
        let cells: usize = mesh.lattice().cells().iter().product();
        let smallest = mesh.volumes().fold(f64::INFINITY, f64::min) * cells as f64;
        let uneven = between(UNEVEN, 1.0 - smallest / mesh.extent().iter().product::<f64>());
        Self { kept: 1.0 - (1.0 - KEPT) * uneven }
    }

    /// The need where u changes by at most `share` of its range over an equal cell: 0 where equal cells resolve u, 1
    /// where they do not.
    pub fn by_slopes(self, share: f64) -> f64 {
        between(SLOPES.map(|limit| self.kept * limit), share)
    }

    /// The need where u bends by `share` of its range in both directions within [`WINDOW`] nodes: 0 where equal cells
    /// resolve u, 1 where they do not.
    pub fn by_bends(self, share: f64) -> f64 {
        between(BENDS.map(|limit| self.kept * limit), share)
    }
}

/// The share of its density that counts on a mesh: 1 where its error of interpolation, the root of the mean square, is
/// no more than that of equal cells, 0 where it is half as large again.
pub(super) fn worth<const D: usize>(mesh: &Mesh<D>, u: &[f64]) -> f64 {
    let mut squares = [0.0; 2];
    for_each_error(mesh, u, |volume, errors| {
        squares.iter_mut().zip(errors).for_each(|(sum, error)| *sum += volume * error * error);
    });
    let [here, equal] = squares.map(f64::sqrt);
    // u that is linear, or not finite, has none
    if here > equal { 1.0 - between(LOSS, here / equal) } else { 1.0 }
}

/// The largest errors of linear interpolation along the lattice: on a mesh, and on equal cells.
pub(crate) fn interpolation_errors<const D: usize>(mesh: &Mesh<D>, u: &[f64]) -> [f64; 2] {
    let [mut here, mut equal] = [0.0; 2];
    for_each_error(mesh, u, |_, errors| {
        here = larger(here, errors[0]);
        equal = larger(equal, errors[1]);
    });
    [here, equal]
}

/// Tells, for every node and axis, about how much volume the node has, and the errors h² |u''|/8 of interpolation along
/// the lattice line: with the longer of the two edges beside the node, and with equal cells of size h.
fn for_each_error<const D: usize>(mesh: &Mesh<D>, u: &[f64], mut see: impl FnMut(f64, [f64; 2])) {
    let lattice = mesh.lattice();
    let patch = Patch { origin: [0; D], size: lattice.nodes(), wraps: lattice.periodic() };
    let h: [f64; D] = std::array::from_fn(|d| mesh.extent()[d] / lattice.cells()[d] as f64);
    let x = padded(lattice, mesh.x(), mesh.jump());
    let u = padded(lattice, u.as_chunks::<1>().0, [[0.0]; D]);
    let strides = patch.padded_strides();
    for k in patch.places() {
        let edge = |n: usize| length(std::array::from_fn::<f64, D, _>(|c| x[n][c] - x[k][c]));
        let edges = strides.map(|s| [edge(k - s), edge(k + s)]);
        let volume = edges.iter().map(|[below, above]| 0.5 * (below + above)).product::<f64>();
        for ([below, above], (s, h)) in edges.into_iter().zip(strides.into_iter().zip(h)) {
            // beyond a side there is no edge
            if below > 0.0 && above > 0.0 {
                let slopes = [(u[k][0] - u[k - s][0]) / below, (u[k + s][0] - u[k][0]) / above];
                let bend = (2.0 * (slopes[1] - slopes[0]) / (above + below)).abs();
                see(volume, [below.max(above), h].map(|h| h * h * bend / 8.0));
            }
        }
    }
}

/// Rises from 0 to 1 between two values, with a slope that is 0 at both.
pub(super) fn between([low, high]: [f64; 2], value: f64) -> f64 {
    let s = ((value - low) / (high - low)).clamp(0.0, 1.0);
    s * s * (3.0 - 2.0 * s)
}

/// How much u bends both ways within a few nodes of the lattice lines along each axis d
///
/// ```text
/// max over windows of min(Σ max(b, 0), Σ max(−b, 0)),   b = (δ_d²u − ∇u·δ_d²x)/(p q)
/// ```
///
/// b is the second derivative of u along the line, per uniform cell squared: δ_d² are second differences along axis d
/// of the lattice, p and q the lengths of the two edges in uniform cells. A kink bends one way, smooth functions bend
/// both ways only at their inflections, where they hardly bend: it is jumps and thin layers that this finds.
pub(super) fn bends<const D: usize>(mesh: &Mesh<D>, u: &[f64]) -> [f64; D] {
    let (lattice, extent) = (mesh.lattice(), mesh.extent());
    let patch = Patch { origin: [0; D], size: lattice.nodes(), wraps: lattice.periodic() };
    let per_cell: [f64; D] = std::array::from_fn(|d| lattice.cells()[d] as f64 / extent[d]);
    let x = padded(lattice, mesh.x(), mesh.jump());
    let u = padded(lattice, u.as_chunks::<1>().0, [[0.0]; D]);
    let strides = patch.padded_strides();
    // the way from one place to another in uniform cells, and the change of u
    let way = |k: usize, n: usize| -> [f64; D] { std::array::from_fn(|d| (x[n][d] - x[k][d]) * per_cell[d]) };
    let change = |k: usize, n: usize| u[n][0] - u[k][0];
    let bend = |k: usize, axis: usize| {
        let (scaled, determinant) =
            scaled_gradient(strides.map(|s| way(k - s, k + s)), strides.map(|s| change(k - s, k + s)));
        let s = strides[axis];
        let (below, above) = (way(k - s, k), way(k, k + s));
        let second = change(k, k + s) - change(k - s, k);
        let second = (0..D).fold(second, |sum, d| sum - scaled[d] / determinant * (above[d] - below[d]));
        second / (length(above) * length(below))
    };
    let sides = patch.wraps.map(|wraps| usize::from(!wraps));
    std::array::from_fn(|axis| {
        let mut most = 0.0;
        let within = |d: usize| sides[d]..patch.size[d].saturating_sub(sides[d]);
        for line in lines(patch.size, axis).filter(|line| (0..D).all(|d| d == axis || within(d).contains(&line[d]))) {
            let first: usize = (0..D).map(|d| (line[d] + 1) * strides[d]).sum();
            let mut window = [0.0; WINDOW];
            for i in within(axis) {
                window[i % WINDOW] = bend(first + i * strides[axis], axis);
                let [up, down] = window.iter().fold([0.0, 0.0], |[up, down], b| [up + b.max(0.0), down - b.min(0.0)]);
                most = larger(most, f64::min(up, down));
            }
        }
        most
    })
}

/// The first nodes of all lines along an axis.
fn lines<const D: usize>(size: [usize; D], axis: usize) -> impl Iterator<Item = [usize; D]> {
    let across: [usize; D] = std::array::from_fn(|d| if d == axis { 1 } else { size[d] });
    let strides = strides(across);
    (0..across.iter().product()).map(move |k| std::array::from_fn(|d| k / strides[d] % across[d]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Lattice;

    fn told(mesh: &Mesh<2>, f: impl Fn(f64, f64) -> f64) -> f64 {
        let u: Vec<f64> = mesh.x().iter().map(|x| f(x[0], x[1])).collect();
        bends(mesh, &u).into_iter().fold(0.0, larger)
    }

    /// A jump by J bends by J each way within a cell, and by half of that at a node, whichever way it lies.
    #[test]
    fn jumps_bend_both_ways() {
        let mesh = Mesh::uniform(Lattice::bounded([40, 20]).unwrap(), [0.0; 2], [1.0, 0.1]).unwrap();
        let step = |x: f64| f64::from(u8::from(x > 0.0)) + 0.5 * f64::from(u8::from(x == 0.0));
        let staircase = |x: f64| [4.0, 16.0, 28.0].map(|at| step(x - at)).iter().sum::<f64>() / 3.0;
        for (shift, exact) in [(0.5, 1.0 / 3.0), (0.0, 1.0 / 6.0)] {
            let told = told(&mesh, |x, _| staircase((40.0 * x).round() - shift));
            assert!((told - exact).abs() < 1e-9, "shifted by {shift}: {told} where it is {exact}");
        }
        let told = told(&mesh, |_, y| staircase((200.0 * y).round() - 0.5));
        assert!((told - 1.0 / 3.0).abs() < 1e-9, "{told}");
    }

    /// Linear functions bend nowhere, on any mesh, and neither kinks nor waves and blobs of twenty cells bend both
    /// ways.
    #[test]
    fn what_is_smooth_or_kinked_does_not() {
        let mesh = Mesh::uniform(Lattice::bounded([40, 40]).unwrap(), [0.0; 2], [1.0; 2]).unwrap();
        let bent = mesh.x().iter().map(|&[x, y]| [x + 0.3 * x * (1.0 - x) * y, y + 0.3 * y * (1.0 - y) * x]);
        let bent = mesh.moved(bent.collect()).unwrap();
        assert!(told(&bent, |x, y| 3.0 * x - 2.0 * y) < 1e-12);
        assert!(told(&mesh, |x, _| (1.0 - 4.0 * (x - 0.5).abs()).max(0.0)) < 1e-12);
        for mesh in [&mesh, &bent] {
            assert!(told(mesh, |x, _| 0.5 * (4.0 * std::f64::consts::PI * x).sin()) < BENDS[0]);
            assert!(told(mesh, |x, y| (-((x - 0.5).powi(2) + (y - 0.5).powi(2)) / 0.02).exp()) < BENDS[0]);
        }
    }
}
