//! What a generator carries from step to step, as bytes.

use crate::mover::{Movers, Parts};
use driftmesh::geometry::{Lattice, Mesh};
use driftmesh::kept::Kept;
use driftmesh::mover::Gait;
use driftmesh::{Error, Result};
use serde::{Deserialize, Serialize};

/// The memory of a generator, of the version of the package that wrote it.
#[derive(Serialize, Deserialize)]
pub struct Memory {
    version: String,
    warned: [bool; 2],
    line: Part<1>,
    plane: Part<2>,
}

#[derive(Serialize, Deserialize)]
struct Part<const D: usize> {
    last: Option<Last<D>>,
    generator: Kept,
}

/// The mesh that the last step led to, and how it was going.
#[derive(Serialize, Deserialize)]
struct Last<const D: usize> {
    cells: Vec<usize>,
    periodic: Vec<bool>,
    lower: Vec<f64>,
    upper: Vec<f64>,
    x: Vec<f64>,
    gait: Gait<D>,
}

const VERSION: &str = env!("CARGO_PKG_VERSION");

/// What a pickled memory must be, for messages about one that cannot be read.
const OURS: &str = "must be what a generator of this version remembered; make a new one";

fn unfit(value: impl std::fmt::Display, rule: &str) -> Error {
    Error::invalid("state", value, rule)
}

impl Memory {
    pub fn of(movers: &Movers, warned: [bool; 2]) -> Self {
        Self { version: VERSION.into(), warned, line: Part::of(&movers.line), plane: Part::of(&movers.plane) }
    }

    pub fn encoded(&self) -> Result<Vec<u8>> {
        rmp_serde::to_vec_named(self).map_err(|error| unfit(error, "cannot be written"))
    }

    pub fn decoded(bytes: &[u8]) -> Result<Self> {
        #[derive(Deserialize)]
        struct Head {
            version: String,
        }
        let damaged = |error| unfit(error, OURS);
        let Head { version } = rmp_serde::from_slice(bytes).map_err(damaged)?;
        if version != VERSION {
            let rule = format!("must be of version {VERSION}; make a new one");
            return Err(unfit(format!("of version {version}"), &rule));
        }
        rmp_serde::from_slice(bytes).map_err(damaged)
    }

    /// Restores it, and tells what was warned of.
    pub fn restore(self, movers: &mut Movers) -> Result<[bool; 2]> {
        self.line.restore(&mut movers.line)?;
        self.plane.restore(&mut movers.plane)?;
        Ok(self.warned)
    }
}

impl<const D: usize> Part<D> {
    fn of(parts: &Parts<D>) -> Self {
        let mut generator = Kept::default();
        parts.mover.generator.keep(&mut generator);
        let last = parts.last.as_ref().map(|(mesh, gait)| Last {
            cells: mesh.lattice().cells().to_vec(),
            periodic: mesh.lattice().periodic().to_vec(),
            lower: mesh.lower().to_vec(),
            upper: mesh.upper().to_vec(),
            x: mesh.x().as_flattened().to_vec(),
            gait: gait.clone(),
        });
        Self { last, generator }
    }

    fn restore(self, parts: &mut Parts<D>) -> Result<()> {
        let Some(Last { cells, periodic, lower, upper, x, gait }) = self.last else { return Ok(()) };
        let mesh = Lattice::new(fixed(&cells)?, fixed(&periodic)?)
            .and_then(|lattice| Mesh::uniform(lattice, fixed(&lower)?, fixed(&upper)?))
            .and_then(|mesh| Ok(mesh.moved(x.as_chunks::<D>().0.to_vec())?))?;
        let damaged = |error| unfit(format!("{error:?}"), OURS);
        gait.check(&mesh).map_err(damaged)?;
        parts.mover.generator.resume(&mesh, &self.generator).map_err(damaged)?;
        parts.last = Some((mesh, gait));
        Ok(())
    }
}

fn fixed<T: Copy, const D: usize>(values: &[T]) -> Result<[T; D]> {
    values.try_into().map_err(|_| unfit(values.len(), "is not its number of dimensions"))
}
