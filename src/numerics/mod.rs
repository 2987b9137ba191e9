//! How things are computed: differences on the lattice and linear systems on patches of it.

pub mod difference;
pub mod linear;
