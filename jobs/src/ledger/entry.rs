//! A line of a ledger.

use std::fmt;

use serde::de::{Error as _, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
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
    /// Whether the frame was set back, to be made anew by whoever comes to it, also in runs that are under
    /// way. Such an entry is a failed one.
    #[serde(default, skip_serializing_if = "is_false")]
    pub set_back: bool,
    /// Means something to the caller only: timings, counts.
    #[serde(default)]
    pub details: Details,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde asks for it")]
const fn is_false(value: &bool) -> bool {
    !*value
}

/// JSON that means something to the caller only. Kept as text: as a tree of values it would take
/// several times the memory, for every frame of the job.
#[derive(Debug, Clone, Serialize)]
#[serde(transparent)]
pub struct Details(Box<RawValue>);

impl Details {
    /// As a tree; null for what is nested deeper than can be read back.
    pub fn value(&self) -> Value {
        serde_json::from_str(self.0.get()).unwrap_or_default()
    }
}

impl<'de> Deserialize<'de> for Details {
    /// Text kept for later is not looked into by the parser: numbers beyond f64, half characters and deep
    /// nesting would be found only when it is used.
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = Box::<RawValue>::deserialize(deserializer)?;
        serde_json::from_str::<Readable>(text.get()).map_err(D::Error::custom)?;
        Ok(Self(text))
    }
}

/// JSON that can be read as a [`Value`]; none is made.
struct Readable;

impl<'de> Deserialize<'de> for Readable {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Self)
    }
}

impl<'de> Visitor<'de> for Readable {
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
            set_back: false,
            details: details.into(),
        }
    }

    /// That `frame` is to be made anew, and why.
    pub(crate) fn set_back(seq: u64, frame: i64, reason: String) -> Self {
        Self {
            reason: Some(reason),
            set_back: true,
            ..Self::new(seq, frame, Status::Failed, &Value::Null)
        }
    }

    /// Reads a line of a ledger.
    ///
    /// # Errors
    /// It is not an entry.
    pub(crate) fn parse(line: &[u8]) -> Result<Self, String> {
        serde_json::from_slice(line).map_err(|e| format!("not a ledger entry ({e})"))
    }
}
