//! `spherule render`: a sequence, or the job of a manifest, to images.

use clap::Args;

use super::plan::RunArgs;
use super::work::use_threads;
use super::{CliError, Outcome, events, signals};
use crate::manifest::ProgressMode;

mod arrivals;
mod follow;
pub(super) mod isolate;
mod run;
mod show;

use run::Run;
pub(super) use show::{parts_text, radius_text, tell};

const EXAMPLES: &str = "\
Examples:
  spherule render run1 -o out/frame.####.exr
      All frames of a directory; the same command goes on where it was stopped
  spherule render run1 --frames 1-10x3 --width 640 --height 360 --samples 4
      Every third of the first ten frames, small and quick
  spherule render run1 --color-by density --map turbo --set camera.mode=turntable
      Coloured by an attribute, from a camera that goes around";

#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
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
    if asked.manifest.job.progress == ProgressMode::Json {
        events::begin();
    }
    use_threads(asked.manifest.job.threads)?;
    if asked.manifest.job.follow {
        return follow::run(&args.run.work, asked, &signals);
    }
    let grace = asked.manifest.job.grace;
    let sequence = asked.sequence()?;
    for note in sequence.notes() {
        note!("{note}");
    }
    let mut run = Run::begin(&args.run.work, asked, sequence)?;
    run.tell_kept();
    let interrupt = signals.at_work_within(grace);
    let result = run.make_pending(interrupt);
    Ok(run.end(result, interrupt))
}
