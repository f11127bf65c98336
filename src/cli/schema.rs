//! `spherule schema`: the manifest's JSON schema on standard output.

use super::{CliError, Outcome, print};
use crate::job::schema_text;

pub(super) fn run() -> Result<Outcome, CliError> {
    print::file(&schema_text())?;
    Ok(Outcome::Done)
}
