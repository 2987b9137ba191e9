//! The report of a run, from its directory alone: `report.html` with a viewer of the moving mesh, plots, and an
//! animation.

mod animation;
mod files;
mod frame;
mod page;
mod plots;
mod tables;
mod viewer;

use crate::error::Result;
use crate::output::{Canvas, Picture, names, write_file};
use crate::parallel::join;
use files::RunFiles;
use std::path::{Path, PathBuf};

/// A report that was written.
#[derive(Debug, Clone)]
pub struct Built {
    /// The page.
    pub path: PathBuf,
    /// Size of the page in bytes.
    pub bytes: usize,
    /// Files that were damaged or left out.
    pub notes: Vec<String>,
}

/// (Re)builds `report.html` and the plots over time, with the picture of the mesh where there is none, and
/// `animation.gif` where the study asks for it.
///
/// The run may be finished, interrupted or still going on. Damaged files are left out, and named.
///
/// # Errors
/// [`Error::NotARun`](crate::Error::NotARun) for any other directory; [`Error::Unreadable`](crate::Error::Unreadable)
/// or [`Error::Unwritable`](crate::Error::Unwritable).
pub fn build(directory: &Path) -> Result<Built> {
    let mut run = RunFiles::read(directory)?;
    // A run that was killed has not drawn its mesh; one that is still going on draws it at its end.
    if !run.busy {
        animation::still(&mut run)?;
    }
    of(run, directory)
}

fn of(mut run: RunFiles, directory: &Path) -> Result<Built> {
    let plots = plots::of(&run);
    let pictures = || {
        // one file is drawn while another is written
        std::thread::scope(|scope| {
            let mut canvas = Canvas::default();
            let drawn = plots.iter().map(|(name, figure)| {
                let svg = figure.svg();
                let picture = Picture::of(&svg, &mut canvas);
                let written = scope.spawn(move || picture.write(directory, name));
                (page::Plot { title: figure.title.clone(), svg }, written)
            });
            let drawn: Vec<_> = drawn.collect();
            let finished = drawn.into_iter().map(|(plot, written)| {
                written.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)).map(|()| plot)
            });
            finished.collect::<Result<Vec<_>>>()
        })
    };
    let (drawn, viewer) = join(pictures, || viewer::Viewer::of(&mut run));
    let drawn = drawn?;
    if run.asks_for("animation") {
        animation::write(&mut run)?;
    }
    let html = page::render(&run, drawn, viewer.as_ref());
    let path = directory.join(names::REPORT);
    write_file(&path, html.as_bytes())?;
    Ok(Built { path, bytes: html.len(), notes: run.notes })
}

/// As [`build`], at the end of a run whose study asks for a report or an animation, with the status that it is to have.
pub(crate) fn finish(directory: &Path, report: bool, animation: bool, status: &str) -> Result<()> {
    if !report && !animation {
        return Ok(());
    }
    let mut run = RunFiles::read(directory)?;
    run.summary.insert("status".into(), status.into());
    if report { of(run, directory).map(|_| ()) } else { animation::write(&mut run) }
}
