use crate::error::{Error, Result, Unfit};
use serde::{Deserialize, Serialize};

/// The times of all steps
///
/// Every report time and the end are met exactly: each interval between two of them is divided into equal steps, none
/// longer than the step asked for. Within an interval t = t_start + n Δt, never a running sum.
///
/// # Example
/// ```
/// use driftmesh::simulation::Schedule;
/// let schedule = Schedule::new(0.0, 1.0, 0.3, vec![0.5])?;
/// assert_eq!(schedule.steps(), Some(4)); // 2 × 0.25 and 2 × 0.25
/// assert_eq!(schedule.time(2), 0.5);
/// # Ok::<(), driftmesh::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Schedule {
    start: f64,
    reports: Vec<f64>,
    steps: Steps,
    /// The longest step that is asked for; the whole run where the solution decides.
    step: f64,
    /// Ends of earlier runs that this one goes on behind, where it would not meet them by itself.
    met: Vec<f64>,
    /// End of each interval, and the number of steps done there.
    intervals: Vec<(f64, usize)>,
}

/// What a run that goes on behind another must know of the schedule of that.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Past {
    end: f64,
    reports: Vec<f64>,
    met: Vec<f64>,
}

/// What decides how long steps are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Steps {
    /// The schedule alone.
    Even,
    /// The solution, by its change at the moving nodes.
    ByChange,
    /// The solution, by the error of a step.
    ByError {
        /// The error of a step, as a share of the range of the solution.
        tolerance: f64,
        /// The first and longest step, where one is given.
        longest: Option<f64>,
    },
}

/// Largest number of steps of a run: at a millisecond each these take twelve days.
const MAX_STEPS: f64 = 1e9;
/// Tolerances of the error of a step that may be set, as shares of the range of the solution: below the smallest, what
/// the solvers of the equations leave would count.
const TOLERANCES: std::ops::RangeInclusive<f64> = 1e-5..=0.1;

impl Schedule {
    /// From `start` to `end` with steps that the solution chooses, meeting all of `report`.
    ///
    /// # Errors
    /// As [`Schedule::new`].
    pub fn automatic(start: f64, end: f64, report: Vec<f64>) -> Result<Self> {
        // one interval between two reports is one step to be divided
        let step = (end - start).abs().max(f64::MIN_POSITIVE);
        Ok(Self { steps: Steps::ByChange, ..Self::new(start, end, step, report)? })
    }

    /// From `start` to `end` with steps whose estimated error is no more than `tolerance`, as a share of the range of
    /// the solution, meeting all of `report`. `longest` is the first step as well.
    ///
    /// # Errors
    /// As [`Schedule::new`], and [`Error::Invalid`] for a tolerance that is not between 1e-5 and 0.1.
    pub fn tolerant(start: f64, end: f64, tolerance: f64, longest: Option<f64>, report: Vec<f64>) -> Result<Self> {
        if !TOLERANCES.contains(&tolerance) {
            let rule = "must be between 1e-5, below which what equations leave unsolved would count, and 0.1";
            return Err(Error::invalid("tolerance", tolerance, rule));
        }
        if let Some(longest) = longest {
            Self::new(start, end, longest, report.clone())?;
        }
        Ok(Self { steps: Steps::ByError { tolerance, longest }, ..Self::automatic(start, end, report)? })
    }

    /// From `start` to `end` with steps no longer than `step`, meeting all of `report`.
    ///
    /// # Errors
    /// [`Error::Invalid`] names the key of `[time]` that is not finite, not positive or out of order.
    pub fn new(start: f64, end: f64, step: f64, report: Vec<f64>) -> Result<Self> {
        let finite = |key: &str, value: f64| match value.is_finite() {
            true => Ok(()),
            false => Err(Error::invalid(key, value, "must be a finite number")),
        };
        finite("start", start)?;
        finite("end", end)?;
        if end <= start {
            return Err(Error::invalid("end", end, format!("must come after start = {start}")));
        }
        finite("step", step)?;
        if step <= 0.0 {
            return Err(Error::invalid("step", step, "must be above 0"));
        }
        let resolution = 1e-12 * start.abs().max(end.abs());
        if step < resolution {
            let rule = format!("near t = {end:e} times are told apart only down to {resolution:.0e}; raise it");
            return Err(Error::invalid("step", step, rule));
        }
        if (end - start) / step > MAX_STEPS {
            let rule = format!("that makes more than {MAX_STEPS:.0e} steps; raise it");
            return Err(Error::invalid("step", step, rule));
        }
        let mut reports = report;
        if let Some(t) = reports.iter().find(|t| !(start..=end).contains(*t)) {
            return Err(Error::invalid("report", t, format!("must lie between start = {start} and end = {end}")));
        }
        reports.sort_by(f64::total_cmp);
        reports.dedup();
        let intervals = divided(start, step, reports.iter().copied().chain([end]));
        Ok(Self { start, reports, steps: Steps::Even, step, met: Vec::new(), intervals })
    }

    /// What a run that goes on behind this one must know of it.
    pub(crate) fn past(&self) -> Past {
        Past { end: self.end(), reports: self.reports.clone(), met: self.met.clone() }
    }

    /// Goes on behind a run that was at its end after `step` steps: the steps up to there stay as they were. True where
    /// this schedule ends later.
    ///
    /// # Errors
    /// [`Unfit::Earlier`] where it ends earlier, [`Unfit::Study`] where it has other reports up to there.
    pub(crate) fn follow(&mut self, past: &Past, step: usize) -> Result<bool, Unfit> {
        past.met.iter().for_each(|t| self.meet(*t));
        if past.end == self.end() {
            return Ok(false);
        }
        if past.end > self.end() || past.end.is_nan() {
            return Err(Unfit::Earlier { was: past.end, is: self.end() });
        }
        let earlier = |reports: &[f64]| reports.iter().copied().filter(|t| *t < past.end).collect::<Vec<f64>>();
        let [was, is] = [&past.reports, &self.reports].map(|reports| earlier(reports));
        if was != is {
            let [was, is] = [was, is].map(|reports| format!("{reports:?} before t = {}", past.end));
            return Err(Unfit::Study { key: "time.report".into(), was, is });
        }
        if !self.meets(step, past.end) {
            self.meet(past.end);
        }
        Ok(true)
    }

    /// Meets a time exactly, as if there were a report.
    fn meet(&mut self, t: f64) {
        let end = self.end();
        if t > self.start && t < end && !self.met.contains(&t) {
            self.met.push(t);
            let mut times: Vec<f64> = self.reports.iter().chain(&self.met).copied().chain([end]).collect();
            times.sort_by(f64::total_cmp);
            self.intervals = divided(self.start, self.step, times.into_iter());
        }
    }

    /// Time of the initial state.
    pub fn start(&self) -> f64 {
        self.start
    }

    /// Time of the last state.
    pub fn end(&self) -> f64 {
        self.intervals.last().map_or(self.start, |i| i.0)
    }

    /// Length of the run, end − start.
    pub fn span(&self) -> f64 {
        self.end() - self.start
    }

    /// The share of the run that is done at time t, (t − start)/(end − start).
    pub fn share(&self, t: f64) -> f64 {
        (t - self.start) / self.span()
    }

    /// Number of steps; none where the solution decides.
    pub fn steps(&self) -> Option<usize> {
        (!self.is_automatic()).then(|| self.intervals.last().map_or(0, |i| i.1))
    }

    /// True where the solution decides how long steps are.
    pub fn is_automatic(&self) -> bool {
        self.steps != Steps::Even
    }

    /// What decides how long steps are.
    pub(super) fn decided_by(&self) -> Steps {
        self.steps
    }

    /// The time after a step from `t` of about `dt`, at most a third longer: the next report or the end is met exactly,
    /// in equal steps. None at the end.
    pub fn after(&self, t: f64, dt: f64) -> Option<f64> {
        let next = self.intervals.iter().map(|i| i.0).find(|&end| end > t)?;
        let count = ((next - t) / dt - 1.0 / 3.0).ceil().max(1.0);
        Some(if count == 1.0 { next } else { t + (next - t) / count })
    }

    /// Time after `step` steps.
    pub fn time(&self, step: usize) -> f64 {
        let (from, done, to, end) = self.interval(step.saturating_sub(1));
        if step == 0 {
            self.start
        } else if step >= end {
            to
        } else {
            from + (step - done) as f64 * ((to - from) / (end - done) as f64)
        }
    }

    /// Length of the step that follows `step` steps; none at the end.
    pub fn step_from(&self, step: usize) -> Option<f64> {
        let (from, done, to, end) = self.interval(step);
        (step < end).then(|| (to - from) / (end - done) as f64)
    }

    /// True where the run may be at `t` after `step` steps.
    pub fn meets(&self, step: usize, t: f64) -> bool {
        match self.steps() {
            Some(steps) => step <= steps && t == self.time(step),
            None => (self.start..=self.end()).contains(&t),
        }
    }

    /// True where a report is due.
    pub fn reports_at(&self, t: f64) -> bool {
        self.reports.contains(&t)
    }

    /// The interval that the step after `step` lies in: its start and the steps done there, its end likewise.
    fn interval(&self, step: usize) -> (f64, usize, f64, usize) {
        let i = self.intervals.iter().position(|&(_, end)| step < end).unwrap_or(self.intervals.len() - 1);
        let (from, done) = if i == 0 { (self.start, 0) } else { self.intervals[i - 1] };
        let (to, end) = self.intervals[i];
        (from, done, to, end)
    }
}

/// Intervals between times in their order, and the steps done at the end of each.
fn divided(start: f64, step: f64, times: impl Iterator<Item = f64>) -> Vec<(f64, usize)> {
    let mut intervals: Vec<(f64, usize)> = Vec::new();
    let mut from = start;
    for to in times {
        if to > from {
            // a quotient that is whole up to round-off is whole
            let count = ((to - from) / step - 1e-9).ceil().max(1.0) as usize;
            let done = intervals.last().map_or(0, |i| i.1);
            intervals.push((to, done + count));
            from = to;
        }
    }
    intervals
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Steps never exceed the one asked for, times increase, and every report is met to the last bit.
        #[test]
        fn reports_are_met_exactly(
            start in -2.0..2.0_f64,
            span in 1e-3..5.0_f64,
            step in 1e-3..1.0_f64,
            at in prop::collection::vec(0.0..1.0_f64, 0..4),
        ) {
            let end = start + span;
            let report: Vec<f64> = at.iter().map(|s| (start + s * span).clamp(start, end)).collect();
            let schedule = Schedule::new(start, end, step, report.clone()).unwrap();
            let times: Vec<f64> = (0..=schedule.steps().unwrap()).map(|n| schedule.time(n)).collect();
            prop_assert_eq!(times[0], start);
            prop_assert_eq!(times[schedule.steps().unwrap()], end);
            for n in 0..schedule.steps().unwrap() {
                prop_assert!(times[n + 1] > times[n] || span < 1e-9);
                prop_assert!(schedule.step_from(n).unwrap() <= step * (1.0 + 1e-8));
            }
            prop_assert!(schedule.step_from(schedule.steps().unwrap()).is_none());
            prop_assert!(report.iter().all(|t| times.contains(t)));
        }
    }

    /// 0.25 + n·1e-3 has exactly 1000 steps to 1.25, whatever the quotient rounds to.
    #[test]
    fn a_step_that_divides_the_span_is_kept() {
        let schedule = Schedule::new(0.25, 1.25, 1e-3, vec![0.75, 1.0, 1.25]).unwrap();
        assert_eq!(schedule.steps(), Some(1000));
        assert_eq!(schedule.time(500), 0.75);
        assert!((schedule.step_from(3).unwrap() - 1e-3).abs() < 1e-18);
    }

    /// 0.3 is met after two steps of at most 0.2 in any run to a later end, however that divides its steps: by 0.25
    /// up to 1, were it not for the earlier end.
    #[test]
    fn a_later_end_leaves_the_steps_before_as_they_were() {
        let short = Schedule::new(0.0, 0.3, 0.2, vec![0.3]).unwrap();
        let mut longer = Schedule::new(0.0, 1.0, 0.2, vec![1.0]).unwrap();
        assert_eq!((longer.steps(), longer.meets(2, 0.3)), (Some(5), false));
        assert!(longer.follow(&short.past(), 2).unwrap());
        assert_eq!((longer.steps(), longer.meets(2, 0.3), longer.reports_at(0.3)), (Some(6), true, false));
        assert_eq!([1, 2].map(|n| longer.time(n)), [1, 2].map(|n| short.time(n)));
        // and so does one that goes on behind that, and one that goes on half-way
        let mut longest = Schedule::new(0.0, 1.7, 0.2, vec![1.7]).unwrap();
        assert!(longest.follow(&longer.past(), 6).unwrap());
        assert!((0..=6).all(|n| longest.time(n) == longer.time(n)) && longest.steps() == Some(10));
        let mut again = Schedule::new(0.0, 1.7, 0.2, vec![1.7]).unwrap();
        assert!(!again.follow(&longest.past(), 8).unwrap() && again == longest);
        assert_eq!(longest.follow(&short.past(), 2), Ok(true));
        assert_eq!(short.clone().follow(&longer.past(), 6), Err(Unfit::Earlier { was: 1.0, is: 0.3 }));
        let other = Schedule::new(0.0, 2.0, 0.2, vec![0.1]).unwrap();
        assert!(
            matches!(other.clone().follow(&short.past(), 2), Err(Unfit::Study { key, .. }) if key == "time.report")
        );
        // a time that both meet by themselves needs nothing
        let mut even = Schedule::new(0.0, 2.0, 0.25, vec![]).unwrap();
        let alone = even.clone();
        assert!(even.follow(&Schedule::new(0.0, 1.0, 0.25, vec![1.0]).unwrap().past(), 4).unwrap() && even == alone);
    }

    #[test]
    fn nonsense_is_refused_by_name() {
        let key = |start, end, step, report| match Schedule::new(start, end, step, report) {
            Err(Error::Invalid { key, .. }) => key,
            other => panic!("{other:?}"),
        };
        assert_eq!(key(0.0, -1.0, 0.1, vec![]), "end");
        assert_eq!(key(0.0, 1.0, 0.0, vec![]), "step");
        assert_eq!(key(0.0, 1.0, 1e-11, vec![]), "step");
        assert_eq!(key(1e15, 1e15 + 1.0, 0.01, vec![]), "step");
        assert_eq!(key(0.0, 1.0, f64::NAN, vec![]), "step");
        assert_eq!(key(f64::NAN, 1.0, 0.1, vec![]), "start");
        assert_eq!(key(0.0, f64::INFINITY, 0.1, vec![]), "end");
        assert_eq!(key(0.0, 1.0, 0.1, vec![2.0]), "report");
        for (tolerance, longest, named) in
            [(0.0, None, "tolerance"), (f64::NAN, None, "tolerance"), (1e-3, Some(-1.0), "step")]
        {
            match Schedule::tolerant(0.0, 1.0, tolerance, longest, vec![]) {
                Err(Error::Invalid { key, .. }) => assert_eq!(key, named),
                other => panic!("{other:?}"),
            }
        }
    }
}
