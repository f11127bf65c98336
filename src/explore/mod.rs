//! Pictures of a job while its settings are being chosen, and the local server with the page where they are. The tree
//! of a frame is kept from picture to picture, so that only what a change needs is computed again, and the renderer is
//! the one of jobs: the last picture has the bytes of the preview that the job writes.
//!
//! A page sends a [`Wish`]: the frame, and the settings that were chosen. The [`Explorer`] answers with pictures that
//! become finer (`level.rs`) until the page wishes something else. [`serve`] connects it with browsers over HTTP.

mod encode;
mod error;
mod explorer;
mod level;
mod particle;
mod save;
pub mod serve;
mod shared;
mod stage;
#[cfg(test)]
mod stage_tests;
mod thin;
mod wish;
mod worker;

pub use error::{ExploreError, Fault};
pub use explorer::Explorer;
pub use particle::{Histogram, ParticleValues};
pub use save::{JobProgress, ManifestTexts, SaveError, Saved, SavedFiles};
pub use shared::{Answer, PageId, Shown};
pub use wish::{Setting, Wish};
