//! Figure 2 and the text of section 4.2: five prescribed rings.

use super::{RESIDUAL, RINGS, Ratios, WHOLE, Way, ended, monte_carlo, published, settings, study};
use crate::{Options, Table};
use driftmesh::error::Result;
use driftmesh::study::compute;

pub fn rings(options: Options) -> Result<Vec<Table>> {
    let all = published(&[(2, 0.05, 1.0, 1.0), (3, 0.05, 1.0, 1.0), (4, 0.05, 1.0, 1.0)]);
    let paper = if options.quick { all[2..].to_vec() } else { all };
    let paths = if options.quick { 1000 } else { 10_000 };
    let bare = settings(&["monitor.gradient=central", "monitor.smoothing=0"]);
    let mut ratios = Ratios::new("Five rings: mesh quality on subdomains", paper);
    let way = |label: &str, settings: &[String], estimator: String| Way::new(label, RINGS, settings, estimator);
    ratios.literal(&way("central, no smoothing, Monte Carlo N=10000 M=1", &bare, monte_carlo(10_000, 1)), false)?;
    let rescued = format!("central, no smoothing, Monte Carlo N={paths} M=1, rescued by [safety]");
    ratios.row(&way(&rescued, &bare, monte_carlo(paths, 1)))?;
    ratios.row(&way("central, no smoothing, residual walk", &bare, RESIDUAL.into()))?;
    ratios.row(&way(&format!("log, 4 passes, Monte Carlo N={paths} M=1"), &[], monte_carlo(paths, 1)))?;
    ratios.row(&way("log, 4 passes, residual walk", &[], RESIDUAL.into()))?;
    let mut table = ratios.table;
    if options.quick {
        table.note(format!("quick: {paths} paths in place of the paper's 10000, 4 × 4 subdomains only"));
    }
    Ok(vec![one_domain(&bare)?, table])
}

/// Q on one domain, and how much of it is noise.
fn one_domain(bare: &[String]) -> Result<Table> {
    let mut table = Table::new("Five rings on one domain, 40 × 40 nodes", &["density", "Q max", "Q mean"]);
    for (label, settings) in [("log gradient, 4 passes", &[][..]), ("central, no smoothing (literal)", bare)] {
        let all = [settings, &super::settings(&super::NO_SAFETY), &[WHOLE.into()]].concat();
        let (record, failure) = compute(&study(RINGS, &all)?)?;
        let quality = record.reports.last().map(|report| report.quality);
        let cells = match (failure, quality) {
            (None, Some(q)) => [q.q_max, q.q_mean].map(|q| format!("{q:.4}")),
            (failure, _) => [failure.map_or_else(|| "–".into(), |failure| ended(&failure)), "–".into()],
        };
        table.row([label.to_string()].into_iter().chain(cells));
    }
    table.note("the paper has no Q of one domain, only that those of subdomains are the same");
    Ok(table)
}
