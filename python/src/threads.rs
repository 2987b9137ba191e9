//! Where things are computed: in threads of their own, with the interpreter free meanwhile.
//!
//! Every computation has a pool to itself, so that none waits for another, whoever started it: a thread beside it, or a
//! Python function that it calls. Python is called in the thread that waits and nowhere else: Ctrl-C is heard there,
//! and a computation that is left alone never meets an interpreter that ends.

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Time between two looks for a signal, such as Ctrl-C, while a computation runs: too short for a person to notice.
const LOOK: Duration = Duration::from_millis(20);
/// How long the caller waits, after a signal, for a computation that stops by itself at its next step and writes its
/// results; after that it is left to finish in the background.
pub const PATIENCE: Duration = Duration::from_secs(3);
/// How long the caller waits, after a signal, for a computation that cannot be stopped: it ends in this time if it was
/// nearly done, else it is left to finish in the background.
pub const BRIEFLY: Duration = Duration::from_millis(200);

/// A number of threads; all cores, or what RAYON_NUM_THREADS says, where none is given.
pub type Threads = Option<usize>;
/// A pool, with the number of threads that it was asked for with.
type Pool = (Threads, Arc<ThreadPool>);

/// Idle pools of threads, kept for the next computations, beside the id of the process that they belong to: a forked
/// process has none of these threads.
static RESTING: Mutex<(u32, Vec<Pool>)> = Mutex::new((0, Vec::new()));
/// Largest number of idle pools that are kept; the threads of further ones end.
const KEPT: usize = 4;

fn resting() -> MutexGuard<'static, (u32, Vec<Pool>)> {
    let mut resting = RESTING.lock().unwrap_or_else(PoisonError::into_inner);
    if resting.0 != std::process::id() {
        // the pools of the parent process are left alone: there is nobody to join
        std::mem::forget(std::mem::replace(&mut *resting, (std::process::id(), Vec::new())));
    }
    resting
}

fn pool(threads: Threads) -> PyResult<Arc<ThreadPool>> {
    let pools = &mut resting().1;
    if let Some(k) = pools.iter().rposition(|pool| pool.0 == threads) {
        return Ok(pools.swap_remove(k).1);
    }
    let made = ThreadPoolBuilder::new().num_threads(threads.unwrap_or(0)).thread_name(|k| format!("driftmesh-{k}"));
    made.build().map(Arc::new).map_err(|error| PyRuntimeError::new_err(format!("no threads can be made: {error}")))
}

fn rest(pool: Pool) {
    let mut resting = resting();
    if resting.1.len() < KEPT {
        resting.1.push(pool);
    }
}

/// What is called in the thread that waits.
type Call = Box<dyn FnOnce(Python<'_>) -> PyResult<()> + Send>;

enum Message {
    Call(Call),
    Ended,
}

/// Lets a computation call Python.
#[derive(Clone)]
pub struct Caller(Sender<Message>);

/// The other end, where the thread waits that handed the computation out.
pub struct Calls(Mutex<Receiver<Message>>);

pub fn calls() -> (Caller, Calls) {
    let (sender, receiver) = channel();
    (Caller(sender), Calls(Mutex::new(receiver)))
}

impl Caller {
    /// What a call returns; nothing where it raised, or nobody waits any longer.
    pub fn call<T: Send + 'static>(&self, f: impl FnOnce(Python<'_>) -> PyResult<T> + Send + 'static) -> Option<T> {
        let (sender, answer) = channel();
        let call: Call = Box::new(move |py| {
            let _ = sender.send(f(py)?);
            Ok(())
        });
        self.0.send(Message::Call(call)).ok()?;
        answer.recv().ok()
    }
}

impl Calls {
    fn next(&self, py: Python<'_>) -> Result<Message, RecvTimeoutError> {
        py.detach(|| self.0.lock().unwrap_or_else(PoisonError::into_inner).recv_timeout(LOOK))
    }
}

/// Computes what cannot be stopped half-way: at Ctrl-C it is left alone, and what it finds is thrown away.
pub fn compute<T: Send + 'static>(
    py: Python<'_>,
    threads: Threads,
    f: impl FnOnce() -> T + Send + 'static,
) -> PyResult<T> {
    match interruptible(py, threads, calls(), f, || BRIEFLY, |_| Ok(()))? {
        Ended::Itself(result) => Ok(result),
        Ended::Stopped(error, _) => Err(error),
    }
}

/// Computes with so many threads. Ctrl-C, or an exception of a call, calls `stop`, which says how long the end may
/// take. `look` is called every now and then meanwhile.
pub fn interruptible<T: Send + 'static>(
    py: Python<'_>,
    threads: Threads,
    (Caller(ended), calls): (Caller, Calls),
    f: impl FnOnce() -> T + Send + 'static,
    stop: impl Fn() -> Duration,
    mut look: impl FnMut(Python<'_>) -> PyResult<()>,
) -> PyResult<Ended<T>> {
    let (sender, result) = channel();
    let pool = pool(threads)?;
    let theirs = pool.clone();
    pool.spawn(move || {
        let result = catch_unwind(AssertUnwindSafe(f));
        rest((threads, theirs));
        let _ = sender.send(result);
        let _ = ended.send(Message::Ended);
    });
    drop(pool);
    let result = Mutex::new(result);
    let mut interrupted: Option<(PyErr, Instant)> = None;
    loop {
        let heard = match calls.next(py) {
            // after the first exception calls are dropped, and whoever waits for their answers ends
            Ok(Message::Call(call)) => interrupted.as_ref().map_or_else(|| call(py), |_| Ok(())),
            Ok(Message::Ended) | Err(RecvTimeoutError::Disconnected) => {
                let result = result.into_inner().unwrap_or_else(PoisonError::into_inner).try_recv();
                return match (result, interrupted) {
                    (Ok(Ok(result)), None) => Ok(Ended::Itself(result)),
                    (Ok(Ok(result)), Some((error, _))) => Ok(Ended::Stopped(error, Some(result))),
                    _ => Err(PyRuntimeError::new_err(
                        "a mistake in driftmesh itself; please report it with these inputs",
                    )),
                };
            }
            Err(RecvTimeoutError::Timeout) => Ok(()),
        };
        match (heard.and_then(|()| py.check_signals()).and_then(|()| look(py)), interrupted.take()) {
            (Err(error), None) => interrupted = Some((error, Instant::now() + stop())),
            // asked twice, or nothing that could stop it
            (Err(error), Some(_)) => return Ok(Ended::Stopped(error, None)),
            (Ok(()), Some((error, until))) if Instant::now() > until => return Ok(Ended::Stopped(error, None)),
            (Ok(()), before) => interrupted = before,
        }
    }
}

/// How a computation ended.
pub enum Ended<T> {
    /// With its result.
    Itself(T),
    /// It was told to stop by this exception; without a result it goes on beside the interpreter.
    Stopped(PyErr, Option<T>),
}
