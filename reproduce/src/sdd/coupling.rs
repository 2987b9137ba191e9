//! Section 5: M^kP, M^vP, (MP)^l and (MP)^∞, and how many paths periodic meshes need.

use super::table_2::state_of;
use super::{BURGERS, PERIODIC, RESIDUAL, WHOLE, ended, settings, stochastic, study};
use crate::{InterfaceStep, Options, Rerun, Table};
use driftmesh::error::Result;
use driftmesh::meshing::{EstimatorKind, Mmpde, MonteCarlo};
use driftmesh::study::compute;

pub fn coupling(options: Options) -> Result<Rerun> {
    Ok(vec![procedures(options)?, paths()?].into())
}

fn procedures(options: Options) -> Result<Table> {
    let mut table = Table::new(
        "M^kP, M^vP, (MP)^l and (MP)^∞: Burgers' equation, 41², conservative, strength 10, 1 pass, to t = .5",
        &[
            "procedure",
            "subdomains",
            "l_inf",
            "over MP",
            "max/mean of ρ·area",
            "R_max",
            "linear solves a step",
            "verdict",
        ],
    )
    .ruled(
        "the paper: these meshes satisfy the equidistribution principle more closely. “holds” where max/mean of ρ·area is below that of MP \
         on as many subdomains by more than 1 %, “does not hold” where it is above by as much, else “no difference”",
    );
    let rows: [(&str, &[&str]); 8] = [
        ("MP", &[]),
        ("M²P", &["mesh.coupling={mesh_steps=2}"]),
        ("M⁸P", &["mesh.coupling={mesh_steps=8}"]),
        ("M^vP, ε = 1e-4", &["mesh.coupling={mesh_steps=16, tolerance=1e-4}"]),
        ("(MP)²", &["mesh.coupling={iterations=2}"]),
        ("(MP)⁴", &["mesh.coupling={iterations=4}"]),
        ("(MP)^∞, ε = 1e-7", &["mesh.coupling={iterations=50, tolerance=1e-7}"]),
        ("MP, τ = .1", &["mesh.relaxation=0.1"]),
    ];
    let common = settings(&[
        "monitor.strength={relative=10.0}",
        "monitor.smoothing=1",
        "time.end=0.5",
        "time.report=[0.5]",
        "safety.substeps=1",
        "safety.smoothing=0",
        "safety.halvings=0",
    ]);
    let sizes: &[usize] = if options.quick { &[1] } else { &[1, 4] };
    for &s in sizes {
        let mut plain = [f64::NAN; 2];
        for (name, more) in
            rows.iter().filter(|(name, _)| !options.quick || !["M⁸P", "M^vP, ε = 1e-4", "(MP)⁴"].contains(name))
        {
            let generator = if s == 1 { WHOLE.into() } else { stochastic([s, s], RESIDUAL) };
            let all = [common.as_slice(), &settings(more), &[generator]].concat();
            let (record, failure) = compute(&study(BURGERS, &all)?)?;
            let on = if s == 1 { "one domain".to_string() } else { format!("{s}×{s}") };
            let (Some(report), None) = (record.reports.first(), &failure) else {
                let why = failure.as_ref().map_or_else(|| "not reached".into(), ended);
                let dash = || "–".to_string();
                table.row([name.to_string(), on, dash(), dash(), dash(), dash(), dash(), why]);
                continue;
            };
            let (error, uneven) = (report.error.map_or(f64::NAN, |e| e.linf), report.quality.equidistribution);
            if *name == "MP" {
                plain = [error, uneven];
            }
            let ratio = uneven / plain[1];
            let verdict = match *name {
                "MP" => "",
                _ if ratio < 0.99 => "holds",
                _ if ratio > 1.01 => "does not hold",
                _ => "no difference",
            };
            table.row([
                name.to_string(),
                on,
                format!("{error:.4}"),
                format!("{:.3}", error / plain[0]),
                format!("{uneven:.4}"),
                report.comparison.map_or("–".into(), |c| format!("{:.4}", c.r_max)),
                format!("{:.1}", record.work.work.linear_solves as f64 / record.work.steps as f64),
                verdict.into(),
            ]);
        }
    }
    table.note(
        "all with τ = 1 but the last row, which is there to show what τ does beside the procedures; R_max is against one domain with the \
         same procedure",
    );
    if options.quick {
        table.note("quick: one domain only, without M⁸P, M^vP and (MP)⁴");
    }
    Ok(table)
}

/// Interface values on bounded and on periodic meshes, from the published Monte Carlo.
fn paths() -> Result<Table> {
    let mut table = Table::new(
        "“Fewer Monte Carlo simulations are needed on periodic meshes”: one step, 4×4 subdomains, N = 1000, M = 10",
        &["mesh", "Δt", "error, rms", "over the shortest edge", "paths for 5 % of it", "verdict"],
    )
    .ruled(
        "paths for an error of 5 % of the shortest edge, by N^(−1/2). “holds” where the periodic mesh needs fewer than the bounded one \
         of its row or of the row above; both boxes have the same number of cells and the equation the same ξ in [0, 1]²",
    );
    let bounded = settings(&[
        "monitor.strength={relative=10.0}",
        "monitor.smoothing=2",
        "time.end=0.5",
        "time.report=[0.5]",
        WHOLE,
    ]);
    let periodic = settings(&["time.end=0.85", "time.report=[0.85]", WHOLE]);
    let [front, wave] = [state_of(&study(BURGERS, &bounded)?)?, state_of(&study(PERIODIC, &periodic)?)?];
    let kind = EstimatorKind::MonteCarlo(MonteCarlo::new(1000, 10));
    let mut needed = [[f64::NAN; 2]; 2];
    for (at, dt) in [1e-3, 5e-3].into_iter().enumerate() {
        for (which, (name, state)) in
            [("Burgers, bounded, t = .75", &front), ("Burgers, periodic, t = .85", &wave)].into_iter().enumerate()
        {
            let step = InterfaceStep::new(state.mesh.clone(), state.rho.clone(), Mmpde::published(), dt, [4, 4])?;
            let found = step.measure(kind.estimator(), 2)?;
            let share = found.error / step.shortest_edge();
            needed[at][which] = 1000.0 * (share / 0.05).powi(2);
            table.row([
                name.to_string(),
                format!("{dt}"),
                format!("{:.1e}", found.error),
                format!("{:.0} %", 100.0 * share),
                format!("{:.0}", needed[at][which]),
                if which == 1 { fewer(needed[at][1], needed[at][0]) } else { String::new() },
            ]);
        }
    }
    // the paper's steps: 1e-3 on the bounded domain, 5e-3 on the periodic one
    let [own, bounded] = [needed[1][1], needed[0][0]];
    let dash = || "–".to_string();
    table.row([
        "periodic at 5e-3 beside bounded at 1e-3, the paper's own steps".to_string(),
        dash(),
        dash(),
        dash(),
        format!("{own:.0} beside {bounded:.0}"),
        fewer(own, bounded),
    ]);
    table.note(
        "a path that leaves a bounded domain stops there, and pays a value without noise; none does on a periodic one",
    );
    Ok(table)
}

fn fewer(periodic: f64, bounded: f64) -> String {
    if periodic < bounded { "holds" } else { "does not hold" }.into()
}
