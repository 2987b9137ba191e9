//! All who watch a run, on all ranks.

use crate::error::Result;
use crate::kept::Kept;
use crate::ranks::{Ranks, Traffic};
use crate::simulation::{Event, Observer, Snapshot};

/// Those who watch a run on this rank, as one observer that all ranks have
///
/// Only some ranks may be told to end, or be told later than others; so all ranks ask each other after every step, and
/// all end after the same one.
#[derive(Default)]
pub(super) struct Together<'a> {
    pub watchers: Vec<&'a mut dyn Observer>,
    /// What had been received when the run began, and how many steps were done since.
    since: (Traffic, usize),
    /// What this rank received from others in a step: the mean over the steps of the run since it began or went on.
    pub received: Received,
}

/// Mean messages and bytes a step.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Received {
    pub messages: f64,
    pub bytes: f64,
}

impl Together<'_> {
    fn count(&mut self) {
        let (before, steps) = &mut self.since;
        *steps += 1;
        let (now, steps) = (Ranks::here().traffic(), *steps as f64);
        self.received = Received {
            messages: (now.messages - before.messages) as f64 / steps,
            bytes: (now.bytes - before.bytes) as f64 / steps,
        };
    }
}

impl Observer for Together<'_> {
    fn observe(&mut self, event: Event, snapshot: &Snapshot<'_>) -> Result<()> {
        match event {
            Event::Started | Event::Resumed => self.since = (Ranks::here().traffic(), 0),
            Event::Stepped => self.count(),
            Event::Finished => {}
        }
        self.watchers.iter_mut().try_for_each(|watcher| watcher.observe(event, snapshot))
    }

    fn adapting(&mut self, t: f64) -> Result<()> {
        self.watchers.iter_mut().try_for_each(|watcher| watcher.adapting(t))
    }

    fn interrupts(&self) -> bool {
        Ranks::here().any(self.watchers.iter().any(|watcher| watcher.interrupts()))
    }

    fn keep(&mut self, kept: &mut Kept) -> Result<()> {
        self.watchers.iter_mut().try_for_each(|watcher| watcher.keep(kept))
    }
}
