//! Seconds that a run takes.

use cpu_time::ProcessTime;
use std::time::Instant;

/// Seconds by the clock, and of the processor over all threads.
pub(crate) struct Stopwatch {
    wall: Instant,
    cpu: ProcessTime,
    before: [f64; 2],
}

impl Stopwatch {
    pub fn start() -> Self {
        Self { wall: Instant::now(), cpu: ProcessTime::now(), before: [0.0; 2] }
    }

    /// Goes on from what an earlier part of the run took.
    pub fn after(self, before: [f64; 2]) -> Self {
        Self { before, ..self }
    }

    /// By the clock, and of the processor.
    pub fn elapsed(&self) -> [f64; 2] {
        [self.wall(), self.before[1] + self.cpu.elapsed().as_secs_f64()]
    }

    /// By the clock alone, which is cheap to ask.
    pub fn wall(&self) -> f64 {
        self.before[0] + self.wall.elapsed().as_secs_f64()
    }
}
