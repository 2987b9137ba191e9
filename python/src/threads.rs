//! Where things are computed: in a pool of threads of this process, with the interpreter free meanwhile.

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// How often signals are looked for.
const LOOK: Duration = Duration::from_millis(20);
/// How long a computation that was told to stop, and looks whether it was, may take to write what it has.
pub const PATIENCE: Duration = Duration::from_secs(3);
/// The same for one that may not look.
pub const BRIEFLY: Duration = Duration::from_millis(200);

/// The pool, and the process that it belongs to: the threads of a process are not there after a fork.
static POOL: Mutex<Option<(u32, Arc<ThreadPool>)>> = Mutex::new(None);

fn pool() -> PyResult<Arc<ThreadPool>> {
    let mut pool = POOL.lock().unwrap_or_else(PoisonError::into_inner);
    match pool.as_ref() {
        Some((process, pool)) if *process == std::process::id() => Ok(pool.clone()),
        _ => {
            let made = ThreadPoolBuilder::new().thread_name(|k| format!("driftmesh-{k}")).build();
            let made = made.map_err(|error| PyRuntimeError::new_err(format!("no threads can be made: {error}")))?;
            let made = Arc::new(made);
            // the pool of the parent process is left alone: there is nobody to join
            std::mem::forget(pool.replace((std::process::id(), made.clone())));
            Ok(made)
        }
    }
}

/// Computes with the interpreter free and all threads at hand.
pub fn compute<T: Send>(py: Python<'_>, f: impl FnOnce() -> T + Send) -> PyResult<T> {
    let pool = pool()?;
    Ok(py.detach(|| pool.install(f)))
}

/// The same for what may take long: Ctrl-C calls `stop`, which says how long the end may take. `look` is called every now
/// and then meanwhile.
pub fn interruptible<T: Send + 'static>(
    py: Python<'_>,
    f: impl FnOnce() -> T + Send + 'static,
    stop: impl Fn() -> Duration,
    mut look: impl FnMut(Python<'_>) -> PyResult<()>,
) -> PyResult<Ended<T>> {
    let (sender, receiver) = channel();
    pool()?.spawn(move || {
        let result = std::panic::catch_unwind(std::panic::AssertUnwindSafe(f));
        let _ = sender.send(result);
    });
    let receiver = Mutex::new(receiver);
    let wait =
        |py: Python<'_>| py.detach(|| receiver.lock().unwrap_or_else(PoisonError::into_inner).recv_timeout(LOOK));
    let mut interrupted: Option<(PyErr, Instant)> = None;
    loop {
        match wait(py) {
            Ok(Ok(result)) => {
                return Ok(match interrupted {
                    None => Ended::Itself(result),
                    Some((error, _)) => Ended::Stopped(error, Some(result)),
                });
            }
            Ok(Err(_)) | Err(RecvTimeoutError::Disconnected) => {
                return Err(PyRuntimeError::new_err(
                    "a mistake in driftmesh itself; please report it with these inputs",
                ));
            }
            Err(RecvTimeoutError::Timeout) => {}
        }
        match (py.check_signals().and_then(|()| look(py)), interrupted.take()) {
            (Err(error), None) => {
                interrupted = Some((error, Instant::now() + stop()));
            }
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
