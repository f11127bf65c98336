//! Verdicts for people and for scripts.

use serde_json::{Value, json};

use super::{FrameVerdict, Verdict, Verified};
use crate::cli::print::json_line;
use crate::cli::work::list;

/// All, with their names in JSON and what people are told.
const VERDICTS: [(Verdict, &str, &str); 6] = [
    (Verdict::Sound, "sound", "sound"),
    (Verdict::Damaged, "damaged", "damaged"),
    (Verdict::Missing, "missing", "missing"),
    (Verdict::Length, "length", "of another length"),
    (Verdict::Failed, "failed", "failed when tried"),
    (Verdict::Pending, "pending", "not made yet"),
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
        let line = |file: &Verified| {
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
        all["files"] = self.files.iter().map(Verified::to_json).collect();
        all
    }
}

impl Verified {
    fn to_json(&self) -> Value {
        let mut all = json!({ "path": self.path, "status": self.verdict.name() });
        if let Some(reason) = &self.reason {
            all["reason"] = json!(reason);
        }
        all
    }
}

/// How many frames stand how, and which.
pub(super) fn summary(verdicts: &[(i64, Verdict)]) -> Vec<String> {
    let mut lines = Vec::new();
    for (wanted, _, told) in VERDICTS {
        let these = verdicts.iter().filter(|(_, verdict)| *verdict == wanted);
        let frames: Vec<i64> = these.map(|(frame, _)| *frame).collect();
        if !frames.is_empty() {
            lines.push(format!("{told:<18} {} ({})", frames.len(), list(&frames)));
        }
    }
    lines
}
