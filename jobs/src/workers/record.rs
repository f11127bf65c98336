//! A worker record: the first line of the worker's file, and of its claims.
//!
//! Other workers read it. They build file names from it and decide with it whether the worker is alive. So a
//! damaged or forged line is not accepted as a record.

use std::io::{self, Read};
use std::path::Path;
use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::RECORD_SUFFIX;
use crate::open_regular;
use crate::process::Process;

/// Bytes of the longest line that is read.
const MAX_LINE: u64 = 1 << 16;

/// Characters of the longest worker name.
const MAX_NAME: usize = 128;

/// Longest heartbeat interval that is accepted. Workers of this version use at most five seconds.
const MAX_HEARTBEAT_INTERVAL: Duration = Duration::from_secs(60);

/// Describes a worker to other workers.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct WorkerRecord {
    /// Unique name: letters, digits, `-` and `_`.
    pub(crate) worker: String,
    /// The process of the worker.
    pub(crate) process: Process,
    /// When the worker started, milliseconds since 1970 by its own clock. Only displayed.
    pub(crate) since_ms: u64,
    /// Milliseconds between heartbeats.
    #[serde(default, rename = "pause_ms")]
    pub(super) heartbeat_interval_ms: u64,
}

/// The serialised form of a record.
#[derive(Serialize, Deserialize)]
struct ChecksummedRecord {
    #[serde(flatten)]
    record: WorkerRecord,
    /// BLAKE3 of the JSON of the record alone, in hex. Records of spherule 0.1.0 have none.
    #[serde(default)]
    blake3: Option<String>,
}

impl WorkerRecord {
    /// Reads the record in the file at `path`; None if the file does not contain a valid record.
    pub(super) fn read(path: &Path) -> io::Result<Option<Self>> {
        let mut bytes = Vec::new();
        let (file, _) = open_regular(path)?;
        // Many heartbeats may follow
        file.take(MAX_LINE).read_to_end(&mut bytes)?;
        Ok(Self::parse(&bytes))
    }

    /// Parses the first line of `bytes`; None if it is not a valid record.
    pub(crate) fn parse(bytes: &[u8]) -> Option<Self> {
        let line = bytes.split(|b| *b == b'\n').next()?;
        let parsed: ChecksummedRecord = serde_json::from_slice(line).ok()?;
        let record = parsed.record;
        let is_intact = match parsed.blake3 {
            Some(checksum) => record.checksum().is_ok_and(|own| own == checksum),
            None => true,
        };
        (is_intact && is_worker_name(&record.worker)).then_some(record)
    }

    /// The line that is written to the file.
    pub(super) fn to_line(&self) -> serde_json::Result<Vec<u8>> {
        let checksummed =
            ChecksummedRecord { record: self.clone(), blake3: Some(self.checksum()?) };
        let mut line = serde_json::to_vec(&checksummed)?;
        line.push(b'\n');
        Ok(line)
    }

    fn checksum(&self) -> serde_json::Result<String> {
        let text = serde_json::to_vec(self)?;
        Ok(blake3::hash(&text).to_hex().to_string())
    }

    /// Time between heartbeats.
    pub(super) fn heartbeat_interval(&self) -> Duration {
        Duration::from_millis(self.heartbeat_interval_ms).min(MAX_HEARTBEAT_INTERVAL)
    }

    /// The name of the record's file.
    pub(super) fn file_name(&self) -> String {
        format!("{}{RECORD_SUFFIX}", self.worker)
    }

    /// Whether `path` has the file name of this record.
    pub(super) fn is_at(&self, path: &Path) -> bool {
        path.file_name().is_some_and(|name| *name == *self.file_name())
    }

    /// The worker as messages name it.
    pub(crate) fn description(&self) -> String {
        format!("process {} on {}", self.process.pid, self.process.host)
    }
}

/// Whether `name` is a valid worker name. Worker names become part of paths.
pub(super) fn is_worker_name(name: &str) -> bool {
    let is_plain = |b: u8| b.is_ascii_alphanumeric() || b == b'-' || b == b'_';
    (1..=MAX_NAME).contains(&name.len()) && name.bytes().all(is_plain)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(worker: &str) -> WorkerRecord {
        WorkerRecord {
            worker: worker.to_owned(),
            process: Process::current().clone(),
            since_ms: 5,
            heartbeat_interval_ms: 5000,
        }
    }

    #[test]
    fn names_that_leave_the_directory_are_rejected() {
        let long = "x".repeat(129);
        let names = ["../../victim", "/victim", "a/b", "..", "", "a b", "é", &long];
        for name in names {
            let line = record(name).to_line().unwrap();
            assert_eq!(WorkerRecord::parse(&line), None, "{name}");
        }
        let good = record("host_1-23-ff-2");
        let mut line = good.to_line().unwrap();
        line.extend(b"......");
        assert_eq!(WorkerRecord::parse(&line).as_ref(), Some(&good));
        // As spherule 0.1.0 writes it
        let old = serde_json::to_vec(&good).unwrap();
        assert_eq!(WorkerRecord::parse(&old).as_ref(), Some(&good));
        let forged = WorkerRecord { heartbeat_interval_ms: u64::MAX, ..good };
        assert_eq!(forged.heartbeat_interval(), MAX_HEARTBEAT_INTERVAL);
    }

    /// The keys on disk are a contract with other versions.
    #[test]
    fn keys_on_disk_stay() {
        let line = record("host-23-ff").to_line().unwrap();
        let value: serde_json::Value = serde_json::from_slice(&line).unwrap();
        for key in ["worker", "process", "since_ms", "pause_ms", "blake3"] {
            assert!(value.get(key).is_some(), "{key}");
        }
        for key in ["token", "host", "machine", "pid", "start"] {
            assert!(value["process"].get(key).is_some(), "{key}");
        }
    }

    /// With any bit flipped the line is rejected or still means the same.
    #[test]
    fn no_flipped_bit_changes_a_record() {
        let record = record("host-23-ff");
        let line = record.to_line().unwrap();
        for at in 0..line.len() {
            for bit in 0..8 {
                let mut damaged = line.clone();
                damaged[at] ^= 1 << bit;
                if let Some(read) = WorkerRecord::parse(&damaged) {
                    assert_eq!(read, record, "byte {at}, bit {bit}");
                }
            }
        }
    }
}
