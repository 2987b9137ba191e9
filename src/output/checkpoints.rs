//! Checkpoints: a run that ends early goes on from the last one, to the same bits.

use super::directory::{remove, sync_directory, write_file};
use super::names;
use crate::error::{Error, Result, Unfit};
use crate::kept::encoded;
use crate::simulation::{Checkpoint, Keeper, Past, Schedule};
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
    /// Every n steps.
    Steps(usize),
    /// After the first step that ends at least this number of seconds after the last checkpoint.
    Seconds(f64),
}

impl Default for CheckpointsAt {
    fn default() -> Self {
        Self::Seconds(60.0)
    }
}

/// Largest number of seconds between checkpoints that may be set: a year.
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
    /// What a later end must know of the schedule; none for a study without time steps.
    #[serde(default)]
    past: Option<Past>,
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
    /// What a run that goes on must know of the times of this one.
    pub(crate) past: Option<Past>,
    /// Whether the one after the last step is written.
    ended: bool,
}

/// A checkpoint that was found, and may be meant for this study.
struct Found {
    name: &'static str,
    behind: Behind,
    content: ByteBuf,
    /// All of it, behind the checksum.
    sealed: Vec<u8>,
}

/// A run that goes on.
pub(crate) struct Resumed<T> {
    /// What was taken up.
    pub taken: T,
    /// Words on the newer checkpoints that were refused.
    pub refused: Vec<String>,
    /// The bytes of the checkpoint behind its checksum, for other ranks.
    pub sealed: Vec<u8>,
}

/// What a checkpoint says of the run that is to go on behind it.
pub(crate) struct Behind {
    /// Steps done.
    pub step: usize,
    past: Option<Past>,
    /// The end or the reports of its study, where this study has others.
    differs: Option<Unfit>,
}

impl Behind {
    /// Puts a schedule behind it. True where the run was complete, and the schedule ends later.
    ///
    /// # Errors
    /// [`Unfit`] where the schedule is no continuation.
    pub(crate) fn followed_by(&self, schedule: Option<&mut Schedule>) -> Result<bool, Unfit> {
        let later = match (&self.past, schedule) {
            (Some(past), Some(schedule)) => schedule.follow(past, self.step)?,
            _ => false,
        };
        match &self.differs {
            Some(unfit) if !later => Err(unfit.clone()),
            _ => Ok(later),
        }
    }
}

impl Checkpoints {
    /// The checkpoints of a run; `study` is the resolved study.
    ///
    /// # Errors
    /// [`Error::Unreadable`] where the study is no TOML.
    pub fn new(directory: &Path, at: CheckpointsAt, study: &str) -> Result<Self> {
        let study = numbers(study)
            .map_err(|reason| Error::Unreadable { path: directory.join(names::STUDY), reason: reason.to_string() })?;
        Ok(Self {
            directory: directory.into(),
            at,
            study,
            next: 0,
            newest: (None, Instant::now()),
            past: None,
            ended: false,
        })
    }

    /// Whether a directory holds one, by how it begins.
    pub(crate) fn are_in(directory: &Path) -> bool {
        let begins = |path: PathBuf| {
            let mut head = [0; MAGIC.len()];
            // what is no file may wait for somebody to write
            path.is_file() && File::open(path).and_then(|mut file| file.read_exact(&mut head)).is_ok() && head == MAGIC
        };
        names::CHECKPOINTS.into_iter().any(|name| begins(directory.join(name)))
    }

    /// Removes them: the run is over.
    pub(crate) fn remove(&self) -> Result<()> {
        names::CHECKPOINTS.into_iter().try_for_each(|name| remove(&self.directory.join(name)))
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
        self.write_as(names::CHECKPOINTS[self.next], step, content)?;
        self.next = 1 - self.next;
        Ok(())
    }

    /// Writes the one after the last step, once.
    ///
    /// # Errors
    /// [`Error::Unwritable`].
    pub(crate) fn write_last(&mut self, step: usize, content: &impl Serialize) -> Result<()> {
        if !self.ended {
            self.write_as(names::LAST_CHECKPOINT, step, content)?;
            self.ended = true;
        }
        Ok(())
    }

    fn write_as(&mut self, name: &str, step: usize, content: &impl Serialize) -> Result<()> {
        write_file(&self.directory.join(name), &self.sealed(step, content))?;
        sync_directory(&self.directory)?;
        self.newest = (Some(step), Instant::now());
        Ok(())
    }

    /// A checkpoint as the bytes of its file.
    fn sealed(&self, step: usize, content: &impl Serialize) -> Vec<u8> {
        let (content, past) = (ByteBuf::from(encoded(content)), self.past.clone());
        let (program, study) = (env!("CARGO_PKG_VERSION").into(), self.study.to_string());
        let sealed = encoded(&Sealed { program, study, step, past, content });
        [MAGIC, blake3::hash(&sealed).as_bytes(), &sealed].concat()
    }

    /// Goes on from the newest checkpoint that `take_up` accepts; none where there is no file. What was refused before
    /// it is told in words.
    ///
    /// # Errors
    /// [`Error::Checkpoint`] where there are files, but none that will do.
    pub(crate) fn resume<T, C: DeserializeOwned>(
        &mut self,
        mut take_up: impl FnMut(C, &Behind) -> Result<T, Unfit>,
    ) -> Result<Option<Resumed<T>>> {
        let mut refused = Vec::new();
        let mut found = Vec::new();
        for name in names::CHECKPOINTS.into_iter().chain([names::LAST_CHECKPOINT]) {
            match self.found(name) {
                Ok(None) => {}
                Ok(Some(one)) => found.push(one),
                Err(unfit) => refused.push((self.directory.join(name), unfit)),
            }
        }
        found.sort_by_key(|found| std::cmp::Reverse(found.behind.step));
        for Found { name, behind, content, sealed } in found {
            match decoded(&content).and_then(|content| take_up(content, &behind)) {
                Ok(taken) => {
                    self.next = usize::from(name == names::CHECKPOINTS[0]);
                    self.newest = (Some(behind.step), Instant::now());
                    let words = |(path, unfit): (PathBuf, Unfit)| {
                        format!("{} was left out: {unfit}; the run went on from {name}", path.display())
                    };
                    let refused = refused.into_iter().map(words).collect();
                    return Ok(Some(Resumed { taken, refused, sealed }));
                }
                Err(unfit) => refused.push((self.directory.join(name), unfit)),
            }
        }
        if refused.is_empty() { Ok(None) } else { Err(Error::Checkpoint { refused }) }
    }

    /// A checkpoint of this study, where there is a file of that name.
    fn found(&self, name: &'static str) -> Result<Option<Found>, Unfit> {
        match read(&self.directory.join(name)) {
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
            Err(error) => Err(Unfit::Damaged(error.to_string())),
            Ok(bytes) => {
                let sealed = opened(&bytes)?;
                let (behind, content) = meant(sealed, &self.study, name == names::LAST_CHECKPOINT)?;
                Ok(Some(Found { name, behind, content, sealed: sealed.to_vec() }))
            }
        }
    }

    /// What a checkpoint of this study is, and its content, from the bytes behind its checksum; the last one may be of
    /// a study with another end.
    pub(crate) fn read<C: DeserializeOwned>(&self, bytes: &[u8], last: bool) -> Result<(Behind, C), Unfit> {
        let (behind, content) = meant(bytes, &self.study, last)?;
        Ok((behind, decoded(&content)?))
    }

    /// What a complete run of the study with this text left, to go on from to a later end; none where the study is this
    /// very one.
    ///
    /// # Errors
    /// The file that is to blame, with what is wrong: [`Unfit::Study`] with the first key that differs, or
    /// [`Unfit::Missing`].
    pub(crate) fn behind(&self, text: &str) -> Result<Option<Behind>, (&'static str, Unfit)> {
        let of_study = |unfit: Unfit| (names::STUDY, unfit);
        let was = numbers(text).map_err(|error| of_study(Unfit::Damaged(error.message().into())))?;
        if unlike(&was, &self.study).is_none() {
            return Ok(None);
        }
        if let Some(unfit) = unlike(&unended(&was), &unended(&self.study)) {
            return Err(of_study(unfit));
        }
        match self.found(names::LAST_CHECKPOINT) {
            Ok(Some(found)) => Ok(Some(found.behind)),
            Ok(None) => Err((names::LAST_CHECKPOINT, Unfit::Missing)),
            Err(unfit) => Err((names::LAST_CHECKPOINT, unfit)),
        }
    }
}

impl<const D: usize> Keeper<D> for Checkpoints {
    fn due(&self, step: usize) -> bool {
        self.is_due(step)
    }

    fn keep(&mut self, checkpoint: &Checkpoint<D>, last: bool) -> Result<()> {
        match last {
            true => self.write_last(checkpoint.step, checkpoint),
            false => self.write(checkpoint.step, checkpoint),
        }
    }
}

/// The tables of a study that decide its numbers.
fn numbers(study: &str) -> Result<toml::Table, toml::de::Error> {
    let mut table: toml::Table = study.parse()?;
    table.remove("output");
    // a table of `[data]` is its content, wherever its file lies
    for (_, file) in table.get_mut("data").and_then(toml::Value::as_table_mut).into_iter().flatten() {
        file.as_table_mut().and_then(|file| file.remove("file"));
    }
    Ok(table)
}

/// Keys of `[time]` that may differ where a run goes on to a later end.
const OF_THE_END: [&str; 3] = ["end", "duration", "report"];

/// A study without time.end, time.duration and time.report, the keys that may differ on resuming.
fn unended(study: &toml::Table) -> toml::Table {
    let mut study = study.clone();
    if let Some(time) = study.get_mut("time").and_then(toml::Value::as_table_mut) {
        OF_THE_END.iter().for_each(|key| drop(time.remove(*key)));
    }
    study
}

/// The first key in which two studies differ.
fn unlike(was: &toml::Table, is: &toml::Table) -> Option<Unfit> {
    differing(was, is, "").map(|(key, was, is)| Unfit::Study { key, was, is })
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

/// The bytes behind the checksum of a file, if that is right.
fn opened(bytes: &[u8]) -> Result<&[u8], Unfit> {
    let sealed = bytes.strip_prefix(MAGIC).ok_or(Unfit::Foreign)?;
    let (checksum, rest) = sealed.split_first_chunk::<CHECKSUM>().ok_or(Unfit::Damaged("it ends early".into()))?;
    match blake3::hash(rest) == *checksum {
        true => Ok(rest),
        false => Err(Unfit::Damaged("its checksum does not match".into())),
    }
}

/// What these are and their content, if they are meant for this program and study; the last one may be so but for how
/// far its study goes.
fn meant(bytes: &[u8], study: &toml::Table, last: bool) -> Result<(Behind, ByteBuf), Unfit> {
    let Sealed { program, study: text, step, past, content } = decoded(bytes)?;
    if program != env!("CARGO_PKG_VERSION") {
        return Err(Unfit::Version { found: program });
    }
    let was = text.parse().map_err(|error: toml::de::Error| Unfit::Damaged(error.message().into()))?;
    let differs = unlike(&was, study);
    let refused = if last { unlike(&unended(&was), &unended(study)) } else { differs.clone() };
    match refused {
        Some(unfit) => Err(unfit),
        None => Ok((Behind { step, past, differs }, content)),
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
