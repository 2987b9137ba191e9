//! The page `docs/errors.md`: every failure that a run may end with, from the code that names it.
//!
//!     cargo run --release -p driftmesh --example errors > docs/errors.md

use driftmesh::study::failures;

const HEAD: &str = "\
# How a run may fail

A run that cannot go on ends with exit status 1 and one of the names below: on the terminal with the time, the step and
the place, in `summary.json` as `error.kind` (`failure.kind` of `poisson` and `equidistribution`), with `\"status\":
\"failed\"`. Everything up to the last good state is kept. In Python the same name is a class of `driftmesh.errors`,
`mesh-folded` being `MeshFolded`. `driftmesh list errors` prints the list.

A mistake in what was asked for (an unknown key, a formula that cannot be read, a directory that is no run) ends with
exit status 2 before anything is written, and is shown where it stands. A run that was told to end has `\"status\":
\"interrupted\"`. One whose disk is full names the file that could not be written.

A run says what helps in the keys of its own study: those that it has and takes, with the value that each has now. Below
are those of all studies.

";

/// Columns of a line of the page.
const WIDTH: usize = 118;

/// The page.
pub fn page() -> String {
    let items = failures().into_iter().map(|[name, what, help]| {
        let remedy = if help.is_empty() { String::new() } else { format!(" Remedy: {help}.") };
        wrapped(&format!("- `{name}`: {what}{remedy}"))
    });
    HEAD.to_string() + &items.collect::<String>()
}

/// An item of a list, in lines of at most so many columns.
fn wrapped(item: &str) -> String {
    let (mut lines, mut line) = (String::new(), String::new());
    for word in item.split(' ') {
        if !line.is_empty() && line.chars().count() + 1 + word.chars().count() > WIDTH {
            lines += &format!("{line}\n");
            line = format!("  {word}");
        } else if line.is_empty() {
            line = word.to_string();
        } else {
            line += &format!(" {word}");
        }
    }
    lines + &line + "\n"
}

#[allow(dead_code)] // the test of the page has a `main` of its own
fn main() {
    print!("{}", page());
}
