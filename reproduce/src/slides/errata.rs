//! What is wrong in the slides, each with a check.

use crate::Rerun;
use crate::errata::{self, row};
use driftmesh::error::{Error, Result};
use driftmesh::formula::Formula;
use driftmesh::study::{Kind, Source, StefanStudy};
use std::f64::consts::PI;

/// A place that no symmetry singles out.
const PLACE: [f64; 2] = [0.7, 0.4];

pub fn errata() -> Result<Rerun> {
    let mut table = errata::table("Castillo and Izsák (2024)");
    for (name, printed, right) in [
        ("p₆", "x^3 - 3*x^2*y", "x^3 - 3*x*y^2"),
        ("p₇", "y^3 - 3*x*y^2", "y^3 - 3*x^2*y"),
        ("p₉", "x^4 + 6*x^2*y^2 - y^4", "x^4 - 6*x^2*y^2 + y^4"),
    ] {
        let values = [laplacian(printed)?, laplacian(right)?];
        let passes = values.map(|v| v.abs() < 1e-12);
        table.row(row(
            [name, printed, right, "“harmonic polynomials”: Δp at (.7, .4) is 0"],
            values.map(|v| format!("{v:.2}")),
            passes,
        ));
    }
    table.row(walls());
    table.row(sign()?);
    table.note(
        "(3.16) alone has the wrong sign: the shift of a segment below it, d = δ (ν·(∇u₀ − ∇u₁))ν, is right with D₀ \
         = D₁ = L_H = 1, whichever way ν points",
    );
    table.note(
        "(2.4) adds up nine neighbours, j = 0 … 9, where there are eight; “(Δp)_j = p_j(x₀)” must read (Δp_j)(x₀)",
    );
    table
        .note("L_H is called the latent heat, and the front moves in proportion to it: it acts as the inverse of that");
    Ok(vec![table].into())
}

fn laplacian(text: &str) -> Result<f64> {
    let wrong = |_| Error::invalid("polynomial", text, "is no formula of x and y");
    let p = Formula::parse(text, &["x", "y"]).map_err(wrong)?;
    let second = |d: usize| -> Result<Formula> { p.derivative(d).and_then(|slope| slope.derivative(d)).map_err(wrong) };
    let (x, y) = (second(0)?, second(1)?);
    Ok(x.eval(&PLACE) + y.eval(&PLACE))
}

/// The initial temperature beside the sides without flux.
fn walls() -> Vec<String> {
    let [printed, right] = [-0.25 * 1.0_f64.sin(), -0.25 * PI * PI.sin()];
    row(
        [
            "initial and side conditions",
            "u = 1 + cos(x)/4 − y, no flux at x = ±1",
            "one of both, such as cos(πx)/4 − y",
            "∂u/∂x at x = 1 is 0",
        ],
        [format!("{printed:.3}"), format!("{right:.0e}")],
        [printed.abs() < 1e-12, right.abs() < 1e-12],
    )
}

/// A planar front of water that melts ice moves into the ice.
fn sign() -> Result<Vec<String>> {
    let text = "[study]\nname = \"melting\"\nkind = \"stefan\"\n[domain]\nx = [-1.0, 1.0]\nbottom = \"0\"\ntop = \
         \"2\"\n[grid]\ncells = [8, 8, 8]\n[exact]\nkind = \"planar\"\nwall = 1.0\nfar = -0.5\nstart_front = \
         0.7\n[time]\nduration = 0.01\nstep = 0.001\n";
    let (run, _) = StefanStudy::from_source(&Source::new("melting", text))?.compute()?;
    let moved = run.course.state.front[0] - 0.7;
    Ok(row(
        [
            "(3.16)",
            "x(t + δ) = x(t) + δ [[∂_ν u]]",
            "x(t + δ) = x(t) − δ L_H [[∂_ν u]]ν, as (3.10)",
            "water of 1 below ice of −.5: the front moves up in .01",
        ],
        [format!("{:.4}", -moved), format!("{moved:.4}")],
        [-moved > 0.0, moved > 0.0],
    ))
}
