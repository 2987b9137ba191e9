//! The engine of a program with MPI. Errors of MPI itself end all ranks, as MPI does unless told otherwise.

use crate::error::Result;
use mpi::Threading;
use mpi::datatype::PartitionMut;
use mpi::environment::Universe;
use mpi::request::scope;
use mpi::topology::SimpleCommunicator;
use mpi::traits::*;
use std::time::{Duration, Instant};

/// How long a rank asks again and again for what others send, before it sleeps between questions: where there are more
/// ranks than cores, one that never sleeps takes the core that another needs.
const AWAKE: Duration = Duration::from_micros(200);
/// How long a waiting rank sleeps between two questions.
const NAP: Duration = Duration::from_micros(20);

/// MPI as long as it is there; dropping it waits for the other ranks.
pub struct Engine {
    _universe: Option<Universe>,
}

/// Starts MPI, which only this thread will call: rank and number of ranks.
pub fn begin() -> Result<(Engine, usize, usize)> {
    let universe = mpi::initialize_with_threading(Threading::Funneled).map(|(universe, _)| universe);
    let world = SimpleCommunicator::world();
    let (rank, count) = (world.rank() as usize, world.size() as usize);
    Ok((Engine { _universe: universe }, rank, count))
}

/// The words of all ranks, one after the other.
pub fn gather(words: &[u64], lengths: &[u64]) -> Vec<u64> {
    let lengths: Vec<i32> = lengths.iter().map(|&n| i32::try_from(n).expect("MPI counts to 2^31")).collect();
    let begins: Vec<i32> = (0..lengths.len()).map(|rank| lengths[..rank].iter().sum()).collect();
    let mut all = vec![0; lengths.iter().map(|&n| n as usize).sum()];
    let mut parts = PartitionMut::new(&mut all[..], lengths, begins);
    let world = SimpleCommunicator::world();
    scope(|scope| {
        let mut waiting = Err(world.immediate_all_gather_varcount_into(scope, words, &mut parts));
        let began = Instant::now();
        while let Err(request) = waiting {
            if began.elapsed() > AWAKE {
                std::thread::sleep(NAP);
            }
            waiting = request.test();
        }
    });
    all
}

/// Ends all ranks.
pub fn abort(status: i32) -> ! {
    SimpleCommunicator::world().abort(status)
}
