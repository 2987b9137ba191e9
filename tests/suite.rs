//! All tests of the library from outside, as one program: built and linked once, on all cores until the last test.
//! `cargo test --release --test suite mover::` runs those of tests/mover.rs.

mod brought_up;
mod cell_sizes;
mod columns;
mod conserved;
mod contact;
mod convergence;
mod corpora;
mod coupling;
mod curved;
mod dam_break;
mod data;
mod data_sheets;
mod defaults;
mod degenerate;
mod dimensions;
mod domains;
mod doubts;
mod equidistribution;
mod errors;
mod few_cells;
mod floors;
mod forced;
mod forming;
mod formula_pde;
mod front_runs;
mod fronts;
mod laplacian;
mod limited;
mod line;
mod line_generators;
mod longer;
mod minimal_rust;
mod mover;
mod moving_line;
mod pages;
mod payoff;
mod peers;
mod phases;
mod poisson_sides;
mod problems;
mod published_lines;
mod refusals;
mod remedies;
mod resume;
mod runs;
mod safety;
mod same_everywhere;
mod schwarz_theorems;
mod shallow_water;
mod shocks;
mod sides;
mod species;
mod stefan;
mod steps;
mod studies;
mod sweep;
mod terms;
mod uniform;

/// What the fuzzer tries, and the random choices of studies.
#[path = "../fuzz/targets.rs"]
mod targets;
