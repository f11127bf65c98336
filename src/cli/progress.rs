//! Shows the progress of a job: a bar on a terminal, otherwise one line per frame, or lines for other programs.

use std::fmt;
use std::io::{IsTerminal, stderr};
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use clap::ValueEnum;
use clap::builder::{EnumValueParser, PossibleValue, TypedValueParser};
use indicatif::{ProgressBar, ProgressState, ProgressStyle};
use serde_json::{Value, json};
use spherule_jobs::{EntryStatus, FinishedFrame, FrameEvent, FrameFailure, QueueEvent};

use super::{events, print};
use crate::manifest::ProgressMode;

/// A [`ProgressMode`] on the command line, with help.
#[derive(Clone, Copy)]
struct ModeArgument(ProgressMode);

impl ValueEnum for ModeArgument {
    fn value_variants<'a>() -> &'a [Self] {
        &[
            Self(ProgressMode::Auto),
            Self(ProgressMode::Plain),
            Self(ProgressMode::Json),
            Self(ProgressMode::Openjd),
            Self(ProgressMode::None),
        ]
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        Some(PossibleValue::new(self.0.name()).help(match self.0 {
            ProgressMode::Auto => {
                "Bars on a terminal; elsewhere plain lines for jobs, nothing for stills"
            }
            ProgressMode::Plain => "One line per frame, or for each tenth of a still",
            ProgressMode::Json => "JSON events, one per line, on standard output",
            ProgressMode::Openjd => "Messages for Open Job Description engines",
            ProgressMode::None => "Only warnings and errors",
        }))
    }
}

/// Parses the argument of `--progress`.
pub(super) fn mode_parser() -> impl TypedValueParser<Value = ProgressMode> {
    EnumValueParser::<ModeArgument>::new().map(|argument| argument.0)
}

/// A report of a finished frame that can be shown.
pub(super) trait ShowReport {
    /// A summary for people.
    fn summary(&self) -> String;

    /// Fields of the event for programs. `output` is the main output.
    fn facts(&self, output: String) -> Value;
}

/// Shows the progress of one run.
pub(super) struct Progress {
    display: Display,
    total: AtomicUsize,
    start: Instant,
    finished: Mutex<FinishedFrames>,
}

/// The finished frames of a run.
#[derive(Debug, Clone, Default)]
pub(super) struct FinishedFrames {
    /// Done or failed.
    pub(super) count: usize,
    /// Failed frames.
    pub(super) failed: Vec<i64>,
}

/// How progress is shown.
pub(super) enum Display {
    Bar(ProgressBar),
    Plain,
    Openjd,
    /// Nothing. Events are sent in any case.
    Nothing,
}

impl Display {
    /// The display for `mode`: on a terminal, auto is what `bar` makes, and `elsewhere` otherwise.
    pub(super) fn new(
        mode: ProgressMode,
        bar: impl FnOnce() -> ProgressBar,
        elsewhere: Self,
    ) -> Self {
        match mode {
            ProgressMode::Auto | ProgressMode::Plain if print::is_quiet() => Self::Nothing,
            ProgressMode::Auto if stderr().is_terminal() => Self::Bar(bar()),
            ProgressMode::Auto => elsewhere,
            ProgressMode::Plain => Self::Plain,
            ProgressMode::Openjd => Self::Openjd,
            ProgressMode::Json | ProgressMode::None => Self::Nothing,
        }
    }

    /// Calls `print` while there is no bar.
    pub(super) fn above_bar(&self, print: impl FnOnce()) {
        match self {
            Self::Bar(bar) => bar.suspend(print),
            _ => print(),
        }
    }

    /// Removes the bar.
    pub(super) fn finish(&self) {
        if let Self::Bar(bar) = self {
            bar.finish_and_clear();
        }
    }
}

impl Progress {
    /// Progress of a run of `command` with `total` frames. `output` is the path that the user gave.
    pub(super) fn new(mode: ProgressMode, command: &str, total: usize, output: &Path) -> Self {
        let output = output.display().to_string();
        events::send("start", json!({"command": command, "total": total, "output": output}));
        let mode = match mode {
            ProgressMode::Auto if print::is_verbose() => ProgressMode::Plain,
            mode => mode,
        };
        Self {
            display: Display::new(mode, || bar(total), Display::Plain),
            total: AtomicUsize::new(total),
            start: Instant::now(),
            finished: Mutex::default(),
        }
    }

    /// Adds `count` frames to the run.
    pub(super) fn add_frames(&self, count: usize) {
        let total = count + self.total.fetch_add(count, Ordering::Relaxed);
        events::send("frames_added", json!({"added": count, "total": total}));
        if let Display::Bar(bar) = &self.display {
            bar.inc_length(count as u64);
        }
    }

    fn total(&self) -> usize {
        self.total.load(Ordering::Relaxed)
    }

    /// Shows an event of a run. Called from several threads.
    pub(super) fn show<R: ShowReport>(&self, event: &FrameEvent<'_, R>) {
        match event {
            FrameEvent::Stage { frame, stage } => self.stage(*frame, stage),
            FrameEvent::Done { frame, finished } => self.done(*frame, finished),
            FrameEvent::Failed(failure) => self.failed(failure),
            FrameEvent::Retrying { failure, attempt, attempts } => self.note(&format!(
                "frame {}: attempt {attempt} of {attempts} failed: {failure}",
                failure.frame
            )),
            FrameEvent::OtherWorker(event) => self.other_worker(*event),
            FrameEvent::Note(note) => self.note(note),
        }
    }

    /// A frame has entered a stage: `reading`.
    fn stage(&self, frame: i64, stage: &str) {
        if let Display::Bar(bar) = &self.display {
            bar.set_message(format!("{stage} frame {frame}"));
        }
    }

    fn done<R: ShowReport>(&self, frame: i64, finished: &FinishedFrame<R>) {
        let done = self.count(None);
        let output =
            finished.outputs.first().map_or_else(String::new, |path| path.display().to_string());
        let summary = finished.report.summary();
        let plain = format!("frame {frame}: {output} ({summary})");
        let facts = finished.report.facts(output);
        let mut event = json!({"frame": frame, "done": done, "total": self.total()});
        if let (Value::Object(event), Value::Object(facts)) = (&mut event, facts) {
            event.extend(facts);
        }
        events::send("frame_done", event);
        self.line(done, &plain);
    }

    fn failed(&self, failure: &FrameFailure) {
        let (frame, reason) = (failure.frame, failure.to_string());
        let done = self.count(Some(frame));
        self.above_bar(|| error!("frame {frame}: {reason}"));
        let facts = json!({"frame": frame, "reason": reason, "done": done, "total": self.total()});
        events::send("frame_failed", facts);
        self.line(done, "");
    }

    /// Another worker has finished a frame or holds one.
    fn other_worker(&self, event: QueueEvent) {
        match event {
            QueueEvent::Waiting(frame, worker) => {
                let text = format!("waiting for frame {frame}: {worker} is working on it");
                self.above_bar(|| message!("{text}"));
                events::send("note", json!({"text": text}));
            }
            QueueEvent::FinishedElsewhere(frame, status) => {
                let is_done = status == EntryStatus::Done;
                let done = self.count((!is_done).then_some(frame));
                let result = if is_done { "done" } else { "failed" };
                let plain = format!("frame {frame}: {result} by another worker");
                let facts = json!({"frame": frame, "elsewhere": true,
                    "done": done, "total": self.total()});
                let event = if is_done { "frame_done" } else { "frame_failed" };
                events::send(event, facts);
                self.line(done, &plain);
            }
        }
    }

    /// Prints a note, whatever the mode.
    fn note(&self, text: &str) {
        self.above_bar(|| note!("{text}"));
    }

    /// Calls `print` while there is no bar.
    fn above_bar(&self, print: impl FnOnce()) {
        self.display.above_bar(print);
    }

    /// Removes the bar.
    pub(super) fn finish(self) -> FinishedFrames {
        self.display.finish();
        self.finished.into_inner().unwrap_or_else(|e| e.into_inner())
    }

    /// Counts a finished frame.
    fn count(&self, failed: Option<i64>) -> usize {
        let mut finished = self.finished.lock().unwrap_or_else(|e| e.into_inner());
        finished.count += 1;
        finished.failed.extend(failed);
        finished.count
    }

    /// Shows that a frame is done or has failed.
    fn line(&self, done: usize, plain: &str) {
        match &self.display {
            Display::Bar(bar) => bar.set_position(done as u64),
            Display::Plain if plain.is_empty() => {}
            Display::Plain => {
                message!("[{done}/{}] {plain}, {}", self.total(), self.remaining(done))
            }
            Display::Openjd => openjd(done, self.total(), plain),
            Display::Nothing => {}
        }
    }

    fn remaining(&self, done: usize) -> String {
        let each = self.start.elapsed().as_secs_f64() / done.max(1) as f64;
        let left = each * self.total().saturating_sub(done) as f64;
        format!("{} left", duration(left))
    }
}

/// Prints the lines that Open Job Description engines read on standard output.
pub(super) fn openjd(done: usize, total: usize, plain: &str) {
    let percent = 100.0 * done as f64 / total.max(1) as f64;
    let mut lines = vec![format!("openjd_progress: {percent:.1}")];
    if !plain.is_empty() {
        lines.push(format!("openjd_status: {plain}"));
    }
    // Continue even if the engine no longer reads
    let _ = print::lines(lines);
}

fn bar(total: usize) -> ProgressBar {
    let template = "{bar:30} {pos}/{len} frames  {msg}  {elapsed} elapsed{left}";
    let style = ProgressStyle::with_template(template)
        .expect("the template is well formed")
        .with_key("left", |state: &ProgressState, text: &mut dyn fmt::Write| {
            // Writing to a string cannot fail
            let _ = text.write_str(&left(state.pos(), state.eta().as_secs_f64()));
        });
    bar_with(style, total as u64)
}

/// A bar that also moves while nothing is done.
pub(super) fn bar_with(style: ProgressStyle, total: u64) -> ProgressBar {
    let bar = ProgressBar::new(total).with_style(style.progress_chars("━╸─"));
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}

/// The remaining time behind the elapsed one; unknown before the first frame is done.
fn left(done: u64, seconds: f64) -> String {
    if done == 0 { String::new() } else { format!(", {} left", duration(seconds)) }
}

/// Formats seconds: `12 s`, `3:20 min`.
pub(super) fn duration(seconds: f64) -> String {
    #[expect(clippy::cast_possible_truncation, reason = "saturates")]
    let whole = seconds.round().max(0.0) as u64;
    match whole {
        0..60 => format!("{whole} s"),
        60..3600 => format!("{}:{:02} min", whole / 60, whole % 60),
        _ => format!("{}:{:02} h", whole / 3600, whole % 3600 / 60),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_left_is_unknown_before_the_first_frame() {
        assert_eq!(left(0, 0.0), "");
        assert_eq!(left(3, 200.0), ", 3:20 min left");
    }
}
