use crate::error::{Error, Result};
use crate::output::RunDirectory;
use serde::Serialize;
use std::time::Instant;

/// Ends a run of any kind: its summary, then the report and what else is drawn, then the summary again with what that took
/// or failed with. What went wrong first is returned.
///
/// `note(summary, failure, seconds)` puts into the summary how the run ended, and adds seconds of output; `draw(status)`
/// finds everything in the summary but the status.
pub(super) fn end<S: Serialize>(
    directory: &RunDirectory,
    summary: &mut S,
    failure: Option<Error>,
    note: impl Fn(&mut S, Option<&Error>, f64),
    draw: impl FnOnce(&str) -> Result<()>,
) -> Option<Error> {
    note(summary, failure.as_ref(), 0.0);
    // what is on the disk is not called completed before all is there: there may be no space to take that back
    let mut unfinished = serde_json::to_value(&*summary).expect("a summary is plain data");
    let status = std::mem::replace(&mut unfinished["status"], "running".into());
    let written = directory.write_summary(&unfinished);
    let output = Instant::now();
    let failure = failure.or(written.and_then(|()| draw(status.as_str().unwrap_or_default())).err());
    note(summary, failure.as_ref(), output.elapsed().as_secs_f64());
    failure.or(directory.write_summary(summary).err())
}
