use super::frame::{Frame, attribute};
use crate::error::{Error, Result};
use crate::output::{Checkpoints, RunDirectory, Standing, names};
use crate::parallel::map;
use serde_json::{Map, Value};
use std::path::{Path, PathBuf};

/// The files in a run directory.
pub struct RunFiles {
    pub directory: PathBuf,
    /// `summary.json`, in the order of the file.
    pub summary: Map<String, Value>,
    /// `study.toml`.
    pub study_text: String,
    /// `study.toml`, parsed as far as that is possible.
    pub study: toml::Table,
    /// `history.csv`, column by column.
    pub history: Vec<Column>,
    /// Frames of the run, and of the run of `[compare]`.
    pub series: [Series; 2],
    /// Whether a run is writing to the directory now, and whether there is a checkpoint from which it can go on.
    pub busy: bool,
    pub resumable: bool,
    /// Files that were damaged or left out.
    pub notes: Vec<String>,
}

/// A column of `history.csv`, with none in rows where it has no value.
pub struct Column {
    pub name: String,
    pub values: Vec<Option<f64>>,
}

/// Frames of a run over time, which are read when needed.
#[derive(Default)]
pub struct Series {
    /// Times, and files relative to the run directory.
    pub frames: Vec<(f64, String)>,
}

impl RunFiles {
    /// Reads everything but the frames.
    pub fn read(directory: &Path) -> Result<Self> {
        let not_a_run = |reason: String| Error::NotARun { path: directory.into(), reason };
        let text = match std::fs::read_to_string(directory.join(names::SUMMARY)) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound && directory.is_dir() => {
                return Err(not_a_run("it has no summary.json".into()));
            }
            Err(error) => return Err(not_a_run(error.to_string())),
        };
        let summary = match serde_json::from_str::<Value>(&text) {
            Ok(Value::Object(summary)) if summary.get("study").is_some_and(Value::is_string) => summary,
            Ok(_) => return Err(not_a_run("its summary.json names no study".into())),
            Err(error) => return Err(not_a_run(format!("its summary.json cannot be read: {error}"))),
        };
        let mut notes = Vec::new();
        let study_text = std::fs::read_to_string(directory.join(names::STUDY)).unwrap_or_else(|error| {
            notes.push(format!("study.toml is left out: {error}"));
            String::new()
        });
        let study = study_text.parse::<toml::Table>().unwrap_or_else(|_| {
            notes.push("study.toml is no TOML file".into());
            toml::Table::new()
        });
        let history = history(&directory.join(names::HISTORY), &mut notes);
        let series = [names::FRAMES, names::COMPARED].map(|[_, index]| Series::read(&directory.join(index)));
        if study.contains_key("compare") && series[1].frames.is_empty() {
            notes.push("the mesh of [compare] is not here: it is computed after the run itself".into());
        }
        if series[0].frames.is_empty() {
            notes.push("the mesh is not here: the run has written no frame".into());
        }
        let busy = RunDirectory::is_busy(directory);
        let unfinished = RunDirectory::standing(directory) == Standing::Unfinished;
        let resumable = unfinished || Checkpoints::are_in(directory);
        Ok(Self { directory: directory.into(), summary, study_text, study, history, series, busy, resumable, notes })
    }

    /// A value of the summary that is a text.
    pub fn word(&self, key: &str) -> &str {
        self.summary.get(key).and_then(Value::as_str).unwrap_or("")
    }

    /// A setting of the study, by the keys that lead to it.
    pub fn setting(&self, keys: &[&str]) -> Option<&toml::Value> {
        let (first, rest) = keys.split_first()?;
        rest.iter().try_fold(self.study.get(*first)?, |table, key| table.get(key))
    }

    /// A coordinate of a corner of the domain, `lower` or `upper`; none where it is no box.
    pub fn corner(&self, which: &str, d: usize) -> Option<f64> {
        if ["map", "top", "mesh"].into_iter().any(|key| self.setting(&["domain", key]).is_some()) {
            return None;
        }
        let value = self.setting(&["domain", which])?.get(d)?;
        value.as_float().or(value.as_integer().map(|n| n as f64))
    }

    /// Whether an axis is periodic.
    pub fn wraps(&self, d: usize) -> bool {
        self.setting(&["domain", "periodic"]).and_then(|axes| axes.get(d)?.as_bool()).unwrap_or(false)
    }

    /// Whether both ends of an axis are the same curve.
    pub fn closes(&self, d: usize) -> bool {
        self.setting(&["domain", "closed"]).and_then(|axes| axes.get(d)?.as_bool()).unwrap_or(false)
    }

    /// For a Stefan problem the index of the mesh line that is the front.
    pub fn front(&self) -> Option<usize> {
        let lower = || self.setting(&["grid", "cells"])?.get(1)?.as_integer();
        (self.word("kind") == "stefan").then(lower).flatten().and_then(|rows| usize::try_from(rows).ok())
    }

    /// Whether a switch in `[output]` of the study is on.
    pub fn asks_for(&self, what: &str) -> bool {
        self.setting(&["output", what]).and_then(toml::Value::as_bool).unwrap_or(false)
    }

    /// The frames of a series with these numbers. Damaged ones are left out, and named in the notes.
    pub fn frames(&mut self, series: usize, places: &[usize]) -> Vec<Frame> {
        let mut frames: Vec<Frame> = Vec::new();
        let files: Vec<&(f64, String)> = places.iter().map(|&place| &self.series[series].frames[place]).collect();
        let found = map(&files, |(t, name)| Frame::read(&self.directory.join(name), *t));
        for ((_, name), read) in files.into_iter().zip(found) {
            let read = read.and_then(|frame| match frames.first() {
                Some(first) if !first.fits(&frame) => Err("it is not of the same mesh as the frames before".into()),
                _ => Ok(frame),
            });
            match read {
                Ok(frame) => frames.push(frame),
                Err(reason) => {
                    let note = format!("{name} is left out: {reason}");
                    if !self.notes.contains(&note) {
                        self.notes.push(note);
                    }
                }
            }
        }
        frames
    }
}

impl Series {
    /// Reads a `.pvd` file as runs write it; empty where there is none.
    fn read(path: &Path) -> Self {
        let text = std::fs::read_to_string(path).unwrap_or_default();
        let entries = text.lines().filter(|line| line.starts_with("<DataSet "));
        let frames = entries.filter_map(|line| {
            let t: f64 = attribute(line, "timestep")?.parse().ok()?;
            let file = attribute(line, "file")?;
            // only files in the directory itself are read
            let inside = Path::new(&file).components().all(|part| matches!(part, std::path::Component::Normal(_)));
            (t.is_finite() && inside).then_some((t, file))
        });
        Self { frames: frames.collect() }
    }
}

/// Reads all whole rows: a run that was killed may leave part of one.
fn history(path: &Path, notes: &mut Vec<String>) -> Vec<Column> {
    let Ok(mut reader) = csv::Reader::from_path(path) else { return Vec::new() };
    let Ok(heads) = reader.headers().cloned() else { return Vec::new() };
    let mut columns: Vec<Column> = heads.iter().map(|name| Column { name: name.into(), values: Vec::new() }).collect();
    let mut broken = 0;
    for row in reader.records() {
        match row {
            Ok(row) => columns.iter_mut().zip(row.iter()).for_each(|(column, text)| {
                column.values.push(text.parse().ok().filter(|value: &f64| value.is_finite()));
            }),
            Err(_) => broken += 1,
        }
    }
    if broken > 0 {
        notes.push(format!("history.csv: {broken} row(s) are damaged and left out"));
    }
    columns
}
