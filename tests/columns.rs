//! The layout of the house: no line is wider than a screen, no file is longer than one thought.

use std::path::{Path, PathBuf};

/// Directories whose files are read; `fuzz` is data, and lock files are written by tools.
const DIRECTORIES: [&str; 10] =
    ["src", "cli", "reproduce", "python", "tests", "docs", "benches", "examples", "studies", "assets/report"];
/// Endings of text files that people write.
const TEXT: [&str; 9] = ["rs", "py", "pyi", "js", "css", "html", "toml", "md", "txt"];
/// Endings of files whose number of lines is limited.
const CODE: [&str; 4] = ["rs", "js", "css", "py"];
/// Most characters in a line, the width that rustfmt is set to.
const COLUMNS: usize = 120;
/// Most lines in a file of code.
const LINES: usize = 400;
/// Most lines in a file of tests, which are read one by one.
const LINES_OF_TESTS: usize = 600;

fn has_ending(path: &Path, endings: &[&str]) -> bool {
    path.extension().and_then(|ending| ending.to_str()).is_some_and(|ending| endings.contains(&ending))
}

/// All text files below a directory, but for hidden ones and what tools leave behind.
fn texts(directory: &Path) -> Vec<PathBuf> {
    let is_left_behind = |path: &Path| {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        name.starts_with('.') || ["target", "__pycache__"].contains(&name.as_str())
    };
    let entries = std::fs::read_dir(directory).unwrap().map(|entry| entry.unwrap().path());
    let all = entries.filter(|path| !is_left_behind(path));
    let each = |path: PathBuf| if path.is_dir() { texts(&path) } else { vec![path] };
    all.flat_map(each).filter(|path| has_ending(path, &TEXT)).collect()
}

/// All text files of the repository, and those at its root.
fn files(root: &Path) -> Vec<PathBuf> {
    let at_root = std::fs::read_dir(root).unwrap().map(|entry| entry.unwrap().path());
    let at_root = at_root.filter(|path| path.is_file() && has_ending(path, &["md", "toml"]));
    at_root.chain(DIRECTORIES.iter().flat_map(|directory| texts(&root.join(directory)))).collect()
}

#[test]
fn no_line_is_wider_than_120_columns() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let files = files(root);
    assert!(files.len() > 400, "only {} files were found: the test no longer reads them", files.len());
    let wide = files.iter().flat_map(|path| {
        let text = std::fs::read_to_string(path).unwrap();
        let name = path.strip_prefix(root).unwrap().display().to_string();
        let lines = text.lines().enumerate().map(|(i, line)| (i + 1, line.chars().count()));
        lines
            .filter(|(_, columns)| *columns > COLUMNS)
            .map(|(line, columns)| format!("{name}:{line}: {columns} columns"))
            .collect::<Vec<String>>()
    });
    let wide: Vec<String> = wide.collect();
    assert!(wide.is_empty(), "wider than {COLUMNS} columns:\n{}", wide.join("\n"));
}

#[test]
fn no_file_of_code_is_longer_than_400_lines_and_none_of_tests_than_600() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let code = files(root).into_iter().filter(|path| has_ending(path, &CODE));
    let long = code.filter_map(|path| {
        let lines = std::fs::read_to_string(&path).unwrap().lines().count();
        let path = path.strip_prefix(root).unwrap();
        let of_tests = path.ends_with("tests.rs") || path.iter().any(|part| part == "tests");
        let most = if of_tests { LINES_OF_TESTS } else { LINES };
        (lines > most).then(|| format!("{}: {lines} lines, {most} at most", path.display()))
    });
    let long: Vec<String> = long.collect();
    assert!(long.is_empty(), "too long:\n{}", long.join("\n"));
}

#[test]
fn every_file_of_tests_is_part_of_the_suite() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    for directory in ["tests", "cli/tests"] {
        let suite = std::fs::read_to_string(root.join(directory).join("suite.rs")).unwrap();
        let entries = std::fs::read_dir(root.join(directory)).unwrap().map(|entry| entry.unwrap().path());
        let names = entries.filter(|path| has_ending(path, &["rs"])).map(|path| path.file_stem().unwrap().to_owned());
        // ranks need an MPI library: a program of its own
        for name in names.filter(|name| name != "suite" && name != "ranks") {
            let module = format!("mod {};", name.display());
            assert!(suite.lines().any(|line| line == module), "{directory}/suite.rs lacks `{module}`");
        }
    }
}
