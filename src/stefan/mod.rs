//! Two-phase Stefan problems.
