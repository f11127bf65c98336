//! The error of a manifest: all of its problems, as lines for people.

use std::fmt;
use std::path::Path;

use super::flags::{KeyFlag, key_flags};
use super::problem::{MAX_SHOWN, Place, Problem};

/// All problems of a manifest, one line each.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ManifestError {
    lines: Vec<String>,
    key: Option<String>,
}

impl ManifestError {
    /// One message per problem, in the order of the file.
    pub fn messages(&self) -> &[String] {
        &self.lines
    }

    /// The key of the first message, if it is about one.
    pub fn key(&self) -> Option<&str> {
        self.key.as_deref()
    }
}

impl fmt::Display for ManifestError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.lines.join("\n"))
    }
}

impl std::error::Error for ManifestError {}

impl ManifestError {
    /// One `message` about `key`.
    pub(super) fn of_key(key: &str, message: String) -> Self {
        Self { lines: vec![message], key: Some(key.to_owned()) }
    }

    /// The messages, without a copy.
    pub(super) fn into_messages(self) -> Vec<String> {
        self.lines
    }

    /// Messages in the order of the file; those for options come first.
    pub(super) fn new(mut problems: Vec<Problem>, text: &str, path: &Path) -> Self {
        problems.sort_by_key(|p| match p.place {
            Place::Option(_) => 0,
            Place::Byte(at) => at + 1,
            Place::Nowhere => usize::MAX,
        });
        // The work depends only on the length of the text, not on the number of problems.
        let shown = problems.iter().take(MAX_SHOWN);
        let mut lines: Vec<String> = shown.map(|problem| message(problem, text, path)).collect();
        if problems.len() > MAX_SHOWN {
            lines.push(format!("{}: and more like these", path.display()));
        }
        let key = problems.first().map(|problem| problem.key.clone());
        Self { lines, key: key.filter(|key| !key.is_empty()) }
    }
}

/// Whether the option `shown` names the `key` already, or sets nothing else.
fn is_option_of(shown: &str, key: &str) -> bool {
    let assigned = shown.strip_prefix("--set ").and_then(|set| set.split_once('='));
    let is_flag =
        |flag: &KeyFlag| flag.key == key && shown.strip_prefix("--") == Some(flag.flag.name);
    assigned.is_some_and(|(set, _)| set.trim() == key) || key_flags().iter().any(is_flag)
}

/// Location, key and text of a problem.
fn message(problem: &Problem, text: &str, path: &Path) -> String {
    let place = match &problem.place {
        Place::Option(shown) if is_option_of(shown, &problem.key) => {
            return format!("{shown}: {}", problem.what);
        }
        Place::Option(shown) => shown.clone(),
        Place::Nowhere => path.display().to_string(),
        Place::Byte(at) => {
            let before = text.get(..*at).unwrap_or(text);
            let line = before.matches('\n').count() + 1;
            let column = before.rsplit('\n').next().map_or(0, |l| l.chars().count()) + 1;
            format!("{}: line {line}, column {column}", path.display())
        }
    };
    if problem.key.is_empty() {
        format!("{place}: {}", problem.what)
    } else {
        format!("{place}: {}: {}", problem.key, problem.what)
    }
}
