//! The tables of a moving mesh in one dimension.

use super::dimension::{GeneratorTable, PdeTable, check_stepper, within_pde};
use super::moving_mesh::{Domain, Stepper, Time};
use crate::error::{Error, Result};
use crate::geometry::Lattice;
use crate::meshing::{LineGeneratorKind, MeshGenerator};
use crate::physics::{self, Coordinates, LinePdeKind, Physics, StartAndSide};

impl PdeTable<1> for LinePdeKind {
    fn check(&self) -> Result<()> {
        self.check()
    }

    fn check_axes(&self, domain: &Domain<1>) -> Result<()> {
        let ([periodic], [lower]) = (*domain.periodic, *domain.lower);
        let coordinates = domain.coordinates.unwrap_or_default();
        if coordinates != Coordinates::Cartesian {
            let named = format!("\"{}\"", format!("{coordinates:?}").to_lowercase());
            if lower < 0.0 {
                let rule =
                    format!("is a distance from the centre with domain.coordinates = {named}; set it to 0 or more");
                return Err(Error::invalid("domain.lower", format!("[{lower}]"), rule));
            }
            if periodic {
                let rule = "a radius is not periodic; set domain.periodic to [false], or leave it out";
                return Err(Error::invalid("domain.coordinates", named, rule));
            }
            if matches!(self, Self::LineBurgers(_)) {
                let rule =
                    "pde.kind = \"burgers\" is along x; leave it out, or write the equation with kind = \"formula\"";
                return Err(Error::invalid("domain.coordinates", named, rule));
            }
        }
        let (wrong, rule) = match self {
            Self::LineBurgers(burgers) if burgers.initial.is_none() => (
                periodic,
                "the front of pde.kind = \"burgers\" needs a bounded line; set it to [false], or give pde.initial",
            ),
            Self::LineBurgers(burgers) => (
                periodic == burgers.boundary.is_some(),
                match burgers.boundary {
                    None => "pde.initial needs pde.boundary beside it on a bounded line; add it, or set this to [true]",
                    Some(_) => "pde.boundary has no end to stand on; leave it out, or set this to [false]",
                },
            ),
            Self::LineFormulaPde(pde) => return pde.check_sides([periodic]).map_err(|error| error.within("pde")),
            Self::Prescribed(_) => (false, ""),
        };
        match wrong {
            true => Err(Error::invalid("domain.periodic", format!("[{periodic}]"), rule)),
            false => Ok(()),
        }
    }

    fn physics(&self, domain: &Domain<1>, time: &Time, _stays: bool) -> Result<Box<dyn Physics<1>>> {
        let stepper = match (self, time.stepper) {
            (Self::LineFormulaPde(_), Some(Stepper::Trapezoid)) => Some(physics::Stepper::Trapezoid),
            (Self::LineFormulaPde(_), Some(Stepper::TrBdf2)) => Some(physics::Stepper::TrBdf2),
            (_, stepper) => check_stepper(stepper, self.stepper()).map(|()| None)?,
        };
        self.clone().into_physics(domain.coordinates.unwrap_or_default(), stepper).map_err(within_pde)
    }

    fn stepper(&self) -> Option<Stepper> {
        match self {
            Self::LineFormulaPde(pde) => Some(pde.stepper().into()),
            Self::Prescribed(_) => None,
            Self::LineBurgers(_) => Some(Stepper::Trapezoid),
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

impl GeneratorTable<1> for LineGeneratorKind {
    fn check(&self, lattice: &Lattice<1>) -> Result<()> {
        self.check(lattice)
    }

    fn subdomains(&self) -> [usize; 2] {
        [self.subdomains(), 1]
    }

    fn stays(&self) -> bool {
        matches!(self, Self::Fixed(_))
    }

    fn into_generator(self) -> Box<dyn MeshGenerator<1>> {
        self.into_generator()
    }
}
