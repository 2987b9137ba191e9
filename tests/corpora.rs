//! Replays what the fuzzer found, and every study of ours.

use crate::targets;

fn replay(directory: &str, target: fn(&[u8])) {
    let entries = std::fs::read_dir(directory).unwrap();
    let files: Vec<_> = entries.map(|entry| entry.unwrap().path()).filter(|path| path.is_file()).collect();
    assert!(files.len() > 10, "{directory} holds {} files", files.len());
    files.iter().for_each(|file| target(&std::fs::read(file).unwrap()));
}

#[test]
fn formulas() {
    replay("fuzz/corpus/formula", targets::formula);
}

#[test]
fn lines() {
    replay("fuzz/corpus/equidistribution", targets::equidistribution);
}

#[test]
fn checkpoints() {
    replay("fuzz/corpus/checkpoint", targets::checkpoint);
}

#[test]
fn studies() {
    replay("fuzz/corpus/study", targets::study);
    replay("studies", targets::study);
}
