//! Ctrl-C and SIGTERM end a run with its step; a second one ends the program at once.

use crate::terminal;
use driftmesh::Result;
use driftmesh::output::names;
use driftmesh::simulation::{Event, Observer, Snapshot};
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Whether somebody asked the run to end.
pub struct Interrupts(Arc<AtomicBool>);

impl Interrupts {
    /// Listens from now on. Where signals cannot be heard, they end the program as they do elsewhere.
    pub fn listen() -> Self {
        let asked = Arc::new(AtomicBool::new(false));
        for signal in [SIGINT, SIGTERM] {
            let _ = flag::register_conditional_shutdown(signal, 1, asked.clone())
                .and_then(|_| flag::register(signal, asked.clone()));
        }
        Self(asked)
    }
}

impl Observer for Interrupts {
    fn observe(&mut self, _event: Event, _snapshot: &Snapshot<'_>) -> Result<()> {
        Ok(())
    }

    fn interrupts(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// A file that would grow past the limit of the shell (`ulimit -f`) is then an error of that file, not the silent end
/// of the program.
pub fn outlive_file_limits() {
    #[cfg(unix)]
    let _ = flag::register(signal_hook::consts::SIGXFSZ, Arc::new(AtomicBool::new(false)));
}

/// The command that goes on with a run: this command line, or where the study came from standard input, which is read
/// once, one with the study in the directory of the run.
pub fn command(standard_input: bool, out: &Path) -> String {
    let mut words = terminal::words();
    if standard_input {
        let [study, out] = [&out.join(names::STUDY), out].map(|path| path.to_string_lossy().into_owned());
        words.truncate(1);
        words.extend(["run".into(), study, "--out".into(), out]);
    }
    if !words.iter().any(|word| word == "--resume") {
        words.push("--resume".into());
    }
    // a word that no shell can quote holds a zero byte, which no argument does
    shlex::try_join(words.iter().map(String::as_str)).unwrap_or_else(|_| words.join(" "))
}
