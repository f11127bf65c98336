//! One run of a render job, from opening the job to the reports.

use std::time::Instant;

use spherule_formats::Sequence;
use spherule_jobs::{InputChange, Interrupt, Job};

use super::isolate;
use super::summary::{print_summary, show_event};
use crate::cli::job::{FinishedRun, JobArgs, report_kept};
use crate::cli::manifest_args::RequestedManifest;
use crate::cli::progress::Progress;
use crate::cli::render_job::{RenderJob, require_one_fits};
use crate::cli::{CliError, Outcome};
use crate::pipeline::{self, Event, ImageTask, Overlap, Schedule, Setup};
use crate::report;

/// See the module.
pub(super) struct Run {
    pub(super) render_job: RenderJob,
    sequence: Sequence,
    pub(super) job: Job,
    setup: Setup,
    /// The pending frames.
    tasks: Vec<ImageTask>,
    schedule: Schedule,
    progress: Progress,
    start: Instant,
    /// Number of frames that were pending in this run.
    task_count: usize,
}

impl Run {
    /// Opens the job of `sequence`, and prints a summary of the resolved settings.
    pub(super) fn start(
        args: &JobArgs,
        requested: RequestedManifest,
        sequence: Sequence,
    ) -> Result<Self, CliError> {
        let mode = args.mode();
        let render_job = RenderJob::new(requested, &sequence, args.shard)?;
        render_job.guard_directory(mode)?;
        render_job.guard_manifest()?;
        let job = render_job.open(&sequence, mode)?;
        for change in job.requeued() {
            note!("{}", repeat_note(change));
        }
        let (survey, setup) = render_job.stored_setup(job.resolved(), &sequence)?;
        let mut tasks = render_job.tasks(&sequence, &job.pending());
        let schedule = render_job.fit(&sequence, &setup, &mut tasks);
        require_one_fits(&tasks)?;
        render_job.write_manifest(args.force || args.keep_done)?;
        print_summary(&sequence, &survey, &setup);
        if schedule.overlap == Overlap::None && tasks.len() > 1 {
            note!("one frame at a time, to reduce memory");
        }
        let progress = Progress::new(
            render_job.manifest.job.progress,
            "render",
            tasks.len(),
            &render_job.shown_output,
        );
        Ok(Self {
            render_job,
            sequence,
            job,
            setup,
            task_count: tasks.len(),
            tasks,
            schedule,
            progress,
            start: Instant::now(),
        })
    }

    /// Reports how many frames are done already.
    pub(super) fn report_kept(&self) {
        report_kept(&self.job, self.tasks.len());
    }

    /// Adds the frames `new` of a grown `sequence` to the run. Finished frames whose inputs have changed are repeated.
    pub(super) fn extend(&mut self, sequence: Sequence, new: &[i64]) -> Result<(), CliError> {
        let request = self.render_job.request_for(&sequence, new)?;
        for change in self.job.extend(&request)? {
            self.progress.note(&repeat_note(&change));
        }
        let mut pending = self.job.pending();
        pending.retain(|frame| new.contains(frame));
        self.sequence = sequence;
        self.tasks = self.render_job.tasks(&self.sequence, &pending);
        self.schedule = self
            .render_job
            .fit(&self.sequence, &self.setup, &mut self.tasks);
        self.progress.add_frames(self.tasks.len());
        self.task_count += self.tasks.len();
        Ok(())
    }

    /// Renders the pending frames.
    pub(super) fn render_pending(&mut self, interrupt: &Interrupt) -> Result<(), CliError> {
        let progress = &self.progress;
        let on_event = |event: Event| show_event(progress, &event);
        let result = if self.render_job.manifest.job.isolate {
            let work = isolate::IsolatedRender {
                render_job: &self.render_job,
                tasks: &self.tasks,
            };
            work.run(&mut self.job, interrupt, &on_event)
        } else {
            pipeline::run(
                &self.setup,
                &self.sequence,
                &self.tasks,
                self.schedule.overlap,
                &mut self.job,
                interrupt,
                &on_event,
            )
        };
        self.tasks.clear();
        Ok(result?)
    }

    /// Writes and prints the reports. `result` is the error that ended the run, if any.
    pub(super) fn end(mut self, result: Result<(), CliError>, interrupt: &Interrupt) -> Outcome {
        let frames = self.progress.finish();
        // Other workers may have finished some of the frames
        let refreshed = self.job.refresh().map_err(CliError::from);
        let report = report::job::JobReport::new(self.job.state(), &self.render_job.manifest);
        let dir = &self.render_job.dir;
        let written = report.files().iter().try_for_each(|(name, text)| {
            report::job::write(dir, name, text).map_err(CliError::io(&dir.join(name)))
        });
        // Report the first error: it explains a missing report too
        let result = result.and(refreshed).and(written);
        let finished = FinishedRun {
            job: &self.job,
            tasks: self.task_count,
            frames,
            start: self.start,
            interrupt,
            output: &self.render_job.shown_output,
        };
        finished.report(result)
    }
}

/// The note for a finished frame whose input has changed.
fn repeat_note(change: &InputChange) -> String {
    format!("{change} since it was rendered; it is rendered again")
}
