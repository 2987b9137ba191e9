//! Figures 1 to 3: the meshes.

use super::table_2::state_of;
use super::{BURGERS, DAM_BREAK, NO_SAFETY, RESIDUAL, RINGS, WHOLE, settings, stochastic, study};
use crate::{Options, Rerun, Table};
use driftmesh::error::Result;
use driftmesh::geometry::{compare, quality};
use driftmesh::output::draw;
use driftmesh::simulation::State;

/// A figure: its study with settings, the times that it shows, and the numbers of subdomains along an axis; 1 for one
/// domain.
struct Shown {
    name: &'static str,
    what: &'static str,
    unknown: &'static str,
    base: &'static str,
    settings: Vec<String>,
    times: Vec<f64>,
    subdomains: Vec<usize>,
}

pub fn figures(options: Options) -> Result<Rerun> {
    let mut table = Table::new(
        "Figures 1 to 3: the meshes that are drawn",
        &["figure", "t", "subdomains", "Q max", "Q mean", "smallest corner", "mesh rms / box", "verdict"],
    )
    .ruled(
        "the paper prints no number; “holds” where the mesh of the subdomains is within a tenth of a cell (rms) \
         of that of one domain",
    );
    let mut pictures = Vec::new();
    for figure in shown(options) {
        for &t in &figure.times {
            let whole = figure.state(t, 1)?;
            for &s in &figure.subdomains {
                let state = if s == 1 { whole.clone() } else { figure.state(t, s)? };
                table.row(row(&figure, t, s, &state, &whole)?);
                // one domain is drawn where the paper draws it
                if s > 1 || figure.name != "figure-1" {
                    let where_ = if s == 1 { "one domain".into() } else { format!("{s} × {s} subdomains") };
                    let title =
                        format!("{}, {}, t = {t}, {where_}", figure.name.replace("figure-", "Figure "), figure.what);
                    let name = format!("{}-{s}x{s}-t{}", figure.name, t.to_string().replace('.', "_"));
                    pictures.push((name, draw(&title, &state.scene(&[figure.unknown.into()]))));
                }
            }
        }
    }
    table.note(
        "by the residual walk, since the paper's Monte Carlo with the one substep that it gives folds the first mesh \
         of figures 2 and 3, with ten and a hundred times as many paths as well (see rings and table-4, which say \
         why). Densities: figure 1 strength 10 and one pass of smoothing, 2 and 3 four passes and the gradient of ln \
         ρ",
    );
    if options.quick {
        table.note("quick: figure 1 at the first of its three times only");
    }
    Ok(Rerun { tables: vec![table], pictures })
}

fn shown(options: Options) -> [Shown; 3] {
    [
        Shown {
            name: "figure-1",
            what: "Burgers",
            unknown: "u",
            base: BURGERS,
            settings: settings(&["monitor.strength={relative=10.0}", "monitor.smoothing=1"]),
            times: if options.quick { vec![0.75] } else { vec![0.75, 1.0, 1.25] },
            subdomains: vec![1, 2, 4],
        },
        Shown {
            name: "figure-2",
            what: "five rings",
            unknown: "u",
            base: RINGS,
            settings: Vec::new(),
            times: vec![0.05],
            subdomains: vec![1, 4],
        },
        Shown {
            name: "figure-3",
            what: "shallow water",
            unknown: "h",
            base: DAM_BREAK,
            settings: Vec::new(),
            times: vec![0.15],
            subdomains: vec![1, 4],
        },
    ]
}

impl Shown {
    fn state(&self, t: f64, s: usize) -> Result<State> {
        let generator = if s == 1 { WHOLE.into() } else { stochastic([s, s], RESIDUAL) };
        let until = [format!("time.end={t:?}"), format!("time.report=[{t:?}]"), generator];
        state_of(&study(self.base, &[&self.settings, until.as_slice(), &settings(&NO_SAFETY)].concat())?)
    }
}

fn row(figure: &Shown, t: f64, s: usize, state: &State, whole: &State) -> Result<Vec<String>> {
    let quality = quality(&state.mesh, state.rho.largest())?;
    let rms = compare(&state.mesh, &whole.mesh).mesh_rms / state.mesh.extent()[0];
    let cell = 1.0 / state.mesh.lattice().cells()[0] as f64;
    let verdict = match s {
        1 => "",
        _ if rms <= 0.1 * cell => "holds",
        _ => "does not hold",
    };
    Ok(vec![
        format!("{}, {}", figure.name, figure.what),
        t.to_string(),
        if s == 1 { "one domain".into() } else { format!("{s}×{s}") },
        format!("{:.3}", quality.q_max),
        format!("{:.3}", quality.q_mean),
        format!("{:.3}", quality.min_scaled_jacobian),
        if s == 1 { String::new() } else { format!("{rms:.1e}") },
        verdict.into(),
    ])
}
