use crate::interrupts::Interrupts;
use crate::progress::Progress;
use crate::run::remedy;
use crate::terminal;
use driftmesh::study::{Begin, EquidistributionStudy, EquidistributionSummary, NumberedIterate};
use std::path::Path;
use std::process::ExitCode;

/// Runs a study of kind `equidistribution`.
pub fn run(study: &EquidistributionStudy, out: &Path, begin: Begin, quiet: bool) -> driftmesh::Result<ExitCode> {
    let mut progress = Progress::new();
    let finished = match &study.time {
        Some(_) if quiet => study.run_from(out, &mut [&mut Interrupts::listen()], begin),
        Some(_) => study.run_from(out, &mut [&mut Interrupts::listen(), &mut progress], begin),
        // a single solve, which nobody can end half-way, ends with the program
        None => study.run_from(out, &mut [], begin),
    };
    progress.clear();
    let finished = finished?;
    finished.summary.warnings.iter().for_each(|warning| terminal::warn(warning));
    if !quiet {
        terminal::say(table(&finished.summary));
        terminal::say_files(out, &[("picture", "mesh.png"), ("history", "convergence.png"), ("report", "report.html")]);
        terminal::say(format_args!("run      {}", out.display()));
    }
    match finished.failure {
        None => Ok(ExitCode::SUCCESS),
        Some(error) => {
            let note = format!("the last mesh and every iteration up to it are in {}", out.display());
            Ok(terminal::complain(&error, remedy(&error, out, study.remedy(&error)), Some(note)))
        }
    }
}

/// Iterations that are shown: the first ones, then ever fewer, and the last.
fn shown(iterations: &[NumberedIterate]) -> impl Iterator<Item = &NumberedIterate> {
    let last = iterations.len().saturating_sub(1);
    let round = |n: usize| n <= 10 || [1, 2, 5].iter().any(|d| (0..7).any(|power| n == d * 10_usize.pow(power)));
    iterations.iter().filter(move |it| round(it.n) || it.n == last)
}

/// Iterations, rates, quality and seconds in a few lines.
fn table(summary: &EquidistributionSummary) -> String {
    let mut text = String::new();
    let figure = |value: Option<f64>| value.map_or("-".into(), |value| format!("{value:.3e}"));
    if !summary.iterations.is_empty() {
        if summary.iterations_per_step.is_some() {
            text += "the last step:\n";
        }
        text += "       n     error  increment  largest jump  interpolation  linear solves\n";
        for it in shown(&summary.iterations) {
            text += &format!(
                "{:8} {:9.3e} {:>10} {:>13} {:>14} {:14}\n",
                it.n,
                it.error_linf,
                it.increment.map_or("-".into(), |increment| format!("{increment:.3e}")),
                figure(it.largest_jump),
                figure(it.interpolation_error),
                it.linear_solves
            );
        }
        let rate = |value: Option<f64>| value.map_or("-".into(), |value| format!("{value:.5}"));
        let r = summary.rate;
        text += &format!(
            "rate     observed {}, predicted {}, at most {} (in two iterations)\n",
            rate(r.observed),
            rate(r.predicted),
            rate(r.bound)
        );
        if let Some(n) = summary.iterations_to_tolerance {
            text += &format!("met      the tolerance after {n} iterations\n");
        }
    }
    if let Some(per) = summary.iterations_per_step {
        text += &format!(
            "steps    {}, each of {:.1} iterations ({} to {})\n",
            summary.work.steps, per.mean, per.min, per.max
        );
    }
    if let Some(q) = summary.quality {
        text += &format!(
            "mesh     equidistribution {:.4}, shortest cell {:.3e} of the mean",
            q.equidistribution, q.shortest_cell
        );
        text += &q.error_linf.map_or(String::new(), |error| format!(", {error:.3e} from the continuous one"));
        text += "\n";
    }
    let s = summary.seconds;
    text + &format!(
        "seconds  {:.2} (mesh {:.2}, output {:.2}), {} linear solves, {} threads",
        s.wall, s.mesh, s.output, summary.work.linear_solves, summary.parallel.threads
    )
}
