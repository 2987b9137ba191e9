use super::balance::Instant;
use super::columns::{Columns, LOWER, UPPER};
use super::conduct::Fields;
use super::energy::Energy;
use super::events::PhaseEvent;
use super::front::{self, Filter, Method};
use super::heat::Solver;
use super::material::Material;
use super::response::Response;
use crate::error::{Error, Failure, Result};
use crate::laplacian::Laplacian;
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

/// How a step advances front and temperatures.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Stepping {
    /// The front moves by the heat flux at the start of the step, then temperatures take a step of implicit Euler.
    /// First order in time; stability limits the step.
    Explicit,
    /// Front and temperatures together by TR-BDF2, each stage by Newton's method. Second order in time, without a
    /// limit.
    #[default]
    Implicit,
}

/// The condition on the left or the right side.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Side {
    /// No flux: mesh and temperatures are mirrored.
    #[default]
    Insulated,
    /// The problem gives temperatures and the height of the front.
    Given,
    /// The problem gives what flows in.
    Flux,
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

    /// Temperature on a side with given values.
    fn side(&self, phase: usize, x: [f64; 2], t: f64) -> f64 {
        self.boundary(phase, x, t)
    }

    /// Height of the front between the walls on a side with given values; none where it is nowhere.
    fn side_front(&self, x: f64, _walls: [f64; 2], t: f64) -> Option<f64> {
        self.exact_front(x, t)
    }

    /// Flux of heat k ∂u/∂n into the box through the left (0) or the right side (1), and its derivative by u; none
    /// where nothing flows.
    fn side_flux(&self, _side: usize, _x: [f64; 2], _u: f64, _t: f64) -> Option<[f64; 2]> {
        None
    }

    /// Flux of heat k ∂u/∂n into the phase through its wall, and its derivative by the temperature u of the wall; none
    /// where [`boundary`](Self::boundary) gives the temperature. A wall has one of both everywhere and always.
    fn flux(&self, _phase: usize, _x: [f64; 2], _u: f64, _t: f64) -> Option<[f64; 2]> {
        None
    }
}

/// A front between two phases, with the scheme that advances it.
#[derive(Debug)]
pub struct Front {
    /// Columns and walls.
    pub columns: Columns,
    /// What conducts, stores and melts.
    pub material: Material,
    /// The phase, if there is one, that is a melt below its melting temperature and freezes into itself.
    pub undercooled: Option<usize>,
    /// How the front is moved.
    pub method: Method,
    /// How temperatures are transferred to the new mesh.
    pub transfer: Transfer,
    /// Smoothing of the front's velocity over three neighbouring columns.
    pub filter: Filter,
    /// How a step advances front and temperatures.
    pub stepping: Stepping,
    /// Conditions on the left and the right side.
    pub sides: [Side; 2],
    /// The discrete Laplacian, of nine points.
    pub laplacian: Laplacian,
    /// Linear solvers of both phases.
    pub(super) solvers: [Solver; 2],
    /// Iterations of the linear solvers in the last step.
    pub(super) spent: Work,
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
    /// The phase that fills the box, if one does: the front then lies on the wall of the other one.
    pub alone: Option<usize>,
    /// At each column the phase, if there is one, that is missing while it is there at other columns: its wall is bare,
    /// and the other phase reaches it.
    pub bare: Vec<Option<usize>>,
    /// Balance of energy.
    pub energy: Energy,
    /// The way of the front in the mean over the columns, and by how much it would be another one if gradients at the
    /// front were taken over four rows in place of three.
    pub way: [f64; 2],
}

impl FrontState {
    pub(super) fn of(fields: Fields, (t, step): (f64, usize), energy: Energy, way: [f64; 2]) -> Self {
        let Fields { h: front, u, alone, bare } = fields;
        Self { t, step, front, u, alone, bare, energy, way }
    }

    pub(super) fn fields(&self) -> Fields {
        Fields { h: self.front.clone(), u: self.u.clone(), alone: self.alone, bare: self.bare.clone() }
    }
}

/// What a step comes to.
#[derive(Debug, Clone)]
pub struct Attempt<S = FrontState> {
    /// The state after the step.
    pub state: S,
    /// The work that the step took.
    pub work: Work,
    /// Its estimated error, where there is one: of an implicit step of a [`Front`] the larger one of the front's, as a
    /// share of its distance from the nearer wall, and of the temperature's, as a share of its range.
    pub error: Option<f64>,
    /// A phase that has appeared or vanished.
    pub event: Option<PhaseEvent>,
}

/// Names, for messages, of the initial temperatures by phase.
pub(crate) const INITIAL: [&str; 2] =
    ["the initial temperature of the lower phase", "the initial temperature of the upper phase"];

impl Front {
    /// A front with the default method: graph, ALE, filter (1, 6, 1), implicit, no flux through the sides.
    pub fn new(columns: Columns, material: Material) -> Self {
        Self {
            columns,
            material,
            undercooled: None,
            method: Method::default(),
            transfer: Transfer::default(),
            filter: Filter::default(),
            stepping: Stepping::default(),
            sides: [Side::default(); 2],
            laplacian: Laplacian::default(),
            solvers: Default::default(),
            spent: Work::default(),
            response: None,
        }
    }

    /// Λ of Λ V = k₀ ∂u₀/∂n − k₁ ∂u₁/∂n: negative where the upper phase is the melt.
    pub(super) fn latent_heat(&self) -> f64 {
        if self.undercooled == Some(UPPER) { -self.material.latent_heat } else { self.material.latent_heat }
    }

    /// Whether the left and the right side are insulated.
    pub(super) fn mirrored(&self) -> [bool; 2] {
        self.sides.map(|side| side == Side::Insulated)
    }

    /// Whether temperatures and the front are given on the left and the right side.
    pub(super) fn held(&self) -> [bool; 2] {
        self.sides.map(|side| side == Side::Given)
    }

    /// Whether temperatures and the front are given at a column.
    pub(super) fn held_at(&self, i: usize) -> bool {
        let [left, right] = self.held();
        left && i == 0 || right && i + 1 == self.columns.x().len()
    }

    /// The state at the start.
    ///
    /// # Errors
    /// As [`Columns::check`]; [`Failure::NonFinite`] where a temperature is not finite; [`Failure::WrongSide`].
    pub fn start(&self, problem: &dyn Problem, t: f64) -> Result<FrontState> {
        let front: Vec<f64> = self.columns.x().iter().map(|&x| problem.initial_front(x)).collect();
        let alone = self.fills(&front);
        if alone.is_none() {
            self.columns.check(&front, &[])?;
        }
        let u = [LOWER, UPPER].map(|phase| {
            let y = self.columns.heights(phase, &front);
            let nodes = self.columns.rows(phase) + 1;
            let [on_front, _] = self.columns.ends(phase);
            let value = |k: usize| match k % nodes {
                j if j == on_front && alone.is_none() => self.material.melting,
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
        let bare = vec![None; front.len()];
        let fields = Fields { h: front, u, alone, bare };
        let content = self.content(&fields);
        let energy = Energy { start: content, now: content, ..Energy::default() };
        let state = FrontState::of(fields, (t, 0), energy, [0.0; 2]);
        self.check_warm_below(&state)?;
        Ok(state)
    }

    /// A step to time `t`; the state changes only if it succeeds.
    ///
    /// # Errors
    /// [`Failure::FrontUnstable`] where an explicit step is too long; those of [`Columns::check`] for the new front;
    /// [`Failure::WrongSide`]; [`Failure::NonFinite`]; [`Failure::NewtonStalled`]; [`Failure::LinearStalled`].
    pub fn step(&mut self, problem: &dyn Problem, state: &mut FrontState, t: f64) -> Result<Work> {
        let attempt = self.attempt(problem, state, t)?;
        *state = attempt.state;
        Ok(attempt.work)
    }

    /// What a step to time `t` would come to. A phase may vanish in it, and one may appear, everywhere or in part.
    ///
    /// # Errors
    /// As [`step`](Self::step).
    pub fn attempt(&mut self, problem: &dyn Problem, state: &FrontState, t: f64) -> Result<Attempt> {
        if let Some((mut from, event)) = self.appear(problem, state, t)? {
            from.step = state.step;
            if from.t >= t {
                from.step += 1;
                return Ok(Attempt { state: from, work: Work::default(), error: None, event: Some(event) });
            }
            return Ok(Attempt { event: Some(event), ..self.plain(problem, &from, t)? });
        }
        let covered = self.covered(problem, state, t);
        let state = covered.as_ref().unwrap_or(state);
        match self.plain(problem, state, t) {
            Err(Error::Failed {
                failure: failure @ (Failure::FrontOutside { .. } | Failure::VanishingPhase { .. }),
                ..
            }) => self.cross(problem, state, t, failure),
            other => other,
        }
    }

    /// A step in which no phase vanishes or appears.
    pub(super) fn plain(&mut self, problem: &dyn Problem, state: &FrontState, t: f64) -> Result<Attempt> {
        self.check_warm_below(state)?;
        self.spent = Work::default();
        let slopes = match state.alone {
            Some(_) => Default::default(),
            None => self.slopes(&state.front, &state.u, &state.bare),
        };
        let (end, energy, mut work, error) = match self.stepping {
            Stepping::Explicit if state.alone.is_none() => self.explicit(problem, state, &slopes, t)?,
            _ => self.tr_bdf2(problem, state, &slopes, t)?,
        };
        work += Work { linear_solves: 0, ..self.spent };
        let mut end = FrontState::of(end, (t, state.step + 1), energy, state.way);
        if end.alone.is_none() {
            let pace = self.pace(&end);
            end.way = [0, 1].map(|k| end.way[k] + (t - state.t) * pace[k]);
        }
        self.check_walls(&end)?;
        self.check_warm_below(&end)?;
        Ok(Attempt { state: end, work, error, event: None })
    }

    fn explicit(
        &mut self,
        problem: &dyn Problem,
        state: &FrontState,
        slopes: &[Vec<f64>; 2],
        t: f64,
    ) -> Result<(Fields, Energy, Work, Option<f64>)> {
        let dt = t - state.t;
        let limit = front::limit(&self.columns, slopes, &self.material, self.filter);
        if dt > limit {
            return Err(Failure::FrontUnstable { dt, limit }.into());
        }
        let from = state.fields();
        let h = self.moved(problem, &from, &from.h, slopes, [t, dt])?;
        self.columns.check(&h, &from.bare)?;
        let u = self.conduct(problem, &from, (&h, &from.u), [t, dt])?;
        let end = Fields { h, u, ..from };
        let instant = Instant { t, dt, fields: &end, from: &state.front, over: dt };
        let energy = self.balance(problem, state, &end, &[instant]);
        Ok((end, energy, Work { linear_solves: 2, ..Work::default() }, None))
    }

    /// The front after a step of `dt` to `t`, moved by the jump of the heat flux that belongs to the front `at`. It
    /// stays where a wall is bare.
    pub(super) fn moved(
        &self,
        problem: &dyn Problem,
        from: &Fields,
        at: &[f64],
        slopes: &[Vec<f64>; 2],
        [t, dt]: [f64; 2],
    ) -> Result<Vec<f64>> {
        let mirrored = self.mirrored();
        let mut jump = front::jump(slopes, self.material.conductivity);
        // the filter sees no other jump beyond the end of a phase
        for i in (0..jump.len()).filter(|&i| from.bare[i].is_some()) {
            let beside = [i.wrapping_sub(1), i + 1].into_iter().find(|&k| from.bare.get(k) == Some(&None));
            jump[i] = beside.map_or(0.0, |k| jump[k]);
        }
        let jump = self.filter.apply(&jump, mirrored);
        let tilt = front::tilt(&self.columns, at, mirrored);
        let factor = dt / self.latent_heat();
        let mut h = match self.method {
            Method::Graph => front::graph(&from.h, &tilt, &jump, factor),
            Method::Segments => front::segments(&self.columns, &from.h, &tilt, &jump, factor, mirrored)?,
        };
        self.hold_ends(problem, &mut h, t);
        for (i, h) in h.iter_mut().enumerate().filter(|(i, _)| from.bare[*i].is_some()) {
            *h = from.h[i];
        }
        Ok(h)
    }

    /// Moves the ends of a front to where it is at time `t` on sides that give that.
    pub(super) fn hold_ends(&self, problem: &dyn Problem, h: &mut [f64], t: f64) {
        for i in [0, h.len() - 1].into_iter().filter(|&i| self.held_at(i)) {
            let walls = [LOWER, UPPER].map(|phase| self.columns.wall(phase)[i]);
            h[i] = problem.side_front(self.columns.x()[i], walls, t).unwrap_or(h[i]);
        }
    }
}
