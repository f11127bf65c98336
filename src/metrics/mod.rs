//! Byte counts and the memory of the process. Does not depend on what is measured.

mod bytes;
pub mod memory;

pub use bytes::Bytes;
pub use memory::{MemoryPeaks, MemoryUse};
