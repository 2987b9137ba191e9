use crate::interrupts::{self, Interrupts};
use crate::terminal::{self, Status};
use crate::{StudyArgs, progress::Progress, tables::Told};
use clap::Args;
use driftmesh::Error;
use driftmesh::output::{RunDirectory, Standing, names};
use driftmesh::ranks::Ranks;
use driftmesh::simulation::Observer;
use driftmesh::study::{Begin, Finished, Study};
use std::path::{Path, PathBuf};

#[derive(Args)]
pub struct Run {
    #[command(flatten)]
    study: StudyArgs,
    /// Directory for the results; by default out/ and the name of the study.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Number of threads; by default all cores, or one for each rank where there are several. Results do not depend on
    /// it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Go on from the newest checkpoint in the directory; from the start where there is none.
    #[arg(long)]
    resume: bool,
    /// Show no progress and print no table.
    #[arg(long)]
    quiet: bool,
}

impl Run {
    pub fn execute(&self) -> driftmesh::Result<Status> {
        if self.resume && self.study.is_standard_input() {
            return Err(unrepeated());
        }
        let study = self.study.read()?;
        Ranks::here().agree("study", &format!("{}resume = {}", study.to_toml(), self.resume))?;
        let out = self.out.clone().unwrap_or_else(|| PathBuf::from("out").join(study.name()));
        // rank 0 looks into the directory, and says what it found
        let mut looked = None;
        let complete = Ranks::here().from_first(|| match looked.insert(self.is_complete(&study, &out)) {
            Ok(complete) => Ok(vec![u8::from(*complete)]),
            Err(error) => Err(error.to_string()),
        });
        looked.transpose()?;
        match complete.as_deref() {
            Ok([1]) => return Ok(self.succeeded(&out)),
            Ok(_) => {}
            Err(_) => return Ok(terminal::WRONG),
        }
        terminal::use_threads(self.threads)?;
        match &study {
            Study::MovingMesh(study) => self.watched(study, &out),
            Study::MovingLine(study) => self.watched(study, &out),
            Study::Poisson(study) => self.watched(study, &out),
            Study::Stefan(study) => self.watched(study, &out),
            Study::Species(study) => self.watched(study, &out),
            Study::Equidistribution(study) => self.watched(study, &out),
        }
    }

    /// Whether there is nothing left to do in a directory. What the user should know of it is said.
    fn is_complete(&self, study: &Study, out: &Path) -> driftmesh::Result<bool> {
        RunDirectory::check(out)?;
        match (study.standing(out), self.resume) {
            (Ok(Standing::Complete), true) => {
                if !self.quiet {
                    terminal::say(format_args!("complete: {} needs nothing more", out.display()));
                }
                if self.study.strict {
                    RunDirectory::warnings(out).iter().for_each(|warning| terminal::warn(warning));
                }
                return Ok(true);
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
        Ok(false)
    }

    /// Runs a study, and says how it went.
    fn watched<K: Told>(&self, study: &K, out: &Path) -> driftmesh::Result<Status> {
        let mut progress = Progress::new();
        // what nobody can end half-way ends with the program
        let mut interrupts = study.has_steps().then(Interrupts::listen);
        let mut watchers: Vec<&mut dyn Observer> = Vec::new();
        interrupts.iter_mut().for_each(|interrupts| watchers.push(interrupts));
        if !self.quiet && Ranks::here().is_first() {
            watchers.push(&mut progress);
        }
        let begin = if self.resume { Begin::Resumed } else { Begin::Anew };
        let finished = study.run(out, begin, &mut watchers);
        progress.clear();
        let Finished { summary, failure, .. } = match finished {
            Ok(finished) => finished,
            Err(error) => return Ok(terminal::complain(&error, study.remedy(&error), None)),
        };
        summary.warnings.iter().for_each(|warning| terminal::warn(warning));
        if !self.quiet {
            terminal::say(K::table(&summary));
            // whoever interrupted the run does not wait for more; all ranks compute it, since it may be another run
            if !matches!(failure.as_ref().map(Error::cause), Some(Error::Interrupted(_)))
                && let Some(line) = study.more(&summary)?
            {
                terminal::say(line);
            }
            let pictures = [("picture", names::MESH), ("front", names::FRONT), ("history", names::CONVERGENCE)];
            let pictures = pictures.map(|(label, name)| (label, format!("{name}.png")));
            terminal::say_files(out, pictures.into_iter().chain([("report", names::REPORT.into())]));
            terminal::say(format_args!("run      {}", out.display()));
        }
        match failure {
            None => Ok(self.succeeded(out)),
            Some(error) => {
                let note = format!("{} in {}", K::left(&summary), out.display());
                Ok(terminal::complain(&error, self.remedy(&error, out, study.remedy(&error)), Some(note)))
            }
        }
    }

    fn succeeded(&self, out: &Path) -> Status {
        terminal::succeeded(self.study.strict, &format!("the run is complete in {}", out.display()))
    }

    /// The remedy for what ended a run: where it can go on, the command for that.
    fn remedy(&self, error: &Error, out: &Path, other: Option<String>) -> Option<String> {
        let resumable = error.is_resumable() && RunDirectory::standing(out) == Standing::Unfinished;
        let command = || interrupts::command(self.study.is_standard_input(), out);
        let go_on = resumable.then(|| format!("go on with: {}", command()));
        Some([other, go_on].into_iter().flatten().collect::<Vec<_>>().join("; then ")).filter(|help| !help.is_empty())
    }
}

/// Going on takes the study once more, and standard input is read once.
fn unrepeated() -> Error {
    let rule = "a run goes on with a study in a file, since standard input is read once; the directory of a run holds \
                its study: driftmesh run DIR/study.toml --out DIR --resume";
    Error::invalid("--resume", "given with -", rule)
}
