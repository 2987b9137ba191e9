use crate::error::{Error, Result};
use serde::Serialize;
use std::fs::File;
use std::path::{Path, PathBuf};

/// The directory of one run
///
/// Claimed before anything is computed. It may be new, empty, or what an earlier run of ours left: then the files that
/// runs write are removed, and nothing else. Any other directory is refused.
#[derive(Debug)]
pub struct RunDirectory {
    path: PathBuf,
    /// Held while the run writes.
    lock: File,
}

/// Present and locked while a run writes.
const LOCK: &str = "run.lock";

/// Everything that a run may write, beside its frames.
const OURS: [&str; 29] = [
    "summary.json",
    "study.toml",
    "history.csv",
    "run.pvd",
    "compare.pvd",
    "final.npz",
    "report.html",
    "animation.gif",
    "mesh.png",
    "mesh.svg",
    "convergence.png",
    "convergence.svg",
    "front.csv",
    "front.png",
    "front.svg",
    "error.png",
    "error.svg",
    "quality.png",
    "quality.svg",
    "contraction.png",
    "contraction.svg",
    "energy.png",
    "energy.svg",
    "front-error.png",
    "front-error.svg",
    "front-position.png",
    "front-position.svg",
    "steps.png",
    "steps.svg",
];
/// Folders of frames: of the run, and of the one that it is compared with.
const FRAMES: [&str; 2] = ["frames", "compare"];

impl RunDirectory {
    /// Refuses a directory that [`RunDirectory::claim`] would refuse, touching nothing.
    ///
    /// # Errors
    /// [`Error::ForeignDirectory`], or [`Error::Unreadable`] where it cannot be listed.
    pub fn check(path: &Path) -> Result<()> {
        let unreadable = |error: std::io::Error| Error::Unreadable { path: path.into(), reason: error.to_string() };
        let foreign = |found: String| Err(Error::ForeignDirectory { path: path.into(), found });
        match std::fs::symlink_metadata(path) {
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(()),
            Err(error) => return Err(unreadable(error)),
            Ok(_) if !path.is_dir() => return foreign("a file of that name".into()),
            Ok(_) => {}
        }
        let mut entries = std::fs::read_dir(path).map_err(unreadable)?;
        match entries.next() {
            None => Ok(()),
            Some(_) if wrote(path) => Ok(()),
            Some(entry) => foreign(entry.map_err(unreadable)?.file_name().to_string_lossy().into_owned()),
        }
    }

    /// Makes the directory ours: created if missing, cleared of an earlier run.
    ///
    /// # Errors
    /// As [`RunDirectory::check`], or [`Error::Unwritable`].
    pub fn claim(path: &Path) -> Result<Self> {
        Self::check(path)?;
        let unwritable =
            |path: &Path, error: std::io::Error| Error::Unwritable { path: path.into(), reason: error.to_string() };
        std::fs::create_dir_all(path).map_err(|error| unwritable(path, error))?;
        let lock = File::create(path.join(LOCK)).map_err(|error| unwritable(path, error))?;
        lock.try_lock().map_err(|_| Error::Busy { path: path.into() })?;
        let folders = FRAMES.into_iter().map(|folder| std::fs::read_dir(path.join(folder)));
        let frames = folders.flatten().flatten().flatten().map(|entry| entry.path());
        let old_frames = frames.filter(|frame| is_frame(frame));
        for old in OURS.into_iter().map(|name| path.join(name)).chain(old_frames) {
            match std::fs::remove_file(&old) {
                Err(error) if error.kind() != std::io::ErrorKind::NotFound => return Err(unwritable(&old, error)),
                _ => {}
            }
        }
        // only an empty folder goes; what is not ours keeps it
        let _ = std::fs::remove_dir(path.join(FRAMES[1]));
        Ok(Self { path: path.into(), lock })
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes one file, which bears its name only once it is complete.
    ///
    /// # Errors
    /// [`Error::Unwritable`].
    pub fn write(&self, name: &str, contents: &[u8]) -> Result<()> {
        write_file(&self.path.join(name), contents)
    }

    /// Writes `summary.json`, of any kind of study.
    ///
    /// # Errors
    /// [`Error::Unwritable`].
    pub fn write_summary(&self, summary: &impl Serialize) -> Result<()> {
        let mut text = serde_json::to_string_pretty(summary).expect("a summary is plain data");
        text.push('\n');
        self.write("summary.json", text.as_bytes())
    }
}

impl Drop for RunDirectory {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(self.path.join(LOCK));
        let _ = self.lock.unlock();
    }
}

fn is_frame(path: &Path) -> bool {
    let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
    name.starts_with("step-") && name.ends_with(".vtu")
}

/// True if a run of ours wrote this directory: its summary says so, or the lock of a run that was killed before.
fn wrote(path: &Path) -> bool {
    if path.join(LOCK).is_file() {
        return true;
    }
    let Ok(text) = std::fs::read_to_string(path.join("summary.json")) else { return false };
    let Ok(summary) = serde_json::from_str::<serde_json::Value>(&text) else { return false };
    summary["schema"].is_u64() && summary["study"].is_string() && path.join("study.toml").is_file()
}

/// Writes a file under another name and renames it when it is complete.
pub(crate) fn write_file(path: &Path, contents: &[u8]) -> Result<()> {
    let mut part = path.as_os_str().to_owned();
    part.push(".part");
    let part = PathBuf::from(part);
    std::fs::write(&part, contents).and_then(|()| std::fs::rename(&part, path)).map_err(|error| {
        let _ = std::fs::remove_file(&part);
        Error::Unwritable { path: path.into(), reason: error.to_string() }
    })
}
