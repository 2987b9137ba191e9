//! Figure 8.6: subdomains that move.

use crate::{Rerun, Table};
use driftmesh::error::Result;
use driftmesh::output::{Curve, Figure, Scale};
use driftmesh::study::{EquidistributionStudy, Evolution, Source};

const FRONT: &str = "(1 - tanh((1 + 249.5*(1 + tanh(10*(t - 0.2))))*(x - t - 0.4)))/2";
const CELLS: usize = 100;

/// First and last nodes of subdomains, and how a study says them.
type Case = (&'static str, &'static str, &'static [[usize; 2]]);

pub fn figure_8_6() -> Result<Rerun> {
    let mut table = Table::new(
        "Figure 8.6: a front that steepens and moves, 100 cells, 100 steps, to 1e-10 in each",
        &["subdomains", "iterations a step", "t", "x(.45)", "x(.55)", "shortest cell over the mean", "verdict"],
    )
    .ruled("the paper prints no number. “holds” where the mesh is monotone, and x(.45) and x(.55) have moved to the right with the front");
    let mut pictures = Vec::new();
    let cases: [Case; 2] = [
        ("two", "overlap = [0.45, 0.55]", &[[0, 55], [45, 100]]),
        ("three", "intervals = [[0.0, 0.38], [0.29, 0.71], [0.62, 1.0]]", &[[0, 38], [29, 71], [62, 100]]),
    ];
    for ((count, divided, ranges), side) in cases.into_iter().zip(["left", "right"]) {
        let evolution = evolved(divided)?;
        let steps = &evolution.steps;
        let mean = steps.iter().map(|step| step.iterations).sum::<usize>() as f64 / steps.len() as f64;
        let mut before = [0.0; 2];
        for n in [0, 50, 100] {
            let (mesh, t) = (&evolution.meshes[n], evolution.times[n]);
            let shortest = mesh.windows(2).map(|x| x[1] - x[0]).fold(f64::INFINITY, f64::min) * CELLS as f64;
            let places = [mesh[45], mesh[55]];
            let moved = places[0] > before[0] && places[1] > before[1];
            table.row([
                count.to_string(),
                format!("{mean:.1}"),
                format!("{t}"),
                format!("{:.4}", places[0]),
                format!("{:.4}", places[1]),
                format!("{shortest:.3}"),
                super::verdict(shortest > 0.0 && moved),
            ]);
            before = places;
        }
        let title = format!("Figure 8.6, {side}: {count} subdomains, nodes of overlaps in grey");
        pictures.push((format!("figure-8-6-{side}"), drawn(&evolution, ranges, title).draw()));
    }
    table.note("MMPDE5, τ = 1e-2, backward Euler, Δt = 1e-3; neither is in the paper");
    Ok(Rerun { tables: vec![table], pictures })
}

fn evolved(divided: &str) -> Result<Evolution> {
    let text = format!(
        "[study]\nname = \"figure-8-6\"\nkind = \"equidistribution\"\n[grid]\ncells = [{CELLS}]\n[density]\n\
         kind = \"arclength\"\nof = \"{FRONT}\"\n[schwarz]\n{divided}\n[stop]\ntolerance = 1e-10\n[time]\nstart = 0.0\n\
         end = 0.1\nstep = 1e-3\nrelaxation = 0.01\n"
    );
    let study = EquidistributionStudy::from_source(&Source::new("figure-8-6", text))?;
    let mut evolution = Evolution::default();
    study.compute(&study.problem()?, &mut evolution)?;
    Ok(evolution)
}

/// Ends of subdomains over time, the overlaps shaded by the paths of their nodes.
fn drawn(evolution: &Evolution, ranges: &[[usize; 2]], title: String) -> Figure {
    let path = |node: usize| -> Vec<[f64; 2]> {
        evolution.times.iter().zip(&evolution.meshes).map(|(t, mesh)| [mesh[node], *t]).collect()
    };
    let end = |node: usize| Curve {
        name: format!("ξ = {}", node as f64 / CELLS as f64),
        points: path(node),
        plain: true,
        ..Curve::default()
    };
    let overlaps = || ranges.windows(2).map(|pair| [pair[1][0], pair[0][1]]);
    let mut curves: Vec<Curve> = overlaps().flatten().map(end).collect();
    for [first, last] in overlaps() {
        let inside =
            (first + 1..last).map(|node| Curve { points: path(node), faint: true, plain: true, ..Curve::default() });
        curves.extend(inside);
    }
    // the whole line is drawn
    let room = vec![[evolution.meshes[0][0], 0.0], [evolution.meshes[0][CELLS], 0.0]];
    Figure { title, labels: ["x".into(), "t".into()], scales: [Scale::Linear; 2], curves, room }
}
