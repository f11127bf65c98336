//! Plans, records and resumes frame-by-frame work. The crate does not know what the work is: the caller passes
//! frames and the settings that outputs depend on, and does the work itself.
//!
//! ```text
//! a plan -> [jobs] -> tasks for workers, a ledger of what is done -> report
//! ```
//!
//! `formats` turns bytes into frames and knows no rays. `jobs` plans, records and resumes work and
//! does not know what the work is. `spherule` (accelerators, tracer, output, command line) joins
//! them. Arrows never point the other way.
//!
//! A job is a directory. The *plan* ([`Plan`]) lists the frames and the settings. It is written once, and again
//! only when frames are added. The *ledger* ([`Ledger`]) only grows: one line per finished or failed frame, in
//! one file per worker. Workers claim frames ([`FrameClaims`]) before they work on them. Outputs are published
//! complete ([`Publisher`]) before they are recorded, so a kill at any moment loses at most the frames in
//! progress. [`run_frames`] is the loop that claims, processes and records frames; the work is a [`FrameWork`].
//! [`export`] describes frames as work for other engines.
//!
//! This example counts the bytes of two files, one frame each. A second run would find nothing to do:
//!
//! ```
//! use serde_json::json;
//! use spherule_jobs::{
//!     ClaimedFrame, DEFAULT_TAKEOVER_AFTER, FailureKind, FinishedFrame, FrameFailure, FrameRequest, FrameWork,
//!     Interrupt, Job, JobRequest, ResumeMode, RunContext, RunOptions, publish, run_frames,
//! };
//! use std::path::PathBuf;
//!
//! struct CountBytes(PathBuf);
//!
//! impl FrameWork for CountBytes {
//!     type Report = u64;
//!
//!     fn process(
//!         &self,
//!         frame: &ClaimedFrame,
//!         _: &RunContext<'_, u64>,
//!     ) -> Result<FinishedFrame<u64>, FrameFailure> {
//!         let fail = |e: std::io::Error| FrameFailure::new(FailureKind::Frame, frame.frame, e);
//!         let input = self.0.join(format!("{}.txt", frame.frame));
//!         let output = self.0.join(format!("out/{}.count", frame.frame));
//!         let count = std::fs::read(&input).map_err(fail)?.len() as u64;
//!         publish(&output, count.to_string().as_bytes()).map_err(fail)?;
//!         Ok(FinishedFrame { outputs: vec![output], report: count })
//!     }
//! }
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let dir = tempfile::tempdir()?;
//! let root = dir.path();
//! for (frame, text) in [(1, "one"), (2, "three")] {
//!     std::fs::write(root.join(format!("{frame}.txt")), text)?;
//! }
//! let request = |number| FrameRequest {
//!     number,
//!     inputs: vec![root.join(format!("{number}.txt"))],
//!     companions: Vec::new(),
//!     outputs: vec![root.join(format!("out/{number}.count"))],
//! };
//! let request = JobRequest {
//!     settings: vec![("unit".to_owned(), "bytes".to_owned())],
//!     frames: [1, 2].map(request).to_vec(),
//!     extra_outputs: Vec::new(),
//!     selection: None,
//!     mode: ResumeMode::Resume,
//!     takeover_after: DEFAULT_TAKEOVER_AFTER,
//! };
//! // What is found out once, and stays the same when the job is resumed, is stored in the plan
//! let mut job = Job::open(&root.join("out"), request, |_| Ok::<_, String>(json!({})))?;
//! let options = RunOptions { frames: job.pending(), retries: 0, interrupt: Interrupt::new() };
//! run_frames(&mut job, &CountBytes(root.to_owned()), &options, &|_| ())?;
//! assert!(job.pending().is_empty());
//! assert_eq!(std::fs::read_to_string(root.join("out/2.count"))?, "5");
//! # Ok(())
//! # }
//! ```
#![deny(unsafe_code)]

mod changes;
mod claims;
mod clock;
mod copies;
mod error;
mod existing_outputs;
pub mod export;
mod extend;
mod failure;
mod file_error;
mod fingerprint;
mod fingerprint_cache;
mod input;
mod job;
mod ledger;
#[doc(hidden)]
pub mod parse;
mod plan;
mod planning;
mod process;
mod queue;
mod range;
mod request;
mod requeue;
mod run;
mod state;
mod workers;

pub use changes::{InputChange, SettingChange};
pub use claims::FrameClaims;
pub use error::{EntryError, JobError, PlanError};
pub use failure::{FailureKind, FrameFailure};
pub use file_error::FileError;
pub use fingerprint::{Fingerprint, compare_settings, contents_hash, settings_hash, text_hash};
pub use job::{DryRun, Job};
pub use ledger::{Details, EntryStatus, Ledger, LedgerEntry, OutputFile};
pub use plan::{Plan, PlannedFrame, PlannedInput};
pub use queue::{ClaimedFrame, FrameQueue, QueueEvent};
pub use range::{FrameRange, RangeError};
pub use request::{DEFAULT_TAKEOVER_AFTER, FrameRequest, JobRequest, ResumeMode};
pub use run::{
    FinishedFrame, FrameEvent, FrameRecorder, FrameWork, OnFrameEvent, Recorded, RunContext,
    RunOptions, run_frames,
};
pub use spherule_files::{
    Interrupt, InterruptLevel, Panic, Publisher, catch_panic, discard_own_parts, discard_parts,
    open_regular, owner, publish, publish_with, read_regular, read_regular_text, set_owner,
};
pub use state::{FrameState, JobState, JobSummary};
pub use workers::{Claim, ClaimOutcome, WORK_DIR, WorkerStatus, start_heartbeat_thread};

/// Name of the plan in the job's directory.
pub const PLAN_FILE: &str = "job.plan.json";
