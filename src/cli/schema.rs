//! `spherule schema`: the manifest's JSON schema on standard output.

use std::path::Path;

use serde_json::Value;
use spherule_jobs::read_regular_text;

use super::{CliError, Outcome, print};
use crate::manifest::job_schema;

pub(super) fn run() -> Result<Outcome, CliError> {
    print::file(&schema_text())?;
    Ok(Outcome::Done)
}

/// The schema as a file.
pub(super) fn schema_text() -> String {
    format!("{:#}\n", job_schema())
}

/// Whether the file at `path` is such a schema, of this version or another.
pub(super) fn is_schema(path: &Path) -> bool {
    let text = read_regular_text(path, MAX_BYTES).unwrap_or_default();
    let title = |text: &str| -> Option<Value> {
        let schema: Value = serde_json::from_str(text).ok()?;
        schema.get("title").cloned()
    };
    title(&text).is_some_and(|found| job_schema().get("title") == Some(&found))
}

/// Many times what a schema has.
const MAX_BYTES: u64 = 16 << 20;

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn schema_in_the_repository_is_current() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/job.schema.json");
        assert_eq!(
            fs::read_to_string(path).unwrap_or_default(),
            schema_text(),
            "after a change: cargo run -- schema > docs/job.schema.json"
        );
    }
}
