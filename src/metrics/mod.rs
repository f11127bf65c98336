//! Byte counts, the wording of counts, and the memory of the process. Does not depend on what is measured.

pub mod memory;

pub use memory::{MemoryPeaks, MemoryUse};
pub use spherule_files::{Bytes, counted};
