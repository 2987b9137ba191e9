//! What the mathematics can do wrong in a step.

use super::words::{counted, given_as, indices, line_rule, noisy, place, short, tuple};
use super::{Cause, NodePlace, Remedy};
use strum::{EnumIter, EnumMessage, IntoEnumIterator, IntoStaticStr};

/// A numerical failure inside one step. It never carries a time: the loop that knows it adds it
/// ([`Error::Failed`](super::Error::Failed)).
#[derive(Debug, Clone, PartialEq, thiserror::Error, EnumIter, EnumMessage, IntoStaticStr)]
#[strum(serialize_all = "kebab-case")]
pub enum Failure {
    /// A mesh cell has a corner whose Jacobian is not positive.
    #[strum(serialize = "mesh-folded")]
    #[error(
        "the mesh folded: cell {} has a corner of scaled Jacobian {jacobian:.1e} at {}{}",
        indices(cell), place(x), noisy(*noise)
    )]
    Folded {
        /// Indices of the cell, one for each axis.
        cell: Vec<usize>,
        /// Smallest corner Jacobian of the cell over that of the uniform mesh; at most 0.
        jacobian: f64,
        /// Where the corner is.
        x: Vec<f64>,
        /// Standard error of the interface values that made the mesh, as a share of its shortest edge before.
        noise: Option<f64>,
    },
    /// A quantity stopped being finite.
    #[error("{what} is {value} at {at}")]
    NonFinite {
        /// The quantity, in the reader's words.
        what: &'static str,
        /// The value found: NaN or ±∞.
        value: f64,
        /// The node.
        at: NodePlace,
    },
    /// A formula of the study has no finite value, or what it makes of an unknown has none.
    #[error("{what} is {value} at {at}{}", given_as(.given))]
    Formula {
        /// The formula's dotted key, in the reader's words.
        what: String,
        /// The value found: NaN or ±∞.
        value: f64,
        /// The node.
        at: NodePlace,
        /// The unknowns there, where the formula takes them.
        given: Vec<(String, f64)>,
    },
    /// A quantity that must be positive is not.
    #[error("{what} is {value:.3e}, not positive, at {at}")]
    NotPositive {
        /// The quantity, in the reader's words.
        what: &'static str,
        /// The value found, at most 0.
        value: f64,
        /// The node.
        at: NodePlace,
    },
    /// An equation that is made for periodic axes met a bounded one.
    #[error("{what} need periodic axes, but axis {axis} is bounded")]
    NotPeriodic {
        /// The equation.
        what: &'static str,
        /// The axis.
        axis: usize,
    },
    /// An equation that is made for the uniform mesh met another, or one that moves.
    #[error("the stepper rk4 needs the uniform mesh, but along axis {axis} {at}, is off by {off:.1e}")]
    NotUniform {
        /// Distance from the place in the uniform mesh.
        off: f64,
        /// The axis along which it is off.
        axis: usize,
        /// The node.
        at: NodePlace,
    },
    /// An explicit step would take too many substeps: over 1e8 on a uniform mesh, over 2e4 by limited fluxes.
    #[error("the step would take {substeps:.1e} explicit substeps for speeds up to {speed:.1e}")]
    ManySubsteps {
        /// Substeps that stability needs.
        substeps: f64,
        /// Largest |u|.
        speed: f64,
    },
    /// Newton's method did not reach its tolerance.
    #[error("Newton's method stalled: residual {residual:.1e} after {iterations} iterations, {tolerance:.0e} needed")]
    NewtonStalled {
        /// Largest residual, in the unit of the solution or as a share of its size.
        residual: f64,
        /// What was asked for.
        tolerance: f64,
        /// Iterations done.
        iterations: usize,
    },
    /// Automatic time steps became so short that the run would not end.
    #[error("automatic time steps shrank to {dt:.1e}: {cause}")]
    VanishingStep {
        /// The last step.
        dt: f64,
        /// What shortened it.
        cause: Cause,
    },
    /// A linear system was not solved to its tolerance by any solver at hand.
    #[error(
        "a linear system of {unknowns} unknowns was not solved: residual {residual:.1e} after {iterations} \
         iterations, {tolerance:.0e} needed"
    )]
    LinearStalled {
        /// Size of the system.
        unknowns: usize,
        /// Largest residual.
        residual: f64,
        /// What was asked for.
        tolerance: f64,
        /// Iterations done.
        iterations: usize,
    },
    /// The density is so steep that the weights of the mesh equation are no probabilities.
    #[error("the density is too steep for random walks: |b|h = {skew:.3} at {at}, and must be at most 2")]
    SteepDensity {
        /// Largest |b|h of the node.
        skew: f64,
        /// The node.
        at: NodePlace,
    },
    /// The random walks of a step would take more than 1e11 jumps.
    #[error(
        "{walks} random walks from each of {points} points would take too long: Δt/(τh²) = {stiffness:.1e}, about \
         {jumps:.1e} jumps a walk"
    )]
    LongWalks {
        /// Δt/(τh²), the larger of both axes.
        stiffness: f64,
        /// Mean jumps of a walk, about.
        jumps: f64,
        /// Walks from each point.
        walks: usize,
        /// Points.
        points: usize,
    },
    /// Interface values are so noisy that cells can fold.
    #[error(
        "interface values are too noisy: standard error {noise:.1e}, shortest edge of the mesh {edge:.1e}, Δt/(τh²) = \
         {stiffness:.3}"
    )]
    NoisyInterface {
        /// Root mean square of the standard errors.
        noise: f64,
        /// Shortest edge of the mesh.
        edge: f64,
        /// Δt/(τh²), the larger of both axes.
        stiffness: f64,
    },
    /// The Schwarz iteration did not reach its tolerance.
    #[error("the Schwarz iteration stalled: change {change:.1e} after {iterations} iterations, {tolerance:.0e} needed")]
    SchwarzStalled {
        /// Largest change in the last iteration.
        change: f64,
        /// What was asked for.
        tolerance: f64,
        /// Iterations done.
        iterations: usize,
    },
    /// A lattice cannot be divided into so many subdomains.
    #[error("{subdomains:?} subdomains do not fit {cells:?} cells")]
    Subdomains {
        /// Asked for along each axis.
        subdomains: Vec<usize>,
        /// Cells along each axis.
        cells: Vec<usize>,
    },
    /// The density of a line is not finite and positive, or its derivative not finite.
    #[error("{what} is {value:e} at x = {x}, t = {t}; {}", line_rule(what, *value))]
    LineDensity {
        /// `M`, `dM/dx` or `u_x`.
        what: &'static str,
        /// What it is.
        value: f64,
        /// Where.
        x: f64,
        /// When.
        t: f64,
    },
    /// Newton's method found no nodes of a line, or of a subdomain of it.
    #[error("Newton's method stalled on the line: residual {residual:.1e} after {iterations} iterations")]
    LineStalled {
        /// Largest difference of neighbouring fluxes.
        residual: f64,
        /// Iterations done.
        iterations: usize,
        /// What helps where it happened; none where nothing is known.
        remedies: Vec<Remedy>,
    },
    /// A layer is so thin, and so many cells lie in it, that neighbouring nodes are the same number.
    #[error(
        "node {node} of {cells} cells and the one before it are the same number, x = {x}: the layer there is too thin \
         for so many"
    )]
    LineUnresolved {
        /// The second of them.
        node: usize,
        /// Where both are.
        x: f64,
        /// Cells of the line.
        cells: usize,
    },
    /// The mesh glued from the subdomains of a line is out of order.
    #[error(
        "the subdomains do not agree on an order: after {} node {node} is at x = {x}, and the one before it at {left}",
        counted(*.iterations)
    )]
    LineFolded {
        /// The node.
        node: usize,
        /// Where it is.
        x: f64,
        /// Where the one before it is.
        left: f64,
        /// Iterations done.
        iterations: usize,
    },
    /// An iteration between subdomains of a line did not converge.
    #[error(
        "not converged: the {measure} is {last:.2e} after {}, {tolerance:.0e} asked for{advice}",
        counted(*.iterations)
    )]
    NotConverged {
        /// What is measured.
        measure: &'static str,
        /// The last value of that measure.
        last: f64,
        /// Iterations done.
        iterations: usize,
        /// What was asked for.
        tolerance: f64,
        /// What is known about this case.
        advice: String,
        /// What cures it there.
        remedies: Vec<Remedy>,
    },
    /// The sides of a mesh touch or cross each other, although no cell is folded.
    #[error("the mesh touches itself at {}, in cells {} and {}", place(x), tuple(cells[0]), tuple(cells[1]))]
    SelfTouching {
        /// The cells at both sides.
        cells: [[usize; 2]; 2],
        /// Where they meet.
        x: [f64; 2],
    },
    /// The nodes around a node determine no Laplacian.
    #[error("the nodes around {at}, give no Laplacian: condition number {condition:.1e}")]
    DegenerateStencil {
        /// The node.
        at: NodePlace,
        /// Condition number of its stencil.
        condition: f64,
    },
    /// The front reached a wall.
    #[error("the front left the box: it is at {}, and the {wall} at y = {}", place(x), short(*y))]
    FrontOutside {
        /// Where the front is.
        x: [f64; 2],
        /// The wall, `bottom` or `top`.
        wall: &'static str,
        /// Where the wall is.
        y: f64,
    },
    /// A phase became so thin that rows of it cannot be told apart.
    #[error("the {phase} phase vanishes at x = {}: only {thickness:.1e} of its column of {of:.3} is left", short(*x))]
    VanishingPhase {
        /// Its name: `lower` or `upper` where there are two, with heat alone.
        phase: String,
        /// Where.
        x: f64,
        /// What is left.
        thickness: f64,
        /// From wall to wall.
        of: f64,
    },
    /// The front turns over, or is too steep for the distance of the columns.
    #[error("the front stops being a graph over x at {}: its slope is {slope:.1e}", place(x))]
    NotAGraph {
        /// Where.
        x: [f64; 2],
        /// dh/dx there; infinite where it turns over.
        slope: f64,
    },
    /// A time step past the stability limit of the explicit front.
    #[error("the step {dt:.3e} is past the stability limit of the explicit front, {limit:.3e}")]
    FrontUnstable {
        /// The step.
        dt: f64,
        /// The longest stable step, as estimated.
        limit: f64,
    },
    /// The warm phase lies on the wrong side of the front: the problem is ill-posed.
    #[error(
        "the warm phase is on the wrong side of the front at {}: D₀ ∂u₀/∂y + D₁ ∂u₁/∂y = {slope:.3e} is above 0, and \
         the problem ill-posed",
        place(x)
    )]
    WrongSide {
        /// Where.
        x: [f64; 2],
        /// D₀ ∂u₀/∂y + D₁ ∂u₁/∂y.
        slope: f64,
    },
    /// The wall of a phase passes the melting temperature, where the other phase would appear with a second front.
    #[error("the {wall} is at {value:.4e} at x = {}, beyond the melting temperature {melting}", short(*x))]
    WallPassesMelting {
        /// The wall, `bottom` or `top`.
        wall: &'static str,
        /// Where.
        x: f64,
        /// Temperature of the wall there.
        value: f64,
        /// T_m.
        melting: f64,
    },
    /// A mesh generator met a mesh whose sides are not those of the box around it: it would pull them straight.
    #[error("the mesh does not fill its box: along axis {axis} {at}, is off its side of the box by {off:.1e}")]
    NotABox {
        /// Distance from the side of the box.
        off: f64,
        /// The axis across the side.
        axis: usize,
        /// The node.
        at: NodePlace,
    },
    /// A setting or an argument of a step is out of range.
    #[error("{what} is {value}, but {rule}")]
    OutOfRange {
        /// The setting, in the reader's words.
        what: String,
        /// The value of the setting.
        value: String,
        /// What must hold.
        rule: String,
    },
    /// An array does not fit the lattice it is given with.
    #[error("{what} has {found} values, but the lattice has {expected} nodes")]
    WrongLength {
        /// The array.
        what: &'static str,
        /// Number of values in the array.
        found: usize,
        /// Number of nodes.
        expected: usize,
    },
}

impl Failure {
    /// What refuses a setting or an argument of a step.
    pub(crate) fn out_of_range(what: &str, value: impl std::fmt::Display, rule: &str) -> Self {
        Self::OutOfRange { what: what.into(), value: value.to_string(), rule: rule.into() }
    }

    /// Short name of the variant, for `summary.json`.
    pub fn name(&self) -> &'static str {
        self.into()
    }

    /// What it means, in one sentence.
    pub fn meaning(&self) -> &'static str {
        self.get_documentation().unwrap_or_default()
    }

    /// One of every failure, of nothing, in the order of this enum.
    pub fn each() -> impl Iterator<Item = Self> {
        Self::iter()
    }

    /// Name and meaning of every failure, in the order of this enum.
    pub fn all() -> impl Iterator<Item = [&'static str; 2]> {
        Self::iter().map(|failure| [failure.name(), failure.meaning()])
    }
}
