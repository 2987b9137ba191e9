use crate::error::{Error, Failure, Result};
use crate::formula::Formula;
use crate::geometry::{Chart, FormulaMap, Lattice, Mesh, check_simple, check_unfolded};
use crate::random::{Philox, uniform};
use crate::setting::{Axes, pair};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// `[domain]` of a study of kind `poisson`: between two curves, or the image of the unit square.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MappedDomain {
    /// x at the left and at the right side of a domain between the curves `bottom` and `top`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub x: Option<Ends>,
    /// Lower curve of the domain, a formula of x.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bottom: Option<String>,
    /// Upper curve of the domain, a formula of x.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub top: Option<String>,
    /// A mapping of the unit square (s, r), in place of `x`, `bottom` and `top`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub map: Option<Mapping>,
    /// Which axes of the mapping are closed, so that their ends are the same curve, as in a ring: the axis of the
    /// parameter along which the map closes, in either direction.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub closed: Option<Axes<bool, 2>>,
    /// How nodes of the unit square are displaced before it is graded and mapped: at random, or by a shear.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub distort: Option<Distort>,
}

/// The lower and the upper of two numbers.
#[derive(Debug, Clone, Copy, Serialize, Deserialize, JsonSchema)]
pub struct Ends(#[serde(deserialize_with = "pair")] pub [f64; 2]);

/// x and y as formulas of s and r in the unit square.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table such as { x = \"s\", y = \"r*(1 + s)\" }")]
pub struct Mapping {
    /// x of the image of a point, a formula of its coordinates s and r in the unit square.
    pub x: String,
    /// y of the image of a point, a formula of its coordinates s and r in the unit square.
    pub y: String,
}

/// A distortion of the unit square: `perturb` with `seed`, or `shear`.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default, expecting = "a table such as { perturb = 0.2, seed = 1 }")]
pub struct Distort {
    /// Each node inside is displaced at random along each axis, by up to this share of a cell.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub perturb: Option<f64>,
    /// Seed of the random numbers of `perturb`; 0 where nothing is said.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    /// Amplitude c of the distortion s ← s + c sin(2πr) sin(πs) of the unit square.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shear: Option<f64>,
}

/// A side of a mesh.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Side {
    /// The side s = 0.
    Left,
    /// The side s = 1.
    Right,
    /// The side r = 0.
    Bottom,
    /// The side r = 1.
    Top,
}

impl Side {
    /// The axis across it, and whether it is the upper one.
    pub fn place(self) -> (usize, bool) {
        match self {
            Self::Left => (0, false),
            Self::Right => (0, true),
            Self::Bottom => (1, false),
            Self::Top => (1, true),
        }
    }
}

/// `grid.grading`: smaller cells toward a side, by `power` or by `ratio`.
#[derive(Debug, Clone, Copy, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table such as { toward = \"top\", power = 1.5 }")]
pub struct Grading {
    /// The side toward which cells get smaller.
    pub toward: Side,
    /// Power p of 1 − (1 − s)^p, where s is the share of the lattice toward the side: above 0 and at most 10, and above
    /// 1 for smaller cells there.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub power: Option<f64>,
    /// Spacing at the side over that at the opposite one, above 1e-6 and at most 1: the p of (1 − p^s)/(1 − p), where s
    /// is the share of the lattice toward the side.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ratio: Option<f64>,
}

/// Reads a formula of these variables.
pub(super) fn parse(key: &str, text: &str, variables: &[&str]) -> Result<Formula> {
    Formula::parse(text, variables).map_err(|mistake| mistake.of(key, text))
}

impl Grading {
    fn check(&self) -> Result<()> {
        let bounds = |key, value: f64, low: f64, high: f64| match value > low && value <= high {
            true => Ok(()),
            false => Err(Error::invalid(key, value, format!("must be above {low} and at most {high}"))),
        };
        match (self.power, self.ratio) {
            (Some(power), None) => bounds("power", power, 0.0, 10.0),
            (None, Some(ratio)) => bounds("ratio", ratio, 1e-6, 1.0),
            (None, None) => Err(Error::invalid("power", "not given", "give one of power and ratio")),
            _ => Err(Error::invalid("ratio", "given", "goes not with power; leave one of them out")),
        }
    }

    /// The error that names the grading that makes a mesh fold, which does not without it.
    fn blame(&self, failure: &Failure) -> Error {
        let (key, value, cure) = match (self.power, self.ratio) {
            (Some(power), _) => ("power", power, "bring it nearer to 1"),
            (None, ratio) => ("ratio", ratio.unwrap_or_default(), "raise it"),
        };
        Error::invalid(format!("grid.grading.{key}"), value, format!("{failure}; {cure}"))
    }

    fn apply(&self, place: [f64; 2]) -> [f64; 2] {
        let (axis, upper) = self.toward.place();
        let toward = |s: f64| match (self.power, self.ratio) {
            (Some(p), _) => 1.0 - (1.0 - s).powf(p),
            (None, Some(p)) if p < 1.0 => (1.0 - p.powf(s)) / (1.0 - p),
            _ => s,
        };
        let mut place = place;
        let s = place[axis].clamp(0.0, 1.0);
        place[axis] = if upper { toward(s) } else { 1.0 - toward(1.0 - s) };
        place
    }
}

/// What the mapping is made of.
enum Shape {
    Between { x: [f64; 2], curves: [Formula; 2] },
    Image([Formula; 2]),
}

impl MappedDomain {
    /// The mesh of this domain: the lattice of the unit square distorted, graded and mapped.
    ///
    /// # Errors
    /// [`Error::Invalid`] or [`Error::Formula`] with the key below `domain` or `grid` that makes no mesh.
    pub fn mesh(&self, cells: [usize; 2], grading: Option<Grading>) -> Result<Mesh<2>> {
        let shape = self.shape().map_err(|error| error.within("domain"))?;
        let closed = self.closed.as_ref().map_or([false; 2], |closed| **closed);
        let lattice = Lattice::new(cells, closed).map_err(|error| error.within("grid"))?;
        if let Some(grading) = grading {
            grading.check().map_err(|error| error.within("grading").within("grid"))?;
        }
        self.check_distortion().map_err(|error| error.within("distort").within("domain"))?;
        let graded = |place| grading.map_or(place, |grading| grading.apply(place));
        let places: Vec<[f64; 2]> = (0..lattice.len()).map(|k| graded(self.distorted(&lattice, k))).collect();
        let mesh = match shape {
            Shape::Image(map) if closed.contains(&true) => {
                let chart = FormulaMap::new(map).and_then(|map| Chart::oriented(map, closed, true));
                Mesh::charted(lattice, chart.map_err(|error| error.within("domain"))?)?.placed(places)?
            }
            shape => {
                let points = places.into_iter().map(|place| shape.point(place)).collect::<Result<_>>();
                Mesh::mapped(lattice, points.map_err(|error| error.within("domain"))?)?
            }
        };
        match check_unfolded(&mesh).and_then(|()| check_simple(&mesh)) {
            Ok(()) => Ok(mesh),
            Err(failure) => Err(match grading {
                Some(grading) if self.mesh(cells, None).is_ok() => grading.blame(&failure),
                _ => self.blame(&failure),
            }),
        }
    }

    /// The setting that made a mesh fold.
    fn blame(&self, failure: &Failure) -> Error {
        let what = failure.to_string();
        match (&self.distort, &self.map) {
            (Some(distort), _) => {
                let (key, value) = match (distort.perturb, distort.shear) {
                    (Some(perturb), _) => ("perturb", perturb),
                    (None, shear) => ("shear", shear.unwrap_or_default()),
                };
                Error::invalid(format!("domain.distort.{key}"), value, format!("{what}; lower it"))
            }
            (None, Some(map)) => {
                let rule = format!("{what}; s must turn into r against the clock, and no point may be met twice");
                Error::invalid("domain.map", format!("({}, {})", map.x, map.y), rule)
            }
            (None, None) => {
                let top = self.top.clone().unwrap_or_default();
                Error::invalid("domain.top", format!("{top:?}"), what)
            }
        }
    }

    fn check_distortion(&self) -> Result<()> {
        let Some(distort) = self.distort else { return Ok(()) };
        let within = |key, value: f64, most: f64| match value.abs() <= most {
            true => Ok(()),
            false => Err(Error::invalid(key, value, format!("must be between -{most} and {most}"))),
        };
        match (distort.perturb, distort.shear) {
            (Some(perturb), None) => within("perturb", perturb, 1.0),
            (None, Some(_)) if distort.seed.is_some() => {
                Err(Error::invalid("seed", "given", "only perturb has random numbers; leave it out"))
            }
            (None, Some(shear)) => within("shear", shear, 1.0),
            (None, None) => Err(Error::invalid("perturb", "not given", "give one of perturb and shear")),
            _ => Err(Error::invalid("shear", "given", "goes not with perturb; leave one of them out")),
        }
    }

    /// Place of a node in the unit square.
    fn distorted(&self, lattice: &Lattice<2>, k: usize) -> [f64; 2] {
        let (node, h) = (lattice.node(k), lattice.spacing());
        let cells = lattice.cells();
        // the last node is at 1 to the last bit
        let place: [f64; 2] = std::array::from_fn(|d| node[d] as f64 / cells[d] as f64);
        match self.distort {
            Some(Distort { perturb: Some(share), seed, .. }) if !lattice.on_side(k) => {
                let mut words = Philox::new(seed.unwrap_or_default()).stream(0, k as u32, 0);
                std::array::from_fn(|d| place[d] + share * h[d] * (2.0 * uniform(words.word()) - 1.0))
            }
            Some(Distort { shear: Some(c), .. }) if !lattice.on_side(k) => {
                [place[0] + c * (2.0 * PI * place[1]).sin() * (PI * place[0]).sin(), place[1]]
            }
            _ => place,
        }
    }

    fn shape(&self) -> Result<Shape> {
        if self.map.is_none() && self.closed.as_ref().is_some_and(|closed| closed.contains(&true)) {
            return Err(Error::invalid("closed", "given", "goes with domain.map; leave it out"));
        }
        if let Some(map) = &self.map {
            let between = [("x", self.x.is_some()), ("bottom", self.bottom.is_some()), ("top", self.top.is_some())];
            if let Some((key, _)) = between.into_iter().find(|(_, given)| *given) {
                return Err(Error::invalid(key, "given", "goes not with domain.map; leave one of them out"));
            }
            let read = |key: &str, text: &str| parse(key, text, &["s", "r"]).map_err(|error| error.within("map"));
            return Ok(Shape::Image([read("x", &map.x)?, read("y", &map.y)?]));
        }
        let missing = |key| Error::invalid(key, "not given", "give x, bottom and top, or map");
        let Ends(x) = self.x.ok_or_else(|| missing("x"))?;
        let curve = |key, text: &Option<String>| match text {
            Some(text) => parse(key, text, &["x"]),
            None => Err(missing(key)),
        };
        let curves = [curve("bottom", &self.bottom)?, curve("top", &self.top)?];
        check_between(x, &curves)?;
        Ok(Shape::Between { x, curves })
    }
}

/// Refuses an empty interval, and curves that meet or have no value on it.
pub(super) fn check_between(x: [f64; 2], [bottom, top]: &[Formula; 2]) -> Result<()> {
    /// Number of equal parts of the range of x at whose ends both curves are evaluated.
    const SAMPLES: usize = 1000;
    if !(x[0].is_finite() && x[1].is_finite() && x[0] < x[1]) {
        return Err(Error::invalid("x", format!("{x:?}"), "must be two numbers, the lower one first"));
    }
    for k in 0..=SAMPLES {
        let at = x[0] + (x[1] - x[0]) * k as f64 / SAMPLES as f64;
        let [low, high] = [bottom, top].map(|curve| curve.eval(&[at]));
        for (key, curve, y) in [("bottom", bottom, low), ("top", top, high)] {
            if !y.is_finite() {
                let rule = format!("it is {y} at x = {at}; mend the formula");
                return Err(Error::invalid(key, format!("{:?}", curve.text()), rule));
            }
        }
        if low >= high {
            let rule = format!("it meets bottom at x = {at}, where both are {low:.6} and {high:.6}; keep it above");
            return Err(Error::invalid("top", format!("{:?}", top.text()), rule));
        }
    }
    Ok(())
}

impl Shape {
    fn point(&self, [s, r]: [f64; 2]) -> Result<[f64; 2]> {
        match self {
            Self::Between { x: [left, right], curves } => {
                let x = if s == 1.0 { *right } else { left + (right - left) * s };
                let [bottom, top] = curves.each_ref().map(|curve| curve.eval(&[x]));
                Ok([x, if r == 1.0 { top } else { bottom + (top - bottom) * r }])
            }
            Self::Image(formulas) => {
                let point = formulas.each_ref().map(|f| f.eval(&[s, r]));
                match point.iter().position(|v| !v.is_finite()) {
                    None => Ok(point),
                    Some(d) => {
                        let rule = format!("it is {} at s = {s}, r = {r}; mend the formula", point[d]);
                        let key = ["map.x", "map.y"][d];
                        Err(Error::invalid(key, format!("{:?}", formulas[d].text()), rule))
                    }
                }
            }
        }
    }
}
