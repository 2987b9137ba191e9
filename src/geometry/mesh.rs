use super::{Chart, Lattice, lattice::diagonal, lattice::strides, nodal::check_finite, nodal::check_length};
use crate::error::{Error, Failure, NodePlace, Result};
use std::borrow::Cow;
use std::sync::Arc;

/// A mesh: the position of every lattice node in a box, or in the image of the unit box by a [`Chart`]
///
/// ```text
/// x = x(ξ),   ξ ∈ [0, 1]^D,   x ∈ [lower, upper]
/// ```
///
/// The lattice fixes the connections; only positions move. On a bounded axis the nodes of a side lie exactly on the
/// box. On a periodic axis x(ξ + 1) = x(ξ) + (upper − lower).
///
/// With a chart x = map(s(ξ)), where the places s of the nodes are a mesh of the unit box
/// ([`parameters`](Self::parameters)). Nodes on sides then lie on the curves, and an axis that wraps around is closed:
/// x(ξ + 1) = x(ξ).
///
/// # Example
/// ```
/// use driftmesh::geometry::{Lattice, Mesh};
/// let mesh = Mesh::uniform(Lattice::bounded([4, 2])?, [0.0, 0.0], [1.0, 3.0])?;
/// assert_eq!(mesh.x()[mesh.lattice().index([1, 1])], [0.25, 1.5]);
/// # Ok::<(), driftmesh::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Mesh<const D: usize> {
    lattice: Lattice<D>,
    lower: [f64; D],
    upper: [f64; D],
    x: Vec<[f64; D]>,
    charted: Option<Charted<D>>,
}

/// What a mesh in a domain that is no box has in addition.
#[derive(Debug, Clone, PartialEq)]
struct Charted<const D: usize> {
    chart: Arc<Chart<D>>,
    /// The places of the nodes in the unit box.
    places: Box<Mesh<D>>,
}

impl<const D: usize> Mesh<D> {
    /// The uniform mesh of the box from `lower` to `upper`.
    ///
    /// # Errors
    /// [`Error::Invalid`] unless `lower < upper` along every axis, both are finite, and the cells are much larger than
    /// the round-off of coordinates.
    pub fn uniform(lattice: Lattice<D>, lower: [f64; D], upper: [f64; D]) -> Result<Self> {
        for d in 0..D {
            if !lower[d].is_finite() {
                return Err(Error::invalid("lower", format!("{lower:?}"), "must be finite along every axis"));
            }
            if !(upper[d].is_finite() && lower[d] < upper[d]) {
                let rule = format!("must be finite and above lower = {lower:?} along every axis");
                return Err(Error::invalid("upper", format!("{upper:?}"), rule));
            }
            // below 1e-12 of the largest coordinate a cell is lost in rounding, and extents beyond these give areas of
            // 0 or ∞
            let (extent, size) = (upper[d] - lower[d], lower[d].abs().max(upper[d].abs()));
            if extent / (lattice.cells()[d] as f64) < 1e-12 * size || !(1e-100..1e100).contains(&extent) {
                let rule =
                    format!("between lower = {lower:?} and it, cells cannot be told apart; move or scale the box");
                return Err(Error::invalid("upper", format!("{upper:?}"), rule));
            }
        }
        let cells = lattice.cells();
        let x = (0..lattice.len())
            .map(|k| {
                let node = lattice.node(k);
                std::array::from_fn(|d| match node[d] {
                    i if i == cells[d] => upper[d], // exactly on the box
                    i => lower[d] + (upper[d] - lower[d]) * (i as f64 / cells[d] as f64),
                })
            })
            .collect();
        Ok(Self { lattice, lower, upper, x, charted: None })
    }

    /// The image of equal cells of the unit box.
    ///
    /// # Errors
    /// [`Error::Invalid`] where the axes that wrap around are not those that are closed.
    ///
    /// # Example
    /// ```
    /// use driftmesh::formula::Formula;
    /// use driftmesh::geometry::{Chart, FormulaMap, Lattice, Mesh};
    /// // the quarter of a ring, from radius 1 to 2
    /// let map = ["(1 + s)*cos(pi*r/2)", "(1 + s)*sin(pi*r/2)"].map(|f| Formula::parse(f, &["s", "r"]));
    /// let [x, y] = map.map(|formula| formula.expect("a formula"));
    /// let chart = Chart::new(FormulaMap::new([x, y])?, [false; 2])?;
    /// let mesh = Mesh::charted(Lattice::bounded([4, 8])?, chart)?;
    /// assert_eq!(mesh.x()[mesh.lattice().index([2, 0])], [1.5, 0.0]);
    /// // π (2² − 1²)/4
    /// assert!((mesh.volume() - 2.356194490192345).abs() < 1e-13);
    /// # Ok::<(), driftmesh::Error>(())
    /// ```
    pub fn charted(lattice: Lattice<D>, chart: impl Into<Arc<Chart<D>>>) -> Result<Self> {
        let chart = chart.into();
        if lattice.periodic() != chart.closed() {
            let rule =
                format!("the axes of the chart that are closed are {:?}; let the same ones wrap", chart.closed());
            return Err(Error::invalid("periodic", format!("{:?}", lattice.periodic()), rule));
        }
        Ok(Self::over(chart, Self::uniform(lattice, [0.0; D], [1.0; D])?))
    }

    /// The image of a mesh of the unit box.
    fn over(chart: Arc<Chart<D>>, places: Self) -> Self {
        let (lower, upper) = chart.ends();
        let x = places.x.iter().map(|s| chart.at(*s)).collect();
        Self { lattice: places.lattice, lower, upper, x, charted: Some(Charted { chart, places: Box::new(places) }) }
    }

    /// A mesh of any shape from the positions of its nodes in lattice order. Its box is the smallest one around them.
    ///
    /// # Errors
    /// [`Error::Invalid`] where an axis is periodic; [`Failure::WrongLength`] where the number of positions is not the
    /// number of nodes.
    pub fn mapped(lattice: Lattice<D>, x: Vec<[f64; D]>) -> Result<Self> {
        if lattice.periodic().contains(&true) {
            return Err(Error::invalid("periodic", "true", "a mesh without a box of its own needs bounded axes"));
        }
        if x.len() != lattice.len() {
            return Err(Failure::WrongLength { what: "the mesh", found: x.len(), expected: lattice.len() }.into());
        }
        let (mut lower, mut upper) = ([f64::INFINITY; D], [f64::NEG_INFINITY; D]);
        for x in &x {
            for d in 0..D {
                lower[d] = lower[d].min(x[d]);
                upper[d] = upper[d].max(x[d]);
            }
        }
        Ok(Self { lattice, lower, upper, x, charted: None })
    }

    /// The mesh of the unit box of which this one is the image; a mesh in a box itself. Mesh equations, their
    /// generators and interpolation work on it, and so know boxes only.
    pub fn parameters(&self) -> &Self {
        self.charted.as_ref().map_or(self, |charted| &charted.places)
    }

    /// The chart of a domain that is no box.
    pub fn chart(&self) -> Option<&Arc<Chart<D>>> {
        self.charted.as_ref().map(|charted| &charted.chart)
    }

    /// A mesh over the same lattice and domain with other [`parameters`](Self::parameters), in lattice order.
    ///
    /// # Errors
    /// As [`moved`](Self::moved).
    pub fn placed(&self, places: Vec<[f64; D]>) -> Result<Self, Failure> {
        let Some(Charted { chart, places: before }) = &self.charted else { return self.moved(places) };
        Ok(Self::over(chart.clone(), before.moved(places)?))
    }

    /// The mesh at a share of the way to another one over the same lattice and domain, along which the
    /// [`parameters`](Self::parameters) of the nodes go straight on.
    ///
    /// # Errors
    /// As [`moved`](Self::moved).
    pub fn between(&self, to: &Self, share: f64) -> Result<Self, Failure> {
        let pairs = self.parameters().x.iter().zip(&to.parameters().x);
        self.placed(pairs.map(|(a, b)| std::array::from_fn(|d| a[d] + share * (b[d] - a[d]))).collect())
    }

    /// The mesh of equal cells in the same domain: in the unit box, where there is a chart.
    ///
    /// # Errors
    /// As [`uniform`](Self::uniform) and [`charted`](Self::charted).
    pub fn even(&self, lattice: Lattice<D>) -> Result<Self> {
        match self.chart() {
            Some(chart) => Self::charted(lattice, chart.clone()),
            None => Self::uniform(lattice, self.lower, self.upper),
        }
    }

    /// The volume of the domain: of the box, or of what is within the curves.
    pub fn volume(&self) -> f64 {
        match self.chart() {
            Some(chart) => chart.volume(),
            None => self.extent().iter().product(),
        }
    }

    /// The smallest width of cells of equal size; with a chart the root of their mean volume.
    pub(crate) fn equal_cell(&self) -> f64 {
        let cells = self.lattice.cells();
        match self.chart() {
            Some(chart) => (chart.volume() / cells.iter().product::<usize>() as f64).powf(1.0 / D as f64),
            None => (0..D).map(|d| self.extent()[d] / cells[d] as f64).fold(f64::INFINITY, f64::min),
        }
    }

    /// A mesh over the same lattice and box with other positions of the nodes, in lattice order. It has no chart, even
    /// if this one has.
    ///
    /// # Errors
    /// [`Failure::WrongLength`] where the number of positions is not the number of nodes; [`Failure::NonFinite`] for
    /// the first position that is not finite.
    pub fn moved(&self, x: Vec<[f64; D]>) -> Result<Self, Failure> {
        check_length(&self.lattice, "the mesh", x.len())?;
        let Self { lattice, lower, upper, .. } = *self;
        let moved = Self { lattice, lower, upper, x, charted: None };
        check_finite(["the mesh"; D], &moved, &moved.x)?;
        Ok(moved)
    }

    /// This mesh on a lattice of other `cells`: the same map from the computational domain, linear between the nodes of
    /// this mesh along each axis.
    ///
    /// # Errors
    /// [`Error::Invalid`] where `cells` make no lattice.
    ///
    /// # Example
    /// ```
    /// use driftmesh::geometry::{Lattice, Mesh};
    /// let mesh = Mesh::mapped(Lattice::bounded([2])?, vec![[0.0], [1.0], [4.0]])?;
    /// assert_eq!(mesh.resampled([4])?.x(), [[0.0], [0.5], [1.0], [2.5], [4.0]]);
    /// # Ok::<(), driftmesh::Error>(())
    /// ```
    pub fn resampled(&self, cells: [usize; D]) -> Result<Self> {
        let lattice = Lattice::new(cells, self.lattice.periodic())?;
        if let Some(Charted { chart, places }) = &self.charted {
            return Ok(Self::over(chart.clone(), places.resampled(cells)?));
        }
        let (x, here) = (self.closed(), self.lattice.cells());
        let strides = strides(here.map(|n| n + 1));
        let at = |node: [usize; D]| {
            // the cell that a node lies in, which at the upper end of the axis is the last one, and its distance from
            // the lower end
            let cell: [usize; D] = std::array::from_fn(|d| (node[d] * here[d] / cells[d]).min(here[d] - 1));
            let share: [f64; D] =
                std::array::from_fn(|d| (node[d] * here[d] - cell[d] * cells[d]) as f64 / cells[d] as f64);
            (0..1 << D).fold([0.0; D], |sum, corner| {
                let upper: [bool; D] = std::array::from_fn(|d| corner >> d & 1 == 1);
                let weight: f64 = (0..D).map(|d| if upper[d] { share[d] } else { 1.0 - share[d] }).product();
                let k: usize = (0..D).map(|d| (cell[d] + usize::from(upper[d])) * strides[d]).sum();
                std::array::from_fn(|d| sum[d] + weight * x[k][d])
            })
        };
        let x = (0..lattice.len()).map(|k| at(lattice.node(k))).collect();
        Ok(Self { lattice, lower: self.lower, upper: self.upper, x, charted: None })
    }

    /// The lattice under the mesh.
    pub fn lattice(&self) -> &Lattice<D> {
        &self.lattice
    }

    /// Positions of the nodes, in lattice order.
    pub fn x(&self) -> &[[f64; D]] {
        &self.x
    }

    /// The image of a point inside the box. Along bounded axes, and in a domain with a chart, it is the point itself.
    ///
    /// # Example
    /// ```
    /// use driftmesh::geometry::{Lattice, Mesh};
    /// let mesh = Mesh::uniform(Lattice::new([4, 4], [true, false])?, [1.0, 0.0], [3.0, 2.0])?;
    /// assert_eq!(mesh.image([7.5, 2.5]), [1.5, 2.5]);
    /// # Ok::<(), driftmesh::Error>(())
    /// ```
    pub fn image(&self, x: [f64; D]) -> [f64; D] {
        if self.charted.is_some() {
            return x;
        }
        std::array::from_fn(|d| {
            let (lower, upper) = (self.lower[d], self.upper[d]);
            if !self.lattice.periodic()[d] || (lower..upper).contains(&x[d]) {
                return x[d];
            }
            let inside = x[d] - (upper - lower) * ((x[d] - lower) / (upper - lower)).floor();
            // round-off may leave the image on the upper side, which is the same as the lower one
            if inside < upper { inside.max(lower) } else { lower }
        })
    }

    /// The [images](Self::image) of all nodes, at which formulas of x and y are evaluated.
    pub fn images(&self) -> Cow<'_, [[f64; D]]> {
        match self.charted.is_none() && self.lattice.periodic().contains(&true) {
            false => Cow::Borrowed(&self.x),
            true => Cow::Owned(self.x.iter().map(|x| self.image(*x)).collect()),
        }
    }

    /// Positions with the closing nodes of periodic axes appended, an array of shape cells + 1, as pictures and files
    /// need them.
    pub fn closed(&self) -> Cow<'_, [[f64; D]]> {
        let nodes = self.lattice.nodes();
        if nodes == self.lattice.cells().map(|n| n + 1) {
            return Cow::Borrowed(&self.x);
        }
        let jump = self.jump();
        let positions = self.lattice.closed_nodes().map(|node| {
            let x = self.x[self.lattice.index(std::array::from_fn(|d| node[d] % nodes[d]))];
            let turns = (0..D).filter(|&d| node[d] == nodes[d]);
            turns.fold(x, |x, d| std::array::from_fn(|c| x[c] + jump[d][c]))
        });
        Cow::Owned(positions.collect())
    }

    /// Lower corner of the box, or of the smallest one around the domain.
    pub fn lower(&self) -> [f64; D] {
        self.lower
    }

    /// Upper corner of the box, or of the smallest one around the domain.
    pub fn upper(&self) -> [f64; D] {
        self.upper
    }

    /// Edge lengths of the box.
    pub fn extent(&self) -> [f64; D] {
        std::array::from_fn(|d| self.upper[d] - self.lower[d])
    }

    /// A node with its indices and coordinates, as failures tell of it.
    pub fn node_place(&self, k: usize) -> NodePlace {
        NodePlace::new(self.lattice.node(k), self.x[k])
    }

    /// What positions jump by on a turn around each axis: the extent of the box along it; nothing on closed axes.
    pub fn jump(&self) -> [[f64; D]; D] {
        match self.charted {
            Some(_) => [[0.0; D]; D],
            None => diagonal(self.extent()),
        }
    }

    /// The largest distance of a node from its position in another mesh over the same lattice.
    pub fn farthest(&self, other: &Self) -> f64 {
        let way = |(a, b): (&[f64; D], &[f64; D])| (0..D).map(|d| (a[d] - b[d]) * (a[d] - b[d])).sum::<f64>();
        self.x.iter().zip(&other.x).map(way).fold(0.0, f64::max).sqrt()
    }

    /// Length of the shortest edge between neighbouring nodes.
    pub fn shortest_edge(&self) -> f64 {
        let x = self.closed();
        let size = self.lattice.cells().map(|n| n + 1);
        let mut shortest = f64::INFINITY;
        let mut measure = |a: &[f64; D], b: &[f64; D]| {
            let length2: f64 = (0..D).map(|c| (b[c] - a[c]) * (b[c] - a[c])).sum();
            shortest = if length2 < shortest { length2 } else { shortest };
        };
        for d in 0..D {
            // neighbours along an axis lie a stride apart, within blocks of `size[d]` strides
            let stride = size[d + 1..].iter().product::<usize>();
            for block in x.chunks_exact(stride * size[d]) {
                block.iter().zip(&block[stride..]).for_each(|(a, b)| measure(a, b));
            }
        }
        shortest.sqrt()
    }
}

/// The first two of some numbers, filled up with 0 where there are fewer.
pub(crate) fn first_two<T: Copy + Default>(values: &[T]) -> [T; 2] {
    [0, 1].map(|d| values.get(d).copied().unwrap_or_default())
}
