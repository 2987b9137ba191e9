use super::columns::{Columns, LOWER, UPPER};
use super::energy::{Energy, Phase, total};
use super::front::{self, Filter, Method};
use super::heat::{HeatStep, carry};
use super::implicit::Response;
use crate::error::{Error, Failure, Result};
use crate::laplacian::Laplacian;
use crate::numerics::larger;
use crate::numerics::linear::Robust;
use crate::work::Work;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How temperatures are transferred to the new mesh.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Transfer {
    /// By a term −w ∂u/∂y in the heat equation on the new mesh, w being the velocity of the nodes.
    #[default]
    Ale,
    /// By linear interpolation along the columns before the step. Less accurate.
    Interpolate,
}

/// The temperatures whose flux moves the front.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Stepping {
    /// Those at the start of the step, whose length is then limited by stability.
    #[default]
    Explicit,
    /// Those at the end of the step, found by Newton's method, without a limit.
    Implicit,
}

/// Conditions on the left and the right side.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Sides {
    /// No flux: mesh and temperatures are mirrored.
    #[default]
    Neumann,
    /// Temperatures and the height of the front are given by the exact solution.
    Exact,
}

/// The data of a problem.
pub trait Problem: Sync {
    /// Temperature on a wall, and on sides with given values.
    fn boundary(&self, phase: usize, x: [f64; 2], t: f64) -> f64;

    /// Temperature at the start.
    fn initial(&self, phase: usize, x: [f64; 2]) -> f64;

    /// Height of the front at the start.
    fn initial_front(&self, x: f64) -> f64;

    /// Height of the exact front, on sides with given values and wherever it is known.
    fn exact_front(&self, x: f64, t: f64) -> Option<f64>;

    /// The exact temperature where it is known.
    fn exact(&self, x: [f64; 2], t: f64) -> Option<f64>;
}

/// A front between two phases, with the scheme that advances it.
#[derive(Debug)]
pub struct Front {
    /// Columns and walls.
    pub columns: Columns,
    /// Diffusivities D of the lower and the upper phase.
    pub diffusivity: [f64; 2],
    /// L, the inverse of the latent heat.
    pub mobility: f64,
    /// How the front is moved.
    pub method: Method,
    /// How temperatures are transferred to the new mesh.
    pub transfer: Transfer,
    /// Smoothing of the front's velocity over three neighbouring columns.
    pub filter: Filter,
    /// The temperatures whose flux moves the front.
    pub stepping: Stepping,
    /// Conditions on the left and the right side.
    pub sides: Sides,
    /// The discrete Laplacian, of nine points.
    pub laplacian: Laplacian,
    /// Linear solvers of both phases.
    solvers: [Robust<1>; 2],
    /// Time step and response of the last step.
    pub(super) response: Option<(f64, Response)>,
}

/// A front with the temperatures of both phases.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FrontState {
    /// Time.
    pub t: f64,
    /// Steps done.
    pub step: usize,
    /// Height of the front at each column.
    pub front: Vec<f64>,
    /// Temperatures below and above it, column by column.
    pub u: [Vec<f64>; 2],
    /// Balance of energy.
    pub energy: Energy,
}

/// Names, for messages, of the initial temperatures by phase.
pub(crate) const INITIAL: [&str; 2] =
    ["the initial temperature of the lower phase", "the initial temperature of the upper phase"];

impl Front {
    /// A front with the default method: graph, ALE, filter (1, 6, 1), explicit, no flux through the sides.
    ///
    /// # Errors
    /// [`Error::Invalid`] unless diffusivities and mobility are positive.
    pub fn new(columns: Columns, diffusivity: [f64; 2], mobility: f64) -> Result<Self> {
        for (key, value, rule) in [
            ("phase.lower.diffusivity", diffusivity[LOWER], "must be above 0"),
            ("phase.upper.diffusivity", diffusivity[UPPER], "must be above 0"),
            ("front.mobility", mobility, "must be above 0: it is the inverse of the latent heat"),
        ] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(Error::invalid(key, value, rule));
            }
        }
        Ok(Self {
            columns,
            diffusivity,
            mobility,
            method: Method::default(),
            transfer: Transfer::default(),
            filter: Filter::default(),
            stepping: Stepping::default(),
            sides: Sides::default(),
            laplacian: Laplacian::default(),
            solvers: Default::default(),
            response: None,
        })
    }

    pub(super) fn mirrored(&self) -> bool {
        self.sides == Sides::Neumann
    }

    /// The state at the start.
    ///
    /// # Errors
    /// As [`Columns::check`]; [`Failure::NonFinite`] where a temperature is not finite; [`Failure::WrongSide`].
    pub fn start(&self, problem: &dyn Problem, t: f64) -> Result<FrontState> {
        let front: Vec<f64> = self.columns.x().iter().map(|&x| problem.initial_front(x)).collect();
        self.columns.check(&front)?;
        let u = [LOWER, UPPER].map(|phase| {
            let y = self.columns.heights(phase, &front);
            let nodes = self.columns.rows(phase) + 1;
            let [on_front, _] = self.columns.ends(phase);
            let value = |k: usize| match k % nodes {
                j if j == on_front => 0.0,
                _ => problem.initial(phase, [self.columns.x()[k / nodes], y[k]]),
            };
            (0..y.len()).map(value).collect::<Vec<f64>>()
        });
        for phase in [LOWER, UPPER] {
            if let Some(k) = u[phase].iter().position(|u| !u.is_finite()) {
                let y = self.columns.heights(phase, &front)[k];
                return Err(self.columns.not_finite(INITIAL[phase], u[phase][k], phase, k, y).into());
            }
        }
        let mut state = FrontState { t, step: 0, front, u, energy: Energy::default() };
        let slopes = self.slopes(&state.front, &state.u);
        front::check_warm_below(&self.columns, &state.front, &slopes, self.diffusivity)?;
        let content = self.contents(&state.front, &state.u).map(|content| content[0]);
        let energy = total(&self.columns, &state.front, content, self.mobility);
        state.energy = Energy { start: energy, now: energy, ..Energy::default() };
        Ok(state)
    }

    pub(super) fn heights(&self, h: &[f64]) -> [Vec<f64>; 2] {
        [LOWER, UPPER].map(|phase| self.columns.heights(phase, h))
    }

    /// Slopes of the temperatures u of both phases at a front.
    pub(super) fn slopes(&self, h: &[f64], u: &[Vec<f64>; 2]) -> [Vec<f64>; 2] {
        front::slopes(&self.columns, &self.heights(h), u)
    }

    fn contents(&self, h: &[f64], u: &[Vec<f64>; 2]) -> [[f64; 2]; 2] {
        let y = self.heights(h);
        [LOWER, UPPER].map(|phase| Phase { columns: &self.columns, phase, y: &y[phase], u: &u[phase] }.content())
    }

    /// The longest step for which the explicit front is stable, as estimated from the temperatures at the front.
    pub fn limit(&self, state: &FrontState) -> f64 {
        front::limit(&self.columns, &self.slopes(&state.front, &state.u), self.diffusivity, self.mobility, self.filter)
    }

    /// A step to time `t`; the state changes only if it succeeds.
    ///
    /// # Errors
    /// [`Failure::FrontUnstable`] where an explicit step is too long; those of [`Columns::check`] for the new front;
    /// [`Failure::WrongSide`]; [`Failure::NonFinite`]; [`Failure::NewtonStalled`]; [`Failure::LinearStalled`].
    pub fn step(&mut self, problem: &dyn Problem, state: &mut FrontState, t: f64) -> Result<Work> {
        let dt = t - state.t;
        let slopes = self.slopes(&state.front, &state.u);
        front::check_warm_below(&self.columns, &state.front, &slopes, self.diffusivity)?;
        let mut work = Work::default();
        let (h, u) = match self.stepping {
            Stepping::Explicit => {
                let limit = front::limit(&self.columns, &slopes, self.diffusivity, self.mobility, self.filter);
                if dt > limit {
                    return Err(Failure::FrontUnstable { dt, limit }.into());
                }
                let h = self.moved(problem, &state.front, &state.front, &slopes, t, dt)?;
                self.columns.check(&h)?;
                let u = self.conduct(problem, state, &h, t)?;
                work.linear_solves += 2;
                (h, u)
            }
            Stepping::Implicit => self.newton(problem, state, &slopes, t, &mut work)?,
        };
        let slopes = self.slopes(&h, &u);
        front::check_warm_below(&self.columns, &h, &slopes, self.diffusivity)?;
        state.energy = self.balance(state, &h, &u, dt);
        (state.front, state.u, state.t) = (h, u, t);
        state.step += 1;
        Ok(work)
    }

    /// The front after a step from `from`, moved by the jump of the heat flux that belongs to the front `at`.
    pub(super) fn moved(
        &self,
        problem: &dyn Problem,
        from: &[f64],
        at: &[f64],
        slopes: &[Vec<f64>; 2],
        t: f64,
        dt: f64,
    ) -> Result<Vec<f64>> {
        let mirrored = self.mirrored();
        let jump = self.filter.apply(&front::jump(slopes, self.diffusivity), mirrored);
        let tilt = front::tilt(&self.columns, at, mirrored);
        let factor = dt * self.mobility;
        let mut h = match self.method {
            Method::Graph => front::graph(from, &tilt, &jump, factor),
            Method::Segments => front::segments(&self.columns, from, &tilt, &jump, factor, mirrored)?,
        };
        self.hold_ends(problem, &mut h, t);
        Ok(h)
    }

    /// Moves the ends of a front to where the exact one is at time `t`, if that is given on the sides.
    pub(super) fn hold_ends(&self, problem: &dyn Problem, h: &mut [f64], t: f64) {
        if !self.mirrored() {
            let last = h.len() - 1;
            for i in [0, last] {
                h[i] = problem.exact_front(self.columns.x()[i], t).unwrap_or(h[i]);
            }
        }
    }

    /// Temperatures at time `t`, when the front is at `h`.
    pub(super) fn conduct(
        &mut self,
        problem: &dyn Problem,
        state: &FrontState,
        h: &[f64],
        t: f64,
    ) -> Result<[Vec<f64>; 2]> {
        let dt = t - state.t;
        let (old, new) = (self.heights(&state.front), self.heights(h));
        let mut out = [Vec::new(), Vec::new()];
        for phase in [LOWER, UPPER] {
            let nodes = self.columns.rows(phase) + 1;
            let [front, wall] = self.columns.ends(phase);
            let last = self.columns.x().len() - 1;
            let mut u = state.u[phase].clone();
            let velocity = velocity(&old[phase], &new[phase], dt);
            if self.transfer == Transfer::Interpolate {
                for i in 0..=last {
                    let part = i * nodes..(i + 1) * nodes;
                    let [y, new] = [&old, &new].map(|y| &y[phase][part.clone()]);
                    carry(y, &state.u[phase][part.clone()], front, new, &mut u[part]);
                }
            }
            let mut sides = u.clone();
            for k in 0..sides.len() {
                let (i, j) = (k / nodes, k % nodes);
                let given = j == wall || !self.mirrored() && (i == 0 || i == last);
                if j == front {
                    sides[k] = 0.0;
                } else if given {
                    let y = new[phase][k];
                    sides[k] = problem.boundary(phase, [self.columns.x()[i], y], t);
                    if !sides[k].is_finite() {
                        let what = "the boundary temperature";
                        return Err(self.columns.not_finite(what, sides[k], phase, k, y).into());
                    }
                }
            }
            let step = HeatStep {
                columns: &self.columns,
                phase,
                diffusivity: self.diffusivity[phase],
                dt,
                y: &new[phase],
                velocity: (self.transfer == Transfer::Ale).then_some(&velocity),
                u: &u,
                sides: &sides,
                mirrored: self.mirrored(),
            };
            out[phase] = step.solve(&mut self.solvers[phase], self.laplacian)?;
        }
        Ok(out)
    }

    /// The balance of energy after a step to (h, u).
    fn balance(&self, state: &FrontState, h: &[f64], u: &[Vec<f64>; 2], dt: f64) -> Energy {
        let (old, new) = (self.heights(&state.front), self.heights(h));
        let [before, after] = [self.contents(&state.front, &state.u), self.contents(h, u)];
        let mut energy = state.energy;
        energy.now = total(&self.columns, h, after.map(|content| content[0]), self.mobility);
        for phase in [LOWER, UPPER] {
            let d = self.diffusivity[phase];
            let at = Phase { columns: &self.columns, phase, y: &new[phase], u: &u[phase] };
            let velocity = velocity(&old[phase], &new[phase], dt);
            energy.inflow += after[phase][1] - before[phase][1] + dt * at.flow(d, &velocity);
            energy.inflow_by_differences += dt * at.wall_flux(d);
            if !self.mirrored() {
                let [all, unseen] = at.side_fluxes(d);
                energy.inflow += dt * unseen;
                energy.inflow_by_differences += dt * all;
            }
        }
        energy
    }

    /// Largest errors of the front and of the temperature, where the problem knows the exact solution.
    pub fn errors(&self, problem: &dyn Problem, state: &FrontState) -> Option<[f64; 2]> {
        let x = self.columns.x();
        let mut worst = [0.0, 0.0];
        for (&x, &h) in x.iter().zip(&state.front) {
            worst[0] = larger(worst[0], h - problem.exact_front(x, state.t)?);
        }
        for phase in [LOWER, UPPER] {
            let nodes = self.columns.rows(phase) + 1;
            for (k, (y, u)) in self.columns.heights(phase, &state.front).iter().zip(&state.u[phase]).enumerate() {
                worst[1] = larger(worst[1], u - problem.exact([x[k / nodes], *y], state.t)?);
            }
        }
        Some(worst)
    }
}

/// Velocities of nodes that have moved from `old` to `new` heights.
fn velocity(old: &[f64], new: &[f64], dt: f64) -> Vec<f64> {
    old.iter().zip(new).map(|(a, b)| (b - a) / dt).collect()
}
