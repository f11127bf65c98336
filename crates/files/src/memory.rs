//! Memory of this process as counted by Linux.
//!
//! `VmHWM` is the exact peak of all resident memory, including mapped files; the kernel separates only the current
//! value into anonymous and file-backed pages. If no data are mapped, the file-backed pages are the code of the
//! program, a few MiB that only grow. So [`MemoryPeaks`] computes the peak of anonymous memory as `VmHWM` minus the
//! largest sampled file-backed part, which misses nothing between two samples. If frames are mapped, their pages come
//! and go, and would be counted. Then the peak is the largest sample of `RssAnon` ([`MemoryPeaks::use_samples_only`]),
//! so samples must be taken where it is highest, at the ends of phases.

use std::fs;

/// Resident memory in bytes; zeros if the system does not report it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct MemoryUse {
    /// Peak of all resident memory since the process started (`VmHWM`).
    pub peak: u64,
    /// Resident heap and stacks (`RssAnon`).
    pub anonymous: u64,
    /// Resident pages of mapped files (`RssFile`, and `RssShmem` for those in a tmpfs).
    pub file: u64,
}

/// Bytes that can be allocated without swapping (`MemAvailable`); None if the system does not report it.
pub fn available() -> Option<u64> {
    value_of(&fs::read_to_string("/proc/meminfo").ok()?, "MemAvailable")
}

/// Bytes that this process can allocate before it reaches its own limit (`ulimit -d`, `ulimit -v`); None without a
/// limit.
#[cfg(unix)]
pub fn process_room() -> Option<u64> {
    use rustix::process::{Resource, getrlimit};
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let limits = [(Resource::Data, "VmData"), (Resource::As, "VmSize")];
    let rooms = limits.into_iter().filter_map(|(limit, taken)| {
        let most = getrlimit(limit).current?;
        Some(most.saturating_sub(value_of(&status, taken).unwrap_or(0)))
    });
    rooms.min()
}

/// Bytes that this process can allocate; unknown on this system.
#[cfg(not(unix))]
pub fn process_room() -> Option<u64> {
    None
}

/// Installed memory in bytes (`MemTotal`); None if the system does not report it.
pub fn installed() -> Option<u64> {
    value_of(&fs::read_to_string("/proc/meminfo").ok()?, "MemTotal")
}

/// The bytes in a line `key: n kB`.
fn value_of(table: &str, key: &str) -> Option<u64> {
    let mut lines = table.lines();
    let rest = lines.find_map(|line| line.strip_prefix(key)?.strip_prefix(':'))?;
    let kib = rest.trim().strip_suffix("kB")?.trim();
    Some(kib.parse::<u64>().ok()? * 1024)
}

impl MemoryUse {
    /// The current values of the system.
    pub fn now() -> Self {
        fs::read_to_string("/proc/self/status")
            .map_or_else(|_| Self::default(), |s| Self::parse(&s))
    }

    fn parse(status: &str) -> Self {
        let bytes = |key: &str| value_of(status, key).unwrap_or(0);
        Self {
            peak: bytes("VmHWM"),
            anonymous: bytes("RssAnon"),
            file: bytes("RssFile") + bytes("RssShmem"),
        }
    }
}

/// The largest values so far, in bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct MemoryPeaks {
    /// Heap and stacks: the larger of `total` minus `file` and any sample of `RssAnon`, or only the latter
    /// ([`Self::use_samples_only`]).
    pub anonymous: u64,
    /// Mapped files, largest sample ([`MemoryUse::file`]).
    pub file: u64,
    /// Everything, at any time (`VmHWM`).
    pub total: u64,
    /// Heap and stacks, largest sample.
    sampled_anonymous: u64,
    use_samples_only: bool,
}

impl MemoryPeaks {
    /// From now on data files are mapped: only samples of anonymous memory count.
    pub fn use_samples_only(&mut self) {
        self.use_samples_only = true;
    }

    /// Adds the sample `now`.
    pub fn update(&mut self, now: MemoryUse) {
        self.file = self.file.max(now.file);
        self.total = self.total.max(now.peak);
        self.sampled_anonymous = self.sampled_anonymous.max(now.anonymous);
        self.anonymous = if self.use_samples_only {
            self.sampled_anonymous
        } else {
            self.sampled_anonymous.max(self.total.saturating_sub(self.file))
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn peak_between_two_samples_counts() {
        let mut peaks = MemoryPeaks::default();
        let use_of = |peak, anonymous, file| MemoryUse { peak, anonymous, file };
        peaks.update(use_of(100, 30, 8));
        assert_eq!((peaks.anonymous, peaks.file, peaks.total), (92, 8, 100));
        peaks.update(use_of(100, 40, 10));
        assert_eq!((peaks.anonymous, peaks.file, peaks.total), (90, 10, 100));
        // The maps were closed before the second sample; the peak remains.
        peaks.update(use_of(140, 95, 60));
        assert_eq!((peaks.anonymous, peaks.file, peaks.total), (95, 60, 140));
    }

    #[test]
    fn mapped_pages_are_not_anonymous_memory() {
        let mut peaks = MemoryPeaks::default();
        peaks.use_samples_only();
        // The map was larger between two samples.
        for (peak, anonymous, file) in [(1000, 50, 600), (1000, 40, 20)] {
            peaks.update(MemoryUse { peak, anonymous, file });
        }
        assert_eq!((peaks.anonymous, peaks.file, peaks.total), (50, 600, 1000));
    }

    #[test]
    fn parses_proc_status() {
        let status = "Name:\tx\nVmHWM:\t    2048 kB\nRssAnon:\t 1024 kB\nRssFile:\t   12 kB\nRssShmem: 4 kB\n";
        let expected = MemoryUse { peak: 2 << 20, anonymous: 1 << 20, file: 16 << 10 };
        assert_eq!(MemoryUse::parse(status), expected);
        assert_eq!(MemoryUse::parse("nothing here"), MemoryUse::default());
    }
}
