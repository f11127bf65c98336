//! The plan: which frames a job has, from which inputs to which outputs, under which settings,
//! and what "auto" turned into. One JSON file in the job's directory, replaced only as a whole, with a
//! checksum of all of it: a plan with one wrong digit would give the remaining frames another camera.

use std::io;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::Value;
use serde_json::value::RawValue;

use crate::{
    Fingerprint, JobError, SettingChange, compare_settings, publish, read_regular, settings_hash,
    text_hash,
};

/// Name of the plan in the job's directory.
pub const PLAN_FILE: &str = "job.plan.json";

/// The version that is written. Version 1, of spherule 0.1.0, has a checksum of the settings alone and no
/// `input_dirs`; it is read, and replaced when the job goes on.
const VERSION: u32 = 2;

/// More than a plan of two million frames needs.
const MAX_BYTES: u64 = 1 << 30;

/// See the module.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    /// That of the file it was read from.
    #[serde(skip, default = "current_version")]
    version: u32,
    /// What outputs depend on, besides the inputs: dotted key and value, in the caller's order.
    settings: Vec<(String, String)>,
    /// What "auto" turned into; means something to the caller only.
    resolved: Value,
    /// The directories that inputs were found in, absolute and without links, the latest last.
    #[serde(default)]
    input_dirs: Vec<String>,
    /// By number, ascending.
    frames: Vec<PlannedFrame>,
}

/// One frame of a [`Plan`].
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct PlannedFrame {
    /// The frame's number, unique in the plan.
    pub number: i64,
    /// Files it is made from.
    pub inputs: Vec<PlannedInput>,
    /// Files it is made into; relative ones are in the job's directory.
    pub outputs: Vec<String>,
}

/// One input of a [`PlannedFrame`].
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct PlannedInput {
    /// As the caller gave it. Not part of the frame's identity: data may be moved.
    pub path: String,
    /// None if the file could not be read when it was planned.
    pub fingerprint: Option<Fingerprint>,
}

/// The file of a plan.
#[derive(Serialize, Deserialize)]
struct SealedPlan<'a> {
    version: u32,
    /// BLAKE3 of the text of `plan` as it stands in the file, in hex.
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
        Self {
            version: VERSION,
            settings,
            resolved,
            input_dirs,
            frames,
        }
    }

    /// What outputs depend on, besides the inputs.
    pub fn settings(&self) -> &[(String, String)] {
        &self.settings
    }

    /// How `settings` differ from the plan's.
    pub fn changes_to(&self, settings: &[(String, String)]) -> Vec<SettingChange> {
        compare_settings(&self.settings, settings)
    }

    /// Settles what "auto" turned into.
    pub(crate) fn resolve(&mut self, resolved: Value) {
        self.resolved = resolved;
    }

    /// What "auto" turned into.
    pub const fn resolved(&self) -> &Value {
        &self.resolved
    }

    /// The directories that inputs were found in; empty in plans of version 1.
    pub(crate) fn input_dirs(&self) -> &[String] {
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

    /// The plan in `dir`, or None if there is none.
    pub(crate) fn load(dir: &Path) -> Result<Option<Self>, JobError> {
        let path = Self::path_in(dir);
        let bytes = match read_regular(&path, MAX_BYTES) {
            Ok(bytes) => bytes,
            Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(e) => return Err(JobError::io(&path, "reading the plan", e)),
        };
        Self::parse(&bytes)
            .map(Some)
            .map_err(|what| JobError::PlanDamaged { path, what })
    }

    /// Reads the bytes of a plan's file. What is wrong with them is said without the file's name.
    ///
    /// # Errors
    /// They are no plan, are damaged, or are of a version that is not known.
    #[doc(hidden)]
    pub fn parse(bytes: &[u8]) -> Result<Self, String> {
        #[derive(Deserialize)]
        struct Versioned {
            version: u32,
        }
        let version = serde_json::from_slice::<Versioned>(bytes)
            .map_err(damaged)?
            .version;
        let plan = match version {
            VERSION => Self::unsealed(bytes)?,
            1 => Self::parse_version_1(bytes)?,
            _ => {
                return Err(format!(
                    "the plan has version {version}, this program knows versions 1 to {VERSION}"
                ));
            }
        };
        if !plan.frames.is_sorted_by(|a, b| a.number < b.number) {
            return Err("the frames in the plan are not in ascending order".to_owned());
        }
        Ok(plan)
    }

    fn unsealed(bytes: &[u8]) -> Result<Self, String> {
        let sealed: SealedPlan = serde_json::from_slice(bytes).map_err(damaged)?;
        let text = sealed.plan.get();
        if text_hash(text) != sealed.blake3 {
            return Err("the plan does not match its checksum: it is damaged or edited".to_owned());
        }
        serde_json::from_str(text).map_err(damaged)
    }

    fn parse_version_1(bytes: &[u8]) -> Result<Self, String> {
        #[derive(Deserialize)]
        struct Hashed {
            settings_blake3: String,
        }
        let hash: Hashed = serde_json::from_slice(bytes).map_err(damaged)?;
        let mut plan: Self = serde_json::from_slice(bytes).map_err(damaged)?;
        if settings_hash(&plan.settings) != hash.settings_blake3 {
            return Err("the settings in the plan do not match their fingerprint".to_owned());
        }
        plan.version = 1;
        Ok(plan)
    }

    pub(crate) fn store(&self, dir: &Path) -> Result<(), JobError> {
        let path = Self::path_in(dir);
        let bytes = self
            .to_bytes()
            .map_err(|e| JobError::Request(format!("the plan cannot be written as JSON: {e}")))?;
        publish(&path, &bytes).map_err(|e| JobError::io(&path, "writing the plan", e))
    }

    fn to_bytes(&self) -> serde_json::Result<Vec<u8>> {
        let text = RawValue::from_string(serde_json::to_string_pretty(self)?)?;
        let sealed = SealedPlan {
            version: VERSION,
            blake3: text_hash(text.get()),
            plan: &text,
        };
        let mut bytes = serde_json::to_vec_pretty(&sealed)?;
        bytes.push(b'\n');
        Ok(bytes)
    }

    /// Takes in `frames`, replacing those of the same number.
    pub(crate) fn merge(&mut self, frames: Vec<PlannedFrame>) {
        for frame in frames {
            match self
                .frames
                .binary_search_by_key(&frame.number, |f| f.number)
            {
                Ok(index) => self.frames[index] = frame,
                Err(index) => self.frames.insert(index, frame),
            }
        }
    }
}

fn damaged(error: serde_json::Error) -> String {
    format!("this is no readable plan ({error})")
}

impl PlannedFrame {
    /// The first input that is not what `self`, planned earlier, was made from.
    pub(crate) fn changed_input(&self, now: &Self) -> Option<(PathBuf, String)> {
        if self.inputs.len() != now.inputs.len() {
            let path = now.inputs.first().or(self.inputs.first())?.path.clone();
            let what = format!("{} -> {} input files", self.inputs.len(), now.inputs.len());
            return Some((path.into(), what));
        }
        self.inputs.iter().zip(&now.inputs).find_map(|(old, new)| {
            let what = match (&old.fingerprint, &new.fingerprint) {
                (Some(old), Some(new)) => old.difference(new),
                (Some(_), None) => Some("cannot be read any more".to_owned()),
                (None, Some(_)) => Some("could not be read when it was planned".to_owned()),
                (None, None) => None,
            };
            what.map(|what| (PathBuf::from(&new.path), what))
        })
    }
}

#[cfg(test)]
mod tests;
