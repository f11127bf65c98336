//! `still --progress`: how much of the picture is traced.

use std::sync::{Mutex, PoisonError};

use indicatif::{ProgressBar, ProgressStyle};
use serde_json::json;

use super::events;
use super::progress::{Display, bar_with, openjd};
use crate::manifest::ProgressMode;
use crate::render::Stop;

/// Plain lines are printed for each of this many parts of the picture, events for each percent.
const PLAIN_PARTS: u64 = 10;

/// Shows the progress of a still. It stops no picture.
pub(super) struct StillProgress {
    display: Display,
    pixels: u64,
    /// Number of traced pixels. It is locked while a percent is shown, so that threads show them in order.
    done: Mutex<u64>,
}

impl StillProgress {
    /// Progress of a picture with that many pixels.
    pub(super) fn new(mode: ProgressMode, pixels: u64) -> Self {
        let display = Display::new(mode, bar, Display::Nothing);
        Self { display, pixels: pixels.max(1), done: Mutex::new(0) }
    }

    /// Calls `print` while there is no bar.
    pub(super) fn above_bar(&self, print: impl FnOnce()) {
        self.display.above_bar(print);
    }

    /// Removes the bar.
    pub(super) fn finish(self) {
        self.display.finish();
    }

    /// Shows that `percent` of the picture is traced, at most once for each number.
    fn show(&self, percent: u64) {
        events::send("progress", json!({"percent": percent}));
        match &self.display {
            Display::Bar(bar) => bar.set_position(percent),
            Display::Plain if percent.is_multiple_of(100 / PLAIN_PARTS) => {
                message!("{percent} % traced");
            }
            Display::Openjd => openjd(usize::try_from(percent).unwrap_or(100), 100, ""),
            Display::Plain | Display::Nothing => {}
        }
    }
}

impl Stop for StillProgress {
    fn is_raised(&self) -> bool {
        false
    }

    fn pixels_done(&self, count: u32) {
        let percent = |done: u64| (100 * done / self.pixels).min(100);
        let mut done = self.done.lock().unwrap_or_else(PoisonError::into_inner);
        let before = *done;
        *done += u64::from(count);
        for reached in percent(before) + 1..=percent(*done) {
            self.show(reached);
        }
    }
}

fn bar() -> ProgressBar {
    let template = "{bar:30} {percent} % traced, {elapsed} elapsed";
    let style = ProgressStyle::with_template(template).expect("the template is well formed");
    bar_with(style, 100)
}
