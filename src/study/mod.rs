//! From a study file to a run: text → checked parts → simulation → run directory.

mod any;
mod mapped;
mod memory;
mod moving_mesh;
mod poisson;
mod run;
mod source;

pub use moving_mesh::{Compare, Domain, Grid, Header, MeshTable, MovingMesh, Output, Stepper, StudyKind, Time};
pub use any::Study;
pub use mapped::{Distort, Ends, Grading, MappedDomain, Mapping, Side};
pub use poisson::{
    Equation, ExactSolution, GradedGrid, LaplacianTable, PoissonError, PoissonSeconds, PoissonStudy, PoissonSummary, Sides, Solved,
    StencilReport,
};
pub use run::{Finished, compute, run};
pub use source::Source;
