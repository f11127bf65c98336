//! `still --progress`: how much of the picture is traced.

use std::io::{IsTerminal, stderr};
use std::sync::atomic::{AtomicU64, Ordering};

use indicatif::{ProgressBar, ProgressStyle};
use serde_json::json;

use super::progress::openjd;
use super::{events, print};
use crate::manifest::ProgressMode;
use crate::render::Stop;

/// Plain lines are printed for each of this many parts of the picture, events for each percent.
const PLAIN_PARTS: u64 = 10;

/// Shows the progress of a still. It stops no picture.
pub(super) struct StillProgress {
    display: Display,
    pixels: u64,
    done: AtomicU64,
}

enum Display {
    Bar(ProgressBar),
    Plain,
    Openjd,
    Json,
    Nothing,
}

impl StillProgress {
    /// Progress of a picture with that many pixels.
    pub(super) fn new(mode: ProgressMode, pixels: u64) -> Self {
        let is_shown = stderr().is_terminal() && !print::is_quiet();
        let display = match mode {
            ProgressMode::Auto if is_shown => Display::Bar(bar()),
            ProgressMode::Plain if !print::is_quiet() => Display::Plain,
            ProgressMode::Openjd => Display::Openjd,
            ProgressMode::Json => Display::Json,
            ProgressMode::Auto | ProgressMode::Plain | ProgressMode::None => Display::Nothing,
        };
        Self { display, pixels: pixels.max(1), done: AtomicU64::new(0) }
    }

    /// Calls `print` while there is no bar.
    pub(super) fn above_bar(&self, print: impl FnOnce()) {
        match &self.display {
            Display::Bar(bar) => bar.suspend(print),
            _ => print(),
        }
    }

    /// Removes the bar.
    pub(super) fn finish(self) {
        if let Display::Bar(bar) = self.display {
            bar.finish_and_clear();
        }
    }

    /// Shows that `percent` of the picture is traced, at most once for each number.
    fn show(&self, percent: u64) {
        match &self.display {
            Display::Bar(bar) => bar.set_position(percent),
            Display::Plain if percent.is_multiple_of(100 / PLAIN_PARTS) => {
                message!("{percent} % traced");
            }
            Display::Openjd => openjd(usize::try_from(percent).unwrap_or(100), 100, ""),
            Display::Json => events::send("progress", json!({"percent": percent})),
            Display::Plain | Display::Nothing => {}
        }
    }
}

impl Stop for StillProgress {
    fn is_raised(&self) -> bool {
        false
    }

    fn pixels_done(&self, count: u32) {
        let before = self.done.fetch_add(u64::from(count), Ordering::Relaxed);
        let percent = |done: u64| (100 * done / self.pixels).min(100);
        for reached in percent(before) + 1..=percent(before + u64::from(count)) {
            self.show(reached);
        }
    }
}

fn bar() -> ProgressBar {
    let template = "{bar:30} {percent} % traced, {elapsed} elapsed";
    let style = ProgressStyle::with_template(template).expect("the template is well formed");
    let bar = ProgressBar::new(100).with_style(style.progress_chars("━╸─"));
    bar.enable_steady_tick(std::time::Duration::from_millis(200));
    bar
}
