//! Studies of kind `equidistribution`: the files that a run leaves beside its summary.

use super::EquidistributionStudy;
use super::line_figures::NumberedIterate;
use super::line_run::Evolution;
use crate::equidistribution::{FaceDensity, History, Line};
use crate::error::Result;
use crate::output::{Curve, Figure, RunDirectory, Scale, moment, names};
use crate::simulation::{Scene, Values};
use ndarray::{Array1, Array2, arr0};
use ndarray_npy::{NpzWriter, WriteNpzError};
use serde::Serialize;
use std::io::Cursor;

/// Largest number of points of a drawn curve: more are not told apart.
const DRAWN: usize = 400;
/// Number of places between two nodes at which M is drawn.
const BETWEEN: usize = 8;
/// Number of cells of a line up to which M is integrated over each cell to round-off in frames; in more, and so
/// smaller, cells the trapezoidal rule is as good.
const EXACTLY: usize = 10_000;
/// Number of nodes whose paths in time are drawn.
const PATHS: usize = 40;

/// Writes the arrays and the pictures.
pub(super) fn keep(
    study: &EquidistributionStudy,
    line: &Line,
    directory: &RunDirectory,
    evolution: &Evolution,
) -> Result<()> {
    directory.write(names::ARRAYS, &arrays(line, evolution))?;
    let mut pictures = vec![(
        names::MESH,
        if study.time.is_some() { paths(study, line, evolution) } else { mapping(study, line, evolution) },
    )];
    pictures.extend(evolution.last.as_ref().map(|history| (names::CONVERGENCE, convergence(study, history))));
    pictures.push((names::DENSITY, density(study, line, evolution)));
    for (name, figure) in pictures {
        figure.draw().write(directory.path(), name)?;
    }
    Ok(())
}

/// A table with its names, also where it has no row.
fn csv_of<T: Serialize + Default>(rows: impl AsRef<[T]>) -> Vec<u8> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    let (rows, nameless) = (rows.as_ref(), [T::default()]);
    for row in if rows.is_empty() { &nameless } else { rows } {
        writer.serialize(row).expect("writing to memory cannot fail");
    }
    let mut table = writer.into_inner().expect("writing to memory cannot fail");
    if rows.is_empty() {
        table.truncate(table.iter().position(|byte| *byte == b'\n').map_or(0, |end| end + 1));
    }
    table
}

/// `xi`, `x` and `t` of the last mesh; `times` and `path`, a row a mesh.
fn arrays(line: &Line, evolution: &Evolution) -> Vec<u8> {
    let n = line.cells;
    let write = || -> Result<Vec<u8>, WriteNpzError> {
        let mut npz = NpzWriter::new(Cursor::new(Vec::new()));
        npz.add_array("xi", &Array1::from_iter((0..=n).map(|i| i as f64 / n as f64)))?;
        npz.add_array("x", &Array1::from(evolution.mesh().to_vec()))?;
        npz.add_array("t", &arr0(*evolution.times.last().unwrap_or(&0.0)))?;
        npz.add_array("times", &Array1::from(evolution.times.clone()))?;
        let path = Array2::from_shape_vec((evolution.times.len(), n + 1), evolution.meshes.concat());
        npz.add_array("path", &path.expect("a mesh has a node more than cells"))?;
        Ok(npz.finish()?.into_inner())
    };
    write().expect("writing to memory cannot fail")
}

/// Writes `history.csv`: the steps of a run in time, or the iterates.
pub(super) fn write_history(
    study: &EquidistributionStudy,
    directory: &RunDirectory,
    evolution: &Evolution,
) -> Result<()> {
    let iterates = evolution.last.iter().flat_map(|history| &history.iterates);
    let table = match study.time {
        Some(_) => csv_of(&evolution.steps),
        None => csv_of(iterates.enumerate().map(|(n, iterate)| NumberedIterate::new(n, iterate)).collect::<Vec<_>>()),
    };
    directory.write(names::HISTORY, &table)
}

/// A mesh of the line at time t, shown with a number and at a place on the axis of time that are those of an iterate
/// where iterates are shown
///
/// At the nodes u, where M is the arc length of one, and M; in the cells ∫M and the length, both over their mean, the
/// first subdomain that a cell lies in and how many more it lies in.
pub(super) fn scene(line: &Line, shown: (usize, f64), t: f64, mesh: &[f64], ranges: &[[usize; 2]]) -> Scene {
    let [a, b] = line.ends;
    // a folded mesh (nodes out of order) may leave the line, where nothing need be known
    let places: Vec<f64> = mesh.iter().map(|x| x.clamp(a, b)).collect();
    let known = |v: &f64| v.is_finite();
    let u = line.density.followed(t, &places).filter(|u| u.iter().all(known));
    let m = line.density.at_each(t, &places).ok().map(|m| m.into_iter().map(|[m, _]| m).collect::<Vec<_>>());
    let named = |name: &str, values: Option<Vec<f64>>| Some((name.to_string(), Values::Scalars(values?)));
    let over_mean = |values: Vec<f64>| {
        let mean = values.iter().sum::<f64>() / line.cells as f64;
        values.into_iter().map(|v| v / mean).collect::<Vec<_>>()
    };
    let face = if line.cells <= EXACTLY { FaceDensity::Exact } else { line.face };
    let shares = Line { face, ..line.clone() }.shares(t, &places).ok().map(over_mean);
    let lengths = over_mean(mesh.windows(2).map(|x| x[1] - x[0]).collect());
    let of_cell = |cell: usize| {
        let first = ranges.partition_point(|range| range[1] <= cell);
        (first, ranges.partition_point(|range| range[0] <= cell).saturating_sub(first + 1))
    };
    let (subdomain, overlap) = (0..line.cells).map(of_cell).unzip();
    let nodes: Vec<_> = [named("u", u), named("M", m)].into_iter().flatten().collect();
    let cells = [named("share", shares), named("jacobian", Some(lengths))].into_iter().flatten();
    let cells: Vec<_> = cells
        .chain([("subdomain".into(), Values::Numbers(subdomain)), ("overlap".into(), Values::Numbers(overlap))])
        .collect();
    Scene {
        t: shown.1,
        step: shown.0,
        cells: [line.cells, 0],
        periodic: [false; 2],
        closed: [false; 2],
        lower: [a, 0.0],
        extent: [b - a, 0.0],
        points: mesh.iter().map(|x| [*x, 0.0]).collect(),
        nodal: nodes,
        density: None,
        in_cells: cells,
        curve: Vec::new(),
    }
}

/// Places in a list, the first and the last among them.
pub(super) fn thinned(count: usize, most: usize) -> impl Iterator<Item = usize> {
    let every = count.saturating_sub(1).div_ceil(most).max(1);
    (0..count).filter(move |i| i % every == 0 || i + 1 == count)
}

/// What a title says of a folded mesh, whose nodes are out of order.
fn folded(mesh: &[f64]) -> &'static str {
    if mesh.is_sorted_by(|a, b| a < b) { "" } else { ", folded: nodes have changed their order" }
}

/// x over ξ.
fn mapping(study: &EquidistributionStudy, line: &Line, evolution: &Evolution) -> Figure {
    let mesh = evolution.mesh();
    let points = thinned(mesh.len(), DRAWN).map(|i| [i as f64 / line.cells as f64, mesh[i]]).collect();
    Figure {
        title: format!("{}, {} cells{}", study.study.name, line.cells, folded(mesh)),
        labels: ["ξ".into(), "x".into()],
        scales: [Scale::Linear; 2],
        curves: vec![Curve { points, plain: line.cells > DRAWN, ..Curve::default() }],
        ..Figure::default()
    }
}

/// Nodes over time; ends of subdomains with a name.
fn paths(study: &EquidistributionStudy, line: &Line, evolution: &Evolution) -> Figure {
    let path = |node: usize| -> Vec<[f64; 2]> {
        let kept = thinned(evolution.times.len(), DRAWN);
        kept.map(|k| [evolution.meshes[k][node], evolution.times[k]]).collect()
    };
    let ranges = study.decomposition().ok().flatten().map_or(Vec::new(), |(_, ranges)| ranges);
    let mut ends: Vec<usize> = ranges.iter().flatten().copied().filter(|&i| i > 0 && i < line.cells).collect();
    ends.sort_unstable();
    ends.dedup();
    let mut curves: Vec<Curve> = Vec::new();
    if ends.len() <= PATHS {
        for node in &ends {
            let name = format!("ξ = {}", *node as f64 / line.cells as f64);
            curves.push(Curve { name, points: path(*node), plain: true, ..Curve::default() });
        }
    }
    for node in thinned(line.cells + 1, PATHS).filter(|node| !ends.contains(node)) {
        curves.push(Curve { points: path(node), plain: true, faint: true, ..Curve::default() });
    }
    Figure {
        title: format!("{}, paths of nodes", study.study.name),
        labels: ["x".into(), "t".into()],
        scales: [Scale::Linear; 2],
        curves,
        ..Figure::default()
    }
}

/// M over x, and where the nodes stand on it; nothing where M has no value.
fn density(study: &EquidistributionStudy, line: &Line, evolution: &Evolution) -> Figure {
    let (mesh, t) = (evolution.mesh(), *evolution.times.last().unwrap_or(&0.0));
    // a folded mesh (nodes out of order) may leave the line, where M need not be known
    let place = |x: f64| {
        let [m, _] = line.density.at(t, x).ok()?;
        (line.ends[0]..=line.ends[1]).contains(&x).then_some([x, m])
    };
    // between nodes too: a layer may lie there
    let kept: Vec<f64> = thinned(mesh.len(), DRAWN).map(|i| mesh[i]).collect();
    let between =
        |w: &[f64]| (0..BETWEEN).map(|k| w[0] + (w[1] - w[0]) * k as f64 / BETWEEN as f64).collect::<Vec<_>>();
    let x = kept.windows(2).flat_map(between).chain(kept.last().copied());
    let mut all: Vec<[f64; 2]> = x.filter_map(place).collect();
    all.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let few = mesh.len() <= DRAWN;
    let nodes: Vec<[f64; 2]> = mesh.iter().filter(|_| few).filter_map(|x| place(*x)).collect();
    let [low, high] = all.iter().fold([f64::INFINITY, 0.0], |[l, h]: [f64; 2], p| [l.min(p[1]), h.max(p[1])]);
    let when = study.time.as_ref().map_or(String::new(), |_| format!(", t = {}", moment(t)));
    let what = if few { "the density and the nodes" } else { "the density" };
    let mut curves = vec![Curve { name: "M".into(), points: all, plain: true, ..Curve::default() }.outlined()];
    if few {
        curves.push(Curve { name: "nodes".into(), points: nodes, scattered: true, ..Curve::default() });
    }
    Figure {
        title: format!("{}, {what}{when}", study.study.name),
        labels: ["x".into(), "M".into()],
        scales: [Scale::Linear, if high > 30.0 * low { Scale::Logarithmic } else { Scale::Linear }],
        curves,
        ..Figure::default()
    }
}

/// Errors over iterations, beside what theory says.
fn convergence(study: &EquidistributionStudy, history: &History) -> Figure {
    let errors: Vec<[f64; 2]> = history.iterates.iter().enumerate().map(|(n, it)| [n as f64, it.error]).collect();
    let last = errors.len() - 1;
    let floor = errors.iter().map(|e| e[1]).filter(|e| *e > 0.0).fold(f64::INFINITY, f64::min);
    let line = |name: &str, rate: Option<f64>, [n, error]: [f64; 2]| {
        let rate = rate.filter(|rate| *rate > 0.0)?;
        let points = (0..=last).map(|k| [k as f64, error.max(floor) * rate.powf(0.5 * (k as f64 - n))]);
        let points = points.filter(|p| (0.1 * floor..10.0 * errors[0][1].max(floor)).contains(&p[1])).collect();
        Some(Curve { name: format!("{name}, {rate:.4} in two iterations"), points, plain: true, ..Curve::default() })
    };
    let mut curves = vec![Curve { name: "observed".into(), points: errors.clone(), ..Curve::default() }.outlined()];
    // slopes: what is predicted holds in the end, before the error stands still; a bound from the start, for even
    // iterates and odd ones apart
    let end = errors.iter().rfind(|e| e[1] >= 10.0 * floor).unwrap_or(&errors[last]);
    curves.extend(line("predicted", history.prediction.predicted, *end));
    let [first, second] = [errors[0][1], errors[1.min(last)][1]];
    let from = history.prediction.bound.map_or(first, |bound| first.max(second / bound.sqrt()));
    curves.extend(line("bound", history.prediction.bound, [0.0, from]));
    Figure {
        title: format!("{}, convergence{}", study.study.name, study.time.as_ref().map_or("", |_| " in the last step")),
        labels: ["iterations".into(), "distance to the single-domain mesh".into()],
        scales: [Scale::Linear, Scale::Logarithmic],
        curves,
        ..Figure::default()
    }
}
