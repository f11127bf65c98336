//! One run of a render job, from opening the job to the reports.

use spherule_formats::Sequence;
use spherule_jobs::{
    FrameEvent, InputChange, Interrupt, Job, JobError, OnFrameEvent, ResumeMode, RunOptions,
    run_frames,
};

use super::follow::{FollowEnd, Follower};
use super::isolate::IsolatedRender;
use super::render_job::{RenderJob, require_one_fits};
use super::{ChildCommand, RunError};
use crate::pipeline::{ImageTask, Overlap, RenderWork, Schedule, Setup};
use crate::report::FrameReport;
use crate::report::job::{self, JobReport};
use crate::survey::Survey;

/// See the module.
#[derive(Debug)]
pub struct RenderRun {
    render_job: RenderJob,
    sequence: Sequence,
    job: Job,
    survey: Survey,
    setup: Setup,
    /// The pending frames.
    tasks: Vec<ImageTask>,
    schedule: Schedule,
    child_command: Option<ChildCommand>,
    notes: Vec<String>,
}

impl RenderRun {
    /// Opens the job: starts or resumes it, resolves the automatic settings, and writes the manifest next to the
    /// images.
    ///
    /// # Errors
    /// Nothing is rendered then. See [`RunError`].
    pub fn open(
        render_job: RenderJob,
        sequence: Sequence,
        mode: ResumeMode,
    ) -> Result<Self, RunError> {
        // Open the job
        render_job.check_output_dir(mode)?;
        render_job.check_manifest_file()?;
        let mut render_job = render_job.resuming(mode)?;
        let (job, device_note) = render_job.open(&sequence, mode)?;
        let mut notes: Vec<String> = job.requeued().iter().map(repeat_note).collect();
        // Schedule the frames with the settings that it has stored
        let (survey, setup) = render_job.stored_setup(job.resolved(), &sequence)?;
        let mut tasks = render_job.tasks(&sequence, &job.pending());
        let schedule = render_job.schedule(&sequence, &setup, &mut tasks);
        require_one_fits(&tasks)?;
        // Write the manifest, and collect what the user should know
        notes.extend(device_note);
        notes.extend(render_job.scene_notes()?);
        notes.extend(render_job.write_manifest(mode)?);
        if schedule.overlap == Overlap::None && tasks.len() > 1 {
            notes.push("one frame at a time, to reduce memory".to_owned());
        }
        Ok(Self {
            render_job,
            sequence,
            job,
            survey,
            setup,
            tasks,
            schedule,
            child_command: None,
            notes,
        })
    }

    /// Sets the command of the child processes that render frames if the manifest sets `job.isolate`. It must call
    /// [`super::isolate::render_task`].
    #[must_use]
    pub fn with_child_command(mut self, command: ChildCommand) -> Self {
        self.child_command = Some(command);
        self
    }

    /// The job and its manifest.
    pub const fn render_job(&self) -> &RenderJob {
        &self.render_job
    }

    /// The job.
    pub const fn job(&self) -> &Job {
        &self.job
    }

    /// The frames of the input.
    pub const fn sequence(&self) -> &Sequence {
        &self.sequence
    }

    /// The survey of the sequence.
    pub const fn survey(&self) -> &Survey {
        &self.survey
    }

    /// The setup of the images.
    pub const fn setup(&self) -> &Setup {
        &self.setup
    }

    /// The number of frames that [`RenderRun::render_pending`] would render.
    pub fn pending_count(&self) -> usize {
        self.tasks.len()
    }

    /// Notes for the user from opening the job.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Renders the pending frames, and records them in the job. Other workers may render some of them. Returns when
    /// all are finished, or after the frames in progress once the interrupt is raised.
    ///
    /// # Errors
    /// The ledger or the images cannot be written, for example because the disk is full. Or `job.isolate` is set
    /// without [`RenderRun::with_child_command`].
    pub fn render_pending(
        &mut self,
        // The frames, and how often one is tried
        interrupt: &Interrupt,
        on_event: OnFrameEvent<'_, FrameReport>,
    ) -> Result<(), RunError> {
        let tasks = std::mem::take(&mut self.tasks);
        let settings = &self.render_job.manifest().job;
        let options = RunOptions {
            frames: tasks.iter().map(|task| task.frame).collect(),
            // Render in child processes, or in stages that overlap
            retries: settings.retries,
            interrupt: interrupt.clone(),
        };
        let result: Result<(), JobError> = if settings.isolate {
            let command = self.child_command.as_ref().ok_or(RunError::NoChildCommand)?;
            let work = IsolatedRender {
                render_job: &self.render_job,
                sequence: &self.sequence,
                images: &tasks,
                resolved: self.job.resolved().clone(),
                command,
            };
            run_frames(&mut self.job, &work, &options, on_event)
        } else {
            let work = RenderWork {
                setup: &self.setup,
                sequence: &self.sequence,
                tasks: &tasks,
                overlap: self.schedule.overlap,
                encoders: self.schedule.encoders,
            };
            run_frames(&mut self.job, &work, &options, on_event)
        };
        Ok(result?)
    }

    /// Adds the frames `new` of a grown `sequence` to the run. Finished frames whose inputs have changed are repeated
    /// and returned.
    ///
    /// # Errors
    /// Those of [`Job::extend`].
    pub fn extend(
        &mut self,
        sequence: Sequence,
        new: &[i64],
    ) -> Result<Vec<InputChange>, RunError> {
        let request = self.render_job.request_for(&sequence, new)?;
        let changes = self.job.extend(&request)?;
        let mut pending = self.job.pending();
        pending.retain(|frame| new.contains(frame));
        self.sequence = sequence;
        self.tasks = self.render_job.tasks(&self.sequence, &pending);
        self.schedule = self.render_job.schedule(&self.sequence, &self.setup, &mut self.tasks);
        Ok(changes)
    }

    /// Renders the pending frames, and then those that `follower` finds, until it ends. `on_frames_added` is called
    /// with the number of frames that were added.
    ///
    /// # Errors
    /// Those of [`RenderRun::render_pending`] and [`RenderRun::extend`].
    pub fn follow(
        &mut self,
        follower: &mut Follower<'_>,
        on_event: OnFrameEvent<'_, FrameReport>,
        mut on_frames_added: impl FnMut(usize),
    ) -> Result<FollowEnd, RunError> {
        loop {
            self.render_pending(&follower.interrupt().clone(), on_event)?;
            self.job.sync()?;
            follower.mark_activity();
            match follower.next()? {
                Ok((sequence, new)) => {
                    for change in self.extend(sequence, &new)? {
                        on_event(FrameEvent::Note(&repeat_note(&change)));
                    }
                    on_frames_added(self.tasks.len());
                }
                Err(end) => return Ok(end),
            }
        }
    }

    /// Reads the state of the job again, which other workers may have changed, and writes the reports.
    ///
    /// # Errors
    /// The files of the job cannot be read, or a report cannot be written.
    pub fn write_reports(&mut self) -> Result<(), RunError> {
        let refreshed = self.job.refresh();
        let report = JobReport::new(self.job.state(), self.render_job.manifest().settings());
        let dir = self.render_job.dir();
        let written = report.files().iter().try_for_each(|(name, text)| {
            job::write(dir, name, text)
                .map_err(RunError::file(&dir.join(name), "cannot be written"))
        });
        // Report the first error: it explains a missing report too
        refreshed?;
        written
    }
}

/// The note for a finished frame whose input has changed.
fn repeat_note(change: &InputChange) -> String {
    format!("{change} since it was rendered; it is rendered again")
}
