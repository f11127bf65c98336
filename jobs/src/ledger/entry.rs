//! A line of a ledger.

use serde::{Deserialize, Serialize};
use serde_json::Value;
use serde_json::value::RawValue;

use crate::process::now_ms;

/// How a frame ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// All its outputs are in place.
    Done,
    /// It could not be made; the reason is in the entry.
    Failed,
}

/// An output as it was when its frame was done.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct OutputFile {
    /// Relative paths are in the job's directory.
    pub path: String,
    /// Length, bytes.
    pub len: u64,
}

/// One line.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Entry {
    /// Larger than that of every line its writer knew of, in any file.
    pub seq: u64,
    /// When, milliseconds since 1970. For rates; the order is by `seq`.
    pub time_ms: u64,
    /// The frame's number.
    pub frame: i64,
    /// How it ended.
    pub status: Status,
    /// What was written, if done.
    #[serde(default)]
    pub outputs: Vec<OutputFile>,
    /// Why it failed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// Means something to the caller only: timings, counts.
    #[serde(default)]
    pub details: Details,
}

/// JSON that means something to the caller only. Kept as text: as a tree of values it would take
/// several times the memory, for every frame of the job.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Details(Box<RawValue>);

impl Details {
    /// As a tree.
    pub fn value(&self) -> Value {
        serde_json::from_str(self.0.get()).expect("it was JSON when it was read or made")
    }
}

impl Default for Details {
    fn default() -> Self {
        Self(RawValue::NULL.to_owned())
    }
}

impl From<&Value> for Details {
    fn from(value: &Value) -> Self {
        let text = value.to_string();
        Self(RawValue::from_string(text).expect("a value is written as JSON"))
    }
}

impl PartialEq for Details {
    fn eq(&self, other: &Self) -> bool {
        self.value() == other.value()
    }
}

impl Entry {
    /// An entry of this moment, to come after all before `seq`.
    pub(crate) fn new(seq: u64, frame: i64, status: Status, details: &Value) -> Self {
        Self {
            seq,
            time_ms: now_ms(),
            frame,
            status,
            outputs: Vec::new(),
            reason: None,
            details: details.into(),
        }
    }
}
