//! From a study file to a run: text → checked parts → simulation → run directory.

mod moving_mesh;
mod run;
mod source;
mod uniform;

pub use moving_mesh::{Compare, Domain, Grid, Header, MeshTable, MovingMesh, Output, Stepper, StudyKind, Time};
pub use run::{Finished, compute, run};
pub use source::Source;
pub use uniform::UniformEquivalent;
