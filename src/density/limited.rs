use super::{Density, Monitor};
use crate::error::{Error, Failure, Result};
use crate::geometry::{Field, Lattice, Mesh};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How small and how large cells may be: shares of the mean edge of the mesh line that they are on
///
/// On a line of N cells over the length L, 0.2 is 0.2 L/N. Along every mesh line ρ is cut to
///
/// ```text
/// m/largest ≤ ρ ≤ m/smallest,   m = the mean of the limited ρ along the line,
/// ```
///
/// since at rest an edge has the length m L/(N ρ) on a line. In the plane mesh lines are tied to their neighbours, and
/// where ρ also changes across the lines, edges meet the limits only nearly.
///
/// # Example
/// ```
/// use driftmesh::{density::CellSizes, geometry::{Lattice, Mesh}};
/// let mesh = Mesh::uniform(Lattice::bounded([4])?, [0.0], [1.0])?;
/// let sizes = CellSizes { smallest: Some(0.5), largest: None };
/// let rho = sizes.limit(&mesh, vec![1.0, 1.0, 9.0, 1.0, 1.0].into());
/// // the mean is 3/4 + ρ/4, and ρ = 2 (3/4 + ρ/4) is 3
/// assert!((rho.largest()[2] - 3.0).abs() < 1e-12);
/// # Ok::<(), driftmesh::Error>(())
/// ```
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct CellSizes {
    /// The smallest length of an edge, above 0 and below 1: a share of the mean edge of its mesh line. No limit where
    /// nothing is said.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub smallest: Option<f64>,
    /// The largest length of an edge, above 1: a multiple of the mean edge of its mesh line. No limit where nothing is
    /// said.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub largest: Option<f64>,
}

/// Largest number of steps in the search for the mean m of a limited density: each at least halves its interval, of
/// which double precision allows about 60 halvings.
const STEPS: usize = 100;
/// The search for the mean m ends once it changes by no more than this share: round-off.
const CLOSE: f64 = 1e-14;

impl CellSizes {
    /// Refuses settings out of range.
    ///
    /// # Errors
    /// [`Error::Invalid`] where `smallest` is not between 0 and 1, or `largest` not a finite number above 1.
    pub fn check(&self) -> Result<()> {
        if let Some(smallest) = self.smallest.filter(|share| !(*share > 0.0 && *share < 1.0)) {
            let rule = "must be above 0 and below 1: a share of an equal cell";
            return Err(Error::invalid("cells.smallest", smallest, rule));
        }
        if let Some(largest) = self.largest.filter(|share| !(*share > 1.0 && share.is_finite())) {
            let rule = "must be above 1: a multiple of an equal cell";
            return Err(Error::invalid("cells.largest", largest, rule));
        }
        Ok(())
    }

    /// The density within the limits: the same where it is within them, else one for each axis.
    pub fn limit<const D: usize>(&self, mesh: &Mesh<D>, rho: Density) -> Density {
        let mut changed = false;
        let axes: [Vec<f64>; D] = std::array::from_fn(|axis| {
            let mut along = rho.along(axis).to_vec();
            let weights = weights(mesh, axis);
            for line in lines(mesh.lattice(), axis) {
                changed |= self.cut(&line, &weights, &mut along);
            }
            along
        });
        match changed {
            true => Density::of_axes(axes).expect("one value a node each"),
            false => rho,
        }
    }

    /// Cuts ρ along one line, and says whether there was anything to cut.
    fn cut(&self, line: &[usize], weights: &[f64], rho: &mut [f64]) -> bool {
        let [low, high] =
            [self.largest.map_or(0.0, |most| 1.0 / most), self.smallest.map_or(f64::MAX, |least| 1.0 / least)];
        let length: f64 = line.iter().map(|&k| weights[k]).sum();
        // what the mean of the cut density is above m, and its slope
        let excess = |rho: &[f64], m: f64| {
            line.iter().fold((-m, -1.0), |(value, slope), &k| {
                let (share, limits) = (weights[k] / length, [low * m, high * m]);
                match rho[k] {
                    r if r < limits[0] => (value + share * limits[0], slope + share * low),
                    r if r > limits[1] => (value + share * limits[1], slope + share * high),
                    r => (value + share * r, slope),
                }
            })
        };
        let ends = line.iter().fold([f64::INFINITY, 0.0_f64], |[a, b], &k| [a.min(rho[k]), b.max(rho[k])]);
        let mut m = line.iter().map(|&k| weights[k] / length * rho[k]).sum::<f64>();
        // a mesh without lengths is refused by those who move it
        if !m.is_finite() || ends[0] >= low * m && ends[1] <= high * m {
            return false;
        }
        let [mut below, mut above] = ends;
        for _ in 0..STEPS {
            let (value, slope) = excess(rho, m);
            if value > 0.0 {
                below = m
            } else {
                above = m
            }
            let newton = m - value / slope;
            let next = if newton > below && newton < above { newton } else { 0.5 * (below + above) };
            let done = (next - m).abs() <= CLOSE * m;
            m = next;
            if done {
                break;
            }
        }
        line.iter().for_each(|&k| rho[k] = rho[k].clamp(low * m, high * m));
        true
    }
}

/// The nodes of each mesh line along an axis, in order.
fn lines<const D: usize>(lattice: &Lattice<D>, axis: usize) -> impl Iterator<Item = Vec<usize>> + use<D> {
    let (n, stride) = (lattice.nodes()[axis], lattice.strides()[axis]);
    lattice.side(axis, 0).map(move |first| (0..n).map(|i| first + i * stride).collect())
}

/// Half of the edges beside each node along an axis, on the mesh in the unit box of a domain with a chart.
fn weights<const D: usize>(mesh: &Mesh<D>, axis: usize) -> Vec<f64> {
    let mesh = mesh.parameters();
    let (lattice, x, jump) = (mesh.lattice(), mesh.x(), mesh.jump());
    let mut weights = vec![0.0; lattice.len()];
    let mut share = |a: usize, b: usize, turn: [f64; D]| {
        let length = (0..D).map(|c| (x[b][c] + turn[c] - x[a][c]).powi(2)).sum::<f64>().sqrt();
        weights[a] += 0.5 * length;
        weights[b] += 0.5 * length;
    };
    for line in lines(lattice, axis) {
        line.windows(2).for_each(|pair| share(pair[0], pair[1], [0.0; D]));
        if lattice.periodic()[axis] {
            share(line[line.len() - 1], line[0], jump[axis]);
        }
    }
    weights
}

/// A monitor whose density is kept within limits on the sizes of cells.
pub(super) struct Limited<const D: usize> {
    pub monitor: Box<dyn Monitor<D>>,
    pub cells: CellSizes,
}

impl<const D: usize> Monitor<D> for Limited<D> {
    fn density(&self, mesh: &Mesh<D>, u: &[f64], gradient: Option<&[[f64; D]]>) -> Result<Density, Failure> {
        Ok(self.cells.limit(mesh, self.monitor.density(mesh, u, gradient)?))
    }

    fn density_of(
        &self,
        t: f64,
        mesh: &Mesh<D>,
        unknowns: &Field,
        gradient: Option<&[[f64; D]]>,
    ) -> Result<Density, Failure> {
        Ok(self.cells.limit(mesh, self.monitor.density_of(t, mesh, unknowns, gradient)?))
    }

    fn followed(&self, t: f64, mesh: &Mesh<D>, unknowns: &Field) -> Result<Vec<f64>, Failure> {
        self.monitor.followed(t, mesh, unknowns)
    }
}
