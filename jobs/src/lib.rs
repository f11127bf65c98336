//! Plans, records and resumes frame-by-frame work, and does not know what the work is: the caller
//! hands it frames, settings to fingerprint, and does the work itself.
//!
//! `formats` turns bytes into frames and knows no rays. `jobs` plans, records and resumes work and
//! does not know what the work is. `spherule` (accelerators, tracer, output, command line) joins
//! them. Arrows never point the other way.
//!
//! A job lives in one directory. The *plan* ([`Plan`]) says which frames there are and under which
//! settings; it is written once and again only when frames are added. The *ledger* ([`Ledger`])
//! only grows: one line for each frame that was finished or failed, a file for each worker. Workers claim
//! frames ([`Claims`]) before they do them. Outputs are published whole
//! ([`Publisher`]) before their line is written, so a kill at any moment loses at most the frames
//! in hand. [`export`] writes frames as work for other engines.
#![deny(unsafe_code)]

mod claims;
mod error;
pub mod export;
mod extend;
mod fingerprint;
mod fingerprint_cache;
mod foreign;
mod input;
mod interrupt;
mod job;
mod ledger;
#[doc(hidden)]
pub mod parse;
mod plan;
mod planning;
mod process;
mod publish;
mod queue;
mod range;
mod regular;
mod request;
mod requeue;
mod state;
mod work;

pub use claims::Claims;
pub use error::{InputChange, JobError, SettingChange};
pub use fingerprint::{Fingerprint, compare_settings, settings_hash, text_hash};
pub use interrupt::{Interrupt, InterruptLevel};
pub use job::{Foreseen, Job};
pub use ledger::{Details, Entry, Ledger, OutputFile, Status};
pub use plan::{PLAN_FILE, Plan, PlannedFrame, PlannedInput};
pub use process::{owner, work_on_behalf_of};
pub use publish::{Publisher, discard_own_parts, discard_parts, publish, publish_with};
pub use queue::{Queue, QueueNews};
pub use range::{FrameRange, RangeError};
pub use regular::{open_regular, read_regular, read_regular_text};
pub use request::{DEFAULT_PATIENCE, FrameRequest, JobRequest, Mode};
pub use state::{FrameState, JobState, Summary};
pub use work::{Claim, Claimed, WorkerView, start_heart};
