//! Section 2: the linear generator of the inverse, (2.2), and the mesh equation that is not divided by ρ.

use super::{BURGERS, WHOLE, settings, study};
use crate::{Options, Rerun, Table};
use driftmesh::Work;
use driftmesh::equidistribution::{FaceDensity, Line, LineDensity};
use driftmesh::error::{Failure, Result};
use driftmesh::geometry::{Density, Lattice, Mesh};
use driftmesh::meshing::{MeshGenerator, Mmpde, Moved, Whole};
use driftmesh::mover::Mover;
use driftmesh::simulation::{Record, Simulation};

pub fn generators(options: Options) -> Result<Rerun> {
    Ok(vec![inverse()?, undivided(options)?].into())
}

/// The mesh by (2.2), (ξ_x/ρ)_x = 0 on equal cells in x, turned round by linear interpolation
///
/// Between nodes the flux ξ_x/ρ is the same, so that ξ grows in each cell by its share of ∫ρ: the solution of the
/// linear
/// system in closed form, with the harmonic mean of 1/ρ over a cell, which the average of `line` stands for.
fn by_inverse(line: &Line) -> Result<Vec<f64>> {
    let x = line.uniform();
    let mut xi = vec![0.0];
    for share in line.shares(0.0, &x)? {
        xi.push(xi[xi.len() - 1] + share);
    }
    let n = line.cells;
    let whole = xi[n];
    let mut k = 0;
    let place = |i: usize| {
        let wanted = whole * i as f64 / n as f64;
        while k + 1 < n && xi[k + 1] < wanted {
            k += 1;
        }
        x[k] + (x[k + 1] - x[k]) * ((wanted - xi[k]) / (xi[k + 1] - xi[k])).clamp(0.0, 1.0)
    };
    Ok((0..=n).map(place).collect())
}

/// Makes a density given by a formula.
type Analytic = fn() -> Result<LineDensity>;

fn inverse() -> Result<Table> {
    let mut table = Table::new(
        "(2.1) and (2.2): the nonlinear generator of x(ξ), and the linear one of ξ(x) turned round by linear \
         interpolation",
        &["ρ", "cells", "error of x, (2.1)", "order", "error of x, (2.2)", "order", "Newton steps of (2.1)"],
    );
    let densities: [(&str, Analytic); 3] = [
        ("x² + 1", || LineDensity::formula("x^2 + 1")),
        ("boundary layer", || LineDensity::arclength("(1 - exp(20*x)) / (1 - exp(20))")),
        ("1 + 100 exp(−1000(x − ½)²)", || LineDensity::formula("1 + 100*exp(-1000*(x - 0.5)^2)")),
    ];
    for (name, density) in densities {
        let mut before: Option<[f64; 2]> = None;
        for cells in [20, 80, 320] {
            let line = Line { face: FaceDensity::Trapezoid, ..Line::new(density()?, cells) };
            let xi: Vec<f64> = (0..=cells).map(|i| i as f64 / cells as f64).collect();
            let exact = line.exact(0.0, &xi)?;
            let off = |x: &[f64]| x.iter().zip(&exact).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            let (direct, solves) = line.solve(0.0, &line.uniform(), None)?;
            let found = [off(&direct), off(&by_inverse(&line)?)];
            let order = |k: usize| before.map_or(String::new(), |b| format!("{:.2}", (b[k] / found[k]).log(4.0)));
            table.row([
                name.to_string(),
                cells.to_string(),
                format!("{:.2e}", found[0]),
                order(0),
                format!("{:.2e}", found[1]),
                order(1),
                solves.to_string(),
            ]);
            before = Some(found);
        }
    }
    table.note(
        "against the continuous mesh; ρ is averaged by trapezoids in both. (2.2) is one linear solve, here in closed \
         form. Its cells are equal in x, those of (2.1) lie where ρ is large: which of both is nearer depends on ρ",
    );
    Ok(table)
}

/// The mesh equation x_t = (1/τ) ∇·(ρ∇x): the row of a node as if its own step were ρΔt, solved by Gauss–Seidel sweeps.
struct Undivided;

/// Sweeps after which the reference counts as not solved.
const SWEEPS: usize = 20_000;
/// Largest change of a node in a sweep below which the reference counts as solved, in units of the box.
const EXACT: f64 = 1e-13;

impl Undivided {
    /// Solves for the free coordinate of the nodes of a lattice that have neighbours on both sides along all axes.
    fn relaxed<const D: usize>(
        equation: &Mmpde,
        lattice: &Lattice<D>,
        rho: &Density,
        dt: f64,
        x: &mut [f64],
    ) -> Result<(), Failure> {
        let operator = equation.operator(lattice, rho, dt)?;
        let (nodes, strides) = (lattice.nodes(), lattice.strides());
        let old = x.to_vec();
        let inner: Vec<usize> = (0..lattice.len())
            .filter(|k| {
                let place = lattice.node(*k);
                (0..D).all(|d| place[d] > 0 && place[d] + 1 < nodes[d])
            })
            .collect();
        let mut largest = f64::INFINITY;
        for _ in 0..SWEEPS {
            largest = 0.0_f64;
            for &k in &inner {
                let (mut sum, mut drawn) = (0.0, 0.0);
                for d in 0..D {
                    let [below, above] = operator.weights()[k][d].map(|w| w * rho.largest()[k]);
                    sum += below + above;
                    drawn += below * x[k - strides[d]] + above * x[k + strides[d]];
                }
                let new = (old[k] + drawn) / (1.0 + sum);
                largest = largest.max((new - x[k]).abs());
                x[k] = new;
            }
            if largest <= EXACT {
                return Ok(());
            }
        }
        Err(Failure::LinearStalled { unknowns: inner.len(), residual: largest, tolerance: EXACT, iterations: SWEEPS })
    }
}

impl MeshGenerator for Undivided {
    fn solve(&mut self, equation: &Mmpde, mesh: &Mesh<2>, rho: &Density, dt: f64) -> Result<Moved, Failure> {
        let lattice = mesh.lattice();
        let (cells, nodes, strides) = (lattice.cells(), lattice.nodes(), lattice.strides());
        let mut x = mesh.x().to_vec();
        for across in 0..2 {
            let along = 1 - across;
            let line = Lattice::<1>::new([cells[along]], [false]).map_err(|_| Failure::WrongLength {
                what: "a side",
                found: cells[along],
                expected: 1,
            })?;
            for end in [0, cells[across]] {
                let place = |i: usize| end * strides[across] + i * strides[along];
                let side: Density = (0..nodes[along]).map(|i| rho.largest()[place(i)]).collect();
                let mut own: Vec<f64> = (0..nodes[along]).map(|i| x[place(i)][along]).collect();
                Self::relaxed(equation, &line, &side, dt, &mut own)?;
                own.iter().enumerate().for_each(|(i, v)| x[place(i)][along] = *v);
            }
        }
        for d in 0..2 {
            // what starts a sweep inside is the old mesh; sides have their new places
            let mut own: Vec<f64> = x.iter().map(|x| x[d]).collect();
            Self::relaxed(equation, lattice, rho, dt, &mut own)?;
            x.iter_mut().zip(own).for_each(|(x, v)| x[d] = v);
        }
        Ok(Moved { mesh: mesh.moved(x)?, work: Work::default(), interface: None })
    }
}

fn undivided(options: Options) -> Result<Table> {
    let mut table = Table::new(
        "The remark on (2.4): dividing by ρ before relaxing “gives better meshes”. Burgers' equation, 41², one domain",
        &["density", "form", "τ", "l_inf at .75", "1", "1.25", "Q max at the end", "verdict"],
    )
    .ruled(
        "the claim is about meshes, so that Q counts as well as the error. “holds” where the divided form has the \
         smaller error at every time and the smaller Q max, both beside the undivided one with the same τ, “does not \
         hold” where both are larger, “neither” where they say different things; a form that ends early has lost. \
         The paper gives no figures",
    );
    let ten =
        |passes: usize| vec!["monitor.strength={relative=10.0}".to_string(), format!("monitor.smoothing={passes}")];
    let cases = [
        ("strength 10, no smoothing", ten(0), 1.0),
        ("strength 10, 1 pass", ten(1), 1.0),
        ("strength 30, 2 passes", settings(&["monitor.strength={relative=30.0}", "monitor.smoothing=2"]), 1.0),
        ("strength 10, 1 pass", ten(1), 0.2),
    ];
    for (label, density, tau) in cases.into_iter().take(if options.quick { 2 } else { 4 }) {
        let all =
            [density.as_slice(), &[format!("mesh.relaxation={tau:?}"), WHOLE.into()], &settings(&super::NO_SAFETY)]
                .concat();
        let divided = errors(&all, Box::<Whole>::default())?;
        let other = errors(&all, Box::new(Undivided))?;
        let verdict = match (&divided, &other) {
            (Ok((a, q)), Ok((b, r))) if q < r && a.iter().zip(b).all(|(a, b)| a < b) => "holds",
            (Ok((a, q)), Ok((b, r))) if q > r && a.iter().zip(b).all(|(a, b)| a > b) => "does not hold",
            (Ok(_), Err(_)) => "holds",
            (Err(_), Ok(_)) => "does not hold",
            _ => "neither",
        };
        for (form, found) in [("divided, (2.4)", divided), ("undivided", other)] {
            let cells = match found {
                Ok((errors, q)) => {
                    errors.iter().map(|e| format!("{e:.4}")).chain([format!("{q:.3}")]).collect::<Vec<_>>()
                }
                Err(why) => vec![why, "–".into(), "–".into(), "–".into()],
            };
            let said = if form == "undivided" { "" } else { verdict };
            let head = [label.to_string(), form.into(), tau.to_string()];
            table.row(head.into_iter().chain(cells).chain([said.into()]));
        }
    }
    table.note(
        "undivided: x_t = (1/τ) ∇·(ρ∇x). With the same τ it follows ρ times as fast, so that τ is not quite \
         the same in both",
    );
    if options.quick {
        table.note("quick: two of four densities");
    }
    Ok(table)
}

/// l_inf at the three times and the largest Q at the end; or why it ended.
type Errors = std::result::Result<([f64; 3], f64), String>;

fn errors(all: &[String], generator: Box<dyn MeshGenerator>) -> Result<Errors> {
    let study = study(BURGERS, all)?;
    let mut simulation: Simulation = study.simulation()?;
    let equation = simulation.mover.equation;
    simulation.mover = Mover::by(generator, equation);
    let mut record = Record::default();
    let mut state = study.start(&simulation, &mut Record::default(), &mut [])?;
    if let Err(failure) = simulation.run(&mut state, &mut record, &mut []) {
        return Ok(Err(super::ended(&failure)));
    }
    let at = |k: usize| record.reports[k].error.map_or(f64::NAN, |error| error.linf);
    Ok(Ok(([at(0), at(1), at(2)], record.reports[2].quality.q_max)))
}
