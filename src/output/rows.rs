use crate::error::{Error, Result, Unfit};
use crate::kept::Kept;
use serde::Serialize;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// A table that grows while a run goes on, as CSV
///
/// Its file holds whole rows, also where the run is killed, or the disk full.
#[derive(Debug)]
pub struct Rows {
    path: PathBuf,
    file: File,
    /// Length of the file.
    length: u64,
    /// Rows that wait for the next flush, and those that a flush could not write.
    waiting: csv::Writer<Vec<u8>>,
    unwritten: Vec<u8>,
}

impl Rows {
    /// Starts the file.
    ///
    /// # Errors
    /// [`Error::Unwritable`].
    pub fn create(path: &Path) -> Result<Self> {
        let file = File::create(path).map_err(Error::unwritable(path))?;
        Ok(Self::of(path, file, 0))
    }

    fn of(path: &Path, file: File, length: u64) -> Self {
        Self { path: path.into(), file, length, waiting: table(length == 0), unwritten: Vec::new() }
    }

    /// Goes on behind the rows that a checkpoint knows of by the name of their file.
    ///
    /// # Errors
    /// [`Unfit`] where they are not there.
    pub fn resume(directory: &Path, name: &str, kept: &Kept) -> Result<Self, Unfit> {
        Self::reopen(&directory.join(name), kept.get(name)?)
    }

    /// Goes on behind the rows of a file that was `length` bytes long; later ones are dropped.
    ///
    /// # Errors
    /// [`Unfit`] where they are not there.
    pub fn reopen(path: &Path, length: u64) -> Result<Self, Unfit> {
        let file = name(path);
        let beside = |reason: String| Unfit::Beside { file: file.clone(), reason };
        let open = || -> std::io::Result<Result<File, Unfit>> {
            let mut rows = File::options().read(true).write(true).open(path)?;
            let there = rows.metadata()?.len();
            if there < length {
                return Ok(Err(beside(format!("it has {there} bytes of the {length} that it had"))));
            }
            let mut end = [0];
            rows.seek(SeekFrom::Start(length.saturating_sub(1)))?;
            rows.read_exact(&mut end)?;
            if end != *b"\n" {
                return Ok(Err(beside(format!("no row ends at byte {length}, where one did"))));
            }
            rows.set_len(length)?;
            rows.seek(SeekFrom::Start(length))?;
            Ok(Ok(rows))
        };
        let file = open().unwrap_or_else(|error| Err(beside(error.to_string())))?;
        Ok(Self::of(path, file, length))
    }

    /// All rows of a file below its heads, which hold numbers only.
    ///
    /// # Errors
    /// [`Unfit`] where they are not there, or hold something else.
    pub fn numbers(directory: &Path, file: &str) -> Result<Vec<Vec<f64>>, Unfit> {
        let beside = |reason: String| Unfit::Beside { file: file.into(), reason };
        let mut rows = csv::Reader::from_path(directory.join(file)).map_err(|error| beside(error.to_string()))?;
        let row = |row: csv::Result<csv::StringRecord>| -> Result<Vec<f64>, Unfit> {
            let row = row.map_err(|error| beside(error.to_string()))?;
            let number = |entry: &str| entry.parse().map_err(|_| beside(format!("{entry:?} is no number")));
            row.iter().map(number).collect()
        };
        rows.records().map(row).collect()
    }

    /// Adds a row; the first one of a struct has the names of its fields above it.
    ///
    /// # Errors
    /// [`Error::Unwritable`] for what is no row.
    pub fn add(&mut self, row: impl Serialize) -> Result<()> {
        self.waiting.serialize(row).map_err(Error::unwritable(&self.path))
    }

    /// Writes the rows that wait. Those for which there is no space go on waiting.
    ///
    /// # Errors
    /// [`Error::Unwritable`].
    pub fn flush(&mut self) -> Result<()> {
        let rows = std::mem::replace(&mut self.waiting, table(false)).into_inner();
        self.unwritten.extend(rows.map_err(Error::unwritable(&self.path))?);
        let written = self.file.write_all(&self.unwritten);
        let whole = match &written {
            Ok(()) => self.unwritten.len(),
            Err(_) => {
                // as much as there was space for, but no half of a row
                let bytes = self.file.stream_position().map_or(0, |end| end.saturating_sub(self.length) as usize);
                let there = &self.unwritten[..bytes.min(self.unwritten.len())];
                there.iter().rposition(|byte| *byte == b'\n').map_or(0, |end| end + 1)
            }
        };
        self.length += whole as u64;
        self.unwritten.drain(..whole);
        written.map_err(|error| {
            let end = SeekFrom::Start(self.length);
            let _ = self.file.set_len(self.length).and_then(|()| self.file.seek(end));
            Error::unwritable(&self.path)(error)
        })
    }

    /// Makes sure that all rows are on the disk. Returns how long the file is then.
    ///
    /// # Errors
    /// [`Error::Unwritable`].
    pub fn sync(&mut self) -> Result<u64> {
        self.flush()?;
        self.file.sync_data().map_err(Error::unwritable(&self.path))?;
        Ok(self.length)
    }

    /// Keeps what [`resume`](Self::resume) needs, with all rows on the disk.
    ///
    /// # Errors
    /// [`Error::Unwritable`].
    pub fn keep(&mut self, kept: &mut Kept) -> Result<()> {
        kept.put(&name(&self.path), &self.sync()?);
        Ok(())
    }
}

fn name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

impl Drop for Rows {
    /// What a run that ends early has not written yet.
    fn drop(&mut self) {
        let _ = self.flush();
    }
}

fn table(heads: bool) -> csv::Writer<Vec<u8>> {
    csv::WriterBuilder::new().has_headers(heads).from_writer(Vec::new())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A disk without space, where the system has one.
    #[test]
    fn rows_that_could_not_be_written_go_on_waiting() {
        let Ok(full) = File::options().write(true).open("/dev/full") else { return };
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("rows.csv");
        let mut rows = Rows::create(&path).unwrap();
        rows.add([1, 2]).unwrap();
        rows.flush().unwrap();
        rows.add([3, 4]).unwrap();
        let space = std::mem::replace(&mut rows.file, full);
        let error = rows.flush().unwrap_err();
        assert!(error.to_string().contains("rows.csv"), "{error}");
        rows.file = space;
        rows.add([5, 6]).unwrap();
        drop(rows);
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "1,2\n3,4\n5,6\n");
    }
}
