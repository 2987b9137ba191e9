//! Tables 3 and 4: Burgers' equation and shallow water on periodic domains.

use super::{DAM_BREAK, NODES, PERIODIC, RESIDUAL, Ratios, Way, first_step, monte_carlo, published, settings, study};
use crate::{Options, Table};
use driftmesh::error::Result;
use driftmesh::study::{Kind, MovingRun};

pub fn table_3(options: Options) -> Result<Vec<Table>> {
    let all = published(&[
        (2, 0.85, 0.99, 1.0),
        (2, 1.0, 0.99, 1.0),
        (3, 0.85, 1.0, 1.0),
        (3, 1.0, 0.99, 1.0),
        (4, 0.85, 0.99, 1.0),
        (4, 1.0, 0.99, 1.0),
    ]);
    let paper = if options.quick { all[4..].to_vec() } else { all };
    let mut ratios = Ratios::new(format!("Table 3: Burgers' equation on a periodic domain, {NODES}"), paper);
    let way = |label: &str, settings: &[String], estimator: String| Way::new(label, PERIODIC, settings, estimator);
    let (bare, smoothed) = (settings(&["monitor.smoothing=0"]), Vec::new());
    ratios.literal(&way("no smoothing, Monte Carlo N=1000 M=1", &bare, monte_carlo(1000, 1)), !options.quick)?;
    ratios.unaided(&way("no smoothing, Monte Carlo N=10⁵ M=1", &bare, monte_carlo(100_000, 1)))?;
    ratios.unaided(&way("no smoothing, Monte Carlo N=1000 M=10", &bare, monte_carlo(1000, 10)))?;
    ratios.unaided(&way("2 passes, Monte Carlo N=1000 M=1", &smoothed, monte_carlo(1000, 1)))?;
    ratios.unaided(&way("2 passes, Monte Carlo N=1000 M=10", &smoothed, monte_carlo(1000, 10)))?;
    if !options.quick {
        let rescued = "2 passes, Monte Carlo N=1000 M=1, rescued by [safety]";
        ratios.row(&way(rescued, &smoothed, monte_carlo(1000, 1)))?;
        ratios.unaided(&way("2 passes, Monte Carlo N=10⁴ M=1", &smoothed, monte_carlo(10_000, 1)))?;
        ratios.unaided(&way("2 passes, Monte Carlo N=3000 M=10", &smoothed, monte_carlo(3000, 10)))?;
    }
    ratios.unaided(&way("2 passes, residual walk", &smoothed, RESIDUAL.into()))?;
    let mut table = ratios.table;
    table.note(first_step(PERIODIC, &bare, 5e-3, 1000)?);
    table.note("the paper gives neither the strength of the density here (10, relative, is taken) nor its smoothing");
    table.note("no row is helped by [safety] but those that say so");
    if options.quick {
        table.note("quick: 4 × 4 subdomains only, no rescued rows, and no more than 1000 paths with M = 10");
    }
    Ok(vec![table])
}

pub fn table_4(options: Options) -> Result<Vec<Table>> {
    let all = published(&[
        (2, 0.05, 0.99, 1.0),
        (2, 0.15, 0.99, 1.0),
        (3, 0.05, 0.97, 1.0),
        (3, 0.15, 0.99, 1.0),
        (4, 0.05, 0.99, 1.0),
        (4, 0.15, 0.99, 1.0),
    ]);
    let paper = if options.quick { all[4..].to_vec() } else { all };
    let mut ratios = Ratios::new(format!("Table 4: shallow water on a periodic domain, {NODES}"), paper);
    let way = |label: &str, settings: &[String], estimator: String| Way::new(label, DAM_BREAK, settings, estimator);
    let bare = settings(&["monitor.smoothing=0", "monitor.gradient=central"]);
    let advective = [bare.as_slice(), &settings(&["pde.form=advective"])].concat();
    ratios.literal(&way("advective, Monte Carlo N=1000 M=1", &advective, monte_carlo(1000, 1)), true)?;
    ratios.unaided(&way("advective, Monte Carlo N=10⁵ M=1", &advective, monte_carlo(100_000, 1)))?;
    ratios.unaided(&way("advective, Monte Carlo N=1000 M=10", &advective, monte_carlo(1000, 10)))?;
    let paths = if options.quick { 3000 } else { 30_000 };
    ratios.unaided(&way(&format!("flux form, Monte Carlo N={paths} M=10"), &bare, monte_carlo(paths, 10)))?;
    ratios.unaided(&way("flux form, residual walk", &bare, RESIDUAL.into()))?;
    ratios.unaided(&way("flux form, 4 passes, log gradient, residual walk", &[], RESIDUAL.into()))?;
    let mut table = ratios.table;
    table.note(
        "the paper gives neither the shape of the pile nor the strength: h = 10 + 1.25 (1 − tanh((r − 1)/.3)) and an \
         absolute .2 are taken. ∇ρ is by central differences of ρ and ρ has no filter where a row does not say \
         otherwise; no row is helped by [safety] but the one that says so",
    );
    table.note(first_step(DAM_BREAK, &advective, 5e-3, 1000)?);
    if options.quick {
        table.note(format!("quick: 4 × 4 subdomains only, and {paths} paths in place of 30000 in flux form"));
    }
    let (flux, advective) = (drift(&[])?, drift(&settings(&["pde.form=advective"]))?);
    table.note(format!(
        "mass drifts by {flux:.1e} of itself in flux form and by {advective:.1e} in the paper's advective form, to t \
         = .15"
    ));
    Ok(vec![table])
}

/// Relative drift of the mass over the dam break.
fn drift(settings: &[String]) -> Result<f64> {
    let (MovingRun { record, .. }, failure) = study(DAM_BREAK, settings)?.compute()?;
    failure.map_or_else(|| Ok(record.reports.last().map_or(f64::NAN, |report| report.conserved.drift)), Err)
}
