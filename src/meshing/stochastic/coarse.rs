use super::super::Form;
use super::super::mmpde::exactness;
use super::super::overlap::share_of_largest;
use super::Problem;
use crate::error::Failure;
use crate::geometry::{Density, Lattice, Patch};
use crate::numerics::linear::{LatticeMatrix, LinearSolver, Robust};
use crate::parallel;
use crate::work::Work;
use std::borrow::Cow;

/// The part of a correction that a coarser lattice can represent
///
/// ```text
/// M_H c_H = R r on the whole coarse lattice,   c ≈ P (c_H + q (c_H − P c_2H)),   q = (H² − h²) / ((2H)² − H²)
/// ```
///
/// R averages fine values with ρ and the hat function of a coarse node as weights. P interpolates by the cubic through
/// four coarse nodes along each axis. M_H is the mesh equation itself on the coarse lattice, with the mean density. The
/// weight ρ matters on periodic axes: only weighted by it do residuals of the mesh equation sum to zero, and without it
/// the mesh would be shifted.
///
/// The error grows like H², and a second lattice of twice the spacing measures it. Richardson's extrapolation then
/// leads to the spacing h of the fine lattice. The right-hand sides of the second lattice follow from those of the
/// first, so that nothing more needs to be gathered.
#[derive(Debug, Clone)]
pub(super) struct Coarse<const D: usize, const S: usize> {
    near: Level<D, S>,
    far: Level<D, S>,
    /// q.
    gain: f64,
}

/// A coarse lattice, with the transfers to and from the next finer one.
#[derive(Debug, Clone)]
struct Level<const D: usize, const S: usize> {
    lattice: Lattice<D>,
    down: Transfer<D>,
    up: Transfer<D>,
    matrix: LatticeMatrix<D, S>,
    plane: Robust<D>,
    /// The density on the next finer lattice, and on this one, once there is a step.
    densities: Option<[Density; 2]>,
}

/// Fewest cells along an axis of a coarse lattice: the interpolating cubic needs four nodes.
pub(super) const FEWEST_CELLS: usize = 4;
/// With fewer cells along an axis both coarse lattices may miss the same layer, so that their difference tells nothing.
const ENOUGH_CELLS: usize = 16;
/// Coarse lattices and strips are solved until their residual is this share of its largest initial value. With a much
/// larger one, rounding would decide where iterations end: ten times the same density could give another mesh.
pub(super) const SOLVED: f64 = 1e-7;

impl<const D: usize, const S: usize> Coarse<D, S> {
    /// Two lattices, of which one cell stands for `ratio` and for twice as many cells of the fine lattice along each
    /// axis; none where no axis has that many cells.
    pub fn new(fine: &Lattice<D>, ratio: usize) -> Option<Self> {
        let near = Level::new(fine, ratio)?;
        let far = Level::new(&near.lattice, 2)?;
        let square = |lattice: &Lattice<D>| lattice.spacing().iter().map(|h| h * h).sum::<f64>();
        let [h, near_h, far_h] = [fine, &near.lattice, &far.lattice].map(square);
        let gain = (near_h - h) / (far_h - near_h);
        Some(Self { near, far, gain })
    }

    /// Whether the coarser lattice is fine enough for the difference between both to measure their errors.
    pub fn knows_its_error(&self) -> bool {
        self.far.lattice.cells().iter().all(|&n| n >= ENOUGH_CELLS)
    }

    /// Number of values gathered for the coarse right-hand side: one for each coarse node and coordinate.
    pub fn len(&self) -> usize {
        Patch::whole(&self.near.lattice).len()
    }

    /// Sets up the mesh equation of a step on both lattices.
    pub fn prepare(&mut self, problem: &Problem<'_, D>) -> Result<(), Failure> {
        self.near.prepare(problem, problem.rho)?;
        self.far.prepare(problem, &self.near.densities()[1])
    }

    /// The correction at all fine nodes for a residual there, zero on bounded sides; and the root mean square of what
    /// the extrapolation changed, as a share of that of the correction. `size` is the largest coordinate along each
    /// axis.
    pub fn correction(&mut self, residual: &[[f64; D]], size: [f64; D]) -> Result<(Vec<[f64; D]>, f64, Work), Failure> {
        let near = self.near.restrict(residual);
        let far = self.far.restrict(&near);
        let (mut c, mut work) = self.near.solve(&near, size)?;
        let (rough, cost) = self.far.solve(&far, size)?;
        work += cost;
        let (mut changed, mut all) = (0.0, 0.0);
        for (c, rough) in c.iter_mut().zip(self.far.up.apply(&rough)) {
            for k in 0..D {
                let change = self.gain * (c[k] - rough[k]);
                c[k] += change;
                (changed, all) = (changed + change * change, all + c[k] * c[k]);
            }
        }
        let share = if all > 0.0 { (changed / all).sqrt() } else { 0.0 };
        Ok((self.near.up.apply(&c), share, work))
    }
}

impl<const D: usize, const S: usize> Level<D, S> {
    fn new(fine: &Lattice<D>, ratio: usize) -> Option<Self> {
        let cells = fine.cells().map(|n| n.div_ceil(ratio).max(FEWEST_CELLS.min(n)));
        if cells == fine.cells() {
            return None;
        }
        let lattice = Lattice::new(cells, fine.periodic()).ok()?;
        let down = Transfer::new(std::array::from_fn(|d| hats(fine, &lattice, d)), fine.nodes()[D - 1]);
        let up = Transfer::new(std::array::from_fn(|d| cubics(fine, &lattice, d)), lattice.nodes()[D - 1]);
        let matrix = LatticeMatrix::zero(Patch::whole(&lattice));
        Some(Self { lattice, down, up, matrix, plane: Robust::default(), densities: None })
    }

    /// Sets up the mesh equation with the mean of a density on the next finer lattice.
    fn prepare(&mut self, problem: &Problem<'_, D>, fine: &Density) -> Result<(), Failure> {
        let down = |part: &Vec<f64>| self.down.apply(part.as_chunks::<1>().0).into_flattened();
        let [_, rho] = self.densities.insert([fine.clone(), fine.map(down)]);
        let rho = &*rho;
        let mut equation = *problem.equation;
        let mut operator = equation.operator(&self.lattice, rho, problem.dt)?;
        if operator.negative_weight().is_some() {
            // the density is too steep for the coarse cells in the gradient form, but never in the conservative form of
            // the same equation
            equation.form = Form::Conservative;
            operator = equation.operator(&self.lattice, rho, problem.dt)?;
        }
        self.matrix = operator.matrix(Patch::whole(&self.lattice));
        Ok(())
    }

    /// The densities of the step that was prepared.
    fn densities(&self) -> &[Density; 2] {
        self.densities.as_ref().expect("a step is prepared before it is solved")
    }

    /// Means of values on the next finer lattice, with the density as weight.
    fn restrict(&self, values: &[[f64; D]]) -> Vec<[f64; D]> {
        let [fine, here] = self.densities().each_ref().map(Density::largest);
        let weighted: Vec<[f64; D]> = values.iter().zip(fine).map(|(v, rho)| v.map(|v| rho * v)).collect();
        let sums = self.down.apply(&weighted);
        sums.into_iter().zip(here).map(|(sum, rho)| sum.map(|sum| sum / rho)).collect()
    }

    fn solve(&mut self, right: &[[f64; D]], size: [f64; D]) -> Result<(Vec<[f64; D]>, Work), Failure> {
        let (patch, none) = (self.matrix.patch, [[0.0; D]; D]);
        let right: Vec<[f64; D]> = patch.nodes(&self.lattice).map(|k| right[k]).collect();
        let mut c = vec![[0.0; D]; patch.padded_len()];
        let tolerance = share_of_largest(&right, SOLVED, exactness(&self.matrix, size));
        let work = self.plane.solve(&self.matrix, &right, &mut c, tolerance)?;
        let mut all = vec![[0.0; D]; self.lattice.len()];
        patch.scatter(&self.lattice, &c, &mut all, none);
        Ok((all, work))
    }
}

/// The nodes along an axis, with their weights, that a value is made of.
type Sources = Vec<(usize, f64)>;

/// A linear map between two lattices of one or two dimensions that is a product of maps along each axis.
#[derive(Debug, Clone)]
struct Transfer<const D: usize> {
    /// For each axis, and each node along it on the lattice of the result.
    rows: [Vec<Sources>; D],
    /// Number of nodes along the last axis of the lattice it maps from.
    width: usize,
}

impl<const D: usize> Transfer<D> {
    fn new(rows: [Vec<Sources>; D], width: usize) -> Self {
        Self { rows, width }
    }

    fn apply<const K: usize>(&self, v: &[[f64; K]]) -> Vec<[f64; K]> {
        let along = &self.rows[D - 1];
        let mut half = Cow::Borrowed(v);
        if let [across, _] = &self.rows[..] {
            let mut sums = vec![[0.0; K]; across.len() * self.width];
            parallel::for_each_row(&mut sums, self.width, |i, row| {
                for &(from, weight) in &across[i] {
                    for (sum, v) in row.iter_mut().zip(&v[from * self.width..]) {
                        (0..K).for_each(|c| sum[c] += weight * v[c]);
                    }
                }
            });
            half = Cow::Owned(sums);
        }
        let mut out = vec![[0.0; K]; half.len() / self.width * along.len()];
        parallel::for_each_row(&mut out, along.len(), |i, row| {
            let half = &half[i * self.width..][..self.width];
            for (sum, sources) in row.iter_mut().zip(along) {
                for &(from, weight) in sources {
                    (0..K).for_each(|c| sum[c] += weight * half[from][c]);
                }
            }
        });
        out
    }
}

/// Restriction: for each coarse node, the fine nodes nearer than one coarse cell, with its hat function as weight.
fn hats<const D: usize>(fine: &Lattice<D>, coarse: &Lattice<D>, d: usize) -> Vec<Sources> {
    let (cells, nodes, periodic) = (fine.cells()[d], fine.nodes()[d], fine.periodic()[d]);
    let ratio = cells as f64 / coarse.cells()[d] as f64;
    let reach = ratio.ceil() as isize;
    let row = |at: f64| -> Sources {
        let middle = at.round() as isize;
        let near = (middle - reach..=middle + reach).filter(|f| periodic || (0..nodes as isize).contains(f));
        let hats = near.map(|f| (f.rem_euclid(nodes as isize) as usize, 1.0 - (f as f64 - at).abs() / ratio));
        let hats: Sources = hats.filter(|(_, weight)| *weight > 0.0).collect();
        let total: f64 = hats.iter().map(|(_, weight)| weight).sum();
        hats.into_iter().map(|(f, weight)| (f, weight / total)).collect()
    };
    (0..coarse.nodes()[d]).map(|i| row(i as f64 * ratio)).collect()
}

/// Interpolation: for each fine node the cubic through the four nearest coarse nodes, or through as many as there are.
fn cubics<const D: usize>(fine: &Lattice<D>, coarse: &Lattice<D>, d: usize) -> Vec<Sources> {
    let (nodes, periodic) = (coarse.nodes()[d], coarse.periodic()[d]);
    let ratio = fine.cells()[d] as f64 / coarse.cells()[d] as f64;
    let count = nodes.min(4) as isize;
    let row = |at: f64| -> Sources {
        let below = at.floor() as isize - (count - 1) / 2;
        let first = if periodic { below } else { below.clamp(0, nodes as isize - count) };
        let points = first..first + count;
        let weight = |p: isize| {
            let others = points.clone().filter(|&q| q != p);
            others.map(|q| (at - q as f64) / (p - q) as f64).product::<f64>()
        };
        points.clone().map(|p| (p.rem_euclid(nodes as isize) as usize, weight(p))).collect()
    };
    (0..fine.nodes()[d]).map(|f| row(f as f64 / ratio)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cubics along both axes come back from their values on a coarse lattice, on bounded axes and any ratio; constants
    /// go down as they are; a periodic axis has no seam.
    #[test]
    fn transfers_are_exact_for_cubics() {
        for (fine, coarse) in [([24, 17], [12, 9]), ([40, 12], [10, 4]), ([9, 30], [5, 7])] {
            let [fine, coarse] = [fine, coarse].map(|cells| Lattice::bounded(cells).unwrap());
            let values = |lattice: &Lattice<2>| -> Vec<[f64; 1]> {
                let at = |k: usize| [0, 1].map(|d| lattice.node(k)[d] as f64 * lattice.spacing()[d]);
                let f = |[s, r]: [f64; 2]| (1.0 + s - 2.0 * s.powi(3)) * (0.5 + r.powi(2) - r.powi(3));
                (0..lattice.len()).map(|k| [f(at(k))]).collect()
            };
            let up = Transfer::new([0, 1].map(|d| cubics(&fine, &coarse, d)), coarse.nodes()[1]);
            for (found, [exact]) in up.apply(&values(&coarse)).iter().zip(values(&fine)) {
                assert!((found[0] - exact).abs() < 1e-13, "{found:?} {exact}");
            }
            let down = Transfer::new([0, 1].map(|d| hats(&fine, &coarse, d)), fine.nodes()[1]);
            assert!(down.apply(&vec![[3.0]; fine.len()]).iter().all(|[v]| (v - 3.0).abs() < 1e-14));
        }
        let [fine, coarse] = [24, 12].map(|n| Lattice::new([n, n], [true; 2]).unwrap());
        let wave = |lattice: &Lattice<2>, shift: usize| -> Vec<[f64; 1]> {
            let at = |k: usize| (lattice.node(k)[0] + shift) as f64 * lattice.spacing()[0];
            (0..lattice.len()).map(|k| [(std::f64::consts::TAU * at(k)).sin()]).collect()
        };
        let up = Transfer::new([0, 1].map(|d| cubics(&fine, &coarse, d)), coarse.nodes()[1]);
        let (plain, shifted) = (up.apply(&wave(&coarse, 0)), up.apply(&wave(&coarse, 1)));
        for (k, [shifted]) in shifted.iter().enumerate() {
            let [i, j] = fine.node(k);
            assert!((plain[fine.index([(i + 2) % 24, j])][0] - shifted).abs() < 1e-14);
        }
    }
}
