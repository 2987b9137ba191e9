use driftmesh::simulation::{Event, Observer, Snapshot};
use indicatif::{ProgressBar, ProgressStyle};
use std::io::{IsTerminal, Write, stderr};

/// A live bar on a terminal, ten plain lines elsewhere.
pub struct Progress {
    bar: Option<ProgressBar>,
    /// Pieces of the run that were told of.
    told: usize,
}

/// Pieces of a run: of the bar, and as lines.
const OF_THE_BAR: usize = 500;
const LINES: usize = 10;

impl Progress {
    pub fn new() -> Self {
        let bar = stderr().is_terminal().then(|| {
            let style = ProgressStyle::with_template("{bar:40} {percent:>3} %  {msg}  {eta} left")
                .expect("the template is valid");
            ProgressBar::new(0).with_style(style)
        });
        Self { bar, told: 0 }
    }

    /// Clears the bar, so that what follows begins on a clean line.
    pub fn clear(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

impl Observer for Progress {
    fn observe(&mut self, event: Event, snapshot: &Snapshot<'_>) -> driftmesh::Result<()> {
        let words = || {
            let (state, jacobian) = (snapshot.state, snapshot.quality.min_scaled_jacobian);
            let of = snapshot.steps.map_or(String::new(), |steps| format!(" of {steps}"));
            format!("t = {:.4}  step {}{of}  min J {jacobian:.3}", state.t, state.step)
        };
        let pieces = if self.bar.is_some() { OF_THE_BAR } else { LINES };
        // a share that is a whole number of pieces up to round-off is one
        let done = (snapshot.share * pieces as f64 + 1e-9) as usize;
        let news = done > std::mem::replace(&mut self.told, done);
        match &self.bar {
            Some(bar) if event == Event::Started => {
                bar.set_length(pieces as u64);
                bar.set_message(words());
            }
            Some(bar) if news => {
                bar.set_position(done as u64);
                bar.set_message(words());
            }
            None if event == Event::Stepped && news => {
                let _ = writeln!(stderr(), "{}", words());
            }
            _ => {}
        }
        Ok(())
    }
}
