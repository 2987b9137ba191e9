use crate::{
    StudyArgs,
    terminal::{complain, say, warn},
};
use clap::Args;
use std::process::ExitCode;

#[derive(Args)]
pub struct Check {
    #[command(flatten)]
    study: StudyArgs,
}

impl Check {
    pub fn execute(&self) -> driftmesh::Result<ExitCode> {
        let study = self.study.read()?;
        study.warnings()?.iter().for_each(|warning| warn(warning));
        if let Err(error) = study.start(&study.simulation()?, &mut driftmesh::simulation::Record::default()) {
            return Ok(complain(&error, study.remedy(&error).or_else(|| error.help()), None));
        }
        say(study.to_toml().trim_end());
        let mebibytes = study.memory() as f64 / f64::from(1 << 20);
        say(format_args!("\n# valid; needs about {:.0} MiB of memory", mebibytes.max(1.0)));
        Ok(ExitCode::SUCCESS)
    }
}
