//! `spherule schema`: the manifest's JSON schema on standard output.

use super::{CliError, Outcome, print};
use crate::manifest::job_schema;

pub(super) fn run() -> Result<Outcome, CliError> {
    print(&schema_text())
}

/// The schema as a file.
pub(super) fn schema_text() -> String {
    format!("{:#}\n", job_schema())
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::Path;

    use super::*;

    #[test]
    fn the_schema_in_the_repository_is_the_programs() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/job.schema.json");
        assert_eq!(
            fs::read_to_string(path).unwrap_or_default(),
            schema_text(),
            "after a change: cargo run -- schema > docs/job.schema.json"
        );
    }
}
