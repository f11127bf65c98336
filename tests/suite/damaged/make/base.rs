//! Ways to break a file.

use super::Made;

/// A file to be broken.
pub(super) struct Base {
    name: &'static str,
    extension: &'static str,
    bytes: Vec<u8>,
    pub(super) made: Vec<Made>,
}

impl Base {
    pub(super) fn new(name: &'static str, extension: &'static str, bytes: Vec<u8>) -> Self {
        let made = Vec::new();
        Self { name, extension, bytes, made }
    }

    /// A file `<name>-<what>` with this content.
    pub(super) fn file(mut self, what: &str, bytes: Vec<u8>) -> Self {
        let name = format!("{}-{what}.{}", self.name, self.extension);
        self.made.push((name, bytes));
        self
    }

    /// Ends `more` bytes after the first `marker`.
    pub(super) fn cut(self, what: &str, marker: &str, more: usize) -> Self {
        let end = find(&self.bytes, marker.as_bytes()) + marker.len() + more;
        let bytes = self.bytes[..end].to_vec();
        self.file(what, bytes)
    }

    /// Ends after `length` bytes.
    pub(super) fn cut_at(self, what: &str, length: usize) -> Self {
        let bytes = self.bytes[..length].to_vec();
        self.file(what, bytes)
    }

    /// The first `old` is `new`.
    pub(super) fn replace(self, what: &str, old: impl AsRef<[u8]>, new: impl AsRef<[u8]>) -> Self {
        let bytes = replace(&self.bytes, old.as_ref(), new.as_ref());
        self.file(what, bytes)
    }

    /// Other bytes from `at` on.
    pub(super) fn patch(self, what: &str, at: usize, new: &[u8]) -> Self {
        let mut bytes = self.bytes.clone();
        bytes[at..at + new.len()].copy_from_slice(new);
        self.file(what, bytes)
    }
}

pub(super) fn find(bytes: &[u8], marker: &[u8]) -> usize {
    let found = bytes.windows(marker.len()).position(|w| w == marker);
    found.expect("the marker is in the file")
}

pub(super) fn replace(bytes: &[u8], old: &[u8], new: &[u8]) -> Vec<u8> {
    let at = find(bytes, old);
    [&bytes[..at], new, &bytes[at + old.len()..]].concat()
}
