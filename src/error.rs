//! Everything that can go wrong, as data.
//!
//! Two enums: a [`Failure`] is what the mathematics can do wrong in a step (it knows *what* and *where*), an [`Error`]
//! is what reaches the caller (it adds *when*, and covers settings and files). Both name the remedy in the words of a
//! study file through `help`.

use std::path::PathBuf;
use strum::{EnumIter, EnumMessage, IntoEnumIterator, IntoStaticStr};

/// `Result` with the library's own [`Error`].
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// A numerical failure inside one step. It never carries a time: the loop that knows it adds it ([`Error::Failed`]).
#[derive(Debug, Clone, PartialEq, thiserror::Error, EnumIter, EnumMessage, IntoStaticStr)]
#[strum(serialize_all = "kebab-case")]
pub enum Failure {
    /// A mesh cell has a corner whose Jacobian is not positive.
    #[strum(serialize = "mesh-folded")]
    #[error("the mesh folded: cell ({}, {}) has a corner of scaled Jacobian {jacobian:.1e} at x = {}, y = {}{}", cell[0], cell[1], short(x[0]), short(x[1]), noisy(*noise))]
    Folded {
        /// Indices of the cell along ξ and η.
        cell: [usize; 2],
        /// Smallest corner Jacobian of the cell over that of the uniform mesh; at most 0.
        jacobian: f64,
        /// Where the corner is.
        x: [f64; 2],
        /// Standard error of the interface values that made the mesh, as a share of its shortest edge before.
        noise: Option<f64>,
    },
    /// A quantity stopped being finite.
    #[error("{what} is {value} at node ({}, {}), x = {}, y = {}", node[0], node[1], short(x[0]), short(x[1]))]
    NonFinite {
        /// The quantity, in the reader's words.
        what: &'static str,
        /// The value found: NaN or ±∞.
        value: f64,
        /// Indices of the node along ξ and η.
        node: [usize; 2],
        /// Where the node is.
        x: [f64; 2],
    },
    /// A formula of the study has no finite value, or what it makes of an unknown has none.
    #[error("{what} is {value} at node ({}, {}), x = {}, y = {}{}", node[0], node[1], short(x[0]), short(x[1]), given_as(.given))]
    Formula {
        /// The formula's dotted key, in the reader's words.
        what: String,
        /// The value found: NaN or ±∞.
        value: f64,
        /// Indices of the node along ξ and η.
        node: [usize; 2],
        /// Where the node is.
        x: [f64; 2],
        /// The unknowns there, where the formula takes them.
        given: Vec<(String, f64)>,
    },
    /// A quantity that must be positive is not.
    #[error("{what} is {value:.3e}, not positive, at node ({}, {}), x = {}, y = {}", node[0], node[1], short(x[0]), short(x[1]))]
    NotPositive {
        /// The quantity, in the reader's words.
        what: &'static str,
        /// The value found, at most 0.
        value: f64,
        /// Indices of the node along ξ and η.
        node: [usize; 2],
        /// Where the node is.
        x: [f64; 2],
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
    #[error(
        "the stepper rk4 needs the uniform mesh, but along axis {axis} node ({}, {}), x = {}, y = {}, is off by {off:.1e}", node[0], node[1], short(x[0]), short(x[1])
    )]
    NotUniform {
        /// Distance from the place in the uniform mesh.
        off: f64,
        /// The axis along which it is off.
        axis: usize,
        /// Indices of the node along ξ and η.
        node: [usize; 2],
        /// Where the node is.
        x: [f64; 2],
    },
    /// An explicit step that would not end in any time worth waiting for.
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
        "a linear system of {unknowns} unknowns was not solved: residual {residual:.1e} after {iterations} iterations, {tolerance:.0e} needed"
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
    #[error("the density is too steep for random walks: |b|h = {skew:.3} at node {}, x = {}, and must be at most 2", tuple(node.iter()), tuple(x.iter().map(|&x| short(x))))]
    SteepDensity {
        /// Largest |b|h of the node.
        skew: f64,
        /// Indices of the node.
        node: Vec<usize>,
        /// Where the node is.
        x: Vec<f64>,
    },
    /// Random walks that would not end in any time worth waiting for.
    #[error(
        "{walks} random walks from each of {points} points would take too long: Δt/(τh²) = {stiffness:.1e}, about {jumps:.1e} jumps a walk"
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
        "interface values are too noisy: standard error {noise:.1e}, shortest edge of the mesh {edge:.1e}, Δt/(τh²) = {stiffness:.3}"
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
        subdomains: [usize; 2],
        /// Cells along each axis.
        cells: [usize; 2],
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
        /// What helps where it happened; empty where nothing is known.
        remedy: &'static str,
    },
    /// A layer is so thin, and so many cells lie in it, that neighbouring nodes are the same number.
    #[error(
        "node {node} of {cells} cells and the one before it are the same number, x = {x}: the layer there is too thin for so many"
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
        "the subdomains do not agree on an order: after {iterations} iteration{} node {node} is at x = {x}, and the one before it at {left}",
        if *.iterations == 1 { "" } else { "s" }
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
        "not converged: the {measure} is {last:.2e} after {iterations} iteration{}, {tolerance:.0e} asked for{advice}",
        if *.iterations == 1 { "" } else { "s" }
    )]
    NotConverged {
        /// What is measured.
        measure: &'static str,
        /// Its last value.
        last: f64,
        /// Iterations done.
        iterations: usize,
        /// What was asked for.
        tolerance: f64,
        /// What is known about this case.
        advice: String,
        /// What cures it there.
        remedy: &'static str,
    },
    /// The sides of a mesh touch or cross each other, although no cell is folded.
    #[error("the mesh touches itself: its sides meet at x = {}, y = {}, in cells ({}, {}) and ({}, {})", short(x[0]), short(x[1]), cells[0][0], cells[0][1], cells[1][0], cells[1][1])]
    SelfTouching {
        /// The cells at both sides.
        cells: [[usize; 2]; 2],
        /// Where they meet.
        x: [f64; 2],
    },
    /// The nodes around a node determine no Laplacian.
    #[error("the nodes around node ({}, {}), x = {}, y = {}, give no Laplacian: condition number {condition:.1e}", node[0], node[1], short(x[0]), short(x[1]))]
    DegenerateStencil {
        /// Indices of the node along ξ and η.
        node: [usize; 2],
        /// Where the node is.
        x: [f64; 2],
        /// Condition number of its stencil.
        condition: f64,
    },
    /// The front reached a wall.
    #[error("the front left the box: at x = {} it is at y = {}, and the {wall} at y = {}", short(x[0]), short(x[1]), short(*y))]
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
        /// `lower` or `upper`.
        phase: &'static str,
        /// Where.
        x: f64,
        /// What is left.
        thickness: f64,
        /// From wall to wall.
        of: f64,
    },
    /// The front turns over, or is too steep for the distance of the columns.
    #[error("the front stops being a graph over x at x = {}, y = {}: its slope is {slope:.1e}", short(x[0]), short(x[1]))]
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
    #[error("the warm phase is on the wrong side of the front at x = {}, y = {}: D₀ ∂u₀/∂y + D₁ ∂u₁/∂y = {slope:.3e} is above 0, and the problem ill-posed", short(x[0]), short(x[1]))]
    WrongSide {
        /// Where.
        x: [f64; 2],
        /// D₀ ∂u₀/∂y + D₁ ∂u₁/∂y.
        slope: f64,
    },
    /// A mesh generator met a mesh whose sides are not those of the box around it: it would pull them straight.
    #[error(
        "the mesh does not fill its box: node ({}, {}) of a side across axis {axis}, x = {}, y = {}, is off that side of the box by {off:.1e}", node[0], node[1], short(x[0]), short(x[1])
    )]
    NotABox {
        /// Distance from the side of the box.
        off: f64,
        /// The axis across the side.
        axis: usize,
        /// Indices of the node along ξ and η.
        node: [usize; 2],
        /// Where the node is.
        x: [f64; 2],
    },
    /// A setting or an argument of a step is out of range.
    #[error("{what} is {value}, but {rule}")]
    OutOfRange {
        /// The setting, in the reader's words.
        what: String,
        /// Its value.
        value: String,
        /// What must hold.
        rule: String,
    },
    /// An array does not fit the lattice it is given with.
    #[error("{what} has {found} values, but the lattice has {expected} nodes")]
    WrongLength {
        /// The array.
        what: &'static str,
        /// Its length.
        found: usize,
        /// Number of nodes.
        expected: usize,
    },
}

/// What shortens automatic time steps without end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, strum::Display)]
pub enum Cause {
    /// In every step the range of the solution grows by most of what changes.
    #[strum(to_string = "the solution grows faster than any step can follow")]
    BlowUp,
    /// It would change by much less if the mesh rested.
    #[strum(to_string = "the mesh sweeps its nodes through the solution in every step")]
    Restless,
    /// It never got away from the start.
    #[strum(to_string = "the solution changes by much in any step from the start")]
    Start,
    /// None of these.
    #[default]
    #[strum(to_string = "the solution never stops changing by much in a step")]
    Stiff,
}

impl Cause {
    fn help(self) -> &'static str {
        match self {
            Self::BlowUp => {
                "refine grid.cells where a layer forms that the mesh does not resolve (pde.flux = \"energy\" keeps Burgers' equation stable meanwhile), or end the run before with time.end where the equation itself blows up"
            }
            Self::Restless => {
                "set mesh.relaxation to \"auto\" where it is a number, follow something smoother by monitor.of, or give time.step as a number; with a stochastic generator raise its walks or paths"
            }
            Self::Start => {
                "smooth the initial solution where it jumps, also against its sides, or refine grid.cells; time.step as a number goes over it"
            }
            Self::Stiff => {
                "smooth what jumps in time, or give time.step as a number, since fast sources allow longer steps than their changes do"
            }
        }
    }
}

impl Failure {
    /// False for what no step is short enough, and for formulas without a value, which a shorter step might only step over.
    pub(crate) fn is_curable(&self) -> bool {
        !matches!(
            self,
            Self::Formula { .. }
                | Self::NotPeriodic { .. }
                | Self::NotUniform { .. }
                | Self::ManySubsteps { .. }
                | Self::Subdomains { .. }
                | Self::NotABox { .. }
                | Self::OutOfRange { .. }
                | Self::WrongLength { .. }
        )
    }

    /// What refuses a setting, where a step cannot return it as an [`Error`].
    pub(crate) fn refusing(error: Error) -> Self {
        match error {
            Error::Failed { failure, .. } => failure,
            Error::Invalid { key, value, rule } => Self::OutOfRange { what: format!("`{key}`"), value, rule },
            other => Self::OutOfRange { what: "a setting".into(), value: "not usable".into(), rule: other.to_string() },
        }
    }

    /// Refuses a number that is not finite and above 0.
    pub(crate) fn unless_positive(what: &str, value: f64) -> Result<(), Self> {
        match value.is_finite() && value > 0.0 {
            true => Ok(()),
            false => Err(Self::OutOfRange {
                what: what.into(),
                value: value.to_string(),
                rule: "must be a finite number above 0".into(),
            }),
        }
    }

    /// Short name of the variant, for `summary.json`.
    pub fn name(&self) -> &'static str {
        self.into()
    }

    /// Name, meaning and remedy of every failure, in the order of this enum.
    pub fn all() -> impl Iterator<Item = [&'static str; 3]> {
        // a failure of nothing: names, meanings and remedies are those of the variant
        Self::iter().map(|failure| [failure.name(), failure.get_documentation().unwrap_or_default(), failure.help()])
    }

    /// The same in a study whose mesh follows no density: of kind `poisson` or `stefan`.
    pub fn help_without_density(&self) -> &'static str {
        match self {
            Self::NonFinite { .. } | Self::Formula { .. } | Self::NotPositive { .. } => {
                "mend the formula that gives it"
            }
            Self::NewtonStalled { .. } => "lower time.step, refine grid.cells, or set front.stepping to \"explicit\"",
            Self::LinearStalled { .. } => {
                "make the flattest cells less flat by grid.grading, or give values in place of slopes on more sides"
            }
            _ => self.help(),
        }
    }

    /// The keys of a study that may cure it.
    pub fn help(&self) -> &'static str {
        match self {
            Self::Folded { .. } => {
                "raise monitor.smoothing, lower monitor.strength or lower time.step; set monitor.gradient to \"safe\" where the density is very steep"
            }
            Self::NonFinite { .. } => {
                "mend the formula that gives it, if one does; else lower time.step, refine grid.cells or raise monitor.smoothing"
            }
            Self::Formula { given, .. } if given.is_empty() => "mend the formula",
            Self::Formula { .. } => {
                "mend the formula, for instance by max(…, 0) under a root; where it is right, lower time.step or raise monitor.smoothing"
            }
            Self::NotPositive { .. } => {
                "mend the formula that gives it, if one does; else lower time.step or refine grid.cells"
            }
            Self::NotPeriodic { .. } => "set domain.periodic to [true, true]",
            Self::NotUniform { .. } => "set mesh.generator to { kind = \"fixed\" }, or leave time.stepper out",
            Self::ManySubsteps { .. } => "leave time.stepper out, or lower grid.cells or pde.viscosity",
            Self::VanishingStep { cause, .. } => cause.help(),
            Self::NewtonStalled { .. } => "lower time.step, refine grid.cells or raise monitor.smoothing",
            Self::LinearStalled { .. } => {
                "lower time.step or raise mesh.relaxation; set monitor.gradient to \"safe\" where the density is very steep"
            }
            Self::SteepDensity { .. } => {
                "set monitor.gradient to \"safe\", which bounds |b|h, or raise monitor.smoothing"
            }
            Self::LongWalks { .. } => {
                "raise mesh.relaxation, lower time.step or the number of walks, or use the generator \"whole\""
            }
            Self::NoisyInterface { .. } => {
                "raise mesh.generator.estimator.walks (or paths), or use the residual walk with sweeps = \"auto\""
            }
            Self::SchwarzStalled { .. } => {
                "raise mesh.generator.iterations or mesh.generator.overlap, or lower time.step"
            }
            Self::Subdomains { .. } => "give every axis between one subdomain and one a cell",
            Self::LineDensity { .. } => "change density.value or density.of so",
            Self::LineStalled { remedy, .. } if !remedy.is_empty() => remedy,
            Self::LineStalled { .. } => {
                "set equidistribution.face_density to \"exact\", or refine grid.cells; with [time] lower time.step; with conditions of Robin's kind set schwarz.robin to \"auto\" or \"lagged\""
            }
            Self::LineUnresolved { .. } => "lower grid.cells, or give the density a thicker layer",
            Self::LineFolded { .. } => {
                "raise stop.iterations, or give stop.tolerance in its place, which tells whether the iteration contracts"
            }
            Self::NotConverged { remedy, .. } if !remedy.is_empty() => remedy,
            Self::NotConverged { .. } => {
                "raise stop.iterations where it converges slowly; else give more overlap, set schwarz.linearized to false, schwarz.sweep to \"alternating\", or schwarz.coarse to \"integral\""
            }
            Self::SelfTouching { .. } => "mend domain.map, or lower domain.distort",
            Self::DegenerateStencil { .. } => {
                "make the cells around it less flat: lower domain.distort or grid.grading"
            }
            Self::FrontOutside { .. } | Self::VanishingPhase { .. } => {
                "end earlier with time.end, or move the walls away"
            }
            Self::NotAGraph { .. } => {
                "end earlier with time.end, or refine grid.cells; a front that turns over needs another method"
            }
            Self::FrontUnstable { .. } => "lower time.step, set it to \"auto\", or set front.stepping to \"implicit\"",
            Self::WrongSide { .. } => "let the lower phase be the warm one: mend the initial and boundary formulas",
            Self::NotABox { .. } => {
                "move the mesh of the unit square instead, and map it to the domain; or set mesh.generator to { kind = \"fixed\" }"
            }
            Self::OutOfRange { .. } => "give a value that does",
            Self::WrongLength { .. } => "give one value a node, in lattice order",
        }
    }
}

/// When something happened.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moment {
    /// Simulated time.
    pub t: f64,
    /// Step number; the initial state is step 0.
    pub step: usize,
}

/// What reaches the caller.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A numerical failure, and when it happened if a time loop was running.
    #[error("{}{failure}", at(.moment))]
    Failed {
        /// The failure.
        failure: Failure,
        /// The step that failed.
        moment: Option<Moment>,
    },
    /// What ended the run that a complete one is compared with.
    #[error("the run itself is complete; in the one of [compare]: {0}")]
    Compared(Box<Error>),
    /// Somebody asked a run to end.
    #[error("interrupted at t = {:.6} (step {})", .0.t, .0.step)]
    Interrupted(Moment),
    /// A setting is out of range.
    #[error("`{key}` is {value}, but {rule}")]
    Invalid {
        /// Dotted key as in a study file.
        key: String,
        /// Value found.
        value: String,
        /// What must hold, and how to make it hold.
        rule: String,
    },
    /// A setting is no formula.
    #[error("`{key}`: {message}\n  {text}\n  {}", carets(text, at))]
    Formula {
        /// Dotted key as in a study file.
        key: String,
        /// The formula.
        text: String,
        /// The bytes of it that are meant.
        at: std::ops::Range<usize>,
        /// What is wrong.
        message: String,
        /// The remedy.
        help: Option<String>,
    },
    /// A study file (or a `--set`) is wrong at a known place.
    #[error("{0}")]
    Study(Box<Diagnostic>),
    /// A file could not be read.
    #[error("cannot read {}: {reason}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// A file or directory could not be written.
    #[error("cannot write {}: {reason}", path.display())]
    Unwritable {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// A run cannot go on: there are checkpoints, but none that will do.
    #[error("cannot go on: {}", refusals(refused))]
    Checkpoint {
        /// Each file with what is wrong with it.
        refused: Vec<(PathBuf, Unfit)>,
    },
    /// Another run is writing to the output directory.
    #[error("another run is writing to {}", path.display())]
    Busy {
        /// The directory.
        path: PathBuf,
    },
    /// A directory that holds no run.
    #[error("{} is no run directory: {reason}", path.display())]
    NotARun {
        /// The directory.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// The output directory holds something that no run of ours wrote.
    #[error("{} is not empty and was not written by driftmesh (it holds {found})", path.display())]
    ForeignDirectory {
        /// The directory.
        path: PathBuf,
        /// Something found in it.
        found: String,
    },
}

/// Why a run cannot go on from a file.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Unfit {
    /// It is of another format.
    #[error("it is no checkpoint that this program can read")]
    Foreign,
    /// Bytes are missing or wrong, or what they say cannot be.
    #[error("it is damaged: {0}")]
    Damaged(String),
    /// Another program wrote it, whose numbers may differ.
    #[error("it was written by driftmesh {found}, and this is driftmesh {}", env!("CARGO_PKG_VERSION"))]
    Version {
        /// The version of the other.
        found: String,
    },
    /// It belongs to other settings.
    #[error("it belongs to a study in which `{key}` is {was}; here it is {is}")]
    Study {
        /// Dotted key of the first setting that differs.
        key: String,
        /// Its value there.
        was: String,
        /// Its value now.
        is: String,
    },
    /// What the run left beside it does not fit.
    #[error("{file} does not go with it: {reason}")]
    Beside {
        /// The file.
        file: String,
        /// Why.
        reason: String,
    },
}

/// Files with what is wrong with each.
fn refusals(refused: &[(PathBuf, Unfit)]) -> String {
    let each = refused.iter().map(|(path, unfit)| format!("{}: {unfit}", path.display()));
    each.collect::<Vec<_>>().join("; ")
}

/// Items in parentheses.
fn tuple(items: impl Iterator<Item = impl std::fmt::Display>) -> String {
    format!("({})", items.map(|item| item.to_string()).collect::<Vec<_>>().join(", "))
}

/// What noise may have to do with a mesh that folded.
fn noisy(noise: Option<f64>) -> String {
    noise.map_or(String::new(), |noise| {
        format!(
            "; its interface values had a standard error of {:.1} % of the shortest edge: more walks lower it",
            100.0 * noise
        )
    })
}

/// Values of unknowns, as the end of a message.
fn given_as(values: &[(String, f64)]) -> String {
    let values: Vec<String> = values.iter().map(|(name, value)| format!("{name} = {}", short(*value))).collect();
    if values.is_empty() { String::new() } else { format!(", where {}", values.join(", ")) }
}

/// What a density of a line breaks.
pub(crate) fn line_rule(what: &str, value: f64) -> &'static str {
    match what {
        "u_x" => "u jumps there, and no mesh resolves a jump: give it a width, as in tanh((x - c)/w)",
        "M" if value.is_nan() => "it has no value there: mend it, or move the ends of the line",
        "M" if value == f64::INFINITY => "it must be finite: bound it, as in min(M, 1e6), or move the ends of the line",
        "M" if value <= 0.0 => "it must be above 0 on the whole line: add a floor, as in max(M, 1e-6)",
        "M" if value > 1e140 => "it is too large for sums: divide it by its largest value, since only its ratios count",
        "M" => {
            "it must be above 0 by more than 1e-14 of its largest on the line, which is rounding: add a floor, as in max(M, 1e-6) \
             where M is about 1"
        }
        _ => "it must be bounded on the whole line",
    }
}

/// A coordinate in a few characters, whatever its size.
fn short(x: f64) -> String {
    if x == 0.0 || (1e-3..1e6).contains(&x.abs()) { format!("{x:.4}") } else { format!("{x:.3e}") }
}

/// Marks a part of a text, on the line below it.
fn carets(text: &str, at: &std::ops::Range<usize>) -> String {
    let before = text.get(..at.start).map_or(0, |t| t.chars().count());
    let width = text.get(at.clone()).map_or(1, |t| t.chars().count().max(1));
    " ".repeat(before) + &"^".repeat(width)
}

fn at(moment: &Option<Moment>) -> String {
    moment.map_or(String::new(), |m| format!("at t = {:.6} (step {}): ", m.t, m.step))
}

impl From<Failure> for Error {
    fn from(failure: Failure) -> Self {
        Self::Failed { failure, moment: None }
    }
}

impl Error {
    /// A setting out of range.
    pub fn invalid(key: impl Into<String>, value: impl std::fmt::Display, rule: impl Into<String>) -> Self {
        let text = value.to_string();
        // very large and very small numbers as powers of ten
        let value = match text.parse::<f64>() {
            Ok(number) if text.len() > 20 || text.len() > 14 && text.contains('.') => format!("{number:e}"),
            _ => text,
        };
        Self::Invalid { key: key.into(), value, rule: rule.into() }
    }

    /// The same error with its key seen from one table further out: `viscosity` becomes `pde.viscosity`.
    pub fn within(self, table: &str) -> Self {
        match self {
            Self::Invalid { key, value, rule } => Self::Invalid { key: format!("{table}.{key}"), value, rule },
            Self::Formula { key, text, at, message, help } => {
                Self::Formula { key: format!("{table}.{key}"), text, at, message, help }
            }
            other => other,
        }
    }

    /// What went wrong, in whichever run.
    pub fn cause(&self) -> &Self {
        match self {
            Self::Compared(cause) => cause,
            other => other,
        }
    }

    /// The same in a study of kind `poisson` or `stefan`, as [`Failure::help_without_density`].
    pub fn help_without_density(&self) -> Option<String> {
        match self {
            Self::Failed { failure, .. } => Some(failure.help_without_density().into()),
            _ => self.help(),
        }
    }

    /// What to do about it, where there is one answer.
    pub fn help(&self) -> Option<String> {
        match self {
            Self::Failed { failure, .. } => Some(failure.help().into()),
            Self::Compared(cause) => cause.help().map(|help| help.replace("mesh.generator", "compare.generator")),
            Self::Study(diagnostic) => diagnostic.help.clone(),
            Self::Formula { help, .. } => help.clone(),
            Self::Busy { .. } => Some("wait for it to end, or name another directory with --out".into()),
            Self::ForeignDirectory { .. } => Some("name another directory with --out, or empty this one".into()),
            Self::NotARun { .. } => Some("name the directory that `driftmesh run` printed behind `run`".into()),
            Self::Checkpoint { refused } => Some(match refused.first() {
                Some((_, Unfit::Study { .. })) => {
                    "go on with the settings in its study.toml; or leave --resume out to begin anew, or name another directory with --out"
                }
                Some((_, Unfit::Version { .. })) => "go on with that version, or leave --resume out to begin anew",
                _ => "leave --resume out to begin anew",
            }.into()),
            Self::Unwritable { .. } => {
                Some("free some space or mend the permissions there, or name another directory with --out".into())
            }
            Self::Interrupted(_) | Self::Invalid { .. } | Self::Unreadable { .. } => None,
        }
    }

    /// True if what ended a run lies outside it: it may go on from its checkpoint.
    pub fn is_resumable(&self) -> bool {
        matches!(self.cause(), Self::Interrupted(_) | Self::Unwritable { .. })
    }

    /// True if the computation failed (exit status 1), false if what was asked for is wrong (exit status 2).
    pub fn is_failure(&self) -> bool {
        matches!(self.cause(), Self::Failed { .. } | Self::Interrupted(_) | Self::Unwritable { .. })
    }
}

/// A mistake at a place in a text, shown as the line with a caret under it.
#[derive(Debug, Clone, PartialEq)]
pub struct Diagnostic {
    /// What is wrong.
    pub message: String,
    /// Name of the text: a file, or `--set`.
    pub origin: String,
    /// The line, without its end; of a very long line the part around the place.
    pub text: String,
    /// Line number from 1.
    pub line: usize,
    /// Column of the first marked character, from 1, in characters.
    pub column: usize,
    /// Where that character stands in `text`, from 1.
    pub caret: usize,
    /// Number of marked characters, at least 1.
    pub width: usize,
    /// The remedy.
    pub help: Option<String>,
}

impl std::fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let number = self.line.to_string();
        let gutter = " ".repeat(number.len());
        writeln!(f, "{}", self.message)?;
        writeln!(f, "{gutter}--> {}:{}:{}", self.origin, self.line, self.column)?;
        writeln!(f, "{gutter} |")?;
        writeln!(f, "{number} | {}", self.text)?;
        write!(f, "{gutter} | {}{}", " ".repeat(self.caret - 1), "^".repeat(self.width))
    }
}
