use crate::interrupts::{self, Interrupts};
use crate::{StudyArgs, equidistribution, poisson, progress::Progress, stefan, terminal};
use clap::Args;
use driftmesh::Error;
use driftmesh::meshing::Interface;
use driftmesh::output::{RunDirectory, Standing, Summary};
use driftmesh::simulation::{Observer, Retries};
use driftmesh::study::{self, Begin, MovingMesh, Study, UniformEquivalent};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

#[derive(Args)]
pub struct Run {
    #[command(flatten)]
    study: StudyArgs,
    /// Directory for the results; `out/NAME` where nothing is said.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Threads to use; all cores where nothing is said. Results do not depend on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Go on from the newest checkpoint in the directory; from the start where there is none.
    #[arg(long)]
    resume: bool,
    /// No progress and no table.
    #[arg(long)]
    quiet: bool,
}

impl Run {
    pub fn execute(&self) -> driftmesh::Result<ExitCode> {
        let study = self.study.read()?;
        let out = self.out.clone().unwrap_or_else(|| PathBuf::from("out").join(study.name()));
        RunDirectory::check(&out)?;
        match (study.standing(&out), self.resume) {
            (Ok(Standing::Complete), true) => {
                if !self.quiet {
                    terminal::say(format_args!("complete: {} needs nothing more", out.display()));
                }
                return Ok(ExitCode::SUCCESS);
            }
            (standing, true) => {
                if standing? == Standing::Nothing && !self.quiet {
                    terminal::note(&format!("nothing to go on from in {}: the run begins at its start", out.display()));
                }
            }
            (Ok(Standing::Unfinished), false) => terminal::warn(&format!(
                "{} holds an unfinished run, which this one replaces; with --resume it would go on",
                out.display()
            )),
            (_, false) => {}
        }
        terminal::use_threads(self.threads)?;
        let begin = if self.resume { Begin::Resumed } else { Begin::Anew };
        match study {
            Study::MovingMesh(study) => self.moving_mesh(&study, &out),
            Study::Poisson(study) => poisson::run(&study, &out, self.quiet),
            Study::Stefan(study) => stefan::run(&study, &out, begin, self.quiet),
            Study::Equidistribution(study) => equidistribution::run(&study, &out, begin, self.quiet),
        }
    }

    fn moving_mesh(&self, study: &MovingMesh, out: &Path) -> driftmesh::Result<ExitCode> {
        let mut progress = Progress::new();
        let mut interrupts = Interrupts::listen();
        let mut watchers: Vec<&mut dyn Observer> = vec![&mut interrupts];
        if !self.quiet {
            watchers.push(&mut progress);
        }
        let finished = match self.resume {
            true => study::resume(study, out, &mut watchers),
            false => study::run(study, out, &mut watchers),
        };
        progress.clear();
        let finished = match finished {
            Ok(finished) => finished,
            Err(error) => return Ok(terminal::complain(&error, study.remedy(&error).or_else(|| error.help()), None)),
        };
        finished.summary.warnings.iter().for_each(|warning| terminal::warn(warning));
        if !self.quiet {
            terminal::say(table(&finished.summary));
            // whoever interrupted the run does not wait for others
            if !matches!(finished.failure.as_ref().map(Error::cause), Some(Error::Interrupted(_)))
                && let Some(line) = uniform(study, &finished.summary)?
            {
                terminal::say(line);
            }
            terminal::say_files(out, &[("picture", "mesh.png"), ("report", "report.html")]);
            terminal::say(format_args!("run      {}", out.display()));
        }
        match finished.failure {
            None => Ok(ExitCode::SUCCESS),
            Some(error) => {
                let step = finished.state.step;
                let note = format!("everything up to the last good state (step {step}) is in {}", out.display());
                Ok(terminal::complain(&error, remedy(&error, out, study.remedy(&error)), Some(note)))
            }
        }
    }
}

/// The remedy for what ended a run: where it can go on, the command for that.
pub fn remedy(error: &Error, out: &Path, other: Option<String>) -> Option<String> {
    let resumable = error.is_resumable() && RunDirectory::standing(out) == Standing::Unfinished;
    let go_on = resumable.then(|| format!("go on with: {}", interrupts::command()));
    Some([other, go_on].into_iter().flatten().collect::<Vec<_>>().join("; then ")).filter(|help| !help.is_empty())
}

/// The uniform meshes with the errors of the reports, where they can be told.
fn uniform(study: &MovingMesh, summary: &Summary) -> driftmesh::Result<Option<String>> {
    let mut found = Vec::new();
    for report in &summary.reports {
        found.extend(study.uniform_equivalent(report)?);
    }
    let Some(UniformEquivalent { thicker, .. }) = found.first().copied() else { return Ok(None) };
    let nodes: Vec<String> = found.iter().map(|at| format!("{} × {}", at.nodes[0], at.nodes[1])).collect();
    let scaled = if thicker > 1.0 { format!(", scaled from a front {thicker} times as thick") } else { String::new() };
    Ok(Some(format!("uniform  about {} nodes have the same l_inf (order 2{scaled})", nodes.join(", "))))
}

/// Time, error, mesh quality, work and seconds in a few lines.
fn table(summary: &Summary) -> String {
    let compared = summary.reports.iter().any(|report| report.comparison.is_some());
    let mut text = String::new();
    if !summary.reports.is_empty() {
        text += "       t     l_inf        l2   Q max  Q mean   min J  equidist";
        text += if compared { "   R max  R mean  mesh rms\n" } else { "\n" };
    }
    for report in &summary.reports {
        let [linf, l2] = report.error.map_or(["-".into(), "-".into()], |e| [e.linf, e.l2].map(|e| format!("{e:.3e}")));
        let q = report.quality;
        let smallest = match q.min_scaled_jacobian {
            small if small > 0.0 && small < 1e-3 => format!("{small:.0e}"),
            j => format!("{j:.4}"),
        };
        text += &format!(
            "{:>8} {linf:>9} {l2:>9} {:7.3} {:7.3} {smallest:>7} {:9.3}",
            terminal::moment(report.t),
            q.q_max,
            q.q_mean,
            q.equidistribution
        );
        if let Some(c) = report.comparison {
            text += &format!(" {:7.4} {:7.4} {:9.1e}", c.r_max, c.r_mean, c.mesh_rms);
        }
        text.push('\n');
    }
    if let Some((t, benefit)) = summary.reports.last().and_then(|report| Some((report.t, report.benefit?))) {
        text += &format!(
            "benefit  interpolation error about {:.1e} on this mesh, {:.1e} on as many equal cells (t = {})\n",
            benefit.mesh,
            benefit.uniform,
            terminal::moment(t)
        );
    }
    let last = summary.reports.last().and_then(|report| Some((report.t, report.interface?)));
    if let Some((t, interface)) = last.filter(|(_, interface)| interface.points > 0) {
        text += &interfaces(t, &interface);
    }
    let (total, s) = (summary.work, summary.seconds);
    text += &format!(
        "work     {} steps, {} Newton iterations, {} linear solves in {} iterations",
        total.steps, total.work.newton_iterations, total.work.linear_solves, total.work.linear_iterations
    );
    if total.work.direct_solves() > 0 {
        text += &format!(", {} of them by elimination", total.work.direct_solves());
    }
    if total.work.substeps > 0 {
        text += &format!(", {} explicit substeps", total.work.substeps);
    }
    if total.work.path_steps > 0 {
        text += &format!(", {} path steps", total.work.path_steps);
    }
    let Retries { substeps, smoothed, shortened } = summary.safety;
    if total.rejected_steps > 0 {
        text += &format!("\nrejected {} steps", total.rejected_steps);
        let again = [(substeps, "with mesh sub-steps"), (smoothed, "with more smoothing"), (shortened, "shortened")];
        let again: Vec<String> = again.iter().filter(|(n, _)| *n > 0).map(|(n, how)| format!("{n} {how}")).collect();
        if !again.is_empty() {
            text += &format!(", tried again {}", again.join(", "));
        }
    }
    text += &format!("\nseconds  {:.2} (", s.wall);
    if s.interface > 0.0 {
        text += &format!("interface {:.2}, ", s.interface);
    }
    text + &format!(
        "mesh {:.2}, pde {:.2}, monitor {:.2}, output {:.2}), {} threads",
        s.mesh, s.pde, s.monitor, s.output, summary.parallel.threads
    )
}

/// How well the subdomains fit together at the last report.
fn interfaces(t: f64, interface: &Interface) -> String {
    let mut text = format!("between  {} interface points at t = {t}", interface.points);
    if let (Some(error), Some(noise)) = (interface.standard_error, interface.noise) {
        text += &format!(", standard error {error:.1e}, {noise:.1e} of the shortest edge");
    }
    if interface.sweeps > 0 {
        text += &format!(", {} sweeps a step", interface.sweeps);
    }
    if interface.walks == 0 && interface.contraction.is_none() {
        text += ", by strips alone";
    }
    if interface.read > 0 {
        let times = if interface.exchanges == 1 { "once".into() } else { format!("{} times", interface.exchanges) };
        text += &format!(", up to {} nodes read from neighbours {times} a step", interface.read);
    }
    if interface.gathered > 0 {
        text += &format!(", {} coarse ones gathered", interface.gathered);
    }
    if let Some(c) = interface.contraction {
        text += &format!(", {} iterations a step, contraction {:.3}", c.iterations, c.observed);
        if let Some(predicted) = c.predicted {
            text += &format!(" (at most {predicted:.3})");
        }
    }
    text + "\n"
}
