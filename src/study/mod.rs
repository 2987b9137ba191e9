//! From a study file to a run: text → checked parts → simulation → run directory.

mod any;
mod common;
mod data;
mod dimension;
mod equidistribution;
mod examples;
mod front_checks;
mod front_figures;
mod front_given;
mod front_run;
mod front_start;
mod fronts;
mod kind;
mod line_checks;
mod line_figures;
mod line_files;
mod line_run;
mod line_tables;
mod mapped;
mod memory;
mod moving_checks;
mod moving_mesh;
mod moving_run;
mod poisson;
mod poisson_run;
mod poisson_sides;
mod remedy;
mod rest;
mod runner;
mod shape;
mod source;
mod species;
mod species_checks;
mod species_figures;
mod species_run;
mod stefan;
mod time_loop;
mod together;
mod uniform;

pub use crate::output::{GivenMesh, read_mesh};
pub use any::Study;
pub use common::{Header, Output, StudyKind};
pub use data::{DataTables, TableFile};
pub use dimension::{GeneratorTable, PdeTable, Settings, Studied};
pub use equidistribution::{
    Discretization, EquidistributionStudy, FirstMesh, Integral, Interval, LineArclength, LineDensityKind, LineDomain,
    LineFormula, LineGrid, LineTime, MethodName, SchwarzTable, Start, StopTable,
};
pub use examples::write_examples;
pub use front_figures::{FrontError, FrontFigures, FrontParts, FrontReport, FrontSummary};
pub use front_run::{FrontRun, TwoPhase};
pub use fronts::{Controller, Fronts, Progress, View};
pub use kind::{Kind, Running, SpentBy};
pub use line_figures::{LineFigures, LineParts, LineQuality, LineWork, NumberedIterate, PerStep, Rate, StepRow};
pub use line_run::{Evolution, LineRun};
pub use mapped::{Distort, Ends, Grading, MappedDomain, Mapping, Side};
pub use memory::check_memory;
pub use moving_mesh::{
    Compare, Domain, Grid, MeshForm, MeshTable, MovingLine, MovingMesh, MovingStudy, StartMesh, Stepper, Time,
};
pub use moving_run::{MovingFigures, MovingRun};
pub use poisson::{Equation, ExactSolution, GradedGrid, LaplacianTable, PoissonStudy, Sides, SolverKind, SolverTable};
pub use poisson_run::{PoissonError, PoissonFigures, PoissonParts, PoissonRun, Solved, StencilReport};
pub use remedy::failures;
pub use runner::{Begin, Finished, Stage};
pub use source::Source;
pub use species::{LawTable, Laws, SpeciesDomain, SpeciesGrid, SpeciesStudy, SpeciesTable};
pub use species_figures::{Balance, FrontsReport, SpeciesReport};
pub use species_run::SpeciesRun;
pub use stefan::{
    Centre, ExactFront, ExactKind, FrontDomain, FrontGrid, FrontTable, FrontTime, PhaseTable, Phases, StefanStudy,
    Walls,
};
pub use time_loop::{FrontCourse, TimeLoop};
pub use uniform::UniformEquivalent;
