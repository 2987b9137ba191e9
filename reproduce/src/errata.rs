//! Tables of what is wrong in a paper.

use super::Table;

/// An empty table of the errata of a paper.
pub(super) fn table(paper: &str) -> Table {
    Table::new(
        format!("{paper}: what is wrong, and the check that shows it"),
        &["where", "printed", "should be", "check", "as printed", "as it should be", "verdict"],
    )
    .ruled("“erratum” where the check fails as printed and passes as it should be")
}

/// A row: four texts, what the check finds as printed and as it should be, and whether it passes.
pub(super) fn row(texts: [&str; 4], values: [String; 2], passes: [bool; 2]) -> Vec<String> {
    let said = match passes {
        [false, true] => "erratum",
        [true, _] => "as printed it holds",
        _ => "neither holds",
    };
    texts.into_iter().map(String::from).chain(values).chain([said.to_string()]).collect()
}
