use crate::terminal::{DONE, Status, say, warn};
use clap::Args;
use std::path::PathBuf;

#[derive(Args)]
pub struct Report {
    /// The directory of a run that is finished or was interrupted.
    #[arg(value_name = "DIR")]
    directory: PathBuf,
}

impl Report {
    pub fn execute(&self) -> driftmesh::Result<Status> {
        let built = driftmesh::report::build(&self.directory)?;
        built.notes.iter().for_each(|note| warn(note));
        say(format_args!("report   {} ({:.1} MB)", built.path.display(), built.bytes as f64 / 1e6));
        Ok(DONE)
    }
}
