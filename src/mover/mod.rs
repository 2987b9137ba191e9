//! From densities to meshes that follow them: one mover for studies, Rust and Python.

mod gait;
mod retries;
mod start;

pub use gait::Gait;
pub use retries::{Care, Retries};
pub(crate) use start::adapted_to_all;
pub use start::{Ending, Start, adapted, steps_to_rest};

use crate::error::{Failure, Result};
use crate::geometry::{Cells, Density, Mesh, check_length, check_unfolded, interpolate};
use crate::meshing::{Interface, MeshGenerator, Mmpde, Moved, Relaxation};
use crate::work::Work;
pub(crate) use gait::Predicted;

/// Moves a mesh from step to step
///
/// A step predicts the mesh, x* = xⁿ + Δt v, and does a step of the mesh equation from there, with the mean of the
/// density of xⁿ and of the one that moved the mesh last; the velocity v of the nodes learns from the correction
/// e = xⁿ⁺¹ − x* ([`Steps`](crate::meshing::Steps)). With [`Relaxation::Auto`] the mover chooses τ, too ([`Gait`]). A
/// step that would fold the mesh, or whose equation cannot be solved, is tried again with more [`Care`].
///
/// # Example
/// ```
/// use driftmesh::density::{Monitor, RootGradient};
/// use driftmesh::geometry::{Lattice, Mesh};
/// use driftmesh::meshing::Whole;
/// use driftmesh::mover::{Followed, Gait, Mover};
///
/// let mut mover = Mover::new(Whole::default());
/// let mut mesh = Mesh::uniform(Lattice::bounded([20, 20])?, [0.0, 0.0], [1.0, 1.0])?;
/// let mut gait = Gait::at_rest(&mesh);
/// for _ in 0..100 {
///     let u: Vec<f64> = mesh.x().iter().map(|x| (40.0 * (x[0] - 0.5)).tanh()).collect();
///     let rho = RootGradient::default().density(&mesh, &u, None)?;
///     let step = mover.step(&mesh, &gait, Followed { u: &u, rho: &rho }, 1.0)?;
///     (mesh, gait) = (step.moved.mesh, step.gait);
/// }
/// // the layer has its cells, and the mesh stands still
/// assert!(mesh.shortest_edge() < 0.5 / 20.0);
/// assert!(gait.correction().iter().all(|e| e[0].hypot(e[1]) < 1e-3 / 20.0));
/// # Ok::<(), driftmesh::Error>(())
/// ```
pub struct Mover<const D: usize = 2> {
    /// How the mesh equation is solved.
    pub generator: Box<dyn MeshGenerator<D>>,
    /// The mesh equation, with its τ.
    pub equation: Mmpde,
    /// How far a step that fails is tried again.
    pub care: Care,
}

/// What a mesh follows: nodal values on it, in lattice order.
#[derive(Debug, Clone, Copy)]
pub struct Followed<'a> {
    /// What the density was computed from: a mesh on periodic axes follows its common translation. The density itself
    /// where there is nothing else.
    pub u: &'a [f64],
    /// The density.
    pub rho: &'a Density,
}

/// A step of a [`Mover`].
#[derive(Debug, Clone)]
pub struct Step<const D: usize = 2> {
    /// The new mesh, and what the step cost.
    pub moved: Moved<D>,
    /// The memory of the mover for the next step.
    pub gait: Gait<D>,
    /// Tries of the step that failed.
    pub retries: Retries,
}

/// Settings of a step of the mesh.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Stride {
    /// Length of the step.
    pub dt: f64,
    /// Time step of which τ is a multiple, where τ is given in steps or chosen by the mover.
    pub scale: f64,
    /// Number of parts into which the step is divided; ρ is interpolated onto the mesh of each.
    pub parts: usize,
    /// Share of the correction that was applied: a mesh that is held back learns no velocity from the rest.
    pub share: f64,
}

impl<const D: usize> Mover<D>
where
    Mesh<D>: Cells<D>,
{
    /// The recipe that needs no number: the conservative form, τ and prediction by the mover itself.
    pub fn new(generator: impl MeshGenerator<D> + 'static) -> Self {
        Self::by(Box::new(generator), Mmpde::default())
    }

    /// Moves by this generator and equation.
    pub fn by(generator: Box<dyn MeshGenerator<D>>, equation: Mmpde) -> Self {
        Self { generator, equation, care: Care::default() }
    }

    /// The mesh at t + `dt` from the mesh at t and what it follows there.
    ///
    /// # Errors
    /// A [`Failure`]: the mesh is folded, or would be whatever is tried, or its equation is not solved.
    pub fn step(
        &mut self,
        mesh: &Mesh<D>,
        gait: &Gait<D>,
        followed: Followed<'_>,
        dt: f64,
    ) -> Result<Step<D>, Failure> {
        let Followed { u, rho } = followed;
        check_length(mesh.lattice(), "what the mesh follows", u.len())?;
        check_unfolded(mesh)?;
        rho.check(mesh)?;
        let mut retries = Retries::default();
        let stride = Stride { dt, scale: dt, parts: 1, share: 1.0 };
        let predicted = self.predict(mesh, gait, u, stride)?;
        let mixed = gait.mixed(rho, self.equation.relaxation);
        let moved = self.relax(&predicted, &mixed, stride, &mut retries)?;
        let gait = self.learn(gait, &predicted, &moved.mesh, (mixed, u.to_vec()), stride);
        Ok(Step { moved, gait, retries })
    }

    /// The mesh to which nodes go on by their velocity.
    pub(crate) fn predict(
        &self,
        mesh: &Mesh<D>,
        gait: &Gait<D>,
        u: &[f64],
        stride: Stride,
    ) -> Result<Predicted<D>, Failure> {
        let prediction = if self.generator.moves() { self.equation.relaxation.prediction() } else { 0.0 };
        Predicted::after(mesh, gait, u, prediction * stride.dt / stride.scale, stride.dt)
    }

    /// A step of the mesh equation from the predicted mesh, with as much care as it needs.
    ///
    /// # Errors
    /// The failure of the first try, where no other helps.
    pub(crate) fn relax(
        &mut self,
        predicted: &Predicted<D>,
        rho: &Density,
        stride: Stride,
        retries: &mut Retries,
    ) -> Result<Moved<D>, Failure> {
        let tau = predicted.tau(self.equation.relaxation, stride.scale);
        let equation = Mmpde { relaxation: Relaxation::Time(tau), ..self.equation };
        let generator = self.generator.as_mut();
        self.care.persist(retries, |substeps, smoothing| {
            let parts = stride.parts * substeps;
            relaxed(
                generator,
                &equation,
                &predicted.mesh,
                retries::smoother(&predicted.mesh, rho, smoothing)?.as_ref(),
                stride.dt,
                parts,
            )
        })
    }

    /// What the next step goes on from; `made` are the density that moved the mesh, and the u from which it was
    /// computed.
    pub(crate) fn learn(
        &self,
        gait: &Gait<D>,
        predicted: &Predicted<D>,
        mesh: &Mesh<D>,
        made: (Density, Vec<f64>),
        stride: Stride,
    ) -> Gait<D> {
        let gains = [self.equation.relaxation.prediction() * stride.dt / stride.scale, stride.share];
        let chooses = self.equation.relaxation == Relaxation::Auto;
        gait.after(predicted, mesh, made, gains, stride.dt, chooses)
    }
}

/// `parts` equal parts of a step of the mesh equation, ρ carried onto the mesh of each by interpolation.
fn relaxed<const D: usize>(
    generator: &mut dyn MeshGenerator<D>,
    equation: &Mmpde,
    start: &Mesh<D>,
    rho: &Density,
    dt: f64,
    parts: usize,
) -> Result<Moved<D>, Failure>
where
    Mesh<D>: Cells<D>,
{
    let mut work = Work::default();
    let mut seconds = 0.0;
    let mut last: Option<Moved<D>> = None;
    for part in 0..parts {
        let mesh = last.as_ref().map_or(start, |moved| &moved.mesh);
        let carried = if part == 0 { None } else { Some(rho.map(|part| interpolate(start, part, mesh))) };
        let moved = generator.step(equation, mesh, carried.as_ref().unwrap_or(rho), dt / parts as f64)?;
        work += moved.work;
        seconds += moved.interface.map_or(0.0, |i| i.seconds);
        last = Some(moved);
    }
    let moved = last.expect("a step has at least one part");
    let interface = moved.interface.map(|interface| Interface { seconds, ..interface });
    Ok(Moved { work, interface, ..moved })
}
