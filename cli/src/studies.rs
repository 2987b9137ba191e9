use crate::terminal::{DONE, Status, say};
use clap::Args;
use std::path::PathBuf;

#[derive(Args)]
pub struct Studies {
    /// Directory for the example studies; files that are there already under their names are kept.
    #[arg(value_name = "DIR", default_value = "studies")]
    directory: PathBuf,
}

impl Studies {
    pub fn execute(&self) -> driftmesh::Result<Status> {
        for path in driftmesh::study::write_examples(&self.directory)? {
            say(path.display());
        }
        Ok(DONE)
    }
}
