//! `[job]`: how the work is gone about. No image depends on it, so none of it is among the settings
//! that a job is known by: it may change from run to run.
//!
//! `--force`, `--keep-done` and `--shard` have no key here. They say what one run does; a manifest that
//! always starts over would throw finished work away.

use std::path::{Path, PathBuf};
use std::time::Duration;

use schemars::JsonSchema;

use super::look::read_size;
use super::named;
use super::reader::{Field, Section};
use super::write::{Entries, Toml, described};
use crate::metrics::Bytes;

/// Name of the file that ends following if the manifest names none, beside the images.
pub const STOP_FILE: &str = "job.stop";

/// Threads beyond this are a slip of the hand. Fewer are used where the machine has few processors.
pub const MAX_THREADS: u32 = 1024;

/// Tries beyond this are a slip of the hand.
pub(super) const MAX_RETRIES: u32 = 100;

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

/// A time as the manifest has it: finite, not negative, at most a thousand million seconds.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
pub struct Seconds(f64);

impl Seconds {
    /// The time, to the nanosecond.
    pub fn duration(self) -> Duration {
        Duration::from_secs_f64(self.0)
    }

    /// The number.
    pub const fn get(self) -> f64 {
        self.0
    }
}

/// `[job]`.
#[derive(Debug, Clone, PartialEq)]
pub struct Work {
    /// Threads to use; None is as many as the machine has.
    pub threads: Option<u32>,
    /// How progress is shown.
    pub progress: ProgressMode,
    /// Whether each frame is made in a process of its own.
    pub isolate: bool,
    /// Most anonymous memory of such a process; None is no limit. Never there without `isolate`.
    pub memory_ceiling: Option<Bytes>,
    /// How often a frame whose process died is tried again in the same run.
    pub retries: u32,
    /// How long a worker on another machine may give no sign of life before its frames are taken over;
    /// above 0.
    pub takeover_after: Seconds,
    /// How long a frame in hand may take after TERM or Ctrl-C before it is dropped.
    pub grace: Seconds,
    /// Whether the run goes on with frames that a running simulation writes.
    pub follow: bool,
    /// How long no new frame may come before following ends; above 0.
    pub idle: Seconds,
    /// How long a file must have stood unchanged to count as complete.
    pub settle: Seconds,
    /// File that ends following when it appears, relative to the manifest; None is [`STOP_FILE`] beside
    /// the images.
    pub stop_file: Option<String>,
}

impl Default for Work {
    fn default() -> Self {
        Self {
            threads: None,
            progress: ProgressMode::Auto,
            isolate: false,
            memory_ceiling: None,
            retries: 1,
            takeover_after: Seconds(60.0),
            grace: Seconds(30.0),
            follow: false,
            idle: Seconds(600.0),
            settle: Seconds(2.0),
            stop_file: None,
        }
    }
}

impl Work {
    /// The file that ends following, of a manifest whose paths are relative to `dir`, where the images go.
    pub fn stop_file_in(&self, dir: &Path) -> PathBuf {
        dir.join(self.stop_file.as_deref().unwrap_or(STOP_FILE))
    }

    pub(super) fn read(mut section: Section<'_>) -> Self {
        let default = Self::default();
        let work = Self {
            threads: section.value("threads", default.threads, read_threads),
            progress: section.value("progress", default.progress, |f| {
                f.choice(ProgressMode::ALL)
            }),
            isolate: section.value("isolate", default.isolate, Field::bool),
            memory_ceiling: section.optional("memory_ceiling", read_size),
            retries: section.value("retries", default.retries, |f| f.count(0, MAX_RETRIES)),
            takeover_after: section.value("takeover_after", default.takeover_after, above_0),
            grace: section.value("grace", default.grace, from_0),
            follow: section.value("follow", default.follow, Field::bool),
            idle: section.value("idle", default.idle, above_0),
            settle: section.value("settle", default.settle, from_0),
            stop_file: section.optional("stop_file", Field::name),
        };
        if work.memory_ceiling.is_some() && !work.isolate {
            section.wrong(
                "memory_ceiling",
                "is that of a frame's own process; say job.isolate = true (--isolate) too, or render.memory_limit",
            );
        }
        section.finish();
        work
    }

    pub(super) fn entries(&self, out: &mut Entries) {
        out.section("job");
        self.run_entries(out);
        self.follow_entries(out);
    }

    fn run_entries(&self, out: &mut Entries) {
        let threads = Threads(self.threads);
        put(
            out,
            "threads",
            &threads,
            "all, or how many; at most 4 for each processor are used",
        );
        put(
            out,
            "progress",
            &self.progress,
            "auto | plain | json | openjd | none",
        );
        put(
            out,
            "isolate",
            &self.isolate,
            "each frame in a process of its own",
        );
        out.maybe(
            "memory_ceiling",
            self.memory_ceiling.as_ref(),
            "\"4GiB\"",
            "most anonymous memory of such a process; default: no limit",
        );
        out.depends_on(None);
        put(
            out,
            "retries",
            &self.retries,
            "how often a frame whose process died is tried again",
        );
        put(
            out,
            "takeover_after",
            &self.takeover_after,
            "seconds without a sign of life after which another machine's frames are taken over",
        );
        put(
            out,
            "grace",
            &self.grace,
            "seconds that a frame may take after TERM or Ctrl-C before it is dropped",
        );
    }

    fn follow_entries(&self, out: &mut Entries) {
        put(
            out,
            "follow",
            &self.follow,
            "goes on with frames that a running simulation writes",
        );
        put(
            out,
            "idle",
            &self.idle,
            "seconds without a new frame after which following ends",
        );
        put(
            out,
            "settle",
            &self.settle,
            "seconds that a file must have stood unchanged to count as complete",
        );
        out.maybe(
            "stop_file",
            self.stop_file.as_ref(),
            "\"job.stop\"",
            "following ends when this file appears; default: job.stop beside the images",
        );
        out.depends_on(None);
    }
}

/// A key that no image depends on.
fn put(out: &mut Entries, key: &str, value: &(impl Toml + JsonSchema), comment: &'static str) {
    out.put(key, value, comment);
    out.depends_on(None);
}

#[expect(
    clippy::option_option,
    reason = "the outer one is a problem, the inner one is `all`"
)]
fn read_threads(field: &Field<'_>) -> Option<Option<u32>> {
    if field.as_text() == Some("all") {
        return Some(None);
    }
    let count = field.as_integer().and_then(|i| u32::try_from(i).ok());
    let count = count.filter(|c| (1..=MAX_THREADS).contains(c)).map(Some);
    field.or_wants(
        count,
        &format!("\"all\" or a whole number from 1 to {MAX_THREADS}"),
    )
}

fn above_0(field: &Field<'_>) -> Option<Seconds> {
    let holds = |v| 0.0 < v && v <= MAX_SECONDS;
    field
        .number("seconds above 0, at most 1e9", holds)
        .map(Seconds)
}

fn from_0(field: &Field<'_>) -> Option<Seconds> {
    let holds = |v| (0.0..=MAX_SECONDS).contains(&v);
    field.number("seconds from 0 to 1e9", holds).map(Seconds)
}

/// A number of threads, or all.
struct Threads(Option<u32>);

impl Toml for Threads {
    fn toml(&self) -> String {
        self.0.map_or_else(|| "all".toml(), |count| count.toml())
    }
}

described!(Threads, {
    "anyOf": [
        { "const": "all" },
        { "type": "integer", "minimum": 1, "maximum": MAX_THREADS },
    ],
});

described!(Seconds, { "type": "number", "minimum": 0, "maximum": MAX_SECONDS });

impl Toml for Seconds {
    fn toml(&self) -> String {
        self.0.toml()
    }
}
