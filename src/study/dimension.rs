//! What the settings of a moving mesh are made of in one dimension and in two.

use super::kind::SpentBy;
use super::moving_mesh::{Domain, MovingStudy, Stepper, Time};
use super::moving_run::{MovingCheckpoint, MovingRun};
use super::runner::Stage;
use super::shape::mesh_in;
use crate::error::{Error, Result, Unfit};
use crate::geometry::{Chart, Lattice, Mesh};
use crate::kept::Kept;
use crate::meshing::{GeneratorKind, LineGeneratorKind, MeshGenerator, Movable};
use crate::output::RunDirectory;
use crate::physics::{self, LinePdeKind, PdeKind, Physics, StartAndSide, UniformBurgers};
use crate::simulation::Scene;
use schemars::JsonSchema;
use serde::{Serialize, de::DeserializeOwned};
use std::fmt::Debug;
use std::path::Path;
use std::sync::Arc;

/// Meshes of which a study can be made
///
/// Its functions are those of [`Kind`](super::Kind) and [`Running`](super::Running). They are here because a generic
/// function is compiled again in every crate that calls it: these are the doors behind which all is compiled once, with
/// the library, for each number of dimensions.
pub trait Studied<const D: usize>: Movable<D> + Clone + Debug {
    /// `[pde]`.
    type Pde: PdeTable<D>;
    /// `mesh.generator`.
    type Generator: GeneratorTable<D>;

    /// [`Kind::resolve`](super::Kind::resolve).
    ///
    /// # Errors
    /// As there.
    fn resolve(study: &mut MovingStudy<D>) -> Result<()>
    where
        Mesh<D>: Studied<D>;

    /// [`Kind::warnings`](super::Kind::warnings).
    ///
    /// # Errors
    /// As there.
    fn contradictions(study: &MovingStudy<D>) -> Result<Vec<String>>
    where
        Mesh<D>: Studied<D>;

    /// [`Kind::try_start`](super::Kind::try_start).
    ///
    /// # Errors
    /// As there.
    fn try_start(study: &MovingStudy<D>) -> Result<()>
    where
        Mesh<D>: Studied<D>;

    /// [`Kind::begin`](super::Kind::begin).
    ///
    /// # Errors
    /// As there.
    fn begin(study: &MovingStudy<D>) -> Result<MovingRun<D>>
    where
        Mesh<D>: Studied<D>;

    /// [`Running::go`](super::Running::go).
    ///
    /// # Errors
    /// As there.
    fn go(run: &mut MovingRun<D>, stage: &mut Stage<'_>) -> Result<()>
    where
        Mesh<D>: Studied<D>;

    /// [`Running::resume`](super::Running::resume).
    ///
    /// # Errors
    /// As there.
    fn take_up(
        run: &mut MovingRun<D>,
        found: MovingCheckpoint<D>,
        directory: Option<&Path>,
    ) -> Result<(SpentBy<MovingRun<D>>, Kept), Unfit>
    where
        Mesh<D>: Studied<D>;

    /// [`Running::scenes`](super::Running::scenes).
    ///
    /// # Errors
    /// As there.
    fn scenes(run: &MovingRun<D>) -> Result<Vec<Scene>>
    where
        Mesh<D>: Studied<D>;

    /// The chart of a domain that is no box.
    ///
    /// # Errors
    /// [`Error::Invalid`] or [`Error::Formula`] with the key below `domain`.
    fn chart_of(domain: &Domain<D>) -> Result<Option<Arc<Chart<D>>>>;

    /// Equal cells, or their image by the map of the domain.
    ///
    /// # Errors
    /// [`Error::Invalid`] where the grid or the domain makes no mesh.
    fn in_domain(domain: &Domain<D>, lattice: Lattice<D>) -> Result<Self>;

    /// [`Running::leave`](super::Running::leave).
    ///
    /// # Errors
    /// As there.
    fn leave(run: &mut MovingRun<D>, directory: &RunDirectory) -> Result<()>
    where
        Mesh<D>: Studied<D>;
}

macro_rules! studied {
    ($D:literal, $Pde:ty, $Generator:ty, $chart:ident, $over:expr) => {
        impl Studied<$D> for Mesh<$D> {
            type Pde = $Pde;
            type Generator = $Generator;

            fn resolve(study: &mut MovingStudy<$D>) -> Result<()> {
                study.resolved()
            }

            fn contradictions(study: &MovingStudy<$D>) -> Result<Vec<String>> {
                study.contradictions()
            }

            fn try_start(study: &MovingStudy<$D>) -> Result<()> {
                study.tried()
            }

            fn begin(study: &MovingStudy<$D>) -> Result<MovingRun<$D>> {
                MovingRun::of(study)
            }

            fn go(run: &mut MovingRun<$D>, stage: &mut Stage<'_>) -> Result<()> {
                run.gone(stage)
            }

            fn take_up(
                run: &mut MovingRun<$D>,
                found: MovingCheckpoint<$D>,
                directory: Option<&Path>,
            ) -> Result<(SpentBy<MovingRun<$D>>, Kept), Unfit> {
                run.taken_up(found, directory)
            }

            fn scenes(run: &MovingRun<$D>) -> Result<Vec<Scene>> {
                run.last_scene()
            }

            fn chart_of(domain: &Domain<$D>) -> Result<Option<Arc<Chart<$D>>>> {
                domain.$chart()
            }

            fn in_domain(domain: &Domain<$D>, lattice: Lattice<$D>) -> Result<Self> {
                match domain.$chart()? {
                    Some(chart) => $over(domain, lattice, chart),
                    None => {
                        Self::uniform(lattice, *domain.lower, *domain.upper).map_err(|error| error.within("domain"))
                    }
                }
            }

            fn leave(run: &mut MovingRun<$D>, directory: &RunDirectory) -> Result<()> {
                run.left(directory)
            }
        }
    };
}

studied!(1, LinePdeKind, LineGeneratorKind, check_line, |_, lattice, chart| Self::charted(lattice, chart));
studied!(2, PdeKind, GeneratorKind, chart, mesh_in);

/// Settings of a table of a study.
pub trait Settings: Clone + Debug + Serialize + DeserializeOwned + JsonSchema {}

impl<T: Clone + Debug + Serialize + DeserializeOwned + JsonSchema> Settings for T {}

/// `[pde]` of a study in D dimensions.
pub trait PdeTable<const D: usize>: Settings {
    /// Refuses settings out of range.
    ///
    /// # Errors
    /// [`Error::Invalid`] or [`Error::Formula`].
    fn check(&self) -> Result<()>;

    /// Refuses axes that the equation is not made for.
    ///
    /// # Errors
    /// [`Error::Invalid`] for `domain`, or for `pde`.
    fn check_axes(&self, domain: &Domain<D>) -> Result<()>;

    /// The equation with its stepper.
    ///
    /// # Errors
    /// As [`PdeTable::check`]; [`Error::Invalid`] where the stepper does not go with the rest.
    fn physics(&self, domain: &Domain<D>, time: &Time, stays: bool) -> Result<Box<dyn Physics<D>>>;

    /// The formulas of place and time alone, with their keys.
    fn formulas(&self) -> Vec<(String, &str)>;

    /// The initial values and the side values that are both formulas of place and time, with their keys.
    fn starts_and_sides(&self) -> Vec<StartAndSide<'_>>;

    /// How the equation is stepped where nothing is said; not at all where the solution is given.
    fn stepper(&self) -> Option<Stepper>;

    /// Whether the solution is prescribed, and whether the density is.
    fn prescribes(&self) -> [bool; 2];
}

/// `mesh.generator` of a study in D dimensions.
pub trait GeneratorTable<const D: usize>: Settings + Default {
    /// Refuses settings out of range for a lattice.
    ///
    /// # Errors
    /// [`Error::Invalid`].
    fn check(&self, lattice: &Lattice<D>) -> Result<()>;

    /// Subdomains along the first two axes.
    fn subdomains(&self) -> [usize; 2];

    /// True where the mesh is not to move.
    fn stays(&self) -> bool;

    /// The generator, ready to step.
    fn into_generator(self) -> Box<dyn MeshGenerator<D>>;
}

impl From<physics::Stepper> for Stepper {
    fn from(stepper: physics::Stepper) -> Self {
        match stepper {
            physics::Stepper::Trapezoid => Self::Trapezoid,
            physics::Stepper::TrBdf2 => Self::TrBdf2,
        }
    }
}

/// Refuses a stepper that is not the one that an equation has.
pub(super) fn check_stepper(stepper: Option<Stepper>, own: Option<Stepper>) -> Result<()> {
    let (name, rule) = match stepper {
        None => return Ok(()),
        Some(given) if own == Some(given) => return Ok(()),
        Some(Stepper::Rk4) => (
            "rk4",
            "steps pde.kind = \"burgers\" in a box in two dimensions on a mesh that stays; set mesh.generator to \
             { kind = \"fixed\" }, or leave time.stepper out",
        ),
        Some(Stepper::TrBdf2) => ("tr-bdf2", "steps pde.kind = \"formula\"; leave time.stepper out"),
        Some(Stepper::Trapezoid) => ("trapezoid", "needs an equation; leave time.stepper out"),
    };
    Err(Error::invalid("time.stepper", format!("\"{name}\""), rule))
}

/// The key of an error of an equation; that of its stepper has one already.
pub(super) fn within_pde(error: Error) -> Error {
    match &error {
        Error::Invalid { key, .. } if key.starts_with("time.") => error,
        _ => error.within("pde"),
    }
}

impl PdeTable<2> for PdeKind {
    fn check(&self) -> Result<()> {
        self.check()
    }

    fn check_axes(&self, domain: &Domain<2>) -> Result<()> {
        if let Some(coordinates) = domain.coordinates {
            let rule = "only a line has them; leave it out, or give one number an axis";
            return Err(Error::invalid("domain.coordinates", format!("{coordinates:?}").to_lowercase(), rule));
        }
        let periodic = domain.wraps();
        let key = if domain.is_box() { "domain.periodic" } else { "domain.closed" };
        let (wrong, rule) = match self {
            Self::ShallowWater(_) if !domain.is_box() => {
                let rule = "needs a periodic box; leave the shape of [domain] out, or give the equation by formulas";
                return Err(Error::invalid("pde.kind", "\"shallow-water\"", rule));
            }
            Self::Burgers(burgers) if burgers.initial.is_none() => (
                periodic.contains(&true),
                "the front of pde.kind = \"burgers\" needs bounded axes; set it to [false, false], or give pde.initial",
            ),
            Self::Burgers(burgers) => (
                periodic.contains(&false) == burgers.boundary.is_none(),
                match burgers.boundary {
                    None => {
                        "pde.initial needs pde.boundary beside it on bounded axes; add it, or make both axes periodic"
                    }
                    Some(_) => "pde.boundary has no side to stand on; leave it out, or make an axis bounded",
                },
            ),
            Self::ShallowWater(_) => {
                (periodic.contains(&false), "pde.kind = \"shallow-water\" needs periodic axes; set it to [true, true]")
            }
            Self::FormulaPde(pde) => return pde.check_sides(periodic).map_err(|error| error.within("pde")),
            Self::Prescribed(_) => (false, ""),
        };
        match wrong {
            true => Err(Error::invalid(key, format!("{periodic:?}"), rule)),
            false => Ok(()),
        }
    }

    fn physics(&self, domain: &Domain<2>, time: &Time, stays: bool) -> Result<Box<dyn Physics<2>>> {
        match (self, time.stepper) {
            (Self::FormulaPde(pde), Some(Stepper::Trapezoid)) => pde.clone().stepped(physics::Stepper::Trapezoid),
            (Self::FormulaPde(pde), Some(Stepper::TrBdf2)) => pde.clone().stepped(physics::Stepper::TrBdf2),
            (Self::Burgers(burgers), Some(Stepper::Rk4)) if stays && domain.is_box() => {
                let uniform = UniformBurgers::new(burgers.clone(), time.order.unwrap_or(2));
                return Ok(Box::new(uniform.map_err(|error| error.within("time"))?));
            }
            (_, stepper) => check_stepper(stepper, self.stepper()).and_then(|()| self.clone().into_physics()),
        }
        .map_err(within_pde)
    }

    fn stepper(&self) -> Option<Stepper> {
        match self {
            Self::FormulaPde(pde) => Some(pde.stepper().into()),
            Self::Prescribed(_) => None,
            Self::Burgers(_) | Self::ShallowWater(_) => Some(Stepper::Trapezoid),
        }
    }

    fn formulas(&self) -> Vec<(String, &str)> {
        self.formulas()
    }

    fn starts_and_sides(&self) -> Vec<StartAndSide<'_>> {
        self.starts_and_sides()
    }

    fn prescribes(&self) -> [bool; 2] {
        match self {
            Self::Prescribed(prescribed) => [true, prescribed.rho.is_some()],
            _ => [false; 2],
        }
    }
}

impl GeneratorTable<2> for GeneratorKind {
    fn check(&self, lattice: &Lattice<2>) -> Result<()> {
        self.check(lattice)
    }

    fn subdomains(&self) -> [usize; 2] {
        self.subdomains()
    }

    fn stays(&self) -> bool {
        matches!(self, Self::Fixed(_))
    }

    fn into_generator(self) -> Box<dyn MeshGenerator<2>> {
        self.into_generator()
    }
}
