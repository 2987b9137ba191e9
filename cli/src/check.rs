use crate::{
    StudyArgs,
    terminal::{Status, complain, say, succeeded, warn},
};
use clap::Args;

#[derive(Args)]
pub struct Check {
    #[command(flatten)]
    study: StudyArgs,
}

impl Check {
    pub fn execute(&self) -> driftmesh::Result<Status> {
        let study = self.study.read()?;
        study.warnings()?.iter().for_each(|warning| warn(warning));
        if let Err(error) = study.try_start() {
            return Ok(complain(&error, study.remedy(&error).or_else(|| error.help()), None));
        }
        valid(&study.to_toml(), study.memory());
        Ok(succeeded(self.study.strict, "the study is valid without it"))
    }
}

/// The study with its defaults, and what it needs.
fn valid(study: &str, bytes: u128) {
    say(study.trim_end());
    let mebibytes = bytes as f64 / f64::from(1 << 20);
    say(format_args!("\n# valid; needs about {:.0} MiB of memory", mebibytes.max(1.0)));
}
