//! Tables of values as functions of formulas.

use super::parse::check_table_name;
use std::cell::RefCell;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};

/// How a table has values between its places.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Interpolation {
    /// Linear between two places, bilinear in a cell of a raster.
    #[default]
    Linear,
    /// Cubics with one slope at each place, the weighted harmonic mean of those beside it, and 0 where these have not
    /// the same sign: no value lies beyond those of the places around it.
    Monotone,
}

/// A function given by its values at places on a line, or on a raster in the plane
///
/// Beyond its ends it is constant, and [`Table::outside`] tells how far beyond it was asked for. Where it has no
/// derivative, at the places of a linear one, it has that of the piece above.
///
/// # Example
/// ```
/// use driftmesh::formula::{Formula, Interpolation, Table, with_tables};
/// use std::sync::Arc;
/// let bed = Table::new("bed", vec![vec![0.0, 1.0, 3.0]], vec![2.0, 4.0, 0.0], Interpolation::Linear)?;
/// let (depth, slope) = with_tables(&[Arc::new(bed)], || {
///     let depth = Formula::parse("h - bed(2*x)", &["x", "h"])?;
///     let slope = depth.derivative(0)?;
///     Ok::<_, driftmesh::formula::Mistake>((depth, slope))
/// })?;
/// // bed(2) = 2, and its slope is −2 there
/// assert_eq!(depth.eval(&[1.0, 5.0]), 3.0);
/// assert_eq!(slope.eval(&[1.0, 5.0]), 4.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Source
/// Fritsch and Butland, *A method for constructing local monotone piecewise cubic interpolants*, SIAM J. Sci. Stat.
/// Comput. 5 (1984).
#[derive(Debug)]
pub struct Table {
    /// By which nodes of formulas name it: no two tables have the same.
    number: u32,
    name: String,
    /// Places along each axis, from the lowest to the highest.
    places: Vec<Vec<f64>>,
    /// At each place, last axis fastest: the value, its slopes along the first and the last axis, and that of one along
    /// the other.
    nodes: Vec<[f64; 4]>,
    interpolation: Interpolation,
    /// For each axis, the largest distances below and above its places that were asked for, as bits.
    outside: [[AtomicU64; 2]; 2],
}

/// A share of the length of a table by which rounding may lead out of it.
const ROUNDING: f64 = 1e-9;

/// Number of the next table that is made, by which tables are told apart.
static NUMBERS: AtomicU32 = AtomicU32::new(0);

thread_local! {
    /// The tables that formulas may name, as they are read in this thread.
    static NAMED: RefCell<Vec<Arc<Table>>> = const { RefCell::new(Vec::new()) };
}

/// Reads formulas that may name these tables as functions, and no others, as long as `read` lasts. The texts of a study
/// are read in many places, each when it is needed; what they may name is a property of the whole study.
pub fn with_tables<R>(tables: &[Arc<Table>], read: impl FnOnce() -> R) -> R {
    /// Puts back what was known before, also where `read` panics.
    struct Before(Vec<Arc<Table>>);
    impl Drop for Before {
        fn drop(&mut self) {
            NAMED.set(std::mem::take(&mut self.0));
        }
    }
    let _before = Before(NAMED.replace(tables.to_vec()));
    read()
}

/// The table of this name, if formulas may name one.
pub(super) fn named(name: &str) -> Option<Arc<Table>> {
    NAMED.with_borrow(|tables| tables.iter().find(|table| table.name == name).cloned())
}

/// All tables that formulas may name.
pub(super) fn all_named() -> Vec<Arc<Table>> {
    NAMED.with_borrow(Clone::clone)
}

impl Table {
    /// A table of one or two axes from its places along each and its values, last axis fastest.
    ///
    /// # Errors
    /// What is wrong, where the name is none or taken, a number is not finite, there are fewer than two places along an
    /// axis, they do not rise, or there is another number of values than of places.
    pub fn new(
        name: &str,
        places: Vec<Vec<f64>>,
        values: Vec<f64>,
        interpolation: Interpolation,
    ) -> Result<Self, String> {
        check_table_name(name)?;
        if !(1..=2).contains(&places.len()) {
            return Err(format!("a table has one or two axes, not {}", places.len()));
        }
        for axis in &places {
            if axis.len() < 2 {
                return Err(format!("a table needs at least 2 places, and this has {}", axis.len()));
            }
            if let Some(k) = axis.iter().position(|x| !x.is_finite()) {
                return Err(format!("place {} is {}, and must be a finite number", k + 1, axis[k]));
            }
            if let Some(k) = axis.windows(2).position(|pair| pair[0] >= pair[1]) {
                return Err(format!(
                    "places must rise, and {} is followed by {} (place {} of {})",
                    axis[k],
                    axis[k + 1],
                    k + 2,
                    axis.len()
                ));
            }
        }
        let count = places.iter().map(Vec::len).product::<usize>();
        if values.len() != count {
            return Err(format!("{count} places need as many values, not {}", values.len()));
        }
        if let Some(k) = values.iter().position(|value| !value.is_finite()) {
            return Err(format!("value {} is {}, and must be a finite number", k + 1, values[k]));
        }
        let number = NUMBERS.fetch_add(1, Ordering::Relaxed);
        let nodes = nodes(&places, &values, interpolation);
        Ok(Self { number, name: name.into(), places, nodes, interpolation, outside: Default::default() })
    }

    /// What formulas call it.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// How many arguments it takes.
    pub fn axes(&self) -> usize {
        self.places.len()
    }

    /// The lowest and the highest place along an axis.
    pub fn range(&self, axis: usize) -> [f64; 2] {
        let places = &self.places[axis];
        [places[0], places[places.len() - 1]]
    }

    /// The value at a place; a table of one axis looks at the first number.
    pub fn at(&self, x: [f64; 2]) -> f64 {
        self.slope(x, [0; 2])
    }

    /// For each axis, the lowest and the highest place beyond its ends that it was asked for, if there was one farther
    /// beyond than rounding leads.
    pub fn outside(&self) -> Vec<[Option<f64>; 2]> {
        let far = |axis: usize, end: usize| {
            let (range, by) = (self.range(axis), f64::from_bits(self.outside[axis][end].load(Ordering::Relaxed)));
            let place = if end == 0 { range[0] - by } else { range[1] + by };
            (by > ROUNDING * (range[1] - range[0])).then_some(place)
        };
        (0..self.axes()).map(|axis| [far(axis, 0), far(axis, 1)]).collect()
    }

    pub(super) fn number(&self) -> u32 {
        self.number
    }

    /// The order of the last derivative along an axis that is not 0.
    pub(super) fn degree(&self) -> u8 {
        match self.interpolation {
            Interpolation::Linear => 1,
            Interpolation::Monotone => 3,
        }
    }

    /// A derivative, by its order along each axis.
    pub(super) fn slope(&self, x: [f64; 2], orders: [u8; 2]) -> f64 {
        let Some((i, [v, dv])) = self.weights(0, x[0], orders[0]) else { return f64::NAN };
        if self.axes() == 1 {
            let [a, b] = [self.nodes[i], self.nodes[i + 1]];
            return v[0] * a[0] + v[1] * b[0] + (dv[0] * a[1] + dv[1] * b[1]);
        }
        let Some((j, [w, dw])) = self.weights(1, x[1], orders[1]) else { return f64::NAN };
        let mut sum = 0.0;
        for (a, b) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            let [u, along, across, both] = self.nodes[(i + a) * self.places[1].len() + j + b];
            sum += v[a] * (w[b] * u + dw[b] * across) + dv[a] * (w[b] * along + dw[b] * both);
        }
        sum
    }

    /// The piece of an axis that a place lies in, and the weights of the values and of the slopes at its ends in a
    /// derivative there. None for NaN.
    fn weights(&self, axis: usize, x: f64, order: u8) -> Option<(usize, [[f64; 2]; 2])> {
        let places = &self.places[axis];
        let [low, high] = self.range(axis);
        if x.is_nan() {
            return None;
        }
        let beyond = if x < low { Some((0, low - x)) } else { (x > high).then_some((1, x - high)) };
        if let Some((end, by)) = beyond {
            // bits of numbers from 0 on have the order of the numbers
            self.outside[axis][end].fetch_max(by.to_bits(), Ordering::Relaxed);
            if order > 0 {
                return Some((0, [[0.0; 2]; 2]));
            }
        }
        let x = x.clamp(low, high);
        let i = places.partition_point(|place| *place <= x).clamp(1, places.len() - 1) - 1;
        let h = places[i + 1] - places[i];
        let t = (x - places[i]) / h;
        let weights = match (self.interpolation, order) {
            (Interpolation::Linear, 0) => [[1.0 - t, t], [0.0; 2]],
            (Interpolation::Linear, 1) => [[-1.0 / h, 1.0 / h], [0.0; 2]],
            (Interpolation::Monotone, order) => hermite(t, h, order),
            _ => [[0.0; 2]; 2],
        };
        Some((i, weights))
    }
}

/// The weights of values and slopes at the ends of a piece of length h in a derivative of Hermite's cubic.
fn hermite(t: f64, h: f64, order: u8) -> [[f64; 2]; 2] {
    match order {
        0 => {
            let (rise, u) = (t * t * (3.0 - 2.0 * t), 1.0 - t);
            [[1.0 - rise, rise], [h * t * u * u, -h * t * t * u]]
        }
        1 => {
            let rise = 6.0 * t * (1.0 - t) / h;
            [[-rise, rise], [(1.0 - t) * (1.0 - 3.0 * t), t * (3.0 * t - 2.0)]]
        }
        2 => {
            let rise = (6.0 - 12.0 * t) / (h * h);
            [[-rise, rise], [(6.0 * t - 4.0) / h, (6.0 * t - 2.0) / h]]
        }
        3 => {
            let rise = -12.0 / (h * h * h);
            [[-rise, rise], [6.0 / (h * h); 2]]
        }
        _ => [[0.0; 2]; 2],
    }
}

/// The value and the slopes at each place.
fn nodes(places: &[Vec<f64>], values: &[f64], interpolation: Interpolation) -> Vec<[f64; 4]> {
    let mut nodes: Vec<[f64; 4]> = values.iter().map(|value| [*value, 0.0, 0.0, 0.0]).collect();
    if interpolation == Interpolation::Linear {
        return nodes;
    }
    let across = places.get(1).map_or(1, Vec::len);
    // of values along the first axis, of values along the second, and of the first slopes along the second
    for (axis, from, to) in [(0, 0, 1), (1, 0, 2), (1, 1, 3)] {
        let Some(places) = places.get(axis) else { break };
        let (stride, lines) = if axis == 0 { (across, across) } else { (1, values.len() / across) };
        for line in 0..lines {
            let first = if axis == 0 { line } else { line * across };
            let along: Vec<f64> = (0..places.len()).map(|k| nodes[first + k * stride][from]).collect();
            for (k, slope) in slopes(places, &along).into_iter().enumerate() {
                nodes[first + k * stride][to] = slope;
            }
        }
    }
    nodes
}

/// The slopes at the places of a line for which cubics do not leave the range of the values beside them.
fn slopes(x: &[f64], values: &[f64]) -> Vec<f64> {
    let h: Vec<f64> = x.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let d: Vec<f64> = values.windows(2).zip(&h).map(|(pair, h)| (pair[1] - pair[0]) / h).collect();
    if d.len() == 1 {
        return vec![d[0]; 2];
    }
    let inside = |k: usize| {
        if d[k - 1] * d[k] <= 0.0 {
            return 0.0;
        }
        let (v, w) = (2.0 * h[k] + h[k - 1], h[k] + 2.0 * h[k - 1]);
        (v + w) / (v / d[k - 1] + w / d[k])
    };
    // at an end, from the two pieces beside it
    let end = |[h, g]: [f64; 2], [d, e]: [f64; 2]| {
        let slope = ((2.0 * h + g) * d - h * e) / (h + g);
        match () {
            () if slope * d <= 0.0 => 0.0,
            () if d * e <= 0.0 && slope.abs() > 3.0 * d.abs() => 3.0 * d,
            () => slope,
        }
    };
    let last = d.len() - 1;
    let first = end([h[0], h[1]], [d[0], d[1]]);
    let after = end([h[last], h[last - 1]], [d[last], d[last - 1]]);
    [first].into_iter().chain((1..d.len()).map(inside)).chain([after]).collect()
}
