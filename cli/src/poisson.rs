use crate::terminal;
use driftmesh::study::{PoissonStudy, PoissonSummary};
use std::path::Path;
use std::process::ExitCode;

/// Runs a study of kind `poisson`.
pub fn run(study: &PoissonStudy, out: &Path, quiet: bool) -> driftmesh::Result<ExitCode> {
    let summary = match study.run(out) {
        Ok(summary) => summary,
        Err(error) => return Ok(terminal::complain(&error, study.remedy(&error), None)),
    };
    summary.warnings.iter().for_each(|warning| terminal::warn(warning));
    if !quiet {
        terminal::say(table(&summary));
        terminal::say_files(out, &[("picture", "mesh.png"), ("report", "report.html")]);
        terminal::say(format_args!("run      {}", out.display()));
    }
    Ok(ExitCode::SUCCESS)
}

/// Errors, stencils and seconds in a few lines.
fn table(summary: &PoissonSummary) -> String {
    let mut text = String::new();
    if let Some(error) = summary.error {
        text += &format!("error    l_inf {:.3e}, l2 {:.3e}\n", error.linf, error.l2);
    }
    if let Some(stencil) = summary.stencil {
        let degree = stencil.exact_degree.map_or("none".into(), |degree| degree.to_string());
        text += &format!(
            "stencils exact to degree {degree}, {:.1} % without negative weights, {:.2e} a second\n",
            100.0 * stencil.nonnegative_fraction,
            stencil.points_per_second
        );
    }
    let s = summary.seconds;
    text + &format!(
        "seconds  {:.2} (stencils {:.3}, solve {:.2}, output {:.2}), {} threads",
        s.wall, s.stencils, s.solve, s.output, summary.parallel.threads
    )
}
