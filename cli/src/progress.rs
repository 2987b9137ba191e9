use driftmesh::simulation::{Event, Observer, Snapshot};
use indicatif::{ProgressBar, ProgressStyle};
use std::io::{IsTerminal, Write, stderr};

/// A live bar on a terminal, ten plain lines elsewhere.
pub struct Progress {
    bar: Option<ProgressBar>,
}

impl Progress {
    pub fn new() -> Self {
        let bar = stderr().is_terminal().then(|| {
            let style = ProgressStyle::with_template("{bar:40} {percent:>3} %  {msg}  {eta} left")
                .expect("the template is valid");
            ProgressBar::new(0).with_style(style)
        });
        Self { bar }
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
        let (step, steps) = (snapshot.state.step, snapshot.steps);
        let words = || {
            let jacobian = snapshot.quality.min_scaled_jacobian;
            format!("t = {:.4}  step {step} of {steps}  min J {jacobian:.3}", snapshot.state.t)
        };
        match &self.bar {
            Some(bar) if event == Event::Started => {
                bar.set_length(steps as u64);
                bar.set_message(words());
            }
            Some(bar) if step.is_multiple_of(steps.div_ceil(500)) => {
                bar.set_position(step as u64);
                bar.set_message(words());
            }
            None if event == Event::Stepped && step.is_multiple_of(steps.div_ceil(10)) => {
                let _ = writeln!(stderr(), "{}", words());
            }
            _ => {}
        }
        Ok(())
    }
}
