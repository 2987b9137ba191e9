//! The `driftmesh` program.

use std::process::ExitCode;

fn main() -> ExitCode {
    ExitCode::from(driftmesh_cli::program(std::env::args_os().collect()))
}
