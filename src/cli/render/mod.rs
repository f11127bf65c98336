//! `spherule render`: a sequence, or the job of a manifest, to images.

use std::path::PathBuf;

use clap::Args;

use super::job::{JobArgs, use_threads};
use super::manifest_args::{ManifestArgs, complete, open_sequence};
use super::movie::MovieAfter;
use super::signals::SignalListener;
use super::{CliError, Outcome, events, signals};
use crate::job::JobManifest;
use crate::manifest::ProgressMode;

mod follow;
pub(super) mod isolate;
mod run;
mod summary;

use run::Run;
pub(super) use summary::{
    CELL_HINT, details, parts_text, print_summary, radius_text, sampling_notes, unframed_text,
};

const EXAMPLES: &str = "\
Examples:
  spherule render run1 -o out/frame.####.exr
      All frames of a directory; the same command continues after a stop
  spherule render run1 --frames 1-10x3 --width 640 --height 360 --samples 4
      Every third of the first ten frames, in a small size
  spherule render run1 --color-by density --map turbo --set camera.mode=turntable
      Coloured by an attribute, from a camera that goes around";

/// Arguments of `render` and `check`.
#[derive(Debug, Args)]
pub(super) struct RunArgs {
    #[command(flatten)]
    pub(super) manifest: ManifestArgs,
    #[command(flatten)]
    pub(super) job: JobArgs,
}

#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct RenderArgs {
    #[command(flatten)]
    run: RunArgs,
    /// After the render, write a movie of all frames: .mp4, .mov, .mkv, .webm, .gif, .png or .webp
    ///
    /// 25 frames per second; `spherule movie` has more settings.
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    movie: Option<PathBuf>,
}

const SIGNAL_MESSAGES: signals::SignalMessages = signals::SignalMessages {
    stopping: "stopping after the frames in progress; a second signal stops at once",
    stopped: "stopped; the same command continues",
};

pub(super) fn run(args: &RenderArgs) -> Result<Outcome, CliError> {
    let signals = signals::listen(SIGNAL_MESSAGES)?;
    // Read the options; errors of a movie are found before the render
    let requested = args.run.manifest.manifest()?;
    let settings = requested.manifest.job.clone();
    if settings.progress == ProgressMode::Json {
        events::start();
    }
    use_threads(settings.threads)?;
    let movie = args
        .movie
        .as_deref()
        .map(|path| MovieAfter::new(path, &requested, args.run.job.force))
        .transpose()?;
    // Render, then make the movie of complete frames
    let outcome = if settings.follow {
        follow::run(&args.run.job, requested, &signals)?
    } else {
        run_once(&args.run.job, requested, &signals)?
    };
    match movie {
        Some(movie) if outcome == Outcome::Done => Ok(movie.make(signals.start_work())),
        Some(_) => {
            message!("no movie: not all frames are done");
            Ok(outcome)
        }
        None => Ok(outcome),
    }
}

/// Renders the frames that are there.
fn run_once(
    args: &JobArgs,
    mut requested: JobManifest,
    signals: &SignalListener,
) -> Result<Outcome, CliError> {
    let grace = requested.manifest.job.grace;
    let mut sequence = open_sequence(&requested)?;
    for note in sequence.notes() {
        note!("{note}");
    }
    complete(&mut requested, &mut sequence, Some(args.mode()))?;
    let mut run = Run::start(args, requested, sequence)?;
    let interrupt = signals.start_work_with_grace(grace);
    let result = run.render_pending(interrupt);
    Ok(run.end(result, interrupt))
}
