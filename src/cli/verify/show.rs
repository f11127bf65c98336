//! Verdicts as text and as JSON.

use serde_json::{Value, json};

use super::{FileVerdict, FrameVerdict, Verdict};
use crate::cli::job::list;
use crate::cli::print::json_line;

/// All verdicts with their names in JSON and in text.
const VERDICTS: [(Verdict, &str, &str); 6] = [
    (Verdict::Sound, "sound", "sound"),
    (Verdict::Damaged, "damaged", "damaged"),
    (Verdict::Missing, "missing", "missing"),
    (Verdict::Length, "length", "of another length"),
    (Verdict::Failed, "failed", "failed"),
    (Verdict::Pending, "pending", "pending"),
];

impl Verdict {
    fn name(self) -> &'static str {
        let found = VERDICTS.iter().find(|(verdict, ..)| *verdict == self);
        found.map_or("", |(_, name, _)| name)
    }
}

impl FrameVerdict {
    /// One line of JSON, or a line for each bad file.
    pub(super) fn lines(&self, json: bool) -> Vec<String> {
        if json {
            return vec![json_line(&self.to_json())];
        }
        let line = |file: &FileVerdict| {
            let reason = file.reason.as_deref().unwrap_or_default();
            let (frame, path) = (self.frame, &file.path);
            let verdict = file.verdict.name();
            format!("frame {frame}: {path}: {verdict}: {reason}")
        };
        let bad = self.files.iter().filter(|f| f.verdict != Verdict::Sound);
        bad.map(line).collect()
    }

    fn to_json(&self) -> Value {
        let mut all = json!({ "frame": self.frame, "status": self.verdict.name() });
        if let Some(reason) = &self.reason {
            all["reason"] = json!(reason);
        }
        all["files"] = self.files.iter().map(FileVerdict::to_json).collect();
        all
    }
}

impl FileVerdict {
    fn to_json(&self) -> Value {
        let mut all = json!({ "path": self.path, "status": self.verdict.name() });
        if let Some(reason) = &self.reason {
            all["reason"] = json!(reason);
        }
        all
    }
}

/// The frames by verdict.
pub(super) fn summary(verdicts: &[(i64, Verdict)]) -> Vec<String> {
    let mut lines = Vec::new();
    for (shown, _, text) in VERDICTS {
        let these = verdicts.iter().filter(|(_, verdict)| *verdict == shown);
        let frames: Vec<i64> = these.map(|(frame, _)| *frame).collect();
        if !frames.is_empty() {
            lines.push(format!("{text:<18} {} ({})", frames.len(), list(&frames)));
        }
    }
    lines
}
