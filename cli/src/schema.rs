use crate::terminal::{self, DONE, Status};
use driftmesh::study::Study;

/// Prints the schema of a study file.
pub fn execute() -> driftmesh::Result<Status> {
    terminal::say(format_args!("{:#}", Study::schema()));
    Ok(DONE)
}
