//! Failures of a single frame, and how far they reach.

use std::io;
use std::panic::{self, AssertUnwindSafe};

use spherule_formats::{FrameError, Sequence};

/// Runs the work of one frame. A panic is a bug in spherule; it fails this frame only.
pub(crate) fn catch_panic<T>(work: impl FnOnce() -> Result<T, String>) -> Result<T, String> {
    panic::catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|payload| {
        let text = payload
            .downcast_ref::<String>()
            .map(String::as_str)
            .or_else(|| payload.downcast_ref::<&str>().copied())
            .unwrap_or("no reason given");
        Err(format!("a bug in spherule, please report it: {text}"))
    })
}

/// Whether all further outputs would fail for the same reason: the disk is full, or the directory is not
/// writable or does not exist any more.
pub(crate) fn is_output_unavailable(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        io::ErrorKind::StorageFull
            | io::ErrorKind::QuotaExceeded
            | io::ErrorKind::PermissionDenied
            | io::ErrorKind::ReadOnlyFilesystem
            | io::ErrorKind::NotFound
            | io::ErrorKind::StaleNetworkFileHandle
    )
}

/// Whether frame `index` may be damaged only because the simulation is still writing it, and the `error` does
/// not say so itself.
pub(crate) fn may_be_incomplete(sequence: &Sequence, index: usize, error: &FrameError) -> bool {
    let is_newest = index + 1 == sequence.frames().len();
    let is_damage = matches!(error, FrameError::Malformed { .. });
    is_newest && is_damage && !error.to_string().contains("being written")
}
