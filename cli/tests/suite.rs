//! The tests of the program, as one program; those on several ranks need an MPI library and are `ranks.rs`.

mod cli;
mod report;
mod resume;
mod running;
