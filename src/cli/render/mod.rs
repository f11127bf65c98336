//! `spherule render`: a sequence, or the job of a manifest, to images.

use clap::Args;

use super::plan::RunArgs;
use super::work::use_threads;
use super::{CliError, Outcome, signals};

mod arrivals;
mod follow;
pub(super) mod isolate;
mod run;
mod show;

use run::Run;
pub(super) use show::{parts_text, radius_text};

#[derive(Debug, Args)]
pub(super) struct RenderArgs {
    #[command(flatten)]
    run: RunArgs,
}

const WORDS: signals::Words = signals::Words {
    asked: "stopping after the frame in hand; once more stops at once",
    at_once: "stopped; the same command goes on from here",
};

pub(super) fn run(args: &RenderArgs) -> Result<Outcome, CliError> {
    let signals = signals::listen(WORDS)?;
    let asked = args.run.manifest.manifest()?;
    use_threads(asked.manifest.job.threads)?;
    if asked.manifest.job.follow {
        return follow::run(&args.run.work, asked, &signals);
    }
    let sequence = asked.sequence()?;
    for note in sequence.notes() {
        say!("note: {note}");
    }
    let mut run = Run::begin(&args.run.work, asked, sequence)?;
    run.tell_kept();
    let interrupt = signals.at_work();
    let result = run.make_pending(interrupt);
    Ok(run.end(result, interrupt))
}
