//! The published tables and figures, rerun: ours beside theirs, with a verdict for each row.

mod fronts;
mod interface_study;
mod laplacian;
mod payoff;
mod schwarz;
mod table;
mod tables;

pub use interface_study::{InterfaceStep, Measured};
pub use laplacian::slides_error;
pub use table::Table;

use crate::error::Result;
use crate::simulation::Picture;

/// Something published, or measured for this project, that can be rerun.
pub struct Item {
    /// Its name on the command line.
    pub name: &'static str,
    /// What it is, in a line.
    pub line: &'static str,
    run: fn(Options) -> Result<Rerun>,
}

/// What an item comes out as.
#[derive(Default)]
pub struct Rerun {
    /// Its tables.
    pub tables: Vec<Table>,
    /// Its pictures, each with the name of its files.
    pub pictures: Vec<(String, Picture)>,
}

impl From<Vec<Table>> for Rerun {
    fn from(tables: Vec<Table>) -> Self {
        Self { tables, pictures: Vec::new() }
    }
}

/// How an item is rerun.
#[derive(Debug, Clone, Copy, Default)]
pub struct Options {
    /// Fewer rows and samples: all items together in a minute or two.
    pub quick: bool,
}

/// Everything that can be rerun.
pub const ITEMS: &[Item] = &[
    Item {
        name: "table-1",
        line: "Burgers' front on 2×2, 3×3 and 4×4 subdomains",
        run: |options| tables::table_1(options).map(Rerun::from),
    },
    Item {
        name: "table-2",
        line: "time of a mesh step against the number of subdomains",
        run: |options| tables::table_2(options).map(Rerun::from),
    },
    Item {
        name: "table-3",
        line: "Burgers' equation on a periodic domain",
        run: |options| tables::table_3(options).map(Rerun::from),
    },
    Item {
        name: "table-4",
        line: "shallow water on a periodic domain",
        run: |options| tables::table_4(options).map(Rerun::from),
    },
    Item { name: "rings", line: "five prescribed rings", run: |options| tables::rings(options).map(Rerun::from) },
    Item {
        name: "interface-study",
        line: "error against work of all estimators of interface values, in one mesh step",
        run: |options| interface_study::run(options).map(Rerun::from),
    },
    Item {
        name: "payoff",
        line: "time to an error of 1e-2 against the viscosity, on moving and on uniform meshes",
        run: payoff::run,
    },
    Item {
        name: "laplacian-table",
        line: "the optimised Laplacian and its rivals on three meshes, and the slides' table",
        run: laplacian::run,
    },
    Item { name: "stefan-slides", line: "the slides' front between ice and water, with balances", run: fronts::slides },
    Item { name: "stefan-exact", line: "fronts against three exact solutions, by every method", run: fronts::exact },
    Item { name: "table-8-1", line: "the boundary layer by four Schwarz methods", run: schwarz::table_8_1 },
    Item {
        name: "figure-8-1",
        line: "classical Schwarz in one dimension against the overlap",
        run: schwarz::figure_8_1,
    },
    Item { name: "figure-8-2", line: "classical, optimised and optimal Schwarz", run: schwarz::figure_8_2 },
    Item { name: "figure-8-3", line: "meshes of the first iterations", run: schwarz::figure_8_3 },
    Item { name: "figure-8-4", line: "parallel and alternating, nonlinear and linearised", run: schwarz::figure_8_4 },
    Item {
        name: "figure-8-5",
        line: "densities that vary ever more, and where the linearised iteration never converges",
        run: schwarz::figure_8_5,
    },
    Item { name: "figure-8-6", line: "subdomains that move", run: schwarz::figure_8_6 },
    Item { name: "coarse", line: "a coarse correction for any number of subdomains", run: schwarz::coarse },
];

impl Item {
    /// Reruns it.
    ///
    /// # Errors
    /// Whatever ends one of its runs where that is not itself the result.
    pub fn run(&self, options: Options) -> Result<Rerun> {
        (self.run)(options)
    }
}
