//! Failures of the work on one frame, and their scope.

use std::io;
use std::panic::{self, AssertUnwindSafe};

use spherule_formats::{FrameError, Sequence};

/// Runs the work of one frame. A panic in it is a bug in this program, and fails only this frame.
pub(crate) fn guarded<T>(work: impl FnOnce() -> Result<T, String>) -> Result<T, String> {
    panic::catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|fault| {
        let text = fault
            .downcast_ref::<String>()
            .map(String::as_str)
            .or_else(|| fault.downcast_ref::<&str>().copied())
            .unwrap_or("no reason given");
        Err(format!(
            "a fault in spherule itself, please report it: {text}"
        ))
    })
}

/// Whether all further files would fail for the same reason: the disk is full, or the directory is no longer writable
/// or has been removed.
pub(crate) fn is_place_at_fault(error: &io::Error) -> bool {
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

/// Whether frame `index` may be damaged only because the simulation is still writing it, unless the `error` states
/// that already.
pub(crate) fn may_be_unfinished(sequence: &Sequence, index: usize, error: &FrameError) -> bool {
    let is_newest = index + 1 == sequence.frames().len();
    let is_damage = matches!(error, FrameError::Malformed { .. });
    is_newest && is_damage && !error.to_string().contains("being written")
}
