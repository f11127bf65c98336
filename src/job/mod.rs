//! Render jobs and conversion jobs, from a manifest or settings to the ledger and the reports: everything that the
//! commands `render` and `convert` do, except parsing arguments, printing and handling signals.
//!
//! A render job is a [`JobManifest`] and its sequence ([`RenderJob`]). [`RenderRun`] opens it, renders its pending
//! frames in this process or each in a child process ([`isolate`]), follows a simulation that still writes
//! ([`Follower`]), and writes the reports. A conversion job ([`ConvertJob`]) converts the frames of a sequence.
//! Several processes may run the same job; they share its frames.
//!
//! ```
//! use std::path::Path;
//!
//! use spherule::job::{JobManifest, RenderJob, RenderRun};
//! use spherule::manifest::{Manifest, Override};
//! use spherule_jobs::{FrameEvent, Interrupt, ResumeMode};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let dir = tempfile::tempdir()?;
//! # let particles = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/dam-break");
//! # std::fs::write(dir.path().join("job.toml"), format!("input.path = {particles:?}"))?;
//! // Read a manifest, and override some of its keys
//! let text = std::fs::read_to_string(dir.path().join("job.toml"))?;
//! let small = ["input.frames=1-3", "image.width=32", "image.height=18", "image.samples=1"];
//! let small = small.map(Override::parse).into_iter().collect::<Result<Vec<_>, _>>()?;
//! let manifest = Manifest::parse_with(&text, Path::new("job.toml"), small)?;
//! let manifest = JobManifest::new(manifest, dir.path());
//!
//! // Render all frames that are not done yet
//! let sequence = manifest.open_sequence()?;
//! let job = RenderJob::new(manifest, &sequence, None)?;
//! let mut run = RenderRun::open(job, sequence, ResumeMode::Resume)?;
//! run.render_pending(&Interrupt::new(), &|event| {
//!     if let FrameEvent::Done { frame, finished } = event {
//!         println!("frame {frame}: {}", finished.outputs[0].display());
//!     }
//! })?;
//! run.write_reports()?;
//! assert_eq!(run.job().summary().done, 2);
//! # Ok(())
//! # }
//! ```

mod child;
mod color_bar;
mod complete;
mod complete_frames;
mod convert_job;
mod error;
mod findings;
mod follow;
pub mod isolate;
mod manifest_file;
mod meshes;
mod placement;
mod render_job;
mod render_run;
mod requested;
mod scene_files;
mod selection;
mod target;

pub use child::{ChildCommand, ChildResult, Crash};
pub use color_bar::color_bar;
pub use convert_job::ConvertJob;
pub use error::RunError;
pub use findings::Findings;
pub use follow::{FollowEnd, Follower};
pub use manifest_file::{JOB_FILE, JobManifest, is_schema, schema_text};
pub use render_job::{RenderJob, cpu_note, require_one_fits};
pub use render_run::RenderRun;
pub use requested::requested_frames;
pub use scene_files::SceneFiles;
pub use selection::{Shard, ShardError, frames_in};
pub use target::KIND;

use std::panic;
use std::thread;

/// Runs `work` in a new thread. Allocators keep the memory that a thread has freed for the next new thread, which
/// reads frames and needs as much. Memory freed by the main thread would stay unused.
pub(crate) fn in_thread<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    thread::scope(|scope| {
        let thread = scope.spawn(work);
        thread.join().unwrap_or_else(|payload| panic::resume_unwind(payload))
    })
}
