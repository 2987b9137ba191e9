//! Moving meshes for time-dependent partial differential equations.
//!
//! A moving mesh keeps its number of points and its connections and *moves* the points to where a thin feature of the
//! solution is. [`simulation::Simulation`] couples the three parts that any such method has, each behind one trait:
//!
//! | part | trait | here |
//! |---|---|---|
//! | where the mesh should be fine | [`density::Monitor`] | [`density::Arclength`] |
//! | how it follows | [`meshing::MeshGenerator`] | [`meshing::Stochastic`], [`meshing::Schwarz`], [`meshing::Whole`] |
//! | what is solved on it | [`physics::Physics`] | [`physics::Burgers`] |
//!
//! # A tour
//!
//! The parts also work alone: here a mesh is moved to the data of somebody else's solver.
//!
//! ```
//! use driftmesh::density::{Arclength, Monitor};
//! use driftmesh::geometry::{Lattice, Mesh, quality};
//! use driftmesh::meshing::{MeshGenerator, Mmpde, Whole};
//!
//! let mut mesh = Mesh::uniform(Lattice::bounded([40, 40])?, [0.0, 0.0], [1.0, 1.0])?;
//! let front = |[x, y]: [f64; 2]| (40.0 * (x + y - 1.0)).tanh();
//! let (monitor, mut generator) = (Arclength::default(), Whole::default());
//! let equation = Mmpde::default();
//! for _ in 0..200 {
//!     let u: Vec<f64> = mesh.x().iter().map(|&x| front(x)).collect();
//!     let rho = monitor.density(&mesh, &u, None)?;
//!     mesh = generator.step(&equation, &mesh, &rho, 1e-3)?.mesh;
//! }
//! let u: Vec<f64> = mesh.x().iter().map(|&x| front(x)).collect();
//! let q = quality(&mesh, monitor.density(&mesh, &u, None)?.largest())?;
//! assert!(q.min_scaled_jacobian > 0.0 && q.equidistribution < 2.0);
//! # Ok::<(), driftmesh::Error>(())
//! ```
//!
//! Laplacians on any structured mesh are in [`laplacian`], moving phase boundaries in [`stefan`], meshes on a line in
//! [`equidistribution`].
//!
//! Whole studies come from TOML files: [`study::Study`] reads one of any kind and runs it into a directory; a
//! [`study::Kind`] does so with one of its kind, and returns what was found.
//!
//! Modules, lowest floor first: [`error`], [`formula`], [`geometry`] and [`ranks`], [`numerics`], then [`density`],
//! [`equidistribution`], [`laplacian`], [`meshing`] and [`physics`], then [`mover`] and [`stefan`], then
//! [`simulation`], [`output`], [`report`] and [`study`].

// What only studies and their checkpoints use is dead code in a library without them.
#![cfg_attr(not(feature = "studies"), allow(dead_code, unused_imports))]

mod elementary;
pub mod error;
pub mod formula;
pub mod kept;
mod kind;
mod parallel;
mod random;
mod setting;
mod stopwatch;
mod work;

pub mod geometry;
pub mod ranks;

pub mod numerics;

pub mod density;
pub mod equidistribution;
pub mod laplacian;
pub mod meshing;
pub mod physics;

pub mod mover;
pub mod species;
pub mod stefan;

pub mod simulation;

#[cfg(feature = "studies")]
pub mod output;

#[cfg(feature = "studies")]
pub mod report;

#[cfg(feature = "studies")]
pub mod study;

pub use error::{Error, Failure, Result};
pub use setting::Auto;
pub use work::Work;
