//! Reports of a run: time and memory of every frame, for people and for scripts, and pages that play its pictures.
//!
//! ```text
//! measurements of frames, ledgers of jobs -> [report] -> report.json, pages, plots
//! ```
//!
//! - [`frame`]: the measurements of one image, in the form of the ledger and of `report.json`.
//! - [`job`]: the state of a whole job, as `report.json` and, with the feature `pages`, as `report.html`.
//! - [`machine`]: the machine of a measurement.
//! - [`page`], [`plots`]: pages of HTML in one file, without external resources, and plots in them.
//! - [`viewer`]: a page that plays listed pictures, with ids, values and channels from OpenEXR images.
//!
//! The same data give the same text. This crate measures nothing, and knows neither settings nor how frames are
//! rendered; jobs and their ledgers are those of `spherule-jobs`.
//!
//! ```
//! use spherule_report::page::{Page, Table};
//! use spherule_report::plots::{Axis, Plot, Series};
//!
//! let mut table = Table::new("frames", &["Frame", "Seconds"]);
//! table.row(["1".to_owned(), "0.25".to_owned()]);
//! let time = Series::new("trace", [(1.0, 0.25), (2.0, 0.5)]);
//! let plot = Plot::new("times", "Time", Axis::linear("frame"), Axis::linear("seconds"));
//!
//! let mut page = Page::new("Drops & splashes");
//! page.table(&table);
//! page.plots(&[plot.with(time)]);
//! assert!(page.html().contains("<h1>Drops &amp; splashes</h1>"));
//! ```
#![deny(unsafe_code)]

#[cfg(feature = "pages")]
mod escape;
pub mod frame;
pub mod job;
pub mod machine;
#[cfg(feature = "pages")]
pub mod page;
#[cfg(feature = "pages")]
pub mod plots;
#[cfg(feature = "pages")]
pub mod viewer;

pub use frame::FrameReport;

/// Peak memory of the thesis's program, bytes per particle: "about 350" at 1e7 particles, for all structures.
pub const THESIS_BYTES_PER_PARTICLE: f64 = 350.0;
