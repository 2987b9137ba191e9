//! Mesh and equation together, (1.2), and Schwarz methods stopped early in every step: what section 9 asks for.

use super::{LINEARISED, NONLINEAR, exactly, two, until};
use crate::{Rerun, Table};
use driftmesh::equidistribution::{Line, LineDensity, Method};
use driftmesh::error::{Act, Error, Failure, Moment, Remedy, Result, Setting};
use driftmesh::numerics::linear::tridiagonal;

/// Burgers' equation u_t + (u²/2)_x = ν u_xx with the front u = 1/(1 + exp((x − x₀ − t/2)/(2ν))).
const VISCOSITY: f64 = 0.005;
const X0: f64 = 0.25;
const CELLS: usize = 60;
const STEPS: usize = 250;
const DT: f64 = 2e-3;
/// Relaxation time τ of the mesh equation MMPDE5.
const RELAXATION: f64 = 0.02;
/// Largest change of a node between two rounds of mesh and solution below which the mesh counts as that of the coupled
/// system, in units of the domain.
const SETTLED: f64 = 1e-8;
const MOST_ROUNDS: usize = 50;
const MOST_NEWTON: usize = 50;
/// Two errors count as the same where they differ by less than this share.
const SAME: f64 = 0.05;
const RULE: &str = "“as good” where the error of u is within 5 % of that on one domain with the same number of \
     rounds; else the ratio of both. A mesh out of order ends a run by name";

/// How the mesh of a step is found.
#[derive(Debug, Clone, Copy)]
enum Way<'a> {
    Whole,
    Subdomains { ranges: &'a [[usize; 2]], method: Method, iterations: Option<usize> },
}

/// What a run came to.
struct Run {
    mesh: Vec<f64>,
    error: f64,
    solves: usize,
    /// Rounds of mesh and equation in all steps.
    rounds: usize,
}

pub fn coupled() -> Result<Rerun> {
    let mut table = Table::new(
        format!(
            "Burgers' equation on a moving mesh in one dimension, (1.2): {CELLS} cells, {STEPS} steps to t = {}",
            STEPS as f64 * DT
        ),
        &["mesh", "subdomains", "rounds a step", "solves a step", "error of u", "distance of the mesh", "verdict"],
    )
    .ruled(RULE);
    let four = [[0, 18], [12, 33], [27, 48], [42, 60]];
    let pair = two([27, 33], CELLS);
    let mut alone = Vec::new();
    for together in [false, true] {
        let whole = run(Way::Whole, together)?;
        alone.push((whole.error, whole.solves));
        table.row(row("one domain", 1, &whole, &whole));
        for (count, ranges) in [(2, pair.as_slice()), (4, four.as_slice())] {
            for (kind, method) in [("nonlinear", NONLINEAR), ("linearised", LINEARISED)] {
                for iterations in [Some(1), Some(2), Some(4), Some(8), None] {
                    // linearised iterations to the end, and rounds of many, take minutes
                    let few = !together
                        || method == NONLINEAR && (iterations == Some(2) || iterations.is_none() && count == 2);
                    if !few || iterations.is_none() && method == LINEARISED {
                        continue;
                    }
                    let how = match iterations {
                        None => "to 1e-8".into(),
                        Some(1) => "1 iteration".into(),
                        Some(n) => format!("{n} iterations"),
                    };
                    let label = format!("{kind}, {how}");
                    match run(Way::Subdomains { ranges, method, iterations }, together) {
                        Ok(found) => table.row(row(&label, count, &found, &whole)),
                        Err(Error::Failed { failure, moment }) => {
                            let at = moment.map_or(String::new(), |m| format!(" in step {}", m.step));
                            let dash = || "–".to_string();
                            let said = format!("{}{at}", failure.name());
                            table.row([label, count.to_string(), dash(), dash(), dash(), dash(), said]);
                        }
                        Err(other) => return Err(other),
                    }
                }
            }
        }
    }
    notes(&mut table, &alone);
    Ok(vec![table].into())
}

/// `alone`: error and solves of one domain, after one round a step and after rounds to the end.
fn notes(table: &mut Table, alone: &[(f64, usize)]) {
    table.note(
        "one round is the MP procedure: the mesh by MMPDE5 with M of the last solution, then the equation. More are \
         (MP)^∞: M of the newest solution, from the same old state, until the mesh changes by less than 1e-8: then \
         mesh and solution solve (1.2) together",
    );
    table.note(format!(
        "M: arc length of u at the nodes, linear between them; τ = {RELAXATION}; u by finite volumes that move, \
         backward Euler; error against u = 1/(1 + exp((x − {X0} − t/2)/(2ν))), ν = {VISCOSITY}; overlaps of 6 cells, \
         each step from the last mesh"
    ));
    table.note(format!(
        "solving both together is no gain here: on one domain the error is {:.3e} against {:.3e} after one round a \
         step, at {:.1} times the linear solves",
        alone[1].0,
        alone[0].0,
        alone[1].1 as f64 / alone[0].1 as f64
    ));
}

fn row(label: &str, subdomains: usize, found: &Run, whole: &Run) -> Vec<String> {
    let distance = found.mesh.iter().zip(&whole.mesh).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    let ratio = found.error / whole.error;
    let said = match subdomains {
        1 => String::new(),
        _ if (ratio - 1.0).abs() <= SAME => "as good".into(),
        _ => format!("{ratio:.3} times the error"),
    };
    let a_step = |n: usize| format!("{:.1}", n as f64 / STEPS as f64);
    vec![
        label.into(),
        subdomains.to_string(),
        a_step(found.rounds),
        a_step(found.solves),
        format!("{:.3e}", found.error),
        format!("{distance:.1e}"),
        said,
    ]
}

fn exact(t: f64, x: f64) -> f64 {
    1.0 / (1.0 + ((x - X0 - 0.5 * t) / (2.0 * VISCOSITY)).exp())
}

fn run(way: Way<'_>, together: bool) -> Result<Run> {
    // adapted to the first solution
    let start = Line::new(LineDensity::function(|_, x| x.iter().map(|x| arc_length(*x)).collect()), CELLS);
    let mut mesh = start.solve(0.0, &start.uniform(), None)?.0;
    let mut u: Vec<f64> = mesh.iter().map(|x| exact(0.0, *x)).collect();
    let (mut solves, mut rounds) = (0, 0);
    for step in 1..=STEPS {
        let t = step as f64 * DT;
        let at = |failure: Failure| Error::Failed { failure, moment: Some(Moment { t, step }) };
        let (old, before) = (mesh.clone(), u.clone());
        let mut density = sampled(&old, &before)?;
        for _ in 0..if together { MOST_ROUNDS } else { 1 } {
            let (next, cost) = moved(way, density, &old)?;
            in_order(&next).map_err(at)?;
            u = stepped(t, &old, &next, &before).map_err(at)?;
            solves += cost;
            rounds += 1;
            let change = next.iter().zip(&mesh).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            mesh = next;
            density = sampled(&mesh, &u)?;
            if change <= SETTLED {
                break;
            }
        }
    }
    let t = STEPS as f64 * DT;
    let error = mesh.iter().zip(&u).map(|(x, u)| (u - exact(t, *x)).abs()).fold(0.0, f64::max);
    Ok(Run { mesh, error, solves, rounds })
}

/// M and M′ of the first solution.
fn arc_length(x: f64) -> [f64; 2] {
    let u = exact(0.0, x);
    let slope = -u * (1.0 - u) / (2.0 * VISCOSITY);
    let second = -slope * (1.0 - 2.0 * u) / (2.0 * VISCOSITY);
    let m = slope.hypot(1.0);
    [m, slope * second / m]
}

/// M at the nodes of a solution, linear between them.
fn sampled(x: &[f64], u: &[f64]) -> Result<LineDensity> {
    let n = x.len() - 1;
    let slope = |i: usize| {
        let (a, b) = (i.saturating_sub(1), (i + 1).min(n));
        (u[b] - u[a]) / (x[b] - x[a])
    };
    LineDensity::sampled(x.to_vec(), (0..=n).map(|i| slope(i).hypot(1.0)).collect())
}

/// The mesh after a step, and its linear solves.
fn moved(way: Way<'_>, density: LineDensity, old: &[f64]) -> Result<(Vec<f64>, usize)> {
    let line = Line::new(density, CELLS);
    let before = Some((old, RELAXATION / DT));
    match way {
        Way::Whole => line.solve(0.0, old, before),
        Way::Subdomains { ranges, method, iterations } => {
            let stop = iterations.map_or_else(|| until(SETTLED), exactly);
            let history = line.iterate(0.0, ranges, method, old, before, stop)?;
            let solves = history.iterates[history.count()].linear_solves;
            Ok((history.mesh, solves))
        }
    }
}

fn in_order(mesh: &[f64]) -> Result<(), Failure> {
    match (1..mesh.len()).find(|&i| mesh[i].is_nan() || mesh[i] <= mesh[i - 1]) {
        None => Ok(()),
        Some(node) => Err(Failure::LineFolded { node, x: mesh[node], left: mesh[node - 1], iterations: 0 }),
    }
}

/// The solution after a step: finite volumes between the middles of cells, which move with the nodes
///
/// ```text
/// (V_i u_i)ⁿ⁺¹ − (V_i u_i)ⁿ + Δt (F_{i+½} − F_{i−½})ⁿ⁺¹ = 0,   F = ū²/2 − w ū − ν u_x,   ū²: the mean of both squares
/// ```
///
/// V_i = (x_{i+1} − x_{i−1})/2 and w the velocity of a middle, so that a constant stays one.
fn stepped(t: f64, old: &[f64], new: &[f64], u: &[f64]) -> Result<Vec<f64>, Failure> {
    let n = new.len() - 1;
    let mut next = u.to_vec();
    (next[0], next[n]) = (exact(t, new[0]), exact(t, new[n]));
    let velocity = |i: usize| 0.5 * (new[i] + new[i + 1] - old[i] - old[i + 1]) / DT;
    let width = |x: &[f64], i: usize| 0.5 * (x[i + 1] - x[i - 1]);
    for _ in 0..MOST_NEWTON {
        // flux of a cell, and its derivatives by both nodes
        let flux = |i: usize| {
            let (a, b, w, d) = (next[i], next[i + 1], velocity(i), VISCOSITY / (new[i + 1] - new[i]));
            [0.25 * (a * a + b * b) - 0.5 * w * (a + b) - d * (b - a), 0.5 * (a - w) + d, 0.5 * (b - w) - d]
        };
        let mut rows = vec![[0.0, 1.0, 0.0]; n + 1];
        let mut residual = vec![0.0; n + 1];
        for i in 1..n {
            let ([f, f_a, f_b], [g, g_a, g_b]) = (flux(i - 1), flux(i));
            residual[i] = width(new, i) * next[i] - width(old, i) * u[i] + DT * (g - f);
            rows[i] = [-DT * f_a, width(new, i) + DT * (g_a - f_b), DT * g_b];
        }
        let change = tridiagonal(&rows, &residual);
        next.iter_mut().zip(&change).for_each(|(u, c)| *u -= c);
        if change.iter().all(|c| c.abs() <= 1e-13) {
            return Ok(next);
        }
    }
    let remedies = vec![Remedy::any([Act::Lower(Setting::TimeStep)])];
    Err(Failure::LineStalled { residual: f64::NAN, iterations: MOST_NEWTON, remedies })
}
