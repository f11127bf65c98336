//! `[job]`: execution options. No image depends on them, so none is among the settings that identify a job: they may
//! change from run to run.
//!
//! `--force`, `--keep-done` and `--shard` have no key here. They say what one run does; a manifest that
//! always starts over would throw finished work away.

use std::path::{Path, PathBuf};
use std::time::Duration;

use serde_json::{Value as Json, json};

use super::key::{Affects, Keys, section};
use super::value::named;
use crate::metrics::Bytes;

/// Name of the file that ends following if the manifest names none, beside the images.
pub const STOP_FILE: &str = "job.stop";

/// More threads than this are a typing mistake. Fewer are used where the machine has few processors.
pub const MAX_THREADS: u32 = 1024;

/// More retries than this are a typing mistake.
const MAX_RETRIES: u32 = 100;

/// Longest time that can be asked for, seconds: some thirty years.
const MAX_SECONDS: f64 = 1e9;

named! {
    /// How progress is shown.
    ProgressMode {
        /// Bars on a terminal, plain lines elsewhere.
        Auto = "auto",
        /// One line a frame.
        Plain = "plain",
        /// One JSON object a frame.
        Json = "json",
        /// The lines that Open Job Description engines read.
        Openjd = "openjd",
        /// Nothing but warnings and errors.
        None = "none",
    }
}

section! {
    /// Execution options; no image depends on them
    Work {
        /// Threads to use: all, or a number
        ///
        /// At most 4 for each processor are used: more only get in each other's way.
        threads: Option<u32> = None, or("all"), from(1), to(MAX_THREADS), affects(Affects::Nothing),
            flag("threads", "COUNT", "Job");
        /// How progress is shown: auto | plain | json | openjd | none
        progress: ProgressMode = ProgressMode::Auto, affects(Affects::Nothing), flag("progress", "PROGRESS", "Job");
        /// Render each frame in a process of its own
        isolate: bool = false, affects(Affects::Nothing), flag("isolate", "", "Job");
        /// Most anonymous memory of such a process: 4GiB, 512MiB
        memory_ceiling: Option<Bytes> = None, example("\"4GiB\""), unset("no limit"), affects(Affects::Nothing),
            flag("memory-ceiling", "SIZE", "Job");
        /// How often a frame whose process died is tried again in the same run
        retries: u32 = 1, from(0), to(MAX_RETRIES), affects(Affects::Nothing), flag("retries", "COUNT", "Job");
        /// Seconds without a heartbeat after which another machine's frames are reassigned
        takeover_after: Duration = Duration::from_secs(60), above(0), to(MAX_SECONDS), affects(Affects::Nothing),
            flag("takeover-after", "SECONDS", "Job");
        /// Seconds that a running frame may take to finish after TERM or Ctrl-C
        grace: Duration = Duration::from_secs(30), from(0), to(MAX_SECONDS), affects(Affects::Nothing),
            flag("grace", "SECONDS", "Job");
        /// Continue with frames that a running simulation writes
        follow: bool = false, affects(Affects::Nothing), flag("follow", "", "Job");
        /// Seconds without a new frame after which following ends
        idle: Duration = Duration::from_secs(600), above(0), to(MAX_SECONDS), affects(Affects::Nothing),
            flag("idle", "SECONDS", "Job");
        /// Seconds that a file must be unchanged to count as complete
        settle: Duration = Duration::from_secs(2), from(0), to(MAX_SECONDS), affects(Affects::Nothing),
            flag("settle", "SECONDS", "Job");
        /// Following ends when this file appears
        stop_file: Option<String> = None, example("\"job.stop\""), unset("job.stop beside the images"),
            affects(Affects::Nothing), flag("stop-file", "FILE", "Job");
    }
}

impl Work {
    /// The file that ends following, of a manifest whose paths are relative to `dir`, where the images go.
    pub fn stop_file_in(&self, dir: &Path) -> PathBuf {
        dir.join(self.stop_file.as_deref().unwrap_or(STOP_FILE))
    }

    /// All keys, with what they need of one another.
    pub(super) fn all_keys(&mut self, keys: &mut Keys<'_>) {
        self.keys(keys);
        if let Some(section) = keys.reading()
            && self.memory_ceiling.is_some()
            && !self.isolate
        {
            section.wrong(
                "memory_ceiling",
                "is that of a frame's own process; say job.isolate = true (--isolate) too, or render.memory_limit",
            );
        }
    }
}

/// What the keys need of one another, as JSON schema.
pub(super) fn conditions() -> Json {
    json!([{
        "if": { "required": ["memory_ceiling"] },
        "then": { "required": ["isolate"], "properties": { "isolate": { "const": true } } },
    }])
}
