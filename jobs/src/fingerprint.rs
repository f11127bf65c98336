//! Fingerprints of the input files and of the settings, to detect changes.
//!
//! A file is identified by its length, its modification time, and a BLAKE3 hash of its length and its first
//! and last 64 KiB. This is cheap for files of gigabytes, and rewriting a file changes at least one of them.

use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;
use std::time::UNIX_EPOCH;

use serde::{Deserialize, Serialize};

use crate::{SettingChange, open_regular};

const SAMPLE_BYTES: u64 = 64 * 1024;

/// Identifies the contents of a file well enough to detect changes.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Fingerprint {
    /// Length, bytes.
    pub length: u64,
    /// Modification time, nanoseconds since 1970.
    pub modified_ns: i64,
    /// BLAKE3 of the length (little-endian u64), the first and the last 64 KiB, in hex.
    pub blake3: String,
}

impl Fingerprint {
    /// Computes the fingerprint of the file at `path`. Reads at most 128 KiB.
    ///
    /// # Errors
    /// The file cannot be opened or read.
    pub fn of_file(path: &Path) -> io::Result<Self> {
        let (mut file, metadata) = open_regular(path)?;
        let length = metadata.len();
        let mut hasher = blake3::Hasher::new();
        hasher.update(&length.to_le_bytes());
        let mut sample = Vec::new();
        Read::by_ref(&mut file).take(SAMPLE_BYTES).read_to_end(&mut sample)?;
        if length > SAMPLE_BYTES {
            let tail = SAMPLE_BYTES.max(length - SAMPLE_BYTES);
            file.seek(SeekFrom::Start(tail))?;
            file.take(SAMPLE_BYTES).read_to_end(&mut sample)?;
        }
        hasher.update(&sample);
        Ok(Self {
            length,
            modified_ns: modified_ns(&metadata),
            blake3: hasher.finalize().to_hex().to_string(),
        })
    }

    /// Whether the contents are the same. The modification time does not matter, so copies are equal.
    pub(crate) fn has_same_contents(&self, other: &Self) -> bool {
        (self.length, &self.blake3) == (other.length, &other.blake3)
    }

    /// Whether the hash is that of all bytes of the file.
    const fn covers_all(&self) -> bool {
        self.length <= 2 * SAMPLE_BYTES
    }

    /// Whether only the modification time differs, so that the bytes between the first and the last 64 KiB tell whether
    /// `now` is a copy.
    pub(crate) fn may_be_copy(&self, now: &Self) -> bool {
        self.has_same_contents(now) && self.difference(now).is_some()
    }

    /// The difference between `self`, computed earlier, and `now`; None if there is none. The time of a file whose
    /// bytes are all in the hash does not matter.
    pub fn difference(&self, now: &Self) -> Option<String> {
        if self.length != now.length {
            Some(format!("length {} -> {} bytes", self.length, now.length))
        } else if self.blake3 != now.blake3 {
            Some("other contents".to_owned())
        } else if self.modified_ns != now.modified_ns && !self.covers_all() {
            Some("modification time has changed".to_owned())
        } else {
            None
        }
    }
}

/// BLAKE3 of the length (little-endian u64) and all contents of the file at `path`, in hex; for files that are read as
/// a whole anyway. Up to 128 KiB, it is that of the fingerprint.
///
/// # Errors
/// The file cannot be opened or read.
pub fn contents_hash(path: &Path) -> io::Result<String> {
    let (file, metadata) = open_regular(path)?;
    let mut hasher = blake3::Hasher::new();
    hasher.update(&metadata.len().to_le_bytes());
    hasher.update_reader(file)?;
    Ok(hasher.finalize().to_hex().to_string())
}

/// Saturates in the year 2262; 0 where the file system keeps no times.
fn modified_ns(metadata: &std::fs::Metadata) -> i64 {
    let Ok(time) = metadata.modified() else {
        return 0;
    };
    match time.duration_since(UNIX_EPOCH) {
        Ok(after) => i64::try_from(after.as_nanos()).unwrap_or(i64::MAX),
        Err(before) => i64::try_from(before.duration().as_nanos()).map_or(i64::MIN, |ns| -ns),
    }
}

/// BLAKE3 of a text, in hex.
pub fn text_hash(text: &str) -> String {
    blake3::hash(text.as_bytes()).to_hex().to_string()
}

/// BLAKE3 of ordered settings, in hex. The hash includes lengths, so that the boundaries of keys and values
/// count.
pub fn settings_hash(settings: &[(String, String)]) -> String {
    let mut hasher = blake3::Hasher::new();
    for text in settings.iter().flat_map(|(key, value)| [key, value]) {
        hasher.update(&(text.len() as u64).to_le_bytes());
        hasher.update(text.as_bytes());
    }
    hasher.finalize().to_hex().to_string()
}

/// The settings that differ between both lists, by key. The order does not matter.
pub fn compare_settings(old: &[(String, String)], new: &[(String, String)]) -> Vec<SettingChange> {
    let value_in = |list: &[(String, String)], key: &str| {
        list.iter().find(|(k, _)| k == key).map(|(_, v)| v.clone())
    };
    let removed = old.iter().filter(|(key, _)| value_in(new, key).is_none());
    new.iter()
        .chain(removed)
        .map(|(key, _)| SettingChange {
            key: key.clone(),
            old: value_in(old, key),
            new: value_in(new, key),
        })
        .filter(|change| change.old != change.new)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::{self, File};
    use std::time::{Duration, SystemTime};

    fn pairs(list: &[(&str, &str)]) -> Vec<(String, String)> {
        list.iter().map(|(k, v)| ((*k).to_owned(), (*v).to_owned())).collect()
    }

    /// Writes `bytes` with a fixed modification time.
    fn write(path: &Path, bytes: &[u8], seconds: u64) -> Fingerprint {
        fs::write(path, bytes).unwrap();
        let time = SystemTime::UNIX_EPOCH + Duration::from_secs(seconds);
        File::options().write(true).open(path).unwrap().set_modified(time).unwrap();
        Fingerprint::of_file(path).unwrap()
    }

    #[test]
    fn all_contents_count_in_a_hash_of_contents() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a");
        for length in [0, 1000, 100_000, 128 * 1024] {
            fs::write(&path, vec![7; length]).unwrap();
            let fingerprint = Fingerprint::of_file(&path).unwrap();
            assert_eq!(contents_hash(&path).unwrap(), fingerprint.blake3);
        }
        let mut contents = vec![7; 1 << 20];
        fs::write(&path, &contents).unwrap();
        let before = contents_hash(&path).unwrap();
        contents[1 << 19] = 8;
        fs::write(&path, &contents).unwrap();
        assert_ne!(contents_hash(&path).unwrap(), before);
        assert!(contents_hash(&dir.path().join("none")).is_err());
    }

    #[test]
    fn detects_changes_of_ends_length_and_time() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.vtk");
        for size in [1, 1000, 65_536, 65_537, 131_072, 131_073, 300_000] {
            let mut bytes = vec![7u8; size];
            let old = write(&path, &bytes, 5);
            assert_eq!(old.difference(&write(&path, &bytes, 5)), None);
            let touched = old.difference(&write(&path, &bytes, 6));
            assert_eq!(touched.is_some(), size > 131_072);
            assert!(touched.is_none_or(|what| what.contains("time")));
            bytes[size - 1] = 8;
            assert_eq!(old.difference(&write(&path, &bytes, 5)).unwrap(), "other contents");
            bytes[size - 1] = 7;
            bytes[0] = 8;
            assert_eq!(old.difference(&write(&path, &bytes, 5)).unwrap(), "other contents");
            bytes.push(7);
            assert!(old.difference(&write(&path, &bytes, 5)).unwrap().contains("length"));
        }
        write(&path, b"", 5);
        assert!(Fingerprint::of_file(&dir.path().join("none")).is_err());
    }

    #[test]
    fn changed_settings_are_listed() {
        let old = pairs(&[("render.max_depth", "3"), ("image.width", "640"), ("gone", "1")]);
        let new = pairs(&[("image.width", "640"), ("render.max_depth", "5"), ("new", "2")]);
        let named: Vec<String> =
            compare_settings(&old, &new).iter().map(ToString::to_string).collect();
        assert_eq!(
            named,
            ["render.max_depth: 3 -> 5", "new: (not set) -> 2", "gone: 1 -> (not set)"]
        );
        assert!(compare_settings(&old, &old).is_empty());
    }

    #[test]
    fn hash_includes_boundaries() {
        assert_ne!(settings_hash(&pairs(&[("ab", "c")])), settings_hash(&pairs(&[("a", "bc")])));
    }
}
