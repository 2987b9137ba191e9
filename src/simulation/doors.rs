//! What other crates call of a simulation.

use super::{Observer, Record, Simulation, State};
use crate::error::Result;
use crate::geometry::Mesh;
use crate::mover::Start;

/// A generic function is compiled again in every crate that calls it: behind these, all is compiled once with the
/// library.
macro_rules! doors {
    ($D:literal) => {
        impl Simulation<$D> {
            /// The state at the start, on a given mesh.
            ///
            /// # Errors
            /// [`Failed`](crate::Error::Failed) where the mesh is folded or the initial solution has no finite density.
            pub fn start(&self, mesh: Mesh<$D>) -> Result<State<$D>> {
                self.started(mesh)
            }

            /// The mesh that rests on the density of the initial solution, from a given mesh, and whether it came to
            /// rest
            ///
            /// Steps of the mesh equation, each with the initial solution at the new nodes, until no node moves by more
            /// than a small share of the shortest edge. Observers see each of them ([`Observer::adapting`]).
            ///
            /// # Errors
            /// [`Failed`](crate::Error::Failed) where the initial solution has no finite density or the mesh folds, or
            /// what an observer returned.
            pub fn adapted(&self, mesh: Mesh<$D>, observers: &mut [&mut dyn Observer]) -> Result<Start<$D>> {
                self.adapted_from(mesh, observers)
            }

            /// Runs to the end of the schedule
            ///
            /// `state` advances step by step; after an error it is the last good one. `record` adds up what was done.
            ///
            /// # Errors
            /// [`Failed`](crate::Error::Failed) with the time and step of a numerical failure, or what an observer
            /// returned.
            pub fn run(
                &mut self,
                state: &mut State<$D>,
                record: &mut Record,
                observers: &mut [&mut dyn Observer],
            ) -> Result<()> {
                self.ran(state, record, observers)
            }
        }
    };
}

doors!(1);
doors!(2);
