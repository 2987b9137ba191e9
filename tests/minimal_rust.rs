//! The least version of Rust that `Cargo.toml` declares is true for everything below it.

use std::process::Command;

/// `1.89` or `1.85.0` as numbers that compare.
fn version(text: &str) -> Vec<u32> {
    let mut parts: Vec<u32> = text.split('.').map(|part| part.parse().unwrap()).collect();
    parts.resize(3, 0);
    parts
}

/// No dependency on any platform asks for a newer Rust than we do, and the README names the same. That our own code
/// needs no more is for Clippy to say (`incompatible_msrv`).
#[test]
fn the_declared_rust_is_enough_for_all_dependencies() {
    let root = env!("CARGO_MANIFEST_DIR");
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--locked"])
        .current_dir(root)
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let declared = env!("CARGO_PKG_RUST_VERSION");
    let packages = metadata["packages"].as_array().unwrap();
    assert!(packages.len() > 50, "{} packages", packages.len());
    for package in packages {
        if let Some(needed) = package["rust_version"].as_str() {
            let [name, at] = ["name", "version"].map(|key| package[key].as_str().unwrap());
            assert!(
                version(needed) <= version(declared),
                "{name} {at} needs Rust {needed}, and {declared} is declared"
            );
        }
    }
    let readme = include_str!("../README.md");
    assert!(readme.contains(&format!("Rust is all you need ({declared} or newer")), "the README names another Rust");
}
