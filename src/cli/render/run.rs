//! A render from the opened job to the last word.

use std::time::Instant;

use spherule_formats::Sequence;
use spherule_jobs::{InputChange, Interrupt, Job};

use super::isolate;
use super::show::{show, tell};
use crate::cli::job::Asked;
use crate::cli::plan::{Plan, one_fits};
use crate::cli::progress::Progress;
use crate::cli::work::{Finished, WorkArgs, tell_kept};
use crate::cli::{CliError, Outcome};
use crate::pipeline::{self, Event, ImageTask, Overlap, Schedule, Setup};
use crate::report;

/// See the module.
pub(super) struct Run {
    pub(super) plan: Plan,
    sequence: Sequence,
    pub(super) job: Job,
    setup: Setup,
    /// What is to be done next.
    tasks: Vec<ImageTask>,
    schedule: Schedule,
    progress: Progress,
    start: Instant,
    /// Frames that this run was to make.
    asked: usize,
}

impl Run {
    /// Opens the job over `sequence`, and tells what was decided.
    pub(super) fn begin(
        args: &WorkArgs,
        asked: Asked,
        sequence: Sequence,
    ) -> Result<Self, CliError> {
        let mode = args.mode();
        let plan = Plan::new(asked, &sequence, args.shard)?;
        plan.guard_directory(mode)?;
        plan.guard_manifest()?;
        let job = plan.open(&sequence, mode)?;
        for change in job.requeued() {
            note!("{}", again(change));
        }
        let (survey, setup) = plan.settle(job.resolved(), &sequence)?;
        let mut tasks = plan.tasks(&sequence, &job.pending());
        let schedule = plan.fit(&sequence, &setup, &mut tasks);
        one_fits(&tasks)?;
        plan.write_manifest(args.force || args.keep_done)?;
        tell(&sequence, &survey, &setup);
        if schedule.overlap == Overlap::None && tasks.len() > 1 {
            note!("one frame at a time, to take less memory");
        }
        let progress = Progress::new(
            plan.manifest.job.progress,
            "render",
            tasks.len(),
            &plan.shown_output,
        );
        Ok(Self {
            plan,
            sequence,
            job,
            setup,
            asked: tasks.len(),
            tasks,
            schedule,
            progress,
            start: Instant::now(),
        })
    }

    /// Tells how many frames are done already.
    pub(super) fn tell_kept(&self) {
        tell_kept(&self.job, self.tasks.len());
    }

    /// Takes in the frames `new` of a `sequence` that has grown; they are to be done next. Those that were
    /// finished and have changed since are done again.
    pub(super) fn extend(&mut self, sequence: Sequence, new: &[i64]) -> Result<(), CliError> {
        let request = self.plan.request_for(&sequence, new)?;
        for change in self.job.extend(&request)? {
            self.progress.note(&again(&change));
        }
        let mut pending = self.job.pending();
        pending.retain(|frame| new.contains(frame));
        self.sequence = sequence;
        self.tasks = self.plan.tasks(&self.sequence, &pending);
        self.schedule = self.plan.fit(&self.sequence, &self.setup, &mut self.tasks);
        self.progress.more(self.tasks.len());
        self.asked += self.tasks.len();
        Ok(())
    }

    /// Makes what is to be done next.
    pub(super) fn make_pending(&mut self, interrupt: &Interrupt) -> Result<(), CliError> {
        let progress = &self.progress;
        let watch = |event: Event| show(progress, &event);
        let made = if self.plan.manifest.job.isolate {
            let work = isolate::Work {
                plan: &self.plan,
                tasks: &self.tasks,
            };
            work.run(&mut self.job, interrupt, &watch)
        } else {
            pipeline::run(
                &self.setup,
                &self.sequence,
                &self.tasks,
                self.schedule.overlap,
                &mut self.job,
                interrupt,
                &watch,
            )
        };
        self.tasks.clear();
        Ok(made?)
    }

    /// Writes the reports and has the last word; `result` is what ended the run.
    pub(super) fn end(mut self, result: Result<(), CliError>, interrupt: &Interrupt) -> Outcome {
        let ended = self.progress.finish();
        // Others may have done some of the frames.
        let refreshed = self.job.refresh().map_err(CliError::from);
        let report = report::job::JobReport::new(self.job.state(), &self.plan.manifest);
        let dir = &self.plan.dir;
        let reported = report.files().iter().try_for_each(|(name, text)| {
            report::job::write(dir, name, text).map_err(CliError::io(&dir.join(name)))
        });
        // What ended the run explains why there is no report either.
        let result = result.and(refreshed).and(reported);
        let finished = Finished {
            job: &self.job,
            tasks: self.asked,
            ended,
            start: self.start,
            interrupt,
            output: &self.plan.shown_output,
        };
        finished.tell(result)
    }
}

/// That the file of a finished frame has changed, and what is done about it.
fn again(change: &InputChange) -> String {
    format!("{change} since it was rendered; it is rendered again")
}
