//! Why automatic time steps vanish.

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
