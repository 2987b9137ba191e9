//! Words to the user, which are those of rank 0. A closed pipe is not an error worth a word.

use driftmesh::Error;
use driftmesh::ranks::Ranks;
use std::ffi::OsString;
use std::io::{ErrorKind, Write, stderr, stdout};
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, OnceLock, PoisonError};

/// How the program ends, for whoever called it.
pub type Status = u8;
/// Exit status: everything that was asked for is done.
pub const DONE: Status = 0;
/// Exit status: the computation failed, or gave a warning under `--strict`.
pub const FAILED: Status = 1;
/// Exit status: the study or the command line is wrong, and nothing was computed.
pub const WRONG: Status = 2;

/// Why writing to standard output failed the first time, as on a full disk; empty if it did not.
static UNSAID: OnceLock<String> = OnceLock::new();
/// Warnings printed so far.
static WARNINGS: AtomicUsize = AtomicUsize::new(0);

/// The error of a rank other than 0, which is printed only where this rank alone failed.
static WITHHELD: Mutex<String> = Mutex::new(String::new());

/// The words of the command line.
static WORDS: Mutex<Vec<String>> = Mutex::new(Vec::new());

/// Forgets what was said before, and keeps the command line.
pub fn begin(words: &[OsString]) {
    WARNINGS.store(0, Ordering::Relaxed);
    *WORDS.lock().unwrap_or_else(PoisonError::into_inner) =
        words.iter().map(|word| word.to_string_lossy().into_owned()).collect();
}

/// The words of the command line.
pub fn words() -> Vec<String> {
    WORDS.lock().unwrap_or_else(PoisonError::into_inner).clone()
}

/// Prints to standard output.
pub fn say(text: impl std::fmt::Display) {
    if Ranks::here().is_first()
        && let Err(error) = writeln!(stdout(), "{text}")
        && error.kind() != ErrorKind::BrokenPipe
    {
        let _ = UNSAID.set(error.to_string());
    }
}

/// How the program ends if it would end so: what was not printed, on a full disk say, is an error.
pub fn ended(code: Status) -> Status {
    match UNSAID.get() {
        None => code,
        Some(reason) => {
            let _ = writeln!(stderr(), "error: cannot write standard output: {reason}");
            FAILED
        }
    }
}

/// Prints where the files of a run are, those that there are.
pub fn say_files(out: &Path, files: impl Iterator<Item = (&'static str, String)>) {
    for (label, name) in files {
        let path = out.join(name);
        if path.is_file() {
            say(format_args!("{label:8} {}", path.display()));
        }
    }
}

/// Prints something that did not stop the program.
pub fn warn(text: &str) {
    WARNINGS.fetch_add(1, Ordering::Relaxed);
    report(&format!("warning: {text}\n"));
}

/// How the program ends where nothing failed: with `strict`, any warning makes it fail, and one line says so. `what`
/// names what is complete in spite of them.
pub fn succeeded(strict: bool, what: &str) -> Status {
    let count = match WARNINGS.load(Ordering::Relaxed) {
        _ if !strict => return DONE,
        0 => return DONE,
        1 => "1 warning, which --strict makes a failure".into(),
        n => format!("{n} warnings, which --strict makes a failure"),
    };
    report(&format!("error: {count}: {what}\n"));
    FAILED
}

/// Prints what the user may not expect.
pub fn note(text: &str) {
    report(&format!("note: {text}\n"));
}

/// Prints to standard error.
fn report(text: &str) {
    if Ranks::here().is_first() {
        let _ = stderr().write_all(text.as_bytes());
    }
}

/// Prints the error of this rank although it does not speak: it alone failed.
pub fn say_withheld() {
    let text = WITHHELD.lock().unwrap_or_else(PoisonError::into_inner);
    let _ = stderr().write_all(text.as_bytes());
}

/// Prints an error with its remedy and a note, and says how the program ends.
pub fn complain(error: &Error, help: Option<String>, note: Option<String>) -> Status {
    let mut text = format!("error: {error}\n");
    for (title, words) in [("help", help), ("note", note)] {
        if let Some(words) = words {
            text.push_str(&format!("  {title}: {words}\n"));
        }
    }
    report(&text);
    if !Ranks::here().is_first() {
        let text = format!("rank {}: {text}", Ranks::here().rank());
        *WITHHELD.lock().unwrap_or_else(PoisonError::into_inner) = text;
    }
    if error.is_failure() { FAILED } else { WRONG }
}

/// Makes the pool of threads: where no number is given, all cores, or one thread for each of several ranks. The caller
/// is one of them: handing each small piece of work to a pool beside it would cost more than the work.
pub fn use_threads(threads: Option<u16>) -> driftmesh::Result<()> {
    let alone = Ranks::here().count() == 1;
    let number = threads.map_or(if alone { 0 } else { 1 }, usize::from);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(number).use_current_thread().build_global();
    pool.map_err(|error| {
        Error::invalid("--threads", number, format!("no pool of so many threads can be made: {error}"))
    })
}

/// A time in eight letters or so.
pub fn moment(t: f64) -> String {
    if t == 0.0 || (1e-2..1e6).contains(&t.abs()) { format!("{t:.4}") } else { format!("{t:.2e}") }
}
