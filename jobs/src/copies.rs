//! Copies of input files: `cp -r` gives them other times, and the fingerprint of a large file says little else about its
//! middle.

use std::collections::HashMap;
use std::io::{self, BufRead, BufReader};
use std::path::{Path, PathBuf};

use crate::{Fingerprint, open_regular};

/// Bytes that are compared at once.
const BUFFER_BYTES: usize = 1 << 20;

/// Pairs of files that were compared byte by byte. Frames of a trajectory share one pair.
#[derive(Debug, Default)]
pub(crate) struct Copies {
    known: HashMap<(PathBuf, PathBuf), bool>,
}

impl Copies {
    /// Whether the file `old` is still what it was when it had the fingerprint `then`, and `new` has the same bytes.
    pub(crate) fn are_equal(&mut self, old: &Path, then: &Fingerprint, new: &Path) -> bool {
        let key = (old.to_owned(), new.to_owned());
        if let Some(known) = self.known.get(&key) {
            return *known;
        }
        let is_original = || Fingerprint::of_file(old).is_ok_and(|now| now == *then);
        let are_equal =
            key.0 != key.1 && is_original() && have_same_bytes(&key.0, &key.1).unwrap_or(false);
        self.known.insert(key, are_equal);
        are_equal
    }
}

fn have_same_bytes(a: &Path, b: &Path) -> io::Result<bool> {
    let open = |path| io::Result::Ok(BufReader::with_capacity(BUFFER_BYTES, open_regular(path)?.0));
    let (mut a, mut b) = (open(a)?, open(b)?);
    loop {
        let (from_a, from_b) = (a.fill_buf()?, b.fill_buf()?);
        let len = from_a.len().min(from_b.len());
        if len == 0 || from_a[..len] != from_b[..len] {
            return Ok(from_a.len() == from_b.len() && len == 0);
        }
        a.consume(len);
        b.consume(len);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn the_middle_of_large_files_counts() {
        let dir = tempfile::tempdir().unwrap();
        let path = |name: &str| dir.path().join(name);
        let mut bytes = vec![7_u8; 3 << 20];
        fs::write(path("a"), &bytes).unwrap();
        fs::copy(path("a"), path("b")).unwrap();
        bytes[2 << 20] = 8;
        fs::write(path("c"), &bytes).unwrap();
        let planned = Fingerprint::of_file(&path("a")).unwrap();
        let are_equal = |name: &str| Copies::default().are_equal(&path("a"), &planned, &path(name));
        assert!(are_equal("b") && !are_equal("c") && !are_equal("a"));
        // The original must be what it was
        fs::write(path("a"), &bytes).unwrap();
        assert!(!are_equal("c"));
    }
}
