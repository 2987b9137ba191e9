//! Checkpoints: a run that ends early goes on from the last one, to the same bits.

use super::directory::{remove, sync_directory, write_file};
use crate::error::{Error, Result, Unfit};
use crate::kept::encoded;
use crate::simulation::{Checkpoint, Keeper};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize, de::DeserializeOwned};
use serde_bytes::ByteBuf;
use std::fs::File;
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// `output.checkpoint`: when a checkpoint is written.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum CheckpointsAt {
    /// After so many steps each.
    Steps(usize),
    /// After the first step that ends so many seconds after the last checkpoint.
    Seconds(f64),
}

impl Default for CheckpointsAt {
    fn default() -> Self {
        Self::Seconds(60.0)
    }
}

/// A year, above which nobody means it.
const LONGEST: f64 = 3.2e7;

impl CheckpointsAt {
    /// Refuses settings out of range.
    ///
    /// # Errors
    /// [`Error::Invalid`] for steps = 0, and seconds that are not above 0 and at most a year.
    pub fn check(&self) -> Result<()> {
        match *self {
            Self::Steps(0) => Err(Error::invalid("checkpoint.steps", 0, "must be 1 or more")),
            Self::Seconds(seconds) if !(seconds > 0.0 && seconds <= LONGEST) => {
                Err(Error::invalid("checkpoint.seconds", seconds, "must be above 0 and at most 3.2e7, a year"))
            }
            Self::Steps(_) | Self::Seconds(_) => Ok(()),
        }
    }
}

/// What a file begins with: the name of the format, and its version.
const MAGIC: &[u8] = b"driftmesh checkpoint 1\n";
/// Bytes of the checksum behind it.
const CHECKSUM: usize = blake3::OUT_LEN;

/// What is read first: whether the content is meant for this program and this study.
#[derive(Serialize, Deserialize)]
struct Sealed {
    program: String,
    /// The resolved study without `[output]`, which changes no number.
    study: String,
    step: usize,
    /// A value as MessagePack, which depends on the kind of the study.
    content: ByteBuf,
}

/// The checkpoints of a run directory.
#[derive(Debug)]
pub(crate) struct Checkpoints {
    directory: PathBuf,
    at: CheckpointsAt,
    study: toml::Table,
    /// Which of the two is written next.
    next: usize,
    /// The step of the newest, and when it was written.
    newest: (Option<usize>, Instant),
    /// Whether one is written after the last step too, since much is left to do then.
    pub(crate) at_the_end: bool,
}

/// A checkpoint that was found, and is meant for this study.
struct Found {
    slot: usize,
    step: usize,
    content: ByteBuf,
}

impl Checkpoints {
    /// The newest and the one before, written in turns.
    pub(crate) const NAMES: [&str; 2] = ["checkpoint.0", "checkpoint.1"];

    /// The checkpoints of a run; `study` is the resolved study.
    ///
    /// # Errors
    /// [`Error::Unreadable`] where the study is no TOML.
    pub fn new(directory: &Path, at: CheckpointsAt, study: &str) -> Result<Self> {
        let study = numbers(study)
            .map_err(|reason| Error::Unreadable { path: directory.join("study.toml"), reason: reason.to_string() })?;
        Ok(Self { directory: directory.into(), at, study, next: 0, newest: (None, Instant::now()), at_the_end: false })
    }

    /// Whether a directory holds one, by how it begins.
    pub(crate) fn are_in(directory: &Path) -> bool {
        let begins = |path: PathBuf| {
            let mut head = [0; MAGIC.len()];
            // what is no file may wait for somebody to write
            path.is_file() && File::open(path).and_then(|mut file| file.read_exact(&mut head)).is_ok() && head == MAGIC
        };
        Self::NAMES.into_iter().any(|name| begins(directory.join(name)))
    }

    /// Removes them: the run is over.
    pub(crate) fn remove(&self) -> Result<()> {
        Self::NAMES.into_iter().try_for_each(|name| remove(&self.directory.join(name)))
    }

    /// Whether one is to be written after a step.
    pub(crate) fn is_due(&self, step: usize) -> bool {
        match self.at {
            CheckpointsAt::Steps(steps) => step > 0 && step.is_multiple_of(steps),
            CheckpointsAt::Seconds(seconds) => self.newest.1.elapsed() >= Duration::from_secs_f64(seconds),
        }
    }

    /// Writes one over the older of the two, unless the newest is of the same step. Whatever happens meanwhile, the
    /// newer of the two stays.
    ///
    /// # Errors
    /// [`Error::Unwritable`].
    pub(crate) fn write(&mut self, step: usize, content: &impl Serialize) -> Result<()> {
        if self.newest.0 == Some(step) {
            return Ok(());
        }
        write_file(&self.directory.join(Self::NAMES[self.next]), &sealed(&self.study, step, content))?;
        sync_directory(&self.directory)?;
        self.next = 1 - self.next;
        self.newest = (Some(step), Instant::now());
        Ok(())
    }

    /// Goes on from the newest checkpoint that `take_up` accepts; none where there is no file. What was refused before
    /// it is told in words.
    ///
    /// # Errors
    /// [`Error::Checkpoint`] where there are files, but none that will do.
    pub(crate) fn resume<T, C: DeserializeOwned>(
        &mut self,
        mut take_up: impl FnMut(C) -> Result<T, Unfit>,
    ) -> Result<Option<(T, Vec<String>)>> {
        let mut refused = Vec::new();
        let mut found = Vec::new();
        for (slot, path) in Self::NAMES.iter().map(|name| self.directory.join(name)).enumerate() {
            match read(&path) {
                Err(error) if error.kind() == std::io::ErrorKind::NotFound => {}
                Err(error) => refused.push((path, Unfit::Damaged(error.to_string()))),
                Ok(bytes) => match opened(&bytes).and_then(|bytes| meant(bytes, &self.study)) {
                    Ok((step, content)) => found.push(Found { slot, step, content }),
                    Err(unfit) => refused.push((path, unfit)),
                },
            }
        }
        found.sort_by_key(|found| std::cmp::Reverse(found.step));
        for Found { slot, step, content } in found {
            match decoded(&content).and_then(&mut take_up) {
                Ok(taken) => {
                    self.next = 1 - slot;
                    self.newest = (Some(step), Instant::now());
                    let words = |(path, unfit): (PathBuf, Unfit)| {
                        format!("{} was left out: {unfit}; the run went on from {}", path.display(), Self::NAMES[slot])
                    };
                    return Ok(Some((taken, refused.into_iter().map(words).collect())));
                }
                Err(unfit) => refused.push((self.directory.join(Self::NAMES[slot]), unfit)),
            }
        }
        if refused.is_empty() { Ok(None) } else { Err(Error::Checkpoint { refused }) }
    }

    /// The step and the content of a checkpoint of this study from the bytes behind its checksum.
    pub(crate) fn read<C: DeserializeOwned>(&self, bytes: &[u8]) -> Result<(usize, C), Unfit> {
        let (step, content) = meant(bytes, &self.study)?;
        Ok((step, decoded(&content)?))
    }

    /// Refuses another study than the one whose text is given.
    ///
    /// # Errors
    /// [`Unfit::Study`] with the first key that differs.
    pub(crate) fn check_study(&self, text: &str) -> Result<(), Unfit> {
        let was = numbers(text).map_err(|error| Unfit::Damaged(error.message().into()))?;
        match differing(&was, &self.study, "") {
            None => Ok(()),
            Some((key, was, is)) => Err(Unfit::Study { key, was, is }),
        }
    }
}

impl<const D: usize> Keeper<D> for Checkpoints {
    fn due(&self, step: usize, last: bool) -> bool {
        if last { self.at_the_end } else { self.is_due(step) }
    }

    fn keep(&mut self, checkpoint: &Checkpoint<D>) -> Result<()> {
        self.write(checkpoint.step, checkpoint)
    }
}

/// The tables of a study that decide its numbers.
fn numbers(study: &str) -> Result<toml::Table, toml::de::Error> {
    let mut table: toml::Table = study.parse()?;
    table.remove("output");
    Ok(table)
}

/// The first key in which two studies differ, with both values.
fn differing(was: &toml::Table, is: &toml::Table, path: &str) -> Option<(String, String, String)> {
    for key in was.keys().chain(is.keys().filter(|key| !was.contains_key(key.as_str()))) {
        let full = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
        let inner = match (was.get(key), is.get(key)) {
            (Some(toml::Value::Table(was)), Some(toml::Value::Table(is))) => differing(was, is, &full),
            (was, is) if was == is => None,
            (was, is) => {
                let said = |value: Option<&toml::Value>| value.map_or("not given".into(), |value| value.to_string());
                Some((full, said(was), said(is)))
            }
        };
        if inner.is_some() {
            return inner;
        }
    }
    None
}

/// A checkpoint as the bytes of its file.
fn sealed(study: &toml::Table, step: usize, content: &impl Serialize) -> Vec<u8> {
    let content = ByteBuf::from(encoded(content));
    let sealed =
        encoded(&Sealed { program: env!("CARGO_PKG_VERSION").into(), study: study.to_string(), step, content });
    [MAGIC, blake3::hash(&sealed).as_bytes(), &sealed].concat()
}

/// The bytes behind the checksum of a file, if that is right.
fn opened(bytes: &[u8]) -> Result<&[u8], Unfit> {
    let sealed = bytes.strip_prefix(MAGIC).ok_or(Unfit::Foreign)?;
    let (checksum, rest) = sealed.split_first_chunk::<CHECKSUM>().ok_or(Unfit::Damaged("it ends early".into()))?;
    match blake3::hash(rest) == *checksum {
        true => Ok(rest),
        false => Err(Unfit::Damaged("its checksum does not match".into())),
    }
}

/// The step and the content of these, if they are meant for this program and study.
fn meant(bytes: &[u8], study: &toml::Table) -> Result<(usize, ByteBuf), Unfit> {
    let Sealed { program, study: text, step, content } = decoded(bytes)?;
    if program != env!("CARGO_PKG_VERSION") {
        return Err(Unfit::Version { found: program });
    }
    let was = text.parse().map_err(|error: toml::de::Error| Unfit::Damaged(error.message().into()))?;
    match differing(&was, study, "") {
        Some((key, was, is)) => Err(Unfit::Study { key, was, is }),
        None => Ok((step, content)),
    }
}

/// A value from any bytes: nothing is allocated that they do not hold.
fn decoded<C: DeserializeOwned>(content: &[u8]) -> Result<C, Unfit> {
    rmp_serde::from_slice(content).map_err(|error| Unfit::Damaged(error.to_string()))
}

/// The bytes of a file; what else bears its name is no checkpoint, and may not be waited for.
fn read(path: &Path) -> std::io::Result<Vec<u8>> {
    match std::fs::metadata(path)?.is_file() {
        true => std::fs::read(path),
        false => Err(std::io::Error::other("it is no file")),
    }
}
