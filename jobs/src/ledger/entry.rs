//! A line of a ledger.

use std::fmt;

use serde::de::{Error as _, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
use serde_json::Value;
use serde_json::value::RawValue;

use crate::process::now_ms;
use crate::{EntryError, FailureKind};

/// The result of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum EntryStatus {
    /// All outputs exist.
    Done,
    /// The frame failed; the entry has the reason.
    Failed,
}

/// An output of a finished frame.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct OutputFile {
    /// Path; relative ones are in the job's directory.
    pub path: String,
    /// Length, bytes.
    pub len: u64,
}

/// One line of a ledger.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LedgerEntry {
    /// Sequence number: larger than that of any entry that its writer knew.
    pub seq: u64,
    /// Time, milliseconds since 1970. Used for rates; `seq` defines the order.
    pub time_ms: u64,
    /// Frame number.
    pub frame: i64,
    /// The result.
    pub status: EntryStatus,
    /// The files that were written, if done.
    #[serde(default)]
    pub outputs: Vec<OutputFile>,
    /// Why the frame failed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// The kind of the failure, if it failed. Entries of spherule 0.1.0 have none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failure: Option<FailureKind>,
    /// Whether the frame was requeued: any worker repeats it, also in runs in progress. The status of such an
    /// entry is failed.
    #[serde(default, rename = "set_back", skip_serializing_if = "is_false")]
    pub is_requeued: bool,
    /// Data of the caller: times, counts.
    #[serde(default)]
    pub details: Details,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde asks for it")]
const fn is_false(value: &bool) -> bool {
    !*value
}

/// JSON of the caller. Stored as text: a tree of values would need several times the memory, for every frame of
/// the job.
#[derive(Debug, Clone, Serialize)]
#[serde(transparent)]
pub struct Details(Box<RawValue>);

impl Details {
    /// The parsed value; null if it is nested deeper than the parser allows.
    pub fn value(&self) -> Value {
        serde_json::from_str(self.0.get()).unwrap_or_default()
    }
}

impl<'de> Deserialize<'de> for Details {
    /// Parses the text completely. `RawValue` alone accepts numbers beyond f64, lone surrogates and deep nesting,
    /// which would be found only when the value is used.
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = Box::<RawValue>::deserialize(deserializer)?;
        serde_json::from_str::<ValidJson>(text.get()).map_err(D::Error::custom)?;
        Ok(Self(text))
    }
}

/// Checks that JSON can be parsed as a [`Value`] without creating one.
struct ValidJson;

impl<'de> Deserialize<'de> for ValidJson {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Self)
    }
}

impl<'de> Visitor<'de> for ValidJson {
    type Value = Self;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("JSON")
    }

    fn visit_unit<E>(self) -> Result<Self, E> {
        Ok(self)
    }

    fn visit_bool<E>(self, _: bool) -> Result<Self, E> {
        Ok(self)
    }

    fn visit_i64<E>(self, _: i64) -> Result<Self, E> {
        Ok(self)
    }

    fn visit_u64<E>(self, _: u64) -> Result<Self, E> {
        Ok(self)
    }

    fn visit_f64<E>(self, _: f64) -> Result<Self, E> {
        Ok(self)
    }

    fn visit_str<E>(self, _: &str) -> Result<Self, E> {
        Ok(self)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Self, A::Error> {
        while list.next_element::<Self>()?.is_some() {}
        Ok(self)
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self, A::Error> {
        while map.next_entry::<Self, Self>()?.is_some() {}
        Ok(self)
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
        Self(RawValue::from_string(text).expect("values serialise to JSON"))
    }
}

impl PartialEq for Details {
    fn eq(&self, other: &Self) -> bool {
        self.value() == other.value()
    }
}

impl LedgerEntry {
    /// An entry with the current time.
    pub(crate) fn new(seq: u64, frame: i64, status: EntryStatus, details: &Value) -> Self {
        Self {
            seq,
            time_ms: now_ms(),
            frame,
            status,
            outputs: Vec::new(),
            reason: None,
            failure: None,
            is_requeued: false,
            details: details.into(),
        }
    }

    /// An entry that requeues `frame`.
    pub(crate) fn requeued(seq: u64, frame: i64, reason: String) -> Self {
        Self {
            reason: Some(reason),
            is_requeued: true,
            ..Self::new(seq, frame, EntryStatus::Failed, &Value::Null)
        }
    }

    /// Parses a line of a ledger.
    ///
    /// # Errors
    /// The line is not an entry.
    pub(crate) fn parse(line: &[u8]) -> Result<Self, EntryError> {
        Ok(serde_json::from_slice(line)?)
    }
}
