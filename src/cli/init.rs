//! `spherule init`: a complete, commented manifest on standard output.

use clap::Args;

use super::manifest_args::{ManifestArgs, complete, open_sequence};
use super::{CliError, Outcome, print};

#[derive(Debug, Args)]
pub(super) struct InitArgs {
    #[command(flatten)]
    manifest: ManifestArgs,
}

pub(super) fn run(args: &InitArgs) -> Result<Outcome, CliError> {
    let mut requested = args.manifest.manifest()?;
    let mut sequence = open_sequence(&requested)?;
    for note in sequence.notes() {
        note!("{note}");
    }
    complete(&mut requested, &mut sequence, None)?;
    print::file(&requested.manifest.to_commented_toml())?;
    Ok(Outcome::Done)
}
