//! Studies of kind `poisson`: the formulas of the equation and of its sides.

use super::mapped::parse;
use super::poisson::{Equation, ExactSolution, PoissonStudy};
use crate::error::{Error, Failure, Result};
use crate::formula::{Formula, Program};
use crate::geometry::{Lattice, Mesh, node_areas};
use crate::laplacian::{Poisson, outward};
use crate::numerics::sum;
use crate::physics::{Condition, Conditions, SIDES};

/// Formulas of x and y.
const VARIABLES: [&str; 2] = ["x", "y"];

/// What holds on a side.
#[derive(Debug, Clone)]
pub(super) enum OnSide {
    /// The value of u, and the key that gives it; that of the exact solution where there is none.
    Value(Option<(Program<2, 1>, String)>),
    /// D n·∇u with n outward, and its derivative by u, of x, y and u, and the key that gives it; those of the exact
    /// solution where there is none.
    Flux(Option<(Program<3, 2>, String)>),
}

/// The formulas of a study, compiled.
pub(super) struct Data {
    /// u, u_x, u_y, u_xx and u_yy.
    pub exact: Option<Program<2, 5>>,
    pub source: Option<Program<2, 1>>,
    /// D and its gradient; 1 where there is none.
    pub diffusivity: Option<Program<2, 3>>,
    /// The lower and the upper side across each axis.
    pub sides: [[OnSide; 2]; 2],
}

impl Data {
    /// Which sides have a flux.
    pub fn fluxes(&self) -> [[bool; 2]; 2] {
        self.sides.each_ref().map(|ends| ends.each_ref().map(|end| matches!(end, OnSide::Flux(_))))
    }
}

impl PoissonStudy {
    /// The formulas: what is not given follows from the exact solution.
    pub(super) fn data(&self) -> Result<Data> {
        let read = |key: &str, text: &str| parse(&format!("equation.{key}"), text, &VARIABLES);
        let diffusivity = self.equation.diffusivity.as_deref().map(diffusivity).transpose()?;
        let exact = self.exact.as_ref().map(|ExactSolution { u }| exact(u)).transpose()?;
        let source = match &self.equation.source {
            Some(text) => Some(Program::new([&read("source", text)?])),
            None if exact.is_some() => None,
            None => return Err(missing("source")),
        };
        let mut sides: [[OnSide; 2]; 2] = [const { [const { OnSide::Value(None) }; 2] }; 2];
        let closed = self.closed();
        self.check_conditions(closed)?;
        for (axis, ends) in sides.iter_mut().enumerate() {
            for (end, side) in ends.iter_mut().enumerate() {
                *side = self.side((axis, end))?;
                let unknown = matches!(side, OnSide::Value(None) | OnSide::Flux(None));
                if unknown && exact.is_none() && !closed[axis] {
                    return Err(missing(if self.is_neumann((axis, end)) { "flux" } else { "boundary" }));
                }
            }
        }
        Ok(Data { exact, source, diffusivity, sides })
    }

    /// Which axes are closed, and have no sides.
    fn closed(&self) -> [bool; 2] {
        self.domain.closed.as_ref().map_or([false; 2], |closed| **closed)
    }

    fn is_neumann(&self, (axis, end): (usize, usize)) -> bool {
        self.sides.neumann.iter().any(|side| side.place() == (axis, end == 1))
    }

    /// Refuses conditions on sides that are not there, sides that are left out, and what is said twice.
    fn check_conditions(&self, closed: [bool; 2]) -> Result<()> {
        let Equation { boundary, flux, .. } = &self.equation;
        let told = match boundary {
            None | Some(Conditions::All(Condition::Value(_))) => return Ok(()),
            Some(_) if flux.is_some() => Some(("equation.flux", "given")),
            Some(_) if !self.sides.neumann.is_empty() => Some(("sides.neumann", "given")),
            Some(_) => None,
        };
        if let Some((key, value)) = told {
            let rule = "equation.boundary says what holds on the sides; leave one of both out";
            return Err(Error::invalid(key, value, rule));
        }
        let Some(Conditions::Each(each)) = boundary else { return Ok(()) };
        let there: Vec<&str> = (0..2).filter(|&d| !closed[d]).flat_map(|d| SIDES[d]).collect();
        let all = there.join(", ");
        if let Some(side) = each.keys().find(|side| !there.contains(&side.as_str())) {
            let rule = format!("there is no such side; the sides here are {all}");
            return Err(Error::invalid(format!("equation.boundary.{side}"), "given", rule));
        }
        match there.iter().find(|side| !each.contains_key(**side)) {
            Some(side) if self.exact.is_none() => {
                let rule = format!("the sides here are {all}; add {side} = \"no-flux\" or another condition");
                Err(Error::invalid("equation.boundary", format!("not given for `{side}`"), rule))
            }
            _ => Ok(()),
        }
    }

    /// What holds on a side.
    fn side(&self, (axis, end): (usize, usize)) -> Result<OnSide> {
        let Equation { boundary, flux, .. } = &self.equation;
        if self.is_neumann((axis, end)) {
            let of_u = |text: &String| read_flux("equation.flux", text);
            return Ok(OnSide::Flux(flux.as_ref().map(of_u).transpose()?));
        }
        let name = SIDES[axis][end];
        let (key, condition) = match boundary {
            None => return Ok(OnSide::Value(None)),
            Some(Conditions::All(condition)) => ("equation.boundary".to_string(), Some(condition)),
            Some(Conditions::Each(each)) => (format!("equation.boundary.{name}"), each.get(name)),
        };
        Ok(match condition {
            None => OnSide::Value(None),
            Some(Condition::Value(text)) => OnSide::Value(Some((Program::new([&parse(&key, text, &VARIABLES)?]), key))),
            // nothing is carried here
            Some(Condition::NoFlux | Condition::Outflow) => OnSide::Flux(Some(read_flux(&key, "0")?)),
            Some(Condition::Flux(text)) => OnSide::Flux(Some(read_flux(&format!("{key}.flux"), text)?)),
        })
    }

    /// Refuses fluxes on all sides that do not bring in what the source takes, by integrals on finer meshes, which tell
    /// their own error.
    pub(super) fn check_balance(&self, data: &Data) -> Result<()> {
        let lattice = Lattice::new(self.grid.cells, self.closed()).map_err(|error| error.within("grid"))?;
        let fluxes = data.fluxes();
        let held = (0..2).any(|d| !lattice.periodic()[d] && fluxes[d] != [true; 2]);
        if held || data.exact.is_some() && data.source.is_none() && self.all_exact(data, &lattice) {
            return Ok(());
        }
        let balances = [2, 4].map(|n| {
            let mesh = self.domain.mesh(self.grid.cells.map(|cells| n * cells), self.grid.grading)?;
            Balance::on(&mesh, data)
        });
        let [coarse, fine] = balances;
        let (coarse, fine) = (coarse?, fine?);
        if fine.robin {
            return Ok(());
        }
        let limit = |coarse: f64, fine: f64| fine + (fine - coarse) / 3.0;
        let [inflow, source] = [limit(coarse.inflow, fine.inflow), limit(coarse.source, fine.source)];
        let doubt = (fine.inflow - coarse.inflow).abs() + (fine.source - coarse.source).abs();
        if (inflow - source).abs() <= doubt.max(UNBALANCED * fine.size) {
            return Ok(());
        }
        let value = "a flux on all sides";
        let rule = format!(
            "{inflow:.6e} flows in and the integral of the source is {source:.6e}, a defect of {:.1e}: nothing is \
             steady then; change equation.source or a flux, or give u on a side",
            inflow - source
        );
        Err(Error::invalid("equation.boundary", value, rule))
    }

    /// Whether all that holds on the sides follows from the exact solution.
    fn all_exact(&self, data: &Data, lattice: &Lattice<2>) -> bool {
        let sides = data.sides.iter().zip(lattice.periodic()).filter(|(_, closed)| !closed);
        sides.flat_map(|(ends, _)| ends).all(|side| matches!(side, OnSide::Value(None) | OnSide::Flux(None)))
    }
}

/// Largest gap between inflow and source, as a share of what flows, with which a problem without given values counts as
/// balanced.
const UNBALANCED: f64 = 1e-6;

/// Integrals over a domain and its sides.
#[derive(Debug, Default)]
struct Balance {
    inflow: f64,
    source: f64,
    /// The integrals of the magnitudes of both.
    size: f64,
    /// Whether a flux depends on u.
    robin: bool,
}

impl Balance {
    fn on(mesh: &Mesh<2>, data: &Data) -> Result<Self> {
        let mut balance = Self::default();
        let source = source(mesh, data, &vec![true; mesh.x().len()])?;
        let areas = node_areas(mesh);
        balance.source = sum(areas.iter().zip(&source).map(|(area, f)| area * f));
        balance.size = sum(areas.iter().zip(&source).map(|(area, f)| area * f.abs()));
        let lattice = mesh.lattice();
        for axis in (0..2).filter(|&axis| !lattice.periodic()[axis]) {
            for end in 0..2 {
                let nodes: Vec<usize> = lattice.side(axis, end).collect();
                let flux = |index: usize| on_side(mesh, data, index, (axis, end == 1));
                let turn = lattice.periodic()[1 - axis].then(|| [nodes[nodes.len() - 1], nodes[0]]);
                let pairs = nodes.windows(2).map(|pair| [pair[0], pair[1]]).chain(turn);
                for [a, b] in pairs {
                    let [p, q] = [mesh.x()[a], mesh.x()[b]];
                    let length = (p[0] - q[0]).hypot(p[1] - q[1]);
                    let ([a, c], [b, d]) = (flux(a)?, flux(b)?);
                    balance.inflow += 0.5 * length * (a + b);
                    balance.size += 0.5 * length * (a.abs() + b.abs());
                    balance.robin |= c != 0.0 || d != 0.0;
                }
            }
        }
        Ok(balance)
    }
}

/// f at the nodes where it counts, 0 elsewhere.
pub(super) fn source(mesh: &Mesh<2>, data: &Data, counts: &[bool]) -> Result<Vec<f64>, Failure> {
    let mut f = vec![0.0; mesh.x().len()];
    for k in (0..f.len()).filter(|&k| counts[k]) {
        f[k] = match (&data.source, &data.exact) {
            (Some(program), _) => program.eval(mesh.x()[k], &[])[0],
            (None, Some(exact)) => {
                let [_, u_x, u_y, u_xx, u_yy] = exact.eval(mesh.x()[k], &[]);
                match data.diffusivity.as_ref().map(|d| d.eval(mesh.x()[k], &[])) {
                    None => u_xx + u_yy,
                    Some([d, d_x, d_y]) => d * (u_xx + u_yy) + d_x * u_x + d_y * u_y,
                }
            }
            (None, None) => 0.0,
        };
        let what = if data.source.is_some() { "equation.source" } else { "the source by exact.u" };
        finite(mesh, k, what, f[k])?;
    }
    Ok(f)
}

/// What holds at a node of a side, (axis, upper): u and 0, or D n·∇u for u = 0 and its derivative by u.
pub(super) fn on_side(mesh: &Mesh<2>, data: &Data, k: usize, at: (usize, bool)) -> Result<[f64; 2], Failure> {
    let x = mesh.x()[k];
    let exact = || data.exact.as_ref().map_or([0.0; 5], |exact| exact.eval(x, &[]));
    let (found, what) = match &data.sides[at.0][usize::from(at.1)] {
        OnSide::Value(Some((program, key))) => ([program.eval(x, &[])[0], 0.0], key.as_str()),
        OnSide::Value(None) => ([exact()[0], 0.0], "exact.u"),
        OnSide::Flux(Some((program, key))) => (program.eval([x[0], x[1], 0.0], &[]), key.as_str()),
        OnSide::Flux(None) => {
            let ([_, u_x, u_y, ..], n) = (exact(), outward(mesh, k, at));
            let d = data.diffusivity.as_ref().map_or(1.0, |d| d.eval(x, &[])[0]);
            ([d * (n[0] * u_x + n[1] * u_y), 0.0], "a derivative of exact.u")
        }
    };
    found.iter().try_for_each(|value| finite(mesh, k, what, *value))?;
    Ok(found)
}

pub(super) fn finite(mesh: &Mesh<2>, k: usize, what: &str, value: f64) -> Result<(), Failure> {
    match value.is_finite() {
        true => Ok(()),
        false => {
            let at = mesh.node_place(k);
            Err(Failure::Formula { what: what.into(), value, at, given: Vec::new() })
        }
    }
}

/// What the formulas give for the system.
pub(super) struct Given {
    pub source: Vec<f64>,
    pub side: Vec<f64>,
    pub robin: Vec<f64>,
    pub diffusivity: Vec<f64>,
}

impl Given {
    /// At all nodes of the sides, and the source where it counts.
    pub fn at(mesh: &Mesh<2>, data: &Data, counts: &[bool]) -> Result<Self, Failure> {
        let lattice = mesh.lattice();
        let problem = Poisson { neumann: data.fluxes(), ..Poisson::default() };
        let (mut side, mut robin) = (vec![0.0; lattice.len()], vec![0.0; lattice.len()]);
        let mut diffusivity = vec![1.0; lattice.len()];
        for k in lattice.sides() {
            let beyond = lattice.beyond(k);
            let there = |&(d, end): &(usize, bool)| beyond[d][usize::from(end)];
            let is_value = |&(d, end): &(usize, bool)| !problem.neumann[d][usize::from(end)];
            let mut all = [(0, false), (0, true), (1, false), (1, true)].into_iter().filter(there);
            // a corner with a value on one of its sides has that
            let at = problem.neumann_side(lattice, k).or_else(|| all.find(is_value)).unwrap_or((0, false));
            [side[k], robin[k]] = on_side(mesh, data, k, at)?;
            if let Some(d) = &data.diffusivity {
                [diffusivity[k], ..] = d.eval(mesh.x()[k], &[]);
                if !(diffusivity[k] > 0.0 && diffusivity[k].is_finite()) {
                    let (what, at) = ("the diffusivity", mesh.node_place(k));
                    return Err(Failure::NotPositive { what, value: diffusivity[k], at });
                }
            }
        }
        Ok(Self { source: source(mesh, data, counts)?, side, robin, diffusivity })
    }
}

fn missing(key: &str) -> Error {
    Error::invalid(format!("equation.{key}"), "not given", "add it, or the exact solution: exact.u")
}

/// u, its gradient, u_xx and u_yy.
fn exact(text: &str) -> Result<Program<2, 5>> {
    let slope = |f: &Formula, d| f.derivative(d).map_err(|mistake| mistake.of("exact.u", text));
    let u = parse("exact.u", text, &VARIABLES)?;
    let [x, y] = [slope(&u, 0)?, slope(&u, 1)?];
    Ok(Program::new([&u, &x, &y, &slope(&x, 0)?, &slope(&y, 1)?]))
}

/// D and its gradient.
fn diffusivity(text: &str) -> Result<Program<2, 3>> {
    let key = "equation.diffusivity";
    let d = parse(key, text, &VARIABLES)?;
    let slope = |axis| d.derivative(axis).map_err(|mistake| mistake.of(key, text));
    Ok(Program::new([&d, &slope(0)?, &slope(1)?]))
}

/// A flux and its derivative by u, which it must be linear in.
fn read_flux(key: &str, text: &str) -> Result<(Program<3, 2>, String)> {
    let flux = parse(key, text, &["x", "y", "u"])?;
    let by_u = flux.derivative(2).map_err(|mistake| mistake.of(key, text))?;
    if by_u.depends_on(2) {
        let message = "a flux of poisson is at most linear in u".to_string();
        let help = Some("write a + b*u with formulas a and b of x and y, or take a study of kind moving-mesh".into());
        return Err(Error::Formula { key: key.into(), text: text.into(), at: 0..text.len(), message, help });
    }
    Ok((Program::new([&flux, &by_u]), key.into()))
}
