//! The optimised Laplacian: its figures, and the slides' table.

use crate::{Options, Rerun, Table};
use driftmesh::error::Result;
use driftmesh::output::{Curve, Figure, Picture, draw};
use driftmesh::study::{Kind, PoissonStudy, Solved, Source};
use std::f64::consts::FRAC_PI_2;
use std::time::Instant;

const MODEL: &str = "[domain]\nx = [0.0, 1.5707963267948966]\nbottom = \"0\"\ntop = \"1 + cos(x)/4\"\n";
const ANNULUS: &str = "[domain]\nmap = { x = \"(0.5+s)*cos(pi*r/2)\", y = \"(0.5+s)*sin(pi*r/2)\" }\n";
const KINDS: [(&str, &str); 6] = [
    ("optimised", "kind = \"optimised\"\n"),
    ("harmonic", "kind = \"harmonic\"\n"),
    ("compact25", "kind = \"compact25\"\n"),
    ("mapped", "kind = \"mapped\"\n"),
    ("published, printed", "kind = \"published\"\n"),
    ("published, harmonic, local", "kind = \"published\"\npolynomials = \"harmonic\"\nscaling = \"local\"\n"),
];

/// Cells of the annulus along an axis.
const SIZES: [usize; 3] = [40, 80, 160];

fn study(domain: &str, grid: &str, u: &str, laplacian: &str) -> Result<PoissonStudy> {
    let text = format!(
        "[study]\nname = \"reproduced\"\nkind = \"poisson\"\n{domain}[grid]\n{grid}\n[exact]\nu = \
         \"{u}\"\n[laplacian]\n{laplacian}"
    );
    PoissonStudy::from_source(&Source::new("reproduced", text))
}

/// The slides' model problem with Nx × 0.8 Nx nodes inside, by the settings that fit their table best.
fn slides_study(nx: usize) -> Result<PoissonStudy> {
    let grid = format!("cells = [{}, {}]\ngrading = {{ toward = \"top\", ratio = 0.75 }}", nx + 1, nx * 4 / 5 + 1);
    let kind = "kind = \"published\"\npolynomials = \"printed\"\nscaling = \"global\"\n";
    study(MODEL, &grid, "y + x*cos(4*y)", kind)
}

/// The error in the slides' norm √(hx hy Σ e²).
fn in_their_norm(solved: &Solved, nx: usize) -> f64 {
    let squares: f64 = solved.u.iter().zip(solved.exact.iter().flatten()).map(|(u, e)| (u - e) * (u - e)).sum();
    (FRAC_PI_2 / (nx + 1) as f64 / (nx * 4 / 5 + 1) as f64 * squares).sqrt()
}

/// Error of the slides' model problem with Nx × 0.8 Nx nodes inside, in their norm √(hx hy Σ e²), by the settings that
/// fit
/// their table best.
///
/// # Errors
/// As [`PoissonStudy::solve`].
pub fn slides_error(nx: usize) -> Result<f64> {
    Ok(in_their_norm(&slides_study(nx)?.solve()?, nx))
}

/// Error in the norm of the integral, as the figures have it.
fn error(study: Result<PoissonStudy>) -> Result<f64> {
    Ok(study?.solve()?.error.map_or(f64::NAN, |error| error.l2_integral))
}

pub fn run(options: Options) -> Result<Rerun> {
    let (annulus, figure) = annulus(options)?;
    let tables = vec![slides(options)?, model_problem()?, annulus];
    let mut pictures = vec![("laplacian-annulus".into(), figure)];
    let grid =
        |n: usize| format!("cells = [{}, {}]\ngrading = {{ toward = \"top\", power = 1.25 }}", n + 1, n * 4 / 5 + 1);
    let distorted = format!("{MODEL}distort = {{ perturb = 0.25, seed = 1 }}\n");
    let on = |title: &str, domain: &str, grid: &str, u: &str| {
        study(domain, grid, u, KINDS[0].1)?.solve().map(|solved| draw(title, &solved.scene()))
    };
    pictures.push((
        "laplacian-model-problem".into(),
        on("The model problem, perturbed, Nx = 20", &distorted, &grid(20), "y + x*cos(4*y)")?,
    ));
    let perturbed = format!("{ANNULUS}distort = {{ perturb = 0.25, seed = 0 }}\n");
    pictures.push((
        "laplacian-annulus-mesh".into(),
        on("A quarter annulus, perturbed, 40 × 40 cells", &perturbed, "cells = [40, 40]", "sin(pi*x)*sin(pi*y)")?,
    ));
    Ok(Rerun { tables, pictures })
}

fn slides(options: Options) -> Result<Table> {
    /// Errors in units of 1e-3 that the slides print, for 10, 15, … 55 cells.
    const ERRORS: [f64; 10] = [10.9, 5.2, 3.1, 2.1, 1.6, 1.2, 1.0, 0.87, 0.77, 0.70];
    /// Times in milliseconds that the slides print, for the same numbers of cells.
    const TIMES: [usize; 10] = [22, 20, 27, 41, 55, 73, 95, 119, 146, 174];
    let mut table = Table::new(
        "The slides' table: error ×1e-3 of Δu = −16 x cos 4y, and time",
        &[
            "Nx",
            "Ny",
            "error, slides",
            "ours",
            "order",
            "ms, slides",
            "ours, whole",
            "of that weights",
            "verdict of the error",
        ],
    )
    .ruled(
        "“agrees” where the error is within 5 % of the slides'; else its ratio. Times have no verdict: the slides \
         name no machine",
    );
    let mut before: Option<(usize, f64)> = None;
    for (k, (slides, ms)) in ERRORS.into_iter().zip(TIMES).enumerate() {
        let nx = 10 + 5 * k;
        if options.quick && k % 3 != 0 {
            continue;
        }
        let started = Instant::now();
        let solved = slides_study(nx)?.solve()?;
        let whole = started.elapsed().as_secs_f64();
        let weights = (nx * (nx * 4 / 5)) as f64 / solved.report().points_per_second;
        let found = 1e3 * in_their_norm(&solved, nx);
        let order = before.map_or("".into(), |(n, e)| format!("{:.2}", order([e, found], [n + 1, nx + 1])));
        let ratio = found / slides;
        table.row([
            nx.to_string(),
            (nx * 4 / 5).to_string(),
            slides.to_string(),
            format!("{found:.3}"),
            order,
            ms.to_string(),
            format!("{:.1}", 1e3 * whole),
            format!("{:.2}", 1e3 * weights),
            if (ratio - 1.0).abs() <= 0.05 { "agrees".into() } else { format!("{ratio:.2} times theirs") },
        ]);
        before = Some((nx, found));
    }
    table.note(
        "a fit, not an identification: the slides give neither grading nor norm. Printed polynomials in coordinates \
         over h = 1/(Nx + 1), grading (1 − p^s)/(1 − p) with p = .75, norm √(hx hy Σ e²)",
    );
    if options.quick {
        table.note("quick: every third of ten sizes");
    }
    Ok(table)
}

/// Observed order of accuracy from which on a method counts as one of second order.
const SECOND: f64 = 1.8;

/// What the slides say of general geometries, for a kind with this order.
fn lost(order: f64) -> &'static str {
    if order < SECOND { "confirmed" } else { "does not hold for this kind" }
}

fn model_problem() -> Result<Table> {
    const NX: [usize; 3] = [20, 40, 80];
    let heads = ["mesh", "kind"].into_iter().map(String::from).chain(NX.iter().map(|n| format!("Nx = {n}")));
    let heads: Vec<String> = heads.chain(["order".into(), "verdict".into()]).collect();
    let mut table = Table {
        title: "Kinds of the Laplacian on the model problem: error ×1e-3".into(),
        columns: heads,
        ..Table::default()
    }
    .ruled(
        "of what the slides say: on a general geometry the accuracy of the five-point formula is lost, and the order \
         of nine points is decreased. “confirmed” where the error falls from Nx = 20 to 80 by an order below 1.8 in \
         h = 1/(Nx + 1), “does not hold for this kind” where by 1.8 or more",
    );
    let meshes = [
        ("graded", ""),
        ("perturbed", "distort = { perturb = 0.25, seed = 1 }\n"),
        ("sheared", "distort = { shear = 0.25 }\n"),
    ];
    for (mesh, distort) in meshes {
        for (name, kind) in KINDS {
            let errors = NX.map(|n| {
                let grid =
                    format!("cells = [{}, {}]\ngrading = {{ toward = \"top\", power = 1.25 }}", n + 1, n * 4 / 5 + 1);
                error(study(&format!("{MODEL}{distort}"), &grid, "y + x*cos(4*y)", kind))
            });
            let errors = errors.into_iter().collect::<Result<Vec<f64>>>()?;
            let shown = errors.iter().map(|error| format!("{:.4}", 1e3 * error));
            let order = order([errors[0], errors[2]], [NX[0] + 1, NX[2] + 1]);
            let said = [format!("{order:.2}"), lost(order).into()];
            table.row([mesh.to_string(), name.into()].into_iter().chain(shown).chain(said));
        }
    }
    table.note(
        "norm √(Σ e²·area); grading 1 − (1 − s)^1.25 toward the curve; summary.json divides by √(Σ area) besides. \
         The slides' kind is the one called published; the others are ours",
    );
    Ok(table)
}

fn annulus(options: Options) -> Result<(Table, Picture)> {
    let seeds = if options.quick { 3 } else { 10 };
    let mut table = Table::new(
        "A quarter annulus with perturbed nodes, u = sin πx sin πy: error ×1e-3",
        &["kind", "seed", "41²", "81²", "161²", "last order", "verdict"],
    )
    .ruled(
        "of what the slides say of their formula: “We cannot guarantee a fixed spatial convergence (or consistency) \
         order”. “confirmed” where the last order is below 1.8, “does not hold for this kind” where it is 1.8 or \
         more",
    );
    let mut curves = Vec::new();
    for (name, kind) in [KINDS[0], KINDS[4], KINDS[5]] {
        let mut worst = [0.0_f64; 3];
        for seed in 0..seeds {
            let errors = SIZES.map(|n| {
                let domain = format!("{ANNULUS}distort = {{ perturb = 0.25, seed = {seed} }}\n");
                error(study(&domain, &format!("cells = [{n}, {n}]"), "sin(pi*x)*sin(pi*y)", kind))
            });
            let errors = errors.into_iter().collect::<Result<Vec<f64>>>()?;
            worst = std::array::from_fn(|k| worst[k].max(errors[k]));
            let order = order([errors[1], errors[2]], [SIZES[1], SIZES[2]]);
            let cells = errors.iter().map(|error| format!("{:.3}", 1e3 * error));
            table.row(
                [name.to_string(), seed.to_string()]
                    .into_iter()
                    .chain(cells)
                    .chain([format!("{order:.2}"), lost(order).into()]),
            );
        }
        let points = SIZES.iter().zip(worst).map(|(n, error)| [*n as f64, error]).collect();
        curves.push(Curve { name: name.into(), points, ..Curve::default() });
    }
    table.note("the published least squares are exact for no quadratic on such a mesh, whatever the unit of length");
    if options.quick {
        table.note(format!("quick: {seeds} of ten seeds"));
    }
    let figure = Figure {
        title: "A quarter annulus with perturbed nodes: the worst seed".into(),
        labels: ["cells along an axis".into(), "l2 error".into()],
        curves,
        ..Figure::default()
    };
    Ok((table, figure.draw()))
}

/// Between two grids with so many cells.
fn order(errors: [f64; 2], cells: [usize; 2]) -> f64 {
    (errors[0] / errors[1]).ln() / (cells[1] as f64 / cells[0] as f64).ln()
}
