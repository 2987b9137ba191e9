//! The floors of the house: a module may use only lower ones. ARCHITECTURE.md says why.

use std::path::{Path, PathBuf};

/// Lowest floor first; modules on one floor are siblings that do not know each other.
const FLOORS: [&[&str]; 10] = [
    &["elementary", "error"],
    &["formula", "kept", "kind", "parallel", "random", "setting", "stopwatch", "work"],
    &["geometry", "ranks"],
    &["numerics"],
    &["density", "equidistribution", "laplacian", "meshing", "physics"],
    &["mover", "species", "stefan"],
    &["simulation"],
    &["output"],
    &["report"],
    &["study"],
];

fn floor(module: &str) -> Option<usize> {
    FLOORS.iter().position(|modules| modules.contains(&module))
}

fn sources(directory: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(directory).unwrap().map(|entry| entry.unwrap().path());
    entries.flat_map(|path| if path.is_dir() { sources(&path) } else { vec![path] }).collect()
}

/// Modules that a source file names by `crate::…`, code examples in comments left out.
fn uses(text: &str) -> Vec<String> {
    let code = text.lines().filter(|line| !line.trim_start().starts_with("//"));
    let name = |rest: &str| rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>();
    code.flat_map(|line| line.split("crate::").skip(1).map(name).collect::<Vec<_>>()).collect()
}

#[test]
fn modules_use_only_lower_floors() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut checked = 0;
    for path in sources(&root) {
        let relative = path.strip_prefix(&root).unwrap();
        let module = relative.iter().next().unwrap().to_str().unwrap().trim_end_matches(".rs").to_string();
        if module == "lib" {
            continue;
        }
        let own = floor(&module).unwrap_or_else(|| panic!("{module} has no floor"));
        for used in uses(&std::fs::read_to_string(&path).unwrap()) {
            // re-exports at the root: Error, Failure, Result
            let Some(theirs) = floor(&used) else {
                assert!(
                    ["Auto", "Error", "Failure", "Result"].contains(&used.as_str()),
                    "{}: what is crate::{used}?",
                    path.display()
                );
                continue;
            };
            assert!(
                theirs < own || used == module,
                "{}: {module} (floor {own}) uses {used} (floor {theirs})",
                path.display()
            );
            checked += 1;
        }
    }
    assert!(checked > 50, "only {checked} uses were found: the test no longer reads them");
}
