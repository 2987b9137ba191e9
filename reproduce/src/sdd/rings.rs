//! Figure 2 and the text of section 4.2: five prescribed rings.

use super::{NODES, RESIDUAL, RINGS, Ratios, WHOLE, Way, ended, first_step, monte_carlo, published, settings, study};
use crate::{Options, Table};
use driftmesh::error::Result;
use driftmesh::study::{Kind, MovingRun};

pub fn rings(options: Options) -> Result<Vec<Table>> {
    let all = published(&[(2, 0.05, 1.0, 1.0), (3, 0.05, 1.0, 1.0), (4, 0.05, 1.0, 1.0)]);
    let paper = if options.quick { all[2..].to_vec() } else { all };
    let paths = if options.quick { 1000 } else { 10_000 };
    let bare = settings(&["monitor.gradient=central", "monitor.smoothing=0"]);
    let mut ratios = Ratios::new(format!("Five rings: mesh quality on subdomains, {NODES}"), paper);
    let way = |label: &str, settings: &[String], estimator: String| Way::new(label, RINGS, settings, estimator);
    ratios.literal(&way("central, no smoothing, Monte Carlo N=10000 M=1", &bare, monte_carlo(10_000, 1)), false)?;
    ratios.unaided(&way("central, no smoothing, Monte Carlo N=10⁵ M=1", &bare, monte_carlo(100_000, 1)))?;
    let label = format!("central, no smoothing, Monte Carlo N={paths} M=10");
    ratios.unaided(&way(&label, &bare, monte_carlo(paths, 10)))?;
    let rescued = format!("central, no smoothing, Monte Carlo N={paths} M=1, rescued by [safety]");
    ratios.row(&way(&rescued, &bare, monte_carlo(paths, 1)))?;
    ratios.unaided(&way("central, no smoothing, residual walk", &bare, RESIDUAL.into()))?;
    ratios.row(&way("central, no smoothing, residual walk, rescued by [safety]", &bare, RESIDUAL.into()))?;
    ratios.unaided(&way(&format!("log, 4 passes, Monte Carlo N={paths} M=1"), &[], monte_carlo(paths, 1)))?;
    ratios.unaided(&way("log, 4 passes, residual walk", &[], RESIDUAL.into()))?;
    let mut table = ratios.table;
    table.note(first_step(RINGS, &bare, 5e-4, 10_000)?);
    table.note(
        "without smoothing the mesh is hardly determined: the rows on one domain above show how Q changes with \
         changes of u that no picture shows, and interface values that are off by as much do the same. Walks on the \
         lattice end there with steep-density: where |b|h is above 2 the weights of a node are no probabilities. \
         What [safety] lets them go on with is a smoother density, whose mesh has a smaller Q max: that makes R_max \
         large and says nothing of the paper's",
    );
    if options.quick {
        table.note(format!(
            "quick: {paths} paths in place of the paper's 10000 in the rows that say so, 4 × 4 subdomains only"
        ));
    }
    Ok(vec![one_domain(&bare)?, table])
}

/// Q on one domain, and how much of it is noise.
fn one_domain(bare: &[String]) -> Result<Table> {
    let mut table = Table::new(format!("Five rings on one domain, {NODES}"), &["density", "Q max", "Q mean"]);
    let rings = "tanh(30*(x^2 + y^2 - 1/8)) + tanh(30*((x-1/2)^2 + (y-1/2)^2 - 1/8)) + tanh(30*((x-1/2)^2 + \
         (y+1/2)^2 - 1/8)) + tanh(30*((x+1/2)^2 + (y-1/2)^2 - 1/8)) + tanh(30*((x+1/2)^2 + (y+1/2)^2 - 1/8))";
    let mut cases = vec![
        ("log gradient, 4 passes".to_string(), Vec::new()),
        ("central, no smoothing (literal)".into(), bare.to_vec()),
    ];
    // what has none of the symmetries of the rings
    for size in [1e-10, 1e-6, 1e-5, 1e-4] {
        let perturbed = format!("pde.u=\"{rings} + {size:e}*cos(pi*(17*x + 19*y) + 1)\"");
        cases.push((format!("the same, u + {size:e} cos(π(17x + 19y) + 1)"), [bare, &[perturbed]].concat()));
    }
    for (label, own) in cases {
        let all = [own.as_slice(), &settings(&super::NO_SAFETY), &[WHOLE.into()]].concat();
        let (MovingRun { record, .. }, failure) = study(RINGS, &all)?.compute()?;
        let quality = record.reports.last().map(|report| report.quality);
        let cells = match (failure, quality) {
            (None, Some(q)) => [q.q_max, q.q_mean].map(|q| format!("{q:.4}")),
            (failure, _) => [failure.map_or_else(|| "–".into(), |failure| ended(&failure)), "–".into()],
        };
        table.row([label].into_iter().chain(cells));
    }
    table.note("the paper has no Q of one domain, only that those of subdomains are the same");
    Ok(table)
}
