//! `[job]`: execution options. Images do not depend on them, so they are not part of the settings that identify a
//! job, and may change from run to run.
//!
//! `--force`, `--keep-done` and `--shard` have no key here. They apply to a single run; a manifest that always starts
//! over would discard finished work.

use std::path::{Path, PathBuf};
use std::time::Duration;

use spherule_files::Bytes;

use super::key::Affects;
use super::keys::{Keys, section};
use super::rule::{Rule, rules};
use super::value::named;

/// Default name of the file that ends following, next to the images.
pub const STOP_FILE: &str = "job.stop";

/// Maximum number of threads; larger numbers are probably typing errors. Machines with few processors use fewer.
pub const MAX_THREADS: u32 = 1024;

/// Maximum number of retries; larger numbers are probably typing errors.
const MAX_RETRIES: u32 = 100;

/// Maximum time in seconds, about thirty years.
const MAX_SECONDS: f64 = 1e9;

named! {
    /// Display of progress.
    ProgressMode {
        /// Bars on a terminal, plain lines elsewhere.
        Auto = "auto",
        /// One line per frame.
        Plain = "plain",
        /// One JSON object per frame.
        Json = "json",
        /// Messages for Open Job Description engines.
        Openjd = "openjd",
        /// Only warnings and errors.
        None = "none",
    }
}

section! {
    /// Execution options; no image depends on them
    Work {
        /// Threads to use: all, or a number
        ///
        /// At most 4 threads per processor are used; more would slow each other down.
        threads: Option<u32> = None, or("all"), from(1), to(MAX_THREADS), affects(Affects::Nothing),
            flag("threads", "COUNT", "Job");
        /// How progress is shown: auto | plain | json | openjd | none
        progress: ProgressMode = ProgressMode::Auto, affects(Affects::Nothing), flag("progress", "PROGRESS", "Job");
        /// Render each frame in a separate process
        isolate: bool = false, affects(Affects::Nothing), flag("isolate", "", "Job");
        /// Maximum anonymous memory per frame, if isolate is set: 4GiB, 512MiB
        memory_ceiling: Option<Bytes> = None, example("\"4GiB\""), unset("no limit"), affects(Affects::Nothing),
            flag("memory-ceiling", "SIZE", "Job");
        /// Number of times that a run retries a frame whose process died
        retries: u32 = 1, from(0), to(MAX_RETRIES), affects(Affects::Nothing), flag("retries", "COUNT", "Job");
        /// Seconds without a heartbeat after which another machine's frames are reassigned
        takeover_after: Duration = Duration::from_secs(60), above(0), to(MAX_SECONDS), affects(Affects::Nothing),
            flag("takeover-after", "SECONDS", "Job");
        /// Seconds that a running frame may take to finish after TERM or Ctrl-C
        grace: Duration = Duration::from_secs(30), from(0), to(MAX_SECONDS), affects(Affects::Nothing),
            flag("grace", "SECONDS", "Job");
        /// Render frames while a running simulation writes them
        follow: bool = false, affects(Affects::Nothing), flag("follow", "", "Job");
        /// Seconds without a new frame after which following ends
        idle: Duration = Duration::from_secs(600), above(0), to(MAX_SECONDS), affects(Affects::Nothing),
            flag("idle", "SECONDS", "Job");
        /// Seconds that a file must be unchanged to count as complete
        settle: Duration = Duration::from_secs(2), from(0), to(MAX_SECONDS), affects(Affects::Nothing),
            flag("settle", "SECONDS", "Job");
        /// Following ends when this file appears
        stop_file: Option<String> = None, example("\"job.stop\""), unset("job.stop next to the images"),
            affects(Affects::Nothing), flag("stop-file", "FILE", "Job");
    }
}

/// Rules between the keys.
pub(super) const RULES: &[Rule] = rules! {
    "isolate" MissingOr["false"] => "memory_ceiling" Missing:
        "applies to the process of a frame; set job.isolate = true too, or use render.memory_limit";
};

impl Work {
    /// The path of the file that ends following, for a manifest with paths relative to `dir`, the directory of the
    /// images.
    pub fn stop_file_in(&self, dir: &Path) -> PathBuf {
        dir.join(self.stop_file.as_deref().unwrap_or(STOP_FILE))
    }

    /// All keys, with checks of their dependencies.
    pub(super) fn all_keys(&mut self, keys: &mut Keys<'_>) {
        self.keys(keys);
        if let Some(section) = keys.reading() {
            section.check(RULES);
        }
    }
}
