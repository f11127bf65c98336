//! What differs between the plan of a job and a request.

use std::fmt;
use std::path::PathBuf;

/// A setting that differs from the one in the plan.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SettingChange {
    /// Dotted key.
    pub key: String,
    /// Value in the plan, if it was set.
    pub old: Option<String>,
    /// Value of this request, if it is set.
    pub new: Option<String>,
}

impl fmt::Display for SettingChange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let show = |value: &Option<String>| value.clone().unwrap_or_else(|| "(not set)".to_owned());
        write!(f, "{}: {} -> {}", self.key, show(&self.old), show(&self.new))
    }
}

/// An input file of a finished frame that has changed since.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct InputChange {
    /// The frame.
    pub frame: i64,
    /// The file.
    pub path: PathBuf,
    /// The difference.
    pub what: String,
}

impl fmt::Display for InputChange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "frame {}: {}: {}", self.frame, self.path.display(), self.what)
    }
}
