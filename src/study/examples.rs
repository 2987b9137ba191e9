use crate::error::{Error, Result};
use crate::output::write_file;
use include_dir::{Dir, include_dir};
use std::path::{Path, PathBuf};

/// The directory `studies/` of the sources.
static EXAMPLES: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/studies");

/// Writes the example studies, with what they read, into a directory, which is made where there is none, and returns
/// their files. What is there by the same names is kept.
///
/// # Errors
/// [`Error::Unwritable`].
pub fn write_examples(directory: &Path) -> Result<Vec<PathBuf>> {
    std::fs::create_dir_all(directory).map_err(Error::unwritable(directory))?;
    let mut paths = Vec::new();
    for file in EXAMPLES.files() {
        let path = directory.join(file.path());
        if !path.exists() {
            write_file(&path, file.contents())?;
        }
        paths.push(path);
    }
    paths.sort();
    Ok(paths)
}
