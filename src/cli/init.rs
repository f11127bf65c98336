//! `spherule init`: a complete, commented manifest on standard output.

use std::io::{self, Write};
use std::path::Path;

use clap::Args;

use super::job::ManifestArgs;
use super::{CliError, Outcome};

#[derive(Debug, Args)]
pub(super) struct InitArgs {
    #[command(flatten)]
    manifest: ManifestArgs,
}

pub(super) fn run(args: &InitArgs) -> Result<Outcome, CliError> {
    let asked = args.manifest.manifest()?;
    let sequence = asked.sequence()?;
    for note in sequence.notes() {
        say!("note: {note}");
    }
    let text = asked.manifest.to_commented_toml();
    match io::stdout().write_all(text.as_bytes()) {
        Err(e) if e.kind() != io::ErrorKind::BrokenPipe => {
            Err(CliError::io(Path::new("standard output"))(e))
        }
        _ => Ok(Outcome::Done),
    }
}
