//! The plan: which frames a job has, from which inputs to which outputs, under which settings,
//! and what "auto" turned into. One JSON file in the job's directory, replaced only as a whole.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::{Fingerprint, JobError, SettingChange, compare_settings, publish, settings_hash};

/// Name of the plan in the job's directory.
pub const PLAN_FILE: &str = "job.plan.json";

const VERSION: u32 = 1;

/// See the module.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    version: u32,
    /// What outputs depend on, besides the inputs: dotted key and value, in the caller's order.
    settings: Vec<(String, String)>,
    settings_blake3: String,
    /// What "auto" turned into; means something to the caller only.
    resolved: Value,
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

impl Plan {
    pub(crate) fn new(
        settings: Vec<(String, String)>,
        resolved: Value,
        frames: Vec<PlannedFrame>,
    ) -> Self {
        Self {
            version: VERSION,
            settings_blake3: settings_hash(&settings),
            settings,
            resolved,
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
        let bytes = match fs::read(&path) {
            Ok(bytes) => bytes,
            Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(e) => return Err(JobError::io(&path, "reading the plan", e)),
        };
        Self::parse(&bytes)
            .map(Some)
            .map_err(|what| JobError::PlanDamaged { path, what })
    }

    fn parse(bytes: &[u8]) -> Result<Self, String> {
        #[derive(Deserialize)]
        struct Versioned {
            version: u32,
        }
        let damaged = |e: serde_json::Error| format!("this is no readable plan ({e})");
        let version = serde_json::from_slice::<Versioned>(bytes)
            .map_err(damaged)?
            .version;
        if version != VERSION {
            return Err(format!(
                "the plan has version {version}, this program knows version {VERSION}"
            ));
        }
        let plan: Self = serde_json::from_slice(bytes).map_err(damaged)?;
        if settings_hash(&plan.settings) != plan.settings_blake3 {
            return Err("the settings in the plan do not match their fingerprint".to_owned());
        }
        if !plan.frames.is_sorted_by(|a, b| a.number < b.number) {
            return Err("the frames in the plan are not in ascending order".to_owned());
        }
        Ok(plan)
    }

    pub(crate) fn store(&self, dir: &Path) -> Result<(), JobError> {
        let path = Self::path_in(dir);
        let mut bytes = serde_json::to_vec_pretty(self)
            .map_err(|e| JobError::Request(format!("the plan cannot be written as JSON: {e}")))?;
        bytes.push(b'\n');
        publish(&path, &bytes).map_err(|e| JobError::io(&path, "writing the plan", e))
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
mod tests {
    use super::*;

    fn plan() -> Plan {
        let frame = |number| PlannedFrame {
            number,
            inputs: Vec::new(),
            outputs: vec![format!("f.{number}.exr")],
        };
        Plan::new(
            vec![("a".into(), "1".into())],
            serde_json::json!({ "radius": 0.1_f32, "eye": [1.0e-300, 0.1 + 0.2] }),
            vec![frame(-1), frame(4)],
        )
    }

    #[test]
    fn comes_back_to_the_bit() {
        let dir = tempfile::tempdir().unwrap();
        assert_eq!(Plan::load(dir.path()).unwrap(), None);
        plan().store(dir.path()).unwrap();
        let again = Plan::load(dir.path()).unwrap().unwrap();
        assert_eq!(again, plan());
        assert_eq!(again.frame(4).unwrap().outputs, ["f.4.exr"]);
        assert_eq!(again.frame(3), None);
    }

    #[track_caller]
    fn refused(text: &str, what: &str) {
        let dir = tempfile::tempdir().unwrap();
        fs::write(dir.path().join(PLAN_FILE), text).unwrap();
        let error = Plan::load(dir.path()).unwrap_err().to_string();
        assert!(error.contains(what) && error.contains("--force"), "{error}");
    }

    #[test]
    fn damage_is_an_error() {
        let text = serde_json::to_string(&plan()).unwrap();
        refused("", "no readable plan");
        refused("[]", "no readable plan");
        refused(&text[..text.len() - 9], "no readable plan");
        refused(&text.replace("\"version\":1", "\"version\":9"), "version 9");
        refused(
            &text.replace("[\"a\",\"1\"]", "[\"a\",\"2\"]"),
            "fingerprint",
        );
        refused(&text.replace("\"number\":-1", "\"number\":5"), "ascending");
    }

    #[test]
    fn merge_keeps_order() {
        let mut plan = plan();
        let frame = |number, output: &str| PlannedFrame {
            number,
            inputs: Vec::new(),
            outputs: vec![output.to_owned()],
        };
        plan.merge(vec![frame(9, "new"), frame(4, "other"), frame(0, "new")]);
        let numbers: Vec<i64> = plan.frames().iter().map(|f| f.number).collect();
        assert_eq!(numbers, [-1, 0, 4, 9]);
        assert_eq!(plan.frame(4).unwrap().outputs, ["other"]);
    }
}
