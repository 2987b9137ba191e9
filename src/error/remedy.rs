//! Remedies of a failure as data; each interface puts them into words with its own names.

use strum::{EnumIter, IntoStaticStr};

/// A setting or argument that may be changed, by its meaning. A study may have a key for it, and Python an argument.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, EnumIter, IntoStaticStr)]
pub enum Setting {
    /// Passes of the filter over the density.
    #[strum(serialize = "the smoothing of the density")]
    Smoothing,
    /// How strongly the density depends on the slope of what the mesh follows.
    #[strum(serialize = "the strength of the density")]
    Strength,
    /// Difference scheme for the gradient of the density.
    #[strum(serialize = "the gradient of the density")]
    Gradient,
    /// The quantity that the mesh follows.
    #[strum(serialize = "what the mesh follows")]
    Followed,
    /// τ of the mesh equation.
    #[strum(serialize = "the relaxation of the mesh equation")]
    Relaxation,
    /// Length of a time step, or the error that it may make.
    #[strum(serialize = "the time step")]
    TimeStep,
    /// Time at which a run ends.
    #[strum(serialize = "the end of the run")]
    End,
    /// Stepper of the equation on a uniform mesh.
    #[strum(serialize = "the stepper of the uniform mesh")]
    Stepper,
    /// Cells of the grid.
    #[strum(serialize = "the cells")]
    Cells,
    /// Axes that wrap around.
    #[strum(serialize = "the periodic axes")]
    Periodic,
    /// ν of Burgers' equation.
    #[strum(serialize = "the viscosity")]
    Viscosity,
    /// Flux of Burgers' equation.
    #[strum(serialize = "the flux")]
    Flux,
    /// How the mesh moves.
    #[strum(serialize = "the generator")]
    Generator,
    /// How interface values are estimated.
    #[strum(serialize = "the estimator")]
    Estimator,
    /// Walks or paths from each point.
    #[strum(serialize = "the walks or paths of the estimator")]
    Samples,
    /// Euler–Maruyama steps of a path within a time step.
    #[strum(serialize = "the sub-steps of the paths")]
    Substeps,
    /// Most iterations of overlapping subdomains in a step.
    #[strum(serialize = "the iterations of the generator")]
    Exchanges,
    /// Cells that subdomains share.
    #[strum(serialize = "the overlap")]
    Overlap,
    /// The density of a line.
    #[strum(serialize = "the density")]
    Density,
    /// Mean of the density of a line over a cell.
    #[strum(serialize = "the face density")]
    FaceDensity,
    /// What subdomains of a line exchange.
    #[strum(serialize = "the method")]
    Method,
    /// Whether they solve with the density of the last iterate.
    #[strum(serialize = "`linearized`")]
    Linearized,
    /// The coarse correction between them.
    #[strum(serialize = "the coarse correction")]
    Coarse,
    /// The order in which they are solved.
    #[strum(serialize = "the sweep")]
    Sweep,
    /// p of their Robin conditions.
    #[strum(serialize = "the parameter of Robin's conditions")]
    Robin,
    /// Quadrature of their optimal conditions.
    #[strum(serialize = "the integral of the optimal conditions")]
    Integral,
    /// Iterations between them.
    #[strum(serialize = "the iterations")]
    Iterations,
    /// The tolerance of these.
    #[strum(serialize = "the tolerance")]
    Tolerance,
    /// Mapping of the unit square to the domain.
    #[strum(serialize = "the map of the domain")]
    Map,
    /// Distortion of the unit square before.
    #[strum(serialize = "the distortion of the mesh")]
    Distortion,
    /// Grading of cells toward a side or a front.
    #[strum(serialize = "the grading of the mesh")]
    Grading,
    /// Sides where slopes are given.
    #[strum(serialize = "the sides with slopes")]
    Slopes,
    /// Stepping of a front.
    #[strum(serialize = "the stepping of the front")]
    Stepping,
    /// Whether a phase is an undercooled melt.
    #[strum(serialize = "that the melt is undercooled")]
    Undercooled,
}

impl Setting {
    /// In words that any reader knows.
    pub fn words(self) -> &'static str {
        self.into()
    }
}

/// One action of a remedy.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Act {
    /// Raise the setting.
    Raise(Setting),
    /// Lower the setting.
    Lower(Setting),
    /// Make the setting finer.
    Refine(Setting),
    /// Set it to one of these values, written as in a study.
    Set(Setting, &'static [&'static str]),
    /// Set it to a number, where the program chooses by default.
    Number(Setting),
    /// Leave the setting out.
    LeaveOut(Setting),
    /// Change it as these words say, which stand before its name.
    Change(&'static str, Setting),
    /// Words that name no setting.
    Say(&'static str),
}

impl Act {
    /// The setting that it changes, if it changes one.
    pub fn setting(self) -> Option<Setting> {
        match self {
            Self::Raise(setting)
            | Self::Lower(setting)
            | Self::Refine(setting)
            | Self::Set(setting, _)
            | Self::Number(setting)
            | Self::LeaveOut(setting)
            | Self::Change(_, setting) => Some(setting),
            Self::Say(_) => None,
        }
    }
}

/// Actions of which any one may help, with the case in which they do.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Remedy {
    /// Words before the actions; `else`, `or` and `and` are left out at the beginning of a sentence.
    pub before: &'static str,
    /// The alternatives.
    pub acts: Vec<Act>,
    /// Words after the actions, with what separates them.
    pub behind: &'static str,
}

impl Remedy {
    /// A remedy of these alternatives.
    pub fn any<const N: usize>(acts: [Act; N]) -> Self {
        Self { acts: acts.into(), ..Self::default() }
    }

    /// This remedy for one case only: `before` names the case, in words that stand before the remedy.
    pub fn when(self, before: &'static str) -> Self {
        Self { before, ..self }
    }

    /// This remedy with further words behind it.
    pub fn with(self, behind: &'static str) -> Self {
        Self { behind, ..self }
    }
}

/// How an interface names what may be changed.
pub trait Door {
    /// The name of the setting that an action changes; none where the interface has no such setting, or it already has
    /// that value.
    fn name(&self, act: Act) -> Option<String>;

    /// The words for a value of a setting.
    fn value(&self, _setting: Setting, value: &'static str) -> String {
        value.into()
    }
}

/// An interface without names of its own: settings in plain words.
pub struct Plain;

impl Door for Plain {
    fn name(&self, act: Act) -> Option<String> {
        act.setting().map(|setting| setting.words().into())
    }
}

/// Remedies in one sentence, with the actions that an interface has; none where it has none of them.
///
/// # Example
/// ```
/// use driftmesh::error::{Act, Plain, Remedy, Setting, sentence};
/// let remedies = [
///     Remedy::any([Act::Lower(Setting::TimeStep), Act::Lower(Setting::Cells), Act::Raise(Setting::Relaxation)]),
///     Remedy::any([Act::Set(Setting::Gradient, &["\"safe\""])]).with(" where it is steep"),
/// ];
/// assert_eq!(
///     sentence(&remedies, &Plain).unwrap(),
///     "lower the time step, lower the cells or raise the relaxation of the mesh equation; \
///      set the gradient of the density to \"safe\" where it is steep"
/// );
/// ```
pub fn sentence(remedies: &[Remedy], door: &impl Door) -> Option<String> {
    let mut clauses: Vec<String> = Vec::new();
    for Remedy { before, acts, behind } in remedies {
        let Some(either) = either(acts, door) else { continue };
        let lead = match *before {
            "" => String::new(),
            "else" | "or" | "and" if clauses.is_empty() => String::new(),
            before => format!("{before} "),
        };
        clauses.push(format!("{lead}{either}{behind}"));
    }
    (!clauses.is_empty()).then(|| clauses.join("; "))
}

/// `raise a, raise b or lower c`.
fn either(acts: &[Act], door: &impl Door) -> Option<String> {
    let mut phrases: Vec<String> = Vec::new();
    for &act in acts {
        let name = door.name(act);
        let (verb, object, rest) = match (act, name) {
            (Act::Say(words), _) => ("", words.to_string(), String::new()),
            (_, None) => continue,
            (Act::Raise(_), Some(name)) => ("raise", name, String::new()),
            (Act::Lower(_), Some(name)) => ("lower", name, String::new()),
            (Act::Refine(_), Some(name)) => ("refine", name, String::new()),
            (Act::Number(_), Some(name)) => ("give", name, " as a number".into()),
            (Act::LeaveOut(_), Some(name)) => ("leave", name, " out".into()),
            (Act::Change(words, _), Some(name)) => (words, name, String::new()),
            (Act::Set(setting, values), Some(name)) => {
                let values: Vec<String> = values.iter().map(|value| door.value(setting, value)).collect();
                ("set", name, format!(" to {}", values.join(" or ")))
            }
        };
        phrases.push(if verb.is_empty() { object } else { format!("{verb} {object}{rest}") });
    }
    let end = phrases.pop()?;
    Some(if phrases.is_empty() { end } else { format!("{} or {end}", phrases.join(", ")) })
}
