//! The published tables and figures, rerun: ours beside theirs, with a verdict for each row.

mod errata;
mod interface_step;
mod interface_study;
mod page;
mod payoff;
mod schwarz;
mod sdd;
mod slides;
mod table;

pub use interface_step::{InterfaceStep, Measured};
pub use page::{Done, page};
pub use slides::slides_error;
pub use table::Table;

use Document::{Laplacian, Own, Schwarz, Stochastic};
use driftmesh::error::Result;
use driftmesh::output::Picture;

/// A document that is rerun.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Document {
    /// A. Bihlo, R. D. Haynes and E. J. Walsh (2015).
    Stochastic,
    /// M. J. Gander and R. D. Haynes (2012).
    Schwarz,
    /// S. J. Castillo and F. Izsák (2024).
    Laplacian,
    /// This project: what no document has.
    Own,
}

impl Document {
    /// All, in order.
    pub const ALL: [Self; 4] = [Self::Stochastic, Self::Schwarz, Self::Laplacian, Self::Own];

    /// Its title with authors and year.
    pub fn title(self) -> &'static str {
        match self {
            Self::Stochastic => {
                "A. Bihlo, R. D. Haynes and E. J. Walsh, Stochastic domain decomposition for time dependent adaptive \
                 mesh generation (2015)"
            }
            Self::Schwarz => {
                "M. J. Gander and R. D. Haynes, Domain decomposition approaches for mesh generation via the \
                 equidistribution principle (2012)"
            }
            Self::Laplacian => {
                "S. J. Castillo and F. Izsák, Efficient discretization of the Laplacian: application to moving \
                 boundary problems (2024)"
            }
            Self::Own => "Measured for this project",
        }
    }
}

/// Something published, or measured for this project, that can be rerun.
pub struct Item {
    /// Its name on the command line.
    pub name: &'static str,
    /// Where it is from.
    pub of: Document,
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
    /// Fewer rows and samples: all items together in five minutes.
    pub quick: bool,
}

const fn item(of: Document, name: &'static str, line: &'static str, run: fn(Options) -> Result<Rerun>) -> Item {
    Item { name, of, line, run }
}

/// Everything that can be rerun, document by document.
pub const ITEMS: &[Item] = &[
    item(Stochastic, "table-1", "Burgers' front on 2×2, 3×3 and 4×4 subdomains", |o| {
        sdd::table_1(o).map(Rerun::from)
    }),
    item(Stochastic, "table-2", "time of a mesh step against the number of subdomains", |_| {
        sdd::table_2().map(Rerun::from)
    }),
    item(Stochastic, "table-3", "Burgers' equation on a periodic domain", |o| sdd::table_3(o).map(Rerun::from)),
    item(Stochastic, "table-4", "shallow water on a periodic domain", |o| sdd::table_4(o).map(Rerun::from)),
    item(Stochastic, "rings", "five prescribed rings", |o| sdd::rings(o).map(Rerun::from)),
    item(
        Stochastic,
        "figures-1-3",
        "the meshes of Burgers' equation, the rings and shallow water, drawn",
        sdd::figures,
    ),
    item(
        Stochastic,
        "generators",
        "the linear generator of the inverse, and the equation not divided by ρ",
        sdd::generators,
    ),
    item(Stochastic, "coupling", "M^kP, M^vP, (MP)^l and (MP)^∞; paths on periodic meshes", sdd::coupling),
    item(Stochastic, "errata-sdd", "what is wrong in this document, with checks", |_| sdd::errata()),
    item(Schwarz, "theorems", "every theorem with its constants beside what is seen", |_| schwarz::theorems()),
    item(Schwarz, "table-8-1", "the boundary layer by four Schwarz methods", |_| schwarz::table_8_1()),
    item(Schwarz, "figure-8-1", "classical Schwarz in one dimension against the overlap", |_| schwarz::figure_8_1()),
    item(Schwarz, "figure-8-2", "classical, optimised and optimal Schwarz", |_| schwarz::figure_8_2()),
    item(Schwarz, "figure-8-3", "meshes of the first iterations", |_| schwarz::figure_8_3()),
    item(Schwarz, "figure-8-4", "parallel and alternating, nonlinear and linearised", |_| schwarz::figure_8_4()),
    item(Schwarz, "figure-8-5", "densities that vary ever more", |_| schwarz::figure_8_5()),
    item(Schwarz, "figure-8-6", "subdomains that move", |_| schwarz::figure_8_6()),
    item(Schwarz, "coarse", "coarse corrections for any number of subdomains", schwarz::coarse),
    item(Schwarz, "in-time", "optimal and optimised conditions in time", |_| schwarz::in_time()),
    item(Schwarz, "coupled", "mesh and equation together, and iterations stopped early", |_| schwarz::coupled()),
    item(Schwarz, "errata-schwarz", "what is wrong in this document, with checks", |_| schwarz::errata()),
    item(
        Laplacian,
        "laplacian-table",
        "the optimised Laplacian and its rivals, and the slides' table",
        slides::laplacian_table,
    ),
    item(Laplacian, "stefan-slides", "the slides' front between ice and water, with balances", slides::stefan_slides),
    item(Laplacian, "stefan-exact", "fronts against three exact solutions, by every method", slides::stefan_exact),
    item(Laplacian, "errata-slides", "what is wrong in this document, with checks", |_| slides::errata()),
    item(Own, "interface-study", "error against work of all estimators of interface values, in one mesh step", |o| {
        interface_study::run(o).map(Rerun::from)
    }),
    item(Own, "payoff", "time to an error of 1e-2 against the viscosity, on moving and on uniform meshes", payoff::run),
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Items that take seconds: every row is as long as its head, no cell is NaN, a verdict has its rule and each
    /// erratum its
    /// check.
    #[test]
    fn every_verdict_says_its_rule() {
        let mut names: Vec<&str> = ITEMS.iter().map(|item| item.name).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), ITEMS.len());
        let short = |item: &&Item| {
            item.of == Document::Schwarz && !["coupled", "coarse"].contains(&item.name)
                || item.name.starts_with("errata")
        };
        for item in ITEMS.iter().filter(short) {
            let rerun = item.run(Options { quick: true }).unwrap_or_else(|error| panic!("{}: {error}", item.name));
            for table in rerun.tables {
                let judged = table.columns.iter().any(|head| head.starts_with("verdict"));
                assert_eq!(judged, !table.rule.is_empty(), "{}", table.title);
                for row in &table.rows {
                    assert_eq!(row.len(), table.columns.len(), "{row:?}");
                    assert!(row.iter().all(|cell| !cell.contains("NaN")), "{row:?}");
                    if item.name.starts_with("errata") {
                        let said = &row[row.len() - 1];
                        assert!(said == "erratum" || said.starts_with("misprint"), "{row:?}");
                    }
                }
            }
        }
    }

    /// Table 8.1 to the paper's digits but in one place, and the counts of its first two rows.
    #[test]
    fn table_8_1_is_the_papers() {
        let table = schwarz::table_8_1().unwrap().tables.remove(0);
        let said = |method: &str, what: &str| {
            let row = table.rows.iter().find(|row| row[0].starts_with(method) && row[1] == what).unwrap();
            row[row.len() - 1].clone()
        };
        for method in ["nonlinear", "linearised"] {
            assert_eq!([said(method, "ours"), said(method, "solves, counted so")], ["agrees", "agrees"]);
        }
        assert_eq!(said("optimal", "ours"), "agrees");
        assert_eq!(said("optimised", "ours"), "not reproduced with our settings: n = 4: 0.0366, not 0.0367");
    }
}
