use crate::terminal::{DONE, Status, say};
use clap::{Args, ValueEnum};
use driftmesh::{
    Failure,
    density::MonitorKind,
    laplacian::Laplacian,
    meshing::{EstimatorKind, GeneratorKind},
    physics::PdeKind,
    study::{LineDensityKind, MethodName},
};

#[derive(Args)]
pub struct List {
    /// Group of kinds to list; all groups where none is given.
    topic: Option<Topic>,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum Topic {
    Pdes,
    Monitors,
    Generators,
    Estimators,
    Laplacians,
    Densities,
    Methods,
    Errors,
}

impl List {
    pub fn execute(&self) -> driftmesh::Result<Status> {
        let topics = [
            (Topic::Pdes, "pdes", "pde.kind", PdeKind::KINDS),
            (Topic::Monitors, "monitors", "monitor.kind", MonitorKind::KINDS),
            (Topic::Generators, "generators", "mesh.generator.kind", GeneratorKind::KINDS),
            (Topic::Estimators, "estimators", "mesh.generator.estimator.kind", EstimatorKind::KINDS),
            (Topic::Laplacians, "laplacians", "laplacian.kind", Laplacian::KINDS),
            (Topic::Densities, "densities of a line", "density.kind", LineDensityKind::KINDS),
            (Topic::Methods, "Schwarz methods of a line", "schwarz.method", MethodName::KINDS),
        ];
        for (topic, title, key, kinds) in topics {
            if self.topic.is_none_or(|only| only == topic) {
                say(format_args!("{title} ({key})"));
                kinds.iter().for_each(|(name, line)| say(format_args!("  {name:<14}{line}")));
            }
        }
        if self.topic.is_none_or(|only| only == Topic::Errors) {
            say("errors (error.kind in summary.json)");
            Failure::all().for_each(|[name, what]| say(format_args!("  {name:<19}{what}")));
        }
        Ok(DONE)
    }
}
