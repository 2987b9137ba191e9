use crate::terminal;
use driftmesh::simulation::{Event, Observer, Snapshot};
use indicatif::{ProgressBar, ProgressStyle};
use std::io::{IsTerminal, Write, stderr};
use std::time::{Duration, Instant};

/// A live bar on a terminal, ten plain lines elsewhere: time, step, rate, smallest corner Jacobian, time that remains
///
/// Before, while the mesh adapts to the initial solution, its steps are told of every few seconds.
pub struct Progress {
    bar: Option<ProgressBar>,
    /// Pieces of the run that were told of.
    told: usize,
    /// Steps in which the mesh adapted, and when they were told of.
    adapting: (usize, Instant),
}

/// Number of equal shares of a run after each of which the bar is drawn again: finer than a terminal shows.
const OF_THE_BAR: usize = 500;
/// Number of equal shares of a run after each of which a line is printed where standard error is no terminal.
const LINES: usize = 10;
/// Least time between two lines about the adaptation of the first mesh, whose number of steps is not known before.
const PATIENCE: Duration = Duration::from_secs(5);

impl Progress {
    pub fn new() -> Self {
        let bar = stderr().is_terminal().then(|| {
            let style =
                ProgressStyle::with_template("{percent:>3} %  {msg}  {wide_bar}").expect("the template is valid");
            ProgressBar::new(0).with_style(style)
        });
        Self { bar, told: 0, adapting: (0, Instant::now()) }
    }

    /// Clears the bar, so that what follows begins on a clean line.
    pub fn clear(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }

    /// Where the run is, where that is news.
    fn show(&mut self, event: Event, at: &Snapshot<'_>) {
        // beside the percentage and the smallest bar
        let room = || usize::from(console::Term::stderr().size().1).saturating_sub(16);
        let pieces = if self.bar.is_some() { OF_THE_BAR } else { LINES };
        // a share that is a whole number of pieces up to round-off is one
        let done = (at.share * pieces as f64 + 1e-9) as usize;
        let news = done > std::mem::replace(&mut self.told, done);
        match &self.bar {
            Some(bar) if news || matches!(event, Event::Started | Event::Resumed) => {
                bar.set_length(pieces as u64);
                bar.set_position(done as u64);
                bar.set_message(fitting(&words(at), room()));
            }
            Some(bar) if event == Event::Finished => bar.set_message("comparing, drawing and writing the report"),
            None if event == Event::Resumed || event == Event::Stepped && news => {
                let _ = writeln!(stderr(), "{}", words(at).join("  "));
            }
            _ => {}
        }
    }
}

impl Observer for Progress {
    fn observe(&mut self, event: Event, snapshot: &Snapshot<'_>) -> driftmesh::Result<()> {
        self.show(event, snapshot);
        Ok(())
    }

    fn adapting(&mut self, _t: f64) -> driftmesh::Result<()> {
        let (steps, told) = &mut self.adapting;
        *steps += 1;
        let words = || format!("adapting the mesh to the initial solution: step {steps}");
        match &self.bar {
            Some(bar) => bar.set_message(words()),
            None if told.elapsed() > PATIENCE => {
                let _ = writeln!(stderr(), "{}", words());
                *told = Instant::now();
            }
            None => {}
        }
        Ok(())
    }
}

/// Where a run is, how fast, and for how long still, as far as the time simulated so far tells; what matters most comes
/// first.
fn words(at: &Snapshot<'_>) -> Vec<String> {
    let of = at.steps.map_or(String::new(), |steps| format!(" of {steps}"));
    let mut words = vec![
        format!("t = {}", terminal::moment(at.t)),
        format!("step {}{of}", at.step),
        format!("min J {:.3}", at.smallest),
    ];
    if at.share > 0.0 && at.share < 1.0 {
        words.push(format!("{} left", duration(at.seconds * (1.0 - at.share) / at.share)));
    }
    if at.step > 0 && at.seconds > 0.0 {
        words.push(format!("{} steps/s", rate(at.step as f64 / at.seconds)));
    }
    words
}

/// As many words as there is room for: none is cut.
fn fitting(words: &[String], room: usize) -> String {
    let mut text = String::new();
    for word in words {
        if text.chars().count() + word.chars().count() > room {
            break;
        }
        text += &format!("{word}  ");
    }
    text.trim_end().to_string()
}

/// Two digits of a number of steps a second.
fn rate(rate: f64) -> String {
    if rate < 10.0 { format!("{rate:.1}") } else { format!("{rate:.0}") }
}

/// A time in seconds, minutes or hours.
fn duration(seconds: f64) -> String {
    let whole = seconds.round() as u64;
    match whole {
        0 => format!("{seconds:.1} s"),
        1..60 => format!("{whole} s"),
        60..3600 => format!("{} min {:02} s", whole / 60, whole % 60),
        _ => format!("{} h {:02} min", whole / 3600, whole / 60 % 60),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_narrow_terminal_leaves_words_out_and_cuts_none() {
        let words = ["t = 1", "step 5 of 9", "3 s left"].map(String::from);
        for (room, text) in [(80, "t = 1  step 5 of 9  3 s left"), (27, "t = 1  step 5 of 9"), (5, "t = 1"), (3, "")] {
            assert_eq!(fitting(&words, room), text);
        }
    }

    #[test]
    fn what_remains_is_told_in_the_unit_that_fits() {
        let words = [0.34, 12.0, 61.0, 3599.7, 7260.0].map(duration);
        assert_eq!(words, ["0.3 s", "12 s", "1 min 01 s", "1 h 00 min", "2 h 01 min"]);
        assert_eq!([0.25, 9.96, 520.4].map(rate), ["0.2", "10.0", "520"]);
    }
}
