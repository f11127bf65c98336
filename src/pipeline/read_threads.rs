//! Threads for reading frames, separate from those that trace.
//!
//! Readers work in parallel. In the pool that traces, their tasks would wait until a thread runs out of tiles: a
//! frame that takes milliseconds to read would be ready only when the previous image is. In a separate pool they
//! start immediately. The data do not depend on the pool.

use std::sync::OnceLock;

use rayon::{Scope, ThreadPool, ThreadPoolBuilder};

/// Frames of at least this size, bytes, are read by many threads; 32 MiB of positions take one thread about 20 ms,
/// the same amount of text about 300 ms.
const LARGE: u64 = 32 << 20;

/// Threads for reading.
#[derive(Debug)]
pub(super) struct ReadThreads {
    /// The single thread of the first stage.
    one: ThreadPool,
    /// As many threads as trace, started for the first large frame. None if the system has no more threads.
    many: OnceLock<Option<ThreadPool>>,
    /// Number of threads that trace.
    tracing: usize,
}

impl ReadThreads {
    /// Starts the thread of the first stage. The current pool must be the one that traces.
    ///
    /// # Panics
    /// If the system has no thread left, as [`std::thread::spawn`] does.
    pub(super) fn new() -> Self {
        let one = start(1).unwrap_or_else(|| panic!("the system has no thread left for reading"));
        Self { one, many: OnceLock::new(), tracing: rayon::current_num_threads() }
    }

    /// Runs `work` on the current thread; tasks that it spawns run on the thread of the first stage, and have
    /// finished on return.
    pub(super) fn scope<'scope, T>(&self, work: impl FnOnce(&Scope<'scope>) -> T) -> T {
        self.one.in_place_scope(work)
    }

    /// Reads a frame of `bytes` with `read`, on the thread of the first stage, which must be the caller, or on many
    /// threads.
    pub(super) fn read<T: Send>(&self, bytes: u64, read: impl FnOnce() -> T + Send) -> T {
        if !needs_many(bytes) {
            return read();
        }
        match self.many.get_or_init(|| start(self.tracing)) {
            Some(many) => many.install(read),
            None => read(),
        }
    }
}

/// Whether a frame of `bytes` is read by as many threads as trace.
pub(super) const fn needs_many(bytes: u64) -> bool {
    bytes >= LARGE
}

fn start(threads: usize) -> Option<ThreadPool> {
    let pool = ThreadPoolBuilder::new().num_threads(threads);
    pool.thread_name(|_| "reading".to_owned()).build().ok()
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;
    use std::sync::{Arc, Mutex};

    use rayon::prelude::*;

    use super::*;

    /// Sums in parallel, as readers do, while every thread of the pool that traces is busy.
    #[test]
    fn reading_does_not_wait_for_the_pool_that_traces() {
        let (end, ends) = channel::<()>();
        let ends = Arc::new(Mutex::new(ends));
        for _ in 0..rayon::current_num_threads() {
            let ends = Arc::clone(&ends);
            rayon::spawn(move || {
                let _ = ends.lock().map(|ends| ends.recv());
            });
        }
        // Would never return if it needed a thread of that pool.
        for bytes in [1, LARGE] {
            let threads = ReadThreads::new();
            let mut sum = 0_u64;
            threads.scope(|stage| {
                let (threads, sum) = (&threads, &mut sum);
                stage.spawn(move |_| {
                    *sum = threads.read(bytes, || (0..10_000_u64).into_par_iter().sum());
                });
            });
            assert_eq!(sum, 49_995_000);
        }
        drop(end);
    }

    #[test]
    fn large_frames_have_as_many_threads_as_trace() {
        let tracing = ThreadPoolBuilder::new().num_threads(3).build().unwrap();
        let threads = tracing.install(ReadThreads::new);
        let mut counts = [0; 2];
        threads.scope(|stage| {
            let (threads, counts) = (&threads, &mut counts);
            stage.spawn(move |_| {
                for (count, bytes) in counts.iter_mut().zip([LARGE - 1, LARGE]) {
                    *count = threads.read(bytes, rayon::current_num_threads);
                }
            });
        });
        assert_eq!(counts, [1, 3]);
    }
}
