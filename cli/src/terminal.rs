//! Words to the user. A closed pipe is not an error worth a word.

use driftmesh::Error;
use std::io::{Write, stderr, stdout};
use std::process::ExitCode;

/// Prints to standard output.
pub fn say(text: impl std::fmt::Display) {
    let _ = writeln!(stdout(), "{text}");
}

/// Prints an error with its remedy, and says how the program ends.
pub fn complain(error: &Error, note: Option<&str>) -> ExitCode {
    let mut text = format!("error: {error}\n");
    if let Some(help) = error.help() {
        text.push_str(&format!("  help: {help}\n"));
    }
    if let Some(note) = note {
        text.push_str(&format!("  note: {note}\n"));
    }
    let _ = stderr().write_all(text.as_bytes());
    ExitCode::from(if error.is_failure() { 1 } else { 2 })
}
