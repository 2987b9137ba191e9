//! From a study file to a run: text → checked parts → simulation → run directory.

mod any;
mod ending;
mod equidistribution;
mod front_run;
mod line_files;
mod line_run;
mod mapped;
mod memory;
mod moving_mesh;
mod poisson;
mod remedy;
mod rest;
mod run;
mod source;
mod stefan;
mod uniform;

pub use any::{Begin, Study};
pub use equidistribution::{
    Discretization, EquidistributionStudy, FirstMesh, Integral, Interval, LineArclength, LineDensityKind, LineDomain,
    LineFormula, LineGrid, LineTime, MethodName, SchwarzTable, Start, StopTable,
};
pub use front_run::{FrontError, FrontFigures, FrontFinished, FrontReport, FrontSeconds, StefanSummary};
pub use line_run::{
    EquidistributionSummary, Evolution, LineFinished, LineQuality, LineSeconds, LineWork, NumberedIterate, PerStep,
    Rate, StepRow,
};
pub use mapped::{Distort, Ends, Grading, MappedDomain, Mapping, Side};
pub use memory::check_memory;
pub use moving_mesh::{
    Compare, Domain, Grid, Header, MeshForm, MeshTable, MovingMesh, Output, Stepper, StudyKind, Time,
};
pub use poisson::{
    Equation, ExactSolution, GradedGrid, LaplacianTable, PoissonError, PoissonSeconds, PoissonStudy, PoissonSummary,
    Sides, Solved, SolverKind, SolverTable, StencilReport,
};
pub use remedy::failures;
pub use run::{Finished, compute, resume, run};
pub use source::Source;
pub use stefan::{
    Centre, ExactFront, ExactKind, FrontDomain, FrontGrid, FrontTable, FrontTime, PhaseTable, Phases, StefanStudy,
    Walls,
};
pub use uniform::UniformEquivalent;
