//! Byte counts, the wording of counts, and the memory of the process. Does not depend on what is measured.

mod bytes;
mod counted;
pub mod memory;

pub use bytes::Bytes;
pub use counted::counted;
pub use memory::{MemoryPeaks, MemoryUse};
