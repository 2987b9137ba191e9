use crate::interrupts::Interrupts;
use crate::progress::Progress;
use crate::run::remedy;
use crate::terminal;
use driftmesh::simulation::Observer;
use driftmesh::study::{Begin, StefanStudy, StefanSummary};
use std::path::Path;
use std::process::ExitCode;

/// Runs a study of kind `stefan`.
pub fn run(study: &StefanStudy, out: &Path, begin: Begin, quiet: bool) -> driftmesh::Result<ExitCode> {
    let mut progress = Progress::new();
    let mut interrupts = Interrupts::listen();
    let mut watchers: Vec<&mut dyn Observer> = vec![&mut interrupts];
    if !quiet {
        watchers.push(&mut progress);
    }
    let finished = match begin {
        Begin::Anew => study.run(out, &mut watchers),
        Begin::Resumed => study.resume(out, &mut watchers),
    };
    progress.clear();
    let finished = finished?;
    finished.summary.warnings.iter().for_each(|warning| terminal::warn(warning));
    if !quiet {
        terminal::say(table(&finished.summary));
        terminal::say_files(out, &[("picture", "mesh.png"), ("front", "front.png"), ("report", "report.html")]);
        terminal::say(format_args!("run      {}", out.display()));
    }
    match finished.failure {
        None => Ok(ExitCode::SUCCESS),
        Some(error) => {
            let note =
                format!("everything up to the last good state (step {}) is in {}", finished.state.step, out.display());
            Ok(terminal::complain(&error, remedy(&error, out, study.remedy(&error)), Some(note)))
        }
    }
}

/// Fronts, errors and balances in a few lines.
fn table(summary: &StefanSummary) -> String {
    let mut text = String::new();
    if !summary.reports.is_empty() {
        text += "       t  front mean       min       max  front error  u error    energy  3-point  step limit\n";
    }
    for report in &summary.reports {
        let figure = |value: Option<f64>| value.map_or("-".into(), |value| format!("{value:.2e}"));
        text += &format!(
            "{:>8} {:11.6} {:9.6} {:9.6} {:>12} {:>8} {:>9} {:>8} {:>11}\n",
            terminal::moment(report.t),
            report.front.mean,
            report.front.range[0],
            report.front.range[1],
            figure(report.front.error_linf),
            figure(report.error.map(|error| error.linf)),
            figure(report.energy_imbalance),
            figure(report.energy_imbalance_by_differences),
            figure(report.step_limit)
        );
    }
    let (work, s) = (summary.work, summary.seconds);
    text += &format!("work     {} steps, {} linear solves", work.steps, work.work.linear_solves);
    if work.work.newton_iterations > 0 {
        text += &format!(", {} Newton iterations", work.work.newton_iterations);
    }
    text + &format!(
        "\nseconds  {:.2} (pde {:.2}, output {:.2}), {} threads",
        s.wall, s.pde, s.output, summary.parallel.threads
    )
}
