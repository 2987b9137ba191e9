//! Domains of moving meshes that are not boxes.

use super::mapped::{check_between, parse};
use super::moving_mesh::Domain;
use crate::error::{Error, Failure, Result};
use crate::geometry::{BetweenCurves, Chart, FormulaMap, Lattice, Mesh, check_simple, check_unfolded};
use crate::output::read_mesh;
use std::path::Path;
use std::sync::Arc;

/// Keys of `[domain]` that say what a domain in the plane is the image of.
const SHAPES: [&str; 5] = ["map", "bottom", "top", "x", "mesh"];

impl<const D: usize> Domain<D> {
    /// Which axes wrap around: periodic ones, and closed ones.
    pub(super) fn wraps(&self) -> [bool; D] {
        let closed = self.closed.as_ref().map_or([false; D], |closed| **closed);
        std::array::from_fn(|d| self.periodic[d] || closed[d])
    }

    /// Which of the keys that give a domain another shape than that of a box are there.
    fn shapes(&self) -> impl Iterator<Item = &'static str> {
        let given =
            [self.map.is_some(), self.bottom.is_some(), self.top.is_some(), self.x.is_some(), self.mesh.is_some()];
        SHAPES.into_iter().zip(given).filter(|(_, given)| *given).map(|(key, _)| key)
    }

    /// Whether the domain is a box.
    pub(super) fn is_box(&self) -> bool {
        self.shapes().next().is_none()
    }

    /// Refuses what only domains in the plane have.
    pub(super) fn check_line(&self) -> Result<Option<Arc<Chart<D>>>> {
        let closed = self.closed.as_ref().map(|_| "closed");
        match self.shapes().chain(closed).next() {
            None => Ok(None),
            Some(key) => {
                let rule = "a line has none; leave it out, or give grid.cells for two axes";
                Err(Error::invalid(format!("domain.{key}"), "given", rule))
            }
        }
    }

    /// Refuses keys that do not go with a shape.
    fn check_shape(&self, shape: &str) -> Result<()> {
        if *self.lower != [0.0; D] || *self.upper != [1.0; D] {
            let key = if *self.lower == [0.0; D] { "upper" } else { "lower" };
            let rule = format!("goes not with domain.{shape}, whose parameters go from 0 to 1; leave it out");
            return Err(Error::invalid(key, "given", rule));
        }
        match self.periodic.contains(&true) {
            true => Err(Error::invalid(
                "periodic",
                format!("{:?}", *self.periodic),
                format!(
                    "goes not with domain.{shape}; where both ends of an axis are the same curve say so in `closed`"
                ),
            )),
            false => Ok(()),
        }
    }
}

impl Domain<2> {
    /// The chart of a domain that is no box.
    ///
    /// # Errors
    /// [`Error::Invalid`] or [`Error::Formula`] with the key below `domain`.
    pub(super) fn chart(&self) -> Result<Option<Arc<Chart>>> {
        self.own_chart().map_err(|error| error.within("domain"))
    }

    fn own_chart(&self) -> Result<Option<Arc<Chart>>> {
        let closed = self.closed.as_ref().map_or([false; 2], |closed| **closed);
        let Some(shape) = self.shapes().next() else {
            return match closed.contains(&true) {
                true => {
                    let rule = "a box has no ends that are the same curve; give a map or a mesh, or use `periodic`";
                    Err(Error::invalid("closed", format!("{closed:?}"), rule))
                }
                false => Ok(None),
            };
        };
        self.check_shape(shape)?;
        let chart = match (&self.map, &self.mesh) {
            (Some(map), _) => {
                if let Some(key) = self.shapes().nth(1) {
                    return Err(Error::invalid(key, "given", "goes not with domain.map; leave one of them out"));
                }
                let read = |key: &str, text: &str| parse(key, text, &["s", "r"]).map_err(|error| error.within("map"));
                let map = FormulaMap::new([read("x", &map.x)?, read("y", &map.y)?])?;
                Chart::oriented(map, closed, true)?
            }
            (None, Some(path)) => {
                if let Some(key) = self.shapes().find(|key| *key != "mesh") {
                    return Err(Error::invalid(key, "given", "goes not with domain.mesh; leave one of them out"));
                }
                let given = read_mesh(Path::new(path))?;
                return Chart::through(given.nodes, given.x, closed).map(Some);
            }
            (None, None) => {
                let missing = |key| Error::invalid(key, "not given", "give x, bottom and top, or map, or mesh");
                let x = self.x.ok_or_else(|| missing("x"))?.0;
                let curve = |key, text: &Option<String>| match text {
                    Some(text) => parse(key, text, &["x"]),
                    None => Err(missing(key)),
                };
                let curves = [curve("bottom", &self.bottom)?, curve("top", &self.top)?];
                check_between(x, &curves)?;
                if closed.contains(&true) {
                    let rule = "a domain between two curves has four sides; leave it out";
                    return Err(Error::invalid("closed", format!("{closed:?}"), rule));
                }
                Chart::new(BetweenCurves::new(x, curves)?, closed)?
            }
        };
        Ok(Some(Arc::new(chart)))
    }

    /// The setting that made a mesh fold.
    fn blame(&self, failure: &Failure) -> Error {
        let (key, value, cure) = match (&self.map, &self.mesh) {
            (Some(map), _) => ("map", format!("({}, {})", map.x, map.y), "no point may be met twice"),
            (_, Some(path)) => ("mesh", format!("{path:?}"), "mend it there"),
            _ => ("top", format!("{:?}", self.top.clone().unwrap_or_default()), "take more cells, or smoother curves"),
        };
        Error::invalid(format!("domain.{key}"), value, format!("{failure}; {cure}"))
    }
}

/// The image of equal cells.
///
/// # Errors
/// [`Error::Invalid`] with the key below `domain` or `grid` that makes no mesh.
pub(super) fn mesh_in(domain: &Domain<2>, lattice: Lattice<2>, chart: Arc<Chart>) -> Result<Mesh<2>> {
    let mesh = Mesh::charted(lattice, chart).map_err(|error| error.within("grid"))?;
    match check_unfolded(&mesh).and_then(|()| check_simple(&mesh)) {
        Ok(()) => Ok(mesh),
        Err(failure) => Err(domain.blame(&failure)),
    }
}
