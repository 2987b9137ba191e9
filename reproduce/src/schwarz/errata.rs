//! What is wrong in the paper, each with a check.

use super::{LINEARISED, VARIANTS, exactly, from_uniform, layer, square, two, until, valley};
use crate::Rerun;
use crate::errata::{self, row};
use driftmesh::equidistribution::{FaceDensity, Line, Stop};
use driftmesh::error::Result;

/// The node that stands at α = .45, the end of the overlap, on 100 cells.
const ALPHA: usize = 45;

pub fn errata() -> Result<Rerun> {
    let mut table = errata::table("Gander and Haynes (2012)");
    let rows = [
        second_estimate()?,
        always_converges()?,
        starting_value()?,
        lipschitz()?,
        left_sides()?,
        relaxation()?,
        hundred()?,
        jumps()?,
    ];
    for row in rows {
        table.row(row);
    }
    table.note(
        "misprints without a number to check: the proof of theorem 4.1 integrates from x₁ⁿ(α), not from \
         x₁ⁿ⁻¹(α), in its two displays",
    );
    Ok(vec![table].into())
}

fn exact() -> Result<Line> {
    Ok(Line { face: FaceDensity::Exact, ..square(100)? })
}

/// Two pieces that begin differently: the second with the right value at α, the first with a wrong one.
fn second_estimate() -> Result<Vec<String>> {
    let line = exact()?;
    let x = line.equidistributed(0.0)?;
    let first = ALPHA as f64 / 100.0;
    // x₂¹(α) = x₁⁰(α) by (3.1)
    let error = (x[ALPHA] - first).abs();
    let [low, high] = line.density.extremes(0.0, line.ends)?;
    let bound = |off: f64| high / low * off;
    let (printed, right) = (bound(0.0), bound((x[ALPHA] - first).abs()));
    Ok(row(
        [
            "(3.4), second estimate",
            "… |x(α) − x₂⁰(α)|",
            "… |x(α) − x₁⁰(α)|",
            "n = 0, x₂⁰(α) = x(α), x₁⁰ uniform, M = x² + 1: the bound is at least the error",
        ],
        [format!("{printed:.3} for an error of {error:.3}"), format!("{right:.3} for {error:.3}")],
        [printed >= error, right >= error],
    ))
}

fn always_converges() -> Result<Vec<String>> {
    let line = Line { face: FaceDensity::Exact, ..valley(300.0, 100)? };
    let smallest = |method| -> Result<f64> {
        let stop = Stop { iterations: 600, ..until(1e-10) };
        let history = from_uniform(&line, &two([48, 52], 100), method, stop)?;
        let last = history.iterates.len().saturating_sub(100);
        Ok(history.iterates[last..].iter().map(|it| it.error).fold(f64::INFINITY, f64::min))
    };
    let [frozen, nonlinear] = [smallest(LINEARISED)?, smallest(VARIANTS[0].1)?];
    Ok(row(
        [
            "theorem 3.4",
            "linearised Schwarz converges",
            "nonlinear Schwarz does",
            "M = 300(x − ½)² + 1, .48/.52, exact faces: smallest error of the last 100 of 600 iterations",
        ],
        [format!("{frozen:.3}"), format!("{nonlinear:.0e}")],
        [frozen < 1e-9, nonlinear < 1e-9],
    ))
}

/// Subdomain two hears of subdomain one: (5.6) after one iteration, in closed form.
fn starting_value() -> Result<Vec<String>> {
    let line = exact()?;
    let (p, alpha) = (2.0, 0.5);
    let x = line.exact(0.0, &[alpha])?[0];
    let first = alpha;
    let r_1 = |x: f64| (x + x.powi(3) / 3.0) / alpha;
    let r_2 = |x: f64| (4.0 / 3.0 - x - x.powi(3) / 3.0) / (1.0 - alpha);
    // R₂ − pI falls: its value is met by bisection
    let wanted = r_1(first) - p * first;
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        *(if r_2(middle) - p * middle > wanted { &mut low } else { &mut high }) = middle;
    }
    let error = (x - low).abs();
    let [least, most] = line.density.extremes(0.0, line.ends)?;
    let constant = most / least * (p + most / (1.0 - alpha)) / (p + least / (1.0 - alpha));
    let right = constant * (x - first).abs();
    Ok(row(
        [
            "theorem 5.2, second estimate",
            "… |x(α) − x₂⁰(α)|",
            "… |x(α) − x₁⁰(α)|",
            "n = 0, x₂⁰ = x, x₁⁰ uniform, p = 2, cut ½, M = x² + 1: the bound is at least the error at the cut",
        ],
        [format!("0 for an error of {error:.3}"), format!("{right:.3} for {error:.3}")],
        [error <= 0.0, right >= error],
    ))
}

/// The Lipschitz constant of (pI + R₁)⁻¹ is 1/min(p + M/α).
fn lipschitz() -> Result<Vec<String>> {
    let line = exact()?;
    let [low, high] = line.density.extremes(0.0, line.ends)?;
    let (p, alpha) = (2.0, 0.5);
    // the slope of the inverse at x = 0, where M is least
    let slope = 1.0 / (p + line.density.at(0.0, 0.0)?[0] / alpha);
    let [printed, right] = [high, low].map(|m| 1.0 / (p + m / alpha));
    Ok(row(
        [
            "proof of theorem 5.2",
            "L = (p + m̂/α)⁻¹",
            "L = (p + m̌/α)⁻¹",
            "M = x² + 1, p = 2, α = ½: at least the slope of (pI + R₁)⁻¹ at x = 0",
        ],
        [format!("{printed:.4} for {slope:.4}"), format!("{right:.4} for {slope:.4}")],
        [printed >= slope - 1e-12, right >= slope - 1e-12],
    ))
}

/// Errors after n iterations are not below the n-th power of what two iterations contract by.
fn left_sides() -> Result<Vec<String>> {
    let (count, width, overlap) = (4, 40, 20);
    let cells = count * (width - overlap) + overlap;
    let line = Line { face: FaceDensity::Exact, ..square(cells)? };
    let ranges: Vec<[usize; 2]> = (0..count).map(|s| [s * (width - overlap), s * (width - overlap) + width]).collect();
    let history = from_uniform(&line, &ranges, super::NONLINEAR, exactly(61))?;
    let sine = (std::f64::consts::PI / (2.0 * (count as f64 + 1.0))).sin();
    let rho = 1.0 - sine * sine;
    let low = line.density.extremes(0.0, line.ends)?[0];
    // ‖e⁰‖₂ is at most the root of the number of its entries times the largest of them
    let whole = line.density.integral(0.0, 0.0, 1.0)?;
    let start = (2.0 * count as f64).sqrt() * whole * history.iterates[0].error / low;
    let after = |n: usize| history.iterates[n].error;
    let (printed, right) = (rho.powi(61) * start, rho.powi(30) * start);
    let mut row = row(
        [
            "theorem 6.5",
            "‖xⁿ − x‖ ≤ ρⁿ …",
            "‖x²ⁿ⁺¹ − x‖ ≤ ρⁿ …",
            "4 subdomains, r = ½, M = x² + 1, after 61 iterations, with a start at least as large as the theorem's: \
             the bound is at least the error",
        ],
        [format!("{printed:.1e} for {:.1e}", after(61)), format!("{right:.1e} for {:.1e}", after(61))],
        [printed >= after(61), right >= after(61)],
    );
    if printed >= after(61) {
        row[6] = "misprint by its own proof; no run tells, the printed bound has room".into();
    }
    Ok(row)
}

/// A mesh relaxes in a time of τ, not of 1.
fn relaxation() -> Result<Vec<String>> {
    let line = square(100)?;
    let old = line.mapped(|xi| xi * xi);
    let (dt, tau) = (1e-6, 0.01);
    let moved = |ratio: f64| -> Result<f64> {
        let x = line.solve(0.0, &old, Some((&old, ratio)))?.0;
        Ok((x[50] - old[50]) / dt)
    };
    // MMPDE5 at the start: τ x_t = (M x_ξ)_ξ = ((ξ⁴ + 1) 2ξ)_ξ = 10 ξ⁴ + 2
    let rate = (10.0 * 0.5_f64.powi(4) + 2.0) / tau;
    let [printed, right] = [moved(1.0 / dt)?, moved(tau / dt)?];
    let near = |v: f64| (v / rate - 1.0).abs() < 0.2;
    Ok(row(
        [
            "(1.3)",
            "x_t = (M x_ξ)_ξ",
            "x_t = (1/τ)(M x_ξ)_ξ, as in MMPDE5",
            &format!(
                "M = x² + 1, x = ξ², τ = .01, one step of 1e-6: speed of the middle node, {rate} at the start by MMPDE5"
            ),
        ],
        [format!("{printed:.1}"), format!("{right:.1}")],
        [near(printed), near(right)],
    ))
}

fn hundred() -> Result<Vec<String>> {
    let line = layer(100)?;
    let mesh = line.solve(0.0, &line.uniform(), None)?.0;
    let jump = |mesh: &[f64]| {
        let u = line.density.followed(0.0, mesh).unwrap_or_default();
        u.windows(2).map(|u| 2.0 * (u[1] - u[0]).abs()).fold(0.0, f64::max)
    };
    let factor = jump(&line.uniform()) / jump(&mesh);
    let said = |claim: f64| format!("{factor:.1} in place of {claim}");
    Ok(row(
        ["text on table 8.1", "reduced by nearly a factor of 100", "of 10", "table 8.1, first over last column, ours"],
        [said(100.0), said(10.0)],
        [factor > 80.0, (8.0..12.0).contains(&factor)],
    ))
}

fn jumps() -> Result<Vec<String>> {
    let line = layer(100)?;
    let uniform = line.uniform();
    let off = line.interpolation_error(0.0, &uniform).unwrap_or(f64::NAN);
    let u = line.density.followed(0.0, &uniform).unwrap_or_default();
    let jump = u.windows(2).map(|u| 2.0 * (u[1] - u[0]).abs()).fold(0.0, f64::max);
    Ok(row(
        ["table 8.1", "interpolation errors", "2 max |u_i − u_{i−1}|", "uniform mesh of 100 cells: .3625"],
        [format!("{off:.4}"), format!("{jump:.4}")],
        [(off - 0.3625).abs() < 5e-5, (jump - 0.3625).abs() < 5e-5],
    ))
}
