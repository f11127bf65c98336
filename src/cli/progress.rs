//! What a running job shows: bars on a terminal, one plain line a frame elsewhere, or lines for
//! programs.

use std::io::{IsTerminal, stderr};
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use clap::ValueEnum;
use clap::builder::PossibleValue;
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::{Value, json};
use spherule_jobs::{QueueNews, Status};

use super::{events, print};
use crate::manifest::ProgressMode;

impl ValueEnum for ProgressMode {
    fn value_variants<'a>() -> &'a [Self] {
        &[
            Self::Auto,
            Self::Plain,
            Self::Json,
            Self::Openjd,
            Self::None,
        ]
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        Some(PossibleValue::new(self.name()).help(match self {
            Self::Auto => "Bars on a terminal, plain lines elsewhere",
            Self::Plain => "One line a frame",
            Self::Json => "Events as JSON, one a line, on standard output",
            Self::Openjd => "The lines that Open Job Description engines read",
            Self::None => "Nothing but warnings and errors",
        }))
    }
}

/// Shows the frames of one run.
pub(super) struct Progress {
    show: Show,
    total: AtomicUsize,
    start: Instant,
    ended: Mutex<Ended>,
}

/// How the frames of this run ended.
#[derive(Debug, Clone, Default)]
pub(super) struct Ended {
    /// How many, well or badly.
    pub(super) count: usize,
    /// Those that failed.
    pub(super) failed: Vec<i64>,
}

enum Show {
    Bar(ProgressBar),
    Plain,
    Openjd,
    /// For people, that is: events are sent whatever is shown.
    Nothing,
}

impl Progress {
    /// For a run of `command` that makes `total` frames, in `output` as the user named it.
    pub(super) fn new(mode: ProgressMode, command: &str, total: usize, output: &Path) -> Self {
        let output = output.display().to_string();
        events::send(
            "start",
            json!({"command": command, "total": total, "output": output}),
        );
        let show = match mode {
            ProgressMode::Auto if stderr().is_terminal() => Show::Bar(bar(total)),
            ProgressMode::Auto | ProgressMode::Plain => Show::Plain,
            ProgressMode::Openjd => Show::Openjd,
            ProgressMode::Json | ProgressMode::None => Show::Nothing,
        };
        Self {
            show,
            total: AtomicUsize::new(total),
            start: Instant::now(),
            ended: Mutex::default(),
        }
    }

    /// There are `count` frames more to do.
    pub(super) fn more(&self, count: usize) {
        let total = count + self.total.fetch_add(count, Ordering::Relaxed);
        events::send("frames_added", json!({"added": count, "total": total}));
        if let Show::Bar(bar) = &self.show {
            bar.inc_length(count as u64);
        }
    }

    fn total(&self) -> usize {
        self.total.load(Ordering::Relaxed)
    }

    /// A frame is in hand: `doing` says what is being done with it.
    pub(super) fn entered(&self, frame: i64, doing: &str) {
        if let Show::Bar(bar) = &self.show {
            bar.set_message(format!("{doing} frame {frame}"));
        }
    }

    /// `frame` has become the file `output`: `told` for people, `facts` for programs.
    pub(super) fn done(&self, frame: i64, output: &Path, told: &str, facts: Value) {
        let done = self.count(None);
        let output = output.display().to_string();
        let plain = format!("frame {frame}: {output} ({told})");
        let mut event = json!({"frame": frame, "done": done, "total": self.total()});
        if let (Value::Object(event), Value::Object(facts)) = (&mut event, facts) {
            event.extend(facts);
        }
        events::send("frame_done", event);
        self.line(done, &plain);
    }

    /// `frame` could not be made.
    pub(super) fn failed(&self, frame: i64, reason: &str) {
        let done = self.count(Some(frame));
        self.message(&format!("error: frame {frame}: {reason}"));
        let facts = json!({"frame": frame, "reason": reason, "done": done, "total": self.total()});
        events::send("frame_failed", facts);
        self.line(done, "");
    }

    /// What other workers do.
    pub(super) fn others(&self, news: QueueNews) {
        match news {
            QueueNews::Waiting(frame, who) => {
                let text = format!("waiting for frame {frame}, which {who} has in hand");
                self.message(&text);
                events::send("note", json!({"text": text}));
            }
            QueueNews::Elsewhere(frame, status) => {
                let is_done = status == Status::Done;
                let done = self.count((!is_done).then_some(frame));
                let told = if is_done { "done" } else { "failed" };
                let plain = format!("frame {frame}: {told} by another worker");
                let facts = json!({"frame": frame, "elsewhere": true,
                    "done": done, "total": self.total()});
                let event = if is_done {
                    "frame_done"
                } else {
                    "frame_failed"
                };
                events::send(event, facts);
                self.line(done, &plain);
            }
        }
    }

    /// What a user should know of, whatever the mode.
    pub(super) fn note(&self, text: &str) {
        match &self.show {
            Show::Bar(bar) => bar.suspend(|| note!("{text}")),
            _ => note!("{text}"),
        }
    }

    /// A line for people, whatever the mode.
    fn message(&self, text: &str) {
        match &self.show {
            Show::Bar(bar) => bar.suspend(|| say!("{text}")),
            _ => say!("{text}"),
        }
    }

    /// Takes the bar away.
    pub(super) fn finish(self) -> Ended {
        if let Show::Bar(bar) = &self.show {
            bar.finish_and_clear();
        }
        self.ended.into_inner().unwrap_or_else(|e| e.into_inner())
    }

    /// Another frame has ended.
    fn count(&self, failed: Option<i64>) -> usize {
        let mut ended = self.ended.lock().unwrap_or_else(|e| e.into_inner());
        ended.count += 1;
        ended.failed.extend(failed);
        ended.count
    }

    /// One frame has ended, well or badly.
    fn line(&self, done: usize, plain: &str) {
        match &self.show {
            Show::Bar(bar) => bar.set_position(done as u64),
            Show::Plain if plain.is_empty() => {}
            Show::Plain => say!(
                "[{done}/{}] {plain}, {}",
                self.total(),
                self.remaining(done)
            ),
            Show::Openjd => openjd(done, self.total(), plain),
            Show::Nothing => {}
        }
    }

    fn remaining(&self, done: usize) -> String {
        let each = self.start.elapsed().as_secs_f64() / done.max(1) as f64;
        let left = each * self.total().saturating_sub(done) as f64;
        format!("{} left", duration(left))
    }
}

/// Engines read these on standard output.
pub(super) fn openjd(done: usize, total: usize, plain: &str) {
    let percent = 100.0 * done as f64 / total.max(1) as f64;
    let mut lines = vec![format!("openjd_progress: {percent:.1}")];
    if !plain.is_empty() {
        lines.push(format!("openjd_status: {plain}"));
    }
    // An engine that does not listen any more is no reason to stop work.
    let _ = print::lines(lines);
}

fn bar(total: usize) -> ProgressBar {
    let template = "{bar:30} {pos}/{len} frames  {msg}  {elapsed} gone, {eta} left";
    let style = ProgressStyle::with_template(template)
        .expect("the template is well formed")
        .progress_chars("━╸─");
    let bar = ProgressBar::new(total as u64).with_style(style);
    bar.enable_steady_tick(std::time::Duration::from_millis(200));
    bar
}

/// Seconds as a person says them.
pub(super) fn duration(seconds: f64) -> String {
    #[expect(clippy::cast_possible_truncation, reason = "saturates")]
    let whole = seconds.round().max(0.0) as u64;
    match whole {
        0..60 => format!("{whole} s"),
        60..3600 => format!("{}:{:02} min", whole / 60, whole % 60),
        _ => format!("{}:{:02} h", whole / 3600, whole % 3600 / 60),
    }
}
