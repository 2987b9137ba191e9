//! Which remedies a failure has.

use super::Act::{Change, LeaveOut, Lower, Number, Raise, Refine, Say, Set};
use super::{Cause, Failure, Plain, Remedy, Setting, sentence};

/// The values of a word that a study writes in quotes.
const SAFE: &[&str] = &["\"safe\""];
const AUTO: &[&str] = &["\"auto\""];
const EXACT: &[&str] = &["\"exact\""];
/// A formula that gives what is no number or not positive.
const MEND: &str = "mend the formula that gives it, if one does";
/// A formula whose slope has no bound.
const BEND: &str = "mend the formula, for instance by max(…, 1e-9) under a root or a logarithm: Newton's method needs \
                    a finite derivative";

impl Cause {
    fn remedies(self) -> Vec<Remedy> {
        match self {
            Self::BlowUp => vec![
                Remedy::any([Refine(Setting::Cells)]).with(" where a layer forms that the mesh does not resolve"),
                Remedy::any([Set(Setting::Flux, &["\"energy\""])])
                    .with(", which keeps Burgers' equation stable until cells resolve the layer"),
                Remedy::any([Change("end the run before that time with", Setting::End)])
                    .with(" where the equation itself blows up"),
            ],
            Self::Restless => vec![Remedy::any([
                Set(Setting::Relaxation, AUTO),
                Change("follow something smoother by", Setting::Followed),
                Number(Setting::TimeStep),
                Raise(Setting::Samples),
            ])],
            Self::Start => vec![
                Remedy::any([
                    Say("smooth the initial solution where it jumps, also against its sides,"),
                    Refine(Setting::Cells),
                ]),
                Remedy::any([Number(Setting::TimeStep)]).with(", which steps over the jump"),
            ],
            Self::Stiff => vec![
                Remedy::any([Say("smooth what jumps in time"), Number(Setting::TimeStep)])
                    .with(", since implicit steps may be longer than the time in which a fast source acts"),
            ],
        }
    }
}

impl Failure {
    /// Whether a shorter step may cure it: not what is wrong with a setting or an array, and not a formula of place and
    /// time without a value, over which a shorter step might only step. One of the unknowns has no value where a long
    /// step overshoots.
    pub(crate) fn is_curable(&self) -> bool {
        if let Self::Formula { given, .. } = self {
            return !given.is_empty();
        }
        !matches!(
            self,
            Self::NotPeriodic { .. }
                | Self::NotUniform { .. }
                | Self::ManySubsteps { .. }
                | Self::Subdomains { .. }
                | Self::NotABox { .. }
                | Self::OutOfRange { .. }
                | Self::WrongLength { .. }
        )
    }

    /// What may cure it, by meaning: the first is the best.
    pub fn remedies(&self) -> Vec<Remedy> {
        match self {
            Self::LineStalled { remedies, .. } | Self::NotConverged { remedies, .. } if !remedies.is_empty() => {
                remedies.clone()
            }
            Self::NonFinite { .. }
            | Self::Formula { .. }
            | Self::NotPositive { .. }
            | Self::NotPeriodic { .. }
            | Self::NotUniform { .. }
            | Self::ManySubsteps { .. }
            | Self::NewtonStalled { .. }
            | Self::VanishingStep { .. } => self.of_equations(),
            Self::LineDensity { .. }
            | Self::LineStalled { .. }
            | Self::LineUnresolved { .. }
            | Self::LineFolded { .. }
            | Self::NotConverged { .. } => self.of_lines(),
            Self::SelfTouching { .. }
            | Self::DegenerateStencil { .. }
            | Self::FrontOutside { .. }
            | Self::VanishingPhase { .. }
            | Self::NotAGraph { .. }
            | Self::FrontUnstable { .. }
            | Self::WrongSide { .. }
            | Self::WallPassesMelting { .. } => self.of_fronts(),
            _ => self.of_meshes(),
        }
    }

    fn of_equations(&self) -> Vec<Remedy> {
        let finer = [Lower(Setting::TimeStep), Refine(Setting::Cells)];
        match self {
            Self::NonFinite { .. } => vec![
                Remedy::any([Say(MEND)]),
                Remedy::any([Lower(Setting::TimeStep), Refine(Setting::Cells), Raise(Setting::Smoothing)]).when("else"),
            ],
            Self::Formula { given, .. } if given.is_empty() => vec![Remedy::any([Say("mend the formula")])],
            Self::Formula { what, value, .. } if value.is_infinite() && what.contains("derivative") => {
                vec![Remedy::any([Say(BEND)])]
            }
            Self::Formula { .. } => vec![
                Remedy::any([Say("mend the formula, for instance by max(…, 0) under a root")]),
                Remedy::any([Lower(Setting::TimeStep), Raise(Setting::Smoothing)]).when("where it is right,"),
            ],
            Self::NotPositive { .. } => vec![Remedy::any([Say(MEND)]), Remedy::any(finer).when("else")],
            Self::NotPeriodic { .. } => vec![Remedy::any([Set(Setting::Periodic, &["[true, true]"])])],
            Self::NotUniform { .. } => {
                vec![Remedy::any([Set(Setting::Generator, &["{ kind = \"fixed\" }"]), LeaveOut(Setting::Stepper)])]
            }
            Self::ManySubsteps { .. } => {
                vec![Remedy::any([LeaveOut(Setting::Stepper), Lower(Setting::Cells), Lower(Setting::Viscosity)])]
            }
            Self::NewtonStalled { .. } => vec![Remedy::any([
                Lower(Setting::TimeStep),
                Refine(Setting::Cells),
                Raise(Setting::Smoothing),
                Set(Setting::Stepping, &["\"explicit\""]),
            ])],
            Self::VanishingStep { cause, .. } => cause.remedies(),
            _ => Vec::new(),
        }
    }

    fn of_meshes(&self) -> Vec<Remedy> {
        let safe = || Remedy::any([Set(Setting::Gradient, SAFE)]).with(" where the density is very steep");
        match self {
            Self::Folded { .. } => vec![
                Remedy::any([
                    Raise(Setting::Smoothing),
                    Lower(Setting::Strength),
                    Lower(Setting::TimeStep),
                    Raise(Setting::Relaxation),
                    Raise(Setting::Substeps),
                ]),
                safe(),
            ],
            Self::LinearStalled { .. } => vec![
                Remedy::any([Lower(Setting::TimeStep), Raise(Setting::Relaxation)]),
                safe(),
                Remedy::any([
                    Change("make the flattest cells less flat by", Setting::Grading),
                    Change("give values in place of slopes on more of", Setting::Slopes),
                ]),
            ],
            Self::SteepDensity { .. } => vec![
                Remedy::any([Set(Setting::Gradient, SAFE)]).with(", which bounds |b|h"),
                Remedy::any([Raise(Setting::Smoothing), Lower(Setting::Strength)]).when("or"),
            ],
            Self::LongWalks { .. } => vec![Remedy::any([
                Raise(Setting::Relaxation),
                Lower(Setting::TimeStep),
                Lower(Setting::Samples),
                Set(Setting::Generator, &["{ kind = \"whole\" }"]),
            ])],
            Self::NoisyInterface { .. } => vec![Remedy::any([
                Raise(Setting::Samples),
                Set(Setting::Estimator, &["{ kind = \"residual-walk\", sweeps = \"auto\" }"]),
            ])],
            Self::SchwarzStalled { .. } => {
                vec![Remedy::any([Raise(Setting::Exchanges), Raise(Setting::Overlap), Lower(Setting::TimeStep)])]
            }
            Self::Subdomains { .. } => {
                vec![Remedy::any([Say("give every axis between one subdomain and one a cell")])]
            }
            Self::NotABox { .. } => vec![Remedy::any([
                Say("move the mesh of the unit square instead, and map it to the domain"),
                Set(Setting::Generator, &["{ kind = \"fixed\" }"]),
            ])],
            Self::OutOfRange { .. } => vec![Remedy::any([Say("give a value within the range that the message names")])],
            Self::WrongLength { .. } => vec![Remedy::any([Say("give one value a node, in lattice order")])],
            _ => Vec::new(),
        }
    }

    fn of_lines(&self) -> Vec<Remedy> {
        match self {
            Self::LineDensity { .. } => vec![Remedy::any([Change("change", Setting::Density)]).with(" so")],
            Self::LineStalled { .. } => vec![Remedy::any([
                Set(Setting::FaceDensity, EXACT),
                Refine(Setting::Cells),
                Lower(Setting::TimeStep),
                Set(Setting::Robin, &["\"auto\"", "\"lagged\""]),
            ])],
            Self::LineUnresolved { .. } => {
                vec![Remedy::any([Lower(Setting::Cells), Say("give the density a thicker layer")])]
            }
            Self::LineFolded { .. } => vec![
                Remedy::any([Raise(Setting::Iterations), Change("give", Setting::Tolerance)])
                    .with(" in its place, which tells whether the iteration contracts"),
            ],
            Self::NotConverged { .. } => vec![
                Remedy::any([Raise(Setting::Iterations)]).with(" where it converges slowly"),
                Remedy::any([
                    Say("give more overlap"),
                    Set(Setting::Linearized, &["false"]),
                    Set(Setting::Sweep, &["\"alternating\""]),
                    Set(Setting::Coarse, &["\"integral\""]),
                ])
                .when("else"),
            ],
            _ => Vec::new(),
        }
    }

    fn of_fronts(&self) -> Vec<Remedy> {
        let earlier = Change("end earlier with", Setting::End);
        match self {
            Self::SelfTouching { .. } => {
                vec![Remedy::any([Change("mend", Setting::Map), Lower(Setting::Distortion)])]
            }
            Self::DegenerateStencil { .. } => vec![
                Remedy::any([Say("make the cells around it less flat")]),
                Remedy::any([Lower(Setting::Distortion), Change("bring them nearer to equal by", Setting::Grading)]),
            ],
            Self::FrontOutside { .. } | Self::VanishingPhase { .. } => {
                vec![Remedy::any([earlier, Say("move the walls away")])]
            }
            Self::WallPassesMelting { .. } => {
                vec![Remedy::any([earlier, Say("keep the wall on its side of the melting temperature")])]
            }
            Self::NotAGraph { .. } => vec![
                Remedy::any([earlier, Refine(Setting::Cells)]),
                Remedy::any([Say("a front that turns over needs another method")]),
            ],
            Self::FrontUnstable { .. } => vec![Remedy::any([
                Lower(Setting::TimeStep),
                Set(Setting::TimeStep, AUTO),
                Set(Setting::Stepping, &["\"implicit\""]),
            ])],
            Self::WrongSide { .. } => {
                let warm = Say("let the lower phase be the warm one: mend the initial and boundary formulas");
                vec![Remedy::any([warm, Set(Setting::Undercooled, &["true"])])]
            }
            _ => Vec::new(),
        }
    }

    /// What may cure it, in words that name no key of a study and no argument.
    pub fn help(&self) -> Option<String> {
        sentence(&self.remedies(), &Plain)
    }
}
