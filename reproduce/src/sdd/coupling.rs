//! Section 5: M^kP, M^vP, (MP)^l and (MP)^∞, and how many paths periodic meshes need.

use super::table_2::state_of;
use super::{BURGERS, PERIODIC, RESIDUAL, WHOLE, ended, settings, stochastic, study};
use crate::{InterfaceStep, Options, Rerun, Table};
use driftmesh::error::Result;
use driftmesh::meshing::{EstimatorKind, Mmpde, MonteCarlo};
use driftmesh::simulation::State;
use driftmesh::study::{Kind, MovingRun};

pub fn coupling(options: Options) -> Result<Rerun> {
    Ok(vec![procedures(options)?, paths()?].into())
}

const RULE: &str = "the paper: these meshes satisfy the equidistribution principle more closely. “no difference” \
     where error and max/mean of ρ·area are both within 1 % of those of MP on as many subdomains; else “neither”, \
     since this measure cannot decide (see below). The last row is no claim of the paper and has no verdict";
const ROWS: [(&str, &[&str]); 8] = [
    ("MP", &[]),
    ("M²P", &["mesh.coupling={mesh_steps=2}"]),
    ("M⁸P", &["mesh.coupling={mesh_steps=8}"]),
    ("M^vP, ε = 1e-4", &["mesh.coupling={mesh_steps=16, tolerance=1e-4}"]),
    ("(MP)²", &["mesh.coupling={iterations=2}"]),
    ("(MP)⁴", &["mesh.coupling={iterations=4}"]),
    ("(MP)^∞, ε = 1e-7", &["mesh.coupling={iterations=50, tolerance=1e-7}"]),
    (OTHER, &["mesh.relaxation=0.1"]),
];
/// The row that is no claim of the paper: another τ.
const OTHER: &str = "MP, τ = .1";

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
    .ruled(RULE);
    for &s in if options.quick { &[1][..] } else { &[1, 4] } {
        let mut plain = [f64::NAN; 2];
        for (name, more) in ROWS {
            table.row(procedure(name, more, s, &mut plain)?);
        }
    }
    table.note(
        "max/mean of ρ·area would be 1 on a mesh that equidistributes ρ. In two dimensions ∇·(ρ∇x) = 0, towards \
         which these meshes relax, does not make ρ·area equal, so that a mesh nearer to its solution need not have \
         the smaller value. The last row shows it: with τ = .1 the mesh follows faster and the error is smaller, and \
         max/mean is larger",
    );
    table.note(
        "all with τ = 1 but the last row. R_max is against one domain with the same procedure, which on one domain \
         is 1 by construction",
    );
    if options.quick {
        table.note("quick: one domain only");
    }
    Ok(table)
}

/// A row: a procedure on S × S subdomains, beside what MP has, error and max/mean of ρ·area, which the first row sets.
fn procedure(name: &str, more: &[&str], s: usize, plain: &mut [f64; 2]) -> Result<Vec<String>> {
    let common = settings(&[
        "monitor.strength={relative=10.0}",
        "monitor.smoothing=1",
        "time.end=0.5",
        "time.report=[0.5]",
        "safety.substeps=1",
        "safety.smoothing=0",
        "safety.halvings=0",
    ]);
    let generator = if s == 1 { WHOLE.into() } else { stochastic([s, s], RESIDUAL) };
    let all = [common.as_slice(), &settings(more), &[generator]].concat();
    let (MovingRun { record, .. }, failure) = study(BURGERS, &all)?.compute()?;
    let on = if s == 1 { "one domain".to_string() } else { format!("{s}×{s}") };
    let dash = || "–".to_string();
    let (Some(report), None) = (record.reports.first(), &failure) else {
        let why = failure.as_ref().map_or_else(|| "not reached".into(), ended);
        return Ok(vec![name.to_string(), on, dash(), dash(), dash(), dash(), dash(), why]);
    };
    let found = [report.error.map_or(f64::NAN, |e| e.linf), report.quality.equidistribution];
    if name == "MP" {
        *plain = found;
    }
    let same = (0..2).all(|k| (found[k] / plain[k] - 1.0).abs() <= 0.01);
    let verdict = match name {
        "MP" | OTHER => "",
        _ if same => "no difference",
        _ => "neither",
    };
    Ok(vec![
        name.to_string(),
        on,
        format!("{:.4}", found[0]),
        format!("{:.3}", found[0] / plain[0]),
        format!("{:.4}", found[1]),
        report.comparison.filter(|_| s > 1).map_or_else(dash, |c| format!("{:.4}", c.r_max)),
        format!("{:.1}", record.work.work.linear_solves as f64 / record.work.steps as f64),
        verdict.into(),
    ])
}

/// Two errors of the box count as the same where they differ by less than this share.
const SAME: f64 = 0.1;

/// Interface values on bounded and on periodic meshes, from the published Monte Carlo.
fn paths() -> Result<Table> {
    let mut table = Table::new(
        "“Fewer Monte Carlo simulations are needed to generate quality periodic meshes”: one step, 4×4 subdomains, N \
         = 1000, M = 10",
        &[
            "mesh",
            "Δt",
            "error, rms",
            "error over the box",
            "√(2Δt/N)",
            "shortest edge over the box",
            "error over the shortest edge",
            "verdict",
        ],
    )
    .ruled(
        "by the error over the side of the box, which falls with N^(−1/2) in both: “no difference” where that of the \
         periodic mesh is within 10 % of that of the bounded one of its row or of the row above, “holds” where it is \
         smaller, “does not hold” where it is larger. Both boxes have 40 × 40 cells and the equation the same ξ in \
         [0, 1]²",
    );
    let [front, wave] = fronts()?;
    let kind = EstimatorKind::MonteCarlo(MonteCarlo::new(1000, 10));
    let mut shares = [[f64::NAN; 2]; 2];
    for (at, dt) in [1e-3, 5e-3].into_iter().enumerate() {
        for (which, (name, state)) in
            [("Burgers, bounded, t = .5", &front), ("Burgers, periodic, t = .85", &wave)].into_iter().enumerate()
        {
            let side = state.mesh.extent()[0];
            let step = InterfaceStep::new(state.mesh.clone(), state.rho.clone(), Mmpde::published(), dt, [4, 4])?;
            let found = step.measure(kind.estimator(), 2)?;
            shares[at][which] = found.error / side;
            table.row([
                name.to_string(),
                format!("{dt}"),
                format!("{:.1e}", found.error),
                format!("{:.1e}", shares[at][which]),
                format!("{:.1e}", (2.0 * dt / 1000.0).sqrt()),
                format!("{:.4}", step.shortest_edge() / side),
                format!("{:.0} %", 100.0 * found.error / step.shortest_edge()),
                if which == 1 { fewer(shares[at][1], shares[at][0]) } else { String::new() },
            ]);
        }
    }
    // the paper's steps: 1e-3 on the bounded domain, 5e-3 on the periodic one
    let [own, bounded] = [shares[1][1], shares[0][0]];
    let mut last = ["periodic at 5e-3 beside bounded at 1e-3, the paper's own steps"; 8].map(String::from);
    last[1..].fill("–".into());
    last[3] = format!("{own:.1e} beside {bounded:.1e}");
    last[7] = fewer(own, bounded);
    table.row(last);
    table.note(
        "the error is the noise √(2Δt/N) of a diffusion on both meshes; a path that leaves a bounded domain stops \
         there, and pays a value without noise, which lowers the error little, as the columns show. Beside the \
         shortest edge the periodic mesh has the smaller error because its density is milder and its shortest edge \
         longer, not because of its sides",
    );
    Ok(table)
}

/// Burgers' equation on a bounded and on a periodic domain, where its front is developed.
fn fronts() -> Result<[State; 2]> {
    let bounded = settings(&[
        "monitor.strength={relative=10.0}",
        "monitor.smoothing=2",
        "time.end=0.5",
        "time.report=[0.5]",
        WHOLE,
    ]);
    let periodic = settings(&["time.end=0.85", "time.report=[0.85]", WHOLE]);
    Ok([state_of(&study(BURGERS, &bounded)?)?, state_of(&study(PERIODIC, &periodic)?)?])
}

fn fewer(periodic: f64, bounded: f64) -> String {
    match periodic / bounded {
        ratio if (ratio - 1.0).abs() <= SAME => "no difference",
        ratio if ratio < 1.0 => "holds",
        _ => "does not hold",
    }
    .into()
}
