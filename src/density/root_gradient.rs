use super::jump::jump;
use super::need::{Need, bends, between, worth};
use super::{Density, Monitor, smoothing::smooth_widely};
use crate::error::{Failure, Result};
use crate::geometry::{Cells, Field, Lattice, Mesh, check_finite, check_length, dot, strides};
use crate::numerics::{ends, larger, sum};
use std::borrow::Cow;

/// The root of the slope, over its mean: no number to set
///
/// ```text
/// ρ_d = c_d (1 + 4 s_d w_d r / m_d),   r = max(√|g_d| − b, 0),   b = ⟨|g_d|^⅛⟩⁴,   m_d = ⟨r⟩,
/// w_d = max(q_d³, 0.1),   c_d = max(q_d, 1 − q_d)³,   q_d = s_d m_d / max_d s_d m_d
/// ```
///
/// for each axis d, ⟨·⟩ the mean over the domain, with g the gradient of u in each mesh cell per uniform cell along
/// each axis, (h_x u_x, h_y u_y), so that a box of any shape is treated alike. A layer of any width gets the same share
/// of the nodes, about half of them: the mean of the root falls with the width as fast as its largest value grows. The
/// background b is 0 where u is flat outside its layers, and takes out the slopes between the shocks of a saw tooth,
/// which would share the nodes otherwise. With a density for each axis, layers along two adjacent sides, or across each
/// other, have their nodes both.
///
/// An axis along which less changes, q_d < 1, draws fewer nodes, by w_d: along a wave-shaped layer its slopes are those
/// of flanks that mesh lines can follow. So that they can, neighbouring lines are tied less along that axis, by c_d.
/// Where nothing changes along an axis, q_d = 0, lines have nothing to follow and are tied in full: on periodic axes
/// they would drift apart otherwise.
///
/// Of several unknowns, each in units of its range, the largest |g_d| counts, and the largest need: what equal cells
/// resolve of one unknown would not be resolved any more where all nodes go to a layer of another.
///
/// The need s is 0 where equal cells resolve u: where it changes by less than 0.18 of its range over a uniform cell
/// everywhere, and by less than 0.06 within a few nodes bends both ways. It is 1 where it changes by more than a
/// quarter of its range over a uniform cell somewhere, or by more than 0.09 bends both ways. Along an axis it is no
/// larger than what √D g_d, or the bends along that axis, have by the same limits. On a mesh that is not even any more
/// these limits are down to a quarter as large: it goes back to equal cells late. But where it interpolates u with a
/// larger error than equal cells, in the mean, s falls: to 0 where the error is half as large again. Where the largest
/// |g_d| is less than twice (⟨|g_d|^⅛⟩)⁸, as in a wave train that fills the domain, there is no place from which nodes
/// could be taken, and s_d is 0; from four times on this does not matter. The largest ρ over the smallest is at most
/// 10⁶, and 500 where an edge shorter than a twentieth of a uniform cell holds half of the range of u, which is then a
/// jump.
///
/// Along an axis of n nodes round(8 (n/41)²) passes of the filter (1 2 1)/4 follow, at least one: a width of a
/// twentieth of the domain. Where lattice lines along it meet k > 2 layers on average there are (2/k)² as many. Their
/// cost does not depend on their number. Where u is constant, ρ = 1.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct RootGradient {}

/// β where equal cells do not resolve u: the density is 1 + β (√|∇u| − background)/mean before it is smoothed.
const BETA: f64 = 4.0;
/// Smallest weight w_d of an axis: thin layers across one axis leave thick ones across another their nodes, and mesh
/// lines stay tied to their neighbours.
const LEAST_WEIGHT: f64 = 0.1;
/// Largest ratio of two values of the density before it is smoothed.
const CONTRAST: f64 = 1e6;
/// Largest ratio of two values of the density around a jump, which no mesh resolves, before it is smoothed: cells there
/// are about a hundredth of equal ones. A shock without viscosity is never wider than a cell, and thinner cells take
/// more steps to follow it.
const CONTRAST_OF_JUMPS: f64 = 500.0;
/// Lengths of an edge in units of an equal cell: up to the first it may hold a jump, from the second on it does not,
/// since a mesh has its shortest edges at a jump.
const THIN: [f64; 2] = [0.05, 0.2];
/// Steepest slope over the background slope: below the first ratio the density is constant, above the second it counts
/// in full. Where all slopes are alike there is no place from which nodes could be taken.
const STEEPER: [f64; 2] = [2.0, 4.0];
/// Number of passes of the filter (1 2 1)/4 on 41 × 41 nodes with one layer; it grows with the square of the number of
/// nodes along an axis, so that the filter is a twentieth of the domain wide.
const PASSES: f64 = 8.0;
/// Number of layers on a lattice line up to which the density is smoothed as for one layer. Were two of them smoothed
/// less, on periodic axes or where a front winds across the lines, a mesh of 40 cells would not come to rest around
/// layers thinner than a hundredth of the box.
const FEW: f64 = 2.0;
/// u counts as constant where its steepest slope times the extent of the domain is below this share of its largest
/// value: such changes are the error of solvers.
const ALIKE: f64 = 1e-7;
/// Slopes are even where their excess is below this share of the background.
const ROUNDING: f64 = 1e-10;
/// An unknown whose range is below this share of the largest of all is made of rounding, and is left out.
const OF_ROUNDING: f64 = 1e-9;

impl<const D: usize> Monitor<D> for RootGradient
where
    Mesh<D>: Cells<D>,
{
    fn density(&self, mesh: &Mesh<D>, u: &[f64], _gradient: Option<&[[f64; D]]>) -> Result<Density, Failure> {
        check_length(mesh.lattice(), "what the mesh follows", u.len())?;
        Self::of_all(mesh, &[Cow::Borrowed(u)])
    }

    fn density_of(
        &self,
        _t: f64,
        mesh: &Mesh<D>,
        unknowns: &Field,
        _gradient: Option<&[[f64; D]]>,
    ) -> Result<Density, Failure> {
        let all = (0..unknowns.components()).map(|c| unknowns.component(c).collect());
        Self::of_all(mesh, &all.collect::<Vec<Cow<[f64]>>>())
    }
}

impl RootGradient {
    /// ρ of unknowns with one value a node each.
    fn of_all<const D: usize>(mesh: &Mesh<D>, unknowns: &[Cow<[f64]>]) -> Result<Density, Failure>
    where
        Mesh<D>: Cells<D>,
    {
        // in a domain with a chart equal cells are those of the unit box
        let (domain, mesh) = (mesh, mesh.parameters());
        let lattice = mesh.lattice();
        let Followed { slopes, needs, jump } = Followed::of(mesh, unknowns);
        // all of a jump is in one cell, and the smaller that gets, the larger ρ would be there
        let contrast = CONTRAST * (CONTRAST_OF_JUMPS / CONTRAST).powf(jump);
        let axes = slopes.into_iter().zip(needs).map(|(slopes, need)| Roots::of(mesh, slopes, need));
        let axes: Vec<Roots> = axes.collect();
        let most = axes.iter().map(Roots::drawn).fold(0.0, larger);
        if most == 0.0 {
            return Ok(vec![1.0; lattice.len()].into());
        }
        let mut axes = axes.into_iter().map(|roots| along(mesh, roots, most, contrast));
        let axes: [Vec<f64>; D] = std::array::from_fn(|_| axes.next().expect("one for each axis"));
        axes.iter().try_for_each(|rho| check_finite(["the mesh density"], domain, rho.as_chunks().0))?;
        Ok(Density::of_axes(axes).expect("one value a node each"))
    }
}

/// ρ along an axis; `most` is the largest of what the axes draw.
fn along<const D: usize>(mesh: &Mesh<D>, roots: Roots, most: f64, contrast: f64) -> Vec<f64>
where
    Mesh<D>: Cells<D>,
{
    let lattice = mesh.lattice();
    let share = roots.drawn() / most;
    let weight = larger(share.powi(3), LEAST_WEIGHT);
    let tie = larger(share, 1.0 - share).powi(3);
    let Roots { mut roots, background, mean, steepest, need } = roots;
    if need == 0.0 {
        return vec![tie; lattice.len()];
    }
    let mean = mean.max(BETA * (steepest.sqrt() - background) / contrast);
    let height = BETA * need * weight / mean;
    roots.iter_mut().for_each(|root| *root = 1.0 + height * (*root - background).max(0.0));
    let mut rho = roots;
    let (cells, layers) = (lattice.cells(), layers(lattice, &rho));
    let passes = std::array::from_fn(|d| {
        let passes = (PASSES * ((cells[d] + 1) as f64 / 41.0).powi(2)).round() * (FEW / layers[d].max(FEW)).powi(2);
        // taking cell values to nodes is one pass already
        (passes - 1.0).max(0.0)
    });
    smooth_widely(cells, lattice.periodic(), &mut rho, passes);
    let mut rho = Mesh::<D>::at_nodes(lattice, rho);
    rho.iter_mut().for_each(|rho| *rho *= tie);
    rho
}

/// What the mesh follows.
struct Followed<const D: usize> {
    /// The largest |g_d| in each cell, for each axis; empty where all unknowns are constant.
    slopes: Vec<Vec<f64>>,
    /// The largest need along each axis.
    needs: [f64; D],
    /// How far an unknown jumps, from 0 to 1.
    jump: f64,
}

impl<const D: usize> Followed<D> {
    fn of(mesh: &Mesh<D>, unknowns: &[Cow<[f64]>]) -> Self
    where
        Mesh<D>: Cells<D>,
    {
        let lattice = mesh.lattice();
        let longest = lattice.cells().into_iter().max().unwrap_or(1) as f64;
        let ends = unknowns.iter().map(|u| ends(u.iter().copied()));
        let ends: Vec<[f64; 2]> = ends.collect();
        let sizes = ends.iter().map(|[low, high]| high.max(-low));
        let largest = sizes.clone().fold(0.0, larger);
        let need = Need::on(mesh);
        let (mut slopes, mut needs, mut most) = (Vec::new(), [0.0; D], 0.0);
        for ((u, [low, high]), size) in unknowns.iter().zip(&ends).zip(sizes) {
            let range = high - low;
            if range <= OF_ROUNDING * largest {
                continue;
            }
            let Slopes { along, steepest, axes } = Slopes::of(mesh, u, range);
            if steepest * range * longest <= ALIKE * size {
                continue;
            }
            most = larger(most, jump(mesh, u, range, THIN));
            // a slope across the axes has 1/√D of itself along each
            let by_slopes = axes.map(|slope| need.by_slopes((D as f64).sqrt() * slope));
            let all = need.by_slopes(steepest);
            let bends = if all < 1.0 || by_slopes.iter().any(|s| *s < 1.0) { bends(mesh, u) } else { [0.0; D] };
            let by_bends = bends.map(|bend| need.by_bends(bend / range));
            let all = by_bends.iter().copied().fold(all, f64::max);
            let worth = if all > 0.0 { worth(mesh, u) } else { 1.0 };
            for d in 0..D {
                // u that is not finite everywhere is told of by its density
                let own = if steepest.is_finite() { worth * all.min(by_slopes[d].max(by_bends[d])) } else { 1.0 };
                needs[d] = f64::max(needs[d], own);
            }
            match slopes.is_empty() {
                true => slopes = along,
                false => slopes.iter_mut().zip(along).for_each(|(slopes, along)| {
                    slopes.iter_mut().zip(along).for_each(|(slope, own)| *slope = larger(*slope, own));
                }),
            }
        }
        Self { slopes, needs, jump: most }
    }
}

/// Slopes of one unknown.
struct Slopes<const D: usize> {
    /// |g_d| in each cell, for each axis.
    along: Vec<Vec<f64>>,
    /// The largest |g|.
    steepest: f64,
    /// The largest |g_d| along each axis.
    axes: [f64; D],
}

impl<const D: usize> Slopes<D> {
    fn of(mesh: &Mesh<D>, u: &[f64], range: f64) -> Self
    where
        Mesh<D>: Cells<D>,
    {
        // with room for one a node, too
        let room: usize = mesh.lattice().cells().map(|n| n + 1).iter().product();
        let mut along = vec![Vec::with_capacity(room); D];
        let mut steepest2 = 0.0;
        for g in mesh.slopes(u, range) {
            steepest2 = larger(steepest2, dot(g, g));
            along.iter_mut().zip(g).for_each(|(along, g)| along.push(g.abs()));
        }
        let axes = std::array::from_fn(|d| along[d].iter().copied().fold(0.0, larger));
        Self { along, steepest: steepest2.sqrt(), axes }
    }
}

/// √|g_d| of the cells of a mesh.
struct Roots {
    /// One a cell, last axis fastest.
    roots: Vec<f64>,
    /// ⟨|g_d|^⅛⟩⁴.
    background: f64,
    /// Mean of √|g_d| less the background, where that is above 0.
    mean: f64,
    /// The largest |g_d|.
    steepest: f64,
    /// The need; 0 where ρ is even.
    need: f64,
}

impl Roots {
    /// From |g_d| of the cells and the need as far as their size tells of it.
    fn of<const D: usize>(mesh: &Mesh<D>, slopes: Vec<f64>, need: f64) -> Self
    where
        Mesh<D>: Cells<D>,
    {
        if need == 0.0 {
            return Self { roots: slopes, background: 0.0, mean: 0.0, steepest: 0.0, need };
        }
        let box_volume: f64 = mesh.extent().iter().product();
        let steepest = slopes.iter().copied().fold(0.0, larger);
        let mut roots = slopes;
        roots.iter_mut().for_each(|slope| *slope = slope.sqrt());
        let background = sum(roots.iter().zip(mesh.volumes()).map(|(root, volume)| volume * root.sqrt().sqrt()));
        let background = (background / box_volume).powi(4);
        let above = sum(roots.iter().zip(mesh.volumes()).map(|(root, volume)| (root - background).max(0.0) * volume));
        let mean = above / box_volume;
        let is_even = mean <= ROUNDING * background;
        let need = if is_even { 0.0 } else { need * between(STEEPER, steepest / (background * background)) };
        Self { roots, background, mean, steepest, need }
    }

    /// s_d m_d, how much the axis has for nodes to be drawn to.
    fn drawn(&self) -> f64 {
        self.need * self.mean
    }
}

/// Mean number of layers on a lattice line along each axis: half of all that ρ, given by the cell, rises and falls
/// along the lines, over the sum of the largest ρ − 1 of each line, so that the lines through the strongest layers
/// count most.
fn layers<const D: usize>(lattice: &Lattice<D>, rho: &[f64]) -> [f64; D] {
    let (cells, wraps) = (lattice.cells(), lattice.periodic());
    let steps = strides(cells);
    std::array::from_fn(|axis| {
        let (n, s) = (cells[axis], steps[axis]);
        let mut changes = 0.0;
        let mut highest = vec![1.0; rho.len() / n];
        // lines along the axis lie side by side in blocks of n times s cells
        for (block, highest) in rho.chunks_exact(n * s).zip(highest.chunks_exact_mut(s)) {
            let mut below = &block[if wraps[axis] { (n - 1) * s } else { 0 }..][..s];
            for row in block.chunks_exact(s) {
                for ((rho, below), highest) in row.iter().zip(below).zip(&mut *highest) {
                    changes += (rho - below).abs();
                    *highest = f64::max(*highest, *rho);
                }
                below = row;
            }
        }
        let highest: f64 = highest.iter().map(|rho| rho - 1.0).sum();
        if highest > 0.0 { 0.5 * changes / highest } else { 0.0 }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    /// Equal cells that resolve u have an even density; ten times thinner, the layer has most of it.
    #[test]
    fn what_equal_cells_resolve_asks_for_nothing() {
        let mesh = Mesh::uniform(Lattice::bounded([40, 4]).unwrap(), [0.0; 2], [1.0, 0.1]).unwrap();
        let density = |w: f64| {
            let u: Vec<f64> = mesh.x().iter().map(|x| (w * (x[0] - 0.5)).tanh()).collect();
            RootGradient::default().density(&mesh, &u, None).unwrap()
        };
        assert_eq!(density(8.0), vec![1.0; mesh.x().len()].into());
        assert!(density(80.0).largest().iter().fold(0.0, |m: f64, rho| m.max(*rho)) > 10.0);
    }

    /// A box of any shape has the same density: slopes count by the cell.
    #[test]
    fn the_shape_of_the_box_does_not_matter() {
        let density = |height: f64| {
            let mesh = Mesh::uniform(Lattice::bounded([24, 16]).unwrap(), [0.0; 2], [1.0, height]).unwrap();
            let u: Vec<f64> = mesh.x().iter().map(|x| (60.0 * (x[0] + 0.3 * x[1] / height - 0.6)).tanh()).collect();
            RootGradient::default().density(&mesh, &u, None).unwrap()
        };
        let (square, thin) = (density(1.0), density(1e-4));
        assert!(square.largest().iter().zip(thin.largest()).all(|(a, b)| (a / b - 1.0).abs() < 1e-9));
    }

    /// A constant has the density 1 to the last bit, and so has its rounding.
    #[test]
    fn a_constant_has_no_slope() {
        let mesh = Mesh::uniform(Lattice::new([7, 5], [true, false]).unwrap(), [0.0; 2], [1.0; 2]).unwrap();
        for noise in [0.0, 1e-15] {
            let u: Vec<f64> = (0..mesh.x().len()).map(|k| 3.0 + noise * (k % 3) as f64).collect();
            assert_eq!(RootGradient::default().density(&mesh, &u, None).unwrap(), vec![1.0; mesh.x().len()].into());
        }
    }

    /// Eight fronts in a row are as thick after smoothing, as shares of what each has, as two are, and each has as much
    /// of ρ.
    #[test]
    fn each_of_many_layers_has_its_share() {
        let contrast = |fronts: f64| {
            let cells = [20 * fronts as usize, 2];
            let mesh = Mesh::uniform(Lattice::new(cells, [true, false]).unwrap(), [0.0; 2], [fronts, 1.0]).unwrap();
            let u: Vec<f64> = mesh.x().iter().map(|x| (50.0 * (PI * (x[0] + 0.2)).sin()).tanh()).collect();
            let rho = RootGradient::default().density(&mesh, &u, None).unwrap();
            let [low, high] = rho.largest().iter().fold([f64::INFINITY, 0.0], |[l, h], rho| [l.min(*rho), h.max(*rho)]);
            high / low
        };
        let (few, many) = (contrast(2.0), contrast(8.0));
        assert!((many / few - 1.0).abs() < 0.2, "{many} against {few}");
    }

    /// ∇u is exact for linear u on any cells, and so ρ is even, whatever the unit of u is.
    #[test]
    fn linear_functions_have_an_even_density() {
        let mesh = Mesh::uniform(Lattice::bounded([3, 4]).unwrap(), [0.0; 2], [2.0, 1.0]).unwrap();
        let bent = mesh.x().iter().map(|&[x, y]| [x + 0.1 * (x * (2.0 - x)) * y, y + 0.1 * (y * (1.0 - y)) * x]);
        let mesh = mesh.moved(bent.collect()).unwrap();
        for unit in [1.0, 1e-6, 1e200, 1e-200] {
            let u: Vec<f64> = mesh.x().iter().map(|[x, y]| unit * (3.0 * x - 2.0 * y)).collect();
            let rho = RootGradient::default().density(&mesh, &u, None).unwrap();
            assert!(rho.largest().iter().all(|rho| (rho - 1.0).abs() < 1e-9), "{rho:?}");
        }
        // a slope that is steep in one cell of three alone is not even any more
        let u: Vec<f64> = mesh.x().iter().map(|[x, y]| 3.0 * x - 2.0 * y + 100.0 * (x - 1.4).max(0.0)).collect();
        let rho = RootGradient::default().density(&mesh, &u, None).unwrap();
        assert!(rho.largest().iter().any(|rho| (rho - 1.0).abs() > 0.1), "{rho:?}");
    }
}
