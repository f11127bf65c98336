//! The workers of a job and the frames that they are working on: the files in `job.work`.
//!
//! Each worker has a *record* there, `WORKER.worker`. It says who the worker is, and the worker appends one
//! byte to it every few seconds as a heartbeat. A worker *claims* a frame before it works on it: it creates
//! `frame.12.0` as a hard link to its record, so the claim says who holds it. The only requirement on the file
//! system is that exactly one process can create a given name. There are no locks, no synchronised clocks, and
//! no file that several processes append to.
//!
//! A claim is dead if its process has ended (known on the same machine only), if its record is gone, or if the
//! record has not changed for some time by the clock of the observer. A dead claim is never replaced under its
//! own name: two workers might do that, and the second would remove the claim of the first. They create the
//! next generation instead, `frame.12.1`, which again only one process can create.
//!
//! Claims only save work; correctness does not depend on them. A worker that was declared dead and comes back
//! writes the same images, complete, under the same names, and records them in a ledger of its own.

mod claim;
mod files;
mod heartbeat;
mod liveness;
mod record;
mod registry;
mod status;
#[cfg(test)]
mod tests;

pub use claim::{Claim, ClaimOutcome};
pub(crate) use files::ListedParts;
use heartbeat::HeartbeatSchedule;
pub use heartbeat::start_heartbeat_thread;
use liveness::{Liveness, LivenessMonitor};
pub(crate) use record::WorkerRecord;
pub(crate) use registry::WorkerRegistry;
pub use status::WorkerStatus;
pub(crate) use status::worker_statuses;

/// Name of the directory in the job's directory.
pub const WORK_DIR: &str = "job.work";

/// Suffix of the file name of a worker record.
const RECORD_SUFFIX: &str = ".worker";
