//! Reports of a run: time and memory of every frame, for people and for scripts.

#[cfg(feature = "reports")]
mod escape;
pub mod frame;
pub mod job;
pub mod machine;
#[cfg(feature = "reports")]
pub mod page;
#[cfg(feature = "reports")]
pub mod plots;

pub use frame::FrameReport;

/// Peak memory of the thesis's program, bytes per particle: "about 350" at 1e7 particles, for all structures.
pub const THESIS_BYTES_PER_PARTICLE: f64 = 350.0;
