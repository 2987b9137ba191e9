use crate::terminal;
use driftmesh::study::Study;
use std::process::ExitCode;

/// Prints the schema of a study file.
pub fn execute() -> driftmesh::Result<ExitCode> {
    terminal::say(format_args!("{:#}", Study::schema()));
    Ok(ExitCode::SUCCESS)
}
