//! Counts the bytes that a conversion holds.

use std::sync::atomic::{AtomicU64, Ordering};

/// Bytes held now, and the largest number held at any time.
#[derive(Debug, Default)]
pub(super) struct MemoryAccount {
    now: AtomicU64,
    most: AtomicU64,
}

impl MemoryAccount {
    pub(super) fn hold(&self, bytes: u64) {
        let now = self.now.fetch_add(bytes, Ordering::Relaxed) + bytes;
        self.most.fetch_max(now, Ordering::Relaxed);
    }

    pub(super) fn let_go(&self, bytes: u64) {
        self.now.fetch_sub(bytes, Ordering::Relaxed);
    }

    pub(super) fn most(&self) -> u64 {
        self.most.load(Ordering::Relaxed)
    }
}
