//! Runs work without the interpreter's lock, on threads of its own, and lets Ctrl-C through.

use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread;
use std::time::Duration;

use pyo3::prelude::*;

use crate::errors::{Class, Failure};

/// Time between two checks for signals.
const SIGNAL_INTERVAL: Duration = Duration::from_millis(50);

/// Runs `work` in a pool of `threads` threads, by default one for each processor. A pool for each call keeps calls in
/// several threads apart, and works after a fork. `on_signal` is called for each signal whose Python handler raises
/// an exception, which is raised when `work` has returned.
pub(crate) fn run<T: Send>(
    py: Python<'_>,
    threads: Option<usize>,
    on_signal: impl Fn() + Send + Sync,
    work: impl FnOnce() -> Result<T, Failure> + Send,
) -> PyResult<T> {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads.unwrap_or(0))
        .build()
        .map_err(|error| Failure::new(Class::Internal, error).raise(py))?;
    // Work without the lock, and look for signals meanwhile
    let (result, signal) = py.detach(|| {
        thread::scope(|scope| {
            let (ended, has_ended) = mpsc::channel::<()>();
            let worker = scope.spawn(|| {
                let _ended = ended;
                pool.install(work)
            });
            let mut signal = None;
            while has_ended.recv_timeout(SIGNAL_INTERVAL) == Err(RecvTimeoutError::Timeout) {
                if let Err(error) = Python::attach(|py| py.check_signals()) {
                    signal.get_or_insert(error);
                    on_signal();
                }
            }
            (worker.join(), signal)
        })
    });
    // A signal takes precedence over the result
    if let Some(signal) = signal {
        return Err(signal);
    }
    let result = result.unwrap_or_else(|_| {
        let what = "a bug: the render thread panicked; see standard error";
        Err(Failure::new(Class::Internal, what))
    });
    result.map_err(|failure| failure.raise(py))
}
