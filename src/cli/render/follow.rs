//! `--follow`: renders frames while a simulation writes them.

use spherule_formats::SequenceError;

use super::run::Run;
use crate::cli::job::JobArgs;
use crate::cli::manifest_args::complete;
use crate::cli::signals::SignalListener;
use crate::cli::{CliError, Outcome};
use crate::job::{FollowEnd, Follower, JobManifest};

pub(super) fn run(
    args: &JobArgs,
    mut requested: JobManifest,
    signals: &SignalListener,
) -> Result<Outcome, CliError> {
    if let Some(shard) = args.shard {
        return Err(CliError::other(format!(
            "--shard {shard} does not combine with --follow: the shard of a frame is unknown until the last frame \
             exists; several workers share the frames without it"
        )));
    }
    // Wait for the first complete frames
    let interrupt = signals.start_work_with_grace(requested.manifest.job.grace);
    let on_waiting = |error: &SequenceError| message!("waiting: {error}");
    let mut follower = Follower::new(requested.clone(), interrupt, &on_waiting)?;
    if let Some(stop_file) = follower.earlier_stop_file() {
        note!(
            "{} is from an earlier run and does not end this one; write it again to end it",
            stop_file.display()
        );
    }
    let (mut sequence, _) = match follower.next()? {
        Ok(found) => found,
        Err(FollowEnd::Interrupted) => return Ok(Outcome::Interrupted),
        Err(end) => return Err(CliError::other(format!("found no complete frame: {end}"))),
    };
    // Choose defaults by them, and open the job
    complete(&mut requested, &mut sequence, Some(args.mode()))?;
    follower.keep_parts(requested.manifest.input.parts.clone());
    let mut run = Run::start(args, requested, sequence)?;
    // Render frames as they appear
    Ok(match run.follow(&mut follower) {
        Ok(end) => {
            match &end {
                FollowEnd::Interrupted => {
                    message!("following was interrupted; the same command continues");
                }
                end => message!("following ends: {end}"),
            }
            let outcome = run.end(Ok(()), interrupt);
            match (end, outcome) {
                (FollowEnd::Interrupted, Outcome::Done) => Outcome::Interrupted,
                (_, outcome) => outcome,
            }
        }
        // Frames were rendered, so write the reports
        Err(error) => run.end(Err(error), interrupt),
    })
}
