use super::Record;
use super::checkpoint::Course;
use crate::stopwatch::{Spent, Stopwatch};

/// The time that a run takes, over all its parts.
pub(super) struct Clock {
    all: Stopwatch,
    /// Time of the steps alone.
    steps: Stopwatch,
}

impl Clock {
    pub fn start(course: Option<&Course>, record: &Record) -> Self {
        let before = course.map_or(0.0, |course| course.seconds);
        let Spent { wall, cpu, .. } = record.seconds;
        Self { all: Stopwatch::start().after([wall, cpu]), steps: Stopwatch::start().after([before, 0.0]) }
    }

    pub fn seconds(&self) -> f64 {
        self.steps.wall()
    }

    /// The record with the time up to now.
    pub fn counted(&self, record: &Record) -> Record {
        let [wall, cpu] = self.all.elapsed();
        Record { seconds: Spent { wall, cpu, ..record.seconds }, ..record.clone() }
    }
}
