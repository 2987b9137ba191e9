//! Domains that are not boxes: images of the unit box.

use super::map::{Map, Turned};
use super::quality::{cross, minus};
use crate::error::{Error, Result};

/// A domain that is the image of the unit box
///
/// ```text
/// x = map(s),   s ∈ [0, 1]^D,   map(s + e_d) = map(s) on a closed axis d
/// ```
///
/// The sides of the box become the sides of the domain: where a node slides along a side of the box, it stays on the
/// curve. An axis is closed where its two ends are the same curve, as in a mesh around an aerofoil.
///
/// # Source
/// Thompson, Warsi and Mastin, *Numerical Grid Generation* (1985).
#[derive(Debug)]
pub struct Chart<const D: usize = 2> {
    map: Box<dyn Map<D>>,
    closed: [bool; D],
    lower: [f64; D],
    upper: [f64; D],
    volume: f64,
    /// For each axis and both of its ends, 2 ∫ of [`Chart::swept`] from 0 to each knot; empty on a closed axis.
    sides: [[Vec<f64>; 2]; D],
}

/// Places and weights of Gauss's rule of six points on [0, 1].
const GAUSS: [(f64, f64); 6] = [
    (0.03376524289842399, 0.08566224618958518),
    (0.16939530676686773, 0.1803807865240693),
    (0.38069040695840156, 0.23395696728634552),
    (0.6193095930415985, 0.23395696728634552),
    (0.8306046932331322, 0.1803807865240693),
    (0.966234757101576, 0.08566224618958518),
];
/// Number of places along an axis at which a map is evaluated and checked before it is used.
const SAMPLES: usize = 64;
/// Ends of a closed axis may be apart by this share of the size of the domain, which is round-off.
const SEAM: f64 = 1e-9;

/// Charts are the same where they close alike and reach as far; places of nodes tell the rest.
impl<const D: usize> PartialEq for Chart<D> {
    fn eq(&self, other: &Self) -> bool {
        (self.closed, self.lower, self.upper, self.volume) == (other.closed, other.lower, other.upper, other.volume)
    }
}

impl<const D: usize> Chart<D> {
    /// Which axes are closed.
    pub fn closed(&self) -> [bool; D] {
        self.closed
    }

    /// Corners of the smallest box around the domain, as far as samples of the map tell.
    pub fn ends(&self) -> ([f64; D], [f64; D]) {
        (self.lower, self.upper)
    }

    /// The volume of the domain.
    pub fn volume(&self) -> f64 {
        self.volume
    }

    /// x at a place of the unit box, beyond which closed axes go on.
    pub fn at(&self, s: [f64; D]) -> [f64; D] {
        self.map.at(self.inside(s))
    }

    /// ∂x/∂s along each axis.
    pub fn slopes(&self, s: [f64; D]) -> [[f64; D]; D] {
        self.map.slopes(self.inside(s))
    }

    fn inside(&self, s: [f64; D]) -> [f64; D] {
        std::array::from_fn(|d| if self.closed[d] { s[d] - s[d].floor() } else { s[d] })
    }
}

impl Chart<2> {
    /// The domain of a map, of which some axes may be closed.
    ///
    /// # Errors
    /// [`Error::Invalid`] where the map has no finite value, where an axis that is said to be closed is not, and where
    /// the map turns the square over.
    ///
    /// # Example
    /// ```
    /// use driftmesh::formula::Formula;
    /// use driftmesh::geometry::{Chart, FormulaMap};
    /// let formula = |text| Formula::parse(text, &["r", "s"]).expect("a formula");
    /// let ring = || FormulaMap::new([formula("(1 + r)*cos(2*pi*s)"), formula("(1 + r)*sin(2*pi*s)")]);
    /// assert!((Chart::new(ring()?, [false, true])?.volume() - 9.42477796076938).abs() < 1e-12); // 3π
    /// let error = Chart::new(ring()?, [true, false]).unwrap_err();
    /// assert!(error.to_string().contains("the ends of axis 1 are apart by 1.000e0"), "{error}");
    /// # Ok::<(), driftmesh::Error>(())
    /// ```
    pub fn new(map: impl Map + 'static, closed: [bool; 2]) -> Result<Self> {
        let mut chart = Self {
            map: Box::new(map),
            closed,
            lower: [f64::INFINITY; 2],
            upper: [f64::NEG_INFINITY; 2],
            volume: 0.0,
            sides: Default::default(),
        };
        chart.look()?;
        for axis in (0..2).filter(|&axis| closed[axis]) {
            let (gap, s) = gap(&*chart.map, axis);
            if gap > SEAM * chart.size() {
                let rule = format!(
                    "the ends of axis {} are apart by {gap:.3e} where the other parameter is {s}; mend the map, or \
                     leave the axis open",
                    axis + 1
                );
                return Err(Error::invalid("closed", format!("{closed:?}"), rule));
            }
        }
        for axis in (0..2).filter(|&axis| !closed[axis]) {
            chart.sides[axis] = [0, 1].map(|end| chart.integrated(axis, end));
        }
        let ends = |axis: usize| chart.sides[axis].each_ref().map(|side| side.last().copied().unwrap_or_default());
        let ([left, right], [bottom, top]) = (ends(0), ends(1));
        chart.volume = 0.5 * (bottom + right - top - left);
        if chart.volume.is_nan() || chart.volume <= 0.0 {
            let rule = "the first axis must turn into the second against the clock; exchange them, or turn one round";
            return Err(Error::invalid("map", format!("area {:.3e}", chart.volume), rule));
        }
        Ok(chart)
    }

    /// The domain of a map whose axes may be taken in the other order, or one of them from its other end, so that the
    /// first turns into the second against the clock
    ///
    /// A closed axis is that of the parameter along which the map closes, and may run either way. Where no axis is
    /// closed, the first is that of the parameter that turns into the other against the clock. With `exchange` false
    /// the order is as it is.
    ///
    /// # Errors
    /// As [`new`](Self::new), and where both axes are to be closed.
    pub fn oriented(map: impl Map + 'static, closed: [bool; 2], exchange: bool) -> Result<Self> {
        if closed == [true; 2] {
            let rule = "a domain in the plane is closed along one axis at most; let the other one be false";
            return Err(Error::invalid("closed", "[true, true]", rule));
        }
        let (against, [first, second]) = (turns(&map), [0, 1].map(|axis| gap(&map, axis).0));
        // NaN compares as false, and is told of by `new`
        let exchanged = exchange
            && match closed.iter().position(|closed| *closed) {
                Some(axis) => (second < first) != (axis == 1),
                None => against < 0.0,
            };
        let clockwise = (against < 0.0) != exchanged;
        let reversed = closed.map(|closed| closed && clockwise);
        Self::new(Turned { map: Box::new(map), exchanged, reversed }, closed)
    }

    /// Looks at the map at places all over the square.
    fn look(&mut self) -> Result<()> {
        for (i, j) in (0..=SAMPLES).flat_map(|i| (0..=SAMPLES).map(move |j| (i, j))) {
            let s = [i, j].map(|i| i as f64 / SAMPLES as f64);
            let x = self.map.at(s);
            if let Some(d) = x.iter().position(|x| !x.is_finite()) {
                let (key, rule) = (["map.x", "map.y"][d], "mend it, since it must be finite all over the unit square");
                return Err(Error::invalid(key, format!("{} at ({}, {})", x[d], s[0], s[1]), rule));
            }
            for (d, x) in x.into_iter().enumerate() {
                (self.lower[d], self.upper[d]) = (self.lower[d].min(x), self.upper[d].max(x));
            }
        }
        Ok(())
    }

    fn size(&self) -> f64 {
        (self.upper[0] - self.lower[0]).max(self.upper[1] - self.lower[1])
    }

    /// Sums over the pieces of a side, from its beginning to each knot.
    fn integrated(&self, axis: usize, end: usize) -> Vec<f64> {
        let (mut sums, pieces) = (vec![0.0], self.map.pieces()[1 - axis]);
        for k in 0..pieces {
            let [from, to] = [k, k + 1].map(|k| k as f64 / pieces as f64);
            sums.push(sums[k] + self.swept(axis, end, from, to));
        }
        sums
    }

    /// Twice the area that the way from the middle of the box around the domain to a point sweeps while the point goes
    /// along a side.
    fn swept(&self, axis: usize, end: usize, from: f64, to: f64) -> f64 {
        let middle = self.middle();
        let part = |(share, weight): (f64, f64)| {
            let along = from + share * (to - from);
            let place = std::array::from_fn(|d| if d == axis { end as f64 } else { along });
            weight * cross(minus(self.at(place), middle), self.slopes(place)[1 - axis])
        };
        (to - from) * GAUSS.into_iter().map(part).sum::<f64>()
    }

    pub(super) fn middle(&self) -> [f64; 2] {
        [0, 1].map(|d| 0.5 * (self.lower[d] + self.upper[d]))
    }

    /// Twice the area that is swept along a side from its beginning to a place: differences of it are exact, whatever
    /// the side is divided into.
    pub(super) fn swept_to(&self, axis: usize, end: usize, along: f64) -> f64 {
        let (sums, pieces) = (&self.sides[axis][end], self.map.pieces()[1 - axis]);
        let Some(all) = sums.last() else { return 0.0 };
        let turns = if self.closed[1 - axis] { along.floor() } else { 0.0 };
        let inside = along - turns;
        let piece = ((inside * pieces as f64) as usize).min(pieces - 1);
        turns * all + sums[piece] + self.swept(axis, end, piece as f64 / pieces as f64, inside)
    }

    /// The place of a point, by Newton's method from a place nearby; nothing where it is outside or not found.
    pub(super) fn place(&self, x: [f64; 2], near: [f64; 2]) -> Option<[f64; 2]> {
        /// Steps of Newton's method after which the place counts as not found: from a place in the same cell it takes
        /// three or four.
        const STEPS: usize = 30;
        /// The place is found once its image is off x by at most this share of the size of the domain: rounding of the
        /// map.
        const ROUNDING: f64 = 1e-9;
        let clamped = |s: [f64; 2]| [0, 1].map(|d| if self.closed[d] { s[d] } else { s[d].clamp(0.0, 1.0) });
        let mut s = near;
        for _ in 0..STEPS {
            let off = minus(x, self.at(s));
            let [e, f] = self.slopes(s);
            let volume = cross(e, f);
            let change = [cross(off, f) / volume, cross(e, off) / volume];
            // a step beyond the sides is stopped there, as long as it leads on
            let next = clamped([s[0] + change[0], s[1] + change[1]]);
            let left = minus(x, self.at(next));
            if left[0].hypot(left[1]) <= ROUNDING * self.size() && change.iter().all(|c| c.abs() < 1e-6) {
                return Some(next);
            }
            if !change.iter().all(|c| c.is_finite()) || next == s {
                return None;
            }
            s = next;
        }
        None
    }
}

/// The largest distance between both ends of an axis, and the place along the other axis where it is.
fn gap(map: &dyn Map, axis: usize) -> (f64, f64) {
    let apart = |k: usize| {
        let along = k as f64 / SAMPLES as f64;
        let place = |end: f64| std::array::from_fn(|d| if d == axis { end } else { along });
        let [dx, dy] = minus(map.at(place(1.0)), map.at(place(0.0)));
        (dx.hypot(dy), along)
    };
    (0..=SAMPLES).map(apart).fold((0.0, 0.0), |most, at| if at.0 > most.0 { at } else { most })
}

/// Twice the area within the image of the sides of the square, positive where the map keeps their sense.
fn turns(map: &dyn Map) -> f64 {
    let share = |k: usize| k as f64 / SAMPLES as f64;
    let sides: [&dyn Fn(f64) -> [f64; 2]; 4] = [&|s| [s, 0.0], &|s| [1.0, s], &|s| [1.0 - s, 1.0], &|s| [0.0, 1.0 - s]];
    let points: Vec<[f64; 2]> =
        sides.iter().flat_map(|side| (0..SAMPLES).map(move |k| side(share(k)))).map(|s| map.at(s)).collect();
    let next = points.iter().cycle().skip(1);
    points.iter().zip(next).map(|(a, b)| cross(minus(*a, points[0]), minus(*b, points[0]))).sum()
}
