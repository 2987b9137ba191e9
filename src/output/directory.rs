use super::{Checkpoints, names};
use crate::error::{Error, Result};
use serde::Serialize;
use std::fs::File;
use std::io::Write;
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
        let directory = Self::open(path)?;
        directory.clear()?;
        Ok(directory)
    }

    /// Makes the directory ours as it stands: created if missing.
    ///
    /// # Errors
    /// As [`RunDirectory::claim`].
    pub fn open(path: &Path) -> Result<Self> {
        Self::check(path)?;
        std::fs::create_dir_all(path).map_err(Error::unwritable(path))?;
        let lock = File::create(path.join(LOCK)).map_err(Error::unwritable(path))?;
        lock.try_lock().map_err(|_| Error::Busy { path: path.into() })?;
        Ok(Self { path: path.into(), lock })
    }

    /// Removes what only a run that ended writes, and leaves checkpoints and what the run adds to.
    pub(crate) fn clear_ended(&self) -> Result<()> {
        let checkpoints = [&names::CHECKPOINTS[..], &[names::LAST_CHECKPOINT]].concat();
        self.clear_but(&[&[names::SUMMARY, names::STUDY], &names::GROWING[..], &checkpoints].concat())
    }

    /// Removes what an earlier run wrote, and nothing else.
    ///
    /// # Errors
    /// [`Error::Unwritable`].
    pub fn clear(&self) -> Result<()> {
        self.clear_but(&[])
    }

    fn clear_but(&self, keep: &[&str]) -> Result<()> {
        let path = &self.path;
        let is_kept = |name: &str| keep.contains(&name);
        let folders = [names::FRAMES[0], names::COMPARED[0]].into_iter().filter(|folder| !is_kept(folder));
        let frames = folders.flat_map(|folder| std::fs::read_dir(path.join(folder))).flatten().flatten();
        let old_frames = frames.map(|entry| entry.path()).filter(|frame| is_frame(frame));
        let files = names::files().filter(|name| !is_kept(name)).map(|name| path.join(name));
        let parts = names::files().map(|name| part(&path.join(name)));
        for old in files.chain(parts).chain(old_frames) {
            remove(&old)?;
        }
        // only an empty folder goes; what is not ours keeps it
        let _ = std::fs::remove_dir(path.join(names::COMPARED[0]));
        Ok(())
    }

    /// Whether a run writes there now.
    pub fn is_busy(path: &Path) -> bool {
        File::open(path.join(LOCK)).is_ok_and(|lock| lock.try_lock().is_err())
    }

    /// How far the run in a directory came.
    pub fn standing(path: &Path) -> Standing {
        let there = |name: &str| path.join(name).exists();
        if names::CHECKPOINTS.into_iter().any(there) {
            return Standing::Unfinished;
        }
        match summary(path) {
            // a run that was killed while it wrote its report has left its lock
            Some(summary) if summary["status"] == "completed" && !there(LOCK) => Standing::Complete,
            // after its last step, or while it goes on behind that to a later end
            _ if there(names::LAST_CHECKPOINT) => Standing::Unfinished,
            _ => Standing::Nothing,
        }
    }

    /// What the run in a directory warned of, as its `summary.json` says.
    pub fn warnings(path: &Path) -> Vec<String> {
        let summary = summary(path).unwrap_or_default();
        summary["warnings"].as_array().into_iter().flatten().filter_map(|w| Some(w.as_str()?.into())).collect()
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
        self.write(names::SUMMARY, text.as_bytes())
    }
}

impl Drop for RunDirectory {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(self.path.join(LOCK));
        let _ = self.lock.unlock();
    }
}

/// True for a frame, and for one that a run was writing when it was killed.
pub(crate) fn is_frame(path: &Path) -> bool {
    let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
    name.starts_with("step-") && (name.ends_with(".vtu") || name.ends_with(".vtu.part"))
}

/// What a directory holds of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Standing {
    /// Nothing to go on from.
    Nothing,
    /// Checkpoints, or the last state of a run that did not write everything, or that was to go on to a later end.
    Unfinished,
    /// A run that came to its end.
    Complete,
    /// A run that came to its end, where the study that is asked about ends later.
    Shorter,
}

/// True if a run of ours wrote this directory: its summary says so, a checkpoint, or the lock of a run that was killed
/// before.
fn wrote(path: &Path) -> bool {
    if path.join(LOCK).is_file() || Checkpoints::are_in(path) {
        return true;
    }
    // study.toml comes second: a disk may have been full then
    summary(path).is_some_and(|summary| {
        let started = summary["status"] == "running" || path.join(names::STUDY).is_file();
        started && summary["schema"].is_u64() && summary["study"].is_string()
    })
}

/// `summary.json`, if it can be read.
fn summary(path: &Path) -> Option<serde_json::Value> {
    serde_json::from_str(&std::fs::read_to_string(path.join(names::SUMMARY)).ok()?).ok()
}

/// The name that a file has until it is complete.
fn part(path: &Path) -> PathBuf {
    let mut part = path.as_os_str().to_owned();
    part.push(".part");
    part.into()
}

/// Removes a file, if it is there.
pub(crate) fn remove(path: &Path) -> Result<()> {
    match std::fs::remove_file(path) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => Err(Error::unwritable(path)(error)),
        _ => Ok(()),
    }
}

/// Writes a file under another name, and renames it when it is complete and on the disk.
pub(crate) fn write_file(path: &Path, contents: &[u8]) -> Result<()> {
    let part = part(path);
    let write = || {
        let mut file = File::create(&part)?;
        file.write_all(contents)?;
        file.sync_data()?;
        std::fs::rename(&part, path)
    };
    write().map_err(|error| {
        let _ = std::fs::remove_file(&part);
        Error::unwritable(path)(error)
    })
}

/// Makes sure that the names in a directory are on the disk.
pub(crate) fn sync_directory(path: &Path) -> Result<()> {
    // elsewhere directories cannot be opened, and renaming does it
    if cfg!(unix) {
        let synced = File::open(path).and_then(|directory| directory.sync_all());
        synced.map_err(Error::unwritable(path))?;
    }
    Ok(())
}
