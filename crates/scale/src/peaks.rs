//! Peak resident memory of this process, by kind. The kernel only records the peak of the total, so that of the parts
//! is sampled: `RssAnon` and mapped files every few milliseconds while particles are made and trees are built, and
//! after every image before it is freed. So pages of a mapped frame are never counted as anonymous memory.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread;
use std::time::Duration;

use spherule_files::memory::MemoryUse;

use spherule_report::frame::RssSummary;

/// Sampling interval: short enough for allocations that last as long as a phase of a build of 1e6.
const INTERVAL: Duration = Duration::from_millis(4);

/// The largest samples so far.
#[derive(Debug, Default)]
pub(super) struct Peaks {
    anonymous: AtomicU64,
    file: AtomicU64,
    done: AtomicBool,
}

impl Peaks {
    /// Takes one sample.
    pub(super) fn sample(&self) {
        let now = MemoryUse::now();
        self.anonymous.fetch_max(now.anonymous, Ordering::Relaxed);
        self.file.fetch_max(now.file, Ordering::Relaxed);
    }

    /// Runs `work`, and takes samples in the meantime.
    pub(super) fn during<T>(&self, work: impl FnOnce() -> T) -> T {
        self.done.store(false, Ordering::Relaxed);
        thread::scope(|scope| {
            let watcher = scope.spawn(|| {
                while !self.done.load(Ordering::Relaxed) {
                    self.sample();
                    thread::park_timeout(INTERVAL);
                }
            });
            let _ends = EndOnDrop(&self.done, watcher.thread());
            work()
        })
    }

    /// The largest samples, and the kernel's own peak of the total.
    pub(super) fn summary(&self) -> RssSummary {
        self.sample();
        let now = MemoryUse::now();
        RssSummary {
            anonymous: now.anonymous,
            anonymous_peak: self.anonymous.load(Ordering::Relaxed),
            file_peak: self.file.load(Ordering::Relaxed),
            total_peak: now.peak,
        }
    }
}

/// Ends the sampling thread even if the work panics; the scope would wait for it otherwise.
struct EndOnDrop<'a>(&'a AtomicBool, &'a thread::Thread);

impl Drop for EndOnDrop<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
        self.1.unpark();
    }
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn short_peak_is_recorded() {
        const SIZE: usize = 64 << 20;
        let peaks = Peaks::default();
        peaks.sample();
        let before = peaks.summary().anonymous_peak;
        peaks.during(|| {
            let block = std::hint::black_box(vec![1_u8; SIZE]);
            peaks.sample();
            drop(block);
        });
        let after = peaks.summary();
        // Other tests run in this process too; they free less than this.
        assert!(after.anonymous_peak >= before.max(SIZE as u64 / 2));
        assert!(after.total_peak >= after.anonymous_peak / 2);
    }
}
