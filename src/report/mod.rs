//! What a run says of itself: time and memory of every frame, for people and for scripts.

mod bytes;
pub mod frame;
pub mod job;
pub mod machine;
pub mod memory;
pub mod page;
pub mod plots;
pub mod scale;

pub use bytes::Bytes;
pub use frame::FrameReport;
pub use memory::{MemoryPeaks, MemoryUse};
