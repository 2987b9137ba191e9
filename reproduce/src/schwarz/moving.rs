//! Figure 8.6: subdomains that move.

use crate::{Rerun, Table};
use driftmesh::error::Result;
use driftmesh::output::{Curve, Figure, Scale};
use driftmesh::study::{EquidistributionStudy, Evolution, Kind, Source};

const FRONT: &str = "(1 - tanh((1 + 249.5*(1 + tanh(10*(t - 0.2))))*(x - t - 0.4)))/2";
const CELLS: usize = 100;

/// First and last nodes of subdomains, and how a study says them.
type Case = (&'static str, &'static str, &'static [[usize; 2]]);

pub fn figure_8_6() -> Result<Rerun> {
    let mut table = Table::new(
        "Figure 8.6: a front that steepens and moves, 100 cells, 100 steps, to 1e-10 in each",
        &[
            "subdomains",
            "iterations a step",
            "t",
            "ends of subdomains, ξ",
            "x of them",
            "shortest cell over the mean",
            "verdict",
        ],
    )
    .ruled(
        "the paper prints no number: its profile moves from left to right. “holds” where the mesh is monotone and \
         every end of a subdomain has moved to the right since the row above, “neither” where one has gone back, \
         “does not hold” where the mesh is not monotone",
    );
    let mut pictures = Vec::new();
    let cases: [Case; 2] = [
        ("two", "overlap = [0.45, 0.55]", &[[0, 55], [45, 100]]),
        ("three", "intervals = [[0.0, 0.38], [0.29, 0.71], [0.62, 1.0]]", &[[0, 38], [29, 71], [62, 100]]),
    ];
    for ((count, divided, ranges), side) in cases.into_iter().zip(["left", "right"]) {
        let evolution = evolved(divided)?;
        let steps = &evolution.steps;
        let mean = steps.iter().map(|step| step.iterations).sum::<usize>() as f64 / steps.len() as f64;
        let mut ends: Vec<usize> = ranges.windows(2).flat_map(|pair| [pair[1][0], pair[0][1]]).collect();
        ends.sort_unstable();
        for n in [0, 50, 100] {
            let (mesh, t) = (&evolution.meshes[n], evolution.times[n]);
            let shortest = mesh.windows(2).map(|x| x[1] - x[0]).fold(f64::INFINITY, f64::min) * CELLS as f64;
            let shown = |text: &dyn Fn(usize) -> String| ends.iter().map(|&k| text(k)).collect::<Vec<_>>().join(" ");
            table.row([
                count.to_string(),
                format!("{mean:.1}"),
                format!("{t}"),
                shown(&|k| format!(".{k}")),
                shown(&|k| format!("{:.4}", mesh[k])),
                format!("{shortest:.3}"),
                if n == 0 { String::new() } else { said(shortest, &ends, [&evolution.meshes[n - 50], mesh]) },
            ]);
        }
        let title = format!("Figure 8.6, {side}: {count} subdomains, nodes of overlaps in grey");
        pictures.push((format!("figure-8-6-{side}"), drawn(&evolution, ranges, title).draw()));
    }
    table.note(
        "three subdomains: the outermost end, ahead of the front, is drawn to the left at first, towards the profile \
         that forms, and then goes with it to the right",
    );
    table.note("MMPDE5, τ = 1e-2, backward Euler, Δt = 1e-3; neither is in the paper");
    Ok(Rerun { tables: vec![table], pictures })
}

/// Where the ends have gone since the mesh before.
fn said(shortest: f64, ends: &[usize], [before, mesh]: [&Vec<f64>; 2]) -> String {
    let back: Vec<String> =
        ends.iter().filter(|&&k| mesh[k] < before[k]).map(|k| format!("x(.{k}) has gone back")).collect();
    match back.as_slice() {
        _ if shortest <= 0.0 => "does not hold".into(),
        [] => "holds".into(),
        back => format!("neither: {}", back.join(", ")),
    }
}

fn evolved(divided: &str) -> Result<Evolution> {
    let text = format!(
        "[study]\nname = \"figure-8-6\"\nkind = \"equidistribution\"\n[grid]\ncells = [{CELLS}]\n[density]\n\
         kind = \"arclength\"\nof = \"{FRONT}\"\n[schwarz]\n{divided}\n[stop]\ntolerance = 1e-10\n[time]\nstart = 0.0\n\
         end = 0.1\nstep = 1e-3\nrelaxation = 0.01\n"
    );
    let study = EquidistributionStudy::from_source(&Source::new("figure-8-6", text))?;
    let (run, failure) = study.compute()?;
    failure.map_or(Ok(run.evolution), Err)
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
