//! The `driftmesh` program: a thin door to the library. Its own binary calls it, and the command that the Python
//! package installs.

mod check;
mod interrupts;
mod list;
mod progress;
mod report;
mod reproduce;
mod run;
mod schema;
mod studies;
mod tables;
mod terminal;

use clap::{Args, Parser, Subcommand};
use driftmesh::study::{Source, Study};
use std::ffi::OsString;
use std::path::PathBuf;
use terminal::Status;

/// Moving meshes for time-dependent PDEs, solved by domain decomposition.
#[derive(Parser)]
#[command(name = "driftmesh", version, arg_required_else_help = true)]
struct Cli {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Subcommand)]
enum Verb {
    /// Run a study.
    #[command(after_help = "Example:\n  driftmesh run studies/burgers.toml --set time.step=5e-4 --out out/finer\n\n\
                      Exit status: 0 done; 1 the computation failed, or warned with --strict; 2 the study or the \
                      command line is wrong.")]
    Run(run::Run),
    /// Validate a study without running it, and print it with every default filled in.
    #[command(after_help = "Example:\n  driftmesh check studies/burgers.toml --set grid.cells=[80,80]\n  \
                      driftmesh check - < studies/burgers.toml")]
    Check(check::Check),
    /// List every kind that a study may name.
    #[command(after_help = "Example:\n  driftmesh list generators")]
    List(list::List),
    /// Rerun published tables and figures: ours beside theirs.
    #[command(after_help = "Example:\n  driftmesh reproduce interface-study --quick")]
    Reproduce(reproduce::Reproduce),
    /// (Re)build the HTML report of a finished or interrupted run.
    #[command(after_help = "Example:\n  driftmesh report out/burgers")]
    Report(report::Report),
    /// Print the JSON Schema of a study file, for editors.
    #[command(after_help = "Example:\n  driftmesh schema > driftmesh.schema.json   and then, as the first line of a \
                      study:\n  #:schema ./driftmesh.schema.json")]
    Schema,
    /// Write the example studies into a directory.
    #[command(after_help = "Example:\n  driftmesh studies studies && driftmesh run studies/burgers.toml")]
    Studies(studies::Studies),
}

/// A study file and what is set on top of it.
#[derive(Args)]
struct StudyArgs {
    /// The study file; `-` reads the study from standard input.
    #[arg(value_name = "STUDY.toml")]
    study: PathBuf,
    /// Override one setting: a dotted key and a TOML value.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// End with status 1 if there was a warning, too.
    #[arg(long)]
    strict: bool,
}

/// What names standard input in the place of a file.
const STANDARD_INPUT: &str = "-";

impl StudyArgs {
    fn read(&self) -> driftmesh::Result<Study> {
        let mut source = match self.is_standard_input() {
            true => Source::from_reader("standard input", std::io::stdin())?,
            false => Source::read(&self.study)?,
        };
        self.set.iter().try_for_each(|assignment| source.set(assignment))?;
        Study::from_source(&source)
    }

    fn is_standard_input(&self) -> bool {
        self.study.as_os_str() == STANDARD_INPUT
    }
}

/// Runs the program with a command line, whose first word is the name of the program, and returns its exit status.
pub fn program(words: Vec<OsString>) -> u8 {
    interrupts::outlive_file_limits();
    terminal::begin(&words);
    let verb = match Cli::try_parse_from(words) {
        Ok(cli) => cli.verb,
        Err(said) => {
            // help and the version are answers, and go to standard output
            let _ = said.print();
            return if said.use_stderr() { terminal::WRONG } else { terminal::ended(terminal::DONE) };
        }
    };
    let outcome = match verb {
        Verb::Run(run) => return on_ranks(&run),
        Verb::Check(check) => check.execute(),
        Verb::List(list) => list.execute(),
        Verb::Reproduce(reproduce) => reproduce.execute(),
        Verb::Report(report) => report.execute(),
        Verb::Schema => schema::execute(),
        Verb::Studies(studies) => studies.execute(),
    };
    told(outcome)
}

/// Runs a study on all ranks, of which this process is one, and leaves them with its exit status.
fn on_ranks(run: &run::Run) -> Status {
    let membership = match driftmesh::ranks::begin() {
        Ok(membership) => membership,
        Err(error) => return told(Err(error)),
    };
    let status = told(run.execute());
    membership.end(status, terminal::say_withheld);
    status
}

/// The exit status of an outcome; an error is told.
fn told(outcome: driftmesh::Result<Status>) -> Status {
    terminal::ended(match outcome {
        Ok(status) => status,
        Err(error) => terminal::complain(&error, error.help(), None),
    })
}
