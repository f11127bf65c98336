//! The plan: the frames of a job with their inputs and outputs, the settings, and the resolved automatic
//! settings. It is one JSON file in the job's directory, always replaced as a whole. It has a checksum: with one
//! wrong digit in the plan, the remaining frames would get another camera.

use std::io;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::Value;
use serde_json::value::RawValue;

use crate::copies::Copies;
use crate::{
    Fingerprint, JobError, PLAN_FILE, PlanError, SettingChange, compare_settings, publish,
    read_regular, settings_hash, text_hash,
};

/// The version that is written. Version 1, of spherule 0.1.0, has a checksum of the settings only and no
/// `input_dirs`. It is read, and replaced when the job is resumed.
const VERSION: u32 = 2;

/// Bytes of the longest plan that is read: more than two million frames need.
const MAX_BYTES: u64 = 1 << 30;

/// See the module.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    /// Version of the file that it was read from.
    #[serde(skip, default = "current_version")]
    version: u32,
    /// Everything that outputs depend on besides the inputs: dotted key and value, in the caller's order.
    settings: Vec<(String, String)>,
    /// Resolved automatic settings, in the caller's format.
    resolved: Value,
    /// Input directories, absolute and without links, most recent last.
    #[serde(default)]
    input_dirs: Vec<String>,
    /// Ascending by number.
    frames: Vec<PlannedFrame>,
}

/// One frame of a [`Plan`].
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct PlannedFrame {
    /// Frame number, unique in the plan.
    pub number: i64,
    /// Input files, and then those of [`crate::FrameRequest::companions`].
    pub inputs: Vec<PlannedInput>,
    /// Output files; relative paths are in the job's directory.
    pub outputs: Vec<String>,
}

/// One input of a [`PlannedFrame`].
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct PlannedInput {
    /// Path as given by the caller. Not part of the frame's identity: data may be moved.
    pub path: String,
    /// None if the file was not readable when it was planned.
    pub fingerprint: Option<Fingerprint>,
}

/// The serialised form of a plan.
#[derive(Serialize, Deserialize)]
struct ChecksummedPlan<'a> {
    version: u32,
    /// BLAKE3 of the text of `plan` exactly as in the file, in hex.
    blake3: String,
    #[serde(borrow)]
    plan: &'a RawValue,
}

const fn current_version() -> u32 {
    VERSION
}

impl Plan {
    pub(crate) fn new(
        settings: Vec<(String, String)>,
        resolved: Value,
        input_dirs: Vec<String>,
        frames: Vec<PlannedFrame>,
    ) -> Self {
        Self { version: VERSION, settings, resolved, input_dirs, frames }
    }

    /// Everything that outputs depend on besides the inputs.
    pub fn settings(&self) -> &[(String, String)] {
        &self.settings
    }

    /// The differences between the settings of the plan and `settings`.
    pub fn changes_to(&self, settings: &[(String, String)]) -> Vec<SettingChange> {
        compare_settings(&self.settings, settings)
    }

    /// Sets the resolved automatic settings.
    pub(crate) fn set_resolved(&mut self, resolved: Value) {
        self.resolved = resolved;
    }

    /// The resolved automatic settings.
    pub const fn resolved(&self) -> &Value {
        &self.resolved
    }

    /// The input directories; empty in plans of version 1.
    pub fn input_dirs(&self) -> &[String] {
        &self.input_dirs
    }

    /// All frames, ascending by number.
    pub fn frames(&self) -> &[PlannedFrame] {
        &self.frames
    }

    /// The frame with this number.
    pub fn frame(&self, number: i64) -> Option<&PlannedFrame> {
        let index = self.frames.binary_search_by_key(&number, |f| f.number);
        index.ok().map(|i| &self.frames[i])
    }

    pub(crate) fn path_in(dir: &Path) -> PathBuf {
        dir.join(PLAN_FILE)
    }

    /// Reads the plan in `dir`; None if there is none.
    pub(crate) fn load(dir: &Path) -> Result<Option<Self>, JobError> {
        let path = Self::path_in(dir);
        let bytes = match read_regular(&path, MAX_BYTES) {
            Ok(bytes) => bytes,
            Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(e) => return Err(JobError::io(&path, "reading the plan", e)),
        };
        Self::parse(&bytes).map(Some).map_err(|source| JobError::PlanDamaged { path, source })
    }

    /// Parses the file of a plan. The error does not contain the file's name.
    ///
    /// # Errors
    /// The bytes are not a plan, are damaged, or have an unknown version.
    #[doc(hidden)]
    pub fn parse(bytes: &[u8]) -> Result<Self, PlanError> {
        #[derive(Deserialize)]
        struct Versioned {
            version: u32,
        }
        let version = serde_json::from_slice::<Versioned>(bytes)?.version;
        let plan = match version {
            VERSION => Self::parse_version_2(bytes)?,
            1 => Self::parse_version_1(bytes)?,
            found => {
                return Err(PlanError::Version { found, latest: VERSION });
            }
        };
        if !plan.frames.is_sorted_by(|a, b| a.number < b.number) {
            return Err(PlanError::Unordered);
        }
        Ok(plan)
    }

    fn parse_version_2(bytes: &[u8]) -> Result<Self, PlanError> {
        let checksummed: ChecksummedPlan = serde_json::from_slice(bytes)?;
        let text = checksummed.plan.get();
        if text_hash(text) != checksummed.blake3 {
            return Err(PlanError::Checksum);
        }
        Ok(serde_json::from_str(text)?)
    }

    fn parse_version_1(bytes: &[u8]) -> Result<Self, PlanError> {
        #[derive(Deserialize)]
        struct Hashed {
            settings_blake3: String,
        }
        let hash: Hashed = serde_json::from_slice(bytes)?;
        let mut plan: Self = serde_json::from_slice(bytes)?;
        if settings_hash(&plan.settings) != hash.settings_blake3 {
            return Err(PlanError::SettingsChecksum);
        }
        plan.version = 1;
        Ok(plan)
    }

    pub(crate) fn store(&self, dir: &Path) -> Result<(), JobError> {
        let path = Self::path_in(dir);
        let bytes =
            self.to_bytes().map_err(|source| JobError::Serialize { path: path.clone(), source })?;
        publish(&path, &bytes).map_err(|e| JobError::io(&path, "writing the plan", e))
    }

    fn to_bytes(&self) -> serde_json::Result<Vec<u8>> {
        let text = RawValue::from_string(serde_json::to_string_pretty(self)?)?;
        let checksummed =
            ChecksummedPlan { version: VERSION, blake3: text_hash(text.get()), plan: &text };
        let mut bytes = serde_json::to_vec_pretty(&checksummed)?;
        bytes.push(b'\n');
        Ok(bytes)
    }

    /// Adds `frames`. They replace frames with the same numbers.
    pub(crate) fn merge(&mut self, frames: Vec<PlannedFrame>) {
        for frame in frames {
            match self.frames.binary_search_by_key(&frame.number, |f| f.number) {
                Ok(index) => self.frames[index] = frame,
                Err(index) => self.frames.insert(index, frame),
            }
        }
    }
}

impl PlannedFrame {
    /// The first input of `now` that differs from the inputs of `self`, which was planned earlier. Copies are equal.
    pub(crate) fn changed_input(
        &self,
        now: &Self,
        copies: &mut Copies,
    ) -> Option<(PathBuf, String)> {
        // Other numbers of files differ without a look into them
        if self.inputs.len() != now.inputs.len() {
            let path = now.inputs.first().or(self.inputs.first())?.path.clone();
            let what = format!("{} -> {} input files", self.inputs.len(), now.inputs.len());
            return Some((path.into(), what));
        }
        // Compare fingerprints; a copy with another time counts as the same
        self.inputs.iter().zip(&now.inputs).find_map(|(old, new)| {
            let what = match (&old.fingerprint, &new.fingerprint) {
                (Some(before), Some(after))
                    if before.may_be_copy(after)
                        && copies.are_equal(Path::new(&old.path), before, Path::new(&new.path)) =>
                {
                    None
                }
                (Some(before), Some(after)) => before.difference(after),
                (Some(_), None) => Some("is no longer readable".to_owned()),
                (None, Some(_)) => Some("was not readable when it was planned".to_owned()),
                (None, None) => None,
            };
            what.map(|what| (PathBuf::from(&new.path), what))
        })
    }
}

#[cfg(test)]
mod tests;
