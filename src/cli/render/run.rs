//! One run of a render job, with its messages.

use std::time::Instant;

use spherule_formats::Sequence;
use spherule_jobs::Interrupt;

use super::isolate::COMMAND;
use super::summary::print_summary;
use crate::cli::job::{FinishedRun, JobArgs, report_kept, report_wait};
use crate::cli::progress::Progress;
use crate::cli::{CliError, Outcome};
use crate::job::{ChildCommand, FollowEnd, Follower, JobManifest, RenderJob, RenderRun, RunError};

/// See the module.
pub(super) struct Run {
    run: RenderRun,
    progress: Progress,
    start: Instant,
    /// Number of frames that were pending in this run.
    task_count: usize,
}

impl Run {
    /// Opens the job of `sequence`, and prints a summary of the resolved settings.
    pub(super) fn start(
        args: &JobArgs,
        requested: JobManifest,
        sequence: Sequence,
    ) -> Result<Self, CliError> {
        let mode = args.mode();
        let job = RenderJob::new(requested, &sequence, args.shard)?;
        // Refuse before the survey is announced; `RenderRun::open` checks again, for callers of the library
        job.check_output_dir(mode)?;
        job.check_manifest_file()?;
        let job = job.resuming(mode)?;
        if job.needs_survey(mode)? {
            message!("surveying the sequence");
            report_wait(job.dir(), job.manifest().job.takeover_after)?;
        }
        // Open the job; frames may be rendered in child processes of this program
        let command = ChildCommand::own_program([COMMAND])
            .map_err(|e| CliError::other(format!("spherule: {e}")))?;
        let run = RenderRun::open(job, sequence, mode)?.with_child_command(command);
        for note in run.notes() {
            note!("{note}");
        }
        // Show what was decided before the first frame
        print_summary(run.sequence(), run.survey(), run.setup());
        let task_count = run.pending_count();
        let progress = Progress::new(
            run.render_job().manifest().job.progress,
            "render",
            task_count,
            run.render_job().shown_output(),
        );
        report_kept(run.job(), task_count);
        Ok(Self { run, progress, start: Instant::now(), task_count })
    }

    /// Renders the pending frames.
    pub(super) fn render_pending(&mut self, interrupt: &Interrupt) -> Result<(), RunError> {
        let progress = &self.progress;
        self.run.render_pending(interrupt, &|event| progress.show(&event))
    }

    /// Renders the pending frames, and then those that `follower` finds.
    pub(super) fn follow(&mut self, follower: &mut Follower<'_>) -> Result<FollowEnd, RunError> {
        let (progress, task_count) = (&self.progress, &mut self.task_count);
        self.run.follow(follower, &|event| progress.show(&event), |count| {
            progress.add_frames(count);
            *task_count += count;
        })
    }

    /// Writes and prints the reports. `result` is the error that ended the run, if any.
    pub(super) fn end(mut self, result: Result<(), RunError>, interrupt: &Interrupt) -> Outcome {
        let frames = self.progress.finish();
        let written = self.run.write_reports();
        // Report the first error: it explains a missing report too
        let result = result.and(written);
        let finished = FinishedRun {
            job: self.run.job(),
            task_count: self.task_count,
            frames,
            start: self.start,
            interrupt,
            output: self.run.render_job().shown_output(),
        };
        finished.report(result)
    }
}
