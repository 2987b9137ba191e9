//! Steps in time.

use super::newton::Solved;
use super::repair::{repair, settle};
use super::transport::Transport;
use super::{Around, Block, Excess, FiniteVolumes, Half, Law, Limited, Side, Stepper, inside, sides, stretched};
use crate::error::Failure;
use crate::geometry::{Cells, DualCells, Mesh, check_finite, padded};
use crate::numerics::larger;
use crate::numerics::linear::LinearSolver;
use crate::physics::Motion;
use crate::work::Work;

/// A mesh with what is measured of it, and the time at which nodes stand there.
struct Level<'a, const B: usize, const D: usize, const S: usize> {
    t: f64,
    mesh: &'a Mesh<D>,
    cells: DualCells<D>,
    /// Positions, padded.
    x: Vec<[f64; D]>,
    /// Coupling of the mass of neighbours, with the weights of all unknowns.
    excess: Option<Excess<B, D, S>>,
    weights: [f64; B],
    /// Whether values given on sides are others than those that the solution has there.
    jumps: bool,
}

impl<'a, const B: usize, const D: usize, const S: usize> Level<'a, B, D, S>
where
    Mesh<D>: Cells<D>,
    for<'b> Half<'b, D>: Around<D, S>,
{
    fn new<L: Law<B, D>>(law: &L, t: f64, mesh: &'a Mesh<D>, known: Option<DualCells<D>>, weights: [f64; B]) -> Self {
        Self {
            t,
            mesh,
            cells: known.unwrap_or_else(|| law.cells(mesh)),
            x: padded(mesh.lattice(), mesh.x(), mesh.jump()),
            excess: weights.iter().any(|weight| *weight != 0.0).then(|| Excess::of(mesh, weights)),
            weights,
            jumps: false,
        }
    }

    /// What faces sweep on the way to a later level, and how they are stretched by it.
    fn ways(&self, later: &Self) -> [Vec<[f64; D]>; 2] {
        let stretched = match self.excess {
            Some(_) => stretched([&self.cells, &later.cells], [&self.x, &later.x]),
            None => Vec::new(),
        };
        [self.cells.swept(&later.cells), stretched]
    }

    fn half<'b>(&'b self, dt: f64, [swept, stretched]: &'b [Vec<[f64; D]>; 2]) -> Half<'b, D> {
        Half { dt, t: self.t, mesh: self.mesh, cells: &self.cells, x: &self.x, swept, stretched }
    }

    /// M u for each node, u being what is stored.
    fn mass<L: Law<B, D>>(&self, law: &L, u: &[[f64; B]]) -> Result<Vec<[f64; B]>, Failure> {
        let stored = law.stored((self.t, &inside(self.mesh, &self.x), u), self.mesh)?;
        let of = |(i, k): (usize, usize)| {
            let area = self.cells.areas()[i];
            let more = self.excess.as_ref().map_or([0.0; B], |excess| excess.product(i, k, |n| u[n]));
            let stored = stored.get(k).map_or(u[k], |stored| stored.value);
            std::array::from_fn(|c| area * stored[c] + more[c])
        };
        Ok(self.cells.patch().places().enumerate().map(of).collect())
    }
}

/// Side values jump at the start of a step where they differ from the values there by more than this share of the size
/// of the unknown; less is rounding.
const JUMP: f64 = 1e-6;
/// γ, the share of a step that the trapezoid does: with it both stages have the same matrix.
const FIRST_STAGE: f64 = 2.0 - std::f64::consts::SQRT_2;

impl<const B: usize, const D: usize, Solver> FiniteVolumes<B, D, Solver> {
    /// The solution on the new mesh, with one value for each node and unknown.
    #[allow(private_bounds)] // what lies around a face is known here alone
    pub fn step<const S: usize, L: Law<B, D>>(
        &mut self,
        law: &L,
        motion: Motion<'_, D>,
        start: &[[f64; B]],
    ) -> Result<(Vec<[f64; B]>, Work), Failure>
    where
        Mesh<D>: Cells<D>,
        Solver: LinearSolver<D, S, B, Block<B>>,
        for<'a> Half<'a, D>: Around<D, S>,
    {
        let Motion { t, dt, old, new } = motion;
        let known = self.newest.take().filter(|(mesh, _)| mesh == old).map(|(_, cells)| cells);
        let weights = law.weights(t, old, start);
        let (mut old, new) = (Level::new(law, t, old, known, weights), Level::new(law, t + dt, new, None, weights));
        let mut u = padded(old.mesh.lattice(), start, [[0.0; B]; D]);
        // initial values may contradict those given on sides, which hold from the first moment on
        let mut jumps = [0.0; B];
        for side in sides(law, t, old.mesh) {
            for c in 0..B {
                let given = side.given[c].unwrap_or(u[side.k][c]);
                jumps[c] = larger(jumps[c], given - u[side.k][c]);
                u[side.k][c] = given;
            }
        }
        <Half<'_, D> as Around<D, S>>::repeat_sides(old.cells.patch(), &mut u);
        let jumps: [bool; B] = std::array::from_fn(|c| jumps[c] > JUMP * u.iter().fold(0.0, |m, u| larger(m, u[c])));
        if jumps.contains(&true) {
            // what has no time derivative is at any time what the others make of it
            let stored = law.stored((t, &inside(old.mesh, &old.x), &u), old.mesh)?;
            let changes = |c: usize| stored.is_empty() || stored.iter().any(|stored| stored.by_value[c] != [0.0; B]);
            old.jumps = (0..B).any(|c| jumps[c] && changes(c));
        }
        let (values, work) = match law.limited().unknowns.contains(&true) {
            true => self.carried(law, motion, [&old, &new], u),
            false => self.solved(law, [&old, &new], u, &[]),
        }?;
        self.newest = Some((new.mesh.clone(), new.cells));
        Ok((values, work))
    }

    /// A step in which some unknowns are carried by limited fluxes: these, then what is implicit; and both again where
    /// the second has an influence on the first, which is then of the second order, too.
    fn carried<const S: usize, L: Law<B, D>>(
        &mut self,
        law: &L,
        motion: Motion<'_, D>,
        [old, new]: [&Level<'_, B, D, S>; 2],
        u: Vec<[f64; B]>,
    ) -> Result<(Vec<[f64; B]>, Work), Failure>
    where
        Mesh<D>: Cells<D>,
        Solver: LinearSolver<D, S, B, Block<B>>,
        for<'a> Half<'a, D>: Around<D, S>,
    {
        let Limited { unknowns, implicit, coupled } = law.limited();
        let shares: &[f64] = match law.stepper() {
            Stepper::Trapezoid => &[1.0],
            Stepper::TrBdf2 => &[FIRST_STAGE, 1.0],
        };
        let (carried, substeps) = Transport::new(law, motion, [&u, &u], &[]).carried::<S>(shares)?;
        let mut work = Work { substeps, ..Work::default() };
        if !implicit {
            let carried = &carried[shares.len() - 1];
            let values = old.mass(law, &u)?.into_iter().zip(carried).zip(new.cells.areas());
            let mut values: Vec<[f64; B]> =
                values.map(|((mass, carried), area)| std::array::from_fn(|c| (mass[c] + carried[c]) / area)).collect();
            for side in sides(law, new.t, new.mesh) {
                let value = &mut values[side.i];
                (0..B).for_each(|c| value[c] = side.given[c].unwrap_or(value[c]));
            }
            within(&bounds(law, new, &sides(law, new.t, new.mesh), &u)?, &mut values);
            check_finite(law.names(), new.mesh, &values)?;
            return Ok((values, work));
        }
        let (values, cost) = self.solved(law, [old, new], u.clone(), &carried)?;
        work += cost;
        if !coupled {
            return Ok((values, work));
        }
        let end = padded(new.mesh.lattice(), &values, [[0.0; B]; D]);
        let all = &carried[shares.len() - 1];
        let brought: Vec<[f64; B]> = (old.mass(law, &u)?.into_iter().zip(new.mass(law, &end)?).zip(all))
            .map(|((before, after), carried)| {
                let brought = |c: usize| if unknowns[c] { after[c] - before[c] - carried[c] } else { 0.0 };
                std::array::from_fn(brought)
            })
            .collect();
        let (carried, substeps) = Transport::new(law, motion, [&u, &end], &brought).carried::<S>(shares)?;
        work.substeps += substeps;
        let (values, cost) = self.solved(law, [old, new], u, &carried)?;
        work += cost;
        Ok((values, work))
    }

    /// What is implicit in a step; `carried` is what limited fluxes bring to the dual cells up to each stage of the
    /// stepper, if anything.
    fn solved<const S: usize, L: Law<B, D>>(
        &mut self,
        law: &L,
        levels: [&Level<'_, B, D, S>; 2],
        u: Vec<[f64; B]>,
        carried: &[Vec<[f64; B]>],
    ) -> Result<(Vec<[f64; B]>, Work), Failure>
    where
        Mesh<D>: Cells<D>,
        Solver: LinearSolver<D, S, B, Block<B>>,
        for<'a> Half<'a, D>: Around<D, S>,
    {
        match law.stepper() {
            Stepper::Trapezoid => self.trapezoid(law, levels, u, carried.first()),
            Stepper::TrBdf2 => self.tr_bdf2(law, levels, u, carried),
        }
    }

    /// ½ of the fluxes at both ends of a step; all of those at its end where side values jump at its start: the
    /// trapezoid would turn what is thinner than a step into oscillations of its size.
    ///
    /// # Source
    /// Rannacher, *Finite element solution of diffusion problems with irregular data* (1984).
    fn trapezoid<const S: usize, L: Law<B, D>>(
        &mut self,
        law: &L,
        [old, new]: [&Level<'_, B, D, S>; 2],
        u: Vec<[f64; B]>,
        carried: Option<&Vec<[f64; B]>>,
    ) -> Result<(Vec<[f64; B]>, Work), Failure>
    where
        Mesh<D>: Cells<D>,
        Solver: LinearSolver<D, S, B, Block<B>>,
        for<'a> Half<'a, D>: Around<D, S>,
    {
        let (mut dt, mut ways) = (new.t - old.t, old.ways(new));
        let mut known = match old.jumps {
            true => old.mass(law, &u)?,
            false => old.half(dt, &ways).known(law, old.excess.as_ref(), &u)?,
        };
        if old.jumps {
            // half of these counts
            dt *= 2.0;
            ways.iter_mut().flatten().for_each(|way| *way = way.map(|way| 2.0 * way));
        }
        for (known, carried) in known.iter_mut().zip(carried.into_iter().flatten()) {
            (0..B).for_each(|c| known[c] += carried[c]);
        }
        self.implicit(law, new, &new.half(dt, &ways), &known, &u.clone(), u)
    }

    /// The trapezoid over the share γ of a step, then the second backward difference formula over the rest
    ///
    /// ```text
    /// M³u³ + (1−γ)/(2−γ) Δt (fluxes − A S)³ = a₂ M²u² − a₁ M¹u¹,   a₂ = 1/(γ(2−γ)),   a₁ = (1−γ)²/(γ(2−γ))
    /// ```
    ///
    /// It damps what decays fast in a step, however fast that is. Faces sweep s₁₃ − a₂ s₁₂ in the second stage, so that
    /// constants stay constant.
    ///
    /// # Source
    /// Bank et al., *Transient simulation of silicon devices and circuits* (1985); Hosea and Shampine, *Analysis and
    /// implementation of TR-BDF2* (1996).
    fn tr_bdf2<const S: usize, L: Law<B, D>>(
        &mut self,
        law: &L,
        [old, new]: [&Level<'_, B, D, S>; 2],
        u: Vec<[f64; B]>,
        carried: &[Vec<[f64; B]>],
    ) -> Result<(Vec<[f64; B]>, Work), Failure>
    where
        Mesh<D>: Cells<D>,
        Solver: LinearSolver<D, S, B, Block<B>>,
        for<'a> Half<'a, D>: Around<D, S>,
    {
        let gamma = FIRST_STAGE;
        let (dt, lattice) = (new.t - old.t, old.mesh.lattice());
        let mesh = old.mesh.between(new.mesh, gamma)?;
        let middle = Level::new(law, old.t + gamma * dt, &mesh, None, old.weights);
        let (there, mut work) = self.trapezoid(law, [old, &middle], u.clone(), carried.first())?;
        let there = padded(lattice, &there, [[0.0; B]; D]);

        let scale = 1.0 / (gamma * (2.0 - gamma));
        let (later, earlier) = (scale, scale * (1.0 - gamma) * (1.0 - gamma));
        let mut known = middle.mass(law, &there)?;
        for (known, start) in known.iter_mut().zip(old.mass(law, &u)?) {
            *known = std::array::from_fn(|c| later * known[c] - earlier * start[c]);
        }
        if let [first, whole] = carried {
            for (known, (first, whole)) in known.iter_mut().zip(first.iter().zip(whole)) {
                (0..B).for_each(|c| known[c] += whole[c] - later * first[c]);
            }
        }
        // half of these counts, as half of Δt does
        let [whole, first] = [old.ways(new), old.ways(&middle)];
        let mut ways = whole;
        for (way, first) in ways.iter_mut().flatten().zip(first.iter().flatten()) {
            (0..D).for_each(|d| way[d] = 2.0 * (way[d] - later * first[d]));
        }
        let half = new.half(2.0 * (1.0 - gamma) / (2.0 - gamma) * dt, &ways);
        let (values, cost) = self.implicit(law, new, &half, &known, &u, there)?;
        work += cost;
        Ok((values, work))
    }

    /// The solution at the end of a stage from what is `known` of its beginning, the values at the start of the step,
    /// and a guess.
    fn implicit<const S: usize, L: Law<B, D>>(
        &mut self,
        law: &L,
        level: &Level<'_, B, D, S>,
        half: &Half<'_, D>,
        known: &[[f64; B]],
        start: &[[f64; B]],
        mut u: Vec<[f64; B]>,
    ) -> Result<(Vec<[f64; B]>, Work), Failure>
    where
        Mesh<D>: Cells<D>,
        Solver: LinearSolver<D, S, B, Block<B>>,
        for<'a> Half<'a, D>: Around<D, S>,
    {
        // given values are set from the start
        let sides = sides(law, level.t, level.mesh);
        for side in &sides {
            for (u, given) in u[side.k].iter_mut().zip(side.given) {
                *u = given.unwrap_or(*u);
            }
        }
        let patch = level.cells.patch();
        <Half<'_, D> as Around<D, S>>::repeat_sides(patch, &mut u);
        let bounds = bounds(law, level, &sides, start)?;
        let Solved { residual, work, stalled } =
            self.newton(law, half, level.excess.as_ref(), known, (&sides, &bounds), &mut u)?;
        let mut values: Vec<[f64; B]> = patch.places().map(|k| u[k]).collect();
        // an unknown that is given nowhere has no flux through the sides; only of u itself is the residual one of u
        let plain = law.stored((level.t, &inside(level.mesh, &level.x), &u), level.mesh)?.is_empty();
        settle(&level.cells, &residual, &mut values, |c| plain && sides.iter().all(|side| side.given[c].is_none()));
        within(&bounds, &mut values);
        let empty = law.empty((level.t, &inside(level.mesh, &level.x)), start, &sides);
        repair(&level.cells, &sides, &empty, &mut values);
        // of values that are not finite, that is what is wrong
        check_finite(law.names(), level.mesh, &values)?;
        stalled.map_or(Ok((values, work)), Err)
    }
}

/// The bounds of all values at a level; those that are given on sides have none.
fn bounds<const B: usize, const D: usize, const S: usize, L: Law<B, D>>(
    law: &L,
    level: &Level<'_, B, D, S>,
    sides: &[Side<B>],
    start: &[[f64; B]],
) -> Result<Vec<[[f64; 2]; B]>, Failure> {
    let at = (level.t, &*inside(level.mesh, &level.x));
    let mut bounds = law.bounds(at, level.mesh, start, sides)?;
    if !bounds.is_empty() {
        for side in sides {
            for c in (0..B).filter(|&c| side.given[c].is_some()) {
                bounds[side.i][c] = [f64::NEG_INFINITY, f64::INFINITY];
            }
        }
    }
    Ok(bounds)
}

/// Moves values that are beyond their bounds by rounding onto these.
fn within<const B: usize>(bounds: &[[[f64; 2]; B]], values: &mut [[f64; B]]) {
    for (value, bounds) in values.iter_mut().zip(bounds) {
        for (value, [lower, upper]) in value.iter_mut().zip(bounds) {
            *value = value.clamp(*lower, *upper);
        }
    }
}
