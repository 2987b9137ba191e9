//! Time that a run takes.

use cpu_time::ProcessTime;
use serde::{Deserialize, Serialize};
use std::time::Instant;

/// Seconds that a run took, over all its parts.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
pub struct Spent<P> {
    /// Seconds by the clock.
    pub wall: f64,
    /// Processor seconds of all threads.
    pub cpu: f64,
    /// Seconds by what was computed.
    #[serde(flatten)]
    pub parts: P,
    /// Seconds of watching and writing: progress, history, frames, pictures.
    pub output: f64,
}

/// Wall-clock seconds, and processor seconds over all threads.
pub(crate) struct Stopwatch {
    wall: Instant,
    cpu: ProcessTime,
    before: [f64; 2],
}

impl Stopwatch {
    pub fn start() -> Self {
        Self { wall: Instant::now(), cpu: ProcessTime::now(), before: [0.0; 2] }
    }

    /// Continues from the times of an earlier part of the run.
    pub fn after(self, before: [f64; 2]) -> Self {
        Self { before, ..self }
    }

    /// Wall-clock seconds and processor seconds so far.
    pub fn elapsed(&self) -> [f64; 2] {
        [self.wall(), self.before[1] + self.cpu.elapsed().as_secs_f64()]
    }

    /// Wall-clock seconds so far, which are cheap to get.
    pub fn wall(&self) -> f64 {
        self.before[0] + self.wall.elapsed().as_secs_f64()
    }
}
