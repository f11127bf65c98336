//! Files that this program has written, by a text in them. It may replace them without being asked.

use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;

/// Text in every movie, contact sheet and viewer page.
pub const MARKER: &str = "Made with spherule";

/// Bytes at the start of a file in which [`MARKER`] is searched for. The index of a movie may be before it.
const MAX_START: u64 = 16 << 20;

/// Bytes at the end of a file in which [`MARKER`] is searched for.
const MAX_END: u64 = 1 << 16;

/// Whether the file at `path` is a movie, sheet or page of this program. False if it cannot be read.
pub fn is_own_file(path: &Path) -> bool {
    find_marker(path).unwrap_or(false)
}

fn find_marker(path: &Path) -> io::Result<bool> {
    let (mut file, metadata) = spherule_files::open_regular(path)?;
    let mut has_marker = |from: u64, length: u64| {
        let mut bytes = Vec::new();
        file.seek(SeekFrom::Start(from))?;
        file.by_ref().take(length).read_to_end(&mut bytes)?;
        let marker = MARKER.as_bytes();
        Ok::<bool, io::Error>(bytes.windows(marker.len()).any(|found| found == marker))
    };
    let end = metadata.len().saturating_sub(MAX_END);
    Ok(has_marker(end, MAX_END)? || has_marker(0, MAX_START)?)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn only_own_files_have_the_marker() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.mp4");
        assert!(!is_own_file(&path) && !is_own_file(dir.path()));
        fs::write(&path, b"another program").unwrap();
        assert!(!is_own_file(&path));
        // After a long index
        let mut long = vec![0; 300_000];
        long.extend(MARKER.as_bytes());
        long.extend(vec![0; 300_000]);
        fs::write(&path, long).unwrap();
        assert!(is_own_file(&path));
    }
}
