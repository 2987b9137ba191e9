//! The published tables and figures, rerun: ours beside theirs, with a verdict for each row.

mod interface_study;
mod table;

pub use interface_study::{InterfaceStep, Measured};
pub use table::Table;

use crate::error::Result;

/// Something published, or measured for this project, that can be rerun.
pub struct Item {
    /// Its name on the command line.
    pub name: &'static str,
    /// What it is, in a line.
    pub line: &'static str,
    run: fn(Options) -> Result<Vec<Table>>,
}

/// How an item is rerun.
#[derive(Debug, Clone, Copy, Default)]
pub struct Options {
    /// Fewer rows and samples: all items together in about a minute.
    pub quick: bool,
}

/// Everything that can be rerun.
pub const ITEMS: &[Item] = &[Item {
    name: "interface-study",
    line: "error against work of all estimators of interface values, in one mesh step",
    run: interface_study::run,
}];

impl Item {
    /// Reruns it.
    ///
    /// # Errors
    /// Whatever ends one of its runs where that is not itself the result.
    pub fn run(&self, options: Options) -> Result<Vec<Table>> {
        (self.run)(options)
    }
}
